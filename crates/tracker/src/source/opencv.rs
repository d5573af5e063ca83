//! Decodes compressed film through OpenCV's `VideoCapture`: a second, independent decoder to check the first against.
//!
//! Owns: [`OpencvSource`]. OpenCV makes blue, green and red of every picture and we make brightness of these,
//! so it costs more and gives 8 bits only. It says nothing of damage: it leaves out pictures, or makes up pixels. So the
//! first decoder reads the same film beside it, and tells times and damage; pixels are OpenCV's. Its times of frames are
//! wrong at the end of streams with reordered frames (version 4.6 gives 0): a picture whose time is not later than a
//! frame's is that frame's. It turns films of 90 and 270 degrees the wrong way (version 4.6 again) and mirrors none, so
//! pictures are turned here.

use std::fs::File;
use std::os::fd::AsRawFd;

use opencv::core::Mat;
use opencv::imgproc;
use opencv::prelude::{MatTraitConst, MatTraitConstManual, VideoCaptureTrait, VideoCaptureTraitConst};
use opencv::videoio::{self, VideoCapture};

use super::ffmpeg::FfmpegSource;
use super::orientation::Orientation;
use super::{Input, OpenOptions};
use crate::error::{Error, Fault, FaultKind, Result};
use crate::frame::{Ending, Frame, FrameSource, PixelFormat, SourceInfo};
use crate::gaps::Gaps;
use crate::message::Setting;

/// Frames by which a picture's time may be ahead of the frame that is due: what is further ahead is no time.
const MOST_LEFT_OUT: f64 = 1000.0;

/// A picture as OpenCV gives it.
struct Taken {
    /// Its time, s from the stream's start; 0 where OpenCV does not know it.
    time_s: f64,
    /// Its samples, if its size is the recording's.
    plane: Option<Vec<u8>>,
}

/// A recording read through OpenCV.
pub struct OpencvSource {
    info: SourceInfo,
    orientation: Orientation,
    capture: VideoCapture,
    color: Mat,
    /// The film through FFmpeg, for times, gaps and damage.
    beside: FfmpegSource,
    /// Ticks are frame numbers: the user gives the rate.
    counts_frames: bool,
    /// A picture whose frame is not due yet.
    ahead: Option<Taken>,
    /// Whether OpenCV has no more pictures.
    is_dry: bool,
    /// Pictures that OpenCV gave, and frames that were due to have one.
    pictures: u64,
    frames: u64,
    /// Whether some picture was taken for the next frame's though its time does not say so.
    by_order: bool,
    /// Time of the frame before, s.
    last_s: Option<f64>,
    /// OpenCV's pictures have lost their places: in AVI it counts them, and passes over those that are damaged.
    is_astray: bool,
    ending: Ending,
}

impl OpencvSource {
    /// Opens a file; `first` is what FFmpeg knows of it.
    ///
    /// # Errors
    /// [`Error::Source`] if OpenCV cannot open it or would throw bits away.
    pub(crate) fn open(
        name: &str,
        input: &Input,
        first: &FfmpegSource,
        options: &OpenOptions,
    ) -> Result<Self> {
        let known = first.info();
        if known.depth_bits > 8 {
            return Err(Error::Source(
                Fault::new(
                    name,
                    format!("{} bits per pixel, and OpenCV's decoder keeps 8", known.depth_bits),
                )
                .of_kind(FaultKind::Unsupported)
                .advice("Leave out " + Setting::Decoder.set_to("opencv")),
            ));
        }
        let orientation = first.orientation();
        let capture = open(name, orientation)?;
        let info = SourceInfo {
            codec: format!("{} (OpenCV)", known.codec),
            converted_from: Some("BGR".into()),
            format: PixelFormat::Gray8,
            depth_bits: 8,
            ..known.clone()
        };
        // Its ticks are those of the container, whatever the user says of the rate.
        let mut beside = FfmpegSource::open(name, input, &OpenOptions { fps: None, ..options.clone() })?;
        beside.turn_as_tagged();
        Ok(Self {
            info,
            orientation,
            capture,
            color: Mat::default(),
            beside,
            counts_frames: options.fps.is_some(),
            ahead: None,
            is_dry: false,
            pictures: 0,
            frames: 0,
            by_order: false,
            last_s: None,
            is_astray: false,
            ending: Ending::Complete,
        })
    }

    /// The next picture, if there is one.
    fn take(&mut self) -> Result<Option<Taken>> {
        if self.is_dry {
            return Ok(None);
        }
        let Some(plane) = read(&mut self.capture, &mut self.color, &self.info, self.orientation)? else {
            self.is_dry = true;
            return Ok(None);
        };
        self.pictures += 1;
        let time_s = self.capture.get(videoio::CAP_PROP_POS_MSEC).unwrap_or(0.0) / 1000.0;
        Ok(Some(Taken { time_s, plane }))
    }

    /// The picture of the frame of this time, s; `None` where OpenCV left it out.
    fn picture(&mut self, frame_s: f64) -> Result<Option<Vec<u8>>> {
        if self.ahead.is_none() {
            self.ahead = self.take()?;
        }
        let step_s = self.last_s.map(|last| frame_s - last).or(self.info.rate_hz.map(|rate| 1.0 / rate));
        self.last_s = Some(frame_s);
        let Some(taken) = &self.ahead else { return Ok(None) };
        let later_s =
            self.beside.start_s().zip(step_s).map(|(start, step)| (start + taken.time_s - frame_s) / step);
        match later_s {
            Some(steps) if steps > 0.5 && steps < MOST_LEFT_OUT => return Ok(None),
            Some(steps) if steps.abs() <= 0.5 => {}
            _ => self.by_order = true,
        }
        Ok(self.ahead.take().and_then(|taken| taken.plane))
    }

    /// The end of the recording, once the first decoder has no more frames.
    fn end(&mut self) -> Result<Ending> {
        let ending = self.beside.ending();
        let is_more = self.ahead.is_some() || self.take()?.is_some();
        if ending != Ending::Complete || !self.by_order || !is_more && self.pictures == self.frames {
            return Ok(ending);
        }
        let gives = if is_more { "more".to_owned() } else { self.pictures.to_string() };
        let reason = format!(
            "OpenCV gives {gives} pictures for {} frames and does not tell which: pictures may be those of frames beside them",
            self.frames
        );
        Ok(Ending::Early { frames: self.frames, byte: None, reason })
    }
}

fn open(name: &str, orientation: Orientation) -> Result<VideoCapture> {
    let failed = |why: String| {
        Error::Source(
            Fault::new(name, format!("OpenCV does not open it{why}"))
                .of_kind(FaultKind::Unsupported)
                .advice("Leave out " + Setting::Decoder.set_to("opencv")),
        )
    };
    // With its protocol, a name is never taken for an address. OpenCV takes names in UTF-8 only: a file of another name is
    // opened here and named by its number, by which FFmpeg opens it again.
    let path = crate::name::path(name);
    let (address, _open) = match path.to_str() {
        Some(name) => (format!("file:{name}"), None),
        None => {
            let file = File::open(&path).map_err(|e| failed(format!(" ({e})")))?;
            (format!("file:/dev/fd/{}", file.as_raw_fd()), Some(file))
        }
    };
    let mut capture = VideoCapture::from_file(&address, videoio::CAP_FFMPEG)
        .map_err(|e| failed(format!(" ({})", e.message)))?;
    if !capture.is_opened().unwrap_or(false) {
        return Err(failed(String::new()));
    }
    let told = capture.set(videoio::CAP_PROP_ORIENTATION_AUTO, 0.0).unwrap_or(false);
    if !told && orientation != Orientation::default() {
        return Err(failed(" as it is: this version turns pictures by itself".into()));
    }
    Ok(capture)
}

/// The next picture, turned, as gray bytes, if its size is the recording's; the outer `None` is the end.
fn read(
    capture: &mut VideoCapture,
    color: &mut Mat,
    info: &SourceInfo,
    orientation: Orientation,
) -> Result<Option<Option<Vec<u8>>>> {
    let fault = |e: opencv::Error| Error::Source(Fault::new(&info.name, format!("OpenCV: {}", e.message)));
    if !capture.read(color).map_err(fault)? {
        return Ok(None);
    }
    let mut gray = Mat::default();
    if color.channels() == 1 {
        color.copy_to(&mut gray).map_err(fault)?;
    } else {
        imgproc::cvt_color_def(color, &mut gray, imgproc::COLOR_BGR2GRAY).map_err(fault)?;
    }
    let (width, height) = orientation.size(info.width, info.height);
    let fits = (i64::from(gray.cols()), i64::from(gray.rows())) == (width.into(), height.into());
    if !fits {
        return Ok(Some(None));
    }
    let samples = gray.data_bytes().map_err(fault)?.to_vec();
    Ok(Some(Some(orientation.apply(samples, width as usize, height as usize, 1).0)))
}

fn frame(info: &SourceInfo, index: u64, ticks: i64, plane: Option<Vec<u8>>) -> Frame {
    Frame { plane: plane.map(|p| Box::new(p) as _), ..info.frame(index, ticks) }
}

impl FrameSource for OpencvSource {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        let Some(told) = self.beside.next_frame()? else {
            self.ending = self.end()?;
            return Ok(None);
        };
        self.frames += 1;
        let frame_s = self.beside.info().time_base.seconds(told.ticks);
        self.is_astray |= told.plane.is_none() && self.info.container == "avi";
        let plane = self.picture(frame_s)?.filter(|_| told.plane.is_some() && !self.is_astray);
        if self.is_dry && self.pictures == 0 {
            return Err(Error::Source(
                Fault::new(&self.info.name, "OpenCV decodes no frame of it")
                    .of_kind(FaultKind::Damaged)
                    .advice("Leave out " + Setting::Decoder.set_to("opencv")),
            ));
        }
        let ticks = if self.counts_frames { told.index as i64 } else { told.ticks };
        Ok(Some(frame(&self.info, told.index, ticks, plane)))
    }

    fn ending(&self) -> Ending {
        self.ending.clone()
    }

    fn gaps(&self) -> Gaps {
        self.beside.gaps()
    }

    fn stamps(&mut self) -> Result<Option<(Vec<i64>, bool)>> {
        if self.counts_frames { Ok(None) } else { self.beside.stamps() }
    }

    fn sample(&mut self, count: usize) -> Result<Vec<Frame>> {
        // OpenCV seeks by frame number, which is not exact; for statistics any frames will do.
        let mut capture = open(&self.info.name, self.orientation)?;
        let frames = capture.get(videoio::CAP_PROP_FRAME_COUNT).unwrap_or(0.0).max(0.0);
        let mut color = Mat::default();
        let mut samples = Vec::new();
        for k in 0..count {
            let at = (frames * (2 * k + 1) as f64 / (2 * count) as f64).floor();
            if at > 0.0 {
                let _ = capture.set(videoio::CAP_PROP_POS_FRAMES, at);
            }
            let Some(plane) = read(&mut capture, &mut color, &self.info, self.orientation)? else { continue };
            samples.extend(Some(frame(&self.info, k as u64, 0, plane)).filter(|f| f.plane.is_some()));
        }
        Ok(samples)
    }
}
