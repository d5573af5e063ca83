//! Reads the frames of a film through FFmpeg: demultiplexes, decodes, puts pictures in order, numbers frames.
//!
//! Owns: [`FfmpegSource`]. Must not: print, or guess what a frame that could not be decoded held.

use std::collections::VecDeque;

use ffmpeg_next::ffi;

use super::decode::{Decoder, Picture, Received};
use super::demux::{Demuxer, Packet};
use super::dependence::Dependence;
use super::describe::{describe, step, stream_base};
use super::feed::{Feed, Given};
use super::fields::{self, FieldOrder};
use super::layout::Layout;
use super::lost::Lost;
use super::order::{Order, Sent};
use super::reach::{Reach, References};
use super::reasons::Reasons;
use super::stamps::{Stamps, Survey, display_times};
use super::watch::Fate;
use crate::error::{Error, Fault, FaultKind, Place, Result};
use crate::frame::{Bytes, Ending, Frame, FrameSource, SourceInfo};
use crate::gaps::{Gaps, Reason};
use crate::message::Setting;
use crate::pixel_aspect::PixelAspect;
use crate::pixel_damage::{self, PixelDamage};
use crate::source::orientation::Orientation;
use crate::source::{Input, Interlaced, OpenOptions};

/// A frame on its way out: its time, and its plane with the bytes of a row.
pub(super) struct Ready {
    pub(super) ticks: i64,
    pub(super) plane: Option<(Box<dyn Bytes>, usize)>,
    pub(super) colour: Option<[Vec<u8>; 2]>,
    pub(super) byte: Option<u64>,
    number: u64,
}

/// A recording read through FFmpeg.
pub struct FfmpegSource {
    pub(super) info: SourceInfo,
    pub(super) url: String,
    pub(super) can_reopen: bool,
    pub(super) protocols: Option<&'static str>,
    pub(super) threads: usize,
    pub(super) feed: Feed,
    pub(super) decoder: Decoder,
    pub(super) layout: Layout,
    pub(super) orientation: Orientation,
    pub(super) interlaced: Interlaced,
    /// Whether frames bring their colour.
    pub(super) colour: bool,
    /// Width to height of a pixel by the first picture; `None` before it.
    coded_aspect: Option<PixelAspect>,
    pub(super) stamps: Stamps,
    /// Ticks from frame to frame by the rate that the container claims; 1 if it claims none.
    pub(super) step: i64,
    pub(super) order: Order,
    pub(super) intra_only: bool,
    references: References,
    dependence: Dependence,
    reasons: Reasons,
    /// Number of the packet given last, in decoding order.
    number: u64,
    /// Packets, in decoding order, of which it is known what became of them.
    settled: u64,
    pub(super) draining: bool,
    pub(super) finished: bool,
    pub(super) failures: usize,
    /// Packets of the stream seen or known to be lost, with those that an edit list hides.
    pub(super) packets: u64,
    pub(super) last_byte: Option<u64>,
    /// The last packet is less than there should be.
    pub(super) last_is_cut: bool,
    pub(super) lost: Lost,
    /// The file is to be looked through before its first packet is given to the decoder.
    pub(super) is_surveyed: bool,
    /// Packets given to the decoder, and numbers of those that come after gaps where nothing else tells of damage.
    pub(super) fed: u64,
    pub(super) after_gaps: VecDeque<u64>,
    /// Least display time of a shown packet, and those of hidden ones that may lie between shown ones, ticks.
    pub(super) first_shown: Option<i64>,
    pub(super) hidden: Vec<i64>,
    /// Frames without a plane whose fate depends on whether a good one follows.
    pub(super) held: VecDeque<Ready>,
    pub(super) ready: VecDeque<Ready>,
    /// Frames given as samples of a pipe, to be handed out in their turn.
    pub(super) replay: VecDeque<Frame>,
    pub(super) next_index: u64,
    /// Ticks are frame numbers: the user gives the rate, or nothing does.
    pub(super) counts_frames: bool,
    pub(super) ending: Ending,
}

/// How far decoding order and display order can differ (H.264's and HEVC's limit of 16 frames).
const REORDER: i64 = 16;

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
        let demuxer = Demuxer::open(url, name, protocols)?;
        let decoder = Decoder::open(&demuxer, name, options.threads)?;
        let parameters = demuxer.parameters();
        let layout = Layout::new(parameters.format, name)?;
        // SAFETY: a look-up in a static table; null for codecs without a descriptor.
        let properties =
            unsafe { ffi::avcodec_descriptor_get(parameters.codec_id).as_ref() }.map_or(0, |d| d.props);
        let intra_only = properties & ffi::AV_CODEC_PROP_INTRA_ONLY != 0;
        let (mut info, orientation) = describe(&demuxer, &layout, name, options)?;

        let counts_frames = options.fps.is_some() || demuxer.is_untimed();
        let step = step(&demuxer).round() as i64;
        let references = References::of(parameters.codec_id, demuxer.codec_bytes());
        let feed = Feed::new(demuxer, name, can_reopen, if intra_only { 1 } else { 6 })?;
        fields::tell(feed.field_order(name)?, name, options.interlaced, &mut info)?;
        if feed.has_sums() {
            info.pixel_damage = PixelDamage::of(pixel_damage::FFV1_WITH_SUMS);
        }
        // Where each field is a packet, so is it where the container counts.
        if feed.has_single_fields() {
            info.declared_frames = info.declared_frames.map(|n| n.div_ceil(2));
        }
        // A stream has display times if its first packets have.
        let lacks = |p: &Packet| {
            p.get().pts == ffi::AV_NOPTS_VALUE && !(intra_only && p.get().dts != ffi::AV_NOPTS_VALUE)
        };
        let unstamped = !feed.demuxer.has_display_times()
            || feed.ahead().any(lacks)
            || feed.demuxer.lacks_display_times(feed.ahead().map(Packet::times));
        let is_blind = feed.is_blind();
        let lost = Lost::new(stream_base(&feed.demuxer), &info.claims.container, is_blind);
        Ok(Self {
            info,
            url: url.clone(),
            can_reopen,
            protocols,
            threads: options.threads,
            feed,
            decoder,
            layout,
            orientation,
            interlaced: options.interlaced,
            colour: options.colour,
            coded_aspect: None,
            stamps: Stamps::new(unstamped, step),
            step,
            order: Order::new(if unstamped && !intra_only { REORDER } else { 0 }),
            intra_only,
            references,
            dependence: Dependence::new(intra_only),
            reasons: Reasons::default(),
            number: 0,
            settled: 0,
            draining: false,
            finished: false,
            failures: 0,
            packets: 0,
            last_byte: None,
            last_is_cut: false,
            lost,
            is_surveyed: is_blind && can_reopen && !intra_only && !counts_frames,
            fed: 0,
            after_gaps: VecDeque::new(),
            first_shown: None,
            hidden: Vec::new(),
            held: VecDeque::new(),
            ready: VecDeque::new(),
            replay: VecDeque::new(),
            next_index: 0,
            counts_frames,
            ending: Ending::Complete,
        })
    }

    /// The turn of the recording's pictures.
    pub(crate) fn orientation(&self) -> Orientation {
        self.orientation
    }

    /// Whether the end was reached.
    pub(crate) fn is_finished(&self) -> bool {
        self.finished
    }

    /// Gives the next packet to the decoder, or starts draining.
    pub(super) fn feed(&mut self) -> Result<()> {
        let Some(mut given) = self.feed.next()? else {
            self.drain();
            return Ok(());
        };
        for slot in std::mem::take(&mut given.lost) {
            let key = self.stamps.key(&slot, self.packets as i64);
            self.packets += 1;
            let number = self.dependence.coded(key, false, Reach::All);
            self.dependence.damaged(number);
            self.order.sent(Sent { key, byte: None, number });
        }
        let is_after_gap = self.is_after_gap()?;
        let fields = *given.packet.get();
        let byte = u64::try_from(fields.pos).ok();
        // A second field belongs to the picture of the packet before it, whose time that picture has.
        let mut key = ffi::AV_NOPTS_VALUE;
        if !given.is_second_field {
            key = self.stamps.key(&fields, self.packets as i64);
            self.packets += 1;
            let time = self.stamps.time(key);
            if self.packets == 1 && given.after_damage && self.feed.begins_with_pictures() {
                self.lost.begins_broken();
            } else if given.after_loss {
                self.lost.broken(time);
            } else if given.after_damage {
                self.lost.damaged(time);
            }
            if given.goes_on && given.is_late {
                self.lost.goes_on(time);
            }
            given.after_loss |= is_after_gap && !given.goes_on;
            self.note_hidden(&given, key);
            let is_key_frame = given.packet.has(ffi::AV_PKT_FLAG_KEY);
            let reach = self.references.reach(given.packet.bytes());
            self.number = self.dependence.coded(key, is_key_frame, reach);
            if given.after_loss {
                self.dependence.lost_before(self.number);
            }
            if given.is_damaged {
                self.dependence.damaged(self.number);
            }
            self.reasons.of_packet(self.number, given.problem.take());
            // What an edit list hides is decoded, because others are predicted from it, but gives no picture.
            if !given.packet.has(ffi::AV_PKT_FLAG_DISCARD) {
                self.order.sent(Sent { key, byte, number: self.number });
                self.last_byte = byte.map(|b| b + u64::try_from(fields.size).unwrap_or(0)).or(self.last_byte);
            }
        }
        given.packet.set_pts(key);
        self.last_is_cut = given.is_cut;
        // A packet that is known to be cut would give a picture with made-up pixels.
        if !given.packet.has(ffi::AV_PKT_FLAG_CORRUPT) {
            self.decoder.send(Some((&given.packet, self.number)));
        }
        Ok(())
    }

    /// Whether the next packet comes after a gap in the times of a file in which nothing else tells of damage.
    fn is_after_gap(&mut self) -> Result<bool> {
        if std::mem::take(&mut self.is_surveyed) {
            let survey = Survey::of(&self.info.name, &Input::File(self.url.clone()), usize::MAX, u64::MAX)?;
            self.after_gaps = survey.packets_after_gaps(&self.info.claims.container).into();
            self.stamps.surveyed(&survey);
        }
        let number = self.fed;
        self.fed += 1;
        let is_next = self.after_gaps.front() == Some(&number);
        if is_next {
            self.after_gaps.pop_front();
        }
        Ok(is_next)
    }

    /// Notes a frame that is not shown. An edit list trims frames at the ends; a frame hidden between shown ones is lost to who
    /// watches, and so is a frame whose display time is damaged: it is further from its decoding time than any codec allows.
    fn note_hidden(&mut self, given: &Given, key: i64) {
        if given.packet.has(ffi::AV_PKT_FLAG_DISCARD) {
            let dts = given.packet.get().dts;
            let is_far = dts != ffi::AV_NOPTS_VALUE
                && self.step > 1
                && key.saturating_sub(dts).unsigned_abs() > (2 * REORDER * self.step).unsigned_abs();
            if is_far {
                self.lost.broken(dts);
            } else {
                self.hidden.push(key);
            }
            return;
        }
        let first = self.first_shown.map_or(key, |f| f.min(key));
        self.first_shown = Some(first);
        let lost = &mut self.lost;
        self.hidden.retain(|hidden| {
            let is_inside = (first..key).contains(hidden);
            if is_inside {
                lost.broken(*hidden);
            }
            !is_inside
        });
    }

    pub(super) fn drain(&mut self) {
        self.draining = true;
        self.decoder.send(None);
    }

    /// Takes one picture out of the decoder, feeding it as needed. Adds to `ready`, or ends the recording.
    pub(super) fn advance(&mut self) -> Result<()> {
        match self.decoder.receive()? {
            Received::Picture(picture) => {
                self.failures = 0;
                if let (Interlaced::Refuse, Some(order)) = (self.interlaced, FieldOrder::of(picture.get())) {
                    return Err(fields::refusal(&self.info.name, order));
                }
                self.check_aspect(&picture)?;
                self.take(picture);
            }
            Received::Hungry if self.draining => self.finish(),
            Received::Hungry => self.feed()?,
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

    /// Refuses pixels of another shape than those before, unless the user says what is true of all.
    fn check_aspect(&mut self, picture: &Picture) -> Result<()> {
        if picture.is_damaged() || !self.info.pixel_aspect_origin.is_recording() {
            return Ok(());
        }
        let told = picture.get().sample_aspect_ratio;
        let [width, height] = [told.num, told.den].map(|n| u64::try_from(n).unwrap_or(0));
        let aspect = PixelAspect::new(width, height).unwrap_or_default();
        let before = *self.coded_aspect.get_or_insert(aspect);
        if before.agrees(aspect) {
            return Ok(());
        }
        let index = self.next_index + (self.ready.len() + self.held.len()) as u64;
        Err(Error::Source(
            Fault::new(
                &self.info.name,
                format!("its pixels are {aspect} (width:height) from here on, and {before} before"),
            )
            .of_kind(FaultKind::Unsupported)
            .at(Place::Frame(index))
            .advice(
                "Give the frames of one shape with "
                    + Setting::Frames
                    + ", or what is true of all with "
                    + Setting::PixelAspect,
            ),
        ))
    }

    /// Puts a picture into the queue, and before it frames without a plane for those that will not come.
    pub(super) fn take(&mut self, picture: Picture) {
        let key = picture.get().pts;
        let arrival = self.order.arrived(key);
        arrival.untold.iter().for_each(|at| self.lost.broken(*at));
        if arrival.is_late {
            return;
        }
        for lost in arrival.lost {
            self.dependence.damaged(lost.number);
            self.hold(lost);
        }
        // A second picture of one packet, or one without a packet, is as good as what came last.
        let number = arrival.own.map_or(self.settled, |own| own.number);
        if picture.is_damaged() || !self.decoder.is_written(number, &picture) {
            self.dependence.damaged(number);
        }
        // It is through with all packets up to this picture's.
        for number in self.settled + 1..=number {
            if self.decoder.fate(number) != Fate::Whole {
                self.dependence.damaged(number);
            }
        }
        self.settled = self.settled.max(number);
        let is_whole = self.dependence.is_whole(number, key);
        let fits = self.layout.is_of(&picture) && {
            let (w, h) = (picture.get().width.unsigned_abs(), picture.get().height.unsigned_abs());
            self.orientation.size(w, h) == (self.info.width, self.info.height)
        };
        let (colour, plane) = if !is_whole || !fits {
            (None, None)
        } else {
            let colour = if self.colour { self.layout.colour(&picture, self.orientation) } else { None };
            (colour, self.layout.plane(picture, self.orientation))
        };
        let (usual, ticks) = (self.stamps.last(), self.stamps.ticks(key));
        // In a file that is cut, the last pictures in display order may be there and one before them not.
        let after_hole = self.draining
            && !self.intra_only
            && usual
                .is_some_and(|(last, longest)| ticks.saturating_sub(last) > longest.saturating_mul(3) / 2);
        let plane = if self.is_unplaced() || after_hole && self.is_cut() { None } else { plane };
        let byte = arrival.own.and_then(|p| p.byte);
        let ready = Ready { ticks, plane, colour, byte, number };
        if ready.plane.is_some() {
            self.ready.append(&mut self.held);
            self.ready.push_back(ready);
        } else {
            self.held.push_back(ready);
        }
    }

    pub(super) fn hold(&mut self, lost: Sent) {
        let ticks = self.stamps.ticks(lost.key);
        self.held.push_back(Ready { ticks, plane: None, colour: None, byte: lost.byte, number: lost.number });
    }

    pub(super) fn make(&mut self, ready: Ready) -> Frame {
        let index = self.next_index;
        self.next_index += 1;
        self.lost.frame(index, ready.ticks);
        if ready.plane.is_none() {
            self.reasons.left_out(index, ready.number);
        }
        let (plane, stride) = ready.plane.unzip();
        let stride = stride.unwrap_or(0);
        let ticks = if self.counts_frames { index as i64 } else { ready.ticks };
        Frame { stride, plane, colour: ready.colour, ..self.info.frame(index, ticks) }
    }

    pub(super) fn decode_next(&mut self) -> Result<Option<Frame>> {
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
                            .of_kind(FaultKind::Damaged)
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
        // A packet that holds one field is no frame.
        if !self.can_reopen || self.counts_frames || self.feed.has_single_fields() {
            return Ok(None);
        }
        let have_times = self.feed.demuxer.has_display_times();
        let found = display_times(&self.info.name, &Input::File(self.url.clone()), have_times)?;
        Ok(Some(found).filter(|(times, _)| !times.is_empty()))
    }

    fn gaps(&self) -> Gaps {
        self.lost.gaps()
    }

    fn reasons(&self) -> Vec<Reason> {
        self.reasons.told()
    }

    fn sample(&mut self, count: usize) -> Result<Vec<Frame>> {
        if self.can_reopen { self.sample_file(count) } else { self.sample_pipe(count) }
    }
}
