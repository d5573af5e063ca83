//! Defines the scene: camera, light, links, markers and mishaps; and the TOML form of it.
//!
//! Owns: [`Scene`] and what makes one valid. Must not: move or draw anything.
//!
//! A link has coordinates of its own: `along` from its joint outwards, `across` to the right of a link that hangs
//! down. At angle phi (counter-clockwise positive, 0 hanging down; image y down) they point to
//! `(sin phi, cos phi)` and `(cos phi, -sin phi)`.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::error::{Error, Fault, Place, Result};
use crate::frame::TimeBase;
use crate::kind::{self, Kind};
use crate::message::PRINT_SCENE;
use crate::pixel_aspect::PixelAspect;

/// Version of the scene's form; a file with a higher one is refused.
pub const SCENE_SCHEMA: u32 = 1;

/// Part by which pixels may be higher or lower than wide before films say so: some five times what makers of sensors and lenses keep
/// to, and more than what containers lose by rounding.
const UNSAID_PART: f64 = 0.01;
/// A pixel's width in units of the finest step of its height.
const HEIGHT_STEPS: u64 = 10_000;

/// Everything that makes a film.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Version of this form, [`SCENE_SCHEMA`].
    pub schema: u32,
    /// Width and height, px.
    pub image_px: [u32; 2],
    /// Number of frames.
    pub frames: u64,
    /// Frames per second, exact as a fraction with a denominator up to 10000.
    pub rate_hz: f64,
    /// Seed of noise, hot pixels, glints and random motion.
    #[serde(default)]
    pub seed: u64,
    /// The camera.
    #[serde(default)]
    pub camera: Camera,
    /// The light and the ground behind everything.
    #[serde(default)]
    pub light: Light,
    /// A table of link angles over time; a link that has no column in it moves by its own motion.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<MotionFile>,
    /// Random glints.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub glints: Option<RandomGlints>,
    /// Links, the first in front of the second and so on: the upper link hides what passes behind it.
    #[serde(rename = "link", default)]
    pub links: Vec<Link>,
    /// Markers, in the order of the nodes.
    #[serde(rename = "marker", default)]
    pub markers: Vec<Marker>,
    /// Things that stand still behind the links and look like markers: screws, the marks of a ruler.
    #[serde(rename = "distractor", default, skip_serializing_if = "Vec::is_empty")]
    pub distractors: Vec<Distractor>,
    /// Things that stand still in front of everything.
    #[serde(rename = "screen", default, skip_serializing_if = "Vec::is_empty")]
    pub screens: Vec<Screen>,
    /// Glints at stated places and times.
    #[serde(rename = "glint", default, skip_serializing_if = "Vec::is_empty")]
    pub glint_list: Vec<Glint>,
    /// Bodies or markers that are not there for some frames.
    #[serde(rename = "hidden", default, skip_serializing_if = "Vec::is_empty")]
    pub hidden: Vec<Hidden>,
    /// Black frames.
    #[serde(rename = "dropout", default, skip_serializing_if = "Vec::is_empty")]
    pub dropouts: Vec<Span>,
}

/// The camera and its noise; levels are grey levels of the recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Camera {
    /// Significant bits: 8 is stored in one byte, 9 to 16 in two.
    pub depth_bits: u32,
    /// Time over which light is gathered, s, centred on the frame's time; 0 is no blur.
    pub exposure_s: f64,
    /// Level of no light.
    pub black: f64,
    /// Standard deviation of the noise that is always there, levels.
    pub read_noise: f64,
    /// Levels per photo-electron: shot noise has the variance `shot_gain * (level - black)`.
    pub shot_gain: f64,
    /// Highest level that can be recorded; `None` is the highest that the depth allows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub saturation: Option<f64>,
    /// Number of hot pixels, at random places that stay.
    pub hot_pixels: u32,
    /// Level that a hot pixel adds.
    pub hot_level: f64,
    /// How the camera stands and what its lens does; `None` faces the links squarely, through a lens that keeps lines
    /// straight.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub view: Option<View>,
}

/// The camera's stand and its lens. Links keep their places in the plane that a square camera would film; markers, bars and
/// joints are given there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct View {
    /// Angle between the camera's axis and the plane's perpendicular, deg.
    pub tilt_deg: f64,
    /// Where in the picture the plane comes nearer, deg from right towards down.
    pub towards_deg: f64,
    /// Focal length in widths of the picture.
    pub focal_widths: f64,
    /// Part by which the lens moves the picture's corners outwards; below 0 is a barrel.
    pub k1: f64,
    /// Height of a pixel, in widths. Where it is off 1 by more than a hundredth the film says so; less is an error of the camera of
    /// which its films say nothing.
    pub pixel_height: f64,
}

impl Default for View {
    fn default() -> Self {
        Self { tilt_deg: 0.0, towards_deg: 30.0, focal_widths: 2.0, k1: 0.0, pixel_height: 1.0 }
    }
}

impl Default for Camera {
    fn default() -> Self {
        Self {
            depth_bits: 8,
            exposure_s: 0.0,
            black: 0.0,
            read_noise: 0.0,
            shot_gain: 0.0,
            saturation: None,
            hot_pixels: 0,
            hot_level: 0.0,
            view: None,
        }
    }
}

impl Camera {
    /// Highest level recorded.
    pub fn top(&self) -> f64 {
        let full = f64::from((1u32 << self.depth_bits.clamp(1, 16)) - 1);
        self.saturation.map_or(full, |s| s.min(full))
    }
}

/// The light.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Light {
    /// Level of the ground in the middle of the image.
    pub background: f64,
    /// Gain of the ground from the left to the right border and from the top to the bottom one, levels.
    pub background_gradient: [f64; 2],
    /// Gain of all light from left to right and from top to bottom, as a part of that in the middle.
    pub uneven: [f64; 2],
}

impl Default for Light {
    fn default() -> Self {
        Self { background: 10.0, background_gradient: [0.0; 2], uneven: [0.0; 2] }
    }
}

/// A table of link angles over time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionFile {
    /// CSV or Parquet with `time_s` and for link k `phik_rad` (`phi1_rad`, ...), for a free body also `xk_px`,
    /// `yk_px`, its place. A relative name starts at the scene's folder.
    pub file: PathBuf,
    /// The table's time at frame 0, s; `None` is its first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start_s: Option<f64>,
}

/// Motion of a link that no table gives.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, tag = "kind", rename_all = "snake_case")]
pub enum LinkMotion {
    /// Stands at an angle.
    Rest {
        /// Angle, rad.
        phi_rad: f64,
    },
    /// Turns at a constant rate.
    Rotation {
        /// Angle at frame 0, rad.
        phi_rad: f64,
        /// Rate, rad/s.
        rate_rad_s: f64,
    },
    /// `phi + amplitude * exp(-decay t) * sin(2 pi f t + phase)`.
    Swing {
        /// Angle about which it swings, rad.
        phi_rad: f64,
        /// Amplitude, rad.
        amplitude_rad: f64,
        /// Frequency, Hz.
        frequency_hz: f64,
        /// Phase at frame 0, rad.
        #[serde(default)]
        phase_rad: f64,
        /// Decay, 1/s.
        #[serde(default)]
        decay_per_s: f64,
    },
    /// Smooth random turning with many turns: a sum of twelve waves of random phase, from the seed.
    Tumble {
        /// Angle at frame 0, rad.
        phi_rad: f64,
        /// Root mean square of the rate, rad/s.
        rate_rad_s: f64,
        /// Highest frequency in the rate, Hz; the lowest is a twentieth of it.
        frequency_hz: f64,
    },
}

/// A rigid body: a bar with markers on it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Link {
    /// The body's name.
    pub name: String,
    /// The link it hangs on, given before it; `None` hangs on the fixed pivot, or is a free body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parent: Option<String>,
    /// Its joint: (along, across) on the parent, or x, y in the image.
    pub joint_px: [f64; 2],
    /// Constant velocity of a free body's joint, px/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity_px_s: Option<[f64; 2]>,
    /// Extent of the bar along the link.
    #[serde(default)]
    pub along_px: [f64; 2],
    /// Width of the bar; 0 is a body of markers only.
    #[serde(default)]
    pub width_px: f64,
    /// Level of the bar.
    #[serde(default)]
    pub level: f64,
    /// Light on the bar and its markers relative to the rest: 2 is twice as bright.
    #[serde(default = "one")]
    pub light: f64,
    /// How it turns if no motion table says it; `None` without a table is at rest, hanging down.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<LinkMotion>,
}

fn one() -> f64 {
    1.0
}

/// A disc on a link.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Marker {
    /// The node's name.
    pub name: String,
    /// The link it is on.
    pub link: String,
    /// Centre, (along, across) on the link.
    pub at_px: [f64; 2],
    /// Radius.
    pub radius_px: f64,
    /// Level.
    pub level: f64,
}

/// A still disc behind the links.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Distractor {
    /// Centre, x, y.
    pub at_px: [f64; 2],
    /// Radius.
    pub radius_px: f64,
    /// Level.
    pub level: f64,
}

/// A still rectangle in front of everything.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Screen {
    /// Left, top, right and bottom edge, px.
    pub edges_px: [f64; 4],
    /// Level.
    pub level: f64,
}

/// A bright spot for a few frames.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Glint {
    /// First frame.
    pub first: u64,
    /// Number of frames.
    pub count: u64,
    /// Centre, x, y.
    pub at_px: [f64; 2],
    /// Radius.
    pub radius_px: f64,
    /// Levels that it adds.
    pub level: f64,
}

/// Glints at random places and times, from the seed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RandomGlints {
    /// Glints that begin per frame, on average.
    pub per_frame: f64,
    /// Longest duration, frames; each lasts 1 to that.
    pub longest: u64,
    /// Smallest and largest radius, px.
    pub radius_px: [f64; 2],
    /// Smallest and largest level added.
    pub level: [f64; 2],
}

/// Frames in a row.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Span {
    /// First frame.
    pub first: u64,
    /// Number of frames.
    pub count: u64,
}

/// Bodies or markers that are not there for some frames.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hidden {
    /// First frame.
    pub first: u64,
    /// Number of frames.
    pub count: u64,
    /// Links that are hidden with all their markers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub links: Vec<String>,
    /// Single markers that are hidden.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub markers: Vec<String>,
}

/// Whether frame `index` is among `count` from `first`.
pub(crate) fn within(index: u64, first: u64, count: u64) -> bool {
    index >= first && index - first < count
}

impl Scene {
    /// Reads and checks a scene file. A relative motion file is looked for beside it.
    ///
    /// # Errors
    /// [`Error::Film`] naming the file and the line or key.
    pub fn read(path: &Path) -> Result<Self> {
        kind::expect(path, &[Kind::Scene], Error::Film)?;
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|e| {
            Error::Film(
                Fault::new(&name, format!("the scene cannot be read ({e})"))
                    .caused_by(&e)
                    .advice("Give a scene in TOML, e.g. one that " + PRINT_SCENE + " prints"),
            )
        })?;
        let mut scene = Self::parse(&text, &name)?;
        if let (Some(motion), Some(folder)) = (&mut scene.motion, path.parent()) {
            motion.file = folder.join(&motion.file);
        }
        Ok(scene)
    }

    /// Reads and checks the text of a scene; `name` is for messages.
    ///
    /// # Errors
    /// [`Error::Film`] naming the line or key.
    pub fn parse(text: &str, name: &str) -> Result<Self> {
        let scene: Scene = toml::from_str(text).map_err(|e| {
            let line =
                e.span().map_or(1, |s| text[..s.start.min(text.len())].matches('\n').count() as u64 + 1);
            Error::Film(
                Fault::new(name, e.message().replace('\n', " "))
                    .at(Place::Line(line))
                    .advice(PRINT_SCENE + " prints a scene with every part"),
            )
        })?;
        scene.check(name)?;
        Ok(scene)
    }

    /// The scene as TOML.
    ///
    /// # Errors
    /// [`Error::Film`] if a value has no TOML form (a seed above 2^63 has none).
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string_pretty(self).map_err(|e| Error::Film(Fault::new("scene", e.to_string())))
    }

    /// Width to height of a pixel, as films of the scene say it.
    pub fn pixel_aspect(&self) -> PixelAspect {
        let height = self.camera.view.map_or(1.0, |v| v.pixel_height);
        if (height - 1.0).abs() <= UNSAID_PART {
            return PixelAspect::SQUARE;
        }
        PixelAspect::new(HEIGHT_STEPS, (height * HEIGHT_STEPS as f64).round() as u64).unwrap_or_default()
    }

    /// Index of a link by its name.
    pub fn link_index(&self, name: &str) -> Option<usize> {
        self.links.iter().position(|l| l.name == name)
    }

    /// Seconds per frame as a fraction; a frame's ticks are its index.
    ///
    /// # Errors
    /// [`Error::Film`] if the rate is not a fraction with a denominator up to 10000.
    pub fn time_base(&self) -> Result<TimeBase> {
        for q in 1..=10_000u64 {
            let p = self.rate_hz * q as f64;
            let whole = p.round();
            if (1.0..1e15).contains(&whole) && (p - whole).abs() <= 1e-12 * p.abs() {
                return Ok(TimeBase { numerator: q, denominator: whole as u64 });
            }
        }
        Err(Error::Film(
            Fault::new("scene", format!("{} frames per second is not a simple fraction", self.rate_hz))
                .at(Place::Key("rate_hz".into()))
                .advice("Give a rate above 0 with at most four decimals"),
        ))
    }
}
