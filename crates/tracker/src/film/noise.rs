//! From the expected level of a pixel to the number that the camera writes.
//!
//! The model, per pixel and frame, all in grey levels of the recording:
//!
//! ```text
//! recorded = clip(round(mu + z * sqrt(read_noise^2 + shot_gain * max(mu - black, 0))), 0, top)
//! ```
//!
//! with `mu` the expected level ([`super::Film::expected`]), `z` independent standard normal numbers, and `top`
//! the camera's saturation level. Shot noise is the normal limit of the Poisson law (`shot_gain` is levels per
//! photo-electron). Rounding adds 1/12 to the variance. [`variance`] is what a Cramer-Rao bound needs.
//!
//! Frame `i` of seed `s` uses stream `i` of ChaCha8 seeded with `s`: frames may be made in any order.

use std::sync::OnceLock;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::scene::Camera;

/// Variance of a recorded level that is expected at `level`, grey levels squared, rounding included,
/// saturation not.
pub fn variance(camera: &Camera, level: f64) -> f64 {
    camera.read_noise * camera.read_noise + camera.shot_gain * (level - camera.black).max(0.0) + 1.0 / 12.0
}

/// Quantile of the standard normal law, Acklam's rational approximation with one step of Halley's method
/// left out: relative error under 1.2e-9.
fn quantile(p: f64) -> f64 {
    const A: [f64; 6] = [
        -3.969683028665376e1,
        2.209460984245205e2,
        -2.759285104469687e2,
        1.38357751867269e2,
        -3.066479806614716e1,
        2.506628277459239,
    ];
    const B: [f64; 5] = [
        -5.447609879822406e1,
        1.615858368580409e2,
        -1.556989798598866e2,
        6.680131188771972e1,
        -1.328068155288572e1,
    ];
    const C: [f64; 6] = [
        -7.784894002430293e-3,
        -3.223964580411365e-1,
        -2.400758277161838,
        -2.549732539343734,
        4.374664141464968,
        2.938163982698783,
    ];
    const D: [f64; 4] = [7.784695709041462e-3, 3.224671290700398e-1, 2.445134137142996, 3.754408661907416];
    let horner = |c: &[f64], x: f64| c.iter().fold(0.0, |s, &k| s * x + k);
    if p < 0.02425 {
        let q = (-2.0 * p.ln()).sqrt();
        horner(&C, q) / (horner(&D, q) * q + 1.0)
    } else if p > 1.0 - 0.02425 {
        -quantile(1.0 - p)
    } else {
        let q = p - 0.5;
        let r = q * q;
        horner(&A, r) * q / (horner(&B, r) * r + 1.0)
    }
}

/// 65536 equally probable standard normal numbers; the two outermost are only a mark, their tails are drawn.
fn normal_table() -> &'static [f32] {
    static TABLE: OnceLock<Vec<f32>> = OnceLock::new();
    TABLE.get_or_init(|| (0..65536u32).map(|i| quantile((f64::from(i) + 0.5) / 65536.0) as f32).collect())
}

/// Standard normal numbers of one frame, in the order of its pixels.
pub(crate) struct FrameNoise {
    rng: ChaCha8Rng,
    table: &'static [f32],
    bits: u64,
    left: u32,
}

impl FrameNoise {
    /// The numbers of frame `index` of a film with `seed`.
    pub(crate) fn new(seed: u64, index: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(index);
        Self { rng, table: normal_table(), bits: 0, left: 0 }
    }

    /// The next number.
    #[inline]
    pub(crate) fn next(&mut self) -> f32 {
        if self.left == 0 {
            self.bits = self.rng.next_u64();
            self.left = 4;
        }
        let i = (self.bits & 0xffff) as usize;
        self.bits >>= 16;
        self.left -= 1;
        if i == 0 || i == 0xffff { self.tail(i == 0) } else { self.table[i] }
    }

    /// A number beyond the 1/65536 quantile, of either sign.
    #[cold]
    fn tail(&mut self, negative: bool) -> f32 {
        let p = ((self.rng.next_u64() >> 11) as f64 + 0.5) / (1u64 << 53) as f64 / 65536.0;
        let z = quantile(p) as f32;
        if negative { z } else { -z }
    }
}

/// Writes the recorded levels of one frame into `out`, one byte or two (little-endian) per pixel.
pub(crate) fn record(camera: &Camera, seed: u64, index: u64, expected: &[f32], out: &mut Vec<u8>) {
    let top = camera.top() as f32;
    let read2 = (camera.read_noise * camera.read_noise) as f32;
    let gain = camera.shot_gain as f32;
    let black = camera.black as f32;
    let noisy = read2 > 0.0 || gain > 0.0;
    let mut noise = FrameNoise::new(seed, index);
    let mut level = |mu: f32| {
        let x = if noisy { mu + noise.next() * (read2 + gain * (mu - black).max(0.0)).sqrt() } else { mu };
        // Adding one half and cutting off rounds what is not negative; the clip comes first.
        (x.clamp(0.0, top) + 0.5) as u16
    };
    out.clear();
    if camera.depth_bits > 8 {
        out.reserve(expected.len() * 2);
        for &mu in expected {
            out.extend_from_slice(&level(mu).to_le_bytes());
        }
    } else {
        out.extend(expected.iter().map(|&mu| level(mu) as u8));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_standard_normal() {
        let mut noise = FrameNoise::new(7, 3);
        let n = 2_000_000;
        let (mut m1, mut m2, mut m4, mut beyond) = (0.0, 0.0, 0.0, 0);
        for _ in 0..n {
            let z = f64::from(noise.next());
            m1 += z;
            m2 += z * z;
            m4 += z * z * z * z;
            beyond += i32::from(z.abs() > 4.5);
        }
        let n = f64::from(n);
        // Five standard errors: 1/sqrt(n), sqrt(2/n), sqrt(96/n).
        assert!((m1 / n).abs() < 5.0 / n.sqrt());
        assert!((m2 / n - 1.0).abs() < 5.0 * (2.0 / n).sqrt());
        assert!((m4 / n - 3.0).abs() < 5.0 * (96.0 / n).sqrt());
        // 6.8e-6 of all lie beyond 4.5: 13.6 expected, so between 1 and 35 but for 1 in 10^5 seeds.
        assert!((1..35).contains(&beyond), "{beyond}");
    }

    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (p, z) in
            [(0.5, 0.0), (0.975, 1.959963984540054), (0.001, -3.090232306167814), (1e-9, -5.99780701500769)]
        {
            assert!((quantile(p) - z).abs() < 1e-7, "{p}");
        }
    }
}
