//! Computes the pose of every link at a time.
//!
//! Owns: [`MotionTable`], `Mechanism`. Must not: know any physics; a pendulum's motion comes as a table.

use std::f64::consts::{PI, TAU};

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::coverage::Quad;
use super::scene::{LinkMotion, Scene};
use super::spline::Spline;
use crate::error::{Error, Fault, Place, Result};

/// Angles of links, and places of free bodies, over time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MotionTable {
    /// Its name in messages.
    pub name: String,
    /// Times, s, increasing.
    pub time_s: Vec<f64>,
    /// For each link its angles, rad, counter-clockwise positive, 0 hanging down; empty is not given.
    pub phi_rad: Vec<Vec<f64>>,
    /// For each link the places x, y of its joint, px; empty is not given.
    pub place_px: Vec<[Vec<f64>; 2]>,
}

impl MotionTable {
    /// Checks that times increase, lengths agree and all is finite.
    ///
    /// # Errors
    /// [`Error::Film`] naming the column or row.
    pub fn check(&self) -> Result<()> {
        let fault = |place, problem: String, advice: &str| {
            Err(Error::Film(Fault::new(&self.name, problem).at(place).advice(advice)))
        };
        if self.time_s.is_empty() {
            return fault(Place::Key("time_s".into()), "no times".into(), "Give at least one row");
        }
        for i in 0..self.time_s.len() {
            let t = self.time_s[i];
            if !t.is_finite() || (i > 0 && t <= self.time_s[i - 1]) {
                return fault(
                    Place::Row(i as u64),
                    format!("the time {t} s does not come after the one before"),
                    "Sort the rows by time_s and leave none twice",
                );
            }
        }
        let columns = (self.phi_rad.iter().enumerate().map(|(k, c)| (format!("phi{}_rad", k + 1), c))).chain(
            self.place_px
                .iter()
                .enumerate()
                .flat_map(|(k, [x, y])| [(format!("x{}_px", k + 1), x), (format!("y{}_px", k + 1), y)]),
        );
        for (name, column) in columns {
            if column.is_empty() {
                continue;
            }
            if column.len() != self.time_s.len() {
                return fault(
                    Place::Key(name),
                    format!("{} values for {} times", column.len(), self.time_s.len()),
                    "Give one value per time",
                );
            }
            if let Some(i) = column.iter().position(|v| !v.is_finite()) {
                return fault(
                    Place::Row(i as u64),
                    format!("{name} is {}", column[i]),
                    "A film needs the motion at every time; fill the gap first",
                );
            }
        }
        Ok(())
    }
}

/// The angle of one link over time.
#[derive(Debug, Clone)]
enum Angle {
    Table(Spline),
    Law(LinkMotion),
    /// Rate as a sum of cosines: amplitude (rad/s), angular frequency (rad/s), phase.
    Waves {
        phi_rad: f64,
        waves: Vec<[f64; 3]>,
    },
}

impl Angle {
    fn at(&self, t: f64) -> f64 {
        match self {
            Angle::Table(s) => s.value(t),
            Angle::Law(LinkMotion::Rest { phi_rad }) => *phi_rad,
            Angle::Law(LinkMotion::Rotation { phi_rad, rate_rad_s }) => phi_rad + rate_rad_s * t,
            Angle::Law(LinkMotion::Swing {
                phi_rad,
                amplitude_rad,
                frequency_hz,
                phase_rad,
                decay_per_s,
            }) => {
                phi_rad
                    + amplitude_rad * (-decay_per_s * t).exp() * (TAU * frequency_hz * t + phase_rad).sin()
            }
            Angle::Law(LinkMotion::Tumble { phi_rad, .. }) => *phi_rad,
            Angle::Waves { phi_rad, waves } => {
                phi_rad + waves.iter().map(|[a, w, p]| a / w * ((w * t + p).sin() - p.sin())).sum::<f64>()
            }
        }
    }
}

/// Twelve waves of the wanted root mean square with random phases, frequencies spread by equal factors.
fn tumble(seed: u64, link: usize, rate_rad_s: f64, frequency_hz: f64) -> Vec<[f64; 3]> {
    const WAVES: usize = 12;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // Streams of frames count up from 0, those of links down from the top.
    rng.set_stream(u64::MAX - link as u64);
    let mut uniform = || (rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
    let amplitude = rate_rad_s * (2.0 / WAVES as f64).sqrt();
    (0..WAVES)
        .map(|k| {
            let spread = 20f64.powf(-((k as f64 + uniform()) / WAVES as f64));
            [amplitude, TAU * frequency_hz * spread, 2.0 * PI * uniform()]
        })
        .collect()
}

/// One link's place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pose {
    /// Joint, px.
    pub(crate) joint: [f64; 2],
    /// Angle, rad.
    pub(crate) phi_rad: f64,
    /// Unit vector along the link, image coordinates.
    pub(crate) along: [f64; 2],
    /// Unit vector across.
    pub(crate) across: [f64; 2],
}

impl Pose {
    /// Image point of (along, across).
    pub(crate) fn point(&self, at: [f64; 2]) -> [f64; 2] {
        [
            self.joint[0] + at[0] * self.along[0] + at[1] * self.across[0],
            self.joint[1] + at[0] * self.along[1] + at[1] * self.across[1],
        ]
    }
}

#[derive(Debug, Clone)]
struct LinkDrive {
    parent: Option<usize>,
    joint: [f64; 2],
    velocity: [f64; 2],
    angle: Angle,
    place: Option<[Spline; 2]>,
}

/// The links of a scene, with the pose of each at any time.
#[derive(Debug, Clone)]
pub(crate) struct Mechanism {
    links: Vec<LinkDrive>,
    /// Time of the motion at frame 0, s.
    start_s: f64,
}

impl Mechanism {
    /// The mechanism of a checked scene; `table` is checked here.
    pub(crate) fn new(scene: &Scene, table: Option<&MotionTable>) -> Result<Self> {
        let mut start_s = 0.0;
        let mut uses_table = false;
        if let Some(t) = table {
            t.check()?;
            start_s = scene.motion.as_ref().and_then(|m| m.start_s).unwrap_or(t.time_s[0]);
        }
        let mut links = Vec::with_capacity(scene.links.len());
        for (i, l) in scene.links.iter().enumerate() {
            let column = table.and_then(|t| t.phi_rad.get(i)).filter(|c| !c.is_empty());
            let angle = match (column, &l.motion, table) {
                (Some(column), _, Some(t)) => {
                    uses_table = true;
                    Angle::Table(Spline::new(&t.time_s, column))
                }
                (_, Some(LinkMotion::Tumble { phi_rad, rate_rad_s, frequency_hz }), _) => Angle::Waves {
                    phi_rad: *phi_rad,
                    waves: tumble(scene.seed, i, *rate_rad_s, *frequency_hz),
                },
                (_, Some(law), _) => Angle::Law(law.clone()),
                (_, None, Some(t)) => {
                    return Err(Error::Film(
                        Fault::new(&t.name, format!("there is no phi{}_rad for link {:?}", i + 1, l.name))
                            .at(Place::Key(format!("phi{}_rad", i + 1)))
                            .advice("Add the column or give the link a motion of its own"),
                    ));
                }
                (_, None, None) => Angle::Law(LinkMotion::Rest { phi_rad: 0.0 }),
            };
            let place = match table.and_then(|t| t.place_px.get(i).map(|p| (t, p))) {
                Some((t, [x, y])) if !x.is_empty() && !y.is_empty() && l.parent.is_none() => {
                    uses_table = true;
                    Some([Spline::new(&t.time_s, x), Spline::new(&t.time_s, y)])
                }
                _ => None,
            };
            links.push(LinkDrive {
                parent: l.parent.as_deref().and_then(|p| scene.link_index(p)),
                joint: l.joint_px,
                velocity: l.velocity_px_s.unwrap_or_default(),
                angle,
                place,
            });
        }
        if let (Some(t), true) = (table, uses_table) {
            // Half an exposure beyond either end is the spline's own continuation.
            let (first, last) = (t.time_s[0], t.time_s[t.time_s.len() - 1]);
            let end = start_s + (scene.frames - 1) as f64 / scene.rate_hz;
            let slack = 1e-9 * (1.0 + last.abs());
            if start_s < first - slack || end > last + slack {
                return Err(Error::Film(
                    Fault::new(
                        &t.name,
                        format!("it spans {first:.6} s to {last:.6} s, the film needs {start_s:.6} s to {end:.6} s"),
                    )
                    .at(Place::Key("time_s".into()))
                    .advice("Film fewer frames or give a longer motion"),
                ));
            }
        }
        Ok(Self { links, start_s })
    }

    /// Places of all links at `t` s after frame 0, into `out` (cleared first).
    pub(crate) fn poses(&self, t: f64, out: &mut Vec<Pose>) {
        out.clear();
        let at = self.start_s + t;
        for l in &self.links {
            // Laws count from frame 0, tables from their own clock.
            let phi_rad = l.angle.at(if matches!(l.angle, Angle::Table(_)) { at } else { t });
            let joint = match (l.parent, &l.place) {
                (Some(p), _) => {
                    let parent: &Pose = &out[p];
                    parent.point(l.joint)
                }
                (None, Some([x, y])) => [x.value(at), y.value(at)],
                (None, None) => [l.joint[0] + l.velocity[0] * t, l.joint[1] + l.velocity[1] * t],
            };
            let (s, c) = phi_rad.sin_cos();
            out.push(Pose { joint, phi_rad, along: [s, c], across: [c, -s] });
        }
    }
}

/// The bar of link `index` at `pose`; `None` if it has none.
pub(crate) fn bar(scene: &Scene, index: usize, pose: &Pose) -> Option<Quad> {
    let l = &scene.links[index];
    (l.width_px > 0.0 && l.along_px[0] != l.along_px[1]).then(|| Quad {
        origin: pose.joint,
        along: pose.along,
        across: pose.across,
        u: [l.along_px[0].min(l.along_px[1]), l.along_px[0].max(l.along_px[1])],
        v: [-0.5 * l.width_px, 0.5 * l.width_px],
    })
}
