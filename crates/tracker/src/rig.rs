//! Defines the rig (nodes, bodies, joints, reference picture) and its TOML form.
//!
//! Owns: [`Rig`] and what makes one valid. Must not: look at a recording (`discover` does).

use std::path::Path;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::camera::{Camera, NUMBERS, Plane};
use crate::error::{Error, Fault, Place, Result};
use crate::kind::{self, Kind};
use crate::message::SETUP;
use crate::name::text;
use crate::output;
use crate::pixel_aspect::PixelAspect;
use crate::wanted::Wanted;

/// Version of the rig file's form; a file with a higher one is refused.
pub const RIG_SCHEMA: u32 = 1;

/// One marker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Node {
    /// `n0`, `n1`, ... or what the user calls it.
    pub name: String,
    /// Name of its body.
    pub body: String,
    /// Centre in the reference picture, px.
    pub x_px: f64,
    /// Centre in the reference picture, px.
    pub y_px: f64,
}

/// A rigid set of nodes (a link).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Its name, `upper` and `lower` for a double pendulum.
    pub name: String,
}

/// A point that two bodies share, or, with one body, the fixed pivot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    /// Its name, e.g. `pivot`, `elbow`.
    pub name: String,
    /// The one body that turns about a fixed point, or the two that share the point.
    pub bodies: Vec<String>,
    /// Place in the reference picture, px.
    pub x_px: f64,
    /// Place in the reference picture, px.
    pub y_px: f64,
}

/// Part of the image in which markers are looked for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum Region {
    /// First and last pixel, both inside: `[x0, y0, x1, y1]`.
    Rectangle([f64; 4]),
    /// Corners in order; the last joins the first.
    Polygon(Vec<[f64; 2]>),
}

impl Region {
    /// Whether a place is in it, px.
    pub fn contains(&self, [x, y]: [f64; 2]) -> bool {
        match self {
            Self::Rectangle([x0, y0, x1, y1]) => (*x0..=*x1).contains(&x) && (*y0..=*y1).contains(&y),
            // A ray to the right crosses the border an odd number of times.
            Self::Polygon(corners) => {
                let next = corners.iter().cycle().skip(1);
                let crosses = |(a, b): (&[f64; 2], &[f64; 2])| {
                    (a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
                };
                corners.iter().zip(next).filter(|&pair| crosses(pair)).count() % 2 == 1
            }
        }
    }
}

impl FromStr for Region {
    type Err = &'static str;

    /// A rectangle, `X0,Y0,X1,Y1`.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
        let corners =
            numbers.and_then(|n| <[f64; 4]>::try_from(n).ok()).filter(|c| c.iter().all(|v| v.is_finite()));
        corners.map(Region::Rectangle).ok_or("expected X0,Y0,X1,Y1, for example 100,50,539,429")
    }
}

/// OpenCV's pinhole model with distortion, applied to centres, not to images.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lens {
    /// Rows of the 3 x 3 camera matrix, px.
    pub camera_matrix: [[f64; 3]; 3],
    /// k1, k2, p1, p2 and, if given, k3 and on, as OpenCV orders them.
    pub distortion: Vec<f64>,
}

/// The origin of a camera's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CameraOrigin {
    /// The user.
    Given,
    /// The recording: bodies are rigid.
    Found,
}

/// The camera through which the plane of the bodies is seen; see [`Camera`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RigCamera {
    /// Whether it was found in the recording.
    pub origin: CameraOrigin,
    /// Logarithm of the stretch along x and along the diagonal, `[a, b]`.
    pub stretch: [f64; 2],
    /// The plane's vanishing line, in one over half the picture's diagonal, `[v1, v2]`.
    pub vanishing: [f64; 2],
    /// Part by which the lens moves the picture's corners outwards.
    pub k1: f64,
    /// Covariance of a, b, v1, v2, k1; `None` is exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance: Option<[[f64; NUMBERS]; NUMBERS]>,
}

impl RigCamera {
    /// A camera as a rig has it.
    pub fn of(camera: &Camera, covariance: Option<[[f64; NUMBERS]; NUMBERS]>, origin: CameraOrigin) -> Self {
        let [a, b, v1, v2, k1] = camera.numbers();
        Self { origin, stretch: [a, b], vanishing: [v1, v2], k1, covariance }
    }

    /// a, b, v1, v2, k1.
    pub fn numbers(&self) -> [f64; NUMBERS] {
        [self.stretch[0], self.stretch[1], self.vanishing[0], self.vanishing[1], self.k1]
    }
}

/// Nodes, bodies, joints and the frame in which they stand so.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rig {
    /// Version of this form, [`RIG_SCHEMA`].
    pub schema: u32,
    /// Width and height of the recording, px; a recording of another size is refused.
    pub image_px: [u32; 2],
    /// Width to height of a pixel; a recording of other pixels is refused. All places here are in recorded pixels, and
    /// bodies are rigid in square ones.
    #[serde(default, skip_serializing_if = "PixelAspect::is_square")]
    pub pixel_aspect: PixelAspect,
    /// Index of the frame in which every node is at its place; `None` if the places come from elsewhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference_frame: Option<u64>,
    /// Where markers are looked for; `None` is the whole image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<Region>,
    /// The lens; `None` is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lens: Option<Lens>,
    /// Markers that the user asked to follow; a run with this rig follows the same.
    #[serde(default, skip_serializing_if = "Wanted::is_default")]
    pub wanted: Wanted,
    /// How the camera stands; `None` faces the bodies' plane squarely.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<RigCamera>,
    /// Bodies, from the pivot outwards.
    #[serde(rename = "body", default)]
    pub bodies: Vec<Body>,
    /// Nodes, by body, along it.
    #[serde(rename = "node", default)]
    pub nodes: Vec<Node>,
    /// Joints, the pivot first.
    #[serde(rename = "joint", default)]
    pub joints: Vec<Joint>,
}

impl Rig {
    /// Reads and checks a rig file.
    ///
    /// # Errors
    /// [`Error::Rig`] naming the file and the line or key.
    pub fn read(path: &Path) -> Result<Self> {
        kind::expect(path, &[Kind::Rig], Error::Rig)?;
        let name = text(path);
        let content = std::fs::read_to_string(path).map_err(|e| {
            Error::Rig(
                Fault::new(&name, format!("the rig file cannot be read ({e})"))
                    .caused_by(&e)
                    .advice("Give a rig made by " + SETUP),
            )
        })?;
        Self::parse(&content, &name)
    }

    /// Reads and checks the text of a rig file; `name` is for messages.
    ///
    /// ```
    /// use tracker::rig::Rig;
    ///
    /// let text = r#"
    ///     schema = 1
    ///     image_px = [640, 480]
    ///     body = [{ name = "upper" }]
    ///     node = [
    ///         { name = "n0", body = "upper", x_px = 320.0, y_px = 100.0 },
    ///         { name = "n1", body = "upper", x_px = 320.0, y_px = 180.5 },
    ///     ]
    /// "#;
    /// assert_eq!(Rig::parse(text, "rig.toml")?.nodes.len(), 2);
    ///
    /// let misspelt = text.replace("n1\", body = \"upper", "n1\", body = \"uper");
    /// let said = Rig::parse(&misspelt, "rig.toml").unwrap_err().to_string();
    /// assert!(said.starts_with("rig.toml") && said.contains("uper"), "{said}");
    /// # Ok::<(), tracker::error::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Rig`] naming the line or key.
    pub fn parse(text: &str, name: &str) -> Result<Self> {
        let rig: Rig = toml::from_str(text).map_err(|e| {
            let line =
                e.span().map_or(1, |s| text[..s.start.min(text.len())].matches('\n').count() as u64 + 1);
            Error::Rig(
                Fault::new(name, e.message().to_string())
                    .at(Place::Line(line))
                    .advice("The form is the one that " + SETUP + " writes"),
            )
        })?;
        rig.check(name)?;
        Ok(rig)
    }

    /// The rig as TOML.
    ///
    /// # Errors
    /// [`Error::Rig`] if a value has no TOML form.
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string_pretty(self).map_err(|e| Error::Rig(Fault::new("rig", e.to_string())))
    }

    /// Writes it as TOML.
    ///
    /// # Errors
    /// [`Error::Rig`] if it cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        output::write(path, self.to_toml()?.as_bytes()).map_err(|e| {
            Error::Rig(
                Fault::new(text(path), format!("the rig file cannot be written ({e})"))
                    .caused_by(&e)
                    .advice("Check that the folder exists and may be written to"),
            )
        })
    }

    /// The plane in which bodies are rigid.
    pub fn plane(&self) -> Plane {
        let camera = self.camera.as_ref().map(|_| self.view());
        Plane { pixel_aspect: self.pixel_aspect, camera }
    }

    /// The camera; one that faces the plane squarely where the rig has none.
    pub fn view(&self) -> Camera {
        let [w, h] = self.image_px.map(f64::from);
        let numbers = self.camera.as_ref().map_or([0.0; NUMBERS], RigCamera::numbers);
        Camera::new(numbers, [w * self.pixel_aspect.ratio(), h])
    }

    /// Index of a body by its name.
    pub fn body_index(&self, name: &str) -> Option<usize> {
        self.bodies.iter().position(|b| b.name == name)
    }

    /// For each node the index of its body.
    pub fn node_bodies(&self) -> Vec<usize> {
        // A checked rig has every body; an unchecked one is refused before it gets here.
        self.nodes.iter().map(|n| self.body_index(&n.body).unwrap_or(usize::MAX)).collect()
    }

    /// Whether a node can be at this place of the reference picture. The image itself need not hold it: a link may reach
    /// out of the image there. But a node is seen in some frame, and so is another of its body, so that it is no farther
    /// from the image than the image's diagonal.
    pub fn in_reach(&self, [x_px, y_px]: [f64; 2]) -> bool {
        let [w, h] = self.image_px.map(f64::from);
        // Pixel centres are at integers, so the image's edges are half a pixel out.
        let outside = |v: f64, size: f64| (-0.5 - v).max(v - (size - 0.5)).max(0.0);
        x_px.is_finite() && y_px.is_finite() && outside(x_px, w).hypot(outside(y_px, h)) <= w.hypot(h)
    }

    /// Whether a place is in the image, to half a pixel beyond the outermost pixel centres.
    pub fn in_image(&self, [x_px, y_px]: [f64; 2]) -> bool {
        let [w, h] = self.image_px.map(f64::from);
        x_px >= -0.5 && y_px >= -0.5 && x_px <= w - 0.5 && y_px <= h - 0.5
    }

    /// Leaves out nodes at places where no node can be, and the bodies and joints that are then nobody's. Names of the
    /// nodes left out.
    pub fn leave_out_unreachable(&mut self) -> Vec<String> {
        let rig = self.clone();
        let gone = |n: &Node| !rig.in_reach([n.x_px, n.y_px]);
        let names: Vec<String> = rig.nodes.iter().filter(|n| gone(n)).map(|n| n.name.clone()).collect();
        self.nodes.retain(|n| !gone(n));
        self.bodies.retain(|b| self.nodes.iter().any(|n| n.body == b.name));
        let known = |name: &String| self.bodies.iter().any(|b| b.name == *name);
        self.joints.retain(|j| j.bodies.iter().all(known) && j.x_px.is_finite() && j.y_px.is_finite());
        names
    }

    /// Checks that names are unique and known and numbers finite and places where nodes can be.
    ///
    /// # Errors
    /// [`Error::Rig`] naming the first key at fault.
    pub fn check(&self, name: &str) -> Result<()> {
        if self.schema == 0 || self.schema > RIG_SCHEMA {
            return wrong(
                name,
                "schema".into(),
                format!("version {} is not known, this program reads up to {RIG_SCHEMA}", self.schema),
                "Use a newer tracker",
            );
        }
        if self.nodes.is_empty() {
            return Err(Error::Rig(
                Fault::new(name, "the rig has no nodes")
                    .at(Place::Key("node".into()))
                    .advice("Add [[node]] entries or run " + SETUP),
            ));
        }
        self.check_camera(name)?;
        self.check_bodies(name)?;
        self.check_nodes(name)?;
        self.check_joints(name)
    }

    /// A camera that films a plane has numbers near those of a square one, and a covariance is one.
    fn check_camera(&self, name: &str) -> Result<()> {
        let Some(camera) = &self.camera else { return Ok(()) };
        let limits = [0.5, 0.5, 1.0, 1.0, 0.5];
        let keys = ["stretch", "stretch", "vanishing", "vanishing", "k1"];
        for ((value, limit), key) in camera.numbers().into_iter().zip(limits).zip(keys) {
            if value.is_nan() || value.abs() > limit {
                return wrong(
                    name,
                    format!("camera.{key}"),
                    format!("{value} is no camera's, its size is at most {limit}"),
                    "Give what was found in a recording of this camera, or leave the camera out",
                );
            }
        }
        if let Some(c) = &camera.covariance
            && (0..NUMBERS).any(|i| c[i][i] < 0.0 || (0..NUMBERS).any(|j| !c[i][j].is_finite()))
        {
            return wrong(
                name,
                "camera.covariance".into(),
                "it is no covariance: a variance is below 0 or a number is not finite".into(),
                "Leave it out",
            );
        }
        Ok(())
    }

    /// Each body has a name of its own.
    fn check_bodies(&self, name: &str) -> Result<()> {
        for (i, b) in self.bodies.iter().enumerate() {
            if b.name.is_empty() || self.bodies[..i].iter().any(|o| o.name == b.name) {
                return wrong(
                    name,
                    format!("body {i}"),
                    format!("the name {:?} is empty or given twice", b.name),
                    "Give each body its own name",
                );
            }
        }
        Ok(())
    }

    /// Each node has a name of its own, a body and a place of its own, and each body a node.
    fn check_nodes(&self, name: &str) -> Result<()> {
        let [w, h] = self.image_px.map(f64::from);
        for (i, n) in self.nodes.iter().enumerate() {
            if n.name.is_empty() || self.nodes[..i].iter().any(|o| o.name == n.name) {
                return wrong(
                    name,
                    format!("node {i}"),
                    format!("the name {:?} is empty or given twice", n.name),
                    "Give each node its own name",
                );
            }
            if self.body_index(&n.body).is_none() {
                return wrong(
                    name,
                    format!("node {}", n.name),
                    format!("its body {:?} is not in the rig", n.body),
                    "Add a [[body]] of that name",
                );
            }
            if let Some(o) = self.nodes[..i].iter().find(|o| {
                (&o.body, o.x_px.to_bits(), o.y_px.to_bits()) == (&n.body, n.x_px.to_bits(), n.y_px.to_bits())
            }) {
                return wrong(
                    name,
                    format!("node {}", n.name),
                    format!("it is at ({}, {}) px as node {} of its body is", n.x_px, n.y_px, o.name),
                    "Give its own centre in the reference picture",
                );
            }
            if !self.in_reach([n.x_px, n.y_px]) {
                return wrong(
                    name,
                    format!("node {}", n.name),
                    format!(
                        "({}, {}) px is farther from the image of {w} x {h} px than its diagonal is long",
                        n.x_px, n.y_px
                    ),
                    "Give its centre in the reference picture",
                );
            }
        }
        for b in &self.bodies {
            if !self.nodes.iter().any(|n| n.body == b.name) {
                return wrong(
                    name,
                    format!("body {}", b.name),
                    "it has no nodes".into(),
                    "Give it a node or leave it out",
                );
            }
        }
        Ok(())
    }

    /// Each joint names one body or two, and has a place.
    fn check_joints(&self, name: &str) -> Result<()> {
        for j in &self.joints {
            if j.bodies.is_empty() || j.bodies.len() > 2 {
                return wrong(
                    name,
                    format!("joint {}", j.name),
                    format!("it names {} bodies", j.bodies.len()),
                    "Name one body (a fixed pivot) or two",
                );
            }
            if let Some(b) = j.bodies.iter().find(|b| self.body_index(b).is_none()) {
                return wrong(
                    name,
                    format!("joint {}", j.name),
                    format!("its body {b:?} is not in the rig"),
                    "Name bodies of the rig",
                );
            }
            if !(j.x_px.is_finite() && j.y_px.is_finite()) {
                return wrong(
                    name,
                    format!("joint {}", j.name),
                    "its place is not finite".into(),
                    "Give its place in the reference picture",
                );
            }
        }
        Ok(())
    }
}

/// The error for an entry of the rig called `name`.
fn wrong(name: &str, key: String, problem: String, advice: &str) -> Result<()> {
    Err(Error::Rig(Fault::new(name, problem).at(Place::Key(key)).advice(advice)))
}
