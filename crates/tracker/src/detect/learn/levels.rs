//! Learns the levels of a recording from frames spread over it.
//!
//! Owns: [`Levels::learn`]. Must not: look at the frames that are detected later.

use rayon::prelude::*;

use super::background;
use super::candidates::{self, Candidate};
use super::marker::{self, Sample};
use crate::detect::levels::Levels;
use crate::detect::noise::Noise;
use crate::detect::pixels::Pixels;
use crate::detect::quantile::{quantile, sorted};
use crate::detect::settings::{DetectSettings, Polarity, Threshold};
use crate::error::{Error, Fault, FaultKind, Place, Result};
use crate::frame::Frame;
use crate::message::{INFO, Message, Setting};

/// Frames that are looked at; more would change nothing.
const MOST_FRAMES: usize = 12;

/// The advice where no marker is found: settings not given yet, or other values of those that are.
fn other_than(settings: &DetectSettings) -> Message {
    let lit = ", or check that markers are lit; " + INFO + " says which container and depth was read";
    let given = match (settings.threshold, settings.polarity) {
        (Threshold::Auto, None) => "Give " + Setting::Threshold + " or " + Setting::Polarity,
        (Threshold::Auto, _) => "Give " + Setting::Threshold + " or the other " + Setting::Polarity,
        (_, None) => "Give another " + Setting::Threshold + " or " + Setting::Polarity,
        _ => "Give another " + Setting::Threshold + " or the other " + Setting::Polarity,
    };
    given + lit
}

impl Levels {
    /// Learns from frames spread over a recording. What the settings give is taken from them.
    ///
    /// # Errors
    /// [`Error::Detect`] if no frame was decoded, frames differ in size, a threshold is out of range, or
    /// nothing like a marker is found.
    pub fn learn(samples: &[Frame], settings: &DetectSettings) -> Result<Self> {
        threads::install(|| Self::learn_here(samples, settings))
    }

    #[expect(clippy::too_many_lines, reason = "four steps in order, each with its heading")]
    fn learn_here(samples: &[Frame], settings: &DetectSettings) -> Result<Self> {
        // Step 1: unpack.
        let mut planes = Vec::new();
        let mut first: Option<&Frame> = None;
        let step = samples.len().div_ceil(MOST_FRAMES).max(1);
        for frame in samples.iter().step_by(step) {
            let Some(pixels) = Pixels::of(frame)? else { continue };
            let known = *first.get_or_insert(frame);
            if (frame.width, frame.height) != (known.width, known.height) {
                return Err(Error::Detect(
                    Fault::new(
                        "sample",
                        format!(
                            "{} x {} px, others are {} x {} px",
                            frame.width, frame.height, known.width, known.height
                        ),
                    )
                    .at(Place::Frame(frame.index))
                    .advice("A recording must keep one size"),
                ));
            }
            planes.push(pixels);
        }
        let Some(known) = first else {
            return Err(Error::Detect(
                Fault::new("recording", "none of its sample frames could be decoded")
                    .of_kind(FaultKind::Damaged)
                    .advice("Look at it with " + INFO),
            ));
        };
        let (width, height) = (known.width as usize, known.height as usize);
        let images: Vec<Vec<u16>> = planes
            .par_iter()
            .map(|pixels| {
                let mut image = vec![0; width * height];
                for (y, row) in image.chunks_exact_mut(width).enumerate() {
                    pixels.read(y, 0, row);
                }
                image
            })
            .collect();
        let top = f64::from((1u32 << known.depth_bits.clamp(1, 16)) - 1);
        if let Threshold::Raw(t) = settings.threshold
            && !(t > 0.0 && t <= top)
        {
            return Err(Error::Detect(
                Fault::of(Setting::Threshold, format!("{t} is outside the recording's range, 1 to {top}"))
                    .advice("It is in raw units of the recording"),
            ));
        }

        // Step 2: background and noise.
        let background = background::learn(&images, width, height);
        let read = background::noise_variance(&images, width);

        // Step 3: polarity and height, by which blobs come and stay.
        let polarities = match settings.polarity {
            None => vec![Polarity::Bright, Polarity::Dark],
            Some(polarity) => vec![polarity],
        };
        let pixel_sides = settings.pixel_aspect.sides();
        let field =
            candidates::Field { images: &images, width, height, pixel_sides, background: &background, read };
        let fixed = match settings.threshold {
            Threshold::Auto => None,
            Threshold::Raw(t) => Some(t),
        };
        let Some(best) = candidates::best(&field, &polarities, fixed) else {
            let what = "nothing like a marker stands out from the background";
            return Err(Error::Detect(
                Fault::new("recording", what).of_kind(FaultKind::NothingFound).advice(other_than(settings)),
            ));
        };

        // Step 4: saturation, limits, typical marker.
        let saturation = saturation(&images, best.polarity, top);
        let area = |part: f64| candidates::weighted_quantile(&best.blobs, |b| b.area, part);
        let low = (0.15 * area(0.05)).max(0.01 * area(0.5)).max(4.0);
        // Where most blobs are of one size, a few large ones are something else.
        let high = 6.0 * typical(&best.blobs).unwrap_or_else(|| area(0.95)).min(area(0.95));
        let area_px = [settings.min_area_px.unwrap_or(low), settings.max_area_px.unwrap_or(high)];
        if !(area_px[0] >= 0.0 && area_px[0] <= area_px[1]) {
            return Err(Error::Detect(
                Fault::of(Setting::MinAreaPx, format!("least {} px, greatest {} px", area_px[0], area_px[1]))
                    .advice("Give a least area below the greatest"),
            ));
        }
        let noise = Noise { read, shot: 0.0, dark: background.median() };
        let samples: Vec<Sample<'_>> = best
            .blobs
            .iter()
            .filter(|b| b.area >= area_px[0] && b.area <= area_px[1])
            .map(|b| Sample { pixels: planes[b.image], blob: b.blob })
            .collect();
        let (marker, noise) = match marker::learn(&samples, best.polarity, noise, saturation, pixel_sides) {
            Some((marker, noise)) => (Some(marker), noise),
            None => (None, noise),
        };
        Ok(Self {
            polarity: best.polarity,
            image_px: [known.width, known.height],
            pixel_aspect: settings.pixel_aspect,
            depth_bits: known.depth_bits,
            background,
            height: best.height,
            fixed_threshold: fixed,
            contrast: candidates::weighted_quantile(&best.blobs, |b| b.contrast, 0.5),
            noise,
            saturation,
            area_px,
            marker_area_px: typical(&best.blobs),
            marker,
            frames: images.len(),
            blobs: best.blobs.len(),
        })
    }
}

/// The value that samples pile up at on the markers' side.
fn saturation(images: &[Vec<u16>], polarity: Polarity, top: f64) -> Option<f64> {
    let extremes = images.par_iter().filter_map(|image| match polarity {
        Polarity::Bright => image.iter().max().copied(),
        Polarity::Dark => image.iter().min().copied(),
    });
    let extreme = match polarity {
        Polarity::Bright => extremes.max()?,
        Polarity::Dark => extremes.min()?,
    };
    let at: usize = images.par_iter().map(|image| image.iter().filter(|&&v| v == extreme).count()).sum();
    let piled = at >= 20 * images.len();
    let end = match polarity {
        Polarity::Bright => f64::from(extreme) >= 0.9 * top,
        Polarity::Dark => f64::from(extreme) <= 0.02 * top,
    };
    (piled && end).then_some(f64::from(extreme))
}

/// The area most blobs have, if most have it within a third.
fn typical(blobs: &[Candidate]) -> Option<f64> {
    let areas = sorted(blobs.iter().map(|b| b.area));
    let middle = quantile(&areas, 0.5);
    let near = areas.iter().filter(|&&a| (a / middle - 1.0).abs() < 0.33).count();
    (near * 4 >= areas.len() * 3).then_some(middle)
}
