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
        let columns = self.names.len();
        let found = |rows: &[Vec<Observation>]| {
            let (paths, frames) = paths(rows, facts.pixel_aspect);
            let frame = |k: usize| self.stamps[frames[k]].index;
            rig_of_paths(&paths, [facts.width, facts.height], facts.pixel_aspect, &frame, stop)
        };
        self.bodies = found(&self.rows)?;
        if self.bodies.is_some() && self.pieces.iter().any(|row| !row.is_empty()) {
            let both = self.rows.iter().zip(&self.pieces).map(|(a, b)| [a.as_slice(), b].concat());
            let both: Vec<Vec<Observation>> = both.collect();
            if let (Some(whole), Some(alone)) = (found(&both)?, &mut self.bodies)
                && let Some(paths) = extended(&alone.paths, &whole.paths)
            {
                self.rows = both;
                alone.paths = paths;
            }
        }
        let pieces: Vec<Vec<usize>> = self.bodies.iter().flat_map(|b| b.paths.clone()).collect();
        let mut gone: Vec<usize> = Vec::new();
        for mut one in pieces.into_iter().filter(|p| p.len() > 1) {
            one.sort_unstable();
            for row in &mut self.rows {
                let seen = one.iter().copied().find(|&k| row[k].status.is_seen());
                row[one[0]] = row[seen.unwrap_or(one[0])];
            }
            gone.extend(one[1..].iter().filter(|k| **k < columns));
        }
        self.rows.iter_mut().for_each(|row| row.truncate(columns));
        self.bodies.iter_mut().flat_map(|b| &mut b.paths).for_each(|p| p.retain(|&k| k < columns));
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

    /// Description of the nodes, a sentence without its full stop.
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

/// Nodes' paths with those that more paths add to them; `None` where these make one node of two.
fn extended(alone: &[Vec<usize>], whole: &[Vec<usize>]) -> Option<Vec<Vec<usize>>> {
    let node = |paths: &Vec<usize>| whole.iter().position(|w| paths.iter().all(|p| w.contains(p)));
    let nodes: Vec<usize> = alone.iter().map(node).collect::<Option<_>>()?;
    let distinct = nodes.iter().all(|n| nodes.iter().filter(|m| *m == n).count() == 1);
    distinct.then(|| nodes.into_iter().map(|n| whole[n].clone()).collect())
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::Status;

    #[test]
    fn pieces_go_to_one_node_each_and_never_make_one_of_two() {
        let alone = [vec![0], vec![1]];
        assert_eq!(
            extended(&alone, &[vec![3], vec![1, 4], vec![0, 2, 5]]),
            Some(vec![vec![0, 2, 5], vec![1, 4]])
        );
        assert_eq!(extended(&alone, &[vec![0, 1]]), None);
        assert_eq!(extended(&alone, &[vec![0, 2]]), None);
    }

    #[test]
    fn a_path_stays_where_it_was_seen_last_and_rows_that_repeat_are_left_out() {
        let at = |x_px: f64| Observation { x_px, y_px: 1.0, status: Status::Seen, ..Observation::MISSING };
        let none = Observation::MISSING;
        let rows: Vec<Vec<Observation>> =
            [none, at(1.0), at(1.0), none, at(3.0), none].into_iter().map(|o| vec![o, none]).collect();
        let (paths, frames) = paths(&rows, PixelAspect::SQUARE);
        assert_eq!(frames, [0, 1, 3, 4, 5]);
        let x: Vec<(f64, bool)> = paths[0].points.iter().map(|p| (p.place.x, p.whole)).collect();
        assert_eq!((paths[0].first, x), (1, vec![(1.0, true), (1.0, false), (3.0, true)]));
        assert!(paths[1].points.iter().all(|p| !p.whole));
    }
}
