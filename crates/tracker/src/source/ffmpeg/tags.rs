//! Reads how the coded pictures of a film say themselves that they are to be turned, as JPEG, PNG, TIFF and WebP can.
//!
//! Owns: [`Tags`]. Must not: turn anything.

use ffmpeg_next::ffi;

use crate::source::images::orientation_told;
use crate::source::orientation::Orientation;

/// Codecs whose packets are whole picture files.
pub(super) const PICTURES: [ffi::AVCodecID; 5] = [
    ffi::AVCodecID::AV_CODEC_ID_MJPEG,
    ffi::AVCodecID::AV_CODEC_ID_PNG,
    ffi::AVCodecID::AV_CODEC_ID_APNG,
    ffi::AVCodecID::AV_CODEC_ID_TIFF,
    ffi::AVCodecID::AV_CODEC_ID_WEBP,
];

/// The orientation that the pictures of a film state.
pub(super) struct Tags {
    /// The first picture's orientation; a picture that states none is not turned.
    first: Option<Orientation>,
}

impl Tags {
    /// `None` for a codec whose pictures say nothing.
    pub(super) fn of(codec: ffi::AVCodecID) -> Option<Self> {
        PICTURES.contains(&codec).then_some(Self { first: None })
    }

    /// Difference of a picture's orientation from the first one's, a clause; no whole picture differs. One that states none is
    /// like the first: some cameras tag the first picture alone.
    pub(super) fn problem(&mut self, packet: &[u8]) -> Option<String> {
        let own = orientation_told(packet);
        let first = *self.first.get_or_insert(own.unwrap_or_default());
        let [words, first_words] = [own?, first].map(Orientation::words_or_none);
        (own != Some(first))
            .then(|| format!("it is to be turned otherwise than the first: {words}, that {first_words}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_that_says_nothing_is_like_the_first() {
        // The start of a JPEG picture, with the tag Orientation if it is not 0.
        let jpeg = |orientation: u8| {
            let mut bytes =
                b"\xff\xd8\xff\xe1\0\x22Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0".to_vec();
            bytes.extend([orientation, 0, 0, 0, 0, 0, 0]);
            if orientation == 0 { b"\xff\xd8\xff\xda".to_vec() } else { bytes }
        };
        let mut tags = Tags::of(ffi::AVCodecID::AV_CODEC_ID_MJPEG).unwrap();
        let told = [6, 0, 6, 8, 6].map(|tag| tags.problem(&jpeg(tag)));
        let words = "it is to be turned otherwise than the first: 90 degrees counter-clockwise, that 90 degrees clockwise";
        assert_eq!(told.each_ref().map(Option::as_deref), [None, None, None, Some(words), None]);
        assert!(Tags::of(ffi::AVCodecID::AV_CODEC_ID_H264).is_none());
    }
}
