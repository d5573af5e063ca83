//! Rows of what moves, in the recording's own pixels and frames.
//!
//! Owns: [`rows`], [`gaps`]. Must not: find anything.

use super::one_place::leave_open;
use crate::moving::{Marker, WorkFilm};
use crate::observation::{Observation, Status};

/// Part of the frames between its first and its last from which on it is said that a node is missing in them.
const TELL_MISSING_PART: f64 = 0.1;

/// The nodes of every frame.
pub(super) fn rows(film: &WorkFilm, markers: &[Marker]) -> Vec<Vec<Observation>> {
    let scale = film.shrink() as f64;
    let unknown = |decoded: bool| if decoded { Observation::MISSING } else { Observation::UNDECODED };
    let mut rows: Vec<Vec<Observation>> =
        film.stamps().iter().map(|s| vec![unknown(s.decoded); markers.len()]).collect();
    for (node, track) in markers.iter().map(|m| &m.track).enumerate() {
        let mut last = None;
        for (picture, spot) in track.spots() {
            let back = last.is_some_and(|l| l + 1 < picture);
            last = Some(picture);
            // A copy shows the marker where the frame before it does.
            for (nth, &row) in film.frames(picture).iter().enumerate() {
                rows[row][node] = Observation {
                    x_px: film.recorded_px(spot.x),
                    y_px: film.recorded_px(spot.y),
                    sigma_px: (track.sigma_px(spot) * scale) as f32,
                    area_px: (spot.area * scale * scale) as f32,
                    status: if back && nth == 0 { Status::Reacquired } else { Status::Seen },
                };
            }
        }
    }
    let radius: Vec<f64> = markers.iter().map(|m| m.radius_px * scale).collect();
    rows.iter_mut().for_each(|row| leave_open(row, &radius));
    rows
}

/// Nodes that are missing in more than a tenth of the frames from their first to their last, with how many these are, and of how
/// many.
pub(super) fn gaps(rows: &[Vec<Observation>]) -> Vec<(usize, [usize; 2])> {
    let is_seen = |node: usize| rows.iter().map(move |r| r[node].status.is_seen());
    let nodes = 0..rows.first().map_or(0, Vec::len);
    nodes
        .filter_map(|node| {
            let first = is_seen(node).position(|seen| seen)?;
            let last = rows.len() - 1 - rows.iter().rev().position(|r| r[node].status.is_seen())?;
            let all = &rows[first..=last];
            let missing = all.iter().filter(|r| r[node].status == Status::Missing).count();
            (missing as f64 > TELL_MISSING_PART * all.len() as f64).then_some((node, [missing, all.len()]))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_that_is_missing_in_more_than_a_tenth_between_its_ends_is_told() {
        let seen = Observation { status: Status::Seen, ..Observation::MISSING };
        let node = |missing: std::ops::Range<usize>| {
            move |k: usize| if missing.contains(&k) || k < 5 { Observation::MISSING } else { seen }
        };
        let (few, many) = (node(10..12), node(10..13));
        let rows: Vec<Vec<Observation>> = (0..25).map(|k| vec![few(k), many(k)]).collect();
        assert_eq!(gaps(&rows), [(1, [3, 20])]);
        assert!(gaps(&[vec![Observation::MISSING]]).is_empty());
    }
}
