//! Finds the rig of a recording in its detections, step by step.
//!
//! Owns: [`discover`]. Must not: name markers frame by frame (`track` does), or look at pixels.

use nalgebra::Vector2;

use super::arrange;
use super::arrange::Found;
use super::continuity::{self, Evidence};
use super::discovery::Discovery;
use super::reading::{Explains, Reading, by_continuity, by_shape, nothing_found};
use super::sample::Sample;
use super::trial::choose;
use crate::calibrate::{Calibration, words};
use crate::camera::Plane;
use crate::error::{Error, Result};
use crate::link::link;
use crate::message::{Message, Setting};
use crate::rig::{CameraOrigin, RigCamera};
use crate::rigid::pose::place;
use crate::stop::Stop;
use crate::store::{DetectionStore, PlaneView};

/// Finds the rig of a recording of `image_px` (width, height) pixels; its places are in these.
///
/// Bodies are first sought by their shapes alone, in frames that differ. Where these do not explain what moves, markers are
/// followed by nearness, which tells of the camera and of bodies whose shapes tell nothing; then what names most stands.
///
/// # Errors
/// [`Error::Rig`] if there are no markers or none moves; [`Error::Interrupted`] once `stop` was asked for.
pub fn discover(store: &DetectionStore, image_px: [u32; 2], stop: &Stop) -> Result<Discovery> {
    let square = PlaneView::new(store, None);
    let plain = by_shape(&square, stop);
    let explains = match &plain {
        Err(Error::Interrupted) => return Err(Error::Interrupted),
        Ok(reading) => reading.explains(stop)?,
        Err(_) => Explains { all: false, fits: true },
    };
    let plain = plain.and_then(|r| finish(&square, r, image_px, None, stop));
    if explains.all && explains.fits {
        return plain;
    }
    let tracklets = link(&square, stop)?;
    let evidence = Evidence::new(&tracklets, stop)?;
    let size_px = [f64::from(image_px[0]) * store.pixel_aspect().ratio(), f64::from(image_px[1])];
    let camera = continuity::camera(&evidence, size_px, stop)?;
    let view = PlaneView::new(store, camera.as_ref().map(|c| c.camera));
    let finished = |r: Reading| finish(&view, r, image_px, camera.as_ref(), stop);
    let bent = evidence.through(view.plane().camera.as_ref());
    let near = by_continuity(&view, &bent, stop).and_then(finished);
    let readings = if camera.is_none() {
        vec![plain, near]
    } else {
        let flat = by_shape(&view, stop).and_then(finished);
        // Bodies that are not rigid without the camera stand only if nothing else does.
        if explains.fits { vec![plain, flat, near] } else { vec![flat, near, plain] }
    };
    choose(store, &tracklets, readings, stop)
}

/// A camera that was found, as a rig has it.
pub(super) fn camera_of(found: &Calibration) -> RigCamera {
    let covariance = std::array::from_fn(|i| std::array::from_fn(|j| found.covariance[(i, j)]));
    RigCamera::of(&found.camera, Some(covariance), CameraOrigin::Found)
}

/// The rig of a reading, and what a user should know of it.
fn finish(
    store: &PlaneView<'_>,
    reading: Reading,
    image_px: [u32; 2],
    camera: Option<&Calibration>,
    stop: &Stop,
) -> Result<Discovery> {
    let mut warnings: Vec<_> = reading.left_out_words().into_iter().collect();
    let Reading { sample, found, .. } = reading;
    let found = without_background(found, image_px, &mut warnings)?;
    let standing = sample.standing.clone();
    let plane = store.plane();
    let (reference, whole) = reference(&sample, &found, image_px, &plane, stop)?;
    if !whole {
        warnings
            .push("no frame shows every marker: their places are put together from several frames".into());
    }
    let index = store.stamp(sample.frames[reference]).index;
    let (mut rig, _) = arrange::arrange(&found, reference, Some(index), image_px, &plane, stop)?;
    rig.camera = camera.map(camera_of);
    if let Some(camera) = camera {
        let width_px = f64::from(image_px[0]) * plane.pixel_aspect.ratio();
        warnings.push(words(camera, width_px).into());
    }
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
    let standing = standing.iter().map(|p| plane.to_recorded(*p).into()).collect();
    Ok(Discovery { rig, standing, warnings })
}

/// The bodies that are not the background before a camera that moves, which is told.
fn without_background(
    found: Vec<Found>,
    image_px: [u32; 2],
    warnings: &mut Vec<Message>,
) -> Result<Vec<Found>> {
    let shorter_px = f64::from(image_px[0].min(image_px[1]));
    let (background, found): (Vec<Found>, Vec<Found>) =
        found.into_iter().partition(|f| f.is_background(shorter_px));
    let marks: usize = background.iter().map(|f| f.link.nodes.len()).sum();
    if marks > 0 && found.is_empty() {
        return Err(nothing_found(
            format!(
                "what stands out is {marks} marks of one body that neither turns nor goes anywhere, as a background does before a \
                 camera that moves"
            ),
            "Point at what is meant with " + Setting::Marker + ", or film from a stand",
        ));
    }
    if marks > 0 {
        warnings.push(format!("the camera moves: {marks} marks of its background are left out").into());
    }
    Ok(found)
}

/// The frame of the sample in which most nodes are seen, the first of those, and whether it shows all.
fn reference(
    sample: &Sample,
    found: &[Found],
    image_px: [u32; 2],
    plane: &Plane,
    stop: &Stop,
) -> Result<(usize, bool)> {
    let [w, h] = image_px.map(f64::from);
    let inside = |there: Vector2<f64>| {
        let p = plane.to_recorded(there);
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
