//! Walks GIF: blocks one after the other, each with a length or a chain of lengths (GIF89a).

use super::bytes::Bytes;
use super::{Fit, Walk};

/// Where the walk stands.
#[derive(Debug, Default)]
pub(super) struct Gif {
    at: u64,
    ended: bool,
    adrift: bool,
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
                chain(file, self.at + 10 + table(place[9]) + 1)?
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
        if self.adrift { Fit::Broken } else { Fit::Whole }
    }

    fn rest(&mut self, file: &mut Bytes) -> Fit {
        while !self.adrift && !self.ended {
            self.adrift = self.step(file).is_none();
        }
        // The end may be padded, but a film that goes on after it was not at its end.
        let padding = file.length().saturating_sub(self.at).min(16);
        let padded = (0..padding).all(|k| file.array(self.at + k) == Some([0]));
        if self.adrift || !padded { Fit::Broken } else { Fit::Whole }
    }
}
