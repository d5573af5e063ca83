//! Walks MPEG program streams: packs and packets one after the other, each with a mark and most with a length
//! (ISO/IEC 13818-1, 2.5; ISO/IEC 11172-1).

use super::bytes::Bytes;
use super::walk::Elements;

/// Kinds after a mark's bytes 0, 0, 1: the stream's end, a pack, a header; from that on all have a length.
const END: u8 = 0xB9;
const PACK: u8 = 0xBA;
const HEADER: u8 = 0xBB;

/// State of the walk through a program stream.
#[derive(Debug, Default)]
pub(super) struct Program {
    at: u64,
}

impl Elements for Program {
    fn at(&mut self) -> &mut u64 {
        &mut self.at
    }

    fn step(&mut self, file: &mut Bytes) -> Option<()> {
        let [0, 0, 1, kind] = file.array(self.at)? else { return None };
        let length = match kind {
            END => 4,
            PACK => {
                let [flags] = file.array(self.at + 4)?;
                if flags >> 6 == 1 {
                    let [stuffing] = file.array(self.at + 13)?;
                    14 + u64::from(stuffing & 7)
                } else {
                    12
                }
            }
            HEADER.. => 6 + u64::from(file.array(self.at + 4).map(u16::from_be_bytes)?),
            _ => return None,
        };
        self.at = self.at.checked_add(length).filter(|end| *end <= file.length())?;
        Some(())
    }
}
