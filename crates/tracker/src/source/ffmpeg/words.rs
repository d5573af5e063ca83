//! Names FFmpeg's errors and codecs in words.
//!
//! Owns: [`message`], [`codec_name`].

use std::ffi::CStr;

use ffmpeg_next::ffi;

/// FFmpeg's words for an error code.
pub(super) fn message(code: i32) -> String {
    // The binding knows FFmpeg's words only once it has been started; starting it again does nothing more.
    match ffmpeg_next::init() {
        Ok(()) => ffmpeg_next::Error::from(code).to_string(),
        Err(e) => format!("FFmpeg's error {code}; {e}"),
    }
}

/// FFmpeg's name of a codec.
pub(super) fn codec_name(id: ffi::AVCodecID) -> String {
    // SAFETY: the call gives a static string for any value.
    unsafe { CStr::from_ptr(ffi::avcodec_get_name(id)) }.to_string_lossy().into_owned()
}
