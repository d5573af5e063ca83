//! Finds where a template may be: normalised cross-correlation at every whole pixel of a gate.
//!
//! Owns: [`Plane`], [`search`]. Must not: choose between places.

use super::template::{Pose, Template, normalise};

/// Points of a template that are compared, at most: so many tell a likeness to some hundredths.
const MOST_POINTS: usize = 200;
/// Places that are looked at closely for one turn.
const STARTS: usize = 3;
/// Likeness from which on a place is one: between pixels that of the finest texture is half of what it is on them.
const LEAST_LIKENESS: f64 = 0.4;

/// Brightness of a picture.
#[derive(Clone)]
pub struct Plane {
    /// Row by row.
    pub values: Vec<f32>,
    /// Width and height, px.
    pub size: (usize, usize),
}

impl Plane {
    /// The pixel at or before a place, with the weights of it and its three neighbours; `None` outside.
    fn cell(&self, [x, y]: [f64; 2]) -> Option<(usize, [f32; 4])> {
        let (w, h) = self.size;
        if !(x >= 0.0 && y >= 0.0 && x < (w - 1) as f64 && y < (h - 1) as f64) {
            return None;
        }
        let (u, v) = (x.fract() as f32, y.fract() as f32);
        let weights = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
        Some((y as usize * w + x as usize, weights))
    }

    /// Of four neighbours by their weights.
    fn mean(&self, i: usize, weights: &[f32; 4]) -> f64 {
        let (v, w) = (&self.values, self.size.0);
        f64::from(
            weights[0] * v[i] + weights[1] * v[i + 1] + weights[2] * v[i + w] + weights[3] * v[i + w + 1],
        )
    }

    /// Value at a place, between pixels by their neighbours; `None` outside.
    pub fn at(&self, place: [f64; 2]) -> Option<f64> {
        self.cell(place).map(|(i, weights)| self.mean(i, &weights))
    }

    /// Likeness of what is at a pose, between pixels by their neighbours; `None` beyond the border or of what is all alike.
    pub fn likeness(&self, template: &Template, pose: &Pose) -> Option<f64> {
        let mut values = Vec::with_capacity(template.points.len());
        for &point in &template.points {
            let (i, weights) = self.cell(pose.place(point))?;
            values.push(self.mean(i, &weights));
        }
        normalise(&mut values)?;
        Some(values.iter().zip(&template.values).map(|(a, b)| a * b).sum())
    }
}

/// Poses within `gate_px` of a start at which the likeness is greatest, by whole pixels.
pub fn search(template: &Template, plane: &Plane, start: &Pose, gate_px: f64) -> Vec<Pose> {
    let stride = template.points.len().div_ceil(MOST_POINTS);
    let chosen: Vec<usize> = (0..template.points.len()).step_by(stride).collect();
    let mut then: Vec<f64> = chosen.iter().map(|&k| template.values[k]).collect();
    if normalise(&mut then).is_none() {
        return Vec::new();
    }
    // All shifts have the same parts of a pixel: places are taken about one far inside.
    let (w, h) = (plane.size.0 as i64, plane.size.1 as i64);
    let places: Vec<(i64, i64, [f32; 4])> = chosen
        .iter()
        .map(|&k| {
            let [x, y] = start.place(template.points[k]);
            let (u, v) = ((x - x.floor()) as f32, (y - y.floor()) as f32);
            let weights = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
            (x.floor() as i64, y.floor() as i64, weights)
        })
        .collect();
    let reach = gate_px.ceil() as i64;
    let side = (2 * reach + 1) as usize;
    let n = places.len() as f64;
    let at = |dx: i64, dy: i64| -> f64 {
        let [mut sum, mut squares, mut product] = [0.0; 3];
        for ((x, y, weights), then) in places.iter().zip(&then) {
            let (x, y) = (x + dx, y + dy);
            if x < 0 || y < 0 || x + 1 >= w || y + 1 >= h {
                return f64::NEG_INFINITY;
            }
            let value = plane.mean((y * w + x) as usize, weights);
            sum += value;
            squares += value * value;
            product += value * then;
        }
        product / (squares - sum * sum / n).max(1e-9).sqrt()
    };
    let shifts = || (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy)));
    let inside = |dx: i64, dy: i64| (dx * dx + dy * dy) as f64 <= gate_px * gate_px + 1.0;
    let map: Vec<f64> =
        shifts().map(|(dx, dy)| if inside(dx, dy) { at(dx, dy) } else { f64::NEG_INFINITY }).collect();
    let mut peaks: Vec<(f64, i64, i64)> = shifts()
        .zip(&map)
        .filter(|((dx, dy), v)| {
            let (i, j) = ((dx + reach) as usize, (dy + reach) as usize);
            let rows = j.saturating_sub(1)..(j + 2).min(side);
            **v > LEAST_LIKENESS
                && rows
                    .flat_map(|j| &map[j * side..][i.saturating_sub(1)..(i + 2).min(side)])
                    .all(|o| o <= *v)
        })
        .map(|((dx, dy), v)| (*v, dx, dy))
        .collect();
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    peaks.truncate(STARTS);
    peaks
        .into_iter()
        .map(|(_, dx, dy)| Pose { x: start.x + dx as f64, y: start.y + dy as f64, ..*start })
        .collect()
}
