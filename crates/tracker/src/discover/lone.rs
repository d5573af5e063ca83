//! Markers that belong to no body of three: alone, or the only one of their link.
//!
//! Owns: [`find_lone`]. Here frames are linked by nearness, since there are no distances to go by.

use nalgebra::{Isometry2, Vector2};

use super::arrange::Found;
use super::bodies::{FLOOR_PX, link_of};
use super::sample::Sample;
use crate::store::DetectionStore;

/// Frames linked at most.
const FRAMES: usize = 3000;
/// Frames a path must have to be a marker's.
const LEAST: usize = 6;

/// A marker's way through the recording.
#[derive(Debug, Clone)]
struct Path {
    at: Vec<(usize, Vector2<f64>)>,
    /// Areas and elongations of its detections.
    shape: Vec<(f32, f32)>,
}

impl Path {
    fn guess(&self, frame: usize) -> Option<Vector2<f64>> {
        let &(f0, p0) = self.at.last()?;
        let h = (frame - f0) as f64;
        Some(match self.at.len() {
            1 => p0,
            n => {
                let (f1, p1) = self.at[n - 2];
                p0 + (p0 - p1) / (f0 - f1) as f64 * h
            }
        })
    }

    /// Whether its detections look alike and round, as a marker's do and a hand's do not.
    fn is_marker(&self) -> bool {
        let mut areas: Vec<f32> = self.shape.iter().map(|s| s.0).collect();
        areas.sort_by(f32::total_cmp);
        let mut long: Vec<f32> = self.shape.iter().map(|s| s.1).collect();
        long.sort_by(f32::total_cmp);
        let n = areas.len();
        // Four fifths within a factor of 1.6 in area: blur and compression change it, not more.
        areas[n - 1 - n / 10] < 1.6 * areas[n / 10] && long[n / 2] < 1.8
    }

    fn travelled(&self) -> f64 {
        let first = self.at[0].1;
        self.at.iter().map(|p| (p.1 - first).norm()).fold(0.0, f64::max)
    }
}

/// Bodies of one marker each, with their places in the sample's frames.
pub fn find_lone(store: &DetectionStore, sample: &Sample, standing: &[Vector2<f64>]) -> Vec<Found> {
    let mut open: Vec<Path> = Vec::new();
    let mut done: Vec<Path> = Vec::new();
    let mut scratch = Vec::new();
    for i in 0..store.len().min(FRAMES) {
        store.read(i, &mut scratch);
        let mut free: Vec<(Vector2<f64>, (f32, f32))> = scratch
            .iter()
            .map(|d| (Vector2::new(d.x_px, d.y_px), (d.area_px, d.elongation)))
            .filter(|(p, _)| standing.iter().all(|s| (s - p).norm() > super::sample::STILL_PX))
            .collect();
        // Nearest pairs first, each used once.
        let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
        for (k, path) in open.iter().enumerate() {
            let Some(guess) = path.guess(i) else { continue };
            for (d, (p, _)) in free.iter().enumerate() {
                let gate = if path.at.len() == 1 { 40.0 } else { 15.0 };
                let r = (p - guess).norm();
                if r < gate {
                    pairs.push((r, k, d));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut used = vec![false; free.len()];
        let mut grown = vec![false; open.len()];
        for (_, k, d) in pairs {
            if !used[d] && !grown[k] {
                used[d] = true;
                grown[k] = true;
                open[k].at.push((i, free[d].0));
                open[k].shape.push(free[d].1);
            }
        }
        let mut still = Vec::new();
        for path in open.drain(..) {
            let last = path.at.last().map_or(0, |p| p.0);
            if i - last > 3 { done.push(path) } else { still.push(path) }
        }
        open = still;
        let mut keep = used.iter();
        free.retain(|_| !keep.next().copied().unwrap_or(false));
        open.extend(free.into_iter().map(|(p, s)| Path { at: vec![(i, p)], shape: vec![s] }));
    }
    done.append(&mut open);
    done.retain(|p| p.at.len() >= LEAST && p.travelled() > 10.0 && p.is_marker());
    done.sort_by_key(|p| std::cmp::Reverse(p.at.len()));
    // Paths that overlap in time are different markers; one that fits none beside it may be any of them.
    let mut kept: Vec<Path> = Vec::new();
    for path in done {
        let span = |p: &Path| (p.at[0].0, p.at[p.at.len() - 1].0);
        let (a, b) = span(&path);
        let overlaps = |q: &Path| {
            let (c, d) = span(q);
            a <= d && c <= b
        };
        if kept.iter().all(overlaps) {
            kept.push(path);
        }
    }
    kept.iter()
        .map(|path| {
            let mut poses = vec![None; sample.frames.len()];
            for &(f, p) in &path.at {
                if let Ok(k) = sample.frames.binary_search(&f) {
                    poses[k] = Some(Isometry2::new(p, 0.0));
                }
            }
            Found { link: link_of(vec![path.at[0].1], FLOOR_PX), poses }
        })
        .collect()
}
