//! Detects the markers of one frame: label, fit, flag, undo the lens, in that order.
//!
//! Owns: [`Detector`] and its scratch. Must not: learn from the frames it sees: each frame's result depends on
//! that frame alone, so frames can be spread over threads in any way.

use std::sync::Arc;

use super::centre::contours::contour_centres;
use super::centre::disc::Disc;
use super::centre::disc_fit::{DiscFit, Fitted};
use super::centre::edge_table::EdgeTable;
use super::centre::normal_equations::DiscModel;
use super::centre::shape;
use super::centre::window::{Centre, Window};
use super::detection::{Detection, Flags};
use super::label::components::{Blob, Labeller};
use super::label::mask::Spans;
use super::label::plan::Plan;
use super::lens::Undistort;
use super::levels::Levels;
use super::marker::LARGEST_MISFIT;
use super::pixels::Pixels;
use super::settings::{Centroid, DetectSettings, Polarity};
use crate::error::{Error, Fault, Place, Result};
use crate::frame::Frame;

/// Least area of a neighbouring blob that is kept out of a fit, px.
const LEAST_NEIGHBOUR_PX: u64 = 4;
/// Rounds of fitting two touching discs, each with the other kept out of it.
const SPLIT_ROUNDS: usize = 3;
/// Relative difference of a split disc's radius from a marker's that is allowed: in spreads of the radii, and at least.
const SPLIT_SPREADS: f64 = 4.0;
const SPLIT_RADIUS_SLACK: f64 = 0.12;
/// Least distance of two split discs, in radii.
const SPLIT_APART_RADII: f64 = 0.8;
/// Longer over shorter axis from which a blob is no disc: it is smeared over more than its radius.
const DISC_ELONGATION: f64 = 1.6;
/// Pixels beyond the blurred edge, on both sides, that tell base and height: where markers stand out, and in noise.
const BAND_PX: f64 = 0.5;
const NOISY_BAND_PX: f64 = 2.0;

/// Finds the markers of one frame at a time. One for each thread.
#[derive(Debug)]
pub struct Detector {
    levels: Arc<Levels>,
    /// Width and height of a pixel in units of the square of its area.
    sides: [f64; 2],
    centroid: Centroid,
    spans: Spans,
    plan: Plan,
    lens: Option<Undistort>,
    labeller: Labeller,
    blobs: Vec<Blob>,
    window: Window,
    /// Height of the tallest blob of the frame, px.
    tallest: u32,
    table: Option<EdgeTable>,
    mask: Vec<u8>,
    row: Vec<u16>,
}

impl Detector {
    /// A detector for recordings with these levels.
    ///
    /// # Errors
    /// [`Error::Detect`] for a region without pixels or a lens that is none.
    pub fn new(levels: Arc<Levels>, settings: &DetectSettings) -> Result<Self> {
        let [width, height] = levels.image_px.map(|n| n as usize);
        let spans = Spans::new(settings.region.as_ref(), width, height)?;
        let plan = Plan::new(&levels, &spans, height);
        let lens = settings.lens.as_ref().map(Undistort::new).transpose()?;
        let sides = levels.pixel_aspect.sides();
        let marker = levels.marker.filter(|_| settings.centroid == Centroid::Disc);
        let table = marker.map(|m| EdgeTable::new(m.radius_px, m.blur_px, sides));
        Ok(Self {
            levels,
            sides,
            centroid: settings.centroid,
            spans,
            plan,
            lens,
            labeller: Labeller::default(),
            blobs: Vec::new(),
            window: Window::new(sides),
            tallest: 0,
            table,
            mask: Vec::new(),
            row: Vec::new(),
        })
    }

    /// The levels that the detector was made with.
    pub fn levels(&self) -> &Levels {
        &self.levels
    }

    /// The detections of a frame, ordered by y, then x; `out` is cleared first. A frame that was not decoded
    /// has none.
    ///
    /// # Errors
    /// [`Error::Detect`] if the frame has another size than those learned from, or too few bytes.
    pub fn detect(&mut self, frame: &Frame, out: &mut Vec<Detection>) -> Result<()> {
        out.clear();
        let Some(pixels) = Pixels::of(frame)? else { return Ok(()) };
        if [frame.width, frame.height] != self.levels.image_px {
            let [w, h] = self.levels.image_px;
            return Err(Error::Detect(
                Fault::new(
                    "frame",
                    format!("{} x {} px, the recording began with {w} x {h} px", frame.width, frame.height),
                )
                .at(Place::Frame(frame.index))
                .advice("A recording must keep one size"),
            ));
        }
        match self.centroid {
            Centroid::Disc | Centroid::Weighted => self.discs(&pixels, out),
            Centroid::Contour => self.contour(&pixels, out)?,
        }
        if let Some(lens) = &mut self.lens {
            lens.apply(out)?;
        }
        // A lens that is undone far outside its image may send a centre anywhere.
        out.retain(is_sound);
        out.sort_unstable_by(|a, b| a.y_px.total_cmp(&b.y_px).then(a.x_px.total_cmp(&b.x_px)));
        Ok(())
    }

    /// The fit of a disc to each blob, or its intensity-weighted mean where there is no table to fit with.
    fn discs(&mut self, pixels: &Pixels<'_>, out: &mut Vec<Detection>) {
        // Step 1: blobs beyond the threshold.
        self.labeller.find(pixels, &self.plan, self.levels.polarity, &mut self.blobs);
        self.tallest = self.blobs.iter().map(|b| b.y1 - b.y0 + 1).max().unwrap_or(0);
        let [least, most] = self.levels.area_px;
        for i in 0..self.blobs.len() {
            let blob = &self.blobs[i].clone();
            // Step 2: area limits.
            let area = blob.area as f64;
            if area < least || area > most {
                continue;
            }
            // Step 3: centre, or centres where two markers touch. Step 4: what its shape says.
            if self.split(pixels, blob, out) {
                continue;
            }
            let avoid = self.neighbours(i);
            let centre = self.centre(pixels, blob, avoid);
            out.push(detection(blob, &centre, &self.levels, self.table.is_some()));
        }
    }

    /// Discs of the two blobs nearest to blob `i` that reach into its window.
    fn neighbours(&self, i: usize) -> [Option<Disc>; 2] {
        let mut near = [None; 2];
        let Some(table) = &self.table else { return near };
        let blob = &self.blobs[i];
        let reach = table.reach_px.ceil() * 2.0 + 4.0;
        let [across, down] = self.sides.map(|side| (reach / side).ceil() as u32);
        let (left, right) = (blob.x0.saturating_sub(across), blob.x1 + across);
        let (above, below) = (blob.y0.saturating_sub(down), blob.y1 + down);
        // Blobs are in order of their first row.
        let before = self.blobs[..i].iter().rev().take_while(|b| b.y0 + self.tallest > above);
        let after = self.blobs[i + 1..].iter().take_while(|b| b.y0 <= below);
        let mut n = 0;
        for b in before.chain(after) {
            let meets = b.x0 <= right && b.x1 >= left && b.y0 <= below && b.y1 >= above;
            if meets && b.area >= LEAST_NEIGHBOUR_PX && n < 2 {
                // As large as its longer axis.
                let disc = Disc::of_area(b.mean(), b.area as f64);
                near[n] = Some(Disc { radius_px: disc.radius_px * b.elongation(self.sides).sqrt(), ..disc });
                n += 1;
            }
        }
        near
    }

    /// Two touching markers as two detections, if two discs fit; otherwise false.
    fn split(&mut self, pixels: &Pixels<'_>, blob: &Blob, out: &mut Vec<Detection>) -> bool {
        let Some([mut a, mut b]) = shape::two_discs(blob, &self.levels) else { return false };
        let (Some(table), Some(marker)) = (&self.table, self.levels.marker) else { return false };
        let fit = disc_fit(table, &self.levels);
        let mut found = None;
        for _ in 0..SPLIT_ROUNDS {
            // Each with the other kept out of it, then again with the better places.
            let fa = self.window.fit_beside(pixels, blob, &fit, a, b);
            let fb = self.window.fit_beside(pixels, blob, &fit, b, a);
            let (Some(fa), Some(fb)) = (fa, fb) else { return false };
            (a, b) = (fa.disc(), fb.disc());
            found = Some([fa, fb]);
        }
        let Some(found) = found else { return false };
        let slack = (SPLIT_SPREADS * marker.radius_spread).max(SPLIT_RADIUS_SLACK);
        let good = found.iter().all(|f| {
            f.chi2 < shape::misfit_limit(&self.levels) && (f.radius_px / marker.radius_px - 1.0).abs() < slack
        }) && ((a.x_px - b.x_px) * self.sides[0]).hypot((a.y_px - b.y_px) * self.sides[1])
            > SPLIT_APART_RADII * marker.radius_px;
        if !good {
            return false;
        }
        for f in found {
            let centre = centre_of(&f);
            out.push(Detection {
                x_px: f.x_px,
                y_px: f.y_px,
                sigma_px: (centre.sigma_px * self.sides[0]) as f32,
                area_px: (std::f64::consts::PI * f.radius_px * f.radius_px) as f32,
                peak: centre.peak as f32,
                elongation: 1.0,
                flags: Flags(
                    Flags::MERGED | if f.saturated >= shape::SATURATED_PIXELS { Flags::SATURATED } else { 0 },
                ),
            });
        }
        true
    }

    fn centre(&mut self, pixels: &Pixels<'_>, blob: &Blob, avoid: [Option<Disc>; 2]) -> Centre {
        if let Some(table) = &self.table
            && blob.elongation(self.sides) < DISC_ELONGATION
        {
            let fit = disc_fit(table, &self.levels);
            if let Some(f) = self.window.fit(pixels, blob, &fit, avoid)
                && f.rms < LARGEST_MISFIT * f.height.abs() + 2.0 * self.levels.noise.variance(f.base).sqrt()
            {
                return centre_of(&f);
            }
        }
        self.window.weighted(pixels, &self.spans, blob, &self.levels)
    }

    /// The paper's way: a mask of the whole image, its outer contours, their moments.
    fn contour(&mut self, pixels: &Pixels<'_>, out: &mut Vec<Detection>) -> Result<()> {
        self.mask.clear();
        self.mask.resize(pixels.width * pixels.height, 0);
        for y in 0..pixels.height {
            for s in self.plan.row(y) {
                self.row.resize((s.end - s.start) as usize, 0);
                pixels.read(y, s.start as usize, &mut self.row);
                let at = y * pixels.width + s.start as usize;
                for (m, &v) in self.mask[at..].iter_mut().zip(&self.row) {
                    *m = u8::from(match self.levels.polarity {
                        Polarity::Bright => v >= s.threshold,
                        Polarity::Dark => v <= s.threshold,
                    });
                }
            }
        }
        self.labeller.find(pixels, &self.plan, self.levels.polarity, &mut self.blobs);
        let [least, most] = self.levels.area_px;
        for contour in contour_centres(&self.mask, pixels.width, pixels.height)? {
            // The blob it goes round says the rest.
            let inside = |b: &&Blob| {
                let (x, y) = (contour.x_px, contour.y_px);
                x >= f64::from(b.x0) && x <= f64::from(b.x1) && y >= f64::from(b.y0) && y <= f64::from(b.y1)
            };
            let Some(blob) = self.blobs.iter().filter(inside).max_by_key(|b| b.area) else { continue };
            let area = blob.area as f64;
            if area < least || area > most {
                continue;
            }
            let centre = self.window.weighted(pixels, &self.spans, blob, &self.levels);
            let whole = detection(blob, &centre, &self.levels, false);
            // Rounding the outline to pixels dominates: 1/12 px^2 for each of its pixels, shared among them.
            let outline = (4.0 * std::f64::consts::PI * area).sqrt().max(1.0);
            out.push(Detection {
                x_px: contour.x_px,
                y_px: contour.y_px,
                area_px: contour.area_px as f32,
                sigma_px: f64::from(whole.sigma_px).hypot((1.0 / 12.0 / outline).sqrt()) as f32,
                ..whole
            });
        }
        Ok(())
    }
}

/// Whether its numbers are what every reader of them may rely on: a place, and an uncertainty above 0.
fn is_sound(d: &Detection) -> bool {
    d.x_px.is_finite()
        && d.y_px.is_finite()
        && d.sigma_px.is_finite()
        && d.sigma_px > 0.0
        && d.area_px.is_finite()
}

fn disc_fit<'a>(table: &'a EdgeTable, levels: &Levels) -> DiscFit<'a> {
    // In much noise more pixels beside the edge are worth their time.
    let band_px = if levels.high_contrast() { BAND_PX } else { NOISY_BAND_PX };
    let model =
        DiscModel { table, noise: levels.noise, polarity: levels.polarity, saturation: levels.saturation };
    DiscFit { model, band_px, usual_chi2: levels.marker.map_or(1.0, |m| m.chi2) }
}

fn centre_of(f: &Fitted) -> Centre {
    Centre {
        x_px: f.x_px,
        y_px: f.y_px,
        // Where the disc fits worse than noise alone, its centre is less sure by as much.
        sigma_px: f.sigma_px * f.chi2.max(1.0).sqrt(),
        peak: f.height.abs(),
        saturated: f.saturated,
        fitted: Some(*f),
        parted: false,
    }
}

fn detection(blob: &Blob, centre: &Centre, levels: &Levels, fits_discs: bool) -> Detection {
    let sides = levels.pixel_aspect.sides();
    Detection {
        x_px: centre.x_px,
        y_px: centre.y_px,
        // From units of sqrt(area of a pixel) to its height.
        sigma_px: (centre.sigma_px * sides[0]) as f32,
        area_px: blob.area as f32,
        peak: centre.peak as f32,
        elongation: blob.elongation(sides) as f32,
        flags: shape::judge(blob, centre, levels, fits_discs),
    }
}
