//! Whether damage to pixels is noticed, as `tracker info` says it of each codec: packets damaged one at a time.
//!
//! `DAMAGED=10 cargo test --release --workspace --locked --test source -- noticed --nocapture` damages that many of each film in
//! three ways and prints the table of docs/validation/robustness.md.

use std::path::Path;

use tracker::pixel_damage::{CODECS, FFV1_WITH_SUMS, PixelDamage};
use tracker::source::{Interlaced, OpenOptions, open};

use crate::codecs::{WAYS, damage, places};
use crate::film::{encode, have_ffmpeg, samples};

const COUNT: usize = 24;

/// Even sides, texture, colours for codecs that know nothing else.
const LARGER: &str = "scale=400x240:flags=neighbor,noise=alls=12:all_seed=1,format=yuv420p";

/// The name in the table, the file, the encoder and its options.
type Film = (&'static str, &'static str, &'static [&'static str]);

const FILMS: [Film; 60] = [
    ("apng", "a.apng", &["-c:v", "apng"]),
    ("asv1", "asv1.avi", &["-c:v", "asv1", "-q:v", "3"]),
    ("asv2", "asv2.avi", &["-c:v", "asv2", "-q:v", "3"]),
    ("av1", "a.mkv", &["-c:v", "libsvtav1", "-preset", "12", "-r", "50"]),
    ("avui", "avui.mov", &["-c:v", "avui", "-s", "720x576", "-strict", "-2"]),
    ("bmp", "bmp/f%03d.bmp", &["-pix_fmt", "gray"]),
    ("cfhd", "cfhd.mov", &["-c:v", "cfhd", "-pix_fmt", "yuv422p10"]),
    ("cinepak", "cinepak.avi", &["-c:v", "cinepak"]),
    ("cljr", "cljr.avi", &["-c:v", "cljr"]),
    ("dirac", "dirac.mkv", &["-c:v", "vc2"]),
    ("dnxhd", "dnx.mov", &["-c:v", "dnxhd", "-profile:v", "dnxhr_sq", "-pix_fmt", "yuv422p"]),
    ("dpx", "dpx.nut", &["-c:v", "dpx", "-pix_fmt", "gray"]),
    ("dvvideo", "dv.mov", &["-c:v", "dvvideo", "-s", "720x576", "-r", "25"]),
    ("ffv1", "one.mkv", &["-c:v", "ffv1", "-level", "1", "-pix_fmt", "gray"]),
    ("ffv1", "none.avi", &["-c:v", "ffv1", "-level", "0"]),
    (FFV1_WITH_SUMS, "three.mkv", &["-c:v", "ffv1", "-level", "3", "-slicecrc", "1"]),
    ("ffvhuff", "ffvhuff.avi", &["-c:v", "ffvhuff"]),
    ("flashsv2", "flashsv2.flv", &["-c:v", "flashsv2"]),
    ("flv1", "flv1.flv", &["-c:v", "flv", "-q:v", "3"]),
    ("gif", "g.gif", &["-r", "50"]),
    ("h261", "h261.avi", &["-c:v", "h261", "-s", "352x288"]),
    ("h264", "h264.mkv", &["-c:v", "libx264", "-g", "10"]),
    ("hap", "hap.mov", &["-c:v", "hap"]),
    ("hevc", "hevc.mkv", &["-c:v", "libx265", "-g", "10", "-x265-params", "log-level=error"]),
    ("huffyuv", "huffyuv.avi", &["-c:v", "huffyuv", "-pix_fmt", "yuv422p"]),
    ("jpeg2000", "j2k.mov", &["-c:v", "jpeg2000"]),
    ("jpegls", "ls.avi", &["-c:v", "jpegls", "-pix_fmt", "gray"]),
    ("jpg", "jpg/f%03d.jpg", &["-q:v", "2"]),
    ("magicyuv", "magicyuv.mkv", &["-c:v", "magicyuv"]),
    ("mjpeg", "mjpeg.avi", &["-c:v", "mjpeg", "-q:v", "2", "-pix_fmt", "yuvj420p"]),
    ("mpeg2video", "mpeg2.mkv", &["-c:v", "mpeg2video", "-r", "50", "-q:v", "3"]),
    ("mpeg4", "mpeg4.mp4", &["-c:v", "mpeg4", "-q:v", "3"]),
    ("msmpeg4v2", "msmpeg4v2.avi", &["-c:v", "msmpeg4v2", "-q:v", "3"]),
    ("msvideo1", "msvideo1.avi", &["-c:v", "msvideo1"]),
    ("pgm", "pgm/f%03d.pgm", &["-pix_fmt", "gray"]),
    ("png", "png/f%03d.png", &["-pix_fmt", "gray"]),
    ("png", "png.mov", &["-c:v", "png"]),
    ("prores", "prores.mov", &["-c:v", "prores_ks"]),
    ("qtrle", "qtrle.mov", &["-c:v", "qtrle"]),
    ("r10k", "r10k.mov", &["-c:v", "r10k"]),
    ("r210", "r210.mov", &["-c:v", "r210"]),
    ("rawvideo", "raw.avi", &["-c:v", "rawvideo"]),
    ("rv10", "rv10.rm", &["-c:v", "rv10"]),
    ("rv20", "rv20.rm", &["-c:v", "rv20"]),
    ("sgi", "sgi.mov", &["-c:v", "sgi"]),
    ("smc", "smc.mov", &["-c:v", "smc", "-pix_fmt", "pal8"]),
    ("speedhq", "speedhq.avi", &["-c:v", "speedhq", "-q:v", "3"]),
    ("theora", "theora.ogv", &["-c:v", "libtheora", "-q:v", "7"]),
    ("tif", "tif/f%03d.tif", &["-pix_fmt", "gray", "-compression_algo", "raw"]),
    ("utvideo", "utvideo.avi", &["-c:v", "utvideo"]),
    ("v210", "v210.mov", &["-c:v", "v210"]),
    ("v308", "v308.mov", &["-c:v", "v308"]),
    ("v408", "v408.mov", &["-c:v", "v408"]),
    ("v410", "v410.mov", &["-c:v", "v410"]),
    ("vp8", "vp8.webm", &["-c:v", "libvpx", "-b:v", "2M"]),
    ("vp9", "vp9.webm", &["-c:v", "libvpx-vp9", "-b:v", "2M", "-cpu-used", "8", "-deadline", "realtime"]),
    ("wmv2", "wmv2.avi", &["-c:v", "wmv2", "-q:v", "3"]),
    ("y41p", "y41p.avi", &["-c:v", "y41p"]),
    ("yuv4", "yuv4.mov", &["-c:v", "yuv4"]),
    ("zlib", "zlib.avi", &["-c:v", "zlib"]),
];

/// Pictures and words that come out of a recording.
struct Out {
    /// All pictures, `None` for each that is left out.
    pictures: Vec<Option<Vec<u32>>>,
    is_whole: bool,
    said: PixelDamage,
}

/// Reads a recording; `None` if it is refused.
fn film(path: &Path, fps: f64) -> Option<Out> {
    let options = OpenOptions { fps: Some(fps), interlaced: Interlaced::AsFrames, ..OpenOptions::default() };
    let mut source = open(path.to_str().unwrap(), &options).ok()?;
    let said = source.info().pixel_damage;
    let mut pictures = Vec::new();
    // Damage may end the reading, too.
    while let Some(frame) = source.next_frame().ok()? {
        pictures.push(samples(&frame));
    }
    let is_whole = pictures.iter().all(Option::is_some)
        && source.ending() == tracker::frame::Ending::Complete
        && !source.gaps().is_damage();
    Some(Out { pictures, is_whole, said })
}

#[test]
fn what_is_said_of_damage_to_pixels_is_so() {
    if !have_ffmpeg() {
        return;
    }
    let each: usize = std::env::var("DAMAGED").ok().and_then(|n| n.parse().ok()).unwrap_or(1);
    println!("| codec | {} | `tracker info` says |\n|---|---|---|---|---|", WAYS.join(" | "));
    for (name, file, options) in FILMS {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join(file).parent().unwrap()).unwrap();
        let path = encode(folder.path(), file, COUNT, &[&["-vf", LARGER], options].concat());
        let Out { pictures: truth, is_whole, said } = film(&path, 50.0).unwrap();
        assert!(is_whole && truth.len() > 2, "{name}, {file}");
        assert_eq!(said, PixelDamage::of(name), "{name}, {file}");
        let places = places(&path);
        let (mut cells, mut told_of_all, mut tried) = (Vec::new(), 0, 0);
        for way in WAYS {
            let mut told = 0;
            for k in 0..each {
                let (file, at, size) = &places[1 + k * (places.len() - 2) / each];
                let whole = std::fs::read(file).unwrap();
                let mut bytes = whole.clone();
                damage(&mut bytes, *at, *size, way, k as u32);
                std::fs::write(file, &bytes).unwrap();
                // A bit that changes no pixel harms nothing.
                told +=
                    usize::from(film(&path, 50.0).is_none_or(|out| !out.is_whole || out.pictures == truth));
                std::fs::write(file, &whole).unwrap();
            }
            (told_of_all, tried) = (told_of_all + told, tried + each);
            cells.push(format!("{told} of {each}"));
        }
        println!("| {name} | {} | {} |", cells.join(" | "), said.words());
        match said {
            PixelDamage::Noticed => assert_eq!(told_of_all, tried, "{name}, {file}: {cells:?}"),
            PixelDamage::Unnoticed => assert!(told_of_all < tried, "{name}, {file}: {cells:?}"),
            PixelDamage::Partly | PixelDamage::Unknown => {}
        }
    }
}

#[test]
fn the_table_of_the_docs_is_that_of_the_program() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/validation/robustness.md");
    let text = std::fs::read_to_string(docs).unwrap();
    for said in [PixelDamage::Noticed, PixelDamage::Partly, PixelDamage::Unnoticed] {
        let line = text.lines().find(|l| l.starts_with(&format!("| {} |", said.words()))).unwrap();
        let listed: Vec<&str> = line.split('`').skip(1).step_by(2).collect();
        let known: Vec<&str> = CODECS.iter().filter(|(_, s)| *s == said).map(|(name, _)| *name).collect();
        assert_eq!(listed, known, "{}", said.words());
    }
    assert_eq!(PixelDamage::of("a codec of tomorrow"), PixelDamage::Unknown);
}
