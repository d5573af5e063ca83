//! Walks NUT: headers one after the other before the first picture, each with a mark and a length (NUT open container format,
//! "header packets"). What lies between pictures is not followed: their lengths need the tables of the headers.

use super::bytes::Bytes;
use super::{Fit, Walk};

/// First bytes of a NUT file.
const NAME: &[u8; 25] = b"nut/multimedia container\0";
/// Marks of the headers: main, stream, information; and of the place from which pictures are read.
const HEADERS: [u64; 3] = [0x4E4D_7A56_1F5F_04AD, 0x4E53_1140_5BF2_F9DB, 0x4E49_AB68_B596_BA78];
const PICTURES: u64 = 0x4E4B_E4AD_EECA_4569;
/// Length of a header from which on it has a checksum of four bytes before its contents, bytes.
const LONG: u64 = 4096;

/// Whether the headers were looked at.
#[derive(Debug, Default)]
pub(super) struct Nut {
    is_begun: bool,
}

/// Whether headers follow each other up to the pictures.
fn headers_fit(file: &mut Bytes) -> Option<bool> {
    let mut at = NAME.len() as u64;
    let mut is_whole = file.array(0)? == *NAME;
    while is_whole {
        let mark = file.array(at).map(u64::from_be_bytes)?;
        if mark == PICTURES {
            break;
        }
        is_whole = HEADERS.contains(&mark);
        at += 8;
        let mut length = 0u64;
        loop {
            let [byte] = file.array(at)?;
            at += 1;
            length = length.checked_mul(128)?.checked_add(u64::from(byte & 0x7F))?;
            if byte & 0x80 == 0 {
                break;
            }
        }
        at = at.checked_add(length)?.checked_add(if length > LONG { 4 } else { 0 })?;
    }
    Some(is_whole)
}

impl Walk for Nut {
    fn reach(&mut self, file: &mut Bytes, _: u64) -> Fit {
        let is_first = !std::mem::replace(&mut self.is_begun, true);
        if is_first && headers_fit(file) != Some(true) { Fit::Broken } else { Fit::Whole }
    }

    fn rest(&mut self, _: &mut Bytes) -> Fit {
        Fit::Whole
    }
}
