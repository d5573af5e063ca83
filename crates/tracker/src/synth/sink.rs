//! Writes frames to the file or files of a film, whose form the ending of the name says.
//!
//! Owns: [`Sink`], [`files`]. Must not: make frames.

use std::collections::HashSet;
use std::ffi::OsStr;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use super::camera_raw::{MrawWriter, pair};
use super::encode::{Codec, ImageKind, VideoSettings, VideoWriter, cannot_write, encode_image};
use super::film::Film;
use super::write_options::{WriteOptions, codec_of, ending};
use crate::error::{Error, Fault, FaultKind, Place, Result};
use crate::name::{self, text};
use crate::output::{self, NewFile};

/// Pictures that are named where there are too many.
const SHOWN: usize = 3;

type Pages = tiff::encoder::TiffEncoder<BufWriter<File>>;

/// Target of the frames that are written.
pub(super) enum Sink {
    Video(VideoWriter),
    Mraw(MrawWriter),
    Images { pattern: String, kind: ImageKind, next: u64 },
    Stack(Box<Pages>, NewFile, String),
    Y4m(Box<dyn Write + Send>, Option<NewFile>, String),
}

fn image_kind(ending: &str) -> Option<ImageKind> {
    match ending {
        "png" => Some(ImageKind::Png),
        "bmp" => Some(ImageKind::Bmp),
        "tif" | "tiff" => Some(ImageKind::Tiff),
        _ => None,
    }
}

/// The files that a film at `path` is made of; none for standard output.
pub fn files(film: &Film, path: &Path) -> Vec<PathBuf> {
    let pattern = text(path);
    match ending(path).as_str() {
        _ if pattern == "-" => Vec::new(),
        "mraw" | "cih" => pair(path).to_vec(),
        ending if image_kind(ending).is_some() && numbered(&pattern, 0).is_some() => {
            (0..film.frames()).filter_map(|i| numbered(&pattern, i)).map(|n| name::path(&n)).collect()
        }
        _ => vec![path.to_owned()],
    }
}

/// Refuses pictures beside those of a film at `path` that whoever reads the folder or the pattern would take for more of its
/// frames: those of a longer film that was there before. Nothing is taken away, as nothing tells whose they are.
pub(super) fn check_folder(film: &Film, path: &Path) -> Result<()> {
    let own: Vec<PathBuf> = files(film, path);
    let file_name = path.file_name().map(text).unwrap_or_default();
    let Some((head, _, tail)) = split(&file_name).filter(|_| image_kind(&ending(path)).is_some()) else {
        return Ok(());
    };
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // A folder that is not there is made.
    let Ok(entries) = std::fs::read_dir(folder) else { return Ok(()) };
    let own: HashSet<&OsStr> = own.iter().filter_map(|p| p.file_name()).collect();
    let is_number = |n: &str| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit());
    let mut others: Vec<String> = entries
        .flatten()
        .filter(|e| !own.contains(e.file_name().as_os_str()) && e.path().is_file())
        .map(|e| text(e.file_name()))
        .filter(|n| n.strip_prefix(head).and_then(|n| n.strip_suffix(tail)).is_some_and(is_number))
        .collect();
    if others.is_empty() {
        return Ok(());
    }
    others.sort();
    let some = others.iter().take(SHOWN).cloned().collect::<Vec<_>>().join(", ");
    let more = if others.len() > SHOWN { ", ..." } else { "" };
    Err(Error::Film(
        Fault::new(
            text(path),
            format!(
                "{} pictures there are not this film's and would be taken for its frames ({some}{more})",
                others.len()
            ),
        )
        .of_kind(FaultKind::Exists)
        .advice("Remove them, or choose a new folder"),
    ))
}

impl Sink {
    pub(super) fn create(film: &Film, path: &Path, options: &WriteOptions) -> Result<Self> {
        let name = text(path);
        let cannot = |e: std::io::Error| cannot_write(&name, &e);
        if name == "-" {
            let out = Box::new(std::io::stdout());
            return y4m_head(film, out, "standard output").map(|out| Self::Y4m(out, None, name));
        }
        let ending = ending(path);
        check_aspect(film, &name, &ending)?;
        match ending.as_str() {
            "mp4" | "mov" | "mkv" | "avi" => return video(film, path, options).map(Self::Video),
            "mraw" | "cih" => return Ok(Self::Mraw(MrawWriter::create(path, film, options.bits)?)),
            "y4m" => {
                let new = NewFile::create(path).map_err(cannot)?;
                let file = new.file().try_clone().map_err(cannot)?;
                let out = y4m_head(film, Box::new(BufWriter::with_capacity(1 << 20, file)), &name)?;
                return Ok(Self::Y4m(out, Some(new), name));
            }
            _ => {}
        }
        let Some(kind) = image_kind(&ending) else {
            return Err(Error::Film(
                Fault::new(&name, format!("no film is written to a file that ends in {ending:?}"))
                    .of_kind(FaultKind::Unsupported)
                    .advice(
                        "Choose .mp4, .mov, .mkv, .avi, .mraw, .y4m, .tif, or images such as frames/%05d.png",
                    ),
            ));
        };
        if numbered(&name, 0).is_some() {
            if let Some(folder) = path.parent() {
                std::fs::create_dir_all(folder).map_err(cannot)?;
            }
            return Ok(Self::Images { pattern: name, kind, next: 0 });
        }
        if kind == ImageKind::Tiff {
            let new = NewFile::create(path).map_err(cannot)?;
            let file = BufWriter::new(new.file().try_clone().map_err(cannot)?);
            let encoder = tiff::encoder::TiffEncoder::new(file).map_err(|e| failed(&name, e))?;
            return Ok(Self::Stack(Box::new(encoder), new, name));
        }
        Err(Error::Film(
            Fault::new(&name, format!("one .{ending} holds one frame, not {}", film.frames()))
                .at(Place::Key("output".into()))
                .advice(format!("Number them, e.g. frames/%05d.{ending}")),
        ))
    }

    pub(super) fn write(&mut self, film: &Film, samples: &[u8]) -> Result<()> {
        let [w, h] = film.scene().image_px;
        let depth = film.scene().camera.depth_bits;
        match self {
            Self::Video(v) => v.write(samples),
            Self::Mraw(m) => m.write(samples),
            Self::Images { pattern, kind, next } => {
                let file = numbered(pattern, *next).unwrap_or_default();
                *next += 1;
                let bytes = encode_image(&file, *kind, w, h, depth, samples)?;
                output::write(&name::path(&file), &bytes).map_err(|e| cannot_write(&file, &e))
            }
            Self::Stack(encoder, _, name) => {
                use tiff::encoder::colortype::{Gray8, Gray16};
                if depth > 8 {
                    let wide: Vec<u16> =
                        samples.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect();
                    encoder.write_image::<Gray16>(w, h, &wide).map_err(|e| failed(name, e))
                } else {
                    encoder.write_image::<Gray8>(w, h, samples).map_err(|e| failed(name, e))
                }
            }
            Self::Y4m(out, _, name) => {
                out.write_all(b"FRAME\n").and_then(|()| out.write_all(samples)).map_err(|e| failed(name, e))
            }
        }
    }

    /// Leaves no file, and does not wait for what is being encoded.
    pub(super) fn abandon(self) {
        if let Self::Video(v) = self {
            v.abandon();
        }
    }

    pub(super) fn finish(self) -> Result<()> {
        let publish = |new: NewFile, name: &str| new.publish(true).map_err(|e| cannot_write(name, &e));
        match self {
            Self::Video(v) => v.finish(),
            Self::Mraw(m) => m.finish(),
            Self::Y4m(mut out, new, name) => {
                out.flush().map_err(|e| failed(&name, e))?;
                new.map_or(Ok(()), |new| publish(new, &name))
            }
            Self::Stack(encoder, new, name) => {
                drop(encoder);
                publish(new, &name)
            }
            Self::Images { .. } => Ok(()),
        }
    }
}

fn failed(name: &str, e: impl std::fmt::Display) -> Error {
    Error::Film(Fault::new(name, format!("writing failed ({e})")))
}

fn video(film: &Film, path: &Path, options: &WriteOptions) -> Result<VideoWriter> {
    let scene = film.scene();
    let codec = codec_of(path, options.codec).unwrap_or(Codec::H264);
    let [width, height] = scene.image_px;
    VideoWriter::create(
        path,
        &VideoSettings {
            width,
            height,
            depth_bits: scene.camera.depth_bits,
            pixel_aspect: film.pixel_aspect(),
            time_base: film.time_base(),
            codec,
            quality: options.quality,
            x264_preset: options.x264_preset.clone(),
            gray_only: options.gray_only,
        },
    )
}

/// `out` with the head of a y4m film written.
fn y4m_head(film: &Film, mut out: Box<dyn Write + Send>, name: &str) -> Result<Box<dyn Write + Send>> {
    let [w, h] = film.scene().image_px;
    let base = film.time_base();
    let colour = match film.scene().camera.depth_bits {
        8 => "mono",
        9 => "mono9",
        10 => "mono10",
        11 | 12 => "mono12",
        _ => "mono16",
    };
    writeln!(
        out,
        "YUV4MPEG2 W{w} H{h} F{}:{} Ip A{} C{colour} XCOLORRANGE=FULL",
        base.denominator,
        base.numerator,
        film.pixel_aspect()
    )
    .map_err(|e| failed(name, e))?;
    Ok(out)
}

/// Refuses pixels that are not square in a form that cannot say so: its reader would take them for square ones.
fn check_aspect(film: &Film, name: &str, ending: &str) -> Result<()> {
    let aspect = film.pixel_aspect();
    if aspect.is_square() || ["mp4", "mov", "mkv", "avi", "y4m"].contains(&ending) {
        return Ok(());
    }
    Err(Error::Film(
        Fault::new(name, format!("a .{ending} written here cannot say that its {}", aspect.words()))
            .of_kind(FaultKind::Unsupported)
            .advice("Name it .mp4, .mov, .mkv, .avi or .y4m"),
    ))
}

/// A pattern with one `%d`, `%5d` or `%05d` in it: what is before and behind, and the number of digits.
fn split(pattern: &str) -> Option<(&str, usize, &str)> {
    let (before, rest) = pattern.split_once('%')?;
    let end = rest.find('d')?;
    let digits = &rest[..end];
    if !digits.chars().all(|c| c.is_ascii_digit()) || rest[end..].contains('%') {
        return None;
    }
    let width: usize = if digits.is_empty() { 0 } else { digits.parse().ok().filter(|&w| w < 20)? };
    Some((before, width, &rest[end + 1..]))
}

/// The name of image `index` of a pattern.
fn numbered(pattern: &str, index: u64) -> Option<String> {
    split(pattern).map(|(before, width, behind)| format!("{before}{index:0width$}{behind}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_numbered() {
        assert_eq!(numbered("a/%05d.png", 42).as_deref(), Some("a/00042.png"));
        assert_eq!(numbered("a%d.png", 7).as_deref(), Some("a7.png"));
        assert_eq!(numbered("a.png", 7), None);
        assert_eq!(numbered("a%s.png", 7), None);
        assert_eq!(numbered("100%.png", 7), None);
    }
}
