//! Draws stills: the reference picture with a rig, and what was found of what moves, each with its number and its path.
//!
//! Owns: [`still`], [`candidates`]. Must not: choose.

use nalgebra::Vector2;
use opencv::core::Mat;

use super::draw::Overlay;
use super::picture::{Picture, colour};
use crate::detect::Detection;
use crate::error::Result;
use crate::frame::Frame;
use crate::observation::{Observation, Status};
use crate::pipeline::Candidate;
use crate::pixel_aspect::PixelAspect;
use crate::rig::{RIG_SCHEMA, Rig};

/// The reference picture with the rig drawn, marks on detections that are no node, and numbers on what else moves.
///
/// # Errors
/// [`crate::error::Error::Film`] if the frame is not of the rig's size or drawing fails.
pub fn still(frame: &Frame, rig: &Rig, detections: &[Detection], moving: &[Candidate]) -> Result<Picture> {
    let mut row = vec![Observation::MISSING; rig.nodes.len()];
    for (o, n) in row.iter_mut().zip(&rig.nodes) {
        o.x_px = n.x_px;
        o.y_px = n.y_px;
        o.sigma_px = 0.1;
        o.area_px = 1.0;
        o.status = Status::Seen;
    }
    let mut overlay = Overlay::new(rig);
    let mut picture = overlay.drawn(frame, None, &row)?;
    for d in detections {
        let p = overlay.square([d.x_px, d.y_px]);
        if rig.nodes.iter().all(|n| (overlay.square([n.x_px, n.y_px]) - p).norm() > 3.0) {
            overlay.ring(&mut picture, p, 6.0 * overlay.scale, [128.0; 3], 1.0)?;
        }
    }
    draw(&mut picture, &overlay, moving)?;
    Ok(Picture(picture))
}

/// A frame with candidates drawn into it.
///
/// # Errors
/// [`crate::error::Error::Film`] if drawing fails.
pub fn candidates(frame: &Frame, aspect: PixelAspect, all: &[Candidate]) -> Result<Picture> {
    let empty = Rig {
        schema: RIG_SCHEMA,
        image_px: [frame.width, frame.height],
        pixel_aspect: aspect,
        reference_frame: None,
        region: None,
        lens: None,
        camera: None,
        wanted: Default::default(),
        bodies: Vec::new(),
        nodes: Vec::new(),
        joints: Vec::new(),
    };
    let overlay = Overlay::new(&empty);
    let mut picture = colour(frame, overlay.size)?;
    draw(&mut picture, &overlay, all)?;
    overlay.write(&mut picture, &format!("frame {}", frame.index), overlay.corner(), [255.0; 3])?;
    Ok(Picture(picture))
}

fn draw(picture: &mut Mat, overlay: &Overlay, all: &[Candidate]) -> Result<()> {
    for c in all {
        let path: Vec<Vector2<f64>> = c.path_px.iter().map(|p| overlay.square(*p)).collect();
        for pair in path.windows(2) {
            overlay.stroke(picture, pair[0], pair[1], c.number, 1.0)?;
        }
    }
    // Above all paths.
    all.iter()
        .try_for_each(|c| overlay.numbered(picture, overlay.square([c.x_px, c.y_px]), c.radius_px, c.number))
}
