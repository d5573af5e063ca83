//! A film into a file, or into many.
//!
//! | name ends in | what is written |
//! |---|---|
//! | `.mp4` `.mov` `.mkv` `.avi` | video; H.264, but FFV1 in `.mkv` and uncompressed in `.avi` if not said otherwise |
//! | `.mraw` `.cih` | a Photron pair: 8, packed 10, packed 12 or 16 bit |
//! | `.png` `.tif` `.tiff` `.bmp` with `%05d` or the like in the name | one image per frame |
//! | `.tif` `.tiff` | one file with a page per frame |
//! | `.y4m` | uncompressed, for pipes; the name `-` writes it to standard output |

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use rayon::prelude::*;

use super::Film;
use super::camera_raw::MrawWriter;
use super::encode::{Codec, ImageKind, VideoSettings, VideoWriter, encode_image};
use super::truth_table::TruthWriter;
use super::write_options::{WriteOptions, codec_of, ending};
use crate::error::{Error, Fault, Place, Result};

/// What frames are written to.
enum Sink {
    Video(VideoWriter),
    Mraw(MrawWriter),
    Images { pattern: String, kind: ImageKind, next: u64 },
    Stack(Box<tiff::encoder::TiffEncoder<BufWriter<File>>>, String),
    Y4m(Box<dyn Write + Send>, String),
}

/// Writes all frames of a film, and its truth if asked for. `progress` is told the number of frames done, and stops
/// the work by giving an error.
///
/// # Errors
/// [`Error::Film`] if the name's ending is not known, the format cannot hold the film, or writing fails; what
/// `progress` gives.
pub fn write(
    film: &Film,
    path: &Path,
    options: &WriteOptions,
    progress: &mut dyn FnMut(u64) -> Result<()>,
) -> Result<()> {
    options.check(path)?;
    let mut truth = options.truth.as_deref().map(|p| TruthWriter::create(p, film)).transpose()?;
    let mut sink = Sink::create(film, path, options)?;
    let batch = 4 * threads::count() as u64;
    let mut first = 0;
    while first < film.frames() {
        let end = film.frames().min(first + batch);
        let with_truth = truth.is_some();
        let one = |i| {
            let mut samples = Vec::new();
            film.render(i, &mut samples);
            (samples, with_truth.then(|| film.truth(i)))
        };
        let made: Vec<_> = threads::install(|| (first..end).into_par_iter().map(one).collect());
        for (samples, true_frame) in &made {
            sink.write(film, samples)?;
            if let (Some(table), Some(t)) = (&mut truth, true_frame) {
                table.write(t)?;
            }
        }
        first = end;
        progress(end)?;
    }
    sink.finish()?;
    truth.map_or(Ok(()), TruthWriter::finish)
}

impl Sink {
    fn create(film: &Film, path: &Path, options: &WriteOptions) -> Result<Self> {
        let scene = film.scene();
        let name = path.display().to_string();
        let cannot = |e: std::io::Error| {
            Error::Film(
                Fault::new(&name, format!("it cannot be written ({e})"))
                    .advice("Check that the folder exists and may be written to"),
            )
        };
        if name == "-" {
            return y4m(film, Box::new(std::io::stdout()), "standard output".into());
        }
        let ending = ending(path);
        let kind = match ending.as_str() {
            "mp4" | "mov" | "mkv" | "avi" => {
                let codec = codec_of(path, options.codec).unwrap_or(Codec::H264);
                let [width, height] = scene.image_px;
                return Ok(Self::Video(VideoWriter::create(
                    path,
                    &VideoSettings {
                        width,
                        height,
                        depth_bits: scene.camera.depth_bits,
                        time_base: film.time_base(),
                        codec,
                        quality: options.quality,
                        speed: options.speed.clone(),
                        gray_only: options.gray_only,
                    },
                )?));
            }
            "mraw" | "cih" => return Ok(Self::Mraw(MrawWriter::create(path, film, options.bits)?)),
            "y4m" => {
                let file = File::create(path).map_err(cannot)?;
                return y4m(film, Box::new(BufWriter::with_capacity(1 << 20, file)), name);
            }
            "png" => ImageKind::Png,
            "bmp" => ImageKind::Bmp,
            "tif" | "tiff" => ImageKind::Tiff,
            _ => {
                return Err(Error::Film(
                    Fault::new(&name, format!("no film is written to a file that ends in {ending:?}"))
                        .advice("Choose .mp4, .mov, .mkv, .avi, .mraw, .y4m, .tif, or images such as frames/%05d.png"),
                ));
            }
        };
        if numbered(&name, 0).is_some() {
            if let Some(folder) = path.parent() {
                std::fs::create_dir_all(folder).map_err(cannot)?;
            }
            return Ok(Self::Images { pattern: name, kind, next: 0 });
        }
        if kind == ImageKind::Tiff {
            let file = BufWriter::new(File::create(path).map_err(cannot)?);
            let encoder = tiff::encoder::TiffEncoder::new(file).map_err(|e| tiff_failed(&name, e))?;
            return Ok(Self::Stack(Box::new(encoder), name));
        }
        Err(Error::Film(
            Fault::new(&name, format!("one .{ending} holds one frame, not {}", film.frames()))
                .at(Place::Key("output".into()))
                .advice(format!("Number them, e.g. frames/%05d.{ending}")),
        ))
    }

    fn write(&mut self, film: &Film, samples: &[u8]) -> Result<()> {
        let [w, h] = film.scene().image_px;
        let depth = film.scene().camera.depth_bits;
        match self {
            Self::Video(v) => v.write(samples),
            Self::Mraw(m) => m.write(samples),
            Self::Images { pattern, kind, next } => {
                let name = numbered(pattern, *next).unwrap_or_default();
                *next += 1;
                let bytes = encode_image(&name, *kind, w, h, depth, samples)?;
                std::fs::write(&name, bytes)
                    .map_err(|e| Error::Film(Fault::new(&name, format!("it cannot be written ({e})"))))
            }
            Self::Stack(encoder, name) => {
                use tiff::encoder::colortype::{Gray8, Gray16};
                if depth > 8 {
                    let wide: Vec<u16> =
                        samples.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect();
                    encoder.write_image::<Gray16>(w, h, &wide).map_err(|e| tiff_failed(name, e))
                } else {
                    encoder.write_image::<Gray8>(w, h, samples).map_err(|e| tiff_failed(name, e))
                }
            }
            Self::Y4m(out, name) => out
                .write_all(b"FRAME\n")
                .and_then(|()| out.write_all(samples))
                .map_err(|e| Error::Film(Fault::new(&*name, format!("writing failed ({e})")))),
        }
    }

    fn finish(self) -> Result<()> {
        match self {
            Self::Video(v) => v.finish(),
            Self::Mraw(m) => m.finish(),
            Self::Y4m(mut out, name) => {
                out.flush().map_err(|e| Error::Film(Fault::new(name, format!("writing failed ({e})"))))
            }
            Self::Images { .. } | Self::Stack(..) => Ok(()),
        }
    }
}

fn tiff_failed(name: &str, e: tiff::TiffError) -> Error {
    Error::Film(Fault::new(name, format!("writing failed ({e})")))
}

fn y4m(film: &Film, mut out: Box<dyn Write + Send>, name: String) -> Result<Sink> {
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
        "YUV4MPEG2 W{w} H{h} F{}:{} Ip A1:1 C{colour} XCOLORRANGE=FULL",
        base.denominator, base.numerator
    )
    .map_err(|e| Error::Film(Fault::new(&name, format!("writing failed ({e})"))))?;
    Ok(Sink::Y4m(out, name))
}

/// The name of image `index` if `pattern` has one `%d`, `%5d` or `%05d` in it.
fn numbered(pattern: &str, index: u64) -> Option<String> {
    let (before, rest) = pattern.split_once('%')?;
    let end = rest.find('d')?;
    let digits = &rest[..end];
    if !digits.chars().all(|c| c.is_ascii_digit()) || rest[end..].contains('%') {
        return None;
    }
    let width: usize = if digits.is_empty() { 0 } else { digits.parse().ok().filter(|&w| w < 20)? };
    Some(format!("{before}{index:0width$}{}", &rest[end + 1..]))
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
