//! Finds the spots of a picture in every way of looking, against the recording's still ground.
//!
//! Owns: [`Search`], [`Against`]. Must not: know of other pictures.

use rayon::prelude::*;

use super::ground::{self, Ground, spread};
use super::limits::Limits;
use super::model::Model;
use super::picture::{Film, Picture};
use super::response::{Direction, Response, octaves, responses};
use super::spot::{Spot, spots};
use crate::error::Result;

/// A recording of fewer pictures has no tracklet that can be judged.
const LEAST_PICTURES: usize = 6;

/// The reference from which a spot must stand out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Against {
    /// From what is around it and from what was at its place before.
    Ground,
    /// From what is around it alone.
    Around,
}

/// A recording and its still ground.
pub struct Search<'a> {
    /// The recording.
    pub film: &'a dyn Film,
    limits: &'a Limits,
    directions: Vec<Direction>,
    /// By octave, then direction.
    grounds: Vec<Vec<Ground>>,
    /// By octave: which pixels are in the region.
    masks: Vec<Option<Vec<bool>>>,
    /// Number of octaves.
    pub count: usize,
    /// Width of the pictures, px.
    pub width: f64,
}

impl<'a> Search<'a> {
    /// Learns the ground; `None` of a recording that is too short.
    pub fn learn(film: &'a dyn Film, limits: &'a Limits) -> Result<Option<Self>> {
        let n = film.count();
        if n < LEAST_PICTURES {
            return Ok(None);
        }
        let first = film.read(0)?;
        let count = octaves(first.width, first.height);
        // A threshold is one of brightness.
        let grey = first.chroma.is_none() || limits.level.is_some();
        let directions = if grey { vec![Direction::LUMA] } else { Direction::ALL.to_vec() };
        let pictures = spread(n, ground::PICTURES.min(n));
        let samples: Vec<Vec<Response>> = pictures
            .par_iter()
            .map(|&i| {
                film.heed()?;
                Ok(responses(&film.read(i)?, count))
            })
            .collect::<Result<_>>()?;
        let masks = (0..count).map(|l| limits.mask((first.width >> l, first.height >> l), l)).collect();
        let grounds = (0..count)
            .map(|l| {
                let octave: Vec<Response> = samples.iter().map(|s| s[l].clone()).collect();
                directions.iter().map(|&d| Ground::learn(&octave, d, l)).collect()
            })
            .collect();
        Ok(Some(Self { film, limits, directions, grounds, masks, count, width: first.width as f64 }))
    }

    /// Every way of looking.
    pub fn models(&self) -> Vec<Model> {
        let signs = self.limits.sign.map_or_else(|| vec![1.0, -1.0], |s| vec![s]);
        let mut all = Vec::new();
        for &direction in &self.directions {
            for octave in 0..self.count {
                all.extend(signs.iter().map(|&sign| Model { direction, sign, octave }));
            }
        }
        all
    }

    fn ground(&self, m: &Model) -> &Ground {
        let d = self.directions.iter().position(|d| *d == m.direction).unwrap_or(0);
        &self.grounds[m.octave][d]
    }

    /// The spots of a picture, whose response on the model's octave is given: above a limit in units of the noise, the
    /// strongest, at most so many.
    pub fn spots(
        &self,
        picture: &Picture,
        response: &Response,
        model: &Model,
        against: Against,
        (limit, most): (f32, usize),
    ) -> Vec<Spot> {
        let along = response.along(model.direction);
        let ground = self.ground(model);
        let mut out = match against {
            Against::Ground => ground.standing_out(&along, model.sign),
            Against::Around => ground.against_noise(&along, model.sign),
        };
        if let Some(mask) = &self.masks[model.octave] {
            out.iter_mut().zip(mask).filter(|(_, inside)| !**inside).for_each(|(o, _)| *o = 0.0);
        }
        let size = (response.width, response.height);
        let mut found = spots(&out, &along, Some(ground), size, model.octave, (limit, most));
        found.retain(|s| self.limits.allow(s, picture, model.sign));
        found
    }
}
