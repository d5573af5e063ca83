//! Decodes packets on FFmpeg's own threads and lends the pictures.
//!
//! Owns: [`Decoder`], [`Picture`]. Must not: know of files, or convert pixels.

use std::ptr;

use ffmpeg_next::ffi;

use super::demux::{Demuxer, Packet};
use super::watch::{Fate, Watch};
use super::{codec_name, message};
use crate::error::{Error, Fault, FaultKind, Result};
use crate::source::cores;

/// Codecs whose decoders keep silent about damage. H.264's says by its messages what it fills in, which [`Watch`] hears; told to
/// stop, its threads would keep good pictures too.
const STRICT: [ffi::AVCodecID; 5] = [
    ffi::AVCodecID::AV_CODEC_ID_HEVC,
    ffi::AVCodecID::AV_CODEC_ID_FFV1,
    ffi::AVCodecID::AV_CODEC_ID_PNG,
    ffi::AVCodecID::AV_CODEC_ID_MJPEG,
    ffi::AVCodecID::AV_CODEC_ID_GIF,
];

/// Codecs whose decoder bends coefficients beyond a block's end back into it, unless it is told that bits matter: then it fills
/// in the block, which [`Watch`] hears. What Microsoft's own encoder writes there is not doubted.
const BENT: [ffi::AVCodecID; 5] = [
    ffi::AVCodecID::AV_CODEC_ID_MSMPEG4V1,
    ffi::AVCodecID::AV_CODEC_ID_MSMPEG4V2,
    ffi::AVCodecID::AV_CODEC_ID_MSMPEG4V3,
    ffi::AVCodecID::AV_CODEC_ID_WMV1,
    ffi::AVCodecID::AV_CODEC_ID_WMV2,
];

/// An open decoder of one stream.
pub(super) struct Decoder {
    context: *mut ffi::AVCodecContext,
    watch: Watch,
}

// SAFETY: the context is owned by this value alone; libavcodec allows use from any one thread at a time.
unsafe impl Send for Decoder {}

/// The outcome of a request for a picture.
pub(super) enum Received {
    /// A picture, in display order.
    Picture(Picture),
    /// The decoder wants another packet.
    Hungry,
    /// All pictures are out.
    End,
    /// Something could not be decoded.
    Damaged,
}

impl Decoder {
    /// Opens a decoder for the demuxer's stream; `threads` 0 is one for each core.
    pub(super) fn open(demuxer: &Demuxer, name: &str, threads: usize) -> Result<Self> {
        let parameters = demuxer.parameters();
        // SAFETY: a look-up by a value that libavformat gave.
        let codec = unsafe { ffi::avcodec_find_decoder(parameters.codec_id) };
        if codec.is_null() {
            return Err(Error::Source(
                Fault::new(name, format!("no decoder for {} is installed", codec_name(parameters.codec_id)))
                    .of_kind(FaultKind::Unsupported)
                    .advice("Install FFmpeg's libraries with it, or convert the recording with `-c:v ffv1`"),
            ));
        }
        // SAFETY: allocation only; null is checked.
        let context = unsafe { ffi::avcodec_alloc_context3(codec) };
        if context.is_null() {
            return Err(Error::Source(Fault::new(name, "out of memory").of_kind(FaultKind::System)));
        }
        let decoder = Self { context, watch: Watch::new(parameters.codec_id) };
        // SAFETY: the context is allocated and not yet open; parameters and stream live during the calls.
        let code = unsafe {
            let code = ffi::avcodec_parameters_to_context(context, parameters);
            (*context).pkt_timebase = demuxer.stream().time_base;
            // Left to itself, FFmpeg takes a thread more than there are cores, which is slower on two of them.
            (*context).thread_count = i32::try_from(cores(threads)).unwrap_or(1);
            (*context).thread_type = ffi::FF_THREAD_FRAME | ffi::FF_THREAD_SLICE;
            // Some decoders pass over damage in silence unless they are told to stop at it; others say of a
            // picture that it is damaged, and stop at trifles if they are told so.
            if STRICT.contains(&parameters.codec_id) {
                (*context).err_recognition |= ffi::AV_EF_EXPLODE | ffi::AV_EF_CRCCHECK;
            }
            if BENT.contains(&parameters.codec_id) {
                (*context).err_recognition |= ffi::AV_EF_BITSTREAM;
            }
            // Cropping is exact to the pixel only with unaligned planes; we read bytes, so any place will do.
            (*context).flags |= ffi::AV_CODEC_FLAG_UNALIGNED as i32;
            decoder.watch.prepare(&mut *context);
            if code < 0 { code } else { ffi::avcodec_open2(context, codec, ptr::null_mut()) }
        };
        if code < 0 {
            let codec = codec_name(parameters.codec_id);
            return Err(Error::Source(
                Fault::new(name, format!("the decoder of {codec} does not open ({})", message(code)))
                    .of_kind(FaultKind::Unsupported)
                    .advice("Check that `ffmpeg -i` reads the file, or convert it with `-c:v ffv1`"),
            ));
        }
        Ok(decoder)
    }

    /// Gives a packet and its number, from 1, to the decoder, or with `None` says that there are no more. A failure shows
    /// later, in [`fate`](Self::fate) or as a picture that does not come.
    pub(super) fn send(&mut self, packet: Option<(&Packet, u64)>) {
        if let Some((_, number)) = packet {
            // SAFETY: the context is open, and no other reference to it exists here.
            self.watch.next(number, unsafe { &mut *self.context });
        }
        // SAFETY: the context is open; a null packet starts draining.
        unsafe { ffi::avcodec_send_packet(self.context, packet.map_or(ptr::null(), |(p, _)| p.as_ptr())) };
    }

    /// The fate of packet `number`; to be asked when its picture or that of a later packet is out.
    pub(super) fn fate(&self, number: u64) -> Fate {
        self.watch.fate(number)
    }

    /// Takes the next picture.
    pub(super) fn receive(&mut self) -> Result<Received> {
        let picture = Picture::new()?;
        // SAFETY: context and frame are valid and owned.
        let code = unsafe { ffi::avcodec_receive_frame(self.context, picture.0) };
        Ok(match code {
            0 => Received::Picture(picture),
            ffi::AVERROR_EOF => Received::End,
            c if c == ffi::AVERROR(libc_eagain()) => Received::Hungry,
            _ => Received::Damaged,
        })
    }

    /// Whether the decoder wrote the last block of packet `number`'s picture.
    pub(super) fn is_written(&self, number: u64, picture: &Picture) -> bool {
        picture.buffer(0).is_none_or(|buffer| self.watch.is_written(number, buffer))
    }

    /// Forgets everything, after a seek.
    pub(super) fn flush(&mut self) {
        // SAFETY: the context is open.
        unsafe { ffi::avcodec_flush_buffers(self.context) };
    }
}

impl Drop for Decoder {
    fn drop(&mut self) {
        // SAFETY: allocated by avcodec_alloc_context3 and freed once.
        unsafe { ffi::avcodec_free_context(&mut self.context) };
    }
}

/// The value of `EAGAIN`.
fn libc_eagain() -> i32 {
    ffmpeg_next::error::EAGAIN
}

/// A decoded picture: a reference to buffers that the decoder may still read but no longer writes.
pub(super) struct Picture(*mut ffi::AVFrame);

// SAFETY: the frame is owned by this value alone, and its buffers' counts are atomic.
unsafe impl Send for Picture {}
// SAFETY: nothing is changed through a shared reference, and the decoder does not write into a picture it gave.
unsafe impl Sync for Picture {}

impl Picture {
    fn new() -> Result<Self> {
        // SAFETY: allocation only; null is checked.
        let frame = unsafe { ffi::av_frame_alloc() };
        if frame.is_null() {
            return Err(Error::Source(Fault::new("decoder", "out of memory").of_kind(FaultKind::System)));
        }
        Ok(Self(frame))
    }

    /// The frame's fields.
    pub(super) fn get(&self) -> &ffi::AVFrame {
        // SAFETY: never null after `new`.
        unsafe { &*self.0 }
    }

    /// Whether the picture is marked as one whose pixels are not those that were filmed.
    pub(super) fn is_damaged(&self) -> bool {
        self.get().decode_error_flags != 0 || self.get().flags & ffi::AV_FRAME_FLAG_CORRUPT != 0
    }

    /// All bytes of the buffer that holds a plane.
    fn buffer(&self, plane: usize) -> Option<&[u8]> {
        let (_, start, end) = self.range(plane)?;
        // SAFETY: the buffer lives as long as `self`, and the decoder does not write into a picture it gave.
        Some(unsafe { std::slice::from_raw_parts(start as *const u8, end - start) })
    }

    /// The memory of plane `plane`: its first row's address, and its buffer's first and past-last ones.
    fn range(&self, plane: usize) -> Option<(usize, usize, usize)> {
        // SAFETY: the frame is valid; the call only looks which of its buffers holds the plane.
        let buffer = unsafe { ffi::av_frame_get_plane_buffer(self.0, i32::try_from(plane).ok()?).as_ref() }?;
        let start = buffer.data as usize;
        Some((*self.get().data.get(plane)? as usize, start, start.checked_add(buffer.size)?))
    }

    /// The bytes of a plane from its first row's first byte to its last row's `row_bytes`-th, if rows go
    /// downwards and all of it lies inside the frame's buffer.
    pub(super) fn plane(&self, plane: usize, row_bytes: usize) -> Option<&[u8]> {
        let frame = self.get();
        let stride = usize::try_from(*frame.linesize.get(plane)?).ok()?;
        let height = usize::try_from(frame.height).ok()?;
        let length = stride.checked_mul(height.checked_sub(1)?)?.checked_add(row_bytes)?;
        let (first, start, end) = self.range(plane)?;
        if first < start || first.checked_add(length)? > end || row_bytes > stride && height > 1 {
            return None;
        }
        // SAFETY: the range was just checked to lie inside one buffer, which lives as long as `self`.
        Some(unsafe { std::slice::from_raw_parts(first as *const u8, length) })
    }

    /// The first `row_bytes` bytes of row `y` of a plane, whichever way its rows go.
    pub(super) fn row(&self, plane: usize, y: usize, row_bytes: usize) -> Option<&[u8]> {
        let (first, start, end) = self.range(plane)?;
        let stride = *self.get().linesize.get(plane)? as isize;
        let row = first.checked_add_signed(stride.checked_mul(isize::try_from(y).ok()?)?)?;
        if row < start || row.checked_add(row_bytes)? > end {
            return None;
        }
        // SAFETY: the range was just checked to lie inside one buffer, which lives as long as `self`.
        Some(unsafe { std::slice::from_raw_parts(row as *const u8, row_bytes) })
    }
}

impl Drop for Picture {
    fn drop(&mut self) {
        // SAFETY: allocated by av_frame_alloc and freed once.
        unsafe { ffi::av_frame_free(&mut self.0) };
    }
}
