//! Reads the packets of the one video stream out of a container.
//!
//! Owns: [`Demuxer`], [`Packet`]. Must not: decode, or decide what a lost packet means.

use std::ffi::{CStr, CString};
use std::os::unix::ffi::OsStringExt;
use std::ptr;

use ffmpeg_next::ffi;

use super::boxes::Boxes;
use super::{formats, message};
use crate::error::{Error, Fault, FaultKind, Result};
use crate::name::path;

/// The rate that libavformat counts time by in a coded stream whose bytes give none; it is told this one, which no file
/// gives, to be known again.
const NOT_GIVEN: ffi::AVRational = ffi::AVRational { num: 1_000_003, den: 40_000 };

/// An open container with one video stream selected; all others are discarded unread.
pub(super) struct Demuxer {
    context: *mut ffi::AVFormatContext,
    stream: usize,
    boxes: Boxes,
}

// SAFETY: the context is owned by this value alone and libavformat binds it to no thread.
unsafe impl Send for Demuxer {}

/// Outcome of a request for a packet.
pub(super) enum Read {
    /// The packet holds data of the stream.
    Packet,
    /// The end of the file.
    End,
    /// The container cannot be read further.
    Failed(String),
}

impl Demuxer {
    /// Opens `url` (with its protocol, e.g. `file:`) if it is of a format in [`formats::READ`]; `protocols` are those
    /// that may be used.
    pub(super) fn open(url: &str, name: &str, protocols: Option<&str>) -> Result<Self> {
        let failed = |code: i32| {
            Error::Source(match formats::not_read(url) {
                Some(what) => {
                    Fault::new(name, what).of_kind(FaultKind::Unsupported).advice("Give the recording itself")
                }
                None => Fault::new(name, format!("not a recording that can be read ({})", message(code)))
                    .of_kind(FaultKind::Unsupported)
                    .advice("Check that the file is complete and that `ffmpeg -i` reads it"),
            })
        };
        let address = CString::new(path(url).into_os_string().into_vec())
            .map_err(|_| Error::Source(Fault::new(name, "the name holds a zero byte")))?;
        let mut options: *mut ffi::AVDictionary = ptr::null_mut();
        let formats = formats::allowed(protocols.is_none());
        for (option, list) in [(c"protocol_whitelist", protocols), (c"format_whitelist", Some(&*formats))] {
            if let Some(list) = list.and_then(|l| CString::new(l).ok()) {
                // SAFETY: all strings are valid and zero-terminated; av_dict_set copies them.
                unsafe { ffi::av_dict_set(&mut options, option.as_ptr(), list.as_ptr(), 0) };
            }
        }
        let boxes = url.strip_prefix("file:").map_or_else(Boxes::default, |p| Boxes::of(&path(p)));
        if boxes.edits_change_time {
            // SAFETY: as above. Only the reader of MP4 and QuickTime knows it.
            unsafe { ffi::av_dict_set(&mut options, c"ignore_editlist".as_ptr(), c"1".as_ptr(), 0) };
        }
        if let Ok(rate) = CString::new(format!("{}/{}", NOT_GIVEN.num, NOT_GIVEN.den)) {
            // SAFETY: as above. Only readers of streams without a container know it.
            unsafe { ffi::av_dict_set(&mut options, c"framerate".as_ptr(), rate.as_ptr(), 0) };
        }
        let mut context: *mut ffi::AVFormatContext = ptr::null_mut();
        // SAFETY: `context` is null, so it is allocated; on failure it is freed and set to null by the call.
        let code =
            unsafe { ffi::avformat_open_input(&mut context, address.as_ptr(), ptr::null(), &mut options) };
        // SAFETY: frees what the call left of the dictionary.
        unsafe { ffi::av_dict_free(&mut options) };
        if code < 0 {
            return Err(failed(code));
        }
        let mut demuxer = Self { context, stream: 0, boxes };
        // SAFETY: the context is open; null asks for no per-stream options.
        let code = unsafe { ffi::avformat_find_stream_info(demuxer.context, ptr::null_mut()) };
        if code < 0 {
            return Err(failed(code));
        }
        // SAFETY: the context is open; a null decoder pointer is allowed.
        let best = unsafe {
            ffi::av_find_best_stream(
                demuxer.context,
                ffi::AVMediaType::AVMEDIA_TYPE_VIDEO,
                -1,
                -1,
                ptr::null_mut(),
                0,
            )
        };
        demuxer.stream = usize::try_from(best).map_err(|_| {
            Error::Source(
                Fault::new(name, "it holds no video stream")
                    .of_kind(FaultKind::Unsupported)
                    .advice("Give a film, not a sound or text file"),
            )
        })?;
        if demuxer.stream().disposition & ffi::AV_DISPOSITION_ATTACHED_PIC != 0 {
            return Err(Error::Source(
                Fault::new(name, "it holds no video stream, only sound with a cover picture")
                    .of_kind(FaultKind::Unsupported)
                    .advice("Give a film, not a sound file"),
            ));
        }
        // SAFETY: `nb_streams` streams are valid while the context is open.
        unsafe {
            for i in 0..(*demuxer.context).nb_streams as usize {
                if i != demuxer.stream {
                    (**(*demuxer.context).streams.add(i)).discard = ffi::AVDiscard::AVDISCARD_ALL;
                }
            }
        }
        Ok(demuxer)
    }

    /// The selected stream.
    pub(super) fn stream(&self) -> &ffi::AVStream {
        // SAFETY: `stream` is an index that av_find_best_stream gave; streams live as long as the context.
        unsafe { &**(*self.context).streams.add(self.stream) }
    }

    /// The stream's index in the container.
    pub(super) fn index(&self) -> usize {
        self.stream
    }

    /// Number of streams of the container.
    pub(super) fn streams(&self) -> u32 {
        // SAFETY: the context is open.
        unsafe { (*self.context).nb_streams }
    }

    /// The stream's parameters.
    pub(super) fn parameters(&self) -> &ffi::AVCodecParameters {
        // SAFETY: every stream has parameters as long as the context lives.
        unsafe { &*self.stream().codecpar }
    }

    /// The codec's parameters as the container holds them.
    pub(super) fn codec_bytes(&self) -> &[u8] {
        let parameters = self.parameters();
        match usize::try_from(parameters.extradata_size) {
            // SAFETY: `extradata_size` bytes that live as long as the parameters and are not changed after opening.
            Ok(size) if !parameters.extradata.is_null() => unsafe {
                std::slice::from_raw_parts(parameters.extradata, size)
            },
            _ => &[],
        }
    }

    /// Whether packets have display times. MPEG program streams have one where a block of bytes begins, and no more.
    pub(super) fn has_display_times(&self) -> bool {
        self.container() != "mpeg"
    }

    /// Whether a film's display times lack, whose first packets have these times to be shown and to be decoded. MXF whose index
    /// does not say how the film is reordered has the same for both.
    pub(super) fn lacks_display_times(&self, first: impl IntoIterator<Item = (i64, i64)>) -> bool {
        let is_reordered = self.parameters().video_delay > 0;
        let mut first = first.into_iter().peekable();
        self.counts_edit_units()
            && is_reordered
            && first.peek().is_some()
            && first.all(|(pts, dts)| pts == dts || dts == ffi::AV_NOPTS_VALUE)
    }

    /// Whether a packet has no time in the file, and libavformat counts packets in place of it.
    pub(super) fn counts_edit_units(&self) -> bool {
        self.container().starts_with("mxf")
    }

    /// Frames by the length of a recording that is counted in frames.
    pub(super) fn edit_units(&self) -> Option<u64> {
        let stream = self.stream();
        let (base, rate) = (stream.time_base, stream.avg_frame_rate);
        let is_frame = i64::from(base.num) * i64::from(rate.num) == i64::from(base.den) * i64::from(rate.den);
        if !self.counts_edit_units() || !is_frame {
            return None;
        }
        u64::try_from(stream.duration).ok().filter(|n| *n > 0)
    }

    /// Width to height of a pixel: the container's, else the codec's; and the codec's own. 0 is not said.
    pub(super) fn pixel_aspect(&self) -> [ffi::AVRational; 2] {
        // SAFETY: the context is open and the stream one of its own; without a frame the codec's parameters are asked.
        let told = unsafe {
            let stream = *(*self.context).streams.add(self.stream);
            ffi::av_guess_sample_aspect_ratio(self.context, stream, ptr::null_mut())
        };
        [told, self.parameters().sample_aspect_ratio]
    }

    /// Short names of the container, comma-separated.
    pub(super) fn container(&self) -> String {
        // SAFETY: an open context has an input format, whose name is a static string.
        unsafe { CStr::from_ptr((*(*self.context).iformat).name) }.to_string_lossy().into_owned()
    }

    /// The rate that the container claims, frames per second.
    pub(super) fn rate(&self) -> Option<ffi::AVRational> {
        Some(self.stream().avg_frame_rate).filter(|r| is_rate(*r)).or_else(|| self.guessed())
    }

    /// Rates that the container gives, frames per second, the likeliest first. Of MP4 and QuickTime the average is none of
    /// them: it is the number of frames over the whole length, which a last frame that is shown longer falsifies.
    pub(super) fn rates(&self) -> impl Iterator<Item = ffi::AVRational> + use<> {
        let is_counted = self.container().contains("mp4");
        let average = Some(self.stream().avg_frame_rate).filter(|r| !is_counted && is_rate(*r));
        average.into_iter().chain(self.guessed())
    }

    /// The lowest rate of which all time stamps are multiples, as libavformat guesses; where it knows no better it gives one
    /// frame per tick, which says nothing.
    fn guessed(&self) -> Option<ffi::AVRational> {
        let (rate, base) = (self.stream().r_frame_rate, self.stream().time_base);
        let is_tick = i64::from(rate.num) * i64::from(base.num) == i64::from(rate.den) * i64::from(base.den);
        Some(rate).filter(|r| is_rate(*r) && !is_tick)
    }

    /// Whether neither the file nor the coded film says anything of time. Where a coded stream gives no rate, libavformat
    /// may put a usual one in one of its two places; the other keeps what it was told.
    pub(super) fn is_untimed(&self) -> bool {
        let rates = [self.stream().avg_frame_rate, self.stream().r_frame_rate];
        rates.iter().any(|r| (r.num, r.den) == (NOT_GIVEN.num, NOT_GIVEN.den))
    }

    /// The contents of the file's boxes, if it has such.
    pub(super) fn boxes(&self) -> &Boxes {
        &self.boxes
    }

    /// The value of a metadata key of the file or of the stream.
    pub(super) fn tag(&self, key: &CStr) -> Option<String> {
        // SAFETY: the context is open; null dictionaries are allowed.
        let of_file = unsafe { ffi::av_dict_get((*self.context).metadata, key.as_ptr(), ptr::null(), 0) };
        // SAFETY: the same, of the stream.
        let of_stream = unsafe { ffi::av_dict_get(self.stream().metadata, key.as_ptr(), ptr::null(), 0) };
        let entry = [of_file, of_stream].into_iter().find(|e| !e.is_null())?;
        // SAFETY: an entry that was found has a zero-terminated value, which lives as long as the context.
        Some(unsafe { CStr::from_ptr((*entry).value) }.to_string_lossy().into_owned())
    }

    /// Frames of the stream by its index, and how many of them an edit list hides; `None` without an index that is
    /// complete from the start.
    pub(super) fn indexed(&self) -> Option<(u64, u64)> {
        if self.stream().nb_frames <= 0 || !self.container().contains("mp4") {
            return None;
        }
        let stream: *const ffi::AVStream = self.stream();
        // SAFETY: the stream is valid.
        let count = unsafe { ffi::avformat_index_get_entries_count(stream) };
        let hidden = (0..count).filter(|&i| {
            // SAFETY: the stream is valid and only read; the index is below the count, and null is checked.
            let entry = unsafe { ffi::avformat_index_get_entry(stream.cast_mut(), i).as_ref() };
            entry.is_some_and(|e| e.flags() & ffi::AVINDEX_DISCARD_FRAME != 0)
        });
        let hidden = hidden.count() as u64;
        u64::try_from(count).ok().filter(|n| *n > 0).map(|n| (n, hidden))
    }

    /// Length of the whole recording by the container, in ticks of the stream's time base.
    pub(super) fn duration(&self) -> Option<i64> {
        let stream = self.stream();
        (stream.duration > 0).then_some(stream.duration).or_else(|| {
            // SAFETY: the context is open.
            let whole = unsafe { (*self.context).duration };
            let base = ffi::AVRational { num: 1, den: ffi::AV_TIME_BASE };
            // SAFETY: a pure function of its arguments.
            (whole > 0).then(|| unsafe { ffi::av_rescale_q(whole, base, stream.time_base) })
        })
    }

    /// The end of the stream that the container itself declares, in ticks; `None` if it declares none, or one for several streams
    /// together.
    pub(super) fn declared_end(&self) -> Option<i64> {
        let stream = self.stream();
        // SAFETY: the context is open.
        let (whole, method, streams) = unsafe {
            let c = &*self.context;
            (c.duration, c.duration_estimation_method, c.nb_streams)
        };
        let from_header = method == ffi::AVDurationEstimationMethod::AVFMT_DURATION_FROM_STREAM;
        // GIF declares none: the library adds up what it finds.
        if whole <= 0 || !from_header || streams != 1 || self.container() == "gif" {
            return None;
        }
        let start = if stream.start_time == ffi::AV_NOPTS_VALUE { 0 } else { stream.start_time };
        let end = start.checked_add(self.duration()?)?;
        // The library's length has the pause in it, where that and what is shown are less than the whole film; so has its start.
        let base = stream.time_base;
        let shown = self.boxes().ends_after_pause_s.map(|s| s * f64::from(base.den) / f64::from(base.num));
        Some(shown.filter(|s| *s < end as f64).map_or(end, |s| s as i64))
    }

    /// Byte offset that the reader has reached.
    pub(super) fn position(&self) -> Option<u64> {
        // SAFETY: the context is open; `pb` may be null for formats without a file.
        let pb = unsafe { (*self.context).pb };
        if pb.is_null() {
            return None;
        }
        // SAFETY: a seek by 0 from the current place is how avio_tell is defined.
        u64::try_from(unsafe { ffi::avio_seek(pb, 0, 1) }).ok()
    }

    /// Reads the next packet of the stream.
    pub(super) fn read(&mut self, packet: &mut Packet) -> Read {
        loop {
            packet.clear();
            // SAFETY: context and packet are valid and owned.
            let code = unsafe { ffi::av_read_frame(self.context, packet.0) };
            if code == ffi::AVERROR_EOF {
                return Read::End;
            }
            if code < 0 {
                return Read::Failed(message(code));
            }
            if usize::try_from(packet.get().stream_index) == Ok(self.stream) {
                return Read::Packet;
            }
        }
    }

    /// Goes to the last key frame at or before `ticks`.
    pub(super) fn seek(&mut self, ticks: i64) -> bool {
        // SAFETY: the context is open and the stream's index valid.
        unsafe { ffi::av_seek_frame(self.context, self.stream as i32, ticks, ffi::AVSEEK_FLAG_BACKWARD) >= 0 }
    }
}

/// Whether it is a rate that the file gives.
fn is_rate(r: ffi::AVRational) -> bool {
    r.num > 0 && r.den > 0 && (r.num, r.den) != (NOT_GIVEN.num, NOT_GIVEN.den)
}

impl Drop for Demuxer {
    fn drop(&mut self) {
        // SAFETY: the context was opened by avformat_open_input and is closed once.
        unsafe { ffi::avformat_close_input(&mut self.context) };
    }
}

/// One packet of coded data.
pub(super) struct Packet(*mut ffi::AVPacket);

// SAFETY: the packet is owned by this value alone; its buffer's count is atomic.
unsafe impl Send for Packet {}

impl Packet {
    /// An empty packet.
    pub(super) fn new(name: &str) -> Result<Self> {
        // SAFETY: allocation only; null is checked.
        let packet = unsafe { ffi::av_packet_alloc() };
        if packet.is_null() {
            return Err(Error::Source(Fault::new(name, "out of memory").of_kind(FaultKind::System)));
        }
        Ok(Self(packet))
    }

    /// The packet's fields.
    pub(super) fn get(&self) -> &ffi::AVPacket {
        // SAFETY: never null after `new`.
        unsafe { &*self.0 }
    }

    /// When it is shown and when decoded, ticks.
    pub(super) fn times(&self) -> (i64, i64) {
        (self.get().pts, self.get().dts)
    }

    /// The packet's bytes of the stream.
    pub(super) fn bytes(&self) -> &[u8] {
        let fields = self.get();
        match usize::try_from(fields.size) {
            // SAFETY: a packet's data are `size` bytes that live until it is cleared, which takes a mutable borrow.
            Ok(size) if !fields.data.is_null() => unsafe { std::slice::from_raw_parts(fields.data, size) },
            _ => &[],
        }
    }

    /// Marks it as damaged, so that no decoder gets it.
    pub(super) fn set_corrupt(&mut self) {
        // SAFETY: never null after `new`, and this value owns it.
        unsafe { (*self.0).flags |= ffi::AV_PKT_FLAG_CORRUPT };
    }

    /// Replaces the packet's display time.
    pub(super) fn set_pts(&mut self, pts: i64) {
        // SAFETY: never null after `new`.
        unsafe { (*self.0).pts = pts };
    }

    /// Replaces the packet's decoding time.
    pub(super) fn set_dts(&mut self, dts: i64) {
        // SAFETY: never null after `new`.
        unsafe { (*self.0).dts = dts };
    }

    /// Whether one of the flags `AV_PKT_FLAG_*` is set.
    pub(super) fn has(&self, flag: i32) -> bool {
        self.get().flags & flag != 0
    }

    /// For the decoder.
    pub(super) fn as_ptr(&self) -> *const ffi::AVPacket {
        self.0
    }

    fn clear(&mut self) {
        // SAFETY: never null after `new`.
        unsafe { ffi::av_packet_unref(self.0) };
    }
}

impl Drop for Packet {
    fn drop(&mut self) {
        // SAFETY: allocated by av_packet_alloc and freed once.
        unsafe { ffi::av_packet_free(&mut self.0) };
    }
}
