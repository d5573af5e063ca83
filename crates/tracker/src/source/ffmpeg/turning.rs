//! Turns the pictures of a film as they say themselves, where its container says nothing.

use super::source::FfmpegSource;
use super::tags::PICTURES;
use crate::source::images::orientation_told;
use crate::source::orientation::Orientation;

impl FfmpegSource {
    /// Turns the pictures as the first of them says, where the container says nothing.
    pub(crate) fn turn_as_tagged(&mut self) {
        let codec = self.feed.demuxer.parameters().codec_id;
        let first = self.feed.ahead().next().filter(|_| PICTURES.contains(&codec));
        let told = first.and_then(|packet| orientation_told(packet.bytes())).unwrap_or_default();
        if told == Orientation::default() || told == self.orientation {
            return;
        }
        let info = &mut self.info;
        if self.orientation != Orientation::default() {
            info.warnings.push(
                format!(
                    "its pictures say themselves that they are to be turned otherwise, {}: what the file says is done",
                    told.words_or_none()
                )
                .into(),
            );
            return;
        }
        self.orientation = told;
        (info.width, info.height) = told.size(info.width, info.height);
        if told.transposed && info.pixel_aspect_origin.is_recording() {
            info.pixel_aspect = info.pixel_aspect.turned();
        }
        info.warnings.extend(told.warning());
    }
}
