//! MPEG program streams: packs and packets one after the other, each with a mark and most with a length
//! (ISO/IEC 13818-1, 2.5; ISO/IEC 11172-1).

use super::bytes::Bytes;
use super::{Fit, Walk};

/// Kinds after a mark's bytes 0, 0, 1: the stream's end, a pack, a header; from that on all have a length.
const END: u8 = 0xB9;
const PACK: u8 = 0xBA;
const HEADER: u8 = 0xBB;

/// Where the walk stands.
#[derive(Debug, Default)]
pub(super) struct Program {
    at: u64,
}

impl Program {
    /// Goes over one element. `None` where there is none that is whole.
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

impl Walk for Program {
    fn reach(&mut self, file: &mut Bytes, to: u64) -> Fit {
        let mut whole = true;
        while whole && self.at < to {
            whole = self.step(file).is_some();
        }
        whole &= self.at == to;
        self.at = to;
        if whole { Fit::Whole } else { Fit::Broken }
    }

    fn rest(&mut self, file: &mut Bytes) -> Fit {
        while self.at < file.length() {
            if self.step(file).is_none() {
                return Fit::Broken;
            }
        }
        Fit::Whole
    }
}
