//! Holds the bodies that are followed: shapes, motion priors, last poses; predicts a pose and sets up a search.
//!
//! Owns: [`Bodies`]. Must not: look for a body in a frame (`body_search` does).

use super::false_matches::{indistinguishable, self_symmetry_rad};
use super::motion_priors::MotionPriors;
use super::seen::BodySeen;
use crate::rigid::body::{Holder, Mechanism};
use crate::rigid::forecast::{Forecast, Motion};
use crate::rigid::hypothesis::Anchor;
use crate::rigid::index::DetectionIndex;
use crate::rigid::pose::place;
use crate::rigid::search::{PAIRS, REACH_SIGMA, Search};
use crate::rigid::work::Work;

/// The bodies that are followed, at one moment.
#[derive(Debug, Clone)]
pub struct Bodies {
    /// Templates and hinges.
    pub mechanism: Mechanism,
    /// Motion priors.
    pub priors: MotionPriors,
    /// The last poses of each body.
    pub motions: Vec<Motion>,
    /// Budget of work for finding them.
    pub work: Work,
    /// For each body the least turn that maps it on itself as far as two nodes, rad.
    pub(super) self_symmetry_rad: Vec<f64>,
    /// For each body those that look the same.
    pub(super) indistinguishable: Vec<Vec<usize>>,
}

impl Bodies {
    /// Bodies of which no pose is known yet.
    pub fn new(mechanism: Mechanism, priors: MotionPriors) -> Self {
        let motions = vec![Motion::default(); mechanism.links.len()];
        let self_symmetry_rad =
            (0..mechanism.links.len()).map(|b| self_symmetry_rad(&mechanism, &priors, b)).collect();
        let indistinguishable = indistinguishable(&mechanism, &priors);
        Self { mechanism, priors, motions, work: Work::saved(), self_symmetry_rad, indistinguishable }
    }

    /// Points of a body known from the ground and from bodies whose pose is known.
    pub fn anchors(&self, body: usize, fits: &[BodySeen]) -> Vec<Anchor> {
        let mut out: Vec<Anchor> = Vec::new();
        for h in self.mechanism.hinges.iter().filter(|h| h.body == body) {
            match h.holder {
                Holder::Ground(p) => out.push(Anchor { local: h.local, place: p, sigma_px: h.sigma_px }),
                Holder::Body(o, there) => {
                    if let Some(f) = &fits[o].fit {
                        let sigma_px = h.sigma_px.hypot(f.sigma_at(there));
                        out.push(Anchor { local: h.local, place: place(&f.pose, there), sigma_px });
                    }
                }
            }
        }
        out.sort_by(|a, b| a.sigma_px.total_cmp(&b.sigma_px));
        out
    }

    /// The forecast of a body's pose at `time`.
    pub fn forecast(&self, body: usize, time: f64, anchors: &[Anchor]) -> Option<Forecast> {
        let f = self.motions[body].forecast(time, self.priors.floor[body], self.priors.first[body])?;
        Some(anchors.first().map_or(f, |a| f.hung(a.local, a.place)))
    }

    pub(super) fn search<'a>(
        &'a self,
        b: usize,
        index: &'a DetectionIndex<'a>,
        free: &'a [bool],
        anchors: &'a [Anchor],
        window: Option<Forecast>,
    ) -> Search<'a> {
        Search {
            link: &self.mechanism.links[b],
            anchors,
            index,
            free,
            window,
            reach_sigma: REACH_SIGMA,
            floor_px: self.priors.floor_px,
            pairs: PAIRS,
            work: &self.work,
        }
    }
}
