//! Compares a table with the truth: which node stands for which marker, and what follows from it.
//!
//! Owns: [`Comparison`]. Must not: read tables.

use super::result::{AngleError, FULL, HALF, Match, Reacquisition, Score, Tracked};
use crate::error::{Error, Fault, Result};
use crate::synth::Truth;

/// Maximum number of wrong identities that a [`Score`] names.
const FIRST_WRONG: usize = 10;

/// Correctness of the nodes' identities.
#[derive(Default)]
struct Identities {
    wrong: u64,
    switches: u64,
    false_positives: u64,
    first_wrong: Vec<(u64, String, String)>,
}

/// Sums over the errors of places.
#[derive(Default)]
struct Errors {
    count: u64,
    sum_px: [f64; 2],
    squares_px2: [f64; 2],
    /// Squared errors over their variances, and how many coordinates.
    over_variance: f64,
    with_sigma: u64,
}

impl Errors {
    fn add(&mut self, error_px: [f64; 2], sigma_px: Option<f64>) {
        self.count += 1;
        for (axis, error) in error_px.into_iter().enumerate() {
            self.sum_px[axis] += error;
            self.squares_px2[axis] += error * error;
        }
        if let Some(sigma) = sigma_px.filter(|s| s.is_finite() && *s > 0.0) {
            self.over_variance += (error_px[0] * error_px[0] + error_px[1] * error_px[1]) / (sigma * sigma);
            self.with_sigma += 2;
        }
    }

    /// Root mean square error of an axis, px; NaN without errors.
    fn rms_px(&self, axis: usize) -> f64 {
        if self.count > 0 { (self.squares_px2[axis] / self.count as f64).sqrt() } else { f64::NAN }
    }

    /// Mean error of an axis, px; NaN without errors.
    fn bias_px(&self, axis: usize) -> f64 {
        if self.count > 0 { self.sum_px[axis] / self.count as f64 } else { f64::NAN }
    }

    /// Root mean square of error over stated uncertainty; `None` where none is stated.
    fn over_sigma(&self) -> Option<f64> {
        (self.with_sigma > 0).then(|| (self.over_variance / self.with_sigma as f64).sqrt())
    }
}

/// A table and a truth, frame by frame.
pub(super) struct Comparison<'a> {
    pub(super) tracked: &'a Tracked,
    pub(super) truth: &'a Truth,
    /// (row of the table, row of the truth) of each frame that both have.
    pub(super) rows: Vec<(usize, usize)>,
    /// Square of the distance within which a place agrees, px2.
    pub(super) limit2: f64,
}

impl Comparison<'_> {
    /// Place of a node in a row of the table, if it has one.
    fn place(&self, row: usize, node: usize) -> Option<[f64; 2]> {
        let p = self.tracked.xy_px[row * self.tracked.nodes.len() + node];
        (p[0].is_finite() && p[1].is_finite()).then_some(p)
    }

    fn agrees(&self, p: [f64; 2], truth_row: usize, marker: usize) -> bool {
        let t = &self.truth.frames[truth_row].nodes[marker];
        let (dx, dy) = (p[0] - t.x_px, p[1] - t.y_px);
        dx * dx + dy * dy <= self.limit2
    }

    fn visible(&self, truth_row: usize, marker: usize) -> f64 {
        self.truth.frames[truth_row].nodes[marker].visible
    }

    /// For each tracked node the true one it agrees with most often, each given once, largest counts first.
    fn consensus(&self) -> Vec<Option<usize>> {
        let (n, m) = (self.tracked.nodes.len(), self.truth.nodes.len());
        let mut votes = vec![0u64; n * m];
        for &(row, t) in &self.rows {
            for i in 0..n {
                let Some(p) = self.place(row, i) else { continue };
                for j in 0..m {
                    votes[i * m + j] += u64::from(self.agrees(p, t, j));
                }
            }
        }
        let mut order: Vec<usize> = (0..n * m).filter(|&k| votes[k] > 0).collect();
        order.sort_by_key(|&k| (std::cmp::Reverse(votes[k]), k));
        let (mut of, mut taken) = (vec![None; n], vec![false; m]);
        for k in order {
            let (i, j) = (k / m, k % m);
            if of[i].is_none() && !taken[j] {
                of[i] = Some(j);
                taken[j] = true;
            }
        }
        of
    }

    pub(super) fn score(&self) -> Result<Score> {
        let m = self.truth.nodes.len();
        let of = self.consensus();
        let node_of: Vec<Option<usize>> = (0..m).map(|j| of.iter().position(|o| *o == Some(j))).collect();
        let per_marker = self.coverage(&node_of);
        let identities = self.identities(&of);
        let errors = self.errors(&of);
        let name = |j: usize| self.truth.nodes[j].0.clone();
        let (visible_rows, covered_rows) =
            (per_marker.iter().map(|c| c[0]).sum(), per_marker.iter().map(|c| c[1]).sum());
        Ok(Score {
            frames: self.rows.len() as u64,
            frames_missing: (self.truth.frames.len() - self.rows.len()) as u64,
            matches: (self.tracked.nodes.iter().zip(&of))
                .map(|(node, of)| Match {
                    node: node.clone(),
                    truth: of.map(name),
                    coverage: of.map_or(0.0, |j| part(per_marker[j][1], per_marker[j][0])),
                })
                .collect(),
            unmatched: (0..m).filter(|&j| node_of[j].is_none()).map(name).collect(),
            visible_rows,
            covered_rows,
            coverage: part(covered_rows, visible_rows),
            wrong: identities.wrong,
            switches: identities.switches,
            false_positives: identities.false_positives,
            first_wrong: identities.first_wrong,
            reacquisition: self.reacquisition(&node_of),
            rms_x_px: errors.rms_px(0),
            rms_y_px: errors.rms_px(1),
            bias_px: [errors.bias_px(0), errors.bias_px(1)],
            error_over_sigma: errors.over_sigma(),
            angles: self.angles(&node_of),
        })
    }

    /// For each marker the rows in which it is at least half visible, and those of them in which its node agrees.
    fn coverage(&self, node_of: &[Option<usize>]) -> Vec<[u64; 2]> {
        let mut out = vec![[0u64; 2]; node_of.len()];
        for &(row, t) in &self.rows {
            for (j, count) in out.iter_mut().enumerate() {
                if self.visible(t, j) >= HALF {
                    count[0] += 1;
                    let seen = node_of[j].and_then(|i| self.place(row, i));
                    count[1] += u64::from(seen.is_some_and(|p| self.agrees(p, t, j)));
                }
            }
        }
        out
    }

    /// The marker at a place in a row of the truth: the node's `own` if it agrees, since two markers may be within the limit
    /// of each other.
    fn marker_at(&self, p: [f64; 2], t: usize, own: Option<usize>) -> Option<usize> {
        let agrees = |j: usize| self.visible(t, j) > 0.0 && self.agrees(p, t, j);
        own.filter(|&j| agrees(j)).or_else(|| (0..self.truth.nodes.len()).find(|&j| agrees(j)))
    }

    /// Counts of the rows by the marker that each node was at: wrong ones, changes, none.
    fn identities(&self, of: &[Option<usize>]) -> Identities {
        let mut out = Identities::default();
        let mut at: Vec<Option<usize>> = vec![None; of.len()];
        for &(row, t) in &self.rows {
            for (i, &own) in of.iter().enumerate() {
                let Some(p) = self.place(row, i) else { continue };
                let Some(j) = self.marker_at(p, t, own) else {
                    out.false_positives += 1;
                    continue;
                };
                if own != Some(j) {
                    out.wrong += 1;
                    if out.first_wrong.len() < FIRST_WRONG {
                        let frame = self.truth.frames[t].frame;
                        let node = self.tracked.nodes[i].clone();
                        out.first_wrong.push((frame, node, self.truth.nodes[j].0.clone()));
                    }
                }
                out.switches += u64::from(at[i].is_some_and(|before| before != j));
                at[i] = Some(j);
            }
        }
        out
    }

    /// Errors of the places of fully visible markers at which their own nodes are.
    fn errors(&self, of: &[Option<usize>]) -> Errors {
        let mut out = Errors::default();
        for &(row, t) in &self.rows {
            for (i, &own) in of.iter().enumerate() {
                let Some((p, j)) = self.place(row, i).zip(own) else { continue };
                if self.visible(t, j) >= FULL && self.agrees(p, t, j) {
                    let mark = &self.truth.frames[t].nodes[j];
                    let sigma = self.tracked.sigma_px.get(row * of.len() + i);
                    out.add([p[0] - mark.x_px, p[1] - mark.y_px], sigma.map(|s| f64::from(*s)));
                }
            }
        }
        out
    }

    fn reacquisition(&self, node_of: &[Option<usize>]) -> Reacquisition {
        let mut r = Reacquisition::default();
        for (j, node) in node_of.iter().enumerate() {
            // Hidden until it is fully visible, then waited for until its node agrees.
            let mut hidden = self.rows.first().is_some_and(|&(_, t)| self.visible(t, j) < HALF);
            let mut waiting: Option<u64> = None;
            let mut done = |waited: u64, seen: bool| {
                r.cases += 1;
                r.at_once += u64::from(seen && waited == 0);
                r.within_3 += u64::from(seen && waited <= 3);
                r.never += u64::from(!seen);
                r.longest = r.longest.max(waited);
            };
            for &(row, t) in &self.rows {
                let v = self.visible(t, j);
                if v < HALF {
                    if let Some(waited) = waiting.take() {
                        done(waited, false);
                    }
                    hidden = true;
                    continue;
                }
                if hidden && v >= FULL {
                    hidden = false;
                    waiting = Some(0);
                }
                if let Some(waited) = waiting {
                    let seen = node.and_then(|i| self.place(row, i)).is_some_and(|p| self.agrees(p, t, j));
                    if seen {
                        done(waited, true);
                        waiting = None;
                    } else {
                        waiting = Some(waited + 1);
                    }
                }
            }
            if let Some(waited) = waiting {
                done(waited, false);
            }
        }
        r
    }

    /// The turn that takes each body's true places to its tracked ones, by least squares about their means.
    fn angles(&self, node_of: &[Option<usize>]) -> Vec<AngleError> {
        let mut bodies: Vec<&str> = Vec::new();
        for (_, body) in &self.truth.nodes {
            if !bodies.contains(&body.as_str()) {
                bodies.push(body);
            }
        }
        let mut errors = Vec::new();
        for body in bodies {
            let (mut squares, mut worst, mut frames) = (0.0, 0.0f64, 0u64);
            let mut points: Vec<([f64; 2], [f64; 2])> = Vec::new();
            for &(row, t) in &self.rows {
                points.clear();
                for (j, node) in node_of.iter().enumerate() {
                    if self.truth.nodes[j].1 != body {
                        continue;
                    }
                    let Some(p) = node.and_then(|i| self.place(row, i)) else { continue };
                    if self.agrees(p, t, j) {
                        let mark = &self.truth.frames[t].nodes[j];
                        points.push((p, [mark.x_px, mark.y_px]));
                    }
                }
                if points.len() < 2 {
                    continue;
                }
                let k = points.len() as f64;
                let mean = |pick: fn(&([f64; 2], [f64; 2])) -> f64| points.iter().map(pick).sum::<f64>() / k;
                let (px, py) = (mean(|p| p.0[0]), mean(|p| p.0[1]));
                let (tx, ty) = (mean(|p| p.1[0]), mean(|p| p.1[1]));
                let (mut dot, mut cross) = (0.0, 0.0);
                for (p, t) in &points {
                    let (a, b, c, d) = (p[0] - px, p[1] - py, t[0] - tx, t[1] - ty);
                    dot += a * c + b * d;
                    cross += c * b - d * a;
                }
                let degrees = cross.atan2(dot).to_degrees();
                squares += degrees * degrees;
                worst = worst.max(degrees.abs());
                frames += 1;
            }
            errors.push(AngleError {
                body: body.to_string(),
                rms_deg: (squares / frames as f64).sqrt(),
                worst_deg: worst,
                frames,
            });
        }
        errors
    }
}

fn part(some: u64, all: u64) -> f64 {
    if all == 0 { 1.0 } else { some as f64 / all as f64 }
}

/// Distance within which a place agrees with a marker, px.
pub const LIMIT_PX: f64 = 2.0;

/// Compares a table with the truth; `limit_px` is [`LIMIT_PX`] unless there is a reason.
///
/// # Errors
/// [`Error::Argument`] if the two have no frame in common or the lengths do not fit.
pub fn score(tracked: &Tracked, truth: &Truth, limit_px: f64) -> Result<Score> {
    let n = tracked.nodes.len();
    if n == 0 || tracked.xy_px.len() != n * tracked.frames.len() {
        return Err(Error::Argument(Fault::new(
            "nodes",
            format!("{} places for {} frames of {n} nodes", tracked.xy_px.len(), tracked.frames.len()),
        )));
    }
    let rows = pair_frames(tracked, truth);
    if rows.is_empty() {
        return Err(Error::Argument(
            Fault::new("nodes", "no frame is both in the table and in the truth")
                .advice("Give the truth of the same film"),
        ));
    }
    Comparison { tracked, truth, rows, limit2: limit_px * limit_px }.score()
}

/// (row of the table, row of the truth) of each frame that both have.
fn pair_frames(tracked: &Tracked, truth: &Truth) -> Vec<(usize, usize)> {
    let mut pairs = Vec::new();
    let mut i = 0;
    for (k, frame) in truth.frames.iter().enumerate() {
        while i < tracked.frames.len() && tracked.frames[i] < frame.frame {
            i += 1;
        }
        if tracked.frames.get(i) == Some(&frame.frame) {
            pairs.push((i, k));
        }
    }
    pairs
}
