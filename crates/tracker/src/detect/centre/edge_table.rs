//! Tabulates how much of a pixel a disc with a blurred edge covers.
//!
//! Owns: [`EdgeTable`]. Must not: fit anything.

use crate::detect::simd::lanes::{Eight, LANES};

/// Steps of distance per pixel.
const PER_PX: usize = 32;
/// Directions of the edge from along an axis to along a diagonal; of pixels that are not square twice as many, from
/// along one axis to along the other.
const DIRECTIONS: usize = 16;
/// Room for the widest blur: a power of two, so that an index needs no check.
const SIZE: usize = 16384;
/// Chords per pixel in the integral.
const CHORDS: usize = 32;

/// Coverage of a pixel and its slope, by the distance of the pixel's centre inside the disc's edge and by the
/// edge's direction. Made for one radius and one blur; the curvature of other radii changes it by less than
/// 1/24 px times the difference of the curvatures.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct EdgeTable {
    /// Coverage and its derivative by distance in 1/px, direction by direction.
    rows: Box<[[f32; 2]; SIZE]>,
    last_column: f32,
    /// Rows for the whole range of what [`EdgeTable::spot`] calls the direction, and the last of them.
    all_rows: f32,
    last_row: f32,
    /// Whether pixels are as wide as high, so that all four quarters and both halves of each are alike.
    pub square: bool,
    /// Distance from the edge beyond which coverage is 0 or 1, px.
    pub reach_px: f64,
}

/// Area of the pixel about (x, y), of the given sides and of area 1, inside a disc of radius r about the origin.
fn disc_in_pixel(x: f64, y: f64, r: f64, [wide, high]: [f64; 2]) -> f64 {
    let mut sum = 0.0;
    for k in 0..CHORDS {
        let yy = y - 0.5 * high + (k as f64 + 0.5) / CHORDS as f64 * high;
        let half = (r * r - yy * yy).max(0.0).sqrt();
        sum += ((x + 0.5 * wide).min(half) - (x - 0.5 * wide).max(-half)).max(0.0);
    }
    sum * high / CHORDS as f64
}

impl EdgeTable {
    /// The table for discs of a radius whose edge is blurred by a Gaussian of standard deviation `blur_px`, in pixels of
    /// the given sides and of area 1.
    pub fn new(radius_px: f64, blur_px: f64, sides: [f64; 2]) -> Self {
        // A little more than half of a pixel's diagonal.
        let reach = (0.04 + 0.5 * sides[0].hypot(sides[1])).max(0.75) + 3.0 * blur_px;
        let square = sides == [1.0; 2];
        let directions = if square { DIRECTIONS } else { 2 * DIRECTIONS };
        let half = (reach * PER_PX as f64).ceil() as usize;
        let columns = 2 * half + 1;
        let spread = (3.5 * blur_px * PER_PX as f64).ceil() as usize;
        let kernel: Vec<f64> = (0..=2 * spread)
            .map(|i| {
                let t = (i as f64 - spread as f64) / PER_PX as f64 / blur_px.max(1e-9);
                (-0.5 * t * t).exp()
            })
            .collect();
        let total: f64 = kernel.iter().sum();
        let mut rows = Box::new([[0.0; 2]; SIZE]);
        debug_assert!(columns * directions <= SIZE);
        let mut sharp = vec![0.0; columns + 2 * spread + 2];
        let mut soft = vec![0.0; columns + 2];
        for k in 0..directions {
            let part = (k as f64 + 0.5) / directions as f64;
            // The component along y, of which `spot` is given the smaller component or the two's difference.
            let s = if square {
                part * std::f64::consts::FRAC_1_SQRT_2
            } else {
                let d = 2.0 * part - 1.0;
                (d + (2.0 - d * d).sqrt()) / 2.0
            };
            let c = (1.0 - s * s).max(0.0).sqrt();
            for (i, v) in sharp.iter_mut().enumerate() {
                let d = (i as f64 - (half + spread + 1) as f64) / PER_PX as f64;
                let rho = radius_px - d;
                // Past the centre the far edge would come in; a small disc ends there.
                *v = if rho <= 0.0 { 1.0 } else { disc_in_pixel(rho * c, rho * s, radius_px, sides) };
            }
            // Tap after tap, so that the compiler works on many places at once.
            soft.fill(0.0);
            for (tap, weight) in kernel.iter().enumerate() {
                soft.iter_mut().zip(&sharp[tap..]).for_each(|(to, v)| *to += weight * v);
            }
            soft.iter_mut().for_each(|v| *v /= total);
            for i in 0..columns {
                // The slope over two steps: coverage has kinks, and a pixel is found within half a step.
                let slope = (soft[i + 2] - soft[i]) * PER_PX as f64 / 2.0;
                rows[k * columns + i] = [soft[i + 1] as f32, slope as f32];
            }
        }
        let all_rows = directions as f32 * if square { std::f32::consts::SQRT_2 } else { 1.0 };
        Self {
            rows,
            last_column: (columns - 1) as f32,
            all_rows,
            last_row: directions as f32 - 1.0,
            square,
            reach_px: half as f64 / PER_PX as f64,
        }
    }

    /// The entries of the table that have the coverage of eight pixels: at distances inside the edge, where the edge's normal has
    /// a direction: its smaller component (at most 0.71) where pixels are square, else half of 1 and what its component along y
    /// has more than that along x.
    #[inline(always)]
    pub fn spot<V: Eight>(&self, token: V::Token, inside_px: V, direction: V) -> Spot {
        // Adding 2^23 rounds to a whole number.
        let all = |v: f32| V::splat(token, v);
        let (whole, zero) = (all(8_388_608.0), all(0.0));
        let (last, columns) = (all(self.last_column), all(self.last_column + 1.0));
        let t = ((inside_px + all(self.reach_px as f32)) * all(PER_PX as f32)).max(zero).min(last);
        let column = (t + whole) - whole;
        let middle = direction * all(self.all_rows) - all(0.5);
        let row = (middle.max(zero).min(all(self.last_row)) + whole) - whole;
        Spot {
            entry: (row * columns + column).trunc(),
            behind_px: ((t - column) * all(1.0 / PER_PX as f32)).array(),
        }
    }

    /// Coverage and slope there.
    #[inline(always)]
    pub fn at<V: Eight>(&self, token: V::Token, spot: &Spot) -> (V, V) {
        let (cover, slope) = V::pairs(token, spot.entry.map(|i| &self.rows[i as usize % SIZE]));
        (cover + slope * V::load(token, &spot.behind_px), slope)
    }
}

/// Eight entries of the table, and how far behind them the pixels are.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Spot {
    entry: [i32; LANES],
    behind_px: [f32; LANES],
}

#[cfg(test)]
mod tests {
    use wide::f32x8;

    use super::*;

    /// Coverage at one place.
    fn cover(table: &EdgeTable, inside_px: f64, minor: f64) -> f64 {
        let spot = table.spot((), f32x8::splat(inside_px as f32), f32x8::splat(minor as f32));
        f64::from(table.at::<f32x8>((), &spot).0.to_array()[0])
    }

    #[test]
    fn the_table_gives_the_exact_area_of_a_sharp_disc() {
        let (r, c) = (6.0, [0.3, -0.2]);
        for ratio in [1.0_f64, 16.0 / 15.0, 0.5, 2.0] {
            let sides = [ratio.sqrt(), ratio.sqrt().recip()];
            let table = EdgeTable::new(r, 0.0, sides);
            let mut worst: f64 = 0.0;
            for y in -12..=12 {
                for x in -12..=12 {
                    let (dx, dy) = ((f64::from(x) - c[0]) * sides[0], (f64::from(y) - c[1]) * sides[1]);
                    let rho = dx.hypot(dy);
                    let (a, b) = (dx.abs() / rho, dy.abs() / rho);
                    let direction = if ratio == 1.0 { a.min(b) } else { (b - a + 1.0) / 2.0 };
                    let p = cover(&table, r - rho, direction);
                    worst = worst.max((p - disc_in_pixel(dx, dy, r, sides)).abs());
                }
            }
            // Half a step of direction (0.022) turns the edge by up to 0.03 rad inside a pixel; of a pixel twice as wide
            // as high that is twice as much at its ends.
            assert!(worst < if ratio == 1.0 { 0.01 } else { 0.02 }, "{ratio}: {worst}");
        }
    }

    #[test]
    fn blur_keeps_the_middle_and_widens_the_edge() {
        let (sharp, soft) = (EdgeTable::new(50.0, 0.0, [1.0; 2]), EdgeTable::new(50.0, 0.8, [1.0; 2]));
        assert!((cover(&soft, 0.0, 0.3) - 0.5).abs() < 0.01);
        // One standard deviation of blur and pixel together: sqrt(0.64 + 1/12) = 0.85 px holds 84 %.
        assert!((cover(&soft, 0.85, 0.3) - 0.841).abs() < 0.01);
        assert_eq!(cover(&sharp, 0.85, 0.3), 1.0);
    }
}
