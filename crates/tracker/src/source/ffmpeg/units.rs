//! The units of H.264 and HEVC packets (ITU-T H.264, 7.3.1; H.265, 7.3.1), as MP4's and Matroska's files and as streams part
//! them.
//!
//! Owns: [`Units`]. Must not: read more of a unit than where it begins and ends.

use ffmpeg_next::ffi;

/// The division of a stream's packets into units.
#[derive(Debug, Clone, Copy)]
pub(super) struct Units {
    /// Bytes of the length before each unit; 0 where marks part them.
    length_bytes: usize,
}

impl Units {
    /// For a stream with its parameters as the container holds them; `None` for codecs without units.
    pub(super) fn of(codec: ffi::AVCodecID, parameters: &[u8]) -> Option<Self> {
        // ISO/IEC 14496-15, 5.3.3.1 and 8.3.3.1: a version, and the size of lengths in the last two bits of a byte.
        let at = match codec {
            ffi::AVCodecID::AV_CODEC_ID_H264 => 4,
            ffi::AVCodecID::AV_CODEC_ID_HEVC => 21,
            _ => return None,
        };
        let length_bytes = match parameters.first() {
            Some(1) => usize::from(parameters.get(at)? & 3) + 1,
            _ => 0,
        };
        Some(Self { length_bytes })
    }

    /// Whether lengths part the units, and the container holds the parameters apart.
    pub(super) fn have_lengths(self) -> bool {
        self.length_bytes > 0
    }

    /// The units in a packet.
    pub(super) fn split(self, packet: &[u8]) -> Vec<&[u8]> {
        let mut units = Vec::new();
        let mut rest = packet;
        if self.length_bytes == 0 {
            let mark = |bytes: &[u8]| bytes.windows(3).position(|w| w == [0, 0, 1]);
            while let Some(at) = mark(rest) {
                rest = &rest[at + 3..];
                units.push(&rest[..mark(rest).unwrap_or(rest.len())]);
            }
            return units;
        }
        while let Some((length, unit)) = rest.split_at_checked(self.length_bytes) {
            let length = length.iter().fold(0, |sum, b| sum << 8 | usize::from(*b));
            let Some((unit, after)) = unit.split_at_checked(length) else { break };
            units.push(unit);
            rest = after;
        }
        units
    }
}
