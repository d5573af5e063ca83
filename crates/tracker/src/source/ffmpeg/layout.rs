//! Turns a decoder's picture into one plane of brightness: lent where it can be, converted once where not.
//!
//! Owns: [`Layout`]. Must not: change a value where the recording has a luma plane.

use std::ffi::CStr;
use std::ptr;

use ffmpeg_next::ffi;

use super::decode::Picture;
use crate::error::{Error, Fault, FaultKind, Result};
use crate::frame::{Bytes, PixelFormat};
use crate::source::orientation::Orientation;

/// Weights of red, green and blue in brightness (ITU-R BT.601), over 2^14; their sum is 2^14, so gray stays
/// what it is. OpenCV's `cvtColor` has the same.
const RED: u32 = 4899;
const GREEN: u32 = 9617;
const BLUE: u32 = 1868;

/// Layout of brightness in pictures of one pixel format.
pub(super) struct Layout {
    /// How samples are handed out.
    pub format: PixelFormat,
    /// Significant bits of a sample.
    pub depth_bits: u32,
    /// The pixel format's name in FFmpeg.
    pub name: String,
    raw: i32,
    kind: Kind,
    has_colour: bool,
}

enum Kind {
    /// A plane that is what we want.
    Lend,
    /// Every n-th byte or byte pair of a plane.
    Gather(Component),
    /// Red, green and blue, weighted.
    Weigh([Component; 3]),
    /// All others, by libswscale.
    Scale,
}

#[derive(Clone, Copy)]
struct Component {
    plane: usize,
    step: usize,
    offset: usize,
    shift: u32,
    depth: u32,
    big_endian: bool,
}

impl Component {
    fn read(self, row: &[u8], x: usize) -> u32 {
        let at = x * self.step + self.offset;
        let mask = (1u32 << self.depth) - 1;
        let value = if self.shift + self.depth <= 8 {
            u32::from(row[at])
        } else {
            let pair = [row[at], row[at + 1]];
            u32::from(if self.big_endian { u16::from_be_bytes(pair) } else { u16::from_le_bytes(pair) })
        };
        (value >> self.shift) & mask
    }

    fn row_bytes(self, width: usize) -> usize {
        (width - 1) * self.step + self.offset + if self.shift + self.depth <= 8 { 1 } else { 2 }
    }
}

/// A value of the enumeration, if it is one.
fn pixel_format(raw: i32) -> Option<ffi::AVPixelFormat> {
    let end = ffi::AVPixelFormat::AV_PIX_FMT_NB as i32;
    // SAFETY: the enumeration was made from the headers of the library we are linked to and has every value
    // from 0 to its end.
    (0..end).contains(&raw).then(|| unsafe { std::mem::transmute::<i32, ffi::AVPixelFormat>(raw) })
}

impl Layout {
    /// The layout of pixel format `raw`; `name` is the recording's, for messages.
    pub(super) fn new(raw: i32, name: &str) -> Result<Self> {
        let unknown = || {
            Error::Source(
                Fault::new(name, format!("pixel format {raw} is not known"))
                    .of_kind(FaultKind::Unsupported)
                    .advice("Convert the recording with `ffmpeg -i IN -pix_fmt gray -c:v ffv1 OUT.mkv`"),
            )
        };
        let format = pixel_format(raw).ok_or_else(unknown)?;
        // SAFETY: a look-up in a static table.
        let descriptor = unsafe { ffi::av_pix_fmt_desc_get(format).as_ref() }.ok_or_else(unknown)?;
        // SAFETY: the name of a pixel format is a static string.
        let label = unsafe { CStr::from_ptr(descriptor.name) }.to_string_lossy().into_owned();
        let has = |flag: i32| descriptor.flags & flag as u64 != 0;
        if has(ffi::AV_PIX_FMT_FLAG_HWACCEL) {
            return Err(Error::Source(
                Fault::new(name, format!("pictures of {label} lie outside memory"))
                    .of_kind(FaultKind::Unsupported),
            ));
        }
        let component = |i: usize| {
            let c = &descriptor.comp[i];
            Component {
                plane: c.plane.unsigned_abs() as usize,
                step: c.step.unsigned_abs() as usize,
                offset: c.offset.unsigned_abs() as usize,
                shift: c.shift.unsigned_abs(),
                depth: c.depth.unsigned_abs(),
                big_endian: has(ffi::AV_PIX_FMT_FLAG_BE),
            }
        };
        let first = component(0);
        let special = has(ffi::AV_PIX_FMT_FLAG_PAL)
            || has(ffi::AV_PIX_FMT_FLAG_BITSTREAM)
            || has(ffi::AV_PIX_FMT_FLAG_FLOAT)
            || has(ffi::AV_PIX_FMT_FLAG_BAYER)
            || label.starts_with("xyz")
            || !(8..=16).contains(&first.depth);
        let deepest = descriptor.comp[..usize::from(descriptor.nb_components)]
            .iter()
            .map(|c| c.depth.unsigned_abs())
            .max()
            .unwrap_or(8);
        let (kind, depth_bits) = if special {
            (Kind::Scale, if has(ffi::AV_PIX_FMT_FLAG_BAYER) || deepest <= 8 { deepest.max(8) } else { 16 })
        } else if has(ffi::AV_PIX_FMT_FLAG_RGB) && descriptor.nb_components >= 3 {
            let all = [component(0), component(1), component(2)];
            if all.iter().all(|c| c.depth == first.depth) {
                (Kind::Weigh(all), first.depth)
            } else {
                (Kind::Scale, deepest.max(8))
            }
        } else if first.step == first.sample_bytes()
            && first.offset == 0
            && first.shift == 0
            && !(first.big_endian && first.step == 2)
        {
            (Kind::Lend, first.depth)
        } else {
            (Kind::Gather(first), first.depth)
        };
        let format = if depth_bits > 8 { PixelFormat::Gray16 } else { PixelFormat::Gray8 };
        let has_colour = descriptor.nb_components >= 3 || has(ffi::AV_PIX_FMT_FLAG_PAL);
        Ok(Self { format, depth_bits, name: label, raw, kind, has_colour })
    }

    /// Whether pictures have this layout.
    pub(super) fn is_of(&self, picture: &Picture) -> bool {
        picture.get().format == self.raw
    }

    /// Whether samples have to be copied out of the picture; then what they are copied from.
    pub(super) fn converted_from(&self) -> Option<String> {
        (!matches!(self.kind, Kind::Lend)).then(|| self.name.clone())
    }

    fn sample_bytes(&self) -> usize {
        if self.format == PixelFormat::Gray8 { 1 } else { 2 }
    }

    /// The plane of a picture and the bytes from one row to the next; `None` if the picture's buffers do not
    /// hold what its size promises.
    pub(super) fn plane(
        &self,
        picture: Picture,
        orientation: Orientation,
    ) -> Option<(Box<dyn Bytes>, usize)> {
        let width = usize::try_from(picture.get().width).ok().filter(|w| *w > 0)?;
        let height = usize::try_from(picture.get().height).ok().filter(|h| *h > 0)?;
        let bytes = self.sample_bytes();
        if matches!(self.kind, Kind::Lend) && orientation == Orientation::default() {
            let row_bytes = width * bytes;
            if picture.plane(0, row_bytes).is_some() {
                let stride = usize::try_from(picture.get().linesize[0]).ok()?;
                return Some((Box::new(Lent { picture, row_bytes }), stride));
            }
        }
        let mut samples = vec![0u8; width.checked_mul(height)?.checked_mul(bytes)?];
        let mut put = |y: usize, x: usize, value: u32| {
            let at = (y * width + x) * bytes;
            samples[at] = value as u8;
            if bytes == 2 {
                samples[at + 1] = (value >> 8) as u8;
            }
        };
        match self.kind {
            Kind::Lend => {
                for (y, to) in samples.chunks_exact_mut(width * bytes).enumerate() {
                    to.copy_from_slice(picture.row(0, y, width * bytes)?);
                }
            }
            Kind::Gather(c) => {
                for y in 0..height {
                    let row = picture.row(c.plane, y, c.row_bytes(width))?;
                    (0..width).for_each(|x| put(y, x, c.read(row, x)));
                }
            }
            Kind::Weigh([r, g, b]) => {
                for y in 0..height {
                    let red = picture.row(r.plane, y, r.row_bytes(width))?;
                    let green = picture.row(g.plane, y, g.row_bytes(width))?;
                    let blue = picture.row(b.plane, y, b.row_bytes(width))?;
                    for x in 0..width {
                        let sum = RED * r.read(red, x) + GREEN * g.read(green, x) + BLUE * b.read(blue, x);
                        put(y, x, (sum + (1 << 13)) >> 14);
                    }
                }
            }
            Kind::Scale => self.scale(&picture, width, &mut samples)?,
        }
        let (turned, row_pixels) = orientation.apply(samples, width, height, bytes);
        Some((Box::new(turned), row_pixels * bytes))
    }

    /// Blue and red colour differences of a picture, a byte a pixel about 128; `None` where it has none.
    pub(super) fn colour(&self, picture: &Picture, orientation: Orientation) -> Option<[Vec<u8>; 2]> {
        if !self.has_colour {
            return None;
        }
        let width = usize::try_from(picture.get().width).ok().filter(|w| *w > 0)?;
        let height = usize::try_from(picture.get().height).ok().filter(|h| *h > 0)?;
        let size = width.checked_mul(height)?;
        let mut planes = [vec![0u8; size], vec![0u8; size], vec![0u8; size]];
        let into = ffi::AVPixelFormat::AV_PIX_FMT_YUV444P;
        let [luma, blue, red] = &mut planes;
        self.converted(picture, into, [(luma, width), (blue, width), (red, width)])?;
        let [_, blue, red] = planes;
        Some([blue, red].map(|plane| orientation.apply(plane, width, height, 1).0))
    }

    fn scale(&self, picture: &Picture, width: usize, to: &mut [u8]) -> Option<()> {
        let into = match self.format {
            PixelFormat::Gray8 => ffi::AVPixelFormat::AV_PIX_FMT_GRAY8,
            _ => ffi::AVPixelFormat::AV_PIX_FMT_GRAY16LE,
        };
        self.converted(picture, into, [(&mut *to, width * self.sample_bytes())])?;
        // libswscale stretches shallower samples to 16 bits; what is handed out keeps the recording's depth.
        if self.format == PixelFormat::Gray16 && self.depth_bits < 16 {
            for pair in to.chunks_exact_mut(2) {
                let value = u16::from_le_bytes([pair[0], pair[1]]) >> (16 - self.depth_bits);
                pair.copy_from_slice(&value.to_le_bytes());
            }
        }
        Some(())
    }

    /// Converts a picture into planes of another pixel format, each with the bytes of its rows; `None` where libswscale
    /// cannot, or a plane is too small.
    fn converted<const N: usize>(
        &self,
        picture: &Picture,
        into: ffi::AVPixelFormat,
        to: [(&mut [u8], usize); N],
    ) -> Option<()> {
        let from = pixel_format(self.raw)?;
        let frame = picture.get();
        let (w, h) = (frame.width, frame.height);
        let rows = usize::try_from(h).ok()?;
        let (mut planes, mut strides) = ([ptr::null_mut(); 4], [0; 4]);
        for ((plane, stride), (bytes, row_bytes)) in planes.iter_mut().zip(&mut strides).zip(to) {
            if bytes.len() < row_bytes.checked_mul(rows)? {
                return None;
            }
            (*plane, *stride) = (bytes.as_mut_ptr(), i32::try_from(row_bytes).ok()?);
        }
        let flags = ffi::SWS_BILINEAR | ffi::SWS_ACCURATE_RND | ffi::SWS_BITEXACT | ffi::SWS_FULL_CHR_H_INP;
        // SAFETY: plain values; null filters and parameters are allowed; null is checked.
        let context = unsafe {
            ffi::sws_getContext(w, h, from, w, h, into, flags, ptr::null_mut(), ptr::null_mut(), ptr::null())
        };
        if context.is_null() {
            return None;
        }
        // SAFETY: the source planes are those of a decoded frame of this format and size; each destination plane was
        // just checked to hold `h` rows of its stride, which the callers make as wide as a row of `into`; the context is
        // freed once after its only use.
        let done = unsafe {
            let done = ffi::sws_scale(
                context,
                frame.data.as_ptr().cast::<*const u8>(),
                frame.linesize.as_ptr(),
                0,
                h,
                planes.as_ptr(),
                strides.as_ptr(),
            );
            ffi::sws_freeContext(context);
            done
        };
        (done == h).then_some(())
    }
}

impl Component {
    fn sample_bytes(self) -> usize {
        if self.shift + self.depth <= 8 { 1 } else { 2 }
    }
}

/// A plane lent by a decoder's picture.
struct Lent {
    picture: Picture,
    row_bytes: usize,
}

impl Bytes for Lent {
    fn bytes(&self) -> &[u8] {
        // Checked when it was made; a picture does not change.
        self.picture.plane(0, self.row_bytes).unwrap_or(&[])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gray_stays_what_it_is_when_weighted() {
        assert_eq!(RED + GREEN + BLUE, 1 << 14);
    }
}
