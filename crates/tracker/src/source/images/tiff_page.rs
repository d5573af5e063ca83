//! Reads the brightness of one page of a TIFF file. The library reads samples of 8 and 16 bits, whatever their compression;
//! uncompressed samples of other sizes and palettes are read here.
//!
//! Owns: [`read`]. Errors are clauses without a full stop.

use std::io::{Read, Seek, SeekFrom};

use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult};
use tiff::tags::Tag;

use super::picture::Picture;
use super::tiff_layout::{Layout, PALETTE};
use crate::source::orientation::Orientation;
use crate::source::raw::brightness;

/// Reads the page at which a TIFF decoder stands.
pub(super) fn read<R: Read + Seek>(decoder: &mut Decoder<R>) -> Result<Picture, String> {
    let layout = Layout::of(decoder)?;
    layout.judge()?;
    if layout.is_own() { own(decoder, &layout) } else { by_library(decoder, &layout) }
}

/// Uncompressed strips of one sample a pixel: rows begin on whole bytes, the most significant bit comes first.
fn own<R: Read + Seek>(decoder: &mut Decoder<R>, layout: &Layout) -> Result<Picture, String> {
    let bits = layout.bits;
    let palette = (layout.photometric == PALETTE).then(|| palette(decoder, bits)).transpose()?;
    let (width, row_bytes) = (layout.width as usize, (u64::from(layout.width) * u64::from(bits)).div_ceil(8));
    // Some cameras' programs put samples of 10, 12 or 14 bits into words of 16 and still say what they hold.
    let total: u64 = layout.lengths.iter().fold(0, |sum, n| sum.saturating_add(*n));
    let in_words = bits > 8 && u128::from(total) >= 2 * u128::from(layout.width) * u128::from(layout.height);
    let row_bytes = if in_words { 2 * u64::from(layout.width) } else { row_bytes };
    let top = (1u32 << bits) - 1;
    let mut samples = Vec::new();
    let mut bytes = Vec::new();
    let mut left = layout.height;
    for at in &layout.places {
        let rows = left.min(layout.rows);
        left -= rows;
        bytes.clear();
        let reader = decoder.inner();
        reader.seek(SeekFrom::Start(*at)).map_err(|e| e.to_string())?;
        let length = row_bytes * u64::from(rows);
        reader.take(length).read_to_end(&mut bytes).map_err(|e| e.to_string())?;
        if bytes.len() as u64 != length {
            return Err("it is cut".into());
        }
        for row in bytes.chunks_exact(row_bytes as usize) {
            let value = |x: usize| {
                if in_words {
                    let pair = [row[2 * x], row[2 * x + 1]];
                    let word =
                        if layout.big_endian { u16::from_be_bytes(pair) } else { u16::from_le_bytes(pair) };
                    return u32::from(word).min(top);
                }
                let first = x * bits as usize;
                // Three bytes hold any sample of up to 16 bits.
                let three = (0..3)
                    .fold(0u32, |v, k| v << 8 | u32::from(row.get(first / 8 + k).copied().unwrap_or(0)));
                three >> (24 - first % 8 - bits as usize) & top
            };
            for x in 0..width {
                let value = value(x);
                let value = if layout.is_inverted() { top - value } else { value };
                match &palette {
                    Some(table) => samples.push(table[value as usize]),
                    None if bits <= 8 => samples.push((value * 255 / top) as u8),
                    None => samples.extend((value as u16).to_le_bytes()),
                }
            }
        }
    }
    if left > 0 {
        return Err("it is cut".into());
    }
    let what = match palette {
        Some(_) => Some("palette".to_owned()),
        None => (bits < 8).then(|| format!("{bits} bit, spread over 8")),
    };
    Ok(Picture {
        width: layout.width,
        height: layout.height,
        depth_bits: bits.max(8),
        samples,
        converted_from: what,
        orientation: Orientation::default(),
        pixel_size: None,
    })
}

/// The brightness of each of a palette's colours.
fn palette<R: Read + Seek>(decoder: &mut Decoder<R>, bits: u32) -> Result<Vec<u8>, String> {
    let count = 1usize << bits;
    let map =
        decoder.find_tag_unsigned_vec::<u16>(Tag::ColorMap).map_err(|e| e.to_string())?.unwrap_or_default();
    if map.len() != 3 * count {
        return Err(format!("its palette has {} numbers, not {}", map.len(), 3 * count));
    }
    // All reds, then all greens, then all blues, of 16 bits each.
    Ok((0..count).map(|i| (brightness([map[i], map[count + i], map[2 * count + i]]) >> 8) as u8).collect())
}

fn by_library<R: Read + Seek>(decoder: &mut Decoder<R>, layout: &Layout) -> Result<Picture, String> {
    let color = decoder.colortype().map_err(|e| e.to_string())?;
    let channels = layout.samples as usize;
    let count = (layout.width as usize)
        .checked_mul(layout.height as usize)
        .filter(|n| n.checked_mul(channels).is_some())
        .ok_or_else(|| format!("{} x {} px is too large", layout.width, layout.height))?;
    // RGB is weighted; of gray with an opacity, and of brightness with two colours, the first counts.
    let weighted = matches!(color, ColorType::RGB(_) | ColorType::RGBA(_));
    let converted_from = (channels > 1).then(|| match color {
        ColorType::Multiband { .. } => "gray with opacity".to_owned(),
        other => format!("{other:?}"),
    });
    let mut decoded = DecodingResult::U8(Vec::new());
    decoder.read_image_to_buffer(&mut decoded).map_err(|e| e.to_string())?;
    let (step, apart) = if layout.planar { (1, count) } else { (channels, 1) };
    let (depth_bits, samples) = match decoded {
        DecodingResult::U8(v) if layout.bits < 8 => (8, spread(&v, layout)?),
        DecodingResult::U8(v) if v.len() >= count * channels => (
            8,
            match (weighted, channels) {
                (false, 1) => v,
                (false, _) => (0..count).map(|i| v[i * step]).collect(),
                (true, _) => (0..count).map(|i| weigh(&v, i * step, apart) as u8).collect(),
            },
        ),
        DecodingResult::U16(v) if v.len() >= count * channels => {
            let value = |i: usize| if weighted { weigh(&v, i * step, apart) as u16 } else { v[i * step] };
            (16, (0..count).flat_map(|i| value(i).to_le_bytes()).collect())
        }
        _ => return Err("it is cut".to_owned()),
    };
    let converted_from =
        converted_from.or_else(|| (layout.bits < 8).then(|| format!("{} bit, spread over 8", layout.bits)));
    Ok(Picture {
        width: layout.width,
        height: layout.height,
        depth_bits,
        samples,
        converted_from,
        orientation: Orientation::default(),
        pixel_size: None,
    })
}

fn weigh<T: Copy + Into<u32>>(v: &[T], at: usize, apart: usize) -> u32 {
    brightness([v[at], v[at + apart], v[at + 2 * apart]])
}

/// Samples of less than 8 bits, rows from whole bytes on, spread over 8 bits.
fn spread(packed: &[u8], layout: &Layout) -> Result<Vec<u8>, String> {
    let (width, bits) = (layout.width as usize, layout.bits as usize);
    let row_bytes = (width * bits).div_ceil(8);
    if packed.len() < row_bytes * layout.height as usize {
        return Err("it is cut".into());
    }
    let top = (1u32 << bits) - 1;
    let rows = packed.chunks_exact(row_bytes).take(layout.height as usize);
    Ok(rows
        .flat_map(|row| {
            (0..width).map(move |x| {
                let value = u32::from(row[x * bits / 8]) >> (8 - x * bits % 8 - bits) & top;
                (value * 255 / top) as u8
            })
        })
        .collect())
}
