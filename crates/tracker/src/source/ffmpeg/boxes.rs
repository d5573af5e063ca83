//! Reads what the boxes of an MP4 or QuickTime file say and FFmpeg does not pass on.
//!
//! Owns: [`Boxes`]: whether the edit list stretches or joins pieces, and a camera's XML. Must not: follow an offset
//! out of the file, or believe a length.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

/// Most bytes of a header box that is read; a film of a day at 1000 frames a second has less.
const MOST_BYTES: u64 = 1 << 30;
/// Most boxes on the file's top level that are looked at: a fragmented file has two for each fragment.
const MOST_BOXES: usize = 4096;
/// First boxes by which such a file is known.
const FIRST: [&[u8; 4]; 6] = [b"ftyp", b"moov", b"wide", b"mdat", b"free", b"skip"];

/// Facts from the boxes of a file.
#[derive(Debug, Default, Clone, PartialEq)]
pub(super) struct Boxes {
    /// The edit list of the first video track plays a piece slower or faster, or joins several: the stamps that it
    /// makes are not the camera's.
    pub edits_change_time: bool,
    /// Seconds at which the edit list of that track ends, where it begins with a pause.
    pub ends_after_pause_s: Option<f64>,
    /// XML of a camera, as Sony's `NonRealTimeMeta`.
    pub xml: Option<String>,
}

impl Boxes {
    /// Reads the boxes of a regular file; what is not such a file says nothing.
    pub(super) fn of(path: &Path) -> Self {
        let is_file = path.metadata().is_ok_and(|m| m.is_file());
        if is_file {
            File::open(path).ok().and_then(|f| Self::read(f).ok()).unwrap_or_default()
        } else {
            Self::default()
        }
    }

    fn read(mut file: File) -> std::io::Result<Self> {
        let size = file.seek(SeekFrom::End(0))?;
        let mut found = Self::default();
        let mut at = 0u64;
        for number in 0..MOST_BOXES {
            let mut head = [0u8; 16];
            file.seek(SeekFrom::Start(at))?;
            let got = read_some(&mut file, &mut head)?;
            let Some((name, start, length)) = header(&head[..got], size - at) else { break };
            if number == 0 && !FIRST.contains(&&name) {
                break;
            }
            let body = length - start;
            if (&name == b"moov" || &name == b"meta") && body <= MOST_BYTES {
                file.seek(SeekFrom::Start(at + start))?;
                let mut bytes = Vec::new();
                Read::by_ref(&mut file).take(body).read_to_end(&mut bytes)?;
                if &name == b"moov" {
                    (found.edits_change_time, found.ends_after_pause_s) = edit_list(&bytes);
                    for meta in children(&bytes).filter(|c| &c.0 == b"meta") {
                        found.xml = found.xml.take().or_else(|| xml(&bytes[meta.1]));
                    }
                } else {
                    found.xml = found.xml.take().or_else(|| xml(&bytes));
                }
            }
            at += length;
            if at >= size {
                break;
            }
        }
        Ok(found)
    }
}

/// As many bytes as there are.
fn read_some(file: &mut File, into: &mut [u8]) -> std::io::Result<usize> {
    let mut got = 0;
    while got < into.len() {
        match file.read(&mut into[got..])? {
            0 => break,
            n => got += n,
        }
    }
    Ok(got)
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_be_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}

fn long(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_be_bytes(bytes.get(at..at + 8)?.try_into().ok()?))
}

/// A box's name, where its content begins, and its length; `left` bytes are left of what holds it.
fn header(bytes: &[u8], left: u64) -> Option<([u8; 4], u64, u64)> {
    let name: [u8; 4] = bytes.get(4..8)?.try_into().ok()?;
    let (start, length) = match word(bytes, 0)? {
        0 => (8, left),
        1 => (16, long(bytes, 8)?),
        n => (8, u64::from(n)),
    };
    (length >= start && length <= left).then_some((name, start, length))
}

/// Boxes one after the other: name and place of the content.
fn children(bytes: &[u8]) -> impl Iterator<Item = ([u8; 4], Range<usize>)> + '_ {
    let mut at = 0;
    std::iter::from_fn(move || {
        let rest = bytes.get(at..).filter(|r| !r.is_empty())?;
        let (name, start, length) = header(rest, rest.len() as u64)?;
        let place = at + start as usize..at + length as usize;
        at = place.end;
        Some((name, place))
    })
}

/// The content of the first box at the end of a path of names.
fn inside<'a>(bytes: &'a [u8], path: &[&[u8; 4]]) -> Option<&'a [u8]> {
    path.iter().try_fold(bytes, |bytes, &name| {
        let (_, place) = children(bytes).find(|c| &c.0 == name)?;
        Some(&bytes[place])
    })
}

/// Whether the first video track of a `moov` has an edit list of several pieces, or with one of another speed; and where the list
/// ends, s, if it begins with a pause.
fn edit_list(moov: &[u8]) -> (bool, Option<f64>) {
    let video = children(moov).filter(|c| &c.0 == b"trak").map(|c| &moov[c.1]).find(|trak| {
        let handler = inside(trak, &[b"mdia", b"hdlr"]);
        handler.and_then(|h| h.get(8..12)) == Some(b"vide")
    });
    let Some(list) = video.and_then(|trak| inside(trak, &[b"edts", b"elst"])) else { return (false, None) };
    let is_long = list.first() == Some(&1);
    let entry = if is_long { 20 } else { 12 };
    let entries = list.get(8..).unwrap_or_default().chunks_exact(entry);
    let count = word(list, 4).unwrap_or(0) as usize;
    let entries: Vec<&[u8]> = entries.take(count).collect();
    // A piece that begins nowhere is a pause.
    let speeds: Vec<u32> =
        entries.iter().filter(|e| !begins_nowhere(e, is_long)).filter_map(|e| word(e, entry - 4)).collect();
    let shown = |e: &&[u8]| if is_long { long(e, 0) } else { word(e, 0).map(u64::from) };
    // Nothing is the rest of a film that is not ended yet.
    let whole = entries.iter().map(shown).try_fold(0u64, |sum, n| sum.checked_add(n.filter(|n| *n > 0)?));
    let movie = inside(moov, &[b"mvhd"]).unwrap_or_default();
    let scale = word(movie, if movie.first() == Some(&1) { 20 } else { 12 }).filter(|n| *n > 0);
    let pauses = entries.first().is_some_and(|e| begins_nowhere(e, is_long));
    let ends = scale.zip(whole).filter(|_| pauses).map(|(scale, whole)| whole as f64 / f64::from(scale));
    (speeds.len() > 1 || speeds.iter().any(|&s| s != 0x1_0000), ends)
}

fn begins_nowhere(entry: &[u8], is_long: bool) -> bool {
    if is_long { long(entry, 8) == Some(u64::MAX) } else { word(entry, 4) == Some(u32::MAX) }
}

/// The text of a `meta` box's `xml ` box. QuickTime's `meta` has no version, MP4's has four bytes of it.
fn xml(meta: &[u8]) -> Option<String> {
    let find = |bytes: &[u8]| inside(bytes, &[b"xml "]).map(<[u8]>::to_vec);
    let found = meta.get(4..).and_then(find).or_else(|| find(meta))?;
    Some(String::from_utf8_lossy(found.get(4..)?).trim_end_matches('\0').to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxed(name: &[u8; 4], body: &[u8]) -> Vec<u8> {
        [&(body.len() as u32 + 8).to_be_bytes()[..], name, body].concat()
    }

    fn moov(edits: &[(u32, u32, u32)]) -> Vec<u8> {
        let mut list = [0u32.to_be_bytes(), (edits.len() as u32).to_be_bytes()].concat();
        for &(duration, start, speed) in edits {
            list.extend([duration, start, speed].iter().flat_map(|v| v.to_be_bytes()));
        }
        let handler = boxed(b"hdlr", b"\0\0\0\0\0\0\0\0vide\0\0\0\0");
        let trak = [boxed(b"edts", &boxed(b"elst", &list)), boxed(b"mdia", &handler)].concat();
        boxed(b"trak", &trak)
    }

    #[test]
    fn an_edit_list_changes_time_if_it_joins_or_stretches() {
        const NOWHERE: u32 = u32::MAX;
        const ONE: u32 = 0x1_0000;
        for (edits, changes) in [
            (&[(4000, 1024, ONE)][..], false),
            (&[(100, NOWHERE, ONE), (4000, 0, ONE)], false),
            (&[(8000, 0, ONE / 2)], true),
            (&[(1000, 0, ONE), (8000, 1000, ONE / 8), (1000, 2000, ONE)], true),
            (&[(1000, 0, ONE), (1000, 5000, ONE)], true),
            (&[], false),
        ] {
            assert_eq!(edit_list(&moov(edits)).0, changes, "{edits:?}");
        }
    }

    #[test]
    fn boxes_that_lie_say_nothing() {
        let whole = moov(&[(8000, 0, 0x8000)]);
        for cut in 0..whole.len() {
            edit_list(&whole[..cut]);
            let mut bytes = whole.clone();
            bytes[cut] ^= 0xff;
            edit_list(&bytes);
        }
        assert!(!edit_list(b"\0\0\0\x04trak").0);
        assert_eq!(header(b"\0\0\0\x01moov\xff\xff\xff\xff\xff\xff\xff\xff", 100), None);
    }

    #[test]
    fn xml_is_found_with_and_without_a_version() {
        let text = boxed(b"xml ", b"\0\0\0\0<a captureFps=\"119.88p\"/>\0");
        let said = Some("<a captureFps=\"119.88p\"/>".to_owned());
        assert_eq!(xml(&text), said);
        assert_eq!(xml(&[&[0; 4][..], &boxed(b"hdlr", &[0; 20]), &text].concat()), said);
        assert_eq!(xml(b"\0\0\0\0"), None);
    }
}
