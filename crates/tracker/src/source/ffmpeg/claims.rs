//! Reads what a file's metadata say of the rate at which the camera took the frames.
//!
//! Owns: [`claims`]. Only tags whose meaning is published are believed: Android's capture rate
//! (`MediaFormat.KEY_CAPTURE_RATE`, kept as `com.android.capture.fps`) and Sony's `captureFps`.

use std::ffi::CStr;

use super::demux::Demuxer;
use crate::frame::{CaptureClaim, RateClaims};
use crate::message::Message;

/// Android's tag of the capture rate.
const ANDROID: &CStr = c"com.android.capture.fps";
/// Sony's attribute in the XML of `NonRealTimeMeta`.
const SONY: &str = "captureFps";
/// Greatest rate that a tag may give, frames per second.
const MOST_HZ: f64 = 1e6;
/// Keys of a camera's maker and of its model.
const MAKER: [&CStr; 4] =
    [c"com.apple.quicktime.make", c"com.android.manufacturer", c"make", c"manufacturer"];
const MODEL: [&CStr; 3] = [c"com.apple.quicktime.model", c"com.android.model", c"model"];
/// Apple's word on how a film is meant to be played; its time stamps are the camera's in both cases.
const APPLE: &CStr = c"com.apple.quicktime.full-frame-rate-playback-intent";

/// The rates that container and metadata claim. A tag that is no rate is warned of and not used.
pub(super) fn claims(
    demuxer: &Demuxer,
    warnings: &mut Vec<Message>,
    details: &mut Vec<(String, String)>,
) -> RateClaims {
    let mut container: Vec<[u64; 2]> = Vec::new();
    for rate in demuxer.rates() {
        let rate = [u64::from(rate.num.unsigned_abs()), u64::from(rate.den.unsigned_abs())];
        if !container.contains(&rate) {
            container.push(rate);
        }
    }
    let android = demuxer.tag(ANDROID).map(|text| (ANDROID.to_string_lossy().into_owned(), text));
    let sony = demuxer.boxes().xml.as_deref().and_then(|xml| attribute(xml, SONY));
    // "119.88p" is progressive; "59.94i" counts fields.
    let sony = sony.map(|text| (SONY.to_owned(), text.trim_end_matches('p').to_owned()));
    let mut capture = None;
    for (tag, text) in [android, sony].into_iter().flatten() {
        details.push((tag.clone(), text.clone()));
        match text.trim().parse::<f64>() {
            Ok(rate_hz) if rate_hz > 0.0 && rate_hz <= MOST_HZ => {
                capture = capture.or(Some(CaptureClaim { tag, rate_hz }));
            }
            _ => warnings.push(format!("the tag {tag} is {text:?}, which is no rate; it is not used").into()),
        }
    }
    // Some cameras write blanks there.
    let first = |keys: &[&CStr]| {
        let mut said = keys.iter().filter_map(|key| demuxer.tag(key)).map(|text| text.trim().to_owned());
        said.find(|text| !text.is_empty())
    };
    let camera: Vec<String> = [first(&MAKER), first(&MODEL)].into_iter().flatten().collect();
    let camera = Some(camera.join(" ")).filter(|c| !c.is_empty());
    details.extend(camera.clone().map(|c| ("camera".to_owned(), c)));
    details.extend(demuxer.tag(APPLE).map(|v| ("full-frame-rate-playback-intent".to_owned(), v)));
    RateClaims { container, capture, camera }
}

/// The value of the first attribute of a name in XML.
fn attribute(xml: &str, name: &str) -> Option<String> {
    let (_, rest) = xml.split_once(&format!(" {name}=\""))?;
    Some(rest.split_once('"')?.0.to_owned())
}

#[cfg(test)]
mod tests {
    use super::attribute;

    #[test]
    fn an_attribute_of_sonys_xml() {
        let xml = r#"<NonRealTimeMeta><VideoFormat><VideoFrame videoCodec="AVC" captureFps="119.88p" formatFps="29.97p"/></VideoFormat></NonRealTimeMeta>"#;
        assert_eq!(attribute(xml, "captureFps").as_deref(), Some("119.88p"));
        assert_eq!(attribute(xml, "formatFps").as_deref(), Some("29.97p"));
        assert_eq!(attribute(xml, "Fps"), None);
        assert_eq!(attribute("<a captureFps=\"1", "captureFps"), None);
    }
}
