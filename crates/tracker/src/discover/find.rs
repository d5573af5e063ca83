//! Finds the rig of a recording in its detections, step by step.
//!
//! Owns: [`discover`], [`Discovery`]. Must not: name markers frame by frame (`track` does), or look at pixels.

use nalgebra::Vector2;
use rayon::prelude::*;

use super::arrange::Found;
use super::sample::Sample;
use super::{arrange, bodies, lone, sample};
use crate::error::{Error, Fault, FaultKind, Result};
use crate::message::{Message, Setting};
use crate::pixel_aspect::PixelAspect;
use crate::rig::Rig;
use crate::rigid::body::Link;
use crate::rigid::pose::place;
use crate::stop::Stop;
use crate::store::DetectionStore;

/// A rig and what a user should know of it.
#[derive(Debug, Clone)]
pub struct Discovery {
    /// The rig.
    pub rig: Rig,
    /// Places that stand still and belong to no body: a ruler, a screw. px.
    pub standing: Vec<[f64; 2]>,
    /// What a user should know, a sentence each.
    pub warnings: Vec<Message>,
}

/// A recording in which no rig is found.
fn nothing_found(problem: impl Into<Message>, advice: Message) -> Error {
    Error::Rig(Fault::new("recording", problem).of_kind(FaultKind::NothingFound).advice(advice))
}

/// Finds the rig of a recording of `image_px` (width, height) pixels; its places are in these.
///
/// # Errors
/// [`Error::Rig`] if there are no markers or none moves; [`Error::Interrupted`] once `stop` was asked for.
pub fn discover(store: &DetectionStore, image_px: [u32; 2], stop: &Stop) -> Result<Discovery> {
    let sample = Sample::take(store, stop)?;
    if sample.frames.is_empty() {
        return Err(nothing_found(
            "no markers are seen in any frame",
            "Look at a frame and set " + Setting::Threshold + " or " + Setting::Polarity,
        ));
    }
    let mut warnings = Vec::new();
    if sample.at_rest {
        return Err(nothing_found(
            "nothing moves, so bodies cannot be told apart",
            "Give a rig with " + Setting::Rig + ", or a longer recording",
        ));
    }
    let mut sample = sample;
    let mut found = moving_bodies(&mut sample, stop)?;
    let standing = sample.standing.clone();
    let links: Vec<Link> = found.iter().map(|f| f.link.clone()).collect();
    if links.is_empty() || lone::others_move(&sample, &links, stop)? {
        warnings.extend(add_lone(&mut found, store, &sample, &links, stop)?);
    }
    if found.is_empty() {
        return Err(nothing_found(
            "no marker can be followed",
            "Point at each with " + Setting::Marker + ", or give a rig with " + Setting::Rig,
        ));
    }
    if let Some((a, b)) = bodies::alike(&links, stop)? {
        let (a, b) =
            (place_words(&found[a], store.pixel_aspect()), place_words(&found[b], store.pixel_aspect()));
        return Err(nothing_found(
            format!("two bodies have the same marker layout, {a} and {b}: they cannot be told apart"),
            "Move a marker of one of them by some pixels, or say which is which with " + Setting::Rig,
        ));
    }
    let aspect = store.pixel_aspect();
    let (reference, whole) = reference(&sample, &found, image_px, aspect, stop)?;
    if !whole {
        warnings
            .push("no frame shows every marker: their places are put together from several frames".into());
    }
    let index = store.stamp(sample.frames[reference]).index;
    let mut rig = arrange::arrange(&found, reference, Some(index), image_px, aspect, stop)?;
    let lost = rig.leave_out_unreachable();
    if !lost.is_empty() {
        warnings.push(
            format!("left out, because they would be far outside the image: {}", lost.join(", ")).into(),
        );
    }
    let beyond: Vec<&str> =
        rig.nodes.iter().filter(|n| !rig.in_image([n.x_px, n.y_px])).map(|n| n.name.as_str()).collect();
    if !beyond.is_empty() {
        let beyond = beyond.join(", ");
        warnings.push(
            format!("outside the image in the reference picture, where their links put them: {beyond}")
                .into(),
        );
    }
    rig.check("discovered rig")?;
    if !standing.is_empty() {
        let n = standing.len();
        warnings.push(
            format!(
                "{n} bright place{} stand{} still and belong{} to no body",
                if n == 1 { "" } else { "s" },
                if n == 1 { "s" } else { "" },
                if n == 1 { "s" } else { "" },
            )
            .into(),
        );
    }
    let standing = standing.iter().map(|p| aspect.to_recorded(*p).into()).collect();
    Ok(Discovery { rig, standing, warnings })
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

/// The frame of the sample in which most nodes are seen, the first of those, and whether it shows all.
fn reference(
    sample: &Sample,
    found: &[Found],
    image_px: [u32; 2],
    aspect: PixelAspect,
    stop: &Stop,
) -> Result<(usize, bool)> {
    let [w, h] = image_px.map(f64::from);
    let inside = |square: Vector2<f64>| {
        let p = aspect.to_recorded(square);
        p.x > 0.0 && p.y > 0.0 && p.x < w - 1.0 && p.y < h - 1.0
    };
    let all: usize = found.iter().map(|f| f.link.nodes.len()).sum();
    let (mut best, mut index) = ((false, 0), 0);
    for (k, frame) in sample.moving.iter().enumerate() {
        stop.heed()?;
        let seen = crate::rigid::index::DetectionIndex::new(frame);
        // A frame is better in which no node is outside the image, and then one in which more are seen.
        let mut rank = (true, 0);
        for f in found {
            let Some(pose) = &f.poses[k] else { continue };
            for &t in &f.link.template {
                let p = place(pose, t);
                rank.0 &= inside(p);
                rank.1 += usize::from(seen.nearest(p, 1.5).is_some_and(|(d, _)| seen.whole(d)));
            }
        }
        // One that shows nothing is no reference for being inside.
        if rank.1 > 0 && rank > best {
            (best, index) = (rank, k);
        }
        if best == (true, all) {
            break;
        }
    }
    Ok((index, best.1 == all))
}

/// Adds markers that are on no body of three, and pairs of them; what to know of those that are too many.
fn add_lone(
    found: &mut Vec<Found>,
    store: &DetectionStore,
    sample: &Sample,
    links: &[Link],
    stop: &Stop,
) -> Result<Option<Message>> {
    let (alone, left_out) = lone::find_lone(store, sample, &sample.standing, links, stop)?;
    found.extend(alone);
    lone::pair_up(found, stop)?;
    Ok(left_out_words(left_out))
}

/// What to know of markers that move by themselves and are too many.
fn left_out_words(left_out: usize) -> Option<Message> {
    let others = if left_out == 1 { "one more is".to_owned() } else { format!("{left_out} more are") };
    let words = format!(
        "markers move by themselves: the {} that are seen longest are followed, {others} not. Leave out what are no markers \
         with ",
        lone::MOST_LONE
    );
    (left_out > 0).then(|| Message::from(words) + Setting::Threshold)
}

/// Where a body was found, for a message.
fn place_words(found: &Found, aspect: PixelAspect) -> String {
    let at = aspect.to_recorded(found.link.home + found.link.template[0]);
    format!("one with a marker at ({:.0}, {:.0}) px", at.x, at.y)
}
