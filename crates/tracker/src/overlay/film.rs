//! Writes the recording as a film with nodes and bodies drawn into it.
//!
//! Owns: [`film`], [`FilmSettings`]. Must not: draw.

use std::path::Path;

use opencv::core::{Mat, Rect};
use opencv::imgproc;
use opencv::prelude::*;

use super::draw::Overlay;
use super::picture::failed;
use crate::error::{Error, Fault, Result};
use crate::frame::{SourceInfo, TimeBase};
use crate::message::Setting;
use crate::observation::Observation;
use crate::output;
use crate::pipeline::{self, Observer, Stage};
use crate::pixel_aspect::PixelAspect;
use crate::rig::Rig;
use crate::source::{self, OpenOptions};
use crate::synth::encode::{Codec, VideoSettings, VideoWriter};
use crate::table::NodeTable;

/// Settings of the film with the drawings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FilmSettings {
    /// Frames a second at which it plays.
    pub play_fps: u32,
    /// x264's constant rate factor, 0 to 51.
    pub quality: u32,
    /// Each such frame of the table is drawn, from its first.
    pub every: usize,
    /// Width of the film in px, the height in proportion; `None` is the recording's in square pixels. Odd sizes lose a row
    /// or column.
    pub width: Option<u32>,
    /// Whether a file that is there already is replaced.
    pub replace: bool,
}

impl Default for FilmSettings {
    fn default() -> Self {
        Self { play_fps: 30, quality: 20, every: 1, width: None, replace: false }
    }
}

impl FilmSettings {
    fn check(&self) -> Result<()> {
        let wrong = [
            (Setting::PlayFps, self.play_fps == 0 || self.play_fps > 1000, "Give 1 to 1000 frames a second"),
            (Setting::Quality, self.quality > 51, "Give x264's rate factor, 0 (best) to 51"),
            (Setting::Every, self.every == 0, "Give 1 for all frames, n for each n-th"),
            (
                Setting::Width,
                self.width.is_some_and(|w| !(64..=8192).contains(&w) || w % 2 == 1),
                "Give an even number of 64 to 8192 px",
            ),
        ];
        if let Some((name, _, advice)) = wrong.iter().find(|(_, wrong, _)| *wrong) {
            return Err(Error::Argument(Fault::of(*name, "it is out of range").advice(*advice)));
        }
        Ok(())
    }
}

/// Frames and times of the pictures of a film.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Filmed {
    /// Of each picture the frame's index in the recording.
    pub frame: Vec<i64>,
    /// Of each picture the time in the recording, s.
    pub time_s: Vec<f64>,
}

/// Writes the recording with its table drawn into it. Frames that the table does not have are left out.
///
/// # Errors
/// [`Error::Source`] if the recording cannot be read, [`Error::Table`] if it is not the table's,
/// [`Error::Film`] if the film is there already, is the recording, or cannot be written, [`Error::Argument`] for settings out of range,
/// [`Error::Interrupted`] if the observer asks to stop: what was drawn is then a whole film, and nothing is left where nothing was.
pub fn film(
    input: &str,
    open: &OpenOptions,
    table: &NodeTable,
    output: &Path,
    settings: &FilmSettings,
    observer: &mut dyn Observer,
) -> Result<Filmed> {
    settings.check()?;
    let outputs = [output.to_owned()];
    output::check(&outputs, &source::files(input)?, settings.replace).map_err(Error::Film)?;
    let rig = &table.meta.rig;
    let n = rig.nodes.len();
    observer.stage(Stage::Open, None);
    let mut source = pipeline::open(input, open, observer)?;
    check_recording(input, source.info(), rig, open)?;
    let mut overlay = match settings.width {
        Some(width) => Overlay::of_width(rig, width),
        None => Overlay::new(rig),
    };
    let mut writer = VideoWriter::create(
        output,
        &VideoSettings {
            width: overlay.size[0] as u32 & !1,
            height: overlay.size[1] as u32 & !1,
            depth_bits: 8,
            pixel_aspect: PixelAspect::SQUARE,
            time_base: TimeBase { numerator: 1, denominator: u64::from(settings.play_fps) },
            codec: Codec::H264,
            quality: Some(settings.quality),
            x264_preset: Some("veryfast".into()),
            gray_only: false,
        },
    )?;
    observer.stage(Stage::Draw, Some(table.frames() as u64));
    let mut filmed = Filmed::default();
    let mut t = 0;
    while let Some(frame) = source.next_frame()? {
        if observer.interrupted() {
            // Without a picture there is no film: what was begun goes with the writer.
            writer.cut()?;
            return Err(Error::Interrupted);
        }
        while t < table.frames() && (table.rows.frame[t] as u64) < frame.index {
            t += 1;
        }
        if t == table.frames() {
            break;
        }
        if table.rows.frame[t] as u64 != frame.index {
            continue;
        }
        let row: Vec<Observation> =
            (0..n).map(|k| table.rows.observation(t, k, n).unwrap_or(Observation::MISSING)).collect();
        if t % settings.every == 0 {
            let time_s = table.rows.time_s[t];
            let picture = overlay.drawn(&frame, Some(time_s), &row)?;
            writer.write_i420(&planes(&picture)?)?;
            filmed.frame.push(table.rows.frame[t]);
            filmed.time_s.push(time_s);
        } else {
            overlay.follow(frame.index, &row);
        }
        observer.progress(t as u64 + 1);
    }
    if filmed.frame.is_empty() {
        return Err(Error::Table(
            Fault::new(input, "it has none of the table's frames")
                .advice("Give the recording that the table was made from"),
        ));
    }
    writer.finish()?;
    Ok(filmed)
}

/// Refuses a recording whose size or pixels are not those of the table's rig.
fn check_recording(input: &str, info: &SourceInfo, rig: &Rig, open: &OpenOptions) -> Result<()> {
    if [info.width, info.height] != rig.image_px {
        let [w, h] = rig.image_px;
        return Err(Error::Table(
            Fault::new(input, format!("{} x {} px, the table is of {w} x {h} px", info.width, info.height))
                .advice("Give the recording that the table was made from"),
        ));
    }
    match open.pixel_aspect {
        Some(given) if !given.agrees(rig.pixel_aspect) => Err(Error::Table(
            Fault::new(
                input,
                format!("pixels of {given} were asked for, the table is of {}", rig.pixel_aspect),
            )
            .advice("Leave out " + Setting::PixelAspect + ", or track the recording with it"),
        )),
        _ => Ok(()),
    }
}

/// The picture as planes of brightness and half-size colour (I420, full range), for an encoder. The last row and
/// column are left out where there is no even number of them.
///
/// # Errors
/// [`Error::Film`] if OpenCV fails.
fn planes(picture: &Mat) -> Result<Vec<u8>> {
    let (w, h) = (picture.cols() & !1, picture.rows() & !1);
    let even = picture.roi(Rect::new(0, 0, w, h)).map_err(failed)?.clone_pointee();
    let mut out = Mat::default();
    imgproc::cvt_color_def(&even, &mut out, imgproc::COLOR_BGR2YUV_I420).map_err(failed)?;
    let mut planes = out.data_bytes().map_err(failed)?.to_vec();
    // OpenCV gives television levels (16 to 235, colour 16 to 240); the film says full range.
    let (luma, chroma) = planes.split_at_mut((w * h) as usize);
    let stretch = |v: f64| v.round().clamp(0.0, 255.0) as u8;
    let of_luma: Vec<u8> = (0..256).map(|v| stretch((f64::from(v) - 16.0) * 255.0 / 219.0)).collect();
    let of_chroma: Vec<u8> =
        (0..256).map(|v| stretch((f64::from(v) - 128.0) * 255.0 / 224.0 + 128.0)).collect();
    luma.iter_mut().for_each(|v| *v = of_luma[usize::from(*v)]);
    chroma.iter_mut().for_each(|v| *v = of_chroma[usize::from(*v)]);
    Ok(planes)
}
