//! Tells interlaced film: which packets hold one field of a picture only, and what is said of such film.
//!
//! Owns: [`Fields`], [`refusal`], [`warning`]. Must not: take a picture apart.

use std::path::Path;
use std::ptr;

use ffmpeg_next::ffi;

use super::demux::{Demuxer, Packet};
use crate::error::{Error, Fault, FaultKind, Result};
use crate::frame::SourceInfo;
use crate::message::{Message, Setting};
use crate::name::{shell_word, text};
use crate::setting_words::Worded;
use crate::source::Interlaced;

/// Tells single fields from whole pictures, by the codec's own headers.
pub(super) struct Fields {
    parser: *mut ffi::AVCodecParserContext,
    context: *mut ffi::AVCodecContext,
    /// The packet before is a first field: this one.
    first: Option<ffi::AVPictureStructure>,
}

// SAFETY: parser and context are owned by this value alone and bound to no thread.
unsafe impl Send for Fields {}

impl Fields {
    /// For codecs whose packets may hold a field; `None` for all others and for progressive film.
    pub(super) fn of(demuxer: &Demuxer) -> Option<Self> {
        let parameters = demuxer.parameters();
        // Other decoders' parsers put both fields into one packet.
        let apart = parameters.codec_id == ffi::AVCodecID::AV_CODEC_ID_H264;
        if !apart || parameters.field_order == ffi::AVFieldOrder::AV_FIELD_PROGRESSIVE {
            return None;
        }
        // SAFETY: allocations, checked for null; a context without a codec only carries parameters to the parser.
        let (parser, context) = unsafe {
            (ffi::av_parser_init(parameters.codec_id as i32), ffi::avcodec_alloc_context3(ptr::null()))
        };
        let fields = Self { parser, context, first: None };
        if parser.is_null() || context.is_null() {
            return None;
        }
        // SAFETY: both are valid; parameters live during the call; the flag is a plain field.
        let code = unsafe {
            (*parser).flags |= ffi::PARSER_FLAG_COMPLETE_FRAMES;
            ffi::avcodec_parameters_to_context(context, parameters)
        };
        (code >= 0).then_some(fields)
    }

    /// Whether a packet is the second field of the picture that the packet before it began.
    pub(super) fn is_second(&mut self, packet: &Packet) -> bool {
        use ffi::AVPictureStructure::{AV_PICTURE_STRUCTURE_BOTTOM_FIELD, AV_PICTURE_STRUCTURE_TOP_FIELD};
        let fields = packet.get();
        let (mut out, mut size) = (ptr::null_mut(), 0);
        // SAFETY: parser, context and packet are valid; a packet's data is followed by the padding that parsers
        // need; what the parser puts out points into the packet and is not used.
        let structure = unsafe {
            ffi::av_parser_parse2(
                self.parser,
                self.context,
                &mut out,
                &mut size,
                fields.data,
                fields.size,
                fields.pts,
                fields.dts,
                fields.pos,
            );
            (*self.parser).picture_structure
        };
        let is_field =
            matches!(structure, AV_PICTURE_STRUCTURE_TOP_FIELD | AV_PICTURE_STRUCTURE_BOTTOM_FIELD);
        let second = is_field && self.first.is_some_and(|first| first != structure);
        self.first = (is_field && !second).then_some(structure);
        second
    }
}

impl Drop for Fields {
    fn drop(&mut self) {
        // SAFETY: each was allocated once or is null, which both calls allow, and is freed once.
        unsafe {
            ffi::av_parser_close(self.parser);
            ffi::avcodec_free_context(&mut self.context);
        }
    }
}

/// The field of a picture that was filmed first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FieldOrder {
    /// The one with the top line.
    Top,
    /// The other.
    Bottom,
}

impl FieldOrder {
    /// As the container says; `None` if it says that film is progressive, or nothing.
    pub(super) fn said(order: ffi::AVFieldOrder) -> Option<Self> {
        use ffi::AVFieldOrder::{AV_FIELD_BB, AV_FIELD_BT, AV_FIELD_TB, AV_FIELD_TT};
        match order {
            // What files say with these agrees with what their pictures say (tried: H.264, ProRes, DV, FFV1).
            AV_FIELD_TT | AV_FIELD_TB => Some(Self::Top),
            AV_FIELD_BB | AV_FIELD_BT => Some(Self::Bottom),
            _ => None,
        }
    }

    /// As a decoded picture says.
    pub(super) fn of(picture: &ffi::AVFrame) -> Option<Self> {
        (picture.interlaced_frame != 0).then_some(if picture.top_field_first != 0 {
            Self::Top
        } else {
            Self::Bottom
        })
    }

    /// In words.
    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Top => "top field first",
            Self::Bottom => "bottom field first",
        }
    }
}

/// The command that makes a picture of each field.
fn command(name: &str) -> String {
    let is_address = name.contains("://");
    let file = if is_address { name.rsplit('/').next().unwrap_or_default() } else { name };
    let stem = text(Path::new(file).with_extension(""));
    // Standard input and an address name no file beside which the other could be.
    let stem = if ["", "-"].contains(&stem.as_str()) { "film" } else { &stem };
    // What is before a colon would be a protocol, and what begins with a hyphen an option.
    let protocol = |file: &str| if file.contains(':') || file.starts_with('-') { "file:" } else { "" };
    let input = if is_address { "" } else { protocol(name) };
    format!(
        "ffmpeg -i {} -vf bwdif=mode=send_field:deint=all -c:v ffv1 {}",
        if name == "-" { name.to_owned() } else { shell_word(&format!("{input}{name}")) },
        shell_word(&format!("{}{stem}-fields.mkv", protocol(stem)))
    )
}

/// The error for interlaced film, which is not read unasked.
pub(super) fn refusal(name: &str, order: FieldOrder) -> Error {
    Error::Source(
        Fault::new(
            name,
            format!(
                "the film is interlaced ({}): each picture holds two fields, filmed one after the other, and a marker that \
                 moves is in two places",
                order.words()
            ),
        )
        .of_kind(FaultKind::Unsupported)
        .advice(
            Message::from(format!(
                "Make a picture of each field, at twice the rate, with `{}`. If the camera filmed whole pictures and only the \
                 file says interlaced, read it as it is with ",
                command(name)
            )) + Setting::Interlaced.set_to(Interlaced::AsFrames.word()),
        ),
    )
}

/// Refuses interlaced pictures, or tells of them where they are to be taken as they are.
///
/// # Errors
/// [`Error::Source`] with the command that makes a picture of each field.
pub(super) fn tell(
    order: Option<FieldOrder>,
    name: &str,
    interlaced: Interlaced,
    info: &mut SourceInfo,
) -> Result<()> {
    let Some(order) = order else { return Ok(()) };
    match interlaced {
        Interlaced::Refuse => Err(refusal(name, order)),
        Interlaced::AsFrames => {
            info.details.push(("fields".into(), format!("interlaced, {}", order.words())));
            info.warnings.push(warning(name, order));
            Ok(())
        }
    }
}

/// The warning of interlaced film that is read as it is.
fn warning(name: &str, order: FieldOrder) -> Message {
    format!(
        "interlaced, {}: its pictures are read whole, as if both fields were filmed at once. If they were not, a marker \
         that moves is in two places; then make a picture of each field with `{}`",
        order.words(),
        command(name)
    )
    .into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_names_files_that_look_like_protocols_or_options() {
        let names =
            |name: &str| command(name).replace(" -vf bwdif=mode=send_field:deint=all -c:v ffv1 ", " | ");
        assert_eq!(names("i.ts"), "ffmpeg -i i.ts | i-fields.mkv");
        assert_eq!(names("a.b/i"), "ffmpeg -i a.b/i | a.b/i-fields.mkv");
        assert_eq!(names("-"), "ffmpeg -i - | film-fields.mkv");
        assert_eq!(names("http://lab:80/a/i.ts"), "ffmpeg -i http://lab:80/a/i.ts | i-fields.mkv");
        assert_eq!(names("12:30 i.ts"), "ffmpeg -i 'file:12:30 i.ts' | 'file:12:30 i-fields.mkv'");
        assert_eq!(names("-i.ts"), "ffmpeg -i file:-i.ts | file:-i-fields.mkv");
        assert_eq!(names("a'b $c.ts"), "ffmpeg -i 'a'\\''b $c.ts' | 'a'\\''b $c-fields.mkv'");
    }
}
