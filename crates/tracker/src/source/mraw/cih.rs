//! Photron's text header: `Key : Value` lines.
//!
//! Must not: open files. Layout verified on real files with line ends of both kinds; the separator is mostly
//! space, colon, space, sometimes a colon alone.

use std::collections::HashMap;

use super::header::{Header, Side, fraction, missing, number, short};
use crate::error::Result;

/// Reads the text of a `.cih` file; `name` is for messages.
///
/// # Errors
/// [`Error::Source`](crate::error::Error::Source) if width, height or bits are missing.
pub fn parse(bytes: &[u8], name: &str) -> Result<Header> {
    let text = decode(bytes);
    let mut values: HashMap<String, &str> = HashMap::new();
    for line in text.lines() {
        // Keys hold no separator; values may, so the first one counts.
        let Some((key, value)) = line.split_once([':', '=']).or_else(|| line.split_once('\t')) else {
            continue;
        };
        values.entry(normal(key)).or_insert(value.trim());
    }
    let get = |key: &str| values.get(&normal(key)).copied().filter(|v| !v.is_empty());
    let mut warnings = Vec::new();
    let mut whole = |key: &str| get(key).and_then(|v| number::<i64>(key, v, &mut warnings));
    let width = whole("Image Width");
    let height = whole("Image Height");
    let bits = whole("Color Bit");
    let depth = whole("EffectiveBit Depth");
    let total = whole("Total Frame");
    let step = whole("Save Step");
    let start_frame = whole("Start Frame");
    let trigger_frame = whole("Correct Trigger Frame");
    let exposure_ns = whole("Shutter Type2(nsec)");
    let rate = get("Record Rate(fps)").or_else(|| get("Record Rate"));
    let record_rate_hz = rate.and_then(|v| fraction("Record Rate(fps)", v, &mut warnings));
    let shutter = get("Shutter Speed(s)").or_else(|| get("Shutter Speed"));
    let exposure_s = shutter.and_then(|v| fraction("Shutter Speed(s)", v, &mut warnings));
    let side = match get("EffectiveBit Side").map(str::to_lowercase).as_deref() {
        Some("higher") => Side::Higher,
        _ => Side::Lower,
    };
    let positive = |value: Option<i64>, key: &str| {
        value.and_then(|v| u32::try_from(v).ok()).filter(|v| *v > 0).ok_or_else(|| missing(name, key))
    };
    let save_step = match step {
        Some(s) if s < 1 => {
            warnings.push(format!("Save Step: {s} makes no sense; taken as 1"));
            1
        }
        Some(s) => s.unsigned_abs(),
        None => 1,
    };
    let recorded = [get("Date"), get("Time")].into_iter().flatten().collect::<Vec<_>>().join(" ");
    Ok(Header {
        width: positive(width, "Image Width")?,
        height: positive(height, "Image Height")?,
        color_bit: positive(bits, "Color Bit")?,
        effective_depth: depth.and_then(|d| u32::try_from(d).ok()),
        side,
        color_type: get("Color Type").and_then(short),
        file_format: get("File Format").and_then(short),
        total_frames: total.and_then(|n| u64::try_from(n).ok()),
        record_rate_hz,
        save_step,
        start_frame,
        trigger_frame,
        exposure_s: exposure_s.or_else(|| exposure_ns.filter(|n| *n > 0).map(|n| n as f64 * 1e-9)),
        camera: get("Camera Type").and_then(short),
        recorded: short(&recorded),
        comment: get("Comment Text").and_then(short),
        warnings,
    })
}

/// Bytes as text: UTF-16 if they say so, else UTF-8 with what is none replaced.
fn decode(bytes: &[u8]) -> String {
    if let [0xff, 0xfe, rest @ ..] = bytes {
        let units: Vec<u16> = rest.chunks_exact(2).map(|c| u16::from_le_bytes([c[0], c[1]])).collect();
        return String::from_utf16_lossy(&units);
    }
    String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)).into_owned()
}

/// A key without spaces and in lower case.
fn normal(key: &str) -> String {
    key.chars().filter(|c| !c.is_whitespace()).flat_map(char::to_lowercase).collect()
}
