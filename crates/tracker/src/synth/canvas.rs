//! Paints discs, bars and light into an image of levels.
//!
//! Owns: [`Canvas`], [`ground`].

use super::coverage::{Quad, disc_rectangle_area};
use super::scene::Scene;

/// Ground, light and things that stand still.
pub(super) fn ground(scene: &Scene) -> Vec<f32> {
    let [w, h] = scene.image_px;
    let mut canvas = Canvas::new(w as usize, h as usize, scene);
    for y in 0..h as usize {
        for x in 0..w as usize {
            let [fx, fy] = canvas.fraction(x, y);
            let [gx, gy] = scene.light.background_gradient;
            let level = (scene.light.background + gx * fx + gy * fy).max(0.0);
            canvas.pixels[y * w as usize + x] = (scene.camera.black + level * canvas.light(x, y)) as f32;
        }
    }
    for d in &scene.distractors {
        canvas.disc(d.at_px, d.radius_px, d.level);
    }
    canvas.pixels
}

/// An image being painted; remembers in each row which pixels were touched.
pub(super) struct Canvas<'a> {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) pixels: Vec<f32>,
    /// Per row the touched pixels as first..end; first >= end is none.
    pub(super) touched: Vec<[usize; 2]>,
    pub(super) black: f64,
    pub(super) uneven: [f64; 2],
    pub(super) even: bool,
    pub(super) ground: Option<&'a [f32]>,
    /// Width and height of a pixel, whose area is 1.
    pub(super) sides: [f64; 2],
}

impl<'a> Canvas<'a> {
    pub(super) fn new(width: usize, height: usize, scene: &Scene) -> Self {
        Self {
            width,
            height,
            pixels: vec![0.0; width * height],
            touched: vec![[usize::MAX, 0]; height],
            black: scene.camera.black,
            uneven: scene.light.uneven,
            even: scene.light.uneven == [0.0; 2],
            ground: None,
            sides: scene.pixel_aspect().sides(),
        }
    }

    pub(super) fn on(ground: &'a [f32], width: usize, height: usize, scene: &Scene) -> Self {
        let mut canvas = Self::new(0, 0, scene);
        canvas.width = width;
        canvas.height = height;
        canvas.pixels = ground.to_vec();
        canvas.touched = vec![[usize::MAX, 0]; height];
        canvas.ground = Some(ground);
        canvas
    }

    /// Place in the image from -0.5 to 0.5.
    pub(super) fn fraction(&self, x: usize, y: usize) -> [f64; 2] {
        [
            (x as f64 - 0.5 * (self.width as f64 - 1.0)) / self.width as f64,
            (y as f64 - 0.5 * (self.height as f64 - 1.0)) / self.height as f64,
        ]
    }

    pub(super) fn light(&self, x: usize, y: usize) -> f64 {
        if self.even {
            return 1.0;
        }
        let [fx, fy] = self.fraction(x, y);
        1.0 + self.uneven[0] * fx + self.uneven[1] * fy
    }

    /// Pixels of one axis that `low..=high` touches, as a range.
    pub(super) fn span(low: f64, high: f64, size: usize) -> std::ops::Range<usize> {
        let first = (low + 0.5).floor().max(0.0);
        let end = ((high + 0.5).floor() + 1.0).min(size as f64);
        if end <= first { 0..0 } else { first as usize..end as usize }
    }

    pub(super) fn touch(&mut self, y: usize, x: &std::ops::Range<usize>) {
        let t = &mut self.touched[y];
        *t = [t[0].min(x.start), t[1].max(x.end)];
    }

    /// Puts `level` over what is there, by `coverage`.
    pub(super) fn put(&mut self, x: usize, y: usize, coverage: f64, level: f64) {
        let value = self.black + level * self.light(x, y);
        let pixel = &mut self.pixels[y * self.width + x];
        *pixel = if coverage >= 1.0 {
            value as f32
        } else {
            (f64::from(*pixel) * (1.0 - coverage) + value * coverage) as f32
        };
    }

    /// Calls `paint` with each pixel of a disc and its coverage. It is about a place in the picture; its radius is in units of
    /// the square of a pixel's area, so that it covers as many pixels whatever their shape.
    pub(super) fn each_of_disc(
        &mut self,
        [cx, cy]: [f64; 2],
        r: f64,
        mut paint: impl FnMut(&mut Self, usize, usize, f64),
    ) {
        let [wide, high] = self.sides;
        for y in Self::span(cy - r / high, cy + r / high, self.height) {
            let (top, bottom) = ((y as f64 - 0.5) * high, (y as f64 + 0.5) * high);
            // The widest chord of this row.
            let middle = cy * high;
            let near = if middle < top {
                top - middle
            } else if middle > bottom {
                middle - bottom
            } else {
                0.0
            };
            if near >= r {
                continue;
            }
            let half = (r * r - near * near).sqrt() / wide;
            let row = Self::span(cx - half, cx + half, self.width);
            self.touch(y, &row);
            for x in row {
                let sides = [(x as f64 - 0.5) * wide, (x as f64 + 0.5) * wide];
                let c = disc_rectangle_area(cx * wide, middle, r, sides, [top, bottom]);
                if c > 0.0 {
                    paint(self, x, y, c);
                }
            }
        }
    }

    pub(super) fn disc(&mut self, centre: [f64; 2], r: f64, level: f64) {
        self.each_of_disc(centre, r, |canvas, x, y, c| canvas.put(x, y, c, level));
    }

    pub(super) fn glint(&mut self, centre: [f64; 2], r: f64, level: f64) {
        self.each_of_disc(centre, r, |canvas, x, y, c| {
            canvas.pixels[y * canvas.width + x] += (c * level) as f32;
        });
    }

    pub(super) fn quad(&mut self, quad: &Quad, level: f64) {
        let (bx, by) = quad.bounds();
        let rows = Self::span(by[0], by[1], self.height);
        // Along a row, u and v are linear in x: the row's part within each pair of sides is an interval.
        let (su, sv) = (quad.along[0], quad.across[0]);
        // A pixel reaches half its diagonal towards any side.
        let reach = std::f64::consts::FRAC_1_SQRT_2;
        for y in rows {
            let [u0, v0] = quad.local(0.0, y as f64);
            let (mut low, mut high) = (bx[0], bx[1]);
            // Between these every pixel is wholly inside.
            let (mut first, mut last) = (f64::NEG_INFINITY, f64::INFINITY);
            for (start, slope, [a, b]) in [(u0, su, quad.u), (v0, sv, quad.v)] {
                if slope.abs() < 1e-9 {
                    if start < a - reach || start > b + reach {
                        low = f64::INFINITY;
                    }
                    if start < a + 1.0 || start > b - 1.0 {
                        first = f64::INFINITY;
                    }
                    continue;
                }
                let (p, q) = ((a - reach - start) / slope, (b + reach - start) / slope);
                low = low.max(p.min(q));
                high = high.min(p.max(q));
                let (p, q) = ((a + 1.0 - start) / slope, (b - 1.0 - start) / slope);
                first = first.max(p.min(q));
                last = last.min(p.max(q));
            }
            if low > high {
                continue;
            }
            let row = Self::span(low, high, self.width);
            if row.is_empty() {
                continue;
            }
            self.touch(y, &row);
            for x in row {
                let inside = x as f64 >= first && x as f64 <= last;
                let c = if inside { 1.0 } else { quad.pixel_coverage(x as f64, y as f64) };
                if c > 0.0 {
                    self.put(x, y, c, level);
                }
            }
        }
    }

    /// Adds to `sum` what differs from the ground, `weight` times, and is the ground again.
    pub(super) fn harvest(&mut self, sum: &mut [f32], weight: f32) {
        let Some(ground) = self.ground else { return };
        for y in 0..self.height {
            let [first, end] = self.touched[y];
            self.touched[y] = [usize::MAX, 0];
            if first >= end {
                continue;
            }
            let row = y * self.width + first..y * self.width + end;
            for ((s, p), g) in
                sum[row.clone()].iter_mut().zip(&mut self.pixels[row.clone()]).zip(&ground[row])
            {
                *s += (*p - *g) * weight;
                *p = *g;
            }
        }
    }
}
