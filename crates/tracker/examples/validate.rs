//! The eight scenes by many seeds, without settings and without a file between: discover, track, score. Prints the
//! table of `docs/validation.md`.
//!
//! `cargo run --release --workspace --example validate -- [--seeds A..B] [--scenes a,b,...] [--rows]`

#![allow(clippy::print_stdout, reason = "what it prints is its result")]

use std::process::ExitCode;
use std::sync::Arc;

use anyhow::{Context, Result, bail};
use rayon::prelude::*;
use tracker::detect::{DetectSettings, Detector, Levels};
use tracker::discover::discover;
use tracker::film::{Film, PRESETS, Truth, preset};
use tracker::frame::FrameSource;
use tracker::rig::Rig;
use tracker::score::{LIMIT_PX, Score, Tracked, score};
use tracker::source::synthetic::SyntheticSource;
use tracker::store::{DetectionStore, FrameStamp};
use tracker::track::track_recording;

/// Frames whose detections are learned from, as in `pipeline`.
const SAMPLES: usize = 12;

struct Outcome {
    score: Score,
    rig_right: bool,
}

/// One film through detection, discovery and tracking.
fn run(scene: &str, seed: u64) -> Result<Outcome> {
    let film = Arc::new(Film::new(&preset(scene, seed)?)?);
    let mut source = SyntheticSource::of(film.clone());
    let settings = DetectSettings::default();
    let levels = Arc::new(Levels::learn(&source.sample(SAMPLES)?, &settings)?);
    let mut detector = Detector::new(levels, &settings)?;
    let mut store = DetectionStore::new();
    let mut detections = Vec::new();
    while let Some(frame) = source.next_frame()? {
        detector.detect(&frame, &mut detections)?;
        store.push(FrameStamp { index: frame.index, ticks: frame.ticks, decoded: true }, &detections)?;
    }
    let rig = discover(&store, film.scene().image_px)?.rig;
    let mut tracked =
        Tracked { nodes: rig.nodes.iter().map(|n| n.name.clone()).collect(), ..Tracked::default() };
    track_recording(&store, &rig, &mut |stamp, row| {
        tracked.frames.push(stamp.index);
        for o in row {
            tracked.xy_px.push([o.x_px, o.y_px]);
            tracked.sigma_px.push(o.sigma_px);
        }
        Ok(())
    })?;
    let score = score(&tracked, &Truth::of(&film), LIMIT_PX)?;
    let rig_right = same_rig(&rig, &score, &film);
    Ok(Outcome { score, rig_right })
}

/// Whether the rig has every marker and no other, each in a body with those of its link and no other.
fn same_rig(rig: &Rig, score: &Score, film: &Film) -> bool {
    let link = |name: &str| film.scene().markers.iter().find(|m| m.name == name).map(|m| m.link.as_str());
    let pairs: Vec<_> = rig
        .nodes
        .iter()
        .zip(&score.matches)
        .map(|(n, m)| (n.body.as_str(), m.truth.as_deref().and_then(link)))
        .collect();
    score.unmatched.is_empty()
        && pairs.iter().all(|p| p.1.is_some())
        && pairs.iter().all(|p| pairs.iter().all(|q| (p.0 == q.0) == (p.1 == q.1)))
        && rig.bodies.len() == film.scene().links.len()
}

fn arguments() -> Result<(Vec<u64>, Vec<String>, bool)> {
    let (mut seeds, mut scenes, mut rows) = ((0..20).collect(), PRESETS.map(String::from).to_vec(), false);
    let mut given = std::env::args().skip(1);
    while let Some(word) = given.next() {
        match word.as_str() {
            "--seeds" => {
                let range = given.next().context("--seeds needs A..B")?;
                let (a, b) = range.split_once("..").context("--seeds needs A..B")?;
                seeds = (a.parse()?..b.parse()?).collect();
            }
            "--scenes" => {
                let list = given.next().context("--scenes needs names")?;
                scenes = list.split(',').map(String::from).collect();
            }
            "--rows" => rows = true,
            other => bail!("{other} is not known; there are --seeds A..B, --scenes a,b and --rows"),
        }
    }
    Ok((seeds, scenes, rows))
}

fn main() -> Result<ExitCode> {
    let (seeds, scenes, rows) = arguments()?;
    let mut flawless = true;
    println!(
        "| scene | films | rig right | coverage, least and mean | wrong | switches | false | back at once | within 3 | \
         longest wait | RMS x, y px | error / sigma | angles deg |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    for scene in &scenes {
        let outcomes: Vec<(u64, Result<Outcome>)> =
            seeds.par_iter().map(|&seed| (seed, run(scene, seed))).collect();
        let mut good = Vec::new();
        for (seed, outcome) in outcomes {
            match outcome {
                Ok(o) => {
                    let s = &o.score;
                    if rows || !o.rig_right || s.wrong + s.switches + s.false_positives > 0 {
                        eprintln!(
                            "{scene} {seed}: rig {} coverage {:.5} wrong {} switches {} false {} back {:?} {:?}",
                            o.rig_right,
                            s.coverage,
                            s.wrong,
                            s.switches,
                            s.false_positives,
                            s.reacquisition,
                            s.first_wrong.first()
                        );
                    }
                    good.push(o);
                }
                Err(e) => {
                    flawless = false;
                    eprintln!("{scene} {seed}: {e:#}");
                }
            }
        }
        flawless &= good.iter().all(|o| o.rig_right && o.score.wrong + o.score.switches == 0);
        println!("{}", line(scene, seeds.len(), &good));
    }
    Ok(ExitCode::from(u8::from(!flawless)))
}

/// One line of the table.
fn line(scene: &str, films: usize, good: &[Outcome]) -> String {
    let sum = |f: fn(&Score) -> u64| good.iter().map(|o| f(&o.score)).sum::<u64>();
    let rms = |f: fn(&Score) -> f64| {
        (good.iter().map(|o| f(&o.score).powi(2)).sum::<f64>() / good.len() as f64).sqrt()
    };
    let least = good.iter().map(|o| o.score.coverage).fold(f64::INFINITY, f64::min);
    let rows = sum(|s| s.visible_rows).max(1) as f64;
    let cases = sum(|s| s.reacquisition.cases);
    let angles: Vec<String> = (0..good.first().map_or(0, |o| o.score.angles.len()))
        .map(|k| {
            let squares = good.iter().filter_map(|o| o.score.angles.get(k)).map(|a| a.rms_deg.powi(2));
            format!("{:.4}", (squares.sum::<f64>() / good.len() as f64).sqrt())
        })
        .collect();
    format!(
        "| {scene} | {films} | {} | {:.4} %, {:.4} % | {} | {} | {} | {} of {cases} | {} | {} | {:.4}, {:.4} | {:.3} | {} |",
        good.iter().filter(|o| o.rig_right).count(),
        100.0 * least,
        100.0 * sum(|s| s.covered_rows) as f64 / rows,
        sum(|s| s.wrong),
        sum(|s| s.switches),
        sum(|s| s.false_positives),
        sum(|s| s.reacquisition.at_once),
        sum(|s| s.reacquisition.within_3),
        good.iter().map(|o| o.score.reacquisition.longest).max().unwrap_or(0),
        rms(|s| s.rms_x_px),
        rms(|s| s.rms_y_px),
        rms(|s| s.error_over_sigma.unwrap_or(f64::NAN)),
        angles.join(", "),
    )
}
