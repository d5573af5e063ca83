//! The window of a picture around a marker, and the region of it that the marker covers.
//!
//! Owns: [`Window`], [`Region`]. Must not: know of other pictures.

use super::backdrop::Backdrop;
use super::picture::Film;
use super::response::{Direction, Planes};
use super::tracklet::median;
use crate::error::Result;

/// Part of the contrast between marker and surroundings that a pixel's own backdrop must leave for the pixel to tell how much of
/// it is covered.
const MATTE_PART: f64 = 0.25;
/// Part of the contrast above the surroundings from which on a pixel is the marker's: of a small one, whose middle is its edge,
/// and of a large one, which may be shaded.
const SMALL_LEVEL: f64 = 0.5;
const LARGE_LEVEL: f64 = 0.4;
/// A pixel that differs from its backdrop by so many standard deviations is covered.
const COVERED_SIGMA: f32 = 6.0;

/// A shadow leaves at least this part of its backdrop's light, and the colour as it is, to so many standard deviations.
const SHADOW_PART: f32 = 0.3;
const SHADOW_SIGMA: f32 = 6.0;

/// Half the least thickness of a part of the marker, in its radii: thinner pieces are rods and strings.
const THIN_RADII: f64 = 0.25;
/// A marker of a smaller radius has no middle apart from its edge, px of the octave.
const SMALL_BELOW: f64 = 4.0;

/// A connected region.
#[derive(Debug, Clone, Copy)]
pub struct Region {
    /// Its centre, px of the window.
    pub x: f64,
    /// Its centre, px of the window.
    pub y: f64,
    /// Its area, px.
    pub area: f64,
    /// Whether it reaches the border of the picture: what is beyond is not known.
    pub is_cut: bool,
}

/// A window of a picture on one octave.
pub struct Window {
    planes: Planes,
    /// Values along the direction that is looked at.
    values: Vec<f32>,
    width: usize,
    height: usize,
    /// Whether the picture ends with its first and last column, and with its first and last row.
    ends: [bool; 4],
    /// Place of its first pixel, px of the octave.
    pub x0: usize,
    /// Place of its first pixel, px of the octave.
    pub y0: usize,
}

impl Window {
    /// Around a place of the octave.
    ///
    /// # Errors
    /// Those of the film.
    pub fn cut(film: &dyn Film, picture: usize, octave: usize, at: [f64; 2], reach: f64) -> Result<Self> {
        let scale = 1usize << octave;
        let range = |c: f64| {
            let from = ((c - reach - 2.0) * scale as f64).max(0.0) as usize;
            from - from % scale..((c + reach + 3.0) * scale as f64).max(0.0) as usize
        };
        let (x, y) = (range(at[0]), range(at[1]));
        let (x0, y0) = (x.start / scale, y.start / scale);
        let part = film.read_part(picture, x.clone(), y.clone())?;
        let ends = [x.start == 0, part.width < x.len(), y.start == 0, part.height < y.len()];
        let planes = Planes::of_octave(&part, octave);
        let (width, height) = (planes.width, planes.height);
        Ok(Self { planes, values: Vec::new(), width, height, ends, x0, y0 })
    }

    /// Looks along a direction, bright (1) or dark (-1). With a backdrop each pixel becomes what it would be before an even
    /// ground, by the part of it that the marker at the place covers; a pixel whose backdrop is about as bright as the marker
    /// tells nothing and stays.
    pub fn look(
        &mut self,
        direction: Direction,
        sign: f32,
        backdrop: Option<&Backdrop>,
        at: [f64; 2],
        radius: f64,
    ) {
        self.values = self.planes.along(direction);
        self.values.iter_mut().for_each(|v| *v *= sign);
        let (Some(backdrop), Some([low, high])) = (backdrop, self.levels(at, radius)) else { return };
        let behind = backdrop.along(direction, (self.x0, self.y0), (self.width, self.height));
        for (v, ground) in self.values.iter_mut().zip(behind) {
            let ground = f64::from(sign * ground);
            let clear = high - ground;
            if clear > MATTE_PART * (high - low) {
                let part = (f64::from(*v) - ground) / clear;
                *v = (low + part.clamp(-0.5, 1.5) * (high - low)) as f32;
            }
        }
    }

    /// Confines values to those between the surroundings and the marker, with a margin below.
    pub fn confine(&mut self, at: [f64; 2], radius: f64) {
        if let Some([low, high]) = self.levels(at, radius) {
            let floor = low - 0.2 * (high - low);
            self.values.iter_mut().for_each(|v| *v = v.clamp(floor as f32, high as f32));
        }
    }

    /// Values of the surroundings and of the marker.
    fn levels(&self, at: [f64; 2], radius: f64) -> Option<[f64; 2]> {
        let mut core = self.ring(at, -1.0, (0.6 * radius).max(0.8));
        let mut ring = self.ring(at, 1.35 * radius + 1.0, 2.1 * radius + 2.0);
        if core.is_empty() || ring.len() < 4 {
            return None;
        }
        core.sort_unstable_by(f64::total_cmp);
        let part = if radius < SMALL_BELOW { 0.75 } else { 0.5 };
        let high = core[((core.len() - 1) as f64 * part).round() as usize];
        let low = median(&mut ring);
        (high - low >= 1.0).then_some([low, high])
    }

    /// Values at distances from a place between two limits.
    fn ring(&self, [x, y]: [f64; 2], inner: f64, outer: f64) -> Vec<f64> {
        let mut out = Vec::new();
        for j in 0..self.height {
            for i in 0..self.width {
                let d = (i as f64 - x).hypot(j as f64 - y);
                if d > inner && d <= outer {
                    out.push(f64::from(self.values[j * self.width + i]));
                }
            }
        }
        out
    }

    /// The region of the marker at a place, about `radius` large, above a level between the surroundings and the marker that is
    /// `raised` by that part of their difference.
    pub fn region(&self, at: [f64; 2], radius: f64, raised: f64) -> Option<Region> {
        let [low, high] = self.levels(at, radius)?;
        let small = radius < SMALL_BELOW;
        let level = low + (high - low) * (raised + if small { SMALL_LEVEL } else { LARGE_LEVEL });
        let inside: Vec<bool> = self.values.iter().map(|v| f64::from(*v) > level).collect();
        let cells = self.connected(&inside, at, radius)?;
        if !small {
            // Highlights and dark middles of a ball are filled.
            let filled = fill(&cells, self.width, self.height);
            if filled.len() as f64 > 1.02 * cells.len() as f64 {
                return Some(self.middle(&filled));
            }
        }
        let [mut s, mut sx, mut sy] = [0.0; 3];
        for &c in &cells {
            let v = ((f64::from(self.values[c]) - level) / (high - level)).clamp(0.0, 1.0);
            (s, sx, sy) = (s + v, sx + v * (c % self.width) as f64, sy + v * (c / self.width) as f64);
        }
        let is_cut = self.is_cut(&cells);
        (s > 0.0).then(|| Region { x: sx / s, y: sy / s, area: cells.len() as f64, is_cut })
    }

    /// Points of the outline of the region of the marker at a place, half way between a pixel inside and one outside.
    pub fn outline(&self, at: [f64; 2], radius: f64) -> Vec<[f64; 2]> {
        let Some([low, high]) = self.levels(at, radius) else { return Vec::new() };
        let level = low + (high - low) * LARGE_LEVEL;
        let inside: Vec<bool> = self.values.iter().map(|v| f64::from(*v) > level).collect();
        let Some(cells) = self.connected(&inside, at, radius) else { return Vec::new() };
        self.border(&fill(&cells, self.width, self.height))
    }

    /// Points half way between a pixel of a region and one beside it.
    fn border(&self, cells: &[usize]) -> Vec<[f64; 2]> {
        let mut covered = vec![false; self.width * self.height];
        cells.iter().for_each(|&c| covered[c] = true);
        let place = |c: usize| [(c % self.width) as f64, (c / self.width) as f64];
        let mut points = Vec::new();
        for &c in cells {
            for n in neighbours(c, self.width, self.height).filter(|n| !covered[*n]) {
                let (p, q) = (place(c), place(n));
                points.push([(p[0] + q[0]) / 2.0, (p[1] + q[1]) / 2.0]);
            }
        }
        points
    }

    /// The region about a place that differs from the backdrop in brightness or in colour and is no shadow, with its holes; and
    /// the points of its outline.
    pub fn silhouette(
        &self,
        backdrop: &Backdrop,
        at: [f64; 2],
        radius: f64,
    ) -> Option<(Region, Vec<[f64; 2]>)> {
        let behind = backdrop.part((self.x0, self.y0), (self.width, self.height));
        let differs: Vec<bool> = (0..self.width * self.height)
            .map(|i| {
                let value = |p: &Planes, k: usize| p.planes.get(k).map_or(0.0, |v| v[i]);
                let [now, then] = [&self.planes, &behind].map(|p| [0, 1, 2].map(|k| value(p, k)));
                is_covered(now, then, backdrop.noise)
            })
            .collect();
        // Strings and edges that a marker hangs on are thinner than it.
        let differs = opened(&differs, self.width, self.height, (THIN_RADII * radius).round() as usize);
        let cells = self.connected(&differs, at, radius)?;
        // One that reaches the window's border is part of something larger.
        let border = |&c: &usize| {
            let (i, j) = (c % self.width, c / self.width);
            i == 0 || j == 0 || i + 1 == self.width || j + 1 == self.height
        };
        let cells = fill(&cells, self.width, self.height);
        (!cells.iter().any(border)).then(|| (self.middle(&cells), self.border(&cells)))
    }

    fn middle(&self, cells: &[usize]) -> Region {
        let n = cells.len() as f64;
        let x = cells.iter().map(|c| (c % self.width) as f64).sum::<f64>() / n;
        let y = cells.iter().map(|c| (c / self.width) as f64).sum::<f64>() / n;
        Region { x, y, area: n, is_cut: self.is_cut(cells) }
    }

    /// Whether a region reaches a border of the picture.
    fn is_cut(&self, cells: &[usize]) -> bool {
        let (w, h) = (self.width, self.height);
        cells.iter().any(|&c| {
            let (i, j) = (c % w, c / w);
            let at = [i == 0, i + 1 == w, j == 0, j + 1 == h];
            at.iter().zip(self.ends).any(|(at, end)| *at && end)
        })
    }

    /// Of the connected regions the one with most pixels near a place.
    fn connected(&self, inside: &[bool], [x, y]: [f64; 2], radius: f64) -> Option<Vec<usize>> {
        let (w, h) = (self.width, self.height);
        let near = |c: usize| ((c % w) as f64 - x).hypot((c / w) as f64 - y) <= (0.7 * radius).max(1.2);
        let mut seen = vec![false; w * h];
        let mut best: Option<(usize, Vec<usize>)> = None;
        for start in (0..w * h).filter(|&c| inside[c] && near(c)) {
            if seen[start] {
                continue;
            }
            seen[start] = true;
            let mut cells = vec![start];
            let (mut next, mut close) = (0, 0);
            while let Some(&c) = cells.get(next) {
                next += 1;
                close += usize::from(near(c));
                for n in neighbours(c, w, h) {
                    if inside[n] && !seen[n] {
                        seen[n] = true;
                        cells.push(n);
                    }
                }
            }
            if best.as_ref().is_none_or(|b| close > b.0) {
                best = Some((close, cells));
            }
        }
        best.map(|b| b.1)
    }
}

/// Whether a colour (luma, and blue and red about 0) is of something before its backdrop: it differs, and not as a shadow does,
/// which makes all of it darker by one factor.
fn is_covered(now: [f32; 3], then: [f32; 3], noise: [f32; 3]) -> bool {
    let part = now[0] / then[0].max(1.0);
    let away = |k: usize, then: f32| (now[k] - then) / noise[k];
    let squares: f32 = (0..3).map(|k| away(k, then[k]).powi(2)).sum();
    let is_shadow =
        (SHADOW_PART..1.0).contains(&part) && (1..3).all(|k| away(k, part * then[k]).abs() < SHADOW_SIGMA);
    squares > COVERED_SIGMA * COVERED_SIGMA && !is_shadow
}

/// The pixels beside, above and below one.
fn neighbours(c: usize, w: usize, h: usize) -> impl Iterator<Item = usize> {
    let (i, j) = (c % w, c / w);
    let left = (i > 0).then(|| c - 1);
    let right = (i + 1 < w).then_some(c + 1);
    let above = (j > 0).then(|| c - w);
    let below = (j + 1 < h).then_some(c + w);
    [left, right, above, below].into_iter().flatten()
}

/// A mask without what is thinner than `2 by + 1` pixels.
fn opened(mask: &[bool], w: usize, h: usize, by: usize) -> Vec<bool> {
    let spread = |mask: &[bool], wanted: bool| -> Vec<bool> {
        let along =
            |mask: &[bool], (count, step, length): (usize, usize, usize), start: &dyn Fn(usize) -> usize| {
                let mut out = vec![!wanted; mask.len()];
                for line in 0..count {
                    let at = |k: usize| start(line) + k * step;
                    for k in (0..length).filter(|&k| mask[at(k)] == wanted) {
                        (k.saturating_sub(by)..(k + by + 1).min(length)).for_each(|n| out[at(n)] = wanted);
                    }
                }
                out
            };
        let rows = along(mask, (h, 1, w), &|y| y * w);
        along(&rows, (w, w, h), &|x| x)
    };
    spread(&spread(mask, false), true)
}

/// A region with its holes.
fn fill(cells: &[usize], w: usize, h: usize) -> Vec<usize> {
    let mut covered = vec![false; w * h];
    cells.iter().for_each(|&c| covered[c] = true);
    // What the window's border reaches through pixels that are not the region's is outside.
    let mut outside = vec![false; w * h];
    let mut open: Vec<usize> = (0..w)
        .flat_map(|i| [i, (h - 1) * w + i])
        .chain((0..h).flat_map(|j| [j * w, j * w + w - 1]))
        .collect();
    while let Some(c) = open.pop() {
        if !covered[c] && !outside[c] {
            outside[c] = true;
            open.extend(neighbours(c, w, h));
        }
    }
    (0..w * h).filter(|&c| !outside[c]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shadow_covers_nothing_and_a_thing_of_another_colour_does_however_dark() {
        let (wall, noise) = ([150.0, -12.0, 15.0], [1.5; 3]);
        let shaded = wall.map(|v| 0.6 * v);
        assert!(!is_covered(wall, wall, noise));
        assert!(!is_covered(shaded, wall, noise));
        // A red ball of the shadow's own brightness, a white net, a black bob.
        assert!(is_covered([90.0, -20.0, 60.0], wall, noise));
        assert!(is_covered([200.0, -2.0, 2.0], wall, noise));
        assert!(is_covered([20.0, 0.0, 0.0], wall, noise));
    }
}
