//! Lists which of FFmpeg's formats are opened, and names the others.
//!
//! Owns: [`READ`], [`not_read`], [`is_protocol`]. A format that is not listed is refused before its demuxer sees the file:
//! some open other files or addresses that the file names, and one takes any text for a film. Must not: open a demuxer.

use std::ffi::{CStr, CString};
use std::fs::File;
use std::io::Read;
use std::ptr;

use ffmpeg_next::ffi;

/// Films and streams of pictures that hold all of themselves, by the names of FFmpeg's demuxers. `docs/reference/recordings.md`
/// lists the same.
pub(crate) const READ: &str = concat!(
    // Containers.
    "mov,matroska,avi,asf,mpegts,mpeg,mxf,flv,ogg,nut,ivf,gxf,lxf,wtv,rm,dv,dhav,nsv,film_cpk,filmstrip,smjpeg,mpjpeg,",
    // Cameras.
    "cine,ser,",
    // Pictures one after another.
    "yuv4mpegpipe,gif,apng,mjpeg,mjpeg_2000,png_pipe,jpeg_pipe,bmp_pipe,tiff_pipe,pgm_pipe,ppm_pipe,pam_pipe,dpx_pipe,",
    "j2k_pipe,jpegls_pipe,jpegxl_pipe,webp_pipe,gif_pipe,qoi_pipe,sgi_pipe,",
    // Coded streams without a container.
    "h264,hevc,av1,obu,m4v,mpegvideo,vc1,h263,h261,dirac,cavsvideo,dnxhd,avs2",
);

/// Formats that may be opened at an address beside [`READ`], by someone who asked for it.
const READ_AT_ADDRESSES: &str = ",rtsp";

/// Formats that are nothing but a list of other files or addresses.
const LISTS: [&str; 9] =
    ["hls", "concat", "dash", "imf", "image2", "image2pipe", "sdp", "webm_dash_manifest", "alias_pix"];

/// Bytes by which a format is known; FFmpeg itself begins with 2 KiB.
const PROBED_BYTES: u64 = 64 << 10;

/// The list that FFmpeg's option `format_whitelist` takes.
pub(super) fn allowed(at_address: bool) -> String {
    READ.to_owned() + if at_address { READ_AT_ADDRESSES } else { "" }
}

/// The kind of the file at `url`, as a clause, if it is nothing that is read here; `None` if it may be, or cannot be read again
/// to find out.
pub(super) fn not_read(url: &str) -> Option<String> {
    let path = url.strip_prefix("file:")?;
    if !std::fs::metadata(path).ok()?.is_file() {
        return None;
    }
    let mut head = Vec::new();
    File::open(path).ok()?.take(PROBED_BYTES).read_to_end(&mut head).ok()?;
    let format = probe(url, &head);
    let (name, words) = format.as_ref().map_or(("", ""), |(name, words)| (name, words));
    if LISTS.iter().any(|l| name.split(',').any(|n| n == *l)) || names_others(&head) {
        return Some("a list of other files, not a recording".to_owned());
    }
    if is_text(&head) {
        let kind = if name.is_empty() || name == "tty" { String::new() } else { format!(" ({words})") };
        return Some(format!("text{kind}, not a recording"));
    }
    if name.is_empty() || READ.split(',').any(|r| name.split(',').any(|n| n == r)) {
        return None;
    }
    Some(format!("not a film but what FFmpeg calls \"{words}\", which is not read"))
}

/// Short names and long name of the format that FFmpeg would take bytes for.
fn probe(url: &str, head: &[u8]) -> Option<(String, String)> {
    let mut bytes = head.to_vec();
    bytes.resize(head.len() + ffi::AVPROBE_PADDING_SIZE as usize, 0);
    let name = CString::new(url).ok()?;
    let data = ffi::AVProbeData {
        filename: name.as_ptr(),
        buf: bytes.as_mut_ptr(),
        buf_size: i32::try_from(head.len()).ok()?,
        mime_type: ptr::null(),
    };
    let mut score = 0;
    // SAFETY: the bytes are followed by the zeros that the call asks for; name and bytes outlive it.
    let format = unsafe { ffi::av_probe_input_format3(&data, 1, &mut score).as_ref() }?;
    // By no more than its ending, a name tells nothing of what is in the file.
    if score <= ffi::AVPROBE_SCORE_EXTENSION {
        return None;
    }
    let text = |p: *const std::ffi::c_char| {
        // SAFETY: a format's names are static strings; the long one may be missing.
        (!p.is_null()).then(|| unsafe { CStr::from_ptr(p) }.to_string_lossy().into_owned())
    };
    let name = text(format.name)?;
    let words = text(format.long_name).unwrap_or_else(|| name.clone());
    Some((name, words))
}

/// Whether bytes begin as a list of other files does.
fn names_others(head: &[u8]) -> bool {
    let text = String::from_utf8_lossy(&head[..head.len().min(4096)]);
    let text = text.trim_start_matches(['\u{feff}', ' ', '\r', '\n', '\t']);
    let lower = text.to_ascii_lowercase();
    ["#extm3u", "ffconcat", "[playlist]", "[reference]", "<asx", "<smil"].iter().any(|s| lower.starts_with(s))
        || lower.starts_with("<?xml")
            && ["<mpd", "<assetmap", "<compositionplaylist", "<playlist", "<smil"]
                .iter()
                .any(|s| lower.contains(s))
        || lower.starts_with("v=0") && lower.contains("\nm=")
}

/// Whether bytes are text: in UTF-8, or in an encoding with single bytes, without control characters.
fn is_text(head: &[u8]) -> bool {
    let control = |b: &u8| *b < 32 && !matches!(*b, b'\t' | b'\n' | b'\r' | 0x0c | 0x1b) || *b == 127;
    // Longer than the text headers of pictures and of Y4M, behind which samples come.
    !head.is_empty() && !head.iter().any(control) && !head.starts_with(b"YUV4MPEG2") && !is_netpbm(head)
}

fn is_netpbm(head: &[u8]) -> bool {
    matches!(head, [b'P', b'1'..=b'7', space, ..] if space.is_ascii_whitespace())
}

/// Whether a name begins with one of FFmpeg's protocols, other than that for files.
pub(crate) fn is_protocol(name: &str) -> bool {
    let Ok(name) = CString::new(name) else { return false };
    // SAFETY: the call reads the name and gives a static string or null.
    let protocol = unsafe { ffi::avio_find_protocol_name(name.as_ptr()) };
    // SAFETY: as above.
    !protocol.is_null() && unsafe { CStr::from_ptr(protocol) } != c"file"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_documentation_lists_what_is_opened() {
        let page = include_str!("../../../../../docs/reference/recordings.md");
        let films = page.split("## Films").nth(1).unwrap();
        let listed =
            |row: &str| row.split('`').skip(1).step_by(2).map(str::to_owned).collect::<Vec<String>>();
        let rows = films.lines().filter(|l| l.starts_with("| ") && l.contains('`'));
        let mut told: Vec<String> = rows.flat_map(listed).collect();
        let mut read: Vec<&str> = READ.split(',').collect();
        told.sort();
        read.sort_unstable();
        assert_eq!(told, read);
    }

    #[test]
    fn every_format_is_one_of_ffmpegs() {
        for name in READ.split(',') {
            let text = CString::new(name).unwrap();
            // SAFETY: a look-up by name; null for an unknown one.
            let format = unsafe { ffi::av_find_input_format(text.as_ptr()) };
            assert!(!format.is_null(), "{name}");
        }
    }
}
