//! Bodies of what moves: the rig of the columns, and pieces that are one marker.
//!
//! Owns: the rig of [`Moving`]. Must not: follow anything, or name a column anew.

use nalgebra::Vector2;

use super::moving_nodes::Moving;
use super::settings::RunSettings;
use crate::discover::rig_of_paths;
use crate::error::Result;
use crate::link::{Point, Tracklet};
use crate::observation::Observation;
use crate::pixel_aspect::PixelAspect;
use crate::rig::{Body, Node, Rig};
use crate::stop::Stop;
use crate::table::SourceFacts;
use crate::wanted::Wanted;

impl Moving {
    /// Finds the bodies of the columns. Pieces of a marker that its body shows to be one become one column, the first one's.
    ///
    /// # Errors
    /// [`Error::Interrupted`] once `stop` was asked for.
    pub fn find_bodies(&mut self, facts: &SourceFacts, stop: &Stop) -> Result<()> {
        let (paths, frames) = paths(&self.rows, facts.pixel_aspect);
        let frame = |k: usize| self.stamps[frames[k]].index;
        let image_px = [facts.width, facts.height];
        self.bodies = rig_of_paths(&paths, image_px, facts.pixel_aspect, &frame, stop)?;
        let pieces: Vec<Vec<usize>> = self.bodies.iter().flat_map(|b| b.paths.clone()).collect();
        let mut gone: Vec<usize> = Vec::new();
        for mut one in pieces.into_iter().filter(|p| p.len() > 1) {
            one.sort_unstable();
            for row in &mut self.rows {
                let seen = one.iter().copied().find(|&k| row[k].status.is_seen());
                row[one[0]] = row[seen.unwrap_or(one[0])];
            }
            gone.extend(&one[1..]);
        }
        gone.sort_unstable_by(|a, b| b.cmp(a));
        for k in gone {
            self.rows.iter_mut().for_each(|row| {
                row.remove(k);
            });
            self.names.remove(k);
            self.markers.remove(k);
            for column in self.bodies.iter_mut().flat_map(|b| b.paths.iter_mut().flatten()) {
                *column -= usize::from(*column > k);
            }
        }
        Ok(())
    }

    /// The rig of the bodies that were found, a node for each column, or of single nodes.
    pub(super) fn rig(&self, facts: &SourceFacts, settings: &RunSettings, wanted: &Wanted) -> Rig {
        let single = self.single_rig(facts, settings, wanted);
        let Some(bodies) = &self.bodies else { return single };
        let mut bodies_of: Vec<Body> = bodies.rig.bodies.clone();
        let node = |(column, alone): (usize, &Node)| {
            let found = bodies.paths.iter().position(|p| p.iter().min() == Some(&column));
            if let Some(found) = found.map(|k| &bodies.rig.nodes[k]) {
                return Node { name: alone.name.clone(), ..found.clone() };
            }
            let name = format!("body{}", bodies_of.len() + 1);
            bodies_of.push(Body { name: name.clone() });
            Node { body: name, ..alone.clone() }
        };
        let nodes = single.nodes.iter().enumerate().map(node).collect();
        Rig {
            reference_frame: bodies.rig.reference_frame,
            camera: bodies.rig.camera.clone(),
            joints: bodies.rig.joints.clone(),
            bodies: bodies_of,
            nodes,
            ..single
        }
    }

    /// What the nodes are, a sentence without its full stop.
    pub(super) fn bodies_words(&self) -> String {
        let Some(found) = &self.bodies else { return "No bodies are made of them".into() };
        let counted =
            |n: usize, one: &str, many: &str| if n == 1 { format!("1 {one}") } else { format!("{n} {many}") };
        let bodies = counted(found.rig.bodies.len(), "body", "bodies");
        match found.rig.joints.len() {
            0 => format!("They are {bodies} without a joint"),
            n => format!("They are {bodies} with {}", counted(n, "joint", "joints")),
        }
    }
}

/// The columns as paths in square pixels, and which rows their frames are: those that differ from the row before. Between the first
/// and the last frame in which a marker is seen it stays, not whole, where it was seen last.
fn paths(rows: &[Vec<Observation>], aspect: PixelAspect) -> (Vec<Tracklet>, Vec<usize>) {
    let same = |a: &Observation, b: &Observation| {
        a.status.is_seen() == b.status.is_seen()
            && (!a.status.is_seen() || (a.x_px, a.y_px) == (b.x_px, b.y_px))
    };
    let is_new = |&f: &usize| f == 0 || !rows[f].iter().zip(&rows[f - 1]).all(|(a, b)| same(a, b));
    let frames: Vec<usize> = (0..rows.len()).filter(is_new).collect();
    let path = |column: usize| {
        let mut points: Vec<Point> = Vec::new();
        let mut first = 0;
        for (k, o) in frames.iter().map(|&f| &rows[f][column]).enumerate() {
            if o.status.is_seen() {
                first = if points.is_empty() { k } else { first };
                let place = aspect.to_square(Vector2::new(o.x_px, o.y_px));
                points.push(Point { place, area_px: 1.0, whole: true });
            } else if let Some(last) = points.last() {
                points.push(Point { whole: false, ..*last });
            }
        }
        let end = points.iter().rposition(|p| p.whole).map_or(0, |k| k + 1);
        points.truncate(end);
        Tracklet { first, points }
    };
    let columns = 0..rows.first().map_or(0, Vec::len);
    // A column that is never seen stays, as a path of one place: paths and columns have the same numbers.
    let nowhere = Point { place: Vector2::zeros(), area_px: 1.0, whole: false };
    let known = |t: Tracklet| if t.points.is_empty() { Tracklet { points: vec![nowhere], ..t } } else { t };
    (columns.map(path).map(known).collect(), frames)
}
