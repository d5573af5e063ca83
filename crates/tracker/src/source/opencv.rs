//! Decodes compressed film through OpenCV's `VideoCapture`: a second, independent decoder to check the first against.
//!
//! Owns: [`OpencvSource`]. OpenCV makes blue, green and red of every picture and we make brightness of these,
//! so it costs more and gives 8 bits only. Its times of frames are wrong at the end of streams with reordered
//! frames (version 4.6 gives 0), so times are the container's. It turns films of 90 and 270 degrees the wrong way
//! (version 4.6 again) and mirrors none, so pictures are turned here.

use std::fs::File;
use std::os::fd::AsRawFd;

use opencv::core::Mat;
use opencv::imgproc;
use opencv::prelude::{MatTraitConst, MatTraitConstManual, VideoCaptureTrait, VideoCaptureTraitConst};
use opencv::videoio::{self, VideoCapture};

use super::ffmpeg::{FfmpegSource, display_times};
use super::orientation::Orientation;
use super::{Input, OpenOptions};
use crate::error::{Error, Fault, FaultKind, Result};
use crate::frame::{Ending, Frame, FrameSource, PixelFormat, SourceInfo};
use crate::message::Setting;

/// A recording read through OpenCV.
pub struct OpencvSource {
    info: SourceInfo,
    orientation: Orientation,
    capture: VideoCapture,
    color: Mat,
    next: u64,
    /// Ticks of all frames; empty if the user gave a rate.
    times: Vec<i64>,
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
        let times = if options.fps.is_some() {
            Vec::new()
        } else {
            display_times(name, input, usize::MAX, u64::MAX)?.0
        };
        Ok(Self {
            info,
            orientation,
            capture,
            color: Mat::default(),
            next: 0,
            times,
            ending: Ending::Complete,
        })
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
    Frame {
        index,
        ticks,
        width: info.width,
        height: info.height,
        stride: info.width as usize,
        format: PixelFormat::Gray8,
        depth_bits: 8,
        plane: plane.map(|p| Box::new(p) as _),
        colour: None,
    }
}

impl FrameSource for OpencvSource {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        let Some(plane) = read(&mut self.capture, &mut self.color, &self.info, self.orientation)? else {
            if self.next == 0 {
                return Err(Error::Source(
                    Fault::new(&self.info.name, "OpenCV decodes no frame of it")
                        .of_kind(FaultKind::Damaged)
                        .advice("Leave out " + Setting::Decoder.set_to("opencv")),
                ));
            }
            if let Some(declared) = self.info.declared_frames.filter(|n| *n > self.next) {
                self.ending = Ending::Early {
                    frames: self.next,
                    byte: None,
                    reason: format!("OpenCV stops after {} of {declared} declared frames", self.next),
                };
            }
            return Ok(None);
        };
        let index = self.next;
        self.next += 1;
        let ticks =
            usize::try_from(index).ok().and_then(|i| self.times.get(i).copied()).unwrap_or(index as i64);
        Ok(Some(frame(&self.info, index, ticks, plane)))
    }

    fn ending(&self) -> Ending {
        self.ending.clone()
    }

    fn stamps(&mut self) -> Result<Option<(Vec<i64>, bool)>> {
        Ok(Some((self.times.clone(), true)).filter(|t| !t.0.is_empty()))
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
