//! Reach of damage to a packet's picture: the other pictures that may be predicted from it, by the headers of its units.
//!
//! Owns: [`Reach`], [`References`]. Must not: decode, or know which packets are damaged.

use ffmpeg_next::ffi;

use super::units::Units;

/// The pictures after a packet's, in decoding order, that may be predicted from it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reach {
    /// None.
    Itself,
    /// Pictures that are shown before the key frame that precedes them.
    Leading,
    /// All up to the next key frame, and those shown before that.
    All,
}

/// Reads the reach of a stream's packets.
#[derive(Debug)]
pub(super) struct References {
    units: Option<Units>,
    codec: ffi::AVCodecID,
    /// HEVC with layers of time, of which a higher one may be predicted from any picture of a lower one.
    has_layers: bool,
}

impl References {
    /// For a stream with its parameters as the container holds them.
    pub(super) fn of(codec: ffi::AVCodecID, parameters: &[u8]) -> Self {
        let units = Units::of(codec, parameters);
        // ISO/IEC 14496-15, 8.3.3.1: numTemporalLayers, 0 where it is unknown.
        let is_one_layer =
            units.is_some_and(Units::have_lengths) && parameters.get(21).is_some_and(|b| b >> 3 & 7 == 1);
        Self { units, codec, has_layers: !is_one_layer }
    }

    /// The reach of a packet; [`Reach::All`] where nothing tells.
    pub(super) fn reach(&self, packet: &[u8]) -> Reach {
        let Some(units) = self.units else { return Reach::All };
        let is_hevc = self.codec == ffi::AVCodecID::AV_CODEC_ID_HEVC;
        let reach = |unit: &&[u8]| {
            let first = *unit.first()?;
            if is_hevc { self.hevc(first >> 1 & 0x3F) } else { h264(first) }
        };
        // A unit whose header is damaged may say anything: what any other one of the packet says counts.
        let mut found = units.split(packet).iter().filter_map(reach).collect::<Vec<_>>();
        found.sort_by_key(|reach| *reach as u8);
        found.last().copied().unwrap_or(Reach::All)
    }

    /// By the type of an HEVC unit (H.265, table 7-1); `None` for one that is no part of a picture.
    fn hevc(&self, kind: u8) -> Option<Reach> {
        match kind {
            // Leading pictures, which no trailing one is predicted from.
            6..=9 => Some(Reach::Leading),
            // Those that none of their layer is predicted from have even numbers.
            0 | 2 | 4 if !self.has_layers => Some(Reach::Itself),
            0..=31 => Some(Reach::All),
            _ => None,
        }
    }
}

/// By the first byte of an H.264 unit (7.3.1): its type, and whether others are predicted from it (`nal_ref_idc`); `None`
/// for one that is no part of a picture.
fn h264(first: u8) -> Option<Reach> {
    match first & 0x1F {
        1..=5 => Some(if first & 0x60 == 0 { Reach::Itself } else { Reach::All }),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ffi::AVCodecID::{AV_CODEC_ID_H264, AV_CODEC_ID_HEVC, AV_CODEC_ID_MPEG4};

    #[test]
    fn the_headers_of_units_tell_how_far_damage_reaches() {
        let h264 = References::of(AV_CODEC_ID_H264, &[]);
        assert_eq!(h264.reach(&[0, 0, 1, 0x01, 9, 0, 0, 1, 0x01, 9]), Reach::Itself);
        assert_eq!(h264.reach(&[0, 0, 1, 0x06, 9, 0, 0, 1, 0x41, 9]), Reach::All);
        assert_eq!(h264.reach(&[0, 0, 1, 0x01, 9, 0, 0, 1, 0x41, 9]), Reach::All);
        // No picture is found in it.
        assert_eq!(h264.reach(&[7, 7, 7]), Reach::All);
        let mut box_bytes = [0u8; 23];
        (box_bytes[0], box_bytes[21]) = (1, 0b0000_1011);
        let hevc = References::of(AV_CODEC_ID_HEVC, &box_bytes);
        assert_eq!(hevc.reach(&[0, 0, 0, 3, 0, 1, 9]), Reach::Itself);
        assert_eq!(hevc.reach(&[0, 0, 0, 3, 2, 1, 9]), Reach::All);
        assert_eq!(hevc.reach(&[0, 0, 0, 3, 9 << 1, 1, 9]), Reach::Leading);
        box_bytes[21] = 0b0001_1011;
        assert_eq!(References::of(AV_CODEC_ID_HEVC, &box_bytes).reach(&[0, 0, 0, 3, 0, 1, 9]), Reach::All);
        assert_eq!(References::of(AV_CODEC_ID_MPEG4, &[]).reach(&[0, 0, 1, 0x01]), Reach::All);
    }
}
