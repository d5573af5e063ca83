//! Tracks beside each other: shadows that go along, and stretches of one marker by their look.
//!
//! Owns: [`overlap`], [`is_companion`], [`goes_beside`], [`join_by_look`]. Must not: choose which marker is wanted.

use super::spot::Spot;
use super::track::{Track, extent};

/// A companion is seen in at most this part of the pictures in which the other one is, and it in at least this part of its own
/// pictures; its offset changes by at most this part of its travel.
const COMPANION_PART: f64 = 0.5;
const COMPANION_SEEN: f64 = 0.8;
const COMPANION_OFFSET: f64 = 0.25;
/// Looks of one marker in two stretches: its contrast changes by a third with what is behind it, its area by a tenth (standard
/// deviations of the logarithms). They agree below two of them, and others' looks must be two farther away.
const LOOK_SCATTER: [f64; 2] = [0.3, 0.1];
const SAME_LOOK: f64 = 2.0;
const CLEAR_LOOK: f64 = 2.0;

/// Whether two tracks are in one place in some picture.
pub fn overlap(a: &Track, b: &Track, radius_px: f64) -> bool {
    let places: std::collections::HashMap<usize, &Spot> = a.spots().collect();
    b.spots().any(|(k, s)| places.get(&k).is_some_and(|o| (o.x - s.x).hypot(o.y - s.y) < radius_px))
}

/// Whether a track goes beside a longer one and nowhere else, as a shadow or a reflection does: it is offered and not named.
pub fn is_companion(t: &Track, of: &Track) -> bool {
    if (t.count as f64) > COMPANION_PART * of.count as f64 {
        return false;
    }
    goes_beside(t, of)
}

/// Whether a track goes beside another one all the while, at one distance and in one direction.
pub fn goes_beside(t: &Track, of: &Track) -> bool {
    let places: std::collections::HashMap<usize, &Spot> = of.spots().collect();
    let beside: Vec<(&Spot, Spot)> = t
        .spots()
        .filter_map(|(k, s)| places.get(&k).map(|o| (s, Spot { x: s.x - o.x, y: s.y - o.y, ..*s })))
        .collect();
    let offset = extent(beside.iter().map(|(_, d)| d));
    let travel = extent(beside.iter().map(|(s, _)| *s));
    beside.len() as f64 > COMPANION_SEEN * t.count as f64 && offset < COMPANION_OFFSET * travel
}

/// Joins tracks that are never seen together where the look of two agrees better than those of any other two of which one is seen
/// while one of them is.
pub fn join_by_look(tracks: &mut Vec<Track>, radius_px: f64) {
    loop {
        let apart = |a: &Track, b: &Track| {
            let [peak, area] = [0, 1].map(|k| (a.look[k] - b.look[k]) / LOOK_SCATTER[k]);
            peak.hypot(area)
        };
        let span = |t: &Track| (t.spots().next().map_or(0, |s| s.0), t.spots().last().map_or(0, |s| s.0));
        let spans: Vec<(usize, usize)> = tracks.iter().map(span).collect();
        // Two that are seen at one time are two markers, so that only one of them is the same as a third.
        let meet = |a: usize, b: usize| spans[a].0 <= spans[b].1 && spans[b].0 <= spans[a].1;
        let follows = |a: &Track, b: &Track| match (a.spots().last(), b.spots().next()) {
            (Some((end, p)), Some((begin, q))) => {
                let fastest = |t: &Track| t.pieces.iter().map(|p| p.longest_step_px()).fold(0.0, f64::max);
                let reach = fastest(a).max(fastest(b)) * begin.saturating_sub(end) as f64 + 3.0 * radius_px;
                begin > end && (p.x - q.x).hypot(p.y - q.y) <= reach
            }
            _ => false,
        };
        let n = tracks.len();
        let pairs: Vec<(f64, usize, usize)> = (0..n)
            .flat_map(|a| (0..n).map(move |b| (a, b)))
            .filter(|&(a, b)| a != b && follows(&tracks[a], &tracks[b]))
            .map(|(a, b)| (apart(&tracks[a], &tracks[b]), a, b))
            .collect();
        let gap = |a: usize, b: usize| spans[b].0 - spans[a].1;
        // One that is seen in between and may be the same decides first.
        let between = |a: usize, b: usize| {
            let ends = pairs.iter().filter(|p| p.1 == a && p.0 < SAME_LOOK).map(|p| p.2);
            ends.into_iter().any(|c| spans[c].1 < spans[b].0)
        };
        let clear = |&&(d, a, b): &&(f64, usize, usize)| {
            let rivals = pairs
                .iter()
                .filter(|p| (p.1 == a && p.2 != b && meet(p.2, b)) || (p.2 == b && p.1 != a && meet(p.1, a)));
            d < SAME_LOOK
                && !between(a, b)
                && rivals.map(|p| p.0).fold(f64::INFINITY, f64::min) > d + CLEAR_LOOK
        };
        let Some(&(_, a, b)) = pairs.iter().filter(clear).min_by_key(|p| gap(p.1, p.2)) else { return };
        let mut pieces = tracks[a].pieces.clone();
        pieces.extend(tracks[b].pieces.iter().cloned());
        tracks[a] = Track::of(pieces, radius_px);
        tracks.remove(b);
    }
}

#[cfg(test)]
mod tests {
    use super::super::tracklet::Tracklet;
    use super::*;

    /// A stretch of a marker of a peak and an area that goes to and fro.
    fn stretch(pictures: std::ops::Range<usize>, peak: f64, area: f64) -> Track {
        let spot = |k: usize| {
            let x = 100.0 + 40.0 * (0.2 * k as f64).sin();
            let (y, elongation, direction) = (80.0, 1.0, 0.0);
            let (length, snr, doubt_px) = (8.0, 30.0, 0.0);
            (k, Spot { x, y, peak, area, elongation, direction, length, snr, doubt_px })
        };
        Track::of(Tracklet::runs(&pictures.map(spot).collect::<Vec<_>>()), 8.0)
    }

    fn joined(mut tracks: Vec<Track>) -> Vec<usize> {
        join_by_look(&mut tracks, 8.0);
        let mut counts: Vec<usize> = tracks.iter().map(|t| t.count).collect();
        counts.sort_unstable();
        counts
    }

    #[test]
    fn stretches_are_joined_by_their_area_though_their_contrast_changes() {
        // The first and the last are the smaller one of two that are seen meanwhile.
        let small = |p: std::ops::Range<usize>, peak: f64| stretch(p, peak, 600.0);
        let three = vec![small(0..50, 42.0), small(60..200, 51.0), small(230..300, 38.0)];
        let other = stretch(70..190, 35.0, 900.0);
        assert_eq!(joined([three.clone(), vec![other]].concat()), [120, 260]);
        // Of two that are alike nothing tells which it is.
        let twin = small(70..190, 47.0);
        assert_eq!(joined([three, vec![twin]].concat()), [50, 70, 120, 140]);
    }
}
