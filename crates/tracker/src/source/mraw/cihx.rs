//! Photron's newer header: XML inside a binary envelope.
//!
//! Must not: open files, or rely on the envelope's offsets; what counts is what lies between `<cih>` and
//! `</cih>`. Elements are read by their path, because names such as `resolution` occur several times.

use std::collections::HashMap;

use super::header::{Header, Side, fraction, missing, number, short};
use crate::error::{Error, Fault, Result};

const OPEN: &[u8] = b"<cih>";
const CLOSE: &[u8] = b"</cih>";
/// Deepest nesting that is followed; real files have eight levels.
const MAX_DEPTH: usize = 64;

/// Whether bytes are this form of header and not the text one.
pub fn is_cihx(bytes: &[u8]) -> bool {
    bytes.get(256..260) == Some(b"CIHX") || find(bytes, OPEN).is_some()
}

/// Reads the bytes of a `.cihx` file; `name` is for messages.
///
/// # Errors
/// [`Error::Source`] if there is no XML in it or width, height or bits are missing.
pub fn parse(bytes: &[u8], name: &str) -> Result<Header> {
    let begin = find(bytes, OPEN).ok_or_else(|| {
        Error::Source(Fault::new(name, "it holds no <cih> element").advice("Copy the header file again"))
    })?;
    let body = &bytes[begin..];
    let mut warnings = Vec::new();
    let end = find(body, CLOSE).map(|e| e + CLOSE.len()).unwrap_or_else(|| {
        warnings.push("the header has no end; what it holds up to there is used".to_owned());
        body.len()
    });
    let values = elements(&String::from_utf8_lossy(&body[..end]));
    let get = |path: &str| values.get(path).map(String::as_str).filter(|v| !v.is_empty());
    let mut whole = |path: &str| get(path).and_then(|v| number::<i64>(path, v, &mut warnings));
    let width = whole("imageDataInfo/resolution/width");
    let height = whole("imageDataInfo/resolution/height");
    let bits = whole("imageDataInfo/colorInfo/bit");
    let depth = whole("imageDataInfo/effectiveBit/depth");
    let total = whole("frameInfo/totalFrame");
    let step = whole("frameInfo/skipFrame");
    let start_frame = whole("frameInfo/startFrame");
    let exposure_ns = whole("recordInfo/shutterSpeedNsec");
    let record_rate_hz =
        get("recordInfo/recordRate").and_then(|v| fraction("recordInfo/recordRate", v, &mut warnings));
    // The shutter speed is a denominator.
    let shutter =
        get("recordInfo/shutterSpeed").and_then(|v| fraction("recordInfo/shutterSpeed", v, &mut warnings));
    let side = match get("imageDataInfo/effectiveBit/side").map(str::to_lowercase).as_deref() {
        Some("higher") => Side::Higher,
        _ => Side::Lower,
    };
    let positive = |value: Option<i64>, key: &str| {
        value.and_then(|v| u32::try_from(v).ok()).filter(|v| *v > 0).ok_or_else(|| missing(name, key))
    };
    let save_step = match step {
        Some(s) if s < 1 => {
            warnings.push(format!("frameInfo/skipFrame: {s} makes no sense; taken as 1"));
            1
        }
        Some(s) => s.unsigned_abs(),
        None => 1,
    };
    let recorded =
        [get("fileInfo/date"), get("fileInfo/time")].into_iter().flatten().collect::<Vec<_>>().join(" ");
    Ok(Header {
        width: positive(width, "imageDataInfo/resolution/width")?,
        height: positive(height, "imageDataInfo/resolution/height")?,
        color_bit: positive(bits, "imageDataInfo/colorInfo/bit")?,
        effective_depth: depth.and_then(|d| u32::try_from(d).ok()),
        side,
        color_type: get("imageDataInfo/colorInfo/type").and_then(short),
        file_format: get("imageFileInfo/fileFormat").and_then(short),
        total_frames: total.and_then(|n| u64::try_from(n).ok()),
        record_rate_hz,
        save_step,
        start_frame,
        // Frames are numbered from the trigger.
        trigger_frame: start_frame.map(|_| 0),
        exposure_s: exposure_ns.filter(|n| *n > 0).map(|n| n as f64 * 1e-9).or(shutter.map(|s| 1.0 / s)),
        camera: get("deviceInfo/deviceName").and_then(short),
        recorded: short(&recorded),
        comment: get("basicInfo/comment").and_then(short),
        warnings,
    })
}

fn find(bytes: &[u8], word: &[u8]) -> Option<usize> {
    bytes.windows(word.len()).position(|w| w == word)
}

/// Text of the elements without children, by their path below the outermost one; the first of a path counts.
fn elements(xml: &str) -> HashMap<String, String> {
    let mut values = HashMap::new();
    let mut path: Vec<&str> = Vec::new();
    let mut rest = xml;
    while let Some(start) = rest.find('<') {
        let text = &rest[..start];
        let Some(length) = rest[start..].find('>') else { break };
        let tag = &rest[start + 1..start + length];
        rest = &rest[start + length + 1..];
        if let Some(name) = tag.strip_prefix('/') {
            // Text right before an end is the element's, if it has no children.
            if path.len() > 1 && !text.trim().is_empty() {
                values.entry(path[1..].join("/")).or_insert_with(|| unescape(text.trim()));
            }
            // An end without its beginning is passed over.
            if let Some(level) = path.iter().rposition(|n| *n == name.trim()) {
                path.truncate(level);
            }
        } else if !tag.starts_with(['?', '!']) && !tag.ends_with('/') && path.len() < MAX_DEPTH {
            path.push(tag.split_whitespace().next().unwrap_or(""));
        }
    }
    values
}

fn unescape(text: &str) -> String {
    text.replace("&lt;", "<")
        .replace("&gt;", ">")
        .replace("&quot;", "\"")
        .replace("&apos;", "'")
        .replace("&amp;", "&")
}
