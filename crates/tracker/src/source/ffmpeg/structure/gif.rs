//! Walks GIF: blocks one after the other, each with a length or a chain of lengths (GIF89a).

use super::bytes::Bytes;
use super::{Fit, Walk};

/// State of the walk through GIF.
#[derive(Debug, Default)]
pub(super) struct Gif {
    at: u64,
    ended: bool,
    adrift: bool,
    /// A picture's data went on through others.
    swallowed: bool,
}

/// Bytes of a colour table, by the byte that tells of it.
fn table(flags: u8) -> u64 {
    if flags & 0x80 == 0 { 0 } else { 3 << ((flags & 7) + 1) }
}

/// One past a chain of blocks that each begin with their length.
fn chain(file: &mut Bytes, mut at: u64) -> Option<u64> {
    loop {
        let [length] = file.array(at)?;
        at += 1 + u64::from(length);
        if length == 0 {
            return Some(at);
        }
    }
}

/// Whether the data of a picture holds the beginning of another (graphic control extension, then an image): a length in
/// the chain is damaged, and the chain went on through the pictures after it. By chance one in 10^14 bytes begins so.
fn swallows(file: &mut Bytes, begin: u64, end: u64) -> bool {
    const CONTROL: [u8; 4] = [0, 0x21, 0xF9, 4];
    const IMAGE: [u8; 2] = [0, 0x2C];
    let mut data = vec![0; usize::try_from(end.saturating_sub(begin)).unwrap_or(0)];
    file.fill(begin, &mut data).is_some()
        && data.windows(10).any(|w| w.starts_with(&CONTROL) && w.ends_with(&IMAGE))
}

impl Gif {
    fn step(&mut self, file: &mut Bytes) -> Option<()> {
        if self.at == 0 {
            let header: [u8; 13] = file.array(0)?;
            self.at = 13 + table(header[10]);
            return Some(());
        }
        let [kind] = file.array(self.at)?;
        self.at = match kind {
            0x21 => chain(file, self.at + 2)?,
            0x2C => {
                let place: [u8; 10] = file.array(self.at)?;
                let begin = self.at + 10 + table(place[9]) + 1;
                let end = chain(file, begin)?;
                self.swallowed |= swallows(file, begin, end);
                end
            }
            0x3B => {
                self.ended = true;
                self.at + 1
            }
            _ => return None,
        };
        Some(())
    }
}

impl Walk for Gif {
    fn reach(&mut self, file: &mut Bytes, to: u64) -> Fit {
        while !self.adrift && !self.ended && self.at < to {
            self.adrift = self.step(file).is_none();
        }
        // After a break nothing tells a block from what a block holds.
        self.adrift |= self.ended || self.at != to;
        if std::mem::take(&mut self.swallowed) || self.adrift { Fit::Broken } else { Fit::Whole }
    }

    fn rest(&mut self, file: &mut Bytes) -> Fit {
        while !self.adrift && !self.ended {
            self.adrift = self.step(file).is_none();
        }
        // The end may be padded, but a film that goes on after it was not at its end.
        let padding = file.length().saturating_sub(self.at).min(16);
        let padded = (0..padding).all(|k| file.array(self.at + k) == Some([0]));
        if self.adrift || self.swallowed || !padded { Fit::Broken } else { Fit::Whole }
    }
}
