//! Whether what is followed keeps its size, as a disc does.
//!
//! Owns: [`Sizes`], [`MOST_SIZES`]. Must not: find anything.

use crate::observation::Observation;
use crate::rig::Rig;

/// Ratio of the ninth to the first tenth of a node's areas from which on it is no marker: the factor that spots of one look differ by
/// where what moves is followed.
pub(super) const MOST_SIZES: f64 = 2.1;
/// Fewer areas tell nothing.
const LEAST_AREAS: usize = 20;

/// Areas of nodes that nothing but their own look speaks for: alone on their body, in a rig that was found.
pub(super) struct Sizes {
    /// By node; none where geometry holds it, too.
    areas_px: Vec<Option<Vec<f32>>>,
}

impl Sizes {
    pub fn of(given: Option<&Rig>, rig: &Rig) -> Self {
        let bodies = rig.node_bodies();
        let alone = |k: usize| bodies.iter().filter(|b| **b == bodies[k]).count() == 1;
        let watched = |k: usize| (given.is_none() && alone(k)).then(Vec::new);
        Self { areas_px: (0..rig.nodes.len()).map(watched).collect() }
    }

    pub fn push(&mut self, row: &[Observation]) {
        for (areas, o) in self.areas_px.iter_mut().zip(row) {
            if let (Some(areas), true) = (areas, o.status.is_seen() && o.area_px.is_finite()) {
                areas.push(o.area_px);
            }
        }
    }

    /// Nodes whose size changes too much.
    pub fn uneven(&mut self) -> impl Iterator<Item = usize> + '_ {
        self.areas_px.iter_mut().enumerate().filter_map(|(k, areas)| {
            let areas = areas.as_mut().filter(|a| a.len() >= LEAST_AREAS)?;
            areas.sort_unstable_by(f32::total_cmp);
            let tenth = |part: usize| f64::from(areas[areas.len() * part / 10]);
            (tenth(9) > MOST_SIZES * tenth(1)).then_some(k)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::Status;

    #[test]
    fn a_node_alone_whose_area_grows_threefold_is_told_and_one_that_wavers_is_not() {
        let at = |area_px: f32| Observation { area_px, status: Status::Seen, ..Observation::MISSING };
        let mut sizes = Sizes { areas_px: vec![Some(Vec::new()), Some(Vec::new()), None] };
        for k in 0..100 {
            sizes.push(&[at(1000.0 + 30.0 * k as f32), at(100.0 + (k % 30) as f32), at(10.0 * k as f32)]);
        }
        assert_eq!(sizes.uneven().collect::<Vec<_>>(), [0]);
    }
}
