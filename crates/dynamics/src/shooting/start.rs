//! Guesses the state somewhere in a recording: local cubics through the angles.

use nalgebra::{Matrix4, Vector4};

use super::problem::Recording;
use crate::state::State;

/// Half width of the window of the local cubic, s, and the fewest samples in it.
const HALF_WIDTH_S: f64 = 0.012;
const FEWEST: usize = 9;

/// Angles and rates at `t_s` from weighted local cubics through the samples around it. `None` when a link has fewer
/// than four samples in reach.
#[must_use]
pub fn local_state(recording: &Recording<'_>, t_s: f64) -> Option<State<f64>> {
    let mut state = [0.0; 4];
    let t = recording.t_s;
    for j in 0..recording.links {
        let centre = t.partition_point(|&x| x < t_s);
        let (mut low, mut high) = (centre, centre);
        let mut count = 0;
        // Grow the window on the nearer side until it is wide enough and holds enough samples.
        loop {
            let left = low.checked_sub(1).map(|i| t_s - t[i]);
            let right = (high < t.len()).then(|| t[high] - t_s);
            let (reach, take_left) = match (left, right) {
                (Some(l), Some(r)) => {
                    if l <= r {
                        (l, true)
                    } else {
                        (r, false)
                    }
                }
                (Some(l), None) => (l, true),
                (None, Some(r)) => (r, false),
                (None, None) => break,
            };
            if reach > HALF_WIDTH_S && count >= FEWEST {
                break;
            }
            let i = if take_left { low - 1 } else { high };
            if take_left {
                low -= 1
            } else {
                high += 1
            }
            count += usize::from(recording.seen(i, j));
        }
        let scale = t[low..high].iter().map(|x| (x - t_s).abs()).fold(f64::MIN_POSITIVE, f64::max);
        let (mut m, mut v) = (Matrix4::zeros(), Vector4::zeros());
        for i in (low..high).filter(|&i| recording.seen(i, j)) {
            let u = (t[i] - t_s) / scale;
            let row = Vector4::new(1.0, u, u * u, u * u * u);
            m += row * row.transpose();
            v += row * recording.phi_rad[j][i];
        }
        let c = m.cholesky()?.solve(&v);
        state[j] = c[0];
        state[2 + j] = c[1] / scale;
    }
    Some(state)
}
