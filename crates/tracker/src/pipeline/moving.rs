//! Follows what moves where no markers stand out, or what a user pointed at.
//!
//! Owns: [`applies`], [`comes_first`], [`is_wanted`], [`check`], [`run`], [`run_first`]. Must not: find anything itself; `moving` does.

use std::sync::atomic::Ordering;

use super::candidates::{Candidates, words};
use super::moving_doubts::SURE_CONFIDENCE;
use super::moving_nodes::{Chosen, Moving};
use super::observer::{Observer, Stage};
use super::opening::{Attended, on_threads, open};
use super::pointed::{Columns, pointed};
use super::request::fits;
use super::settings::RunSettings;
use super::summary::RunSummary;
use super::unclear::{Found, LEAST_CONFIDENCE, Unclear, candidates, point_at};
use crate::detect::{Centroid, DetectSettings, Threshold};
use crate::error::{Error, Fault, Result};
use crate::frame::SourceInfo;
use crate::message::Setting;
use crate::moving::{Against, Limits, Marker, Search, Survey, WorkFilm, finish, survey};
use crate::rig::Rig;
use crate::source::{self, OpenOptions};
use crate::table::{NodeSummary, RunEnding, SourceFacts};
use crate::wanted::{Pointed, Wanted};

/// Part of the decoded frames in which one marker at least must be seen for the rig to be believed.
const LEAST_SEEN: f64 = 0.5;

/// Outcome of looking at what moves.
pub(super) enum Outcome {
    /// A moving thing is followed.
    Followed(Box<RunSummary>),
    /// Why nothing is named, and the way on.
    Unclear(Unclear),
}

/// Whether what moves may be followed in place of markers: only where no more was said of how markers look than where they are
/// and whether they are bright, and a rig that was given has no lens.
pub(super) fn applies(settings: &RunSettings) -> bool {
    is_understood(&settings.detect)
        && settings.detect.threshold == Threshold::Auto
        && settings.rig.as_ref().is_none_or(|r| r.lens.is_none())
        && !source::is_read_once(&settings.input)
}

/// Whether what moves is looked at first where there is clutter.
pub(super) fn comes_first(settings: &RunSettings) -> bool {
    settings.rig.is_none() && applies(settings)
}

/// Looks at what moves in a recording that can be read; where it is too long for that, that is why it is unclear.
///
/// # Errors
/// Those of [`run`] but for the source's.
pub(super) fn run_first(settings: &RunSettings, observer: &mut dyn Observer) -> Result<Outcome> {
    match run(settings, false, observer) {
        Err(Error::Source(fault)) => {
            Ok(Outcome::Unclear(Unclear::new(fault.problem.to_string(), fault.advice)))
        }
        outcome => outcome,
    }
}

/// Whether no more was said of detection than region, polarity and threshold.
fn is_understood(detect: &DetectSettings) -> bool {
    let said = DetectSettings {
        region: None,
        polarity: None,
        threshold: Threshold::Auto,
        pixel_aspect: DetectSettings::default().pixel_aspect,
        ..detect.clone()
    };
    said == DetectSettings::default()
}

/// Refuses what cannot be done where something is named that only moves.
pub(super) fn check(settings: &RunSettings) -> Result<()> {
    let asked = settings.asked();
    let setting = match (asked.marker.is_empty(), asked.also.is_empty()) {
        (false, _) => Setting::Marker,
        (true, false) => Setting::Also,
        (true, true) => Setting::Same,
    };
    let refuse =
        |problem: &str, advice: &str| Err(Error::Argument(Fault::of(setting, problem).advice(advice)));
    if source::is_read_once(&settings.input) {
        return refuse("it is looked for in the whole recording, which can be read once only", "Give a file");
    }
    if !is_understood(&settings.detect) {
        let what = match settings.detect.centroid {
            Centroid::Disc => "limits of area and lenses",
            Centroid::Weighted => "centres by intensity",
            Centroid::Contour => "contours",
        };
        return refuse(
            &format!("{what} are for markers that stand out, not for what moves"),
            "Leave one of them out",
        );
    }
    if settings.rig.as_ref().is_some_and(|r| r.lens.is_some()) {
        return refuse(
            "the rig has a lens, and what moves is followed as the picture shows it",
            "Leave one of them out",
        );
    }
    Ok(())
}

/// Whether markers were not found, or are seen in so few frames or change their size so much that what was taken for them is
/// something else.
pub(super) fn is_wanted(markers: &Result<RunSummary>) -> bool {
    match markers {
        Ok(summary) => {
            let doubtful = |n: &NodeSummary| is_seldom(n) || summary.doubtful.contains(&n.node);
            summary.meta.ending != RunEnding::Interrupted && summary.nodes.iter().all(doubtful)
        }
        Err(error) => matches!(error, Error::Detect(_) | Error::Rig(_)),
    }
}

/// Whether a node is seen in so few of the decoded frames that it may be no marker, or not all of one.
pub(super) fn is_seldom(n: &NodeSummary) -> bool {
    let rows = n.seen + n.missing + n.ambiguous;
    rows == 0 || (n.seen as f64) < LEAST_SEEN * rows as f64
}

/// Follows what moves in a recording and writes the table, if it is clear what is meant. The observer is told what else was
/// found. With `only_whole` a rig's nodes are followed only if each of them can be: the markers that stand out are a result already.
///
/// # Errors
/// Those of reading, and of the table; [`Error::Argument`] for what was pointed at and is not there; [`Error::Interrupted`] if
/// the observer asks to stop.
pub(super) fn run(settings: &RunSettings, only_whole: bool, observer: &mut dyn Observer) -> Result<Outcome> {
    let options = OpenOptions { colour: true, ..settings.open.clone() };
    let mut source = open(&settings.input, &options, observer)?;
    let info = source.info().clone();
    let facts = SourceFacts::of(&info, &source::files(&settings.input)?)?;
    if let Some(edits) = &settings.edits {
        edits.belongs(&facts)?;
    }
    let wanted = settings.asked().clone();
    wanted.check([facts.width, facts.height])?;
    if let Some(rig) = &settings.rig {
        fits(rig, &facts)?;
    }
    let frames = settings.frames.clone().unwrap_or(0..u64::MAX);
    let total = facts.declared_frames.map(|n| n.min(frames.end).saturating_sub(frames.start));
    observer.stage(Stage::Moving, total);
    let attended = Attended::default();
    let found = attended.run(
        observer,
        |o| o.interrupted(),
        |attended| {
            let mut tell =
                |index: u64| attended.done.store(index.saturating_sub(frames.start), Ordering::Relaxed);
            let film = WorkFilm::read(source.as_mut(), frames.clone(), &attended.stop, &mut tell)?;
            let limits = limits(settings, &info, film.shrink());
            on_threads(settings.threads, || {
                let rig = settings.rig.as_ref().map(|rig| (rig, only_whole));
                let mut found = follow(&film, &limits, &wanted, rig)?;
                if let (Ok(moving), None) = (&mut found.moving, &settings.rig) {
                    moving.find_bodies(&facts, &attended.stop)?;
                }
                Ok(found)
            })
        },
    )?;
    if let Some(candidates) = found.candidates {
        observer.candidates(candidates);
    }
    match found.moving {
        Err(why) => Ok(Outcome::Unclear(why)),
        Ok(moving) => {
            let summary = moving.write(settings, &wanted, &info, facts)?;
            Ok(Outcome::Followed(Box::new(summary)))
        }
    }
}

/// The limits by the settings of where markers are and how they look.
fn limits(settings: &RunSettings, info: &SourceInfo, shrink: usize) -> Limits {
    let of_rig = settings.rig.as_ref().and_then(|r| r.region.clone());
    Limits {
        region: settings.detect.region.clone().or(of_rig),
        shrink,
        sign: settings.detect.polarity.map(|polarity| polarity.sign() as f32),
        level: match settings.detect.threshold {
            Threshold::Auto => None,
            // Work pictures have the upper 8 bits.
            Threshold::Raw(level) => Some((level / f64::from(1u32 << (info.depth_bits.max(8) - 8))) as f32),
        },
    }
}

/// Follows what is wanted, or else what is likeliest meant; with a rig, what is at the places of its nodes (`true`: of all of them).
fn follow(film: &WorkFilm, limits: &Limits, wanted: &Wanted, rig: Option<(&Rig, bool)>) -> Result<Found> {
    let Some(search) = Search::learn(film, limits)? else {
        let why = Unclear::new("it is too short to tell what moves", "");
        return Ok(Found::unclear(why, Candidates::default()));
    };
    let mut found = if wanted.marker.is_empty() {
        surveyed(film, &search, wanted, rig.map(|r| r.0))?
    } else {
        pointed(film, &search, &wanted.marker, Columns::Followed)?
    };
    if let Ok(moving) = &mut found.moving {
        moving.unite(&wanted.same)?;
    }
    let Some((rig, only_whole)) = rig else { return Ok(found) };
    let named = found.moving.as_mut().is_ok_and(|m| m.name_by(rig));
    let places: Option<Vec<Pointed>> = rig.reference_frame.map(|frame| {
        let at = |x_px, y_px| Pointed { x_px, y_px, frame: Some(frame) };
        rig.nodes.iter().map(|n| at(n.x_px, n.y_px)).collect()
    });
    match places {
        _ if named => {}
        // The rig's own places are as good as any that are pointed at.
        Some(places) if wanted.is_default() => {
            found = pointed(film, &search, &places, Columns::All)?;
            if only_whole && found.moving.as_ref().is_ok_and(|m| !m.is_whole()) {
                let why = "not all that the rig has moves where its nodes are";
                found.moving =
                    Err(Unclear::new(why, "Point at it with " + Setting::Marker + ", without the rig"));
            }
            if let Ok(moving) = &mut found.moving {
                moving.name_in_order(rig);
            }
        }
        _ if found.moving.is_ok() => {
            found.moving = Err(Unclear::new(
                "what moves is not at the places of the rig",
                "Point at it with " + Setting::Marker + ", without the rig",
            ));
        }
        _ => {}
    }
    Ok(found)
}

/// The tracks that are likeliest meant, or were named by their numbers.
fn surveyed(film: &WorkFilm, search: &Search, wanted: &Wanted, rig: Option<&Rig>) -> Result<Found> {
    let is_clear = |s: &Survey| s.answers > 0 && (s.confidence >= LEAST_CONFIDENCE || s.is_sole);
    let mut found = survey(search, Against::Ground)?;
    let mut doubt =
        (found.usual_confidence < SURE_CONFIDENCE).then_some("much else moves that is found in the same way");
    if !is_clear(&found) {
        // What moves less than its own size is never away from its place: it is not new there.
        let around = survey(search, Against::Around)?;
        if around.answers > 0 && around.confidence >= LEAST_CONFIDENCE {
            (found, doubt) = (around, Some("it is never away from its place by more than its size"));
        }
    }
    let mut chosen: Vec<usize> = if is_clear(&found) { (0..found.answers).collect() } else { Vec::new() };
    let Survey { markers, answers, pieces, confidence, .. } = found;
    if let Some(n) = wanted.also.iter().find(|n| !(1..=markers.len()).contains(*n)) {
        return Err(Error::Argument(
            Fault::of(
                Setting::Also,
                format!("{n} is no number of the picture, which has 1 to {}", markers.len()),
            )
            .advice("Point at it with " + Setting::Marker),
        ));
    }
    wanted.also.iter().map(|n| n - 1).for_each(|k| {
        if !chosen.contains(&k) {
            chosen.push(k);
        }
    });
    if let (Some(count), false) = (wanted.markers, chosen.is_empty()) {
        let weight = |k: &usize| markers[*k].track.weight();
        let mut rest: Vec<usize> = (0..markers.len()).filter(|k| !chosen.contains(k)).collect();
        chosen.sort_by(|a, b| weight(b).total_cmp(&weight(a)));
        rest.sort_by(|a, b| weight(b).total_cmp(&weight(a)));
        chosen.extend(rest);
        if chosen.len() < count {
            let why = format!("{count} markers are wanted, and {} move smoothly", chosen.len());
            let candidates = candidates(film, search, &markers, answers, confidence, &[])?;
            return Ok(Found::unclear(Unclear::new(why, point_at(&candidates)), candidates));
        }
        chosen.truncate(count);
        chosen.sort_unstable();
    }
    let candidates = candidates(film, search, &markers, answers, confidence, &chosen)?;
    if chosen.is_empty() {
        return Ok(Found::unclear(unclear(film, &markers, answers, confidence, &candidates), candidates));
    }
    let others = markers.len() - chosen.len();
    let mut taken: Vec<Marker> = chosen.into_iter().map(|k| markers[k].clone()).collect();
    let count = taken.len();
    // Pieces belong to what was found by itself: what was named is followed as far as it can be.
    taken.extend(pieces.into_iter().filter(|_| wanted.is_default() && rig.is_none()));
    finish(film, &mut taken)?;
    let pieces = taken.split_off(count);
    let how = if wanted.also.is_empty() {
        Chosen::Likeliest { confidence, others, doubt }
    } else {
        Chosen::Numbered
    };
    let moving = Moving::of(film, taken, how).and_pieces(film, pieces);
    Ok(Found { moving: Ok(moving), candidates: Some(candidates) })
}

/// The reason for which what moves is not named.
fn unclear(
    film: &WorkFilm,
    markers: &[Marker],
    answers: usize,
    confidence: f64,
    candidates: &Candidates,
) -> Unclear {
    let why = match markers.first() {
        None => "nothing moves smoothly before a still background".into(),
        Some(m) => format!(
            "of the {} that move the likeliest ({}) explains {:.0} % of what looks like it ({:.0} % are needed)",
            markers.len(),
            words(m, film.shrink() as f64),
            100.0 * if answers > 0 { confidence } else { 0.0 },
            100.0 * LEAST_CONFIDENCE,
        ),
    };
    Unclear::new(why, point_at(candidates))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::Polarity;

    fn plain() -> RunSettings {
        RunSettings { input: env!("CARGO_MANIFEST_DIR").into(), ..RunSettings::default() }
    }

    #[test]
    fn what_moves_is_followed_only_where_nothing_was_said_of_the_size_of_markers() {
        assert!(applies(&plain()));
        let with = |detect| RunSettings { detect, ..plain() };
        let plain = DetectSettings::default;
        assert!(applies(&with(DetectSettings { polarity: Some(Polarity::Dark), ..plain() })));
        assert!(!applies(&with(DetectSettings { min_area_px: Some(5.0), ..plain() })));
        assert!(!applies(&with(DetectSettings { threshold: Threshold::Raw(5.0), ..plain() })));
    }

    #[test]
    fn only_missing_markers_make_it_wanted() {
        let fault = || Fault::new("film", "no marker");
        assert!(is_wanted(&Err(Error::Detect(fault()))));
        assert!(is_wanted(&Err(Error::Rig(fault()))));
        assert!(!is_wanted(&Err(Error::Source(fault()))));
        assert!(!is_wanted(&Err(Error::Interrupted)));
    }
}
