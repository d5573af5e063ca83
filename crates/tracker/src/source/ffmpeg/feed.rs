//! Feeds packets to the decoder, with what the file around each of them tells: whether it is whole, whether
//! others before it are lost, whether it is one field of a picture only.
//!
//! Owns: [`Feed`], [`Given`]. Must not: decode, or number frames.

use std::collections::VecDeque;

use ffmpeg_next::ffi;

use super::decode::{Decoder, Received};
use super::demux::{Demuxer, Packet, Read};
use super::fields::{FieldOrder, Fields};
use super::frame_numbers::FrameNumbers;
use super::inside::Inside;
use super::slice_sums::{self, SliceSums};
use super::slots::Slots;
use super::structure::{Fit, Structure};
use super::tags::Tags;
use crate::error::Result;

/// Frames in a row that cannot be read before the rest of a file is given up.
const MOST_FAILED: usize = 1000;

/// A packet as it was read.
struct Arrived {
    packet: Packet,
    /// How the file between the packet before it and this one fits together.
    fit: Fit,
    /// Stamps of packets between the two that did not come.
    lost: Vec<i64>,
    /// Its time follows that of the packet before it without a gap.
    follows: bool,
    /// The packet is later than that by more than half a frame.
    is_late: bool,
    /// The coded film goes on with it; `None` where nothing tells.
    goes_on: Option<bool>,
    is_second_field: bool,
}

/// A packet for the decoder.
pub(super) struct Given {
    pub packet: Packet,
    /// Stamps of packets before it that did not come.
    pub lost: Vec<ffi::AVPacket>,
    /// Packets before it are gone.
    pub after_loss: bool,
    /// The file before it is damaged.
    pub after_damage: bool,
    /// Its time is later than the end of the packet before it, by more than half a frame.
    pub is_late: bool,
    /// The coded film goes on with it.
    pub goes_on: bool,
    /// The packet itself is damaged, as far as the file around it tells.
    pub is_damaged: bool,
    /// Damage inside the packet, a clause.
    pub problem: Option<String>,
    /// The packet is the last one and shorter than it should be.
    pub is_cut: bool,
    /// The packet belongs to the picture of the packet before it.
    pub is_second_field: bool,
}

/// Reads packets, one ahead of the decoder where the file can tell damage.
pub(super) struct Feed {
    pub demuxer: Demuxer,
    name: String,
    /// Packets read ahead.
    ahead: VecDeque<Arrived>,
    structure: Option<Structure>,
    slots: Option<Slots>,
    fields: Option<Fields>,
    numbers_in_film: Option<FrameNumbers>,
    sums: Option<SliceSums>,
    inside: Option<Inside>,
    tags: Option<Tags>,
    has_single_fields: bool,
    /// Time and duration of the packet read last, ticks.
    last: Option<(i64, i64)>,
    /// Frames of a file with numbered ones that were read or failed.
    numbers: i64,
    /// Packets that hold nothing.
    empty: u64,
    failed: Option<String>,
    at_end: bool,
    /// Reading stopped at damage.
    is_broken_off: bool,
    ends_broken: bool,
}

impl Feed {
    /// Packets of the demuxer's stream; `first` of them are read at once. `is_file` is whether the file can be read
    /// again.
    pub(super) fn new(demuxer: Demuxer, name: &str, is_file: bool, first: usize) -> Result<Self> {
        let container = demuxer.container();
        let (id, is_alone) = (demuxer.stream().id, demuxer.streams() == 1);
        let structure = is_file.then(|| Structure::of(&container, name, id, is_alone)).flatten();
        let slots = (is_file && container == "avi").then(|| Slots::read(name, demuxer.index())).flatten();
        let fields = Fields::of(&demuxer);
        let codec = demuxer.parameters().codec_id;
        let numbers_in_film = FrameNumbers::of(codec, demuxer.codec_bytes());
        let mut feed = Self {
            demuxer,
            name: name.to_owned(),
            ahead: VecDeque::new(),
            structure,
            slots,
            fields,
            numbers_in_film,
            sums: SliceSums::of(codec),
            inside: Inside::of(codec),
            tags: Tags::of(codec),
            has_single_fields: false,
            last: None,
            numbers: 0,
            empty: 0,
            failed: None,
            at_end: false,
            is_broken_off: false,
            ends_broken: false,
        };
        for _ in 0..first {
            feed.read()?;
        }
        feed.has_single_fields = feed.ahead.iter().any(|a| a.is_second_field);
        Ok(feed)
    }

    /// Packets read ahead.
    pub(super) fn ahead(&self) -> impl Iterator<Item = &Packet> {
        self.ahead.iter().map(|a| &a.packet)
    }

    /// Whether the first packets are single fields.
    pub(super) fn has_single_fields(&self) -> bool {
        self.has_single_fields
    }

    /// Whether the first packets carry sums of their pixels, right or wrong.
    pub(super) fn has_sums(&self) -> bool {
        self.sums.is_some() && self.ahead().any(|p| slice_sums::are_there(p.bytes()))
    }

    /// Frames that the container declares and that were never in it: the recorder left them out.
    pub(super) fn empty(&self) -> u64 {
        self.slots.as_ref().map_or(self.empty, Slots::empty)
    }

    /// Whether packets can be cut out of the file without a trace: its container's elements are not followed, or those
    /// of FLV and MPEG program streams, which have no numbers; and its frames are not in numbered slots (AVI's empty ones are in the file).
    pub(super) fn is_blind(&self) -> bool {
        let container = self.demuxer.container();
        let is_numbered = self.slots.is_some() || ["avi", "cine"].contains(&container.as_str());
        !is_numbered && (self.structure.is_none() || ["flv", "mpeg", "nut"].contains(&container.as_str()))
    }

    /// The reason for which nothing more could be read, if that is not the end of the file.
    pub(super) fn stop_reason(&self) -> Option<&str> {
        self.failed.as_deref()
    }

    /// Whether the file is damaged or cut after its last packet.
    pub(super) fn ends_broken(&self) -> bool {
        self.ends_broken
    }

    /// Whether reading stopped at damage: how many pictures were to be shown between those after it nothing tells.
    pub(super) fn is_broken_off(&self) -> bool {
        self.is_broken_off
    }

    /// Once [`Feed::ends_broken`] is known: whether the file ends inside something that holds pictures, whatever it declares.
    pub(super) fn ends_in_pictures(&self) -> bool {
        self.structure.as_ref().is_some_and(Structure::ends_in_pictures)
    }

    /// The field that was filmed first, for interlaced film: as the container says, else as the first picture does.
    pub(super) fn field_order(&self, name: &str) -> Result<Option<FieldOrder>> {
        let parameters = self.demuxer.parameters();
        if parameters.field_order != ffi::AVFieldOrder::AV_FIELD_UNKNOWN {
            return Ok(FieldOrder::said(parameters.field_order));
        }
        let mut decoder = Decoder::open(&self.demuxer, name, 1)?;
        for packet in self.ahead().zip(1..).map(Some).chain([None]) {
            decoder.send(packet);
            if let Received::Picture(picture) = decoder.receive()? {
                return Ok(FieldOrder::of(picture.get()));
            }
        }
        Ok(None)
    }

    /// The next packet; `None` at the end.
    pub(super) fn next(&mut self) -> Result<Option<Given>> {
        if self.ahead.is_empty() {
            self.read()?;
        }
        let Some(arrived) = self.ahead.pop_front() else { return Ok(None) };
        let mut given = Given {
            lost: arrived.lost.iter().map(|at| stamped(&arrived.packet, *at)).collect(),
            after_loss: !arrived.lost.is_empty()
                || !arrived.follows && (arrived.fit != Fit::Whole || arrived.goes_on == Some(false)),
            after_damage: arrived.fit != Fit::Whole,
            is_late: arrived.is_late,
            goes_on: arrived.goes_on == Some(true),
            is_damaged: arrived.packet.has(ffi::AV_PKT_FLAG_CORRUPT),
            problem: None,
            is_cut: arrived.packet.has(ffi::AV_PKT_FLAG_CORRUPT),
            is_second_field: arrived.is_second_field,
            packet: arrived.packet,
        };
        if self.structure.is_some() || self.slots.is_some() {
            if self.ahead.is_empty() {
                self.read()?;
            }
            match self.ahead.front() {
                Some(after) => given.is_damaged |= after.fit == Fit::Broken,
                None => {
                    let rest = match &mut self.structure {
                        _ if self.is_broken_off => Fit::Broken,
                        Some(structure) => structure.rest(),
                        None => Fit::Whole,
                    };
                    self.ends_broken =
                        rest != Fit::Whole && (self.ends_in_pictures() || !self.is_declared_end());
                    given.is_damaged |= self.ends_broken;
                    given.is_cut |= self.ends_broken;
                }
            }
        }
        if let Some(sums) = &mut self.sums {
            let is_after_loss = given.after_loss || given.after_damage;
            if sums.is_damaged(given.packet.bytes(), is_after_loss, given.is_damaged) {
                given.is_damaged = true;
                // It may decode to anything, to interlaced pictures too.
                given.packet.set_corrupt();
            }
        }
        let bytes = given.packet.bytes();
        let problem = self.inside.as_mut().and_then(|inside| inside.problem(bytes));
        given.problem = problem.or_else(|| self.tags.as_mut().and_then(|tags| tags.problem(bytes)));
        given.is_damaged |= given.problem.is_some();
        Ok(Some(given))
    }

    /// Whether the length that the container declares is that of its pictures: FLV gives the last one's time, ASF adds the
    /// time that a player fills its buffer; Ogg and MPEG program streams give none, and the library's is what it finds.
    pub(super) fn declares_length(&self) -> bool {
        !["flv", "asf", "ogg", "mpeg"].contains(&self.demuxer.container().as_str())
    }

    /// Whether pictures follow the file's header at once, so that damage between the two may have cost some. Others' headers
    /// hold much that no picture needs.
    pub(super) fn begins_with_pictures(&self) -> bool {
        ["flv", "asf", "ogg", "nut"].contains(&self.demuxer.container().as_str())
    }

    /// Whether the packet read last reaches the end that the container declares.
    fn is_declared_end(&self) -> bool {
        if !self.declares_length() {
            return false;
        }
        let (Some(end), Some((time, duration))) = (self.demuxer.declared_end(), self.last) else {
            return false;
        };
        duration > 0 && time.saturating_add(duration) >= end.saturating_sub(duration / 2)
    }

    /// Reads one packet into the queue, if there is one.
    fn read(&mut self) -> Result<()> {
        let mut lost = Vec::new();
        let mut packet = Packet::new(&self.name)?;
        while !self.at_end {
            match self.demuxer.read(&mut packet) {
                // An empty one is a slot that the recorder left empty; a decoder would take it for the end.
                Read::Packet if packet.get().size <= 0 => {
                    self.numbers += 1;
                    self.empty += 1;
                }
                Read::Packet => {
                    self.failed = None;
                    self.numbers += 1;
                    self.arrive(packet, lost);
                    if self.numbers > 1 && self.demuxer.counts_edit_units() {
                        self.end_at_break();
                    }
                    return Ok(());
                }
                Read::End => self.at_end = true,
                Read::Failed(reason) => {
                    self.failed = Some(reason);
                    // Frames found by number: one that cannot be read says nothing of the next.
                    let number = self.numbers;
                    let numbered = self.demuxer.container() == "cine" && lost.len() < MOST_FAILED;
                    self.numbers += 1;
                    if numbered
                        && self.numbers < self.demuxer.duration().unwrap_or(0)
                        && self.demuxer.seek(self.numbers)
                    {
                        lost.push(number);
                    } else {
                        self.at_end = true;
                    }
                }
            }
        }
        Ok(())
    }

    /// Ends the reading where the packet read last comes after damage: frames that were between have no numbers, and those that
    /// follow no times.
    fn end_at_break(&mut self) {
        self.is_broken_off = self.ahead.back().is_some_and(|arrived| arrived.fit == Fit::Broken);
        if !self.is_broken_off {
            return;
        }
        let place = self.ahead.pop_back().and_then(|broken| u64::try_from(broken.packet.get().pos).ok());
        let place = place.map_or_else(String::new, |at| format!(" before byte {at}"));
        self.failed = Some(format!("it is damaged{place}, and frames after that have no times of their own"));
        self.at_end = true;
    }

    fn arrive(&mut self, mut packet: Packet, mut lost: Vec<i64>) {
        let fields = *packet.get();
        let mut fit = Fit::Whole;
        if let Ok(at) = u64::try_from(fields.pos) {
            if let Some(structure) = &mut self.structure {
                fit = structure.reach(at);
            }
            if let Some(slots) = &mut self.slots {
                let found = slots.find(at, usize::try_from(fields.size).unwrap_or(0));
                if let Ok(slot) = i64::try_from(found.slot) {
                    lost.extend(found.lost.iter().filter_map(|s| i64::try_from(*s).ok()));
                    packet.set_dts(slot);
                    if fields.pts != ffi::AV_NOPTS_VALUE {
                        packet.set_pts(slot);
                    }
                }
                if found.is_broken {
                    fit = Fit::Broken;
                }
            }
        }
        let fields = *packet.get();
        let time = [fields.dts, fields.pts].into_iter().find(|t| *t != ffi::AV_NOPTS_VALUE);
        let (follows, is_late) = match (self.last, time) {
            (Some((last, duration)), Some(time)) if duration > 0 => {
                let late = time.saturating_sub(last.saturating_add(duration));
                (late.abs() <= (duration / 2).max(1), late > duration / 2)
            }
            _ => (false, true),
        };
        self.last = time.map(|t| (t, fields.duration));
        let is_second_field = self.fields.as_mut().is_some_and(|f| f.is_second(&packet));
        let goes_on = self.numbers_in_film.as_mut().and_then(|n| n.follows(packet.bytes()));
        self.ahead.push_back(Arrived { packet, fit, lost, follows, is_late, goes_on, is_second_field });
    }
}

/// The stamps that a packet beside `packet` would have at `at`.
fn stamped(packet: &Packet, at: i64) -> ffi::AVPacket {
    let mut fields = *packet.get();
    fields.dts = at;
    if fields.pts != ffi::AV_NOPTS_VALUE {
        fields.pts = at;
    }
    fields
}
