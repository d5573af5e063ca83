//! Parses Photron's newer header: XML inside a binary envelope.
//!
//! Must not: open files, or rely on the envelope's offsets; what counts is what lies between `<cih>` and
//! `</cih>`. Elements are read by their path, because names such as `resolution` occur several times.

use std::collections::HashMap;

use super::fields::{Header, Names};
use crate::error::{Error, Fault, FaultKind, Result};

const OPEN: &[u8] = b"<cih>";
const CLOSE: &[u8] = b"</cih>";
/// Deepest nesting that is followed; real files have eight levels.
const MAX_DEPTH: usize = 64;

const NAMES: Names = Names {
    width: "imageDataInfo/resolution/width",
    height: "imageDataInfo/resolution/height",
    color_bit: "imageDataInfo/colorInfo/bit",
    depth: "imageDataInfo/effectiveBit/depth",
    side: "imageDataInfo/effectiveBit/side",
    color_type: "imageDataInfo/colorInfo/type",
    file_format: "imageFileInfo/fileFormat",
    total_frames: "frameInfo/totalFrame",
    record_rate: "recordInfo/recordRate",
    save_step: "frameInfo/skipFrame",
    start_frame: "frameInfo/startFrame",
    trigger_frame: None,
    exposure_ns: "recordInfo/shutterSpeedNsec",
    shutter: "recordInfo/shutterSpeed",
    shutter_s: |denominator| 1.0 / denominator,
    camera: "deviceInfo/deviceName",
    recorded: ["fileInfo/date", "fileInfo/time"],
    comment: "basicInfo/comment",
};

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
        Error::Source(
            Fault::new(name, "it holds no <cih> element")
                .of_kind(FaultKind::Damaged)
                .advice("Copy the header file again"),
        )
    })?;
    let body = &bytes[begin..];
    let mut warnings = Vec::new();
    let end = find(body, CLOSE).map(|e| e + CLOSE.len()).unwrap_or_else(|| {
        warnings.push("the header has no end; what it holds up to there is used".into());
        body.len()
    });
    let values = elements(&String::from_utf8_lossy(&body[..end]));
    Header::of(&NAMES, |path| values.get(path).map(String::as_str), warnings, name)
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
