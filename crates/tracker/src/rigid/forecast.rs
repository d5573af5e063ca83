//! Predicts a body's pose from its last poses, with the error to expect.
//!
//! Owns: [`Motion`], [`Forecast`]. Must not: look at detections.

use nalgebra::{Isometry2, Vector2};

use super::pose::{PoseFit, place, pose_at};

/// Gate of a prediction, in units of the largest of about twenty last one-frame errors. The largest of twenty normal
/// errors is about 2 sigma, so the gate is about 4 sigma.
const GATE_ERRORS: f64 = 2.0;
/// Decay per frame of the largest prediction error: half in 14 frames.
const ERROR_DECAY: f64 = 0.95;
/// Gate of a forecast, in units of its standard error: 3 sigma.
const GATE_SIGMA: f64 = 3.0;
/// Frames after which earlier poses say nothing of the rates.
const LONGEST_GAP_FRAMES: f64 = 3.5;

/// A predicted pose and how far the body may be from it.
#[derive(Debug, Clone, Copy)]
pub struct Forecast {
    /// The pose.
    pub pose: Isometry2<f64>,
    /// Half width of the angles that are possible, rad; pi or more is every angle.
    pub angle_rad: f64,
    /// Radius of the places of the origin that are possible, px.
    pub origin_px: f64,
}

impl Forecast {
    /// The forecast of a body whose point `local` is known to be at `there`.
    pub fn hung(mut self, local: Vector2<f64>, there: Vector2<f64>) -> Self {
        self.pose = hung_at(&self.pose, local, there);
        self.origin_px = 0.0;
        self
    }
}

/// Error of the pose predicted one frame ahead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PredictionError {
    /// Of the angle, rad.
    pub angle_rad: f64,
    /// Of the origin, px.
    pub origin_px: f64,
}

/// The last poses of a body, at most three, newest last.
#[derive(Debug, Clone, Default)]
pub struct Motion {
    /// Time in frames, unwrapped angle in rad, origin in px.
    past: Vec<(f64, f64, Vector2<f64>)>,
    /// Errors of past predictions by one frame, the greatest with a slow decay.
    prediction_error: Option<PredictionError>,
    /// Standard uncertainty of the last pose: angle, origin.
    sigma: (f64, f64),
}

impl Motion {
    /// A motion of which one pose is known.
    pub fn at(time: f64, pose: &Isometry2<f64>) -> Self {
        let past = vec![(time, pose.rotation.angle(), pose.translation.vector)];
        Self { past, ..Self::default() }
    }

    /// Time of the newest pose, frames.
    pub fn newest(&self) -> Option<f64> {
        self.past.last().map(|p| p.0)
    }

    /// The newest pose.
    pub fn newest_pose(&self) -> Option<Isometry2<f64>> {
        self.past.last().map(|&(_, angle, origin)| pose_at(angle, Vector2::zeros(), origin))
    }

    /// Whether a pose is known of this frame or the one before it, either way in time.
    pub fn was_just_seen(&self, time: f64) -> bool {
        self.newest().is_some_and(|t| (time - t).abs() < 1.5)
    }

    /// The newest pose where it was just seen and too few are known to carry it on.
    pub fn fresh(&self, time: f64) -> Option<Isometry2<f64>> {
        self.newest_pose().filter(|_| self.past.len() < 3 && self.was_just_seen(time))
    }

    /// Forgets the poses; how far predictions erred stays.
    pub fn forget(&mut self) {
        self.past.clear();
    }

    /// The number of poses that carry the prediction.
    pub fn depth(&self) -> usize {
        self.past.len()
    }

    /// Polynomial through the past poses at `time`.
    fn carried(&self, time: f64) -> Option<(f64, Vector2<f64>)> {
        let &(t0, a0, o0) = self.past.last()?;
        let h = time - t0;
        let n = self.past.len();
        if n == 1 {
            return Some((a0, o0));
        }
        let (t1, a1, o1) = self.past[n - 2];
        let (va, vo) = ((a0 - a1) / (t0 - t1), (o0 - o1) / (t0 - t1));
        if n == 2 {
            return Some((a0 + va * h, o0 + vo * h));
        }
        // Newton's form: the third difference carries the curvature.
        let (t2, a2, o2) = self.past[n - 3];
        let (ua, uo) = ((a1 - a2) / (t1 - t2), (o1 - o2) / (t1 - t2));
        let (ca, co) = ((va - ua) / (t0 - t2), (vo - uo) / (t0 - t2));
        Some((a0 + va * h + ca * h * (time - t1), o0 + vo * h + co * h * (time - t1)))
    }

    /// The pose at `time` and how far off it may be. `floor` is the lower bound of the prediction error,
    /// `first` how far a body of which only one pose is known may go in one frame.
    pub fn forecast(&self, time: f64, floor: PredictionError, first: PredictionError) -> Option<Forecast> {
        let (angle, origin) = self.carried(time)?;
        let m = (time - self.newest()?).abs().max(1.0);
        let (angle_rad, origin_px) = match self.past.len() {
            1 => (first.angle_rad * m, first.origin_px * m),
            2 => {
                // Only the rate is known: the error grows with the square of the time.
                let u = self.prediction_error(floor);
                let grow = m * (m + 1.0) / 2.0;
                (
                    (u.angle_rad * GATE_SIGMA).max(0.5 * first.angle_rad) * grow,
                    (u.origin_px * GATE_SIGMA).max(0.5 * first.origin_px) * grow,
                )
            }
            _ => {
                // With the curvature known it grows with the cube; the poses' own noise comes with it.
                let u = self.prediction_error(floor);
                let grow = m * (m + 1.0) * (m + 2.0) / 6.0;
                let noise = GATE_SIGMA * (1.0 + 3.0 * m * (m + 1.0) / 2.0);
                (
                    GATE_SIGMA * u.angle_rad * grow + noise * self.sigma.0,
                    GATE_SIGMA * u.origin_px * grow + noise * self.sigma.1,
                )
            }
        };
        let pose = pose_at(angle, Vector2::zeros(), origin);
        Some(Forecast { pose, angle_rad, origin_px })
    }

    /// The pose at `time` with no more room than the last predictions needed; `None` while that is not known.
    pub fn settled_forecast(&self, time: f64) -> Option<Forecast> {
        let own = self.prediction_error.filter(|_| self.past.len() == 3)?;
        let mut f = self.forecast(time, own, own)?;
        if self.was_just_seen(time) {
            // What predictions by one frame erred by holds the poses' noise already.
            f.angle_rad = f.angle_rad.min(GATE_ERRORS * own.angle_rad);
            f.origin_px = f.origin_px.min(GATE_ERRORS * own.origin_px);
        }
        Some(f)
    }

    fn prediction_error(&self, floor: PredictionError) -> PredictionError {
        let own = self.prediction_error.unwrap_or(floor);
        PredictionError {
            angle_rad: own.angle_rad.max(floor.angle_rad),
            origin_px: own.origin_px.max(floor.origin_px),
        }
    }

    /// Adds the pose found at `time`. Returns by how much the prediction by one frame failed, if there was one.
    pub fn add(&mut self, time: f64, fit: &PoseFit) -> Option<PredictionError> {
        if self.newest() == Some(time) {
            // The same frame again, as where two directions of time meet: the newer pose stands.
            self.past.pop();
        }
        let mut angle = fit.pose.rotation.angle();
        let origin = fit.pose.translation.vector;
        let mut missed = None;
        if let Some((guess, place)) = self.carried(time) {
            // The turn that is nearest to the prediction.
            angle += std::f64::consts::TAU * ((guess - angle) / std::f64::consts::TAU).round();
            let step = self.newest().map_or(1.0, |t| (time - t).abs());
            if self.past.len() == 3 && step < 1.5 {
                let now =
                    PredictionError { angle_rad: (angle - guess).abs(), origin_px: (origin - place).norm() };
                missed = Some(now);
                self.prediction_error = Some(self.prediction_error.map_or(now, |old| PredictionError {
                    angle_rad: now.angle_rad.max(ERROR_DECAY * old.angle_rad),
                    origin_px: now.origin_px.max(ERROR_DECAY * old.origin_px),
                }));
            }
        }
        // Poses before a gap say nothing of the rates after it.
        if self.newest().is_some_and(|t| (time - t).abs() > LONGEST_GAP_FRAMES) {
            self.past.clear();
        }
        if self.past.len() == 3 {
            self.past.remove(0);
        }
        self.past.push((time, angle, origin));
        self.sigma = (fit.sigma_angle_rad, fit.sigma_at(Vector2::zeros()));
        missed
    }
}

/// Moves a pose so that `local` is at `there`, its angle unchanged.
pub fn hung_at(pose: &Isometry2<f64>, local: Vector2<f64>, there: Vector2<f64>) -> Isometry2<f64> {
    let mut out = *pose;
    out.translation.vector += there - place(pose, local);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constant_acceleration_is_carried_exactly_and_backwards_too() {
        for direction in [1.0, -1.0] {
            let mut motion = Motion::default();
            let angle = |t: f64| 3.0 + 0.5 * t - 0.02 * t * t;
            let fit = |t: f64| PoseFit {
                pose: Isometry2::new(Vector2::new(t, 2.0 * t), angle(t)),
                centre: Vector2::zeros(),
                sigma_angle_rad: 1e-4,
                sigma_centre_px: 0.01,
                chi2: 0.0,
            };
            for k in 0..3 {
                motion.add(direction * f64::from(k), &fit(direction * f64::from(k)));
            }
            let none = PredictionError { angle_rad: 0.0, origin_px: 0.0 };
            let next = motion.forecast(direction * 3.0, none, none).unwrap();
            let miss =
                (next.pose.rotation.angle() - angle(direction * 3.0)).rem_euclid(std::f64::consts::TAU);
            assert!(miss.min(std::f64::consts::TAU - miss) < 1e-12);
            assert!((next.pose.translation.vector.y - direction * 6.0).abs() < 1e-12);
        }
    }
}
