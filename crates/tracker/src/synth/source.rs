//! Reads a scene as a recording without a file, for tests and benches.

use std::sync::Arc;

use super::{Film, Scene};
use crate::error::Result;
use crate::frame::{Ending, Frame, FrameSource, PixelFormat, RateClaims, RateOrigin, SourceInfo};
use crate::pixel_aspect::AspectOrigin;
use crate::pixel_damage::{self, PixelDamage};

/// Frames of a [`Film`], made when they are asked for.
#[derive(Debug)]
pub struct SyntheticSource {
    film: Arc<Film>,
    info: SourceInfo,
    next: u64,
}

impl SyntheticSource {
    /// The film of a scene.
    ///
    /// # Errors
    /// As [`Film::new`].
    pub fn new(scene: &Scene) -> Result<Self> {
        Ok(Self::of(Arc::new(Film::new(scene)?)))
    }

    /// A film that may be shared with whoever asks it for the truth.
    pub fn of(film: Arc<Film>) -> Self {
        let scene = film.scene();
        let time_base = film.time_base();
        let info = SourceInfo {
            name: "scene".into(),
            container: "scene".into(),
            codec: match film.format() {
                PixelFormat::Gray16 => "gray 16 bit".into(),
                _ => "gray 8 bit".into(),
            },
            width: scene.image_px[0],
            height: scene.image_px[1],
            pixel_aspect: film.pixel_aspect(),
            pixel_aspect_origin: AspectOrigin::Recording,
            format: film.format(),
            depth_bits: scene.camera.depth_bits,
            pixel_damage: PixelDamage::of(pixel_damage::SAMPLES),
            declared_frames: Some(scene.frames),
            time_base,
            rate_hz: Some(time_base.denominator as f64 / time_base.numerator as f64),
            rate_origin: RateOrigin::TimeStamps,
            claims: RateClaims::default(),
            converted_from: None,
            size_bytes: None,
            details: Vec::new(),
            warnings: Vec::new(),
        };
        Self { film, info, next: 0 }
    }

    /// The film.
    pub fn film(&self) -> &Arc<Film> {
        &self.film
    }
}

impl FrameSource for SyntheticSource {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        if self.next >= self.film.frames() {
            return Ok(None);
        }
        self.next += 1;
        Ok(Some(self.film.frame(self.next - 1)))
    }

    fn ending(&self) -> Ending {
        Ending::Complete
    }

    fn sample(&mut self, count: usize) -> Result<Vec<Frame>> {
        let frames = self.film.frames();
        let n = frames.min(count as u64);
        Ok((0..n).map(|k| self.film.frame((2 * k + 1) * frames / (2 * n))).collect())
    }
}
