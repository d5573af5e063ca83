//! Compressed film through FFmpeg's libraries; the luma plane is lent to detection without a copy.
//!
//! Owns: [`FfmpegSource`]. Must not: print, change a pixel where the recording has a luma plane, or guess what
//! a frame that could not be decoded held: it comes without a plane, and so do frames predicted from it, up to
//! the next key frame.

mod boxes;
mod claims;
mod decode;
mod demux;
mod describe;
mod ending;
pub(crate) mod formats;
mod layout;
mod order;
mod sample;
mod stamps;

use std::collections::VecDeque;
use std::ffi::CStr;
use std::sync::Arc;

use ffmpeg_next::ffi;

use decode::{Decoder, Picture, Received};
use demux::{Demuxer, Packet, Read};
use describe::{describe, step};
use layout::{Layout, Orientation};
use order::{Order, Sent};
use stamps::Stamps;
pub(crate) use stamps::display_times;

use super::{Input, OpenOptions};
use crate::error::{Error, Fault, Result};
use crate::frame::{Bytes, Ending, Frame, FrameSource, SourceInfo};

/// FFmpeg's words for an error code.
fn message(code: i32) -> String {
    // The binding knows FFmpeg's words only once it has been started; starting it again does nothing more.
    match ffmpeg_next::init() {
        Ok(()) => ffmpeg_next::Error::from(code).to_string(),
        Err(e) => format!("FFmpeg's error {code}; {e}"),
    }
}

/// FFmpeg's name of a codec.
fn codec_name(id: ffi::AVCodecID) -> String {
    // SAFETY: the call gives a static string for any value.
    unsafe { CStr::from_ptr(ffi::avcodec_get_name(id)) }.to_string_lossy().into_owned()
}

/// A frame on its way out: its time, and its plane with the bytes of a row.
struct Ready {
    ticks: i64,
    plane: Option<(Box<dyn Bytes>, usize)>,
    byte: Option<u64>,
}

/// A recording read through FFmpeg.
pub struct FfmpegSource {
    info: SourceInfo,
    url: String,
    can_reopen: bool,
    protocols: Option<&'static str>,
    threads: usize,
    demuxer: Demuxer,
    decoder: Decoder,
    layout: Layout,
    orientation: Orientation,
    /// Packets read ahead while looking whether the stream has display times.
    ahead: VecDeque<Packet>,
    packet: Packet,
    stamps: Stamps,
    order: Order,
    intra_only: bool,
    /// A frame is damaged and those that follow are predicted from it.
    tainted: bool,
    draining: bool,
    finished: bool,
    failures: usize,
    /// Packets of the stream seen, with those that an edit list hides.
    packets: u64,
    last_byte: Option<u64>,
    /// The demuxer found less of the last packet than there should be.
    last_is_cut: bool,
    stop_reason: Option<String>,
    /// Frames without a plane whose fate depends on whether a good one follows.
    held: VecDeque<Ready>,
    ready: VecDeque<Ready>,
    /// Frames given as samples of a pipe, to be handed out in their turn.
    replay: VecDeque<Frame>,
    next_index: u64,
    user_clock: bool,
    ending: Ending,
}

/// How far decoding order and display order can differ (H.264's and HEVC's limit of 16 frames).
const REORDER: i64 = 16;

/// Packets, and bytes of them, whose time stamps are looked at without decoding.
const SURVEYED_FRAMES: usize = 20_000;
const SURVEYED_BYTES: u64 = 256 << 20;

impl FfmpegSource {
    /// Opens what `input` stands for; `name` is the user's, for messages.
    ///
    /// # Errors
    /// [`Error::Source`] if it holds no film that can be decoded.
    pub(crate) fn open(name: &str, input: &Input, options: &OpenOptions) -> Result<Self> {
        // SAFETY: sets one global number. The libraries would print; errors come back as codes.
        unsafe { ffi::av_log_set_level(ffi::AV_LOG_QUIET) };
        let (url, can_reopen, protocols) = match input {
            Input::File(url) => (url, true, Some("file")),
            Input::Pipe(url) => (url, false, Some(if url.starts_with("file:") { "file" } else { "pipe" })),
            Input::Address(url) => (url, false, None),
        };
        let mut demuxer = Demuxer::open(url, name, protocols)?;
        let decoder = Decoder::open(&demuxer, name, options.threads)?;
        let parameters = demuxer.parameters();
        let layout = Layout::new(parameters.format, name)?;
        // SAFETY: a look-up in a static table; null for codecs without a descriptor.
        let properties =
            unsafe { ffi::avcodec_descriptor_get(parameters.codec_id).as_ref() }.map_or(0, |d| d.props);
        let intra_only = properties & ffi::AV_CODEC_PROP_INTRA_ONLY != 0;
        let (info, orientation) = describe(&demuxer, &layout, name, options)?;

        // A stream has display times if its first packets have.
        let mut ahead = VecDeque::new();
        let mut stop_reason = None;
        let mut at_end = false;
        for _ in 0..if intra_only { 1 } else { 6 } {
            let mut packet = Packet::new(name)?;
            match demuxer.read(&mut packet) {
                Read::Packet => ahead.push_back(packet),
                Read::End => at_end = true,
                Read::Failed(reason) => {
                    stop_reason = Some(reason);
                    at_end = true;
                }
            }
            if at_end {
                break;
            }
        }
        let lacks = |p: &Packet| {
            p.get().pts == ffi::AV_NOPTS_VALUE && !(intra_only && p.get().dts != ffi::AV_NOPTS_VALUE)
        };
        let unstamped = ahead.iter().any(lacks);
        let step = step(&demuxer);
        Ok(Self {
            info,
            url: url.clone(),
            can_reopen,
            protocols,
            threads: options.threads,
            demuxer,
            decoder,
            layout,
            orientation,
            ahead,
            packet: Packet::new(name)?,
            stamps: Stamps::new(unstamped, step),
            order: Order::new(if unstamped && !intra_only { REORDER } else { 0 }),
            intra_only,
            tainted: false,
            draining: false,
            finished: false,
            failures: 0,
            packets: 0,
            last_byte: None,
            last_is_cut: false,
            stop_reason,
            held: VecDeque::new(),
            ready: VecDeque::new(),
            replay: VecDeque::new(),
            next_index: 0,
            user_clock: options.fps.is_some(),
            ending: Ending::Complete,
        })
    }

    /// Whether the end was reached.
    pub(crate) fn is_finished(&self) -> bool {
        self.finished
    }

    /// Reads one packet and gives it to the decoder, or starts draining.
    fn feed(&mut self) {
        if let Some(packet) = self.ahead.pop_front() {
            self.packet = packet;
        } else if self.stop_reason.is_some() {
            return self.drain();
        } else {
            match self.demuxer.read(&mut self.packet) {
                Read::Packet => {}
                Read::End => return self.drain(),
                Read::Failed(reason) => {
                    self.stop_reason = Some(reason);
                    return self.drain();
                }
            }
        }
        let number = self.packets as i64;
        self.packets += 1;
        let fields = *self.packet.get();
        let byte = u64::try_from(fields.pos).ok();
        let key = self.stamps.key(&fields, number);
        self.packet.set_pts(key);
        // What an edit list hides is decoded, because others are predicted from it, but gives no picture.
        if !self.packet.has(ffi::AV_PKT_FLAG_DISCARD) {
            self.order.sent(Sent { key, byte, key_frame: self.packet.has(ffi::AV_PKT_FLAG_KEY) });
            self.last_byte = byte.map(|b| b + u64::try_from(fields.size).unwrap_or(0)).or(self.last_byte);
        }
        // A packet that the demuxer knows to be cut would give a picture with made-up pixels.
        self.last_is_cut = self.packet.has(ffi::AV_PKT_FLAG_CORRUPT);
        if !self.last_is_cut {
            self.decoder.send(Some(&self.packet));
        }
    }

    fn drain(&mut self) {
        self.draining = true;
        self.decoder.send(None);
    }

    /// Takes one picture out of the decoder, feeding it as needed. Adds to `ready`, or ends the recording.
    fn advance(&mut self) -> Result<()> {
        match self.decoder.receive()? {
            Received::Picture(picture) => {
                self.failures = 0;
                self.take(picture);
            }
            Received::Hungry if self.draining => self.finish(),
            Received::Hungry => self.feed(),
            Received::End => self.finish(),
            Received::Damaged => {
                self.failures += 1;
                // One failure for each packet under way is the most that can come; more is a decoder that is stuck.
                if self.draining && self.failures > self.order.waiting() + 64 {
                    self.finish();
                }
            }
        }
        Ok(())
    }

    /// Puts a picture into the queue, and before it frames without a plane for those that will not come.
    fn take(&mut self, picture: Picture) {
        let key = picture.get().pts;
        let arrival = self.order.arrived(key);
        for lost in arrival.lost {
            self.tainted |= !self.intra_only;
            self.hold(lost);
        }
        let damaged = picture.is_damaged();
        if damaged {
            self.tainted |= !self.intra_only;
        } else if arrival.own.is_some_and(|p| p.key_frame) {
            self.tainted = false;
        }
        let byte = arrival.own.and_then(|p| p.byte);
        let fits = self.layout.is_of(&picture) && {
            let (w, h) = (picture.get().width.unsigned_abs(), picture.get().height.unsigned_abs());
            self.orientation.size(w, h) == (self.info.width, self.info.height)
        };
        let plane = if damaged || self.tainted || !fits {
            None
        } else {
            self.layout.plane(picture, self.orientation)
        };
        let usual = self.stamps.last();
        let ticks = self.stamps.ticks(key);
        // In a file that is cut, the last pictures in display order may be there and one before them not.
        let after_hole = self.draining
            && !self.intra_only
            && usual
                .is_some_and(|(last, longest)| ticks.saturating_sub(last) > longest.saturating_mul(3) / 2);
        let plane = if after_hole && self.is_cut() { None } else { plane };
        let ready = Ready { ticks, plane, byte };
        if ready.plane.is_some() {
            self.ready.append(&mut self.held);
            self.ready.push_back(ready);
        } else {
            self.held.push_back(ready);
        }
    }

    fn hold(&mut self, lost: Sent) {
        let ticks = self.stamps.ticks(lost.key);
        self.held.push_back(Ready { ticks, plane: None, byte: lost.byte });
    }

    fn make(&mut self, ready: Ready) -> Frame {
        let index = self.next_index;
        self.next_index += 1;
        let (plane, stride) = match ready.plane {
            Some((plane, stride)) => (Some(plane), stride),
            None => (None, 0),
        };
        Frame {
            index,
            ticks: if self.user_clock { index as i64 } else { ready.ticks },
            width: self.info.width,
            height: self.info.height,
            stride,
            format: self.info.format,
            depth_bits: self.info.depth_bits,
            plane,
        }
    }

    fn decode_next(&mut self) -> Result<Option<Frame>> {
        loop {
            if let Some(ready) = self.ready.pop_front() {
                return Ok(Some(self.make(ready)));
            }
            if self.finished {
                if self.next_index == 0 {
                    let reason = match &self.ending {
                        Ending::Early { reason, .. } => reason.clone(),
                        Ending::Complete => "it holds no frames".to_owned(),
                    };
                    return Err(Error::Source(
                        Fault::new(&self.info.name, format!("no frame can be decoded: {reason}"))
                            .advice("Check that the file is complete and that `ffmpeg -i` reads it"),
                    ));
                }
                return Ok(None);
            }
            self.advance()?;
        }
    }
}

impl FrameSource for FfmpegSource {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        match self.replay.pop_front() {
            Some(frame) => Ok(Some(frame)),
            None => self.decode_next(),
        }
    }

    fn ending(&self) -> Ending {
        self.ending.clone()
    }

    fn stamps(&mut self) -> Result<Option<(Vec<i64>, bool)>> {
        if !self.can_reopen || self.user_clock {
            return Ok(None);
        }
        let input = Input::File(self.url.clone());
        let found = display_times(&self.info.name, &input, SURVEYED_FRAMES, SURVEYED_BYTES)?;
        Ok(Some(found).filter(|(times, _)| !times.is_empty()))
    }

    fn sample(&mut self, count: usize) -> Result<Vec<Frame>> {
        if self.can_reopen { self.sample_file(count) } else { self.sample_pipe(count) }
    }
}

/// A plane that two frames share.
struct Shared(Arc<dyn Bytes>);

impl Bytes for Shared {
    fn bytes(&self) -> &[u8] {
        self.0.bytes()
    }
}
