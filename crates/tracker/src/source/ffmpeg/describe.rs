//! Describes a recording by what its container and stream say.
//!
//! Owns: [`describe`]. Must not: decode.

use ffmpeg_next::ffi;

use super::claims::claims;
use super::codec_name;
use super::demux::Demuxer;
use super::layout::Layout;
use crate::error::{Error, Fault, FaultKind, Result};
use crate::frame::{RateOrigin, SourceInfo, TimeBase};
use crate::message::Message;
use crate::pixel_aspect::PixelAspect;
use crate::pixel_damage::PixelDamage;
use crate::source::orientation::Orientation;
use crate::source::{OpenOptions, clock};

/// The facts of a recording before any of it is decoded, and how its pictures are to be turned.
///
/// # Errors
/// [`Error::Source`] for a size that is none; [`Error::Argument`] for a rate that is none.
pub(super) fn describe(
    demuxer: &Demuxer,
    layout: &Layout,
    name: &str,
    options: &OpenOptions,
) -> Result<(SourceInfo, Orientation)> {
    let parameters = demuxer.parameters();
    let (width, height) = size(parameters, name)?;
    let mut warnings = Vec::new();
    let orientation = turn(demuxer, &mut warnings);
    let (width, height) = orientation.size(width, height);
    let (pixel_aspect, pixel_aspect_origin) = options.aspect(aspect(demuxer, orientation, &mut warnings));

    let stream = demuxer.stream();
    let rate = demuxer.rate();
    let stream_rate_hz = rate.map(|r| f64::from(r.num) / f64::from(r.den));
    let (time_base, rate_hz, rate_origin) = match options.fps {
        Some(fps) => (clock::time_base(fps)?, Some(fps), RateOrigin::User),
        // Times are frame numbers.
        None if demuxer.is_untimed() => {
            (TimeBase { numerator: 1, denominator: 1 }, None, RateOrigin::Unknown)
        }
        None => (stream_base(demuxer), stream_rate_hz, RateOrigin::Container),
    };
    if demuxer.boxes().edits_change_time {
        warnings.push(
            "an edit list plays pieces of it one after the other or at another speed; all its frames are read, at \
             the time stamps that the camera gave them"
                .into(),
        );
    }
    let counted = u64::try_from(stream.nb_frames).ok().filter(|n| *n > 0);
    let declared = counted.or_else(|| demuxer.edit_units());
    let indexed = demuxer.indexed();
    let mut details = details(parameters, layout);
    if let (Some(all), Some((there, hidden))) = (declared, indexed)
        && there - hidden < all
    {
        let shown = there - hidden;
        details.push(("edit list".into(), format!("shows {shown} of the {all} frames; these are read")));
    }
    let claims = claims(demuxer, &mut warnings, &mut details);
    let info = SourceInfo {
        name: name.to_owned(),
        container: demuxer.container(),
        codec: codec_name(parameters.codec_id),
        width,
        height,
        pixel_aspect,
        pixel_aspect_origin,
        format: layout.format,
        depth_bits: layout.depth_bits,
        pixel_damage: PixelDamage::of(&codec_name(parameters.codec_id)),
        declared_frames: indexed.map(|(there, hidden)| there - hidden).or(declared),
        time_base,
        rate_hz,
        rate_origin,
        claims,
        converted_from: layout.converted_from(),
        size_bytes: std::fs::metadata(crate::name::path(name)).ok().filter(|m| m.is_file()).map(|m| m.len()),
        details,
        warnings,
    };
    Ok((info, orientation))
}

/// The unit of the stream's time stamps.
pub(super) fn stream_base(demuxer: &Demuxer) -> TimeBase {
    let (numerator, denominator) = positive(demuxer.stream().time_base).unwrap_or((1, 1_000_000));
    TimeBase { numerator, denominator }
}

/// Ticks from frame to frame by the rate that the container claims, at least 1.
pub(super) fn step(demuxer: &Demuxer) -> f64 {
    let base = demuxer.stream().time_base;
    let ticks = demuxer
        .rate()
        .map_or(1.0, |r| f64::from(base.den) * f64::from(r.den) / (f64::from(base.num) * f64::from(r.num)));
    // A base of 0 gives no number.
    if ticks.is_finite() { ticks.max(1.0) } else { 1.0 }
}

/// A fraction with both parts above 0.
fn positive(r: ffi::AVRational) -> Option<(u64, u64)> {
    Some((u64::try_from(r.num).ok().filter(|n| *n > 0)?, u64::try_from(r.den).ok().filter(|n| *n > 0)?))
}

/// Pixel format, profile's range and the like, for the user.
fn details(parameters: &ffi::AVCodecParameters, layout: &Layout) -> Vec<(String, String)> {
    let range = match parameters.color_range {
        ffi::AVColorRange::AVCOL_RANGE_MPEG => "limited",
        ffi::AVColorRange::AVCOL_RANGE_JPEG => "full",
        _ if layout.name.starts_with("yuvj") || layout.name.starts_with("gray") => "full",
        _ if layout.converted_from().is_some() => "full",
        _ => "not said",
    };
    vec![("pixel format".into(), layout.name.clone()), ("range".into(), range.into())]
}

fn size(parameters: &ffi::AVCodecParameters, name: &str) -> Result<(u32, u32)> {
    match (u32::try_from(parameters.width), u32::try_from(parameters.height)) {
        (Ok(w), Ok(h)) if w > 0 && h > 0 => Ok((w, h)),
        _ => Err(Error::Source(
            Fault::new(name, format!("a picture of {} x {} px", parameters.width, parameters.height))
                .of_kind(FaultKind::Damaged)
                .advice("Check that the file is complete and that `ffmpeg -i` reads it"),
        )),
    }
}

/// Width to height of a pixel of the turned picture, by the container or, where it does not say, by the codec.
fn aspect(demuxer: &Demuxer, orientation: Orientation, warnings: &mut Vec<Message>) -> PixelAspect {
    let [told, by_codec] = demuxer.pixel_aspect().map(|r| positive(r).unwrap_or((0, 0)));
    let aspect = PixelAspect::said(told.0, told.1, warnings);
    if let Some(other) = PixelAspect::new(by_codec.0, by_codec.1)
        && PixelAspect::new(told.0, told.1).is_some()
        && !other.agrees(aspect)
    {
        warnings.push(
            format!("the container says that pixels are {aspect} (width:height), the coded film {other}; the container's is taken")
                .into(),
        );
    }
    if orientation.transposed { aspect.turned() } else { aspect }
}

/// The turn of pictures that the container states.
fn turn(demuxer: &Demuxer, warnings: &mut Vec<Message>) -> Orientation {
    let mut size = 0usize;
    // SAFETY: the stream is valid, and the data it gives lives as long as the stream.
    let data = unsafe {
        ffi::av_stream_get_side_data(
            demuxer.stream(),
            ffi::AVPacketSideDataType::AV_PKT_DATA_DISPLAYMATRIX,
            (&raw mut size).cast(),
        )
    };
    if data.is_null() || size < 36 {
        return Orientation::default();
    }
    // SAFETY: a display matrix is nine 32-bit numbers; the size was checked, and reads may be unaligned.
    let at = |i: usize| unsafe { data.cast::<i32>().add(i).read_unaligned() };
    let orientation = Orientation::from_matrix(at(0), at(1), at(3), at(4));
    match orientation {
        Some(o) => {
            warnings.extend(o.warning());
            o
        }
        None => {
            warnings.push("the file asks for a turn that is not by a right angle; it is not turned".into());
            Orientation::default()
        }
    }
}
