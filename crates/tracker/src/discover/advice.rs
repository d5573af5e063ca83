//! Advises what to change about a rig, a camera or a recording before trusting it.
//!
//! Owns: [`advise`]. Must not: look at pixels.

use nalgebra::Vector2;

use super::signature::Signatures;
use crate::rig::Rig;
use crate::table::Rows;

/// Signatures that differ by less are too alike, px: some times the misfit of a compressed film.
const ALIKE_PX: f64 = 1.5;
/// Markers this near to each other, in radii, run together in the picture.
const MERGING_RADII: f64 = 2.5;

/// Causes of names that are hard to tell in a recording, the likeliest first, a sentence each. `rate_hz` is the rate of the recording, if known;
/// `rows` some of its nodes' frames.
pub fn causes(rig: &Rig, rows: &Rows, rate_hz: Option<f64>) -> Vec<String> {
    let home = home(rig);
    let mut out: Vec<String> = rate(rig, &home, rows, rate_hz).into_iter().collect();
    out.extend(alike(rig, &home));
    for body in &rig.bodies {
        let own: Vec<&str> =
            rig.nodes.iter().filter(|n| n.body == body.name).map(|n| n.name.as_str()).collect();
        if let [a, b] = own[..] {
            out.push(format!(
                "{} has two markers, {a} and {b}, which look the same after half a turn: a third one would tell them apart",
                body.name
            ));
        }
    }
    out.extend(merging(rig, rows));
    out
}

/// Warnings, a sentence each. `rate_hz` is the rate of the recording, if known; `rows` its nodes.
pub fn advise(rig: &Rig, rows: &Rows, rate_hz: Option<f64>) -> Vec<String> {
    let home = home(rig);
    let mut out = Vec::new();
    out.extend(rate(rig, &home, rows, rate_hz));
    out.extend(alike(rig, &home));
    out.extend(merging(rig, rows));
    out.extend(not_at_rest(rig, rows));
    out
}

/// The nodes' places in the reference picture, square px.
fn home(rig: &Rig) -> Vec<Vector2<f64>> {
    rig.nodes.iter().map(|a| rig.pixel_aspect.to_square(Vector2::new(a.x_px, a.y_px))).collect()
}

/// Nodes of a body that its others do not tell apart.
fn alike(rig: &Rig, home: &[Vector2<f64>]) -> Vec<String> {
    let n = rig.nodes.len();
    let mut out = Vec::new();
    for (b, body) in rig.bodies.iter().enumerate() {
        let nodes: Vec<usize> = (0..n).filter(|&i| rig.node_bodies()[i] == b).collect();
        let places: Vec<Vector2<f64>> = nodes.iter().map(|&i| home[i]).collect();
        for (i, j) in Signatures::new(&places).alike(ALIKE_PX) {
            out.push(format!(
                "nodes {} and {} of body {} have the same distances to its other nodes: move one of them by a \
                 few pixels, so that it can be told which comes back",
                rig.nodes[nodes[i]].name, rig.nodes[nodes[j]].name, body.name
            ));
        }
    }
    out
}

/// Of node `k` in frame `t` in square pixels.
fn place(rig: &Rig, rows: &Rows, t: usize, k: usize) -> Option<Vector2<f64>> {
    let at = 2 * (t * rig.nodes.len() + k);
    let p = rig.pixel_aspect.to_square(Vector2::new(rows.xy_px[at], rows.xy_px[at + 1]));
    p.x.is_finite().then_some(p)
}

/// The greatest step against half the spacing, what plain nearest neighbours need. Markers of other bodies come as near
/// as they like at any rate: they count only for a body of one.
fn rate(rig: &Rig, home: &[Vector2<f64>], rows: &Rows, rate_hz: Option<f64>) -> Option<String> {
    let n = rig.nodes.len();
    let bodies = rig.node_bodies();
    let nearest = |k: usize, own: bool| {
        let others = (0..n).filter(|&j| j != k && (!own || bodies[j] == bodies[k]));
        others.map(|j| (home[k] - home[j]).norm()).fold(f64::INFINITY, f64::min)
    };
    let mut worst: Option<(f64, usize, f64, f64)> = None;
    for k in 0..n {
        let spacing = if nearest(k, true).is_finite() { nearest(k, true) } else { nearest(k, false) };
        for t in 1..rows.frames() {
            if let (Some(a), Some(b)) = (place(rig, rows, t - 1, k), place(rig, rows, t, k))
                && rows.frame[t] == rows.frame[t - 1] + 1
            {
                let step = (b - a).norm();
                let ratio = step / (spacing / 2.0);
                if ratio > worst.map_or(1.0, |w| w.0) {
                    worst = Some((ratio, k, step, spacing));
                }
            }
        }
    }
    let (ratio, k, step, spacing) = worst?;
    let least = rate_hz.map_or_else(
        || format!("{ratio:.1} times the frame rate"),
        |r| format!("{:.0} frames a second", round_up(r * ratio)),
    );
    Some(format!(
        "node {} moves up to {step:.0} px in a frame, over half its {spacing:.0} px from the next: only the motion \
         of its body tells them apart. At least {least} would do without",
        rig.nodes[k].name
    ))
}

/// The next number of two digits and zeros that is over by a percent at least: the greatest step lies between frames,
/// and a chord is shorter than its arc.
fn round_up(rate_hz: f64) -> f64 {
    let unit = 10f64.powf(rate_hz.log10().floor() - 1.0);
    (1.01 * rate_hz / unit).ceil() * unit
}

fn merging(rig: &Rig, rows: &Rows) -> Vec<String> {
    let n = rig.nodes.len();
    let bodies = rig.node_bodies();
    let mut areas: Vec<f32> = rows.area_px.iter().copied().filter(|a| a.is_finite()).collect();
    areas.sort_by(f32::total_cmp);
    let Some(&area) = areas.get(areas.len() / 2) else { return Vec::new() };
    let radius = (f64::from(area) * rig.pixel_aspect.ratio() / std::f64::consts::PI).sqrt();
    let mut out = Vec::new();
    for i in 0..n {
        for j in i + 1..n {
            let near = (0..rows.frames())
                .filter_map(|t| Some((place(rig, rows, t, i)? - place(rig, rows, t, j)?).norm()))
                .fold(f64::INFINITY, f64::min);
            if near < MERGING_RADII * radius {
                let same = bodies[i] == bodies[j];
                out.push(format!(
                    "nodes {} and {} come within {near:.1} px, {:.1} of their radii, and merge in the picture{}",
                    rig.nodes[i].name,
                    rig.nodes[j].name,
                    near / radius,
                    if same { ": put them farther apart" } else { " when their bodies cross" }
                ));
            }
        }
    }
    out
}

fn not_at_rest(rig: &Rig, rows: &Rows) -> Option<String> {
    let n = rig.nodes.len();
    let t = rows.frame.iter().position(|&f| Some(f as u64) == rig.reference_frame)?;
    let before = if t > 0 { t - 1 } else { t + 1 };
    if before >= rows.frames() {
        return None;
    }
    let (k, step) = (0..n)
        .filter_map(|k| Some((k, (place(rig, rows, t, k)? - place(rig, rows, before, k)?).norm())))
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    (step > 0.5).then(|| {
        format!(
            "the reference picture, frame {}, is not at rest: node {} moves {step:.1} px in a frame, so angles have no zero \
             from it. Film the rig hanging still first, or give a rest recording",
            rig.reference_frame.unwrap_or(0),
            rig.nodes[k].name
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::scene::LinkMotion;
    use crate::synth::{Scene, preset};
    use crate::track::tests::bed::{Bed, QUIET, scene, tumble};

    fn advice(scene: &Scene) -> Vec<String> {
        let bed = Bed::new(scene, QUIET);
        let rig = bed.film.rig(0);
        advise(&rig, &bed.rows(&rig), Some(scene.rate_hz))
    }

    fn bare(rate_hz: f64, frames: u64) -> Scene {
        let mut s = preset("clean", 2000).unwrap();
        s.links.iter_mut().for_each(|l| l.width_px = 0.0);
        s.rate_hz = rate_hz;
        s.frames = frames;
        s
    }

    #[test]
    fn too_slow_a_camera_is_told_the_least_rate() {
        let said = advice(&bare(100.0, 400));
        let rate = said.iter().find(|w| w.contains("frames a second would do")).unwrap();
        let words: Vec<&str> = rate.split_whitespace().collect();
        let least: f64 = words[words.iter().position(|w| *w == "frames").unwrap() - 1].parse().unwrap();
        assert!(least > 100.0, "{rate}");
        // At that rate, over the same time, it is enough.
        let again = advice(&bare(least, (4.0 * least) as u64));
        assert!(!again.iter().any(|w| w.contains("frames a second would do")), "{again:?}");
    }

    #[test]
    fn alike_signatures_are_named_with_their_pair() {
        let layout = [[10.0, 0.0], [110.0, 0.0], [50.0, 30.0], [50.0, -30.0]];
        let link = ("kite", None, [360.0, 360.0], tumble(0.0, 5.0));
        let said = advice(&scene(2000, &[link], &layout.map(|at| ("kite", at))));
        assert!(
            said.iter().any(|w| w.contains("nodes m2 and m3 of body kite have the same distances")),
            "{said:?}"
        );
        assert!(!said.iter().any(|w| w.contains("m0 and")), "{said:?}");
    }

    #[test]
    fn markers_that_merge_and_a_reference_that_moves_are_told() {
        let said = advice(&bare(500.0, 1000));
        assert!(said.iter().any(|w| w.contains("merge in the picture when their bodies cross")), "{said:?}");
        assert!(
            said.iter().any(|w| w.contains("the reference picture, frame 0, is not at rest")),
            "{said:?}"
        );
        let still = LinkMotion::Swing {
            phi_rad: 0.0,
            amplitude_rad: 1.0,
            frequency_hz: 0.5,
            phase_rad: std::f64::consts::FRAC_PI_2,
            decay_per_s: 0.0,
        };
        // It begins at rest, at the turning point.
        let layout = [[20.0, 5.0], [70.0, -9.0], [130.0, 3.0]];
        let said =
            advice(&scene(2000, &[("rod", None, [360.0, 360.0], still)], &layout.map(|at| ("rod", at))));
        assert!(said.is_empty(), "{said:?}");
    }
}
