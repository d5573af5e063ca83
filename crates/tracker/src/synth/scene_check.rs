//! Checks that a scene makes sense.
//!
//! Owns: [`Scene::check`]. Must not: change a scene.

use super::scene::{LinkMotion, SCENE_SCHEMA, Scene, View};
use crate::error::{Error, Fault, Place, Result};
use crate::message::Message;

impl Scene {
    /// Checks that names are known and numbers make sense.
    ///
    /// # Errors
    /// [`Error::Film`] naming the first key at fault.
    pub fn check(&self, name: &str) -> Result<()> {
        Checker { name }.scene(self)
    }
}

/// Refuses with the key at fault.
struct Checker<'a> {
    /// The scene's name in messages.
    name: &'a str,
}

impl Checker<'_> {
    fn fault(&self, key: impl Into<String>, problem: impl Into<Message>, advice: &str) -> Result<()> {
        Err(Error::Film(Fault::new(self.name, problem).at(Place::Key(key.into())).advice(advice)))
    }

    /// A finite number that is at least `least`.
    fn number(&self, key: &str, value: f64, least: f64) -> Result<()> {
        if value.is_finite() && value >= least {
            return Ok(());
        }
        let needed = if least == f64::NEG_INFINITY {
            "a finite number is needed".to_string()
        } else {
            format!("at least {least} is needed")
        };
        self.fault(key, format!("{value} makes no sense, {needed}"), "Correct the value")
    }

    fn finite(&self, key: &str, values: &[f64]) -> Result<()> {
        values.iter().try_for_each(|&v| self.number(key, v, f64::NEG_INFINITY))
    }

    fn radius(&self, key: &str, value: f64) -> Result<()> {
        if value.is_finite() && value > 0.0 {
            return Ok(());
        }
        self.fault(key, format!("a radius of {value} px makes no disc"), "Give a radius above 0")
    }

    pub(super) fn scene(&self, s: &Scene) -> Result<()> {
        if s.schema == 0 || s.schema > SCENE_SCHEMA {
            return self.fault(
                "schema",
                format!("version {} is not known, this program reads up to {SCENE_SCHEMA}", s.schema),
                "Use a newer tracker",
            );
        }
        let [w, h] = s.image_px;
        if w == 0 || h == 0 || w > 16384 || h > 16384 {
            return self.fault(
                "image_px",
                format!("an image of {w} x {h} px cannot be made"),
                "Give 1 to 16384 px",
            );
        }
        if s.frames == 0 {
            return self.fault("frames", "a film without frames", "Give at least 1");
        }
        s.time_base()?;
        if s.seed > i64::MAX as u64 {
            return self.fault("seed", format!("{} is too large for TOML", s.seed), "Give less than 2^63");
        }
        self.camera(s)?;
        self.finite("light.background", &[s.light.background])?;
        self.finite("light.background_gradient", &s.light.background_gradient)?;
        self.finite("light.uneven", &s.light.uneven)?;
        if s.light.uneven.iter().map(|u| u.abs()).sum::<f64>() > 2.0 {
            return self.fault("light.uneven", "light would be negative in a corner", "Give less");
        }
        self.links(s)?;
        self.markers(s)?;
        self.mishaps(s)
    }

    fn camera(&self, s: &Scene) -> Result<()> {
        let c = &s.camera;
        if !(8..=16).contains(&c.depth_bits) {
            return self.fault(
                "camera.depth_bits",
                format!("{} bits cannot be recorded", c.depth_bits),
                "Give 8 to 16",
            );
        }
        self.number("camera.exposure_s", c.exposure_s, 0.0)?;
        if c.exposure_s > 1.000_001 / s.rate_hz {
            return self.fault(
                "camera.exposure_s",
                format!("{} s is longer than the {} s between frames", c.exposure_s, 1.0 / s.rate_hz),
                "Give at most the time between frames",
            );
        }
        self.number("camera.black", c.black, 0.0)?;
        self.number("camera.read_noise", c.read_noise, 0.0)?;
        self.number("camera.shot_gain", c.shot_gain, 0.0)?;
        self.number("camera.hot_level", c.hot_level, 0.0)?;
        c.view.map_or(Ok(()), |v| self.view(&v))?;
        c.saturation.map_or(Ok(()), |v| self.number("camera.saturation", v, 1.0))
    }

    fn view(&self, v: &View) -> Result<()> {
        self.finite("camera.view.towards_deg", &[v.towards_deg])?;
        let within = |key: &str, value: f64, [least, most]: [f64; 2]| {
            if (least..=most).contains(&value) {
                return Ok(());
            }
            self.fault(
                format!("camera.view.{key}"),
                format!("{value} is no such camera's"),
                &format!("Give {least} to {most}"),
            )
        };
        within("tilt_deg", v.tilt_deg, [0.0, 45.0])?;
        within("focal_widths", v.focal_widths, [0.5, 100.0])?;
        // Beyond it the picture of a barrel folds before its corners.
        within("k1", v.k1, [-0.3, 0.5])?;
        within("pixel_height", v.pixel_height, [0.5, 2.0])
    }

    fn links(&self, s: &Scene) -> Result<()> {
        for (i, l) in s.links.iter().enumerate() {
            let key = |what: &str| format!("link {}, {what}", l.name);
            if l.name.is_empty() || s.links[..i].iter().any(|o| o.name == l.name) {
                return self.fault(
                    format!("link {}", i + 1),
                    format!("the name {:?} is empty or given twice", l.name),
                    "Give each link its own name",
                );
            }
            if let Some(p) = &l.parent {
                if !s.links[..i].iter().any(|o| &o.name == p) {
                    return self.fault(
                        key("parent"),
                        format!("no link {p:?} is given before it"),
                        "Give links from the pivot outwards",
                    );
                }
                if l.velocity_px_s.is_some() {
                    return self.fault(
                        key("velocity_px_s"),
                        "a link that hangs on another has no velocity of its own",
                        "Leave out the velocity or the parent",
                    );
                }
            }
            self.finite(&key("joint_px"), &l.joint_px)?;
            self.finite(&key("along_px"), &l.along_px)?;
            self.finite(&key("velocity_px_s"), &l.velocity_px_s.unwrap_or_default())?;
            self.number(&key("width_px"), l.width_px, 0.0)?;
            self.number(&key("light"), l.light, 0.0)?;
            self.number(&key("level"), l.level, 0.0)?;
            match &l.motion {
                None => {}
                Some(LinkMotion::Rest { phi_rad }) => self.finite(&key("motion"), &[*phi_rad])?,
                Some(LinkMotion::Rotation { phi_rad, rate_rad_s }) => {
                    self.finite(&key("motion"), &[*phi_rad, *rate_rad_s])?;
                }
                Some(LinkMotion::Swing { phi_rad, amplitude_rad, frequency_hz, phase_rad, decay_per_s }) => {
                    self.finite(
                        &key("motion"),
                        &[*phi_rad, *amplitude_rad, *frequency_hz, *phase_rad, *decay_per_s],
                    )?
                }
                Some(LinkMotion::Tumble { phi_rad, rate_rad_s, frequency_hz }) => {
                    self.finite(&key("motion"), &[*phi_rad])?;
                    self.number(&key("motion.rate_rad_s"), *rate_rad_s, 0.0)?;
                    self.number(&key("motion.frequency_hz"), *frequency_hz, 1e-6)?;
                }
            }
        }
        Ok(())
    }

    fn markers(&self, s: &Scene) -> Result<()> {
        for (i, m) in s.markers.iter().enumerate() {
            let key = |what: &str| format!("marker {}, {what}", m.name);
            if m.name.is_empty() || s.markers[..i].iter().any(|o| o.name == m.name) {
                return self.fault(
                    format!("marker {}", i + 1),
                    format!("the name {:?} is empty or given twice", m.name),
                    "Give each marker its own name",
                );
            }
            if s.link_index(&m.link).is_none() {
                return self.fault(
                    key("link"),
                    format!("no link {:?} in the scene", m.link),
                    "Name a link of the scene",
                );
            }
            self.finite(&key("at_px"), &m.at_px)?;
            self.radius(&key("radius_px"), m.radius_px)?;
            self.number(&key("level"), m.level, 0.0)?;
        }
        Ok(())
    }

    fn mishaps(&self, s: &Scene) -> Result<()> {
        for (i, d) in s.distractors.iter().enumerate() {
            self.finite(&format!("distractor {}, at_px", i + 1), &d.at_px)?;
            self.radius(&format!("distractor {}, radius_px", i + 1), d.radius_px)?;
            self.number(&format!("distractor {}, level", i + 1), d.level, 0.0)?;
        }
        for (i, c) in s.screens.iter().enumerate() {
            let [x0, y0, x1, y1] = c.edges_px;
            self.finite(&format!("screen {}, edges_px", i + 1), &c.edges_px)?;
            self.number(&format!("screen {}, level", i + 1), c.level, 0.0)?;
            if x1 <= x0 || y1 <= y0 {
                return self.fault(
                    format!("screen {}, edges_px", i + 1),
                    "it has no area",
                    "Give left, top, right, bottom",
                );
            }
        }
        for (i, g) in s.glint_list.iter().enumerate() {
            self.finite(&format!("glint {}, at_px", i + 1), &g.at_px)?;
            self.radius(&format!("glint {}, radius_px", i + 1), g.radius_px)?;
            self.number(&format!("glint {}, level", i + 1), g.level, 0.0)?;
        }
        if let Some(g) = &s.glints {
            self.number("glints.per_frame", g.per_frame, 0.0)?;
            if g.longest == 0 || g.per_frame > 1000.0 {
                return self.fault(
                    "glints",
                    "no such glints can be made",
                    "Give longest at least 1, at most 1000 per frame",
                );
            }
            self.radius("glints.radius_px", g.radius_px[0])?;
            self.number("glints.radius_px", g.radius_px[1], g.radius_px[0])?;
            self.number("glints.level", g.level[0], 0.0)?;
            self.number("glints.level", g.level[1], g.level[0])?;
        }
        for (i, h) in s.hidden.iter().enumerate() {
            let unknown = h
                .links
                .iter()
                .find(|l| s.link_index(l).is_none())
                .or_else(|| h.markers.iter().find(|m| !s.markers.iter().any(|o| &o.name == *m)));
            if let Some(u) = unknown {
                return self.fault(
                    format!("hidden {}", i + 1),
                    format!("{u:?} is no link or marker of the scene"),
                    "Name links under `links` and markers under `markers`",
                );
            }
        }
        Ok(())
    }
}
