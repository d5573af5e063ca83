//! Reads a recording as bodies: by the shapes that come again, or by markers followed by nearness.
//!
//! Owns: [`Reading`], [`Explains`]. Must not: choose between readings.

use nalgebra::Vector2;
use rayon::prelude::*;

use super::arrange::Found;
use super::continuity::{self, Evidence};
use super::sample::Sample;
use super::{bodies, lone, sample};
use crate::camera::Plane;
use crate::error::{Error, Fault, FaultKind, Result};
use crate::message::{Message, Setting};
use crate::rigid::body::Link;
use crate::rigid::pose::place;
use crate::stop::Stop;
use crate::store::PlaneView;

/// The bodies of a recording with their poses in the sample's frames.
pub(super) struct Reading {
    /// Frames that differ.
    pub sample: Sample,
    /// Bodies, with their poses in these.
    pub found: Vec<Found>,
    /// Bodies of three markers and more.
    links: Vec<Link>,
    /// Markers that move by themselves and are too many to be followed.
    left_out: usize,
}

/// Part of what is seen that a reading explains where no other is sought.
const EXPLAINED: f64 = 0.97;
/// Squared residuals over their variances of a reading beside which no camera is sought.
const FITS: f64 = 2.0;
/// Frames in which that is looked at.
const JUDGED: usize = 100;

/// The extent to which bodies of three markers explain the detections.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Explains {
    /// The bodies are nearly all that is seen.
    pub all: bool,
    /// The bodies are rigid but for noise.
    pub fits: bool,
}

impl Reading {
    /// The warning of markers that move by themselves and are too many.
    pub(super) fn left_out_words(&self) -> Option<Message> {
        let others =
            if self.left_out == 1 { "one more is".to_owned() } else { format!("{} more are", self.left_out) };
        let words = format!(
            "markers move by themselves: the {} that are seen longest are followed, {others} not. Leave out what are no \
             markers with ",
            lone::MOST_LONE
        );
        (self.left_out > 0).then(|| Message::from(words) + Setting::Threshold)
    }

    /// Whether the bodies of three are nearly all that is seen, and rigid but for noise.
    pub(super) fn explains(&self, stop: &Stop) -> Result<Explains> {
        let (mut seen, mut named, mut chi2, mut freedom) = (0_u32, 0_usize, 0.0, 0.0);
        let n = self.sample.moving.len();
        for k in 0..n.min(JUDGED) {
            stop.heed()?;
            let frame = &self.sample.moving[k * n / n.min(JUDGED)];
            seen += frame.iter().filter(|d| bodies::looks_whole(d)).count() as u32;
            for (link, s) in self.links.iter().zip(bodies::poses(&self.links, frame)) {
                let Some(s) = s else { continue };
                let picks: Vec<(usize, usize)> =
                    s.picks.iter().enumerate().filter_map(|(j, d)| Some((j, (*d)?))).collect();
                named += picks.iter().filter(|p| bodies::looks_whole(&frame[p.1])).count();
                if picks.len() < 3 {
                    continue;
                }
                for &(j, d) in &picks {
                    let d = &frame[d];
                    let off = place(&s.fit.pose, link.template[j]) - Vector2::new(d.x_px, d.y_px);
                    chi2 += off.norm_squared() / f64::from(d.sigma_px).powi(2).max(1e-4);
                }
                freedom += 2.0 * picks.len() as f64 - 3.0;
            }
        }
        Ok(Explains { all: named as f64 >= EXPLAINED * f64::from(seen), fits: chi2 < FITS * freedom })
    }
}

/// A recording in which no rig is found.
pub(super) fn nothing_found(problem: impl Into<Message>, advice: Message) -> Error {
    Error::Rig(Fault::new("recording", problem).of_kind(FaultKind::NothingFound).advice(advice))
}

/// Bodies by the shapes that come again in frames that differ.
pub(super) fn by_shape(store: &PlaneView<'_>, stop: &Stop) -> Result<Reading> {
    let mut sample = Sample::take(store, stop)?;
    if sample.frames.is_empty() {
        return Err(nothing_found(
            "no markers are seen in any frame",
            "Look at a frame and set " + Setting::Threshold + " or " + Setting::Polarity,
        ));
    }
    if sample.at_rest {
        return Err(nothing_found(
            "nothing moves, so bodies cannot be told apart",
            "Give a rig with " + Setting::Rig + ", or a longer recording",
        ));
    }
    let mut found = moving_bodies(&mut sample, stop)?;
    let links: Vec<Link> = found.iter().map(|f| f.link.clone()).collect();
    let mut left_out = 0;
    if links.is_empty() || lone::others_move(&sample, &links, stop)? {
        let (alone, more) = lone::find_lone(store, &sample, &sample.standing, &links, stop)?;
        left_out = more;
        found.extend(alone);
        lone::pair_up(&mut found, stop)?;
    }
    if found.is_empty() {
        return Err(nothing_found(
            "no marker can be followed",
            "Point at each with " + Setting::Marker + ", or give a rig with " + Setting::Rig,
        ));
    }
    if let Some((a, b)) = bodies::alike(&links, stop)? {
        let (a, b) = (place_words(&found[a], &store.plane()), place_words(&found[b], &store.plane()));
        return Err(nothing_found(
            format!("two bodies have the same marker layout, {a} and {b}: they cannot be told apart"),
            "Move a marker of one of them by some pixels, or say which is which with " + Setting::Rig,
        ));
    }
    Ok(Reading { sample, found, links, left_out })
}

/// Bodies of tracklets.
pub(super) fn by_continuity(store: &PlaneView<'_>, evidence: &Evidence<'_>, stop: &Stop) -> Result<Reading> {
    let found: Vec<Found> = continuity::bodies(evidence, stop)?.into_iter().map(|f| f.found).collect();
    if found.is_empty() {
        return Err(nothing_found(
            "no marker can be followed",
            "Point at each with " + Setting::Marker + ", or give a rig with " + Setting::Rig,
        ));
    }
    let standing = Sample::take(store, stop)?.standing;
    let sample = Sample::of(evidence.frames.clone(), standing, store, stop)?;
    let links = found.iter().filter(|f| f.link.nodes.len() > 2).map(|f| f.link.clone()).collect();
    Ok(Reading { sample, found, links, left_out: 0 })
}

/// Bodies with their poses. Those that do not move are no bodies: their points are counted among the standing.
fn moving_bodies(sample: &mut Sample, stop: &Stop) -> Result<Vec<Found>> {
    loop {
        let links = bodies::find_bodies(sample, stop)?;
        let mut found: Vec<Found> = links
            .iter()
            .map(|link| Found { link: link.clone(), poses: Vec::with_capacity(sample.frames.len()) })
            .collect();
        let posed: Vec<_> = sample
            .moving
            .par_iter()
            .map(|frame| stop.heed().map(|()| bodies::poses(&links, frame)))
            .collect::<Result<_>>()?;
        for frame in posed {
            for (f, s) in found.iter_mut().zip(frame) {
                f.poses.push(s.map(|s| s.fit.pose));
            }
        }
        let mut changed = false;
        for f in &found {
            // A point near a joint hardly moves; a body stands still only if all of it does.
            let still: Option<Vec<Vector2<f64>>> = f
                .link
                .template
                .iter()
                .map(|&t| {
                    let places: Vec<Vector2<f64>> = f.poses.iter().flatten().map(|p| place(p, t)).collect();
                    sample::still_place(&places)
                })
                .collect();
            for place in still.into_iter().flatten() {
                changed |= sample.stands(place);
            }
        }
        if !changed {
            return Ok(found);
        }
    }
}

/// The frame and place at which a body was found, for a message.
fn place_words(found: &Found, plane: &Plane) -> String {
    let at = plane.to_recorded(found.link.home + found.link.template[0]);
    format!("one with a marker at ({:.0}, {:.0}) px", at.x, at.y)
}
