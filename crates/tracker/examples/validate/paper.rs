//! The paper's own method (Section 8.2) on the same detections, for comparison: mutual nearest neighbours from frame
//! to frame, and a detection left over is the missing node whose masked column of the nearest-neighbour matrix its own
//! neighbours match best. No gate, no prediction, no rigid test; nothing is left open.
//!
//! As in the paper it is told the bodies and the places of all nodes in a frame that shows them all, and starts there.

use tracker::rig::Rig;
use tracker::score::Tracked;
use tracker::store::DetectionStore;

type Place = [f64; 2];

fn apart(a: Place, b: Place) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// The others among `places`, nearest first.
fn neighbours(from: Place, places: &[(usize, Place)]) -> Vec<usize> {
    let mut near: Vec<(f64, usize)> = places.iter().map(|&(j, p)| (apart(from, p), j)).collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    near.into_iter().map(|n| n.1).collect()
}

/// Follows the nodes of `rig` from frame `start` of the store on.
pub fn follow(store: &DetectionStore, rig: &Rig, start: usize) -> Tracked {
    let n = rig.nodes.len();
    let home: Vec<Place> = rig.nodes.iter().map(|m| [m.x_px, m.y_px]).collect();
    let body = rig.node_bodies();
    let mates =
        |k: usize| (0..n).filter(move |&j| j != k).filter(|&j| body[j] == body[k]).collect::<Vec<_>>();
    let matrix: Vec<Vec<usize>> = (0..n)
        .map(|k| neighbours(home[k], &mates(k).into_iter().map(|j| (j, home[j])).collect::<Vec<_>>()))
        .collect();
    let mut last: Vec<Option<Place>> = home.iter().copied().map(Some).collect();
    let mut out = Tracked { nodes: rig.nodes.iter().map(|m| m.name.clone()).collect(), ..Tracked::default() };
    let mut detections = Vec::new();
    for i in start..store.len() {
        store.read(i, &mut detections);
        let seen: Vec<Place> = detections.iter().map(|d| [d.x_px, d.y_px]).collect();
        let mut now: Vec<Option<Place>> = vec![None; n];
        let mut free = vec![true; seen.len()];
        let nodes: Vec<(usize, Place)> =
            last.iter().enumerate().filter_map(|(k, p)| p.map(|p| (k, p))).collect();
        let stars: Vec<(usize, Place)> = seen.iter().copied().enumerate().collect();
        for &(k, p) in &nodes {
            if let Some(&d) = neighbours(p, &stars).first()
                && neighbours(seen[d], &nodes).first() == Some(&k)
            {
                now[k] = Some(seen[d]);
                free[d] = false;
            }
        }
        // What is left over is compared with the columns of the missing nodes, the best match first.
        let mut matches: Vec<(f64, usize, usize)> = Vec::new();
        for k in (0..n).filter(|&k| now[k].is_none()) {
            let masked: Vec<usize> = matrix[k].iter().copied().filter(|&j| now[j].is_some()).collect();
            let there: Vec<(usize, Place)> = masked.iter().filter_map(|&j| now[j].map(|p| (j, p))).collect();
            for d in (0..seen.len()).filter(|&d| free[d]) {
                let column = neighbours(seen[d], &there);
                let same = column.iter().zip(&masked).filter(|(a, b)| a == b).count();
                matches.push((same as f64 / masked.len().max(1) as f64, k, d));
            }
        }
        matches.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
        for (_, k, d) in matches {
            if now[k].is_none() && free[d] {
                now[k] = Some(seen[d]);
                free[d] = false;
            }
        }
        out.frames.push(store.stamp(i).index);
        out.xy_px.extend(now.iter().map(|p| p.unwrap_or([f64::NAN; 2])));
        last = now;
    }
    out
}
