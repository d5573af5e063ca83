//! Makes a rig of markers that were followed already: of what moves where no markers stand out.
//!
//! Owns: [`rig_of_paths`], [`PathRig`]. Must not: follow a marker, or give a path to two.

use super::arrange::{Found, arrange};
use super::continuity::{self, Evidence, FoundBody};
use super::find::camera_of;
use crate::calibrate::words;
use crate::camera::Plane;
use crate::error::Result;
use crate::link::Tracklet;
use crate::message::Message;
use crate::pixel_aspect::PixelAspect;
use crate::rig::Rig;
use crate::stop::Stop;

/// A rig whose nodes are paths.
#[derive(Debug, Clone)]
pub struct PathRig {
    /// The rig.
    pub rig: Rig,
    /// For each of its nodes the paths that are it: more than one where pieces of it are never seen together.
    pub paths: Vec<Vec<usize>>,
    /// Warnings to the user, a sentence each.
    pub warnings: Vec<Message>,
}

/// The bodies, joints and camera of paths in square pixels, in a picture of `image_px` (width, height) recorded pixels; `frame` says
/// which frame of the recording a path's frame is. `None` where each path is a body of its own that hangs on nothing.
///
/// # Errors
/// [`crate::error::Error::Interrupted`] once `stop` was asked for.
pub fn rig_of_paths(
    paths: &[Tracklet],
    image_px: [u32; 2],
    pixel_aspect: PixelAspect,
    frame: &(dyn Fn(usize) -> u64 + Sync),
    stop: &Stop,
) -> Result<Option<PathRig>> {
    let mut evidence = Evidence::new(paths, stop)?;
    evidence.are_markers = true;
    let size_px = [f64::from(image_px[0]) * pixel_aspect.ratio(), f64::from(image_px[1])];
    let camera = continuity::camera(&evidence, size_px, stop)?;
    let plane = Plane { pixel_aspect, camera: camera.as_ref().map(|c| c.camera) };
    let flat = evidence.through(plane.camera.as_ref());
    let bodies = continuity::bodies(&flat, stop)?;
    let Some(reference) = reference(&flat, &bodies) else { return Ok(None) };
    let found: Vec<Found> = bodies.iter().map(|b| b.found.clone()).collect();
    let index = frame(flat.frames[reference]);
    let (mut rig, markers) = arrange(&found, reference, Some(index), image_px, &plane, stop)?;
    if rig.joints.is_empty() && rig.bodies.len() == rig.nodes.len() {
        return Ok(None);
    }
    rig.camera = camera.as_ref().map(camera_of);
    // Bodies of places that are nowhere near the picture are not those of the paths.
    if rig.nodes.iter().any(|n| !rig.in_reach([n.x_px, n.y_px])) || rig.check("rig of what moves").is_err() {
        return Ok(None);
    }
    let path = |t: &usize| paths.iter().position(|p| std::ptr::eq(p, flat.tracklets[*t]));
    let paths =
        markers.iter().map(|&(b, q)| bodies[b].markers[q].iter().filter_map(path).collect()).collect();
    let warnings = camera.iter().map(|c| words(c, size_px[0]).into()).collect();
    Ok(Some(PathRig { rig, paths, warnings }))
}

/// The first of the frames in which most markers are seen.
fn reference(evidence: &Evidence<'_>, bodies: &[FoundBody]) -> Option<usize> {
    let seen = |k: usize| {
        let of_body = |b: &FoundBody| {
            let here = |tracklets: &&Vec<usize>| tracklets.iter().any(|&t| evidence.place(t, k).is_some());
            b.markers.iter().filter(here).count()
        };
        bodies.iter().filter(|b| b.found.poses[k].is_some()).map(of_body).sum::<usize>()
    };
    (0..evidence.frames.len()).rev().max_by_key(|&k| seen(k)).filter(|&k| seen(k) > 0)
}
