//! Checks the sums of FFV1's slices (RFC 9043): FFmpeg's decoder compares them too, but hands out such a picture as a good one,
//! with the slice of the picture before in the place of the damaged one.
//!
//! Owns: [`SliceSums`], [`are_there`]. Must not: decode.

use ffmpeg_next::ffi;

/// Bytes behind a slice: its length, and where slices have sums, a byte of status and the sum.
const LENGTH: usize = 3;
const LENGTH_AND_SUM: usize = LENGTH + 5;
/// Start of the sum over a slice and its stored sum, and its end if both agree, in libavutil's order of bytes: version 3,
/// version 4.
const REMAINDERS: [u32; 2] = [0, 0x7A8C_4079];
/// First two bytes of a key frame's packet, at least: its first bit, coded with even odds, is 1.
const KEY_FRAME: u16 = 0x7F80;

/// Follows the packets of an FFV1 stream.
pub(super) struct SliceSums {
    /// A packet was met in which all sums are right.
    has_sums: bool,
    /// Coding goes on from a picture that is damaged or lost.
    is_stale: bool,
}

/// The verdict of a packet's own checksums.
#[derive(Debug, PartialEq, Eq)]
enum Sums {
    Right,
    Wrong,
    /// The packet is not made of slices that have sums.
    None,
}

impl SliceSums {
    /// `None` for a codec without such sums.
    pub(super) fn of(codec: ffi::AVCodecID) -> Option<Self> {
        (codec == ffi::AVCodecID::AV_CODEC_ID_FFV1).then_some(Self { has_sums: false, is_stale: false })
    }

    /// Whether a packet's picture is not what was filmed: it is damaged, `is_known` from elsewhere or by its sums, or goes on
    /// from a picture that is, or from one that is lost.
    pub(super) fn is_damaged(&mut self, packet: &[u8], is_after_loss: bool, is_known: bool) -> bool {
        let sums = sums(packet);
        self.has_sums |= sums == Sums::Right;
        let is_key = packet.first_chunk().is_some_and(|first| u16::from_be_bytes(*first) >= KEY_FRAME);
        self.is_stale &= !is_key;
        self.is_stale |= !is_key && is_after_loss;
        self.is_stale |= is_known || sums == Sums::Wrong || sums == Sums::None && self.has_sums;
        self.is_stale
    }
}

/// Whether a packet is made of slices that have sums, right or wrong.
pub(super) fn are_there(packet: &[u8]) -> bool {
    sums(packet) != Sums::None
}

/// Goes over the slices from the packet's end, where the length of each stands.
fn sums(packet: &[u8]) -> Sums {
    let mut rest = packet;
    let mut are_right = true;
    while !rest.is_empty() {
        let Some(slice) = last_slice(rest) else { return Sums::None };
        are_right &= REMAINDERS.iter().any(|&start| sum(start, slice) == start);
        rest = &rest[..rest.len() - slice.len()];
    }
    match (packet.is_empty(), are_right) {
        (true, _) => Sums::None,
        (_, true) => Sums::Right,
        (_, false) => Sums::Wrong,
    }
}

/// The last slice with what is behind it; `None` where no slice of its length fits.
fn last_slice(bytes: &[u8]) -> Option<&[u8]> {
    let behind = bytes.len().checked_sub(LENGTH_AND_SUM)?;
    let length = bytes[behind..behind + LENGTH].iter().fold(0, |sum, b| sum << 8 | usize::from(*b));
    bytes.len().checked_sub(length + LENGTH_AND_SUM).map(|at| &bytes[at..])
}

/// The sum of `bytes` that begins with `start`: polynomial 0x04C11DB7, highest bit first, the highest byte lowest.
fn sum(start: u32, bytes: &[u8]) -> u32 {
    // SAFETY: the table is static, and made at the first call under a lock; the bytes are as many as are told.
    unsafe {
        let table = ffi::av_crc_get_table(ffi::AVCRCId::AV_CRC_32_IEEE);
        ffi::av_crc(table, start, bytes.as_ptr(), bytes.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A packet of slices with sums.
    fn packet(slices: &[&[u8]]) -> Vec<u8> {
        let mut packet = Vec::new();
        for slice in slices {
            let begin = packet.len();
            packet.extend_from_slice(slice);
            packet.extend_from_slice(&(slice.len() as u32).to_be_bytes()[1..]);
            packet.push(0);
            let own = sum(0, &packet[begin..]);
            packet.extend_from_slice(&own.to_le_bytes());
        }
        packet
    }

    #[test]
    fn the_sum_is_that_of_the_standard() {
        // CRC-32/MPEG-2 is the same with a start of all ones.
        assert_eq!(sum(u32::MAX, b"123456789").swap_bytes(), 0x0376_E6E7);
    }

    #[test]
    fn every_changed_byte_is_seen() {
        let good = packet(&[b"\x80\x00first slice", b"second", b""]);
        let mut sums_of = SliceSums { has_sums: false, is_stale: false };
        assert!(!sums_of.is_damaged(&good, false, false));
        for at in 0..good.len() {
            let mut bad = good.clone();
            bad[at] ^= 0x10;
            assert_ne!(sums(&bad), Sums::Right, "byte {at}");
            assert!(sums_of.is_damaged(&bad, false, false), "byte {at}");
            assert!(!sums_of.is_damaged(&good, false, false), "a key frame begins anew");
        }
    }

    #[test]
    fn what_goes_on_from_damage_is_damaged_up_to_the_next_key_frame() {
        let (key, goes_on) = (packet(&[b"\x80\x00key"]), packet(&[b"\x10\x00goes on"]));
        let mut sums_of = SliceSums { has_sums: false, is_stale: false };
        let mut told = |packet: &[u8], is_after_loss| sums_of.is_damaged(packet, is_after_loss, false);
        assert!(!told(&key, false) && !told(&goes_on, false));
        assert!(told(&goes_on, true) && told(&goes_on, false));
        assert!(!told(&key, true) && !told(&goes_on, false));
        assert!(told(&key[..5], false) && told(&goes_on, false));
        assert!(!told(&key, false));
    }

    #[test]
    fn a_stream_without_sums_is_not_doubted() {
        let mut sums_of = SliceSums { has_sums: false, is_stale: false };
        assert!(!are_there(b"\x80\x00 version 1 has neither") && are_there(&packet(&[b"\x80\x00slice"])));
        assert!(!sums_of.is_damaged(b"\x80\x00 version 1 has neither lengths nor sums", false, false));
    }
}
