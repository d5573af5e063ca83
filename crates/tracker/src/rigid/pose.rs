//! Fits the pose of a rigid body in the image by weighted least squares.
//!
//! Owns: [`Pair`], [`PoseFit`], [`fit_pose`]. Must not: decide which detection is which node.
//!
//! Angles are those of image coordinates (x right, y down): positive turns x towards y.

use nalgebra::{Isometry2, Point2, Translation2, UnitComplex, Vector2};

/// A point of the body and where it was seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// In the body's own coordinates, px.
    pub local: Vector2<f64>,
    /// In the image, px.
    pub place: Vector2<f64>,
    /// Standard uncertainty of each coordinate of `place`, px, above 0.
    pub sigma_px: f64,
}

/// A pose with its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseFit {
    /// Takes the body's coordinates to the image.
    pub pose: Isometry2<f64>,
    /// Weighted mean of the points used, in the body's coordinates: there the place is known best.
    pub centre: Vector2<f64>,
    /// Standard uncertainty of the angle, rad.
    pub sigma_angle_rad: f64,
    /// Standard uncertainty of each coordinate of `centre` in the image, px.
    pub sigma_centre_px: f64,
    /// Sum of squared residuals over their variances.
    pub chi2: f64,
}

impl PoseFit {
    /// Standard uncertainty of each coordinate of the image of `local`, px (the larger of the two directions).
    pub fn sigma_at(&self, local: Vector2<f64>) -> f64 {
        self.sigma_centre_px.hypot((local - self.centre).norm() * self.sigma_angle_rad)
    }
}

/// Image of a point of the body.
pub fn place(pose: &Isometry2<f64>, local: Vector2<f64>) -> Vector2<f64> {
    (pose * Point2::from(local)).coords
}

/// The weighted least-squares pose that takes the points of the body to their places.
///
/// `None` for fewer than two points, for points that coincide in the body, and for places from which no
/// direction follows (all at one place).
pub fn fit_pose(pairs: &[Pair]) -> Option<PoseFit> {
    let mut sum = 0.0;
    let (mut local, mut seen) = (Vector2::zeros(), Vector2::zeros());
    for p in pairs {
        let w = p.sigma_px.powi(-2);
        sum += w;
        local += w * p.local;
        seen += w * p.place;
    }
    if pairs.len() < 2 || !sum.is_finite() || sum <= 0.0 {
        return None;
    }
    let (local, seen) = (local / sum, seen / sum);
    // The best angle maximises sum w (R a) . b: it is the argument of sum w conj(a) b.
    let (mut dot, mut cross, mut inertia) = (0.0, 0.0, 0.0);
    for p in pairs {
        let w = p.sigma_px.powi(-2);
        let (a, b) = (p.local - local, p.place - seen);
        dot += w * a.dot(&b);
        cross += w * a.perp(&b);
        inertia += w * a.norm_squared();
    }
    let strength = dot.hypot(cross);
    if !(strength > 1e-9 * inertia && inertia > 0.0) {
        return None;
    }
    let rotation = UnitComplex::from_cos_sin_unchecked(dot / strength, cross / strength);
    let pose = Isometry2::from_parts(Translation2::from(seen - rotation * local), rotation);
    let chi2 =
        pairs.iter().map(|p| (place(&pose, p.local) - p.place).norm_squared() / p.sigma_px.powi(2)).sum();
    Some(PoseFit {
        pose,
        centre: local,
        sigma_angle_rad: inertia.powf(-0.5),
        sigma_centre_px: sum.powf(-0.5),
        chi2,
    })
}

/// The pose with a given angle that takes `local` to `place`.
pub fn pose_at(angle_rad: f64, local: Vector2<f64>, place: Vector2<f64>) -> Isometry2<f64> {
    let rotation = UnitComplex::new(angle_rad);
    Isometry2::from_parts(Translation2::from(place - rotation * local), rotation)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(x: f64, y: f64, pose: &Isometry2<f64>, sigma_px: f64) -> Pair {
        let local = Vector2::new(x, y);
        Pair { local, place: place(pose, local), sigma_px }
    }

    #[test]
    fn an_exact_motion_is_found_exactly() {
        let truth = pose_at(2.5, Vector2::new(3.0, 4.0), Vector2::new(100.0, 50.0));
        let pairs =
            [pair(0.0, 0.0, &truth, 0.1), pair(30.0, 1.0, &truth, 0.1), pair(-5.0, 60.0, &truth, 0.3)];
        let fit = fit_pose(&pairs).unwrap();
        // Rounding only: coordinates of some hundred pixels carry 1e-13.
        assert!((fit.pose.rotation.angle() - 2.5).abs() < 1e-12);
        assert!((place(&fit.pose, Vector2::new(3.0, 4.0)) - Vector2::new(100.0, 50.0)).norm() < 1e-11);
        assert!(fit.chi2 < 1e-18);
    }

    #[test]
    fn the_stated_uncertainty_is_the_scatter() {
        use rand::SeedableRng;
        use rand_distr::{Distribution, Normal};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let truth = pose_at(-0.7, Vector2::zeros(), Vector2::new(300.0, 200.0));
        let normal = Normal::new(0.0, 1.0).unwrap();
        let (mut angle, mut elbow, n) = (0.0, 0.0, 4000);
        let (mut said_angle, mut said_elbow) = (0.0, 0.0);
        let end = Vector2::new(0.0, 150.0);
        for _ in 0..n {
            let pairs = [(0.0, 0.0, 0.05), (20.0, 40.0, 0.1), (-10.0, 90.0, 0.2)].map(|(x, y, s)| {
                let mut p = pair(x, y, &truth, s);
                p.place += s * Vector2::new(normal.sample(&mut rng), normal.sample(&mut rng));
                p
            });
            let fit = fit_pose(&pairs).unwrap();
            angle += (fit.pose.rotation.angle() + 0.7).powi(2);
            // Perpendicular to the line from the centre the error is largest, along it smallest: mean of both.
            elbow += (place(&fit.pose, end) - place(&truth, end)).norm_squared();
            said_angle += fit.sigma_angle_rad.powi(2);
            let lever = (end - fit.centre).norm() * fit.sigma_angle_rad;
            said_elbow += 2.0 * fit.sigma_centre_px.powi(2) + lever.powi(2);
        }
        // 4000 draws give a variance to 1 / sqrt(2000) = 2.2 %; three of these.
        assert!((angle / said_angle - 1.0).abs() < 0.07, "{}", angle / said_angle);
        assert!((elbow / said_elbow - 1.0).abs() < 0.07, "{}", elbow / said_elbow);
    }

    #[test]
    fn no_pose_from_one_point_or_from_coinciding_points() {
        let truth = Isometry2::identity();
        assert!(fit_pose(&[pair(1.0, 2.0, &truth, 0.1)]).is_none());
        assert!(fit_pose(&[pair(1.0, 2.0, &truth, 0.1); 3]).is_none());
    }
}
