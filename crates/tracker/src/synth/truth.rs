//! Computes the truth of a frame: where every marker is and how much of it can be seen.
//!
//! Owns: [`NodeTruth`], [`FrameTruth`], `visible_part`. The table's form is in [`super::truth_table`].

use super::coverage::{Quad, disc_rectangle_area};
use super::film::Film;
use super::render::{instant_s, instants};
use super::scene::within;

/// One marker in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NodeTruth {
    /// Centre in the middle of the exposure, px; x right. Given also when hidden or outside the image.
    pub x_px: f64,
    /// Centre in the middle of the exposure, px; y down.
    pub y_px: f64,
    /// Mean of the centre over the exposure, px: the centroid of the blurred marker. Differs from `x_px` where the
    /// path bends.
    pub mean_x_px: f64,
    /// Mean of the centre over the exposure, px.
    pub mean_y_px: f64,
    /// Part of the marker's area that is seen, 0 to 1, averaged over the exposure: 1 less what links and markers in
    /// front, screens and the image's border hide. Glints hide nothing.
    pub visible: f64,
}

/// One frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FrameTruth {
    /// Index of the frame.
    pub frame: u64,
    /// Time, s.
    pub time_s: f64,
    /// Markers in the scene's order.
    pub nodes: Vec<NodeTruth>,
    /// Angles of the links, rad, counter-clockwise positive, 0 hanging down, unwrapped.
    pub phi_rad: Vec<f64>,
}

impl Film {
    /// Truth of a frame.
    pub fn truth(&self, index: u64) -> FrameTruth {
        let scene = &self.scene;
        let border = Border { size_px: scene.image_px.map(f64::from), sides: self.pixel_aspect.sides() };
        let time_s = self.time_s(index);
        let mut poses = Vec::new();
        let n = instants(self, index, &mut poses);
        // The seen part changes slowly: at most 16 instants of the exposure tell it.
        let n = n.min(16);
        let hidden_links = self.hidden_links(index);
        let hidden_markers = self.hidden_markers(index);
        let black = scene.dropouts.iter().any(|d| within(index, d.first, d.count));
        let mut nodes = vec![
            NodeTruth { x_px: 0.0, y_px: 0.0, mean_x_px: 0.0, mean_y_px: 0.0, visible: 0.0 };
            scene.markers.len()
        ];
        let (mut quads, mut discs) = (Vec::new(), Vec::new());
        for k in 0..n {
            self.mechanism.poses(time_s + instant_s(scene.camera.exposure_s, k, n), &mut poses);
            for (j, m) in scene.markers.iter().enumerate() {
                let link = self.marker_links[j];
                let plane = poses[link].point(m.at_px);
                let at = self.seen(plane);
                nodes[j].mean_x_px += at[0] / n as f64;
                nodes[j].mean_y_px += at[1] / n as f64;
                if black || hidden_links[link] || hidden_markers[j] {
                    continue;
                }
                quads.clear();
                discs.clear();
                quads.extend(
                    (0..link).filter(|&i| !hidden_links[i]).filter_map(|i| self.seen_bar(i, &poses[i])),
                );
                quads.extend(scene.screens.iter().map(|s| Quad {
                    origin: [0.0, 0.0],
                    along: [1.0, 0.0],
                    across: [0.0, 1.0],
                    u: [s.edges_px[0], s.edges_px[2]],
                    v: [s.edges_px[1], s.edges_px[3]],
                }));
                for (o, other) in scene.markers.iter().enumerate() {
                    let front = self.marker_links[o];
                    let before = front < link || (front == link && o > j);
                    if before && !hidden_links[front] && !hidden_markers[o] {
                        let there = poses[front].point(other.at_px);
                        let p = self.seen(there);
                        discs.push([p[0], p[1], other.radius_px * self.scale(there)]);
                    }
                }
                nodes[j].visible +=
                    visible_part(at, m.radius_px * self.scale(plane), &quads, &discs, &border) / n as f64;
            }
        }
        self.mechanism.poses(time_s, &mut poses);
        for (j, m) in scene.markers.iter().enumerate() {
            [nodes[j].x_px, nodes[j].y_px] = self.seen(poses[self.marker_links[j]].point(m.at_px));
        }
        FrameTruth { frame: index, time_s, nodes, phi_rad: poses.iter().map(|p| p.phi_rad).collect() }
    }
}

/// The picture: its size, and the width and height of its pixels, whose area is 1.
struct Border {
    size_px: [f64; 2],
    sides: [f64; 2],
}

/// Part of the disc about `(x, y)` that `quads` and `discs` (x, y, radius) leave free, inside the picture. Radii are in units of the
/// square of a pixel's area.
///
/// Exact where one rectangle or the border hides some of it; where several things do, by 4096 points of equal area
/// on the disc (miscounted on the edges only, under 0.01), as for rectangles in pixels that are not square.
fn visible_part([x, y]: [f64; 2], r: f64, quads: &[Quad], discs: &[[f64; 3]], border: &Border) -> f64 {
    let Border { size_px: size, sides: [wide, high] } = *border;
    let area = std::f64::consts::PI * r * r;
    let edges = |end: f64, side: f64| [-0.5 * side, (end - 0.5) * side];
    let inside =
        disc_rectangle_area(x * wide, y * high, r, edges(size[0], wide), edges(size[1], high)) / area;
    if inside <= 0.0 {
        return 0.0;
    }
    let cut = inside < 1.0 - 1e-12;
    let mut single = 0.0;
    let mut near = 0;
    for q in quads {
        // A circle about the disc, where that is none in the picture.
        let reach = r * wide.max(high);
        let hidden = q.disc_area(x, y, reach) / (area * (reach / r).powi(2));
        if hidden >= 1.0 - 1e-12 {
            return 0.0;
        }
        if hidden > 1e-12 {
            near += if wide == high { 1 } else { 2 };
            single = hidden;
        }
    }
    let covers = |d: &&[f64; 3]| ((d[0] - x) * wide).hypot((d[1] - y) * high) < d[2] + r;
    let discs_near = discs.iter().filter(covers).count();
    match (near, discs_near, cut) {
        (0, 0, _) => inside.min(1.0),
        (1, 0, false) => 1.0 - single,
        _ => {
            const N: u32 = 64;
            let mut free = 0u32;
            for i in 0..N {
                let radius = r * ((f64::from(i) + 0.5) / f64::from(N)).sqrt();
                for k in 0..N {
                    // Turned from ring to ring so that no ray runs along an edge.
                    let angle = (f64::from(k) + 0.618 * f64::from(i)) * std::f64::consts::TAU / f64::from(N);
                    let (px, py) = (x + radius * angle.cos() / wide, y + radius * angle.sin() / high);
                    let hidden = px < -0.5
                        || py < -0.5
                        || px > size[0] - 0.5
                        || py > size[1] - 0.5
                        || quads.iter().any(|q| q.contains(px, py))
                        || discs.iter().any(|d| {
                            ((d[0] - px) * wide).powi(2) + ((d[1] - py) * high).powi(2) < d[2] * d[2]
                        });
                    free += u32::from(!hidden);
                }
            }
            f64::from(free) / f64::from(N * N)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain(u: [f64; 2], v: [f64; 2]) -> Quad {
        Quad { origin: [0.0, 0.0], along: [1.0, 0.0], across: [0.0, 1.0], u, v }
    }

    /// A picture of square pixels.
    fn square(side: f64) -> Border {
        Border { size_px: [side; 2], sides: [1.0; 2] }
    }

    #[test]
    fn half_behind_a_bar_is_one_half() {
        let q = plain([20.0, 50.0], [0.0, 50.0]);
        assert!((visible_part([20.0, 25.0], 4.0, &[q], &[], &square(99.0)) - 0.5).abs() < 1e-12);
        assert_eq!(visible_part([30.0, 25.0], 4.0, &[q], &[], &square(99.0)), 0.0);
        assert!((visible_part([60.0, 25.0], 4.0, &[q], &[], &square(99.0)) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn two_bars_over_the_same_half_hide_it_once() {
        let q = plain([20.0, 50.0], [0.0, 50.0]);
        let v = visible_part([20.0, 25.0], 4.0, &[q, q], &[], &square(99.0));
        assert!((v - 0.5).abs() < 0.01, "{v}");
    }

    #[test]
    fn the_border_cuts() {
        let v = visible_part([-0.5, 20.0], 5.0, &[], &[], &square(40.0));
        assert!((v - 0.5).abs() < 1e-12, "{v}");
        let corner = visible_part([-0.5, -0.5], 5.0, &[], &[], &square(40.0));
        assert!((corner - 0.25).abs() < 1e-12, "{corner}");
    }

    #[test]
    fn what_hides_is_counted_in_pixels_that_are_not_square_too() {
        // Twice as wide as high: the disc is half as wide in them as it is high.
        let [wide, high] = [2f64.sqrt(), 0.5f64.sqrt()];
        let border = Border { size_px: [40.0; 2], sides: [wide, high] };
        assert!((visible_part([-0.5, 20.0], 5.0, &[], &[], &border) - 0.5).abs() < 1e-12);
        let half = 5.0 / wide;
        for (from, free) in [(20.0, 0.5), (20.0 + half, 1.0), (20.0 - half, 0.0)] {
            let v = visible_part([20.0, 20.0], 5.0, &[plain([from, 60.0], [0.0, 60.0])], &[], &border);
            assert!((v - free).abs() < 0.01, "{from}: {v}");
        }
        let beside = [20.0, 20.0 + 8.0 / high, 5.0];
        assert!(visible_part([20.0, 20.0], 5.0, &[], &[beside], &border) < 1.0);
        assert_eq!(visible_part([20.0, 20.0], 5.0, &[], &[[20.0 + 11.0 / wide, 20.0, 5.0]], &border), 1.0);
    }

    #[test]
    fn a_marker_in_front_hides() {
        let v = visible_part([20.0, 20.0], 4.0, &[], &[[20.0, 20.0, 2.0]], &square(40.0));
        assert!((v - 0.75).abs() < 0.01, "{v}");
    }
}
