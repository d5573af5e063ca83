//! Reads frames spread over a recording, for statistics, without disturbing the reading of it.

use std::sync::Arc;

use ffmpeg_next::ffi;

use super::decode::{Decoder, Picture, Received};
use super::demux::{Demuxer, Packet, Read};
use super::fields::{self, FieldOrder};
use super::layout::Layout;
use super::source::FfmpegSource;
use super::watch::Fate;
use crate::error::{Error, Fault, FaultKind, Result};
use crate::frame::{Bytes, Frame, SourceInfo};
use crate::source::orientation::Orientation;
use crate::source::{Interlaced, cores};

/// Most bytes of a pipe's first frames that are kept to be handed out again.
const PIPE_BYTES: usize = 64 << 20;
/// Stride over the frames after a key frame.
const STRIDE: usize = 4;

/// A plane that two frames share.
struct Shared(Arc<dyn Bytes>);

impl Bytes for Shared {
    fn bytes(&self) -> &[u8] {
        self.0.bytes()
    }
}

impl FfmpegSource {
    /// Opens the file again, once for each thread, and decodes at places spread by time. Key frames are taken;
    /// where there are fewer than `count`, frames that follow them too.
    pub(super) fn sample_file(&mut self, count: usize) -> Result<Vec<Frame>> {
        let mut demuxer = Demuxer::open(&self.url, &self.info.name, self.protocols)?;
        let places = places(&mut demuxer, &self.info.name, count)?;
        let keys = places.iter().filter(|p| p.key).count();
        let each = (count - keys.min(count)).div_ceil(places.len());
        let threads = cores(self.threads);
        let part = places.len().div_ceil(threads);
        let from = From {
            url: &self.url,
            protocols: self.protocols,
            info: &self.info,
            layout: &self.layout,
            orientation: self.orientation,
            interlaced: self.interlaced,
            threads: threads.div_ceil(places.len().div_ceil(part)),
        };
        let mut found: Vec<Result<Vec<Taken>>> = std::thread::scope(|scope| {
            let mut demuxer = Some(demuxer);
            let samplers: Vec<_> = places
                .chunks(part)
                .map(|places| {
                    let (from, demuxer) = (&from, demuxer.take());
                    scope.spawn(move || Sampler::open(from, demuxer)?.take(places, each))
                })
                .collect();
            let failed =
                || Error::Source(Fault::new(&self.info.name, "the decoder failed; please report this"));
            samplers.into_iter().map(|s| s.join().unwrap_or_else(|_| Err(failed()))).collect()
        });
        // A container without an index may seek past its only key frame; then decoding begins at the beginning.
        if found.iter().all(|f| f.as_ref().is_ok_and(|t| t.iter().all(Taken::is_empty))) {
            found.push(Sampler::open(&from, None).and_then(|mut s| Ok(vec![s.take_here(true, count)?])));
        }
        let (mut frames, mut later) = (Vec::new(), Vec::new());
        let mut seen = Vec::new();
        for taken in found {
            for taken in taken? {
                if let Some(key) = taken.key
                    && !seen.contains(&key.ticks)
                {
                    seen.push(key.ticks);
                    frames.push(key);
                }
                later.extend(taken.later);
            }
        }
        frames.extend(later);
        frames.truncate(count);
        for (i, frame) in frames.iter_mut().enumerate() {
            frame.index = i as u64;
        }
        if frames.is_empty() {
            return Err(Error::Source(
                Fault::new(&self.info.name, "no frame can be decoded")
                    .of_kind(FaultKind::Damaged)
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
                let shared: Arc<dyn Bytes> = Arc::from(plane);
                bytes += shared.bytes().len();
                frame.plane = Some(Box::new(Shared(Arc::clone(&shared))));
                let plane: Box<dyn Bytes> = Box::new(Shared(shared));
                samples.push(Frame { plane: Some(plane), colour: frame.colour.clone(), ..frame });
            }
            self.replay.push_back(frame);
        }
        Ok(samples)
    }
}

/// Somewhere to decode from.
struct Place {
    ticks: i64,
    /// Whether seeking there gave a packet; else it is the file's beginning.
    key: bool,
}

/// The places at which to decode: the key frames before `count` moments spread evenly, each once.
fn places(demuxer: &mut Demuxer, name: &str, count: usize) -> Result<Vec<Place>> {
    let start = match demuxer.stream().start_time {
        ffi::AV_NOPTS_VALUE => 0,
        t => t,
    };
    let mut packet = Packet::new(name)?;
    let (mut places, mut packets) = (Vec::new(), Vec::new());
    if let Some(duration) = demuxer.duration() {
        for i in 0..count as i64 {
            let ticks = start.saturating_add((i128::from(duration) * i128::from(i) / count as i128) as i64);
            if !demuxer.seek(ticks) {
                break;
            }
            if let Read::Packet = demuxer.read(&mut packet) {
                let fields = packet.get();
                let identity = (fields.pts, fields.dts, fields.pos);
                if !packets.contains(&identity) {
                    packets.push(identity);
                    places.push(Place { ticks, key: true });
                }
            }
        }
    }
    if places.is_empty() {
        places.push(Place { ticks: start, key: false });
    }
    Ok(places)
}

/// Settings that samplers share.
struct From<'a> {
    url: &'a str,
    protocols: Option<&'static str>,
    info: &'a SourceInfo,
    layout: &'a Layout,
    orientation: Orientation,
    interlaced: Interlaced,
    threads: usize,
}

/// Frames that were decoded at a place.
#[derive(Default)]
struct Taken {
    /// The first frame there, if the place is a key frame.
    key: Option<Frame>,
    /// Every few of those that follow.
    later: Vec<Frame>,
}

impl Taken {
    fn is_empty(&self) -> bool {
        self.key.is_none() && self.later.is_empty()
    }
}

struct Sampler<'a> {
    from: &'a From<'a>,
    demuxer: Demuxer,
    decoder: Decoder,
    packet: Packet,
    /// Packets given to the decoder, and time stamps of those from the place where it decodes.
    given: u64,
    stamps: Vec<i64>,
}

impl<'a> Sampler<'a> {
    fn open(from: &'a From<'a>, demuxer: Option<Demuxer>) -> Result<Self> {
        let name = &from.info.name;
        let demuxer = match demuxer {
            Some(demuxer) => demuxer,
            None => Demuxer::open(from.url, name, from.protocols)?,
        };
        let decoder = Decoder::open(&demuxer, name, from.threads)?;
        Ok(Self { from, demuxer, decoder, packet: Packet::new(name)?, given: 0, stamps: Vec::new() })
    }

    /// Decodes at each place the frame there and `each` that follow.
    fn take(mut self, places: &[Place], each: usize) -> Result<Vec<Taken>> {
        let mut all = Vec::new();
        for place in places {
            if self.demuxer.seek(place.ticks) {
                self.decoder.flush();
            } else {
                self = Self::open(self.from, None)?;
            }
            all.push(self.take_here(place.key, each)?);
        }
        Ok(all)
    }

    /// Decodes from here and keeps the first frame, if it is wanted, and every [`STRIDE`]-th until `each` of them
    /// are kept or the stream ends.
    fn take_here(&mut self, key: bool, each: usize) -> Result<Taken> {
        let mut taken = Taken::default();
        let (mut seen, mut draining, mut failures) = (0usize, false, 0usize);
        self.stamps.clear();
        while (key && taken.key.is_none() || taken.later.len() < each) && failures < 64 {
            match self.decoder.receive()? {
                Received::Picture(picture) => {
                    if let (Interlaced::Refuse, Some(order)) =
                        (self.from.interlaced, FieldOrder::of(picture.get()))
                    {
                        return Err(fields::refusal(&self.from.info.name, order));
                    }
                    seen += 1;
                    let first = key && taken.key.is_none();
                    if !first && !seen.is_multiple_of(STRIDE) {
                        continue;
                    }
                    match self.frame(picture) {
                        Some(frame) if first => taken.key = Some(frame),
                        Some(frame) => taken.later.push(frame),
                        None => failures += 1,
                    }
                }
                Received::Hungry if draining => break,
                Received::End => break,
                Received::Damaged => failures += 1,
                Received::Hungry => match self.demuxer.read(&mut self.packet) {
                    Read::Packet => {
                        if !self.packet.has(ffi::AV_PKT_FLAG_CORRUPT) {
                            self.given += 1;
                            self.stamps.push(self.packet.get().pts);
                            self.decoder.send(Some((&self.packet, self.given)));
                        }
                    }
                    Read::End | Read::Failed(_) => {
                        draining = true;
                        self.decoder.send(None);
                    }
                },
            }
        }
        Ok(taken)
    }

    /// Whether nothing was damaged in the packets up to the picture's own.
    fn is_whole(&self, picture: &Picture) -> bool {
        let own = self.stamps.iter().rposition(|stamp| *stamp == picture.get().pts);
        let first = self.given - self.stamps.len() as u64 + 1;
        let up_to = own.map_or(self.given, |own| first + own as u64);
        (first..=up_to).all(|number| self.decoder.fate(number) != Fate::Damaged)
    }

    /// The picture as a frame; `None` if it is damaged or not like the others.
    fn frame(&self, picture: Picture) -> Option<Frame> {
        let From { info, layout, orientation, .. } = self.from;
        let (w, h) = (picture.get().width.unsigned_abs(), picture.get().height.unsigned_abs());
        if picture.is_damaged()
            || !self.is_whole(&picture)
            || !layout.is_of(&picture)
            || orientation.size(w, h) != (info.width, info.height)
        {
            return None;
        }
        let ticks = picture.get().best_effort_timestamp;
        let (plane, stride) = layout.plane(picture, *orientation)?;
        Some(Frame { stride, plane: Some(plane), ..info.frame(0, ticks) })
    }
}
