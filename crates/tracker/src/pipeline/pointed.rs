//! Follows what was pointed at, each place by itself: where one cannot be followed, the others are all the same.
//!
//! Owns: [`pointed`]. Must not: choose what is followed where nothing was pointed at.

use super::candidates::look;
use super::moving_nodes::{Chosen, Moving};
use super::unclear::{Found, Unclear, candidates, point_at};
use crate::error::{Error, Fault, Result};
use crate::message::{Message, Setting};
use crate::moving::{
    Against, Click, End, Lost, Marker, Missed, Search, Survey, Track, Unheld, WorkFilm, finish,
    follow_clicks, survey,
};
use crate::wanted::Pointed;

/// Two places nearer than this are one to who points at them, px.
const ONE_PLACE_PX: f64 = 2.0;

/// The use of the columns of places that cannot be followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Columns {
    /// No columns: each place that can be followed has the name of its number among those that were pointed at.
    Followed,
    /// Empty columns: the places are a rig's nodes.
    All,
}

/// A place that is not followed.
struct Refused {
    /// Where it is, in words.
    place: String,
    /// Why, a clause.
    why: String,
}

impl Refused {
    fn words(&self) -> Message {
        Message::from(format!(
            "nothing is followed from {}: {}. Point at the middle of a marker with ",
            self.place, self.why
        )) + Setting::Marker
            + ", or leave the place out"
    }
}

/// The tracks through the places that were pointed at.
///
/// # Errors
/// Those of the film; [`Error::Argument`] for a frame that is not there.
pub(super) fn pointed(
    film: &WorkFilm,
    search: &Search,
    places: &[Pointed],
    columns: Columns,
) -> Result<Found> {
    let first = film.stamps().first().map_or(0, |s| s.index);
    let clicks = places.iter().map(|p| click(film, p, first)).collect::<Result<Vec<Click>>>()?;
    let shown = |k: usize| {
        let p = &places[k];
        format!("({:.0}, {:.0}) px in frame {}", p.x_px, p.y_px, p.frame.unwrap_or(first))
    };
    let Survey { markers: known, answers, confidence, .. } = survey(search, Against::Ground)?;
    let mut followed = follow_clicks(search, &clicks, &known)?;
    let twice = doubles(&followed, &clicks);
    let scale = film.shrink() as f64;
    let mut refused = Vec::new();
    for (k, double) in twice.into_iter().enumerate() {
        let why = match (double, &followed[k]) {
            (Some(other), _) => {
                format!("it and {} are one marker, which is followed from there", shown(other))
            }
            (None, Err(missed)) => unheld_words(*missed, scale),
            (None, Ok(_)) => continue,
        };
        refused.push((k, Refused { place: shown(k), why }));
    }
    if refused.len() == places.len() {
        let why =
            refused.iter().map(|(_, r)| format!("at {} {}", r.place, r.why)).collect::<Vec<_>>().join("; ");
        let candidates = candidates(film, search, &known, answers, confidence, &[])?;
        return Ok(Found::unclear(Unclear::new(why, point_at(&candidates)), candidates));
    }
    let empty = || Marker { track: Track::of(Vec::new(), 1.0), model: None, radius_px: 1.0 };
    let mut names = Vec::new();
    let mut markers = Vec::new();
    for (k, marker) in followed.drain(..).enumerate() {
        let is_refused = refused.iter().any(|(r, _)| *r == k);
        if is_refused && columns == Columns::Followed {
            continue;
        }
        names.push(format!("n{k}"));
        markers.push(marker.ok().filter(|_| !is_refused).unwrap_or_else(empty));
    }
    finish(film, &mut markers)?;
    let refused = refused.into_iter().map(|(_, r)| (r.place.clone(), r.words())).collect();
    let moving = Moving::of(film, markers, Chosen::Pointed).pointed_at(names, refused);
    Ok(Found { moving: Ok(moving), candidates: None })
}

fn click(film: &WorkFilm, place: &Pointed, first: u64) -> Result<Click> {
    let frame = place.frame.unwrap_or(first);
    let picture = film.picture_of(frame).ok_or_else(|| {
        let last = film.stamps().last().map_or(0, |s| s.index);
        Error::Argument(
            Fault::of(Setting::Marker, format!("frame {frame} is not among those that are decoded"))
                .advice(format!("Give a frame of {first} to {last}")),
        )
    })?;
    Ok(Click { picture, x: film.work_px(place.x_px), y: film.work_px(place.y_px) })
}

/// The distance within which two markers are one, px: what is followed by its picture is where it was pointed at, and a large picture has
/// room for many such places.
fn same_px(one: &Marker, other: &Marker) -> f64 {
    let least_px = one.radius_px.min(other.radius_px);
    if one.model.is_some() && other.model.is_some() { least_px } else { least_px.min(ONE_PLACE_PX) }
}

/// For each place another one from which the same marker is followed, and which is nearer to its middle (the first, where both are as near).
fn doubles(followed: &[Result<Marker, Unheld>], clicks: &[Click]) -> Vec<Option<usize>> {
    let off = |k: usize, marker: &Marker| {
        let spot = marker.track.spots().find(|(p, _)| *p == clicks[k].picture);
        spot.map_or(f64::INFINITY, |(_, s)| (s.x - clicks[k].x).hypot(s.y - clicks[k].y))
    };
    let mut taken: Vec<(usize, &Marker)> =
        followed.iter().enumerate().filter_map(|(k, f)| Some((k, f.as_ref().ok()?))).collect();
    taken.sort_by(|a, b| off(a.0, a.1).total_cmp(&off(b.0, b.1)));
    let mut kept: Vec<(usize, &Marker)> = Vec::new();
    let mut out = vec![None; followed.len()];
    for (k, marker) in taken {
        match kept.iter().find(|(_, m)| m.is_same(marker, same_px(m, marker))) {
            Some((other, _)) => out[k] = Some(*other),
            None => kept.push((k, marker)),
        }
    }
    out
}

fn unheld_words(unheld: Unheld, scale: f64) -> String {
    let picture = match unheld.picture {
        Lost::Still => "what is there stands still all through the recording".into(),
        Lost::Plain => "what is there has too little of a picture to be told from the noise".into(),
        Lost::Soon(1) => "its picture is not found again with certainty in the frames beside it".into(),
        Lost::Soon(count) => format!("its picture is found with certainty in {count} frames only"),
    };
    format!("{}; and {picture}", missed_words(unheld.spot, scale))
}

fn missed_words(missed: Missed, scale: f64) -> String {
    match missed {
        Missed::Nothing => "nothing stands out from what is around it".into(),
        Missed::Ends(model, count, end) => {
            let why = match end {
                End::Ambiguous => "two places compete for it",
                End::Look => "it changes its look",
                End::Lost | End::Recording => "nothing is where it is expected",
            };
            let look = look(&model, model.radius_px(), scale);
            format!("something stands out ({look}) and is followed through {count} frames only: then {why}")
        }
        Missed::Beside(model) => {
            let look = look(&model, model.radius_px(), scale);
            format!("the middle of what stands out ({look}) is not there but beside it")
        }
        Missed::Restless(model, count) => {
            let look = look(&model, model.radius_px(), scale);
            format!(
                "something stands out ({look}), and in the {count} frames in which it is seen it jumps about"
            )
        }
    }
}
