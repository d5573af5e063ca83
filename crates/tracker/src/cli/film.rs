//! The subcommand `film`: a scene in, a film and its truth out.

use std::path::{Path, PathBuf};

use crate::csv_text::Cells;
use crate::error::Error;
use crate::output;
use crate::pipeline::{Observer, Stage};
use crate::synth::encode::Codec;
use crate::synth::{
    Film, MECHANISMS, MotionTable, PRESETS, Scene, View, WriteOptions, film_files, preset, write,
};
use clap::builder::PossibleValuesParser;

use super::print;
use super::reading::word;
use super::watch::Watch;

/// Make a film of markers on links, with its truth: to try a marker layout, a light and a frame rate before the rig
/// is built, or to test a tracker.
///
/// The ending of OUTPUT decides what is written: .mp4 .mov .mkv .avi (video), .mraw (Photron, with its .cih), .tif
/// (pages), .y4m (or - for standard output), frames/%05d.png (.tif, .bmp: numbered images).
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The scene, TOML.
    #[arg(required_unless_present = "preset", conflicts_with = "preset")]
    scene: Option<PathBuf>,
    /// A scene that comes with the program: clean, noisy, dim, glints, late, dropout, occluded, fast; triple, pairs,
    /// symmetric.
    #[arg(long, value_name = "NAME", value_parser = PossibleValuesParser::new(PRESETS.iter().chain(&MECHANISMS)))]
    preset: Option<String>,
    /// Where the film goes.
    #[arg(short, long, value_name = "OUTPUT", required_unless_present_any = ["print_scene", "rig"])]
    output: Option<PathBuf>,
    /// Where the truth goes: .parquet or .csv, a row per frame and marker.
    #[arg(long, value_name = "TABLE", requires = "output")]
    truth: Option<PathBuf>,
    /// Where the rig goes, as a perfect `pydpend setup` would find it in frame 0.
    #[arg(long, value_name = "RIG.toml")]
    rig: Option<PathBuf>,
    /// Print the scene as TOML, with all that was left out filled in; edit it and film it.
    #[arg(long)]
    print_scene: bool,
    /// Angles of the links over time, .csv or .parquet with time_s, phi1_rad, phi2_rad, ...
    #[arg(long, value_name = "TABLE")]
    motion: Option<PathBuf>,
    /// Seed of noise, glints and random motion; replaces the scene's.
    #[arg(long)]
    seed: Option<u64>,
    /// Number of frames; replaces the scene's.
    #[arg(long, alias = "frames", value_name = "N")]
    frame_count: Option<u64>,
    /// Frames per second; replaces the scene's.
    #[arg(long, value_name = "F")]
    fps: Option<f64>,
    /// Angle by which the camera is off facing the links squarely, deg; replaces the scene's.
    #[arg(long, value_name = "DEG")]
    tilt: Option<f64>,
    /// Where in the picture the links then come nearer, deg from right towards down; replaces the scene's.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    towards: Option<f64>,
    /// Part by which the lens moves the picture's corners outwards; below 0 is a barrel; replaces the scene's.
    #[arg(long, value_name = "K", allow_negative_numbers = true)]
    k1: Option<f64>,
    /// Height of a pixel in widths; replaces the scene's. The film says so beyond a hundredth.
    #[arg(long, value_name = "H")]
    pixel_height: Option<f64>,
    /// Codec of a video file: h264 (small, lossy, plays everywhere), ffv1 (without loss, 8 to 16 bit), mjpeg (pictures,
    /// lossy) or raw (uncompressed); by the ending if not given.
    #[arg(long, value_parser = word::<Codec>(), requires = "output")]
    codec: Option<Codec>,
    /// H.264: constant rate factor, 0 (no loss) to 51; MJPEG: 1 (best) to 31.
    #[arg(long, value_name = "Q", requires = "output")]
    quality: Option<u32>,
    /// H.264: x264's preset, e.g. ultrafast, medium, veryslow.
    #[arg(long, alias = "speed", value_name = "PRESET", requires = "output")]
    x264_preset: Option<String>,
    /// H.264: no colour planes; smaller, but not every player shows it.
    #[arg(long, alias = "gray", requires = "output")]
    gray_only: bool,
    /// Bits per pixel of an .mraw: 8, 10, 12 or 16.
    #[arg(long, requires = "output")]
    bits: Option<u32>,
    /// In a CSV of the truth put a ' before names that a spreadsheet would take for a formula.
    #[arg(long)]
    safe_csv: bool,
    /// Replace files that are there already.
    #[arg(long)]
    force: bool,
    /// No progress bar.
    #[arg(short, long)]
    quiet: bool,
}

impl Args {
    fn scene(&self) -> anyhow::Result<Scene> {
        let mut scene = match (&self.scene, &self.preset) {
            (Some(path), _) => Scene::read(path)?,
            (None, Some(name)) => preset(name, self.seed.unwrap_or(0))?,
            (None, None) => anyhow::bail!("a scene is missing. Give one, or --preset"),
        };
        scene.seed = self.seed.unwrap_or(scene.seed);
        scene.frames = self.frame_count.unwrap_or(scene.frames);
        scene.rate_hz = self.fps.unwrap_or(scene.rate_hz);
        if self.tilt.or(self.towards).or(self.k1).or(self.pixel_height).is_some() {
            let view = scene.camera.view.unwrap_or_default();
            scene.camera.view = Some(View {
                tilt_deg: self.tilt.unwrap_or(view.tilt_deg),
                towards_deg: self.towards.unwrap_or(view.towards_deg),
                k1: self.k1.unwrap_or(view.k1),
                pixel_height: self.pixel_height.unwrap_or(view.pixel_height),
                ..view
            });
        }
        Ok(scene)
    }
}

/// Makes the film.
pub fn run(args: Args) -> anyhow::Result<u8> {
    let scene = args.scene()?;
    if args.print_scene {
        print::lines(&scene.to_toml()?)?;
    }
    let film = match &args.motion {
        Some(path) => Film::with_motion(&scene, &MotionTable::read(path)?)?,
        None => Film::new(&scene)?,
    };
    let reads: Vec<PathBuf> = args.scene.iter().chain(&args.motion).cloned().collect();
    if let Some(path) = &args.rig {
        // The film is not there yet, so that the rig's name is none of its files'.
        let mut outputs = vec![path.clone()];
        outputs.extend(args.output.iter().flat_map(|o| film_files(&film, o)).chain(args.truth.clone()));
        output::check(&outputs, &reads, args.force).map_err(Error::Film)?;
    }
    if let Some(output) = &args.output {
        film_to(output, &film, &args, reads)?;
    }
    if let Some(path) = &args.rig {
        film.rig(0).write(path)?;
    }
    Ok(0)
}

/// Writes the film and its truth.
fn film_to(output: &Path, film: &Film, args: &Args, reads: Vec<PathBuf>) -> anyhow::Result<()> {
    let options = WriteOptions {
        codec: args.codec,
        quality: args.quality,
        x264_preset: args.x264_preset.clone(),
        gray_only: args.gray_only,
        bits: args.bits,
        truth: args.truth.clone(),
        cells: if args.safe_csv { Cells::Safe } else { Cells::Plain },
        replace: args.force,
        reads,
    };
    let mut watch = Watch::without_end(args.quiet);
    watch.stage(Stage::Draw, Some(film.frames()));
    write(film, output, &options, &mut |done| {
        watch.progress(done);
        Ok(())
    })?;
    watch.finish();
    Ok(())
}
