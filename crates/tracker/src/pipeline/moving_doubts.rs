//! Doubts about what moves and was followed: whether it is what is meant, and where its centre is.
//!
//! Owns: the doubts of [`Moving`]. Must not: follow anything.

use super::moving_nodes::{Chosen, Moving};
use super::moving_rows::gaps;
use crate::message::{Message, Setting};
use crate::rig::Rig;

/// From this part of the radius on it is said that a centre is not well known.
const TELL_SIGMA_RADII: f64 = 0.1;

/// Below this confidence what is followed is named, and whether it is what is meant is doubtful.
pub(super) const SURE_CONFIDENCE: f64 = 0.3;

impl Moving {
    /// Names of the nodes of which it is doubtful where their centres are or whether they are what is meant; it is told why.
    pub(super) fn doubts(&self, rig: &Rig, warnings: &mut Vec<Message>) -> Vec<String> {
        let mut doubtful = Vec::new();
        for (node, usual) in self.doubtful() {
            let name = rig.nodes[node].name.clone();
            warnings.push(
                format!(
                    "the centre of {name} depends on what is taken for the marker: brightness, colour and outline have centres \
                     that differ; its standard uncertainty is {usual:.1} px in half of the frames"
                )
                .into(),
            );
            doubtful.push(name);
        }
        for (node, [missing, all]) in gaps(&self.rows) {
            let name = rig.nodes[node].name.clone();
            warnings.push(
                format!("{name} is not seen in {missing} of the {all} frames from its first to its last")
                    .into(),
            );
            doubtful.push(name);
        }
        for (node, said) in self.lost(rig.image_px) {
            let name = rig.nodes[node].name.clone();
            warnings.push(format!("{name} {said}: nothing there is certainly it").into());
            doubtful.push(name);
        }
        for (node, part) in self.aside(rig) {
            let name = rig.nodes[node].name.clone();
            warnings.push(
                format!(
                    "{name} is alone on its body and is seen in {:.0} % of the frames: it may be no marker, or two that run together",
                    100.0 * part
                )
                .into(),
            );
            doubtful.push(name);
        }
        if let Chosen::Likeliest { confidence, doubt, .. } = self.chosen
            && (doubt.is_some() || confidence < SURE_CONFIDENCE)
        {
            let part = format!("it explains {:.0} % of what looks like it", 100.0 * confidence);
            let why = doubt.filter(|_| confidence >= SURE_CONFIDENCE).map_or(part, str::to_owned);
            warnings.push(
                Message::from(format!(
                    "whether this is what is meant is doubtful: {why}. If it is, say so with "
                )) + Setting::Also.set_to("1"),
            );
            doubtful.extend(rig.nodes.iter().map(|n| n.name.clone()));
            doubtful.dedup();
        }
        doubtful
    }

    /// Where there are bodies, columns that are alone on theirs and seen in less than half as many frames as another, with the part of
    /// the frames in which each is seen.
    fn aside(&self, rig: &Rig) -> Vec<(usize, f64)> {
        let columns = 0..rig.nodes.len();
        let count = |k: usize| self.rows.iter().filter(|row| row[k].status.is_seen()).count();
        let seen: Vec<usize> = columns.clone().map(count).collect();
        let most = seen.iter().copied().max().unwrap_or(0);
        let alone = |k: usize| rig.nodes.iter().filter(|n| n.body == rig.nodes[k].body).count() == 1;
        let aside = columns.filter(|&k| self.bodies.is_some() && alone(k) && 2 * seen[k] < most);
        aside.map(|k| (k, seen[k] as f64 / self.rows.len().max(1) as f64)).collect()
    }

    /// Columns whose usual standard uncertainty is a large part of the radius, with that uncertainty, px.
    pub(super) fn doubtful(&self) -> Vec<(usize, f32)> {
        let limit = |node: usize| TELL_SIGMA_RADII * self.markers[node].radius_px * self.scale;
        let usual = |node: usize| {
            let seen = self.rows.iter().map(|r| &r[node]).filter(|o| o.status.is_seen());
            let mut sigma: Vec<f32> = seen.map(|o| o.sigma_px).collect();
            sigma.sort_unstable_by(f32::total_cmp);
            sigma.get(sigma.len() / 2).copied()
        };
        let columns = 0..self.rows.first().map_or(0, Vec::len);
        columns.filter_map(|k| Some((k, usual(k).filter(|s| f64::from(*s) > limit(k))?))).collect()
    }

    /// Columns of what is followed by its picture and is lost for good within a picture of that size, with a clause of where.
    fn lost(&self, image_px: [u32; 2]) -> Vec<(usize, String)> {
        let mut all = Vec::new();
        for (node, marker) in self.markers.iter().enumerate().filter(|(_, m)| m.model.is_none()) {
            let seen: Vec<usize> =
                (0..self.rows.len()).filter(|&k| self.rows[k][node].status.is_seen()).collect();
            let (Some(&first), Some(&last)) = (seen.first(), seen.last()) else { continue };
            let margin = 2.0 * marker.radius_px * self.scale;
            let within = |k: usize| {
                let o = &self.rows[k][node];
                let inside = |v: f64, n: f64| v > margin && v < n - margin;
                inside(o.x_px, f64::from(image_px[0])) && inside(o.y_px, f64::from(image_px[1]))
            };
            let index = |k: usize| self.stamps[k].index;
            let mut said = Vec::new();
            if first > 0 && within(first) {
                said.push(format!("is not seen before frame {}", index(first)));
            }
            if last + 1 < self.rows.len() && within(last) {
                said.push(format!("is lost after frame {}", index(last)));
            }
            if !said.is_empty() {
                all.push((node, said.join(" and ")));
            }
        }
        all
    }
}
