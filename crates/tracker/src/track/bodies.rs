//! The bodies that are followed: their shapes, what was learned of their motion, and their last poses.
//!
//! Owns: [`Bodies`]. Must not: look for a body in a frame (`finding` does).

use super::chance::{likeness, twins};
use super::habits::Habits;
use super::seen::BodySeen;
use crate::rigid::body::{Holder, Mechanism};
use crate::rigid::forecast::{Forecast, Motion};
use crate::rigid::index::Sky;
use crate::rigid::pose::place;
use crate::rigid::search::{Anchor, PAIRS, REACH_SIGMA, Search};

/// The bodies that are followed, at one moment.
#[derive(Debug, Clone)]
pub struct Bodies {
    /// Templates and hinges.
    pub mechanism: Mechanism,
    /// What to reckon with.
    pub habits: Habits,
    /// The last poses of each body.
    pub motions: Vec<Motion>,
    /// For each body the least turn that maps it on itself as far as two nodes, rad.
    pub(super) likeness: Vec<f64>,
    /// For each body those that look the same.
    pub(super) twins: Vec<Vec<usize>>,
}

impl Bodies {
    /// Bodies of which no pose is known yet.
    pub fn new(mechanism: Mechanism, habits: Habits) -> Self {
        let motions = vec![Motion::default(); mechanism.links.len()];
        let likeness = (0..mechanism.links.len()).map(|b| likeness(&mechanism, &habits, b)).collect();
        let twins = twins(&mechanism, &habits);
        Self { mechanism, habits, motions, likeness, twins }
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

    /// Where a body is expected at `time`.
    pub fn forecast(&self, body: usize, time: f64, anchors: &[Anchor]) -> Option<Forecast> {
        let f = self.motions[body].forecast(time, self.habits.floor[body], self.habits.first[body])?;
        Some(anchors.first().map_or(f, |a| f.hung(a.local, a.place)))
    }

    pub(super) fn search<'a>(
        &'a self,
        b: usize,
        sky: &'a Sky<'a>,
        free: &'a [bool],
        anchors: &'a [Anchor],
        window: Option<Forecast>,
    ) -> Search<'a> {
        Search {
            link: &self.mechanism.links[b],
            anchors,
            sky,
            free,
            window,
            reach_sigma: REACH_SIGMA,
            floor_px: self.habits.floor_px,
            pairs: PAIRS,
        }
    }
}
