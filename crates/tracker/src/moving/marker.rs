//! A marker that moves: its track, how it is looked at, how large it is.
//!
//! Owns: [`Marker`], [`finish`]. Must not: choose which marker is wanted.

use rayon::prelude::*;

use super::backdrop::Backdrop;
use super::centre::refine;
use super::model::Model;
use super::picture::Film;
use super::rest::{Places, extend};
use super::track::Track;
use super::tracklet::median;
use crate::error::Result;

/// Places from which the radius of a marker is learned.
const RADIUS_PLACES: usize = 24;

/// Least smoothness and travel, in radii, of a track that is one thing and not chained by chance.
const FAR_SMOOTHNESS: f64 = 0.5;
const FAR_RADII: f64 = 6.0;

/// A marker that moves.
#[derive(Debug, Clone)]
pub struct Marker {
    /// Where it is.
    pub track: Track,
    /// How it is looked at; `None` where it is followed by its picture.
    pub model: Option<Model>,
    /// Its radius, px.
    pub radius_px: f64,
}

impl Marker {
    /// A track, with the radius that its places show.
    pub fn of(film: &dyn Film, track: Track, model: Model) -> Result<Self> {
        let (radius_px, _) = compact(film, &track, &model)?;
        Ok(Self { track, model: Some(model), radius_px })
    }

    /// Whether it moves smoothly over three times its own size.
    pub fn goes_far(&self) -> bool {
        self.track.smoothness >= FAR_SMOOTHNESS && self.track.extent_px >= FAR_RADII * self.radius_px
    }

    /// Part of its places at which a compact region is found.
    pub fn whole(&self, film: &dyn Film) -> Result<f64> {
        // A picture's places are certain, each of them.
        let Some(model) = &self.model else { return Ok(1.0) };
        Ok(refine(film, &mut self.track.clone(), model, RADIUS_PLACES, None, None)?.found)
    }

    /// Whether two are one: near each other where both are seen.
    pub fn is_same(&self, other: &Self, within_px: f64) -> bool {
        let places: std::collections::HashMap<usize, (f64, f64)> =
            self.track.spots().map(|(k, s)| (k, (s.x, s.y))).collect();
        let mut apart: Vec<f64> = other
            .track
            .spots()
            .filter_map(|(k, s)| places.get(&k).map(|p| (p.0 - s.x).hypot(p.1 - s.y)))
            .collect();
        apart.len() as f64 > 0.3 * self.track.count.min(other.track.count) as f64
            && median(&mut apart) < within_px
    }
}

/// Radius of a track's marker, px, and how compact it is: the part of its places at which a region is found, less where the
/// region's size is another than the filter's.
pub fn compact(film: &dyn Film, track: &Track, model: &Model) -> Result<(f64, f64)> {
    let c = refine(film, &mut track.clone(), model, RADIUS_PLACES, None, None)?;
    let compact = c.found * (-(c.radius_px / model.radius_px()).ln().powi(2) / 0.5).exp();
    Ok((c.radius_px, compact))
}

/// Takes the centres of markers from close by, follows those that come to rest, and leaves out places that jump aside. Those of
/// one way of looking have one radius. Those that are followed by their picture stay as they are.
///
/// # Errors
/// Those of the film; [`crate::error::Error::Interrupted`] once the work is to stop.
pub fn finish(film: &dyn Film, markers: &mut [Marker]) -> Result<()> {
    let mut done = vec![false; markers.len()];
    while let Some(first) = done.iter().position(|d| !d) {
        let model = markers[first].model;
        let same: Vec<usize> = (first..markers.len()).filter(|&k| markers[k].model == model).collect();
        same.iter().for_each(|&k| done[k] = true);
        // The place of a picture is as good as it will be.
        let Some(model) = model else { continue };
        let backdrop = Backdrop::learn(film, &model)?;
        let mut group: Vec<&mut Marker> =
            markers.iter_mut().enumerate().filter(|(k, _)| same.contains(k)).map(|(_, m)| m).collect();
        let refined = |group: &mut Vec<&mut Marker>| -> Result<()> {
            group.iter_mut().try_for_each(|m| {
                refine(film, &mut m.track, &model, usize::MAX, Some(m.radius_px), Some(&backdrop)).map(|_| ())
            })
        };
        // Twice: what comes to rest is looked for from places that the ground does not pull.
        refined(&mut group)?;
        let mut taken = Places::new();
        for (k, s) in group.iter().flat_map(|m| m.track.spots()) {
            taken.entry(k).or_default().push([s.x, s.y]);
        }
        group.par_iter_mut().try_for_each(|m| extend(film, &mut m.track, &model, &taken))?;
        refined(&mut group)?;
        group.iter_mut().for_each(|m| m.track.settle(m.radius_px));
    }
    Ok(())
}
