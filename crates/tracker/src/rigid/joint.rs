//! Finds the point that a body turns about, or that two bodies share, from their poses.
//!
//! Owns: [`Turning`], [`Shared`]. Must not: know which bodies a rig says are joined.
//!
//! A joint's places a (in the first body) and b (in the second, or in the image) solve R1 a + p1 = R2 b + p2 in
//! every frame: linear least squares.

use nalgebra::{Isometry2, Matrix4, SymmetricEigen, Vector2, Vector4};

/// Sums of the least squares for one joint.
#[derive(Debug, Clone)]
pub struct Shared {
    normal: Matrix4<f64>,
    right: Vector4<f64>,
    square: f64,
    count: usize,
}

/// A joint and how well the poses agree on it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turning {
    /// In the first body's coordinates, px.
    pub first: Vector2<f64>,
    /// In the second body's coordinates, or in the image, px.
    pub second: Vector2<f64>,
    /// Root mean square disagreement per coordinate, px.
    pub rms_px: f64,
    /// Standard uncertainty per coordinate in the direction that is known least, px, if errors were
    /// independent from frame to frame.
    pub sigma_px: f64,
}

impl Default for Shared {
    fn default() -> Self {
        Self { normal: Matrix4::zeros(), right: Vector4::zeros(), square: 0.0, count: 0 }
    }
}

impl Shared {
    /// Adds the poses of one frame; the second is the identity for a point of the image.
    pub fn add(&mut self, first: &Isometry2<f64>, second: &Isometry2<f64>) {
        let (r1, r2) = (first.rotation.to_rotation_matrix(), second.rotation.to_rotation_matrix());
        let gap = second.translation.vector - first.translation.vector;
        for row in 0..2 {
            let a = Vector4::new(r1[(row, 0)], r1[(row, 1)], -r2[(row, 0)], -r2[(row, 1)]);
            self.normal += a * a.transpose();
            self.right += a * gap[row];
            self.square += gap[row] * gap[row];
        }
        self.count += 1;
    }

    /// The joint, if the bodies turned against each other by enough to tell it: the least eigenvalue of the
    /// normal matrix per frame is the spread of the relative direction, 0.003 for some 6 degrees.
    pub fn solve(&self) -> Option<Turning> {
        if self.count < 5 {
            return None;
        }
        let eigen = SymmetricEigen::new(self.normal / self.count as f64);
        let least = eigen.eigenvalues.min();
        if least < 0.003 {
            return None;
        }
        let x = self.normal.cholesky()?.solve(&self.right);
        let square = (self.square - 2.0 * x.dot(&self.right) + x.dot(&(self.normal * x))).max(0.0);
        let rms_px = (square / (2.0 * self.count as f64 - 4.0)).sqrt();
        let sigma_px = rms_px / (least * self.count as f64).sqrt();
        let (first, second) = (Vector2::new(x[0], x[1]), Vector2::new(x[2], x[3]));
        Some(Turning { first, second, rms_px, sigma_px })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rigid::pose::{place, pose_at};

    #[test]
    fn an_elbow_is_found_from_two_turning_bodies() {
        let (a, b) = (Vector2::new(10.0, 150.0), Vector2::new(-7.0, -60.0));
        let mut joint = Shared::default();
        for k in 0..40 {
            let t = f64::from(k);
            let first = pose_at(0.1 * t, Vector2::zeros(), Vector2::new(300.0, 300.0));
            let second = pose_at(-0.3 * t, b, place(&first, a));
            joint.add(&first, &second);
        }
        let found = joint.solve().unwrap();
        // Rounding: places of 500 px, squares of 1e5, a condition of some 10.
        assert!((found.first - a).norm() < 1e-6 && (found.second - b).norm() < 1e-6);
        assert!(found.rms_px < 1e-3);
    }

    #[test]
    fn bodies_that_move_as_one_have_no_joint() {
        let mut joint = Shared::default();
        for k in 0..40 {
            let pose = pose_at(0.1 * f64::from(k), Vector2::zeros(), Vector2::new(300.0, 300.0));
            joint.add(&pose, &pose);
        }
        assert!(joint.solve().is_none());
    }
}
