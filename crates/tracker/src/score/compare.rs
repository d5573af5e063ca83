//! The comparison itself: which node stands for which marker, and what follows from it.
//!
//! Owns: [`Comparison`]. Must not: read tables.

use super::result::{AngleError, FULL, HALF, Match, Reacquisition, Score, Tracked};
use crate::error::{Error, Fault, Result};
use crate::synth::Truth;

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
        let (n, m) = (self.tracked.nodes.len(), self.truth.nodes.len());
        let of = self.consensus();
        let node_of: Vec<Option<usize>> = (0..m).map(|j| of.iter().position(|o| *o == Some(j))).collect();
        let mut s = Score {
            frames: self.rows.len() as u64,
            frames_missing: (self.truth.frames.len() - self.rows.len()) as u64,
            matches: Vec::new(),
            unmatched: (0..m)
                .filter(|&j| node_of[j].is_none())
                .map(|j| self.truth.nodes[j].0.clone())
                .collect(),
            visible_rows: 0,
            covered_rows: 0,
            coverage: 1.0,
            wrong: 0,
            switches: 0,
            false_positives: 0,
            reacquisition: Reacquisition::default(),
            rms_x_px: f64::NAN,
            rms_y_px: f64::NAN,
            bias_px: [f64::NAN; 2],
            error_over_sigma: None,
            angles: Vec::new(),
            first_wrong: Vec::new(),
        };
        let mut per_marker = vec![[0u64; 2]; m];
        let (mut sum, mut squares, mut count) = ([0.0; 2], [0.0; 2], 0u64);
        let (mut ratios, mut ratio_count) = (0.0, 0u64);
        let mut at: Vec<Option<usize>> = vec![None; n];
        for &(row, t) in &self.rows {
            for j in 0..m {
                if self.visible(t, j) >= HALF {
                    per_marker[j][0] += 1;
                    let seen = node_of[j].and_then(|i| self.place(row, i));
                    per_marker[j][1] += u64::from(seen.is_some_and(|p| self.agrees(p, t, j)));
                }
            }
            for i in 0..n {
                let Some(p) = self.place(row, i) else { continue };
                // Its own marker first: two markers may be within the limit of each other.
                let own = of[i].filter(|&j| self.agrees(p, t, j) && self.visible(t, j) > 0.0);
                let here = own.or_else(|| (0..m).find(|&j| self.visible(t, j) > 0.0 && self.agrees(p, t, j)));
                let Some(j) = here else {
                    s.false_positives += 1;
                    continue;
                };
                if own.is_none() {
                    s.wrong += 1;
                    if s.first_wrong.len() < 10 {
                        s.first_wrong.push((
                            self.truth.frames[t].frame,
                            self.tracked.nodes[i].clone(),
                            self.truth.nodes[j].0.clone(),
                        ));
                    }
                }
                s.switches += u64::from(at[i].is_some_and(|before| before != j));
                at[i] = Some(j);
                if own.is_some() && self.visible(t, j) >= FULL {
                    let mark = &self.truth.frames[t].nodes[j];
                    let e = [p[0] - mark.x_px, p[1] - mark.y_px];
                    count += 1;
                    for axis in 0..2 {
                        sum[axis] += e[axis];
                        squares[axis] += e[axis] * e[axis];
                    }
                    if let Some(&sigma) = self.tracked.sigma_px.get(row * n + i) {
                        let sigma = f64::from(sigma);
                        if sigma.is_finite() && sigma > 0.0 {
                            ratios += (e[0] * e[0] + e[1] * e[1]) / (sigma * sigma);
                            ratio_count += 2;
                        }
                    }
                }
            }
        }
        for (i, node) in self.tracked.nodes.iter().enumerate() {
            s.matches.push(Match {
                node: node.clone(),
                truth: of[i].map(|j| self.truth.nodes[j].0.clone()),
                coverage: of[i].map_or(0.0, |j| part(per_marker[j][1], per_marker[j][0])),
            });
        }
        s.visible_rows = per_marker.iter().map(|c| c[0]).sum();
        s.covered_rows = per_marker.iter().map(|c| c[1]).sum();
        s.coverage = part(s.covered_rows, s.visible_rows);
        if count > 0 {
            let c = count as f64;
            s.rms_x_px = (squares[0] / c).sqrt();
            s.rms_y_px = (squares[1] / c).sqrt();
            s.bias_px = [sum[0] / c, sum[1] / c];
        }
        s.error_over_sigma = (ratio_count > 0).then(|| (ratios / ratio_count as f64).sqrt());
        s.reacquisition = self.reacquisition(&node_of);
        s.angles = self.angles(&node_of);
        Ok(s)
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
