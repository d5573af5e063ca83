//! Says why nothing is named of what moves, with all that does.
//!
//! Owns: [`Found`], [`Unclear`], [`candidates`], [`point_at`]. Must not: follow anything.

use super::candidates::Candidates;
use super::moving_nodes::Moving;
use crate::error::Result;
use crate::message::{Message, Setting};
use crate::moving::{Marker, Search, WorkFilm, strongest};

/// Confidence from which on what moves is named: right results of the films with truth have 0.2 to 0.8, and of the wrong ones
/// none has more than 0.16 (docs/validation/moving.md).
pub(super) const LEAST_CONFIDENCE: f64 = 0.2;
/// The reason for which nothing is named.
#[derive(Debug, Clone)]
pub(super) struct Unclear {
    /// A clause.
    pub why: String,
    /// A sentence without its full stop; empty if there is nothing to do.
    pub advice: Message,
}

impl Unclear {
    pub(super) fn new(why: impl Into<String>, advice: impl Into<Message>) -> Self {
        Self { why: why.into(), advice: advice.into() }
    }
}

/// Outcome of the look at what moves.
pub(super) struct Found {
    pub(super) moving: Result<Moving, Unclear>,
    pub(super) candidates: Option<Candidates>,
}

impl Found {
    pub(super) fn unclear(why: Unclear, candidates: Candidates) -> Self {
        Self { moving: Err(why), candidates: Some(candidates) }
    }
}

/// All that moves, or what stands out where nothing does.
pub(super) fn candidates(
    film: &WorkFilm,
    search: &Search,
    markers: &[Marker],
    answers: usize,
    confidence: f64,
    chosen: &[usize],
) -> Result<Candidates> {
    if markers.is_empty() {
        let (picture, spots) = strongest(search)?;
        return Ok(Candidates::of_spots(film, picture, &spots));
    }
    Ok(Candidates::of_markers(film, markers, |k| match k {
        _ if chosen.contains(&k) => None,
        k if k < answers => Some(format!(
            "of the likeliest look, which explains {:.0} % of what looks like it ({:.0} % are needed)",
            100.0 * confidence,
            100.0 * LEAST_CONFIDENCE
        )),
        _ => Some("of another look, and less likely meant".into()),
    }))
}

/// The way on where it is not clear what is meant.
pub(super) fn point_at(candidates: &Candidates) -> Message {
    match candidates.all.first() {
        Some(first) => {
            Message::from("Say what is meant with ")
                + first.advice()
                + ", for what has number 1 in the picture"
        }
        None => "Point at it with " + Setting::Marker.set_to("X,Y@FRAME"),
    }
}
