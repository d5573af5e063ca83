//! Finds a template's place to a hundredth of a pixel: inverse-compositional Gauss-Newton.
//!
//! Owns: [`align`], [`Match`]. Must not: search far.

use super::surface::Surface;
use super::template::{Line, Pose, Template, normalise};

/// Rounds, and the step at which they end: a thousandth of a pixel, and as much at the template's edge.
const ROUNDS: usize = 30;
const SMALL_STEP_PX: f64 = 1e-3;

/// A place of a template.
#[derive(Debug, Clone, Copy)]
pub struct Match {
    /// Where.
    pub pose: Pose,
    /// Likeness: normalised cross-correlation, -1 to 1.
    pub likeness: f64,
    /// Standard uncertainty of each coordinate of the place, px.
    pub sigma_px: f64,
}

/// The values that a picture has at a template's points, of mean 0 and sum of squares 1; `None` beyond its border.
fn seen(template: &Template, surface: &Surface, pose: &Pose) -> Option<Vec<f64>> {
    let mut values = Vec::with_capacity(template.points.len());
    for &point in &template.points {
        values.push(surface.value(pose.place(point))?);
    }
    normalise(&mut values).map(|_| values)
}

/// The place nearest to a start at which the picture is most like the template; `None` where there is none.
pub fn align(template: &Template, surface: &Surface, start: Pose) -> Option<Match> {
    let mut pose = start;
    for _ in 0..ROUNDS {
        let values = seen(template, surface, &pose)?;
        let right: Line = template
            .slopes
            .iter()
            .zip(values.iter().zip(&template.values))
            .map(|(slope, (now, then))| slope * (now - then))
            .sum();
        let step = template.inverse * right;
        pose = pose.less(&step);
        let far = pose.off(&start) > template.radius_px || (pose.angle - start.angle).abs() > 1.0;
        if far || (pose.log_size - start.log_size).abs() > 0.5 || !pose.x.is_finite() {
            return None;
        }
        let edge = step[2].hypot(step[3]) * template.radius_px;
        if step[0].hypot(step[1]).max(edge) < SMALL_STEP_PX {
            let values = seen(template, surface, &pose)?;
            let remains: Vec<f64> = values.iter().zip(&template.values).map(|(a, b)| a - b).collect();
            let likeness = 1.0 - remains.iter().map(|r| r * r).sum::<f64>() / 2.0;
            let sigma_px = template.sigma_px(&remains) * pose.log_size.exp();
            return Some(Match { pose, likeness, sigma_px });
        }
    }
    None
}
