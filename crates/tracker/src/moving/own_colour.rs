//! The colour direction in which a marker differs most from its surroundings (Fisher's linear discriminant).
//!
//! Owns: [`own_colour`]. Must not: find regions.

use nalgebra::{Matrix3, Vector3};

use super::picture::Film;
use super::response::Direction;
use super::track::{Track, chosen};
use super::tracklet::median;
use crate::error::Result;

/// Pictures that teach that direction.
const PICTURES: usize = 12;
/// Variance of each plane that is added, grey levels squared: no direction is trusted beyond the recording's own noise.
const NOISE_VARIANCE: f64 = 4.0;

/// Fisher's direction between a marker and its surroundings, pooled over pictures; `None` without colour or pixels.
pub fn own_colour(film: &dyn Film, track: &Track, radius_px: f64) -> Result<Option<Direction>> {
    let (mut inside, mut outside): (Vec<[f64; 3]>, Vec<[f64; 3]>) = (Vec::new(), Vec::new());
    for (p, i) in chosen(track, PICTURES) {
        let t = &track.pieces[p];
        let s = &t.spots[i];
        let picture = film.read(t.first + i)?;
        let Some([blue, red]) = picture.chroma.as_ref() else { return Ok(None) };
        let reach = 2.2 * radius_px + 3.0;
        let (x0, x1) =
            ((s.x - reach).max(0.0) as usize, ((s.x + reach + 1.0).max(0.0) as usize).min(picture.width));
        let (y0, y1) =
            ((s.y - reach).max(0.0) as usize, ((s.y + reach + 1.0).max(0.0) as usize).min(picture.height));
        for y in y0..y1 {
            for x in x0..x1 {
                let d = (x as f64 - s.x).hypot(y as f64 - s.y);
                let k = y * picture.width + x;
                let colour = [picture.luma[k], blue[k], red[k]].map(f64::from);
                if d < 0.75 * radius_px {
                    inside.push(colour);
                } else if d > 1.4 * radius_px + 1.0 && d < 2.1 * radius_px + 2.0 {
                    outside.push(colour);
                }
            }
        }
    }
    if inside.len() < 10 || outside.len() < 10 {
        return Ok(None);
    }
    let middle = |v: &[[f64; 3]]| [0, 1, 2].map(|k| median(&mut v.iter().map(|c| c[k]).collect::<Vec<_>>()));
    let pooled = (covariance(&inside) + covariance(&outside)) / 2.0 + NOISE_VARIANCE * Matrix3::identity();
    let apart = Vector3::from(middle(&inside)) - Vector3::from(middle(&outside));
    let Some(w) = pooled.cholesky().map(|c| c.solve(&apart)) else { return Ok(None) };
    let size: f64 = w.iter().map(|v| v.abs()).sum();
    Ok((size > 0.0).then(|| Direction([w.x, w.y, w.z].map(|v| (v / size) as f32))))
}

fn covariance(colours: &[[f64; 3]]) -> Matrix3<f64> {
    let n = colours.len() as f64;
    let all = || colours.iter().map(|c| Vector3::from(*c));
    let mean = all().sum::<Vector3<f64>>() / n;
    all().map(|c| (c - mean) * (c - mean).transpose()).sum::<Matrix3<f64>>() / n
}
