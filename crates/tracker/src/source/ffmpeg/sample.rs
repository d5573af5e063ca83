//! Frames spread over a recording, for statistics, without disturbing the reading of it.

use std::sync::Arc;

use ffmpeg_next::ffi;

use super::decode::{Decoder, Received};
use super::demux::{Demuxer, Packet, Read};
use super::{FfmpegSource, Shared};
use crate::error::{Error, Fault, Result};
use crate::frame::Frame;

/// Most bytes of a pipe's first frames that are kept to be handed out again.
const PIPE_BYTES: usize = 64 << 20;

impl FfmpegSource {
    /// Opens the file a second time and decodes at places spread by time. Key frames are taken; where there are
    /// fewer than `count`, frames that follow them too.
    pub(super) fn sample_file(&mut self, count: usize) -> Result<Vec<Frame>> {
        let mut sampler = Sampler {
            source: self,
            demuxer: Demuxer::open(&self.url, &self.info.name, self.protocols)?,
            decoder: Decoder::open(&self.demuxer, &self.info.name, self.threads)?,
            packet: Packet::new(&self.info.name)?,
            keys: Vec::new(),
            frames: Vec::new(),
        };
        let duration = sampler.demuxer.duration();
        let start = match sampler.demuxer.stream().start_time {
            ffi::AV_NOPTS_VALUE => 0,
            t => t,
        };
        if let Some(duration) = duration {
            for i in 0..count as i64 {
                let at = start.saturating_add((i128::from(duration) * i128::from(i) / count as i128) as i64);
                if !sampler.demuxer.seek(at) {
                    break;
                }
                sampler.decoder.flush();
                sampler.take(1, 1)?;
            }
        }
        if sampler.frames.len() < count {
            // Few key frames: from each of them some way on, taking every few.
            let keys = if sampler.keys.is_empty() { vec![start] } else { sampler.keys.clone() };
            let wanted = (count - sampler.frames.len()).div_ceil(keys.len());
            for key in &keys {
                if sampler.frames.len() >= count {
                    break;
                }
                if sampler.demuxer.seek(*key) {
                    sampler.decoder.flush();
                } else {
                    sampler.demuxer = Demuxer::open(&self.url, &self.info.name, self.protocols)?;
                    sampler.decoder = Decoder::open(&self.demuxer, &self.info.name, self.threads)?;
                }
                let left = count - sampler.frames.len();
                sampler.take(wanted.min(left), 4)?;
            }
        }
        let frames = sampler.frames;
        if frames.is_empty() {
            return Err(Error::Source(
                Fault::new(&self.info.name, "no frame can be decoded")
                    .advice("Check that the file is complete and that `ffmpeg -i` reads it"),
            ));
        }
        Ok(frames)
    }

    /// Decodes the first frames and keeps them for [`next_frame`](crate::frame::FrameSource::next_frame).
    pub(super) fn sample_pipe(&mut self, count: usize) -> Result<Vec<Frame>> {
        let mut samples = Vec::new();
        let mut bytes = 0usize;
        while samples.len() < count && bytes < PIPE_BYTES {
            let Some(mut frame) = self.decode_next()? else { break };
            if let Some(plane) = frame.plane.take() {
                let shared: Arc<dyn crate::frame::Bytes> = Arc::from(plane);
                bytes += shared.bytes().len();
                frame.plane = Some(Box::new(Shared(Arc::clone(&shared))));
                samples.push(Frame { plane: Some(Box::new(Shared(shared))), ..frame });
            }
            self.replay.push_back(frame);
        }
        Ok(samples)
    }
}

struct Sampler<'a> {
    source: &'a FfmpegSource,
    demuxer: Demuxer,
    decoder: Decoder,
    packet: Packet,
    /// Display times of the first frames after each seek, to see when a key frame comes again.
    keys: Vec<i64>,
    frames: Vec<Frame>,
}

impl Sampler<'_> {
    /// Decodes from here and keeps every `stride`-th frame until `wanted` are kept or the stream ends. With a
    /// stride of 1 the first frame is a key frame, kept if it is new.
    fn take(&mut self, wanted: usize, stride: usize) -> Result<()> {
        let (mut seen, mut kept, mut draining, mut failures) = (0usize, 0usize, false, 0usize);
        while kept < wanted && failures < 64 {
            match self.decoder.receive()? {
                Received::Picture(picture) => {
                    let time = picture.get().best_effort_timestamp;
                    seen += 1;
                    if stride == 1 {
                        if self.keys.contains(&time) {
                            return Ok(());
                        }
                        self.keys.push(time);
                    } else if seen % stride != 0 {
                        continue;
                    }
                    let info = &self.source.info;
                    if picture.is_damaged() || !self.source.layout.is_of(&picture) {
                        failures += 1;
                        continue;
                    }
                    let (w, h) = (picture.get().width.unsigned_abs(), picture.get().height.unsigned_abs());
                    let orientation = self.source.orientation;
                    if orientation.size(w, h) != (info.width, info.height) {
                        failures += 1;
                        continue;
                    }
                    if let Some((plane, row)) = self.source.layout.plane(picture, orientation) {
                        self.frames.push(Frame {
                            index: self.frames.len() as u64,
                            ticks: time,
                            width: info.width,
                            height: info.height,
                            stride: row,
                            format: info.format,
                            depth_bits: info.depth_bits,
                            plane: Some(plane),
                        });
                        kept += 1;
                    }
                }
                Received::Hungry if draining => return Ok(()),
                Received::End => return Ok(()),
                Received::Damaged => failures += 1,
                Received::Hungry => match self.demuxer.read(&mut self.packet) {
                    Read::Packet => {
                        if !self.packet.has(ffi::AV_PKT_FLAG_CORRUPT) {
                            self.decoder.send(Some(&self.packet));
                        }
                    }
                    Read::End | Read::Failed(_) => {
                        draining = true;
                        self.decoder.send(None);
                    }
                },
            }
        }
        Ok(())
    }
}
