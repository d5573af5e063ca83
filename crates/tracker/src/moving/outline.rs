//! The circle that most of a region's outline lies on: a disc of which stripes, highlights or fingers cover a part.
//!
//! Owns: [`Circle`], [`circle_of`]. Must not: find regions.

use std::ops::Range;

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

/// An outline of fewer points shows no circle.
const LEAST_POINTS: usize = 24;
/// Points of the outline from which circles are tried.
const TRIALS: usize = 48;
/// A point is on the circle if it is as near as this: in parts of the radius, and at least in px, the outline's own steps.
const ON_PART: f64 = 0.06;
const ON_PX: f64 = 0.6;
/// Part of the outline that must be on it, and part of the circle that must show.
const ON_OUTLINE: f64 = 0.5;
const ON_CIRCLE: f64 = 0.5;
/// Directions in which it may show.
const DIRECTIONS: usize = 24;
/// Radius of the circle over that of a disc of the region's area: what is covered may be two thirds.
const RADII: Range<f64> = 0.85..1.7;

/// Radius of the circle over the radius known from other pictures.
const KNOWN: Range<f64> = 0.9..1.1;

/// A circle, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Circle {
    /// Its middle.
    pub middle: [f64; 2],
    /// Its radius.
    pub radius: f64,
}

/// The circle of an outline; `None` where it has none. `radius` is that of a disc of the region's area.
pub fn circle_of(outline: &[[f64; 2]], radius: f64) -> Option<Circle> {
    circle(outline, RADII.start * radius..RADII.end * radius, None)
}

/// The circle of an outline whose radius is known: where little of it shows, its middle is then known better.
pub fn circle_of_radius(outline: &[[f64; 2]], radius: f64) -> Option<Circle> {
    circle(outline, KNOWN.start * radius..KNOWN.end * radius, Some(radius))
}

fn circle(outline: &[[f64; 2]], radii: Range<f64>, known: Option<f64>) -> Option<Circle> {
    if outline.len() < LEAST_POINTS {
        return None;
    }
    let n = outline.len() as f64;
    let mean = [0, 1].map(|k| outline.iter().map(|p| p[k]).sum::<f64>() / n);
    let mut points: Vec<Vector2<f64>> =
        outline.iter().map(|p| Vector2::new(p[0] - mean[0], p[1] - mean[1])).collect();
    points.sort_by(|a, b| a.y.atan2(a.x).total_cmp(&b.y.atan2(b.x)));
    let count = points.len();
    let on = |c: &(Vector2<f64>, f64)| -> Vec<Vector2<f64>> {
        let near = (ON_PART * c.1).max(ON_PX);
        points.iter().filter(|p| ((*p - c.0).norm() - c.1).abs() < near).copied().collect()
    };
    // Three points a sixth of the outline apart: some three of them are on the part that shows.
    let trials = (0..TRIALS).filter_map(|k| {
        let from = k * count / TRIALS;
        fitted(&[0, 1, 2].map(|j| points[(from + j * count / 6) % count]))
    });
    let fits = |c: &(Vector2<f64>, f64)| radii.contains(&c.1);
    let mut best = trials.filter(fits).max_by_key(|c| on(c).len())?;
    for _ in 0..3 {
        best = match known {
            None => fitted(&on(&best)).filter(fits)?,
            Some(radius) => (centred(&on(&best), best.0, radius)?, radius),
        };
    }
    let shown = on(&best);
    let mut directions = [false; DIRECTIONS];
    for p in &shown {
        let turn = (p.y - best.0.y).atan2(p.x - best.0.x) / std::f64::consts::TAU + 0.5;
        directions[((turn * DIRECTIONS as f64) as usize).min(DIRECTIONS - 1)] = true;
    }
    let part = directions.iter().filter(|d| **d).count() as f64 / DIRECTIONS as f64;
    let enough = shown.len() as f64 >= ON_OUTLINE * n && part >= ON_CIRCLE;
    enough.then(|| Circle { middle: [best.0.x + mean[0], best.0.y + mean[1]], radius: best.1 })
}

/// The middle of the circle of a radius, from one near it: a Gauss-Newton step of the distances to the circle.
fn centred(points: &[Vector2<f64>], from: Vector2<f64>, radius: f64) -> Option<Vector2<f64>> {
    let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
    for p in points {
        let ray = p - from;
        let length = ray.norm();
        if length > 0.0 {
            let out = ray / length;
            normal += out * out.transpose();
            right += (length - radius) * out;
        }
    }
    Some(from + normal.cholesky()?.solve(&right))
}

/// The least-squares circle (Kasa): |p|^2 = 2 c p + k is linear in its middle c.
fn fitted(points: &[Vector2<f64>]) -> Option<(Vector2<f64>, f64)> {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for p in points {
        let row = Vector3::new(p.x, p.y, 1.0);
        normal += row * row.transpose();
        right += row * p.norm_squared();
    }
    let x = normal.cholesky()?.solve(&right);
    let middle = Vector2::new(x[0], x[1]) / 2.0;
    let square = x[2] + middle.norm_squared();
    (square > 0.0).then(|| (middle, square.sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The steps of a disc's outline, cut off above a line.
    fn outline(x: f64, y: f64, radius: f64, top: f64) -> (Vec<[f64; 2]>, f64) {
        let inside =
            |i: i32, j: i32| (f64::from(i) - x).hypot(f64::from(j) - y) < radius && f64::from(j) > top;
        let (mut out, mut area) = (Vec::new(), 0.0);
        for j in 0..80 {
            for i in 0..80 {
                if !inside(i, j) {
                    continue;
                }
                area += 1.0;
                for (u, v) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
                    if !inside(i + u, j + v) {
                        out.push([f64::from(i) + f64::from(u) / 2.0, f64::from(j) + f64::from(v) / 2.0]);
                    }
                }
            }
        }
        (out, (area / std::f64::consts::PI).sqrt())
    }

    #[test]
    fn a_disc_of_which_the_top_is_missing_has_its_own_middle() {
        for (radius, part) in [(8.0, 2.0), (8.0, 0.5), (12.0, 0.55), (20.0, 0.4)] {
            let (x, y) = (40.3, 39.8);
            let (points, region) = outline(x, y, radius, y - part * radius);
            let c = circle_of(&points, region).unwrap();
            let off = (c.middle[0] - x).hypot(c.middle[1] - y);
            assert!(off < 0.05 * radius, "{radius}, {part}: {off}");
            assert!((c.radius / radius - 1.0).abs() < 0.06, "{radius}, {part}: {}", c.radius);
        }
    }

    #[test]
    fn a_known_radius_holds_the_middle_where_half_of_the_outline_is_frayed() {
        let (x, y, radius) = (40.3, 39.8, 12.0);
        let (mut points, region) = outline(x, y, radius, y - 0.4 * radius);
        // Steps of the lower part are off by up to a pixel, as a codec and blur make them.
        for (k, p) in points.iter_mut().enumerate().filter(|(_, p)| p[1] > y) {
            p[1] += 0.4 * (k % 5) as f64 - 0.8;
        }
        let off = |c: Circle| (c.middle[0] - x).hypot(c.middle[1] - y);
        let (free, known) =
            (circle_of(&points, region).map(off), circle_of_radius(&points, radius).map(off).unwrap());
        assert!(known < 0.05 * radius, "{known}");
        assert!(free.is_none_or(|free| known < free), "{known}, {free:?}");
    }

    #[test]
    fn a_square_and_a_bar_have_no_circle() {
        let line = |n: i32, f: fn(f64) -> [f64; 2]| (0..n).map(|k| f(f64::from(k))).collect::<Vec<_>>();
        let square = [
            line(20, |t| [t, 0.0]),
            line(20, |t| [t, 20.0]),
            line(20, |t| [0.0, t]),
            line(20, |t| [20.0, t]),
        ]
        .concat();
        assert_eq!(circle_of(&square, 11.3), None);
        let bar = [line(60, |t| [t, 0.0]), line(60, |t| [t, 8.0])].concat();
        assert_eq!(circle_of(&bar, 12.0), None);
    }
}
