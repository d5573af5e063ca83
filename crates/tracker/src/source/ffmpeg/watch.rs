//! Damage to a packet's picture, as heard from the decoder's threads while they decode it.
//!
//! Owns: [`Watch`]. FFmpeg hides errors in a picture's data and marks the picture; but up to version 7.0 a thread copies that
//! mark when it hands the picture on, while another thread may still be decoding it, so that the same damaged film is marked
//! in one run and not in the next. Two things are certain by the time that the picture is out: the message that the decoder
//! logs when it fills in what it could not decode, and its request for the picture's memory, which a packet with a
//! damaged header never makes. HEVC's decoder fills in nothing and says nothing: a mark is put into the memory of the last block, which a
//! whole picture overwrites. The context of each thread carries a pointer to its packet's [`Slot`].

use std::ffi::{CStr, c_char, c_int, c_void};
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use ffmpeg_next::ffi;

/// Packets that are remembered: far more than a decoder has under way.
const REMEMBERED: usize = 4096;

/// How messages begin that say of the picture under way that a part of it could not be decoded (libavcodec's
/// `error_resilience.c`, `h264_slice.c` for fields, `hevcdec.c`, and `dvdec.c`). They are FFmpeg's own, the same in versions 4 to 7.
const DAMAGE: [&[u8]; 4] =
    [b"concealing ", b"error while decoding MB ", b"Error parsing NAL unit ", b"Concealing bitstream errors"];

/// A packet that is being decoded.
#[derive(Debug, Default)]
struct Slot {
    number: AtomicU64,
    has_begun: AtomicBool,
    is_damaged: AtomicBool,
    /// Byte of the luma plane's buffer where the two rows of the mark begin, and bytes from one to the other; 0 and 0 without a mark.
    mark: [AtomicUsize; 2],
}

impl Slot {
    /// Two bytes for each row of the mark, others for each packet.
    fn marks(&self) -> [[u8; 2]; 2] {
        let [a, b, c, d, ..] =
            self.number.load(Ordering::Acquire).wrapping_mul(0x9e37_79b9_7f4a_7c15).to_be_bytes();
        [[a, b], [c, d]]
    }
}

/// The fate of a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Fate {
    /// Nothing was heard of damage.
    Whole,
    /// The decoder filled in what it could not decode, or gave up inside the picture.
    Damaged,
    /// The decoder found no picture in it.
    NoPicture,
}

/// The packets that a decoder has under way.
#[derive(Debug)]
pub(super) struct Watch {
    slots: Box<[Slot]>,
    /// The codec asks for each picture's memory while it decodes the picture's packet.
    tells_begin: bool,
}

/// Addresses of the slots of all open decoders: other users of FFmpeg in this process have pointers of their own in
/// their contexts.
static OPEN: Mutex<Vec<Range<usize>>> = Mutex::new(Vec::new());

impl Watch {
    /// Slots for the packets of `codec`'s decoder, and FFmpeg's messages heard from now on.
    pub(super) fn new(codec: ffi::AVCodecID) -> Self {
        let watch = Self {
            slots: (0..REMEMBERED).map(|_| Slot::default()).collect(),
            tells_begin: [ffi::AVCodecID::AV_CODEC_ID_H264, ffi::AVCodecID::AV_CODEC_ID_HEVC]
                .contains(&codec),
        };
        OPEN.lock().unwrap_or_else(PoisonError::into_inner).push(watch.range());
        // SAFETY: `heard` takes what FFmpeg calls it with; only the type of its last argument, which differs from machine
        // to machine and is not used, is another: a list of arguments is handed over as one pointer on all of them.
        #[expect(clippy::missing_transmute_annotations, reason = "the type differs from machine to machine")]
        unsafe {
            ffi::av_log_set_callback(Some(std::mem::transmute::<*const (), _>(heard as *const ())));
        }
        watch
    }

    /// Prepares a decoder's context, which must be closed before this value is dropped.
    pub(super) fn prepare(&self, context: &mut ffi::AVCodecContext) {
        if self.tells_begin {
            context.get_buffer2 = Some(begun);
        }
        context.opaque = self.pointer(0);
    }

    /// The decoder's next packet has this number, from 1; the fields of one picture have the same.
    pub(super) fn next(&self, number: u64, context: &mut ffi::AVCodecContext) {
        let slot = self.slot(number);
        if slot.number.swap(number, Ordering::AcqRel) != number {
            slot.has_begun.store(false, Ordering::Release);
            slot.is_damaged.store(false, Ordering::Release);
            slot.mark.iter().for_each(|m| m.store(0, Ordering::Release));
        }
        context.opaque = self.pointer(number);
    }

    /// The fate of a packet; to be asked when the picture of it or of a later packet is out. Of one that was not given to the
    /// decoder, or long ago, nothing is known, and it counts as whole.
    pub(super) fn fate(&self, number: u64) -> Fate {
        let slot = self.slot(number);
        if slot.number.load(Ordering::Acquire) != number {
            Fate::Whole
        } else if slot.is_damaged.load(Ordering::Acquire) {
            Fate::Damaged
        } else if self.tells_begin && !slot.has_begun.load(Ordering::Acquire) {
            Fate::NoPicture
        } else {
            Fate::Whole
        }
    }

    /// Whether the decoder wrote the last block of packet `number`'s picture, whose luma plane is in `buffer`.
    pub(super) fn is_written(&self, number: u64, buffer: &[u8]) -> bool {
        let slot = self.slot(number);
        let [at, stride] = [0, 1].map(|i| slot.mark[i].load(Ordering::Acquire));
        if slot.number.load(Ordering::Acquire) != number || stride == 0 {
            return true;
        }
        let marks = slot.marks();
        !(0..2).all(|row| buffer.get(at + row * stride..).is_some_and(|b| b.starts_with(&marks[row])))
    }

    fn slot(&self, number: u64) -> &Slot {
        &self.slots[number as usize % REMEMBERED]
    }

    fn pointer(&self, number: u64) -> *mut c_void {
        std::ptr::from_ref(self.slot(number)).cast_mut().cast()
    }

    fn range(&self) -> Range<usize> {
        let range = self.slots.as_ptr_range();
        range.start as usize..range.end as usize
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        let range = self.range();
        OPEN.lock().unwrap_or_else(PoisonError::into_inner).retain(|r| *r != range);
    }
}

/// FFmpeg's request for memory of a picture, made by the thread that decodes its packet.
unsafe extern "C" fn begun(
    context: *mut ffi::AVCodecContext,
    frame: *mut ffi::AVFrame,
    flags: c_int,
) -> c_int {
    // SAFETY: only contexts that `Watch::prepare` was given and copies of them have this function, and their pointer is to
    // a slot that outlives them; FFmpeg calls with what its own function takes.
    let (slot, code) = unsafe {
        let slot = &*(*context).opaque.cast::<Slot>().cast_const();
        slot.has_begun.store(true, Ordering::Release);
        (slot, ffi::avcodec_default_get_buffer2(context, frame, flags))
    };
    // SAFETY: both are alive during the call.
    let (context, frame) = unsafe { (&*context, &*frame) };
    if code >= 0 && context.codec_id == ffi::AVCodecID::AV_CODEC_ID_HEVC {
        mark(slot, frame);
    }
    code
}

/// Puts a mark into the last block of a picture that is yet to be decoded: samples that the filters of the blocks beside it do
/// not change (H.265, 8.7.2: three samples from an edge), in the smallest block that there is, of 8 x 8.
fn mark(slot: &Slot, frame: &ffi::AVFrame) {
    // SAFETY: a look-up in a static table by a number that it checks, and the plane's buffer of a valid frame.
    let (described, buffer) = unsafe {
        let format = std::mem::transmute::<c_int, ffi::AVPixelFormat>(frame.format);
        (ffi::av_pix_fmt_desc_get(format).as_ref(), frame.buf[0].as_ref())
    };
    let (Some(described), Some(buffer)) = (described, buffer) else { return };
    let numbers = [frame.linesize[0], frame.width, frame.height, described.comp[0].step].map(usize::try_from);
    let [Ok(stride), Ok(width), Ok(height), Ok(step)] = numbers else { return };
    let Some((left, top)) = width.checked_sub(5).zip(height.checked_sub(5)) else { return };
    let at = (frame.data[0] as usize).wrapping_sub(buffer.data as usize) + top * stride + left * step;
    if at.saturating_add(stride + 2) > buffer.size {
        return;
    }
    for (row, bytes) in slot.marks().into_iter().enumerate() {
        // SAFETY: inside the buffer, as was just checked; no one else has it before this call returns.
        unsafe { buffer.data.add(at + row * stride).cast::<[u8; 2]>().write_unaligned(bytes) };
    }
    slot.mark[0].store(at, Ordering::Release);
    slot.mark[1].store(stride, Ordering::Release);
}

/// FFmpeg's messages. Nothing is printed: errors come back as codes.
unsafe extern "C" fn heard(source: *mut c_void, level: c_int, format: *const c_char, _: *mut c_void) {
    if level > ffi::AV_LOG_INFO || source.is_null() || format.is_null() {
        return;
    }
    // SAFETY: a message's format is a C string.
    let format = unsafe { CStr::from_ptr(format) }.to_bytes();
    if !DAMAGE.iter().any(|start| format.starts_with(start)) {
        return;
    }
    // SAFETY: the source of a message begins with a pointer to its class; a decoder's context is known by it.
    let is_decoder = unsafe { *source.cast::<*const ffi::AVClass>() == ffi::avcodec_get_class() };
    if !is_decoder {
        return;
    }
    // SAFETY: it is a context, by its class, and alive while it logs; another program's pointer is only compared.
    let opaque = unsafe { (*source.cast::<ffi::AVCodecContext>()).opaque };
    let open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
    if open.iter().any(|range| range.contains(&(opaque as usize))) {
        // SAFETY: the pointer is into the slots of an open decoder, which set it to the beginning of one; they cannot
        // be dropped while the lock is held.
        unsafe { (*opaque.cast::<Slot>().cast_const()).is_damaged.store(true, Ordering::Release) };
    }
}
