//! The eight scenes by many seeds, without settings and without a file between: discover, track, score. Prints the
//! tables of `docs/validation/identity.md`, of the tracker and, on the same detections, of the paper's own method.
//!
//! `cargo build --release --workspace --locked --example validate`, then
//! `target/release/examples/validate [--seeds A..B] [--scenes a,b,...] [--view TILT,TOWARDS,K1,HEIGHT]
//! [--rows] [--write FILE]`
//!
//! `--view` gives every scene another camera: tilt and its direction in deg, the lens's k1, the height of a pixel. A scene may be
//! one of the other mechanisms too.
//!
//! `--rows` lists every film and every row that should have been given and was not. `--write` puts the tables
//! between the two comment lines of FILE that name them.

#![allow(clippy::print_stdout, reason = "what it prints is its result")]

mod films;
mod paper;

use std::fmt::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use films::{Filmed, Followed};
use rayon::prelude::*;
use tracker::observation::Status;
use tracker::score::{FULL, HALF, LIMIT_PX, Score, Tracked};
use tracker::synth::{NodeTruth, PRESETS, View, preset};

struct Outcome {
    score: Score,
    rig_right: bool,
    /// Score of the paper's method on the same detections.
    paper: Option<Score>,
    /// Rows that were missed, a line each.
    missed: Vec<String>,
}

/// One film through detection, discovery and tracking.
fn run(scene: &str, seed: u64, view: Option<View>) -> Result<Outcome> {
    let mut scene = preset(scene, seed)?;
    scene.camera.view = view;
    let filmed = Filmed::of(&scene)?;
    let Followed { tracked, status, score, rig_right } = filmed.follow()?;
    let whole = filmed.truth.frames.iter().position(|f| f.nodes.iter().all(|n| n.visible >= FULL));
    let paper = match whole {
        Some(start) => {
            let told = paper::follow(&filmed.store, &filmed.film.rig(start as u64), start);
            let mut s = tracker::score::score(&told, &filmed.truth, LIMIT_PX)?;
            // The frames before its start are visible rows that it does not give.
            s.visible_rows = score.visible_rows;
            s.coverage = s.covered_rows as f64 / s.visible_rows.max(1) as f64;
            Some(s)
        }
        None => None,
    };
    let missed = missed(&filmed, &score, &tracked, &status);
    Ok(Outcome { score, rig_right, paper, missed })
}

/// Rows given where nothing is seen, and rows of markers at least half visible in which the node is not at its place,
/// with what was detected nearest.
fn missed(filmed: &Filmed, score: &Score, tracked: &Tracked, status: &[Status]) -> Vec<String> {
    let n = tracked.nodes.len();
    let mut out = Vec::new();
    let mut detections = Vec::new();
    for (t, frame) in filmed.truth.frames.iter().enumerate() {
        for k in 0..n {
            let [x, y] = tracked.xy_px[t * n + k];
            let own = filmed.truth.nodes.iter().position(|m| score.matches[k].truth.as_ref() == Some(&m.0));
            let seen = |m: &NodeTruth| m.visible > 0.0 && (x - m.x_px).hypot(y - m.y_px) <= LIMIT_PX;
            if let (true, Some(j)) = (x.is_finite() && !frame.nodes.iter().any(seen), own) {
                let m = &frame.nodes[j];
                out.push(format!(
                    "    {} frame {t} given at {x:.1}, {y:.1} sigma {:.3} {} where {:.2} of it is seen {:.2} px off",
                    filmed.truth.nodes[j].0,
                    tracked.sigma_px[t * n + k],
                    status[t * n + k].as_str(),
                    m.visible,
                    (x - m.x_px).hypot(y - m.y_px),
                ));
            }
        }
    }
    for (j, (name, _)) in filmed.truth.nodes.iter().enumerate() {
        let Some(k) = score.matches.iter().position(|m| m.truth.as_ref() == Some(name)) else { continue };
        for (t, frame) in filmed.truth.frames.iter().enumerate() {
            let m = &frame.nodes[j];
            let off = |x: f64, y: f64| (x - m.x_px).hypot(y - m.y_px);
            let [x, y] = tracked.xy_px[t * n + k];
            if m.visible < HALF || off(x, y) <= LIMIT_PX {
                continue;
            }
            filmed.store.read(t, &mut detections);
            let near = detections.iter().min_by(|a, b| off(a.x_px, a.y_px).total_cmp(&off(b.x_px, b.y_px)));
            out.push(format!(
                "    {name} frame {t} visible {:.2} {} at {:.1}, {:.1}; nearest {}",
                m.visible,
                status[t * n + k].as_str(),
                m.x_px,
                m.y_px,
                near.map_or("none".into(), |d| format!(
                    "{:.2} px off, area {:.0}, sigma {:.3}, flags {}",
                    off(d.x_px, d.y_px),
                    d.area_px,
                    d.sigma_px,
                    d.flags.0
                ))
            ));
        }
    }
    out
}

struct Arguments {
    seeds: Vec<u64>,
    scenes: Vec<String>,
    view: Option<View>,
    rows: bool,
    write: Option<PathBuf>,
}

fn arguments() -> Result<Arguments> {
    let mut out = Arguments {
        seeds: (0..20).collect(),
        scenes: PRESETS.map(String::from).to_vec(),
        view: None,
        rows: false,
        write: None,
    };
    let mut given = std::env::args().skip(1);
    while let Some(word) = given.next() {
        match word.as_str() {
            "--seeds" => {
                let range = given.next().context("--seeds needs A..B")?;
                let (a, b) = range.split_once("..").context("--seeds needs A..B")?;
                out.seeds = (a.parse()?..b.parse()?).collect();
            }
            "--scenes" => {
                let list = given.next().context("--scenes needs names")?;
                out.scenes = list.split(',').map(String::from).collect();
            }
            "--view" => {
                let list = given.next().context("--view needs TILT,TOWARDS,K1,HEIGHT")?;
                let numbers: Vec<f64> = list.split(',').map(str::parse).collect::<Result<_, _>>()?;
                let [tilt_deg, towards_deg, k1, pixel_height] = numbers[..] else {
                    bail!("--view needs TILT,TOWARDS,K1,HEIGHT, not {list}")
                };
                out.view = Some(View { tilt_deg, towards_deg, k1, pixel_height, ..View::default() });
            }
            "--rows" => out.rows = true,
            "--write" => out.write = Some(given.next().context("--write needs a file")?.into()),
            other => {
                bail!(
                    "{other} is not known; there are --seeds A..B, --scenes a,b, --view, --rows and --write FILE"
                )
            }
        }
    }
    Ok(out)
}

const OURS: &str = "| scene | films | rig right | coverage, least and mean | wrong | switches | false | back at once | \
                    within 3 | longest wait | RMS x, y px | error / sigma | angles deg |\n\
                    |---|---|---|---|---|---|---|---|---|---|---|---|---|\n";
const PAPER: &str = "| scene | films | coverage, least and mean | wrong | switches | false | back at once |\n\
                     |---|---|---|---|---|---|---|\n";

fn main() -> Result<ExitCode> {
    let given = arguments()?;
    let mut flawless = true;
    let (mut ours, mut papers) = (String::from(OURS), String::from(PAPER));
    for scene in &given.scenes {
        let outcomes: Vec<(u64, Result<Outcome>)> =
            given.seeds.par_iter().map(|&seed| (seed, run(scene, seed, given.view))).collect();
        let mut good = Vec::new();
        for (seed, outcome) in outcomes {
            match outcome {
                Ok(o) => {
                    tell(scene, seed, &o, given.rows);
                    good.push(o);
                }
                Err(e) => {
                    flawless = false;
                    eprintln!("{scene} {seed}: {e:#}");
                }
            }
        }
        flawless &= good
            .iter()
            .all(|o| o.rig_right && o.score.wrong + o.score.switches + o.score.false_positives == 0);
        writeln!(ours, "{}", line(scene, given.seeds.len(), &good))?;
        writeln!(papers, "{}", paper_line(scene, &good))?;
        eprintln!("{scene}: done");
    }
    println!("{ours}\n{papers}");
    if let Some(file) = &given.write {
        let text = std::fs::read_to_string(file).with_context(|| file.display().to_string())?;
        let text = replaced(&replaced(&text, "scenes", &ours)?, "paper", &papers)?;
        std::fs::write(file, text).with_context(|| file.display().to_string())?;
    }
    Ok(ExitCode::from(u8::from(!flawless)))
}

/// The text with what lies between `<!-- name -->` and `<!-- /name -->` replaced.
fn replaced(text: &str, name: &str, by: &str) -> Result<String> {
    let (open, close) = (format!("<!-- {name} -->\n"), format!("<!-- /{name} -->"));
    let start = text.find(&open).with_context(|| format!("there is no line {open:?}"))? + open.len();
    let end = text[start..].find(&close).with_context(|| format!("there is no line {close:?}"))? + start;
    Ok(format!("{}{by}{}", &text[..start], &text[end..]))
}

fn tell(scene: &str, seed: u64, o: &Outcome, rows: bool) {
    let s = &o.score;
    if rows || !o.rig_right || s.wrong + s.switches + s.false_positives > 0 {
        eprintln!(
            "{scene} {seed}: rig {} coverage {:.5} wrong {} switches {} false {} back {:?} {:?}",
            o.rig_right, s.coverage, s.wrong, s.switches, s.false_positives, s.reacquisition, s.first_wrong
        );
    }
    if rows {
        o.missed.iter().for_each(|m| eprintln!("{m}"));
    }
}

/// One line of the tracker's table.
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

/// One line of the table of the paper's method.
fn paper_line(scene: &str, good: &[Outcome]) -> String {
    let told: Vec<&Score> = good.iter().filter_map(|o| o.paper.as_ref()).collect();
    let sum = |f: fn(&Score) -> u64| told.iter().map(|&s| f(s)).sum::<u64>();
    let least = told.iter().map(|s| s.coverage).fold(f64::INFINITY, f64::min);
    format!(
        "| {scene} | {} | {:.2} %, {:.2} % | {} | {} | {} | {} of {} |",
        told.len(),
        100.0 * least,
        100.0 * sum(|s| s.covered_rows) as f64 / sum(|s| s.visible_rows).max(1) as f64,
        sum(|s| s.wrong),
        sum(|s| s.switches),
        sum(|s| s.false_positives),
        sum(|s| s.reacquisition.at_once),
        sum(|s| s.reacquisition.cases),
    )
}
