//! Parses Photron's text header: `Key : Value` lines.
//!
//! Must not: open files. Layout verified on real files with line ends of both kinds; the separator is mostly
//! space, colon, space, sometimes a colon alone.

use std::collections::HashMap;

use super::fields::{Header, Names};
use crate::error::Result;

const NAMES: Names = Names {
    width: "Image Width",
    height: "Image Height",
    color_bit: "Color Bit",
    depth: "EffectiveBit Depth",
    side: "EffectiveBit Side",
    color_type: "Color Type",
    file_format: "File Format",
    total_frames: "Total Frame",
    record_rate: "Record Rate(fps)",
    save_step: "Save Step",
    start_frame: "Start Frame",
    trigger_frame: Some("Correct Trigger Frame"),
    exposure_ns: "Shutter Type2(nsec)",
    shutter: "Shutter Speed(s)",
    shutter_s: |s| s,
    camera: "Camera Type",
    recorded: ["Date", "Time"],
    comment: "Comment Text",
};

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
        values.entry(normal(key)).or_insert(value);
    }
    Header::of(&NAMES, |key| values.get(&normal(key)).copied(), Vec::new(), name)
}

/// Bytes as text: UTF-16 if they say so, else UTF-8 with what is none replaced.
fn decode(bytes: &[u8]) -> String {
    if let [0xff, 0xfe, rest @ ..] = bytes {
        let units: Vec<u16> = rest.chunks_exact(2).map(|c| u16::from_le_bytes([c[0], c[1]])).collect();
        return String::from_utf16_lossy(&units);
    }
    String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)).into_owned()
}

/// A key without its unit, without spaces and in lower case.
fn normal(key: &str) -> String {
    let key = key.split('(').next().unwrap_or(key);
    key.chars().filter(|c| !c.is_whitespace()).flat_map(char::to_lowercase).collect()
}
