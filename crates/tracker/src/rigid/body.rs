//! Holds the rig as the tracker uses it: templates in body coordinates, hinges, the order from the pivot outwards.
//!
//! Owns: [`Link`], [`Hinge`], [`Mechanism`]. Must not: look at detections.

use nalgebra::{Isometry2, Vector2};

use super::pose::place;
use crate::rig::Rig;

/// Part of a marker that must be left of a merged blob for it to be seen in it, and of a cut one for its own centre
/// to be given.
pub(crate) const LEAST_PART: f64 = 0.5;

/// A rigid body: its nodes and where they are on it.
#[derive(Debug, Clone)]
pub struct Link {
    /// Indices into the rig's nodes.
    pub nodes: Vec<usize>,
    /// Places in the body's coordinates, px. The origin is the mean of the nodes in the reference picture.
    pub template: Vec<Vector2<f64>>,
    /// Standard uncertainty of each template place, px: what the detections' own does not explain.
    pub slack_px: Vec<f64>,
    /// Least area of a whole marker, px; 0 where nothing is known of it. Smaller ones are half hidden.
    pub whole_px: Vec<f32>,
    /// Usual area of a marker and its scatter, px; 0 where nothing is known of it.
    pub area_px: Vec<(f64, f64)>,
    /// Origin in the reference picture, px.
    pub home: Vector2<f64>,
    /// Standard deviation of what places scatter beyond their stated uncertainty, px.
    pub excess_px: f64,
}

/// The holder of a point on which a body hangs.
#[derive(Debug, Clone, Copy)]
pub enum Holder {
    /// A point of the image, px.
    Ground(Vector2<f64>),
    /// A point of another body, in its coordinates, px.
    Body(usize, Vector2<f64>),
}

/// A joint seen from one of its bodies.
#[derive(Debug, Clone, Copy)]
pub struct Hinge {
    /// Index of the joint in the rig.
    pub joint: usize,
    /// The body.
    pub body: usize,
    /// The joint in the body's coordinates, px.
    pub local: Vector2<f64>,
    /// The ground, or the body on the other side.
    pub holder: Holder,
    /// Standard uncertainty of the two sides' agreement per coordinate, px.
    pub sigma_px: f64,
}

/// Bodies and hinges, in the order of the rig.
#[derive(Debug, Clone)]
pub struct Mechanism {
    /// Bodies, in the rig's order.
    pub links: Vec<Link>,
    /// Every joint once for each body it holds.
    pub hinges: Vec<Hinge>,
    /// Bodies from the ground outwards.
    pub order: Vec<usize>,
    /// Number of nodes.
    pub nodes: usize,
    /// Area of the image, px.
    pub image_px: f64,
}

impl Mechanism {
    /// The mechanism of a checked rig, in square pixels. `slack_px` is how well the rig's places are known.
    pub fn new(rig: &Rig, slack_px: f64) -> Self {
        let bodies = rig.node_bodies();
        let plane = rig.plane();
        let square = |x: f64, y: f64| plane.to_plane(Vector2::new(x, y));
        let at = |i: usize| square(rig.nodes[i].x_px, rig.nodes[i].y_px);
        let links: Vec<Link> = (0..rig.bodies.len())
            .map(|b| {
                let nodes: Vec<usize> = (0..rig.nodes.len()).filter(|&i| bodies[i] == b).collect();
                let home = nodes.iter().map(|&i| at(i)).sum::<Vector2<f64>>() / nodes.len().max(1) as f64;
                let template = nodes.iter().map(|&i| at(i) - home).collect();
                let slack_px = vec![slack_px; nodes.len()];
                let whole_px = vec![0.0; nodes.len()];
                let area_px = vec![(0.0, 0.0); nodes.len()];
                Link { nodes, template, slack_px, whole_px, area_px, home, excess_px: 0.0 }
            })
            .collect();
        let mut hinges = Vec::new();
        for (j, joint) in rig.joints.iter().enumerate() {
            let here = square(joint.x_px, joint.y_px);
            let sides: Vec<usize> = joint.bodies.iter().filter_map(|b| rig.body_index(b)).collect();
            for (k, &body) in sides.iter().enumerate() {
                let holder = if sides.len() == 1 {
                    Holder::Ground(here)
                } else {
                    let other = sides[1 - k];
                    Holder::Body(other, here - links[other].home)
                };
                let local = here - links[body].home;
                hinges.push(Hinge { joint: j, body, local, holder, sigma_px: slack_px.hypot(slack_px) });
            }
        }
        let mut mechanism = Self {
            links,
            hinges,
            order: Vec::new(),
            nodes: rig.nodes.len(),
            image_px: f64::from(rig.image_px[0]) * f64::from(rig.image_px[1]) * rig.pixel_aspect.ratio(),
        };
        mechanism.order = mechanism.outwards();
        mechanism
    }

    /// Bodies from the ground outwards; where no ground is, from the body with most nodes.
    fn outwards(&self) -> Vec<usize> {
        let n = self.links.len();
        let mut order: Vec<usize> = Vec::new();
        let grounded =
            |b: usize| self.hinges.iter().any(|h| h.body == b && matches!(h.holder, Holder::Ground(_)));
        order.extend((0..n).filter(|&b| grounded(b)));
        loop {
            let next = (0..n).find(|b| {
                !order.contains(b)
                    && self
                        .hinges
                        .iter()
                        .any(|h| h.body == *b && matches!(h.holder, Holder::Body(o, _) if order.contains(&o)))
            });
            let next = next.or_else(|| {
                (0..n)
                    .filter(|b| !order.contains(b))
                    .max_by_key(|&b| (self.links[b].nodes.len(), std::cmp::Reverse(b)))
            });
            match next {
                Some(b) => order.push(b),
                None => return order,
            }
        }
    }

    /// Pose in the reference picture.
    pub fn home_pose(&self, body: usize) -> Isometry2<f64> {
        Isometry2::new(self.links[body].home, 0.0)
    }
}

impl Link {
    /// The farthest node from a point of the body, px.
    pub fn reach_px(&self, from: Vector2<f64>) -> f64 {
        self.template.iter().map(|t| (t - from).norm()).fold(0.0, f64::max)
    }

    /// The least distance between two nodes, px; infinite for a single one.
    pub fn spacing_px(&self) -> f64 {
        let n = self.template.len();
        let pairs = (0..n).flat_map(|i| (0..i).map(move |j| (i, j)));
        pairs.map(|(i, j)| (self.template[i] - self.template[j]).norm()).fold(f64::INFINITY, f64::min)
    }

    /// Greatest distance of the centre of a blob of `area_px` from node `j`'s, px, if the missing part is hidden: the part hidden
    /// of a disc, where small, moves the centre of the rest by that part of the radius. Areas scatter too.
    pub fn cut_px(&self, j: usize, area_px: f32) -> f64 {
        let (usual, scatter) = self.area_px[j];
        if usual <= 0.0 {
            return 0.0;
        }
        let radius = (usual / std::f64::consts::PI).sqrt();
        radius * ((usual - f64::from(area_px)).max(0.0) + scatter) / usual
    }

    /// The places of the nodes in a pose, px.
    pub fn places(&self, pose: &Isometry2<f64>) -> Vec<Vector2<f64>> {
        self.template.iter().map(|&t| place(pose, t)).collect()
    }
}
