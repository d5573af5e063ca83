//! Says what a found camera is, for people.
//!
//! Owns: [`words`].

use super::bundle::Calibration;
use crate::camera::NUMBERS;

/// Focal length for which a tilt is told, in widths of the picture: that of a usual lens.
const FOCAL_WIDTHS: f64 = 2.0;

/// Squared residuals over their variances beyond which they are not noise.
const CROOKED: f64 = 3.0;

/// A clause about a camera for a picture of a width in square px.
pub fn words(found: &Calibration, width_px: f64) -> String {
    let [a, b, v1, v2, k] = found.camera.numbers();
    let variance = |i: usize| found.covariance[(i, i)];
    let mut parts: Vec<String> = Vec::new();
    let size = v1.hypot(v2);
    if size > 0.0 {
        let scale = FOCAL_WIDTHS * width_px / found.camera.radius_px();
        let along = [v1 / size, v2 / size];
        let mut of_size = 0.0;
        for i in 0..2 {
            for j in 0..2 {
                of_size += along[i] * found.covariance[(2 + i, 2 + j)] * along[j];
            }
        }
        let tilt = (size * scale).atan();
        let sigma = of_size.max(0.0).sqrt() * scale * tilt.cos().powi(2);
        parts.push(format!(
            "is {:.1} +- {:.1} deg off facing the links squarely, which come nearer towards {} (if its lens is {FOCAL_WIDTHS} \
             pictures' widths long)",
            tilt.to_degrees(),
            sigma.to_degrees().max(0.05),
            side(v1, v2),
        ));
    } else if a.hypot(b) > 0.0 {
        parts.push(format!("shows lengths that differ by {:.2} % with their direction", 200.0 * a.hypot(b)));
    }
    if k != 0.0 && variance(NUMBERS - 1) > 0.0 {
        parts.push(format!(
            "has a lens that moves the corners by {:+.1} +- {:.1} % of their distance from the middle",
            100.0 * k,
            100.0 * variance(NUMBERS - 1).sqrt().max(5e-4),
        ));
    }
    let left = if found.chi2 > CROOKED {
        format!(
            ", and lengths still vary by {:.1} times what noise does: the links may not be in one plane, or the shutter rolls",
            found.chi2.sqrt()
        )
    } else {
        String::new()
    };
    format!("the camera {}: this is corrected{left}", parts.join(" and "))
}

/// The side or corner of the picture in a direction.
fn side(x: f64, y: f64) -> &'static str {
    const SIDES: [&str; 8] = [
        "the right",
        "the lower right",
        "the bottom",
        "the lower left",
        "the left",
        "the upper left",
        "the top",
        "the upper right",
    ];
    let eighth = (y.atan2(x) / std::f64::consts::FRAC_PI_4).round().rem_euclid(8.0);
    SIDES[eighth as usize % 8]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use nalgebra::Matrix5;

    #[test]
    fn a_tilt_and_a_barrel_are_said_with_their_errors() {
        let size = [1000.0, 800.0];
        let camera = Camera::tilted(9.8f64.to_radians(), 0.8, 2000.0, -0.1, 1.0, size);
        let covariance = Matrix5::from_diagonal(&[1e-8, 1e-8, 1e-6, 1e-6, 4e-6].into());
        let said = words(&Calibration { camera, covariance, chi2: 1.0 }, size[0]);
        assert!(said.contains("9.8 +- 0.2 deg") && said.contains("the lower right"), "{said}");
        assert!(said.contains("-10.0 +- 0.2 %"), "{said}");
    }
}
