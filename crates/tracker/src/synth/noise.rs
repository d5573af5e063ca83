//! Draws the number that the camera writes from the expected level of a pixel.
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

/// Equally probable intervals of the standard normal law; the two outermost are drawn exactly.
const INTERVALS: usize = 4096;
/// Steps into which each interval is divided evenly: 12 + 4 bits make a number.
const STEPS: usize = 16;

/// For each interval its first number and its step.
fn normal_table() -> &'static [[f32; 2]; INTERVALS] {
    static TABLE: OnceLock<Box<[[f32; 2]; INTERVALS]>> = OnceLock::new();
    TABLE.get_or_init(|| {
        let mut table = Box::new([[0.0; 2]; INTERVALS]);
        for (i, entry) in table.iter_mut().enumerate().take(INTERVALS - 1).skip(1) {
            let edge = |k: usize| quantile(k as f64 / INTERVALS as f64);
            let step = (edge(i + 1) - edge(i)) / STEPS as f64;
            *entry = [(edge(i) + 0.5 * step) as f32, step as f32];
        }
        table
    })
}

/// Standard normal numbers of one frame, in the order of its pixels.
pub(crate) struct FrameNoise {
    rng: ChaCha8Rng,
    table: &'static [[f32; 2]; INTERVALS],
}

impl FrameNoise {
    /// The numbers of frame `index` of a film with `seed`.
    pub(crate) fn new(seed: u64, index: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(index);
        Self { rng, table: normal_table() }
    }

    /// The next four numbers.
    #[inline]
    pub(crate) fn next4(&mut self) -> [f32; 4] {
        let bits = self.rng.next_u64();
        [0, 16, 32, 48].map(|shift| {
            let b = (bits >> shift) as usize;
            let i = b % INTERVALS;
            if i == 0 || i == INTERVALS - 1 {
                return self.tail(i == 0);
            }
            let [first, step] = self.table[i];
            first + step * ((b / INTERVALS) % STEPS) as f32
        })
    }

    /// A number of one of the outermost intervals.
    #[cold]
    fn tail(&mut self, negative: bool) -> f32 {
        let p = ((self.rng.next_u64() >> 11) as f64 + 0.5) / (1u64 << 53) as f64 / INTERVALS as f64;
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
    let mut noise = FrameNoise::new(seed, index);
    // Clipped first, then adding one half and cutting off rounds.
    let level = |x: f32| (x.clamp(0.0, top) + 0.5) as u16;
    let mut four_levels = |four: &[f32]| {
        let mut levels = [0u16; 4];
        if read2 == 0.0 && gain == 0.0 {
            levels.iter_mut().zip(four).for_each(|(l, &mu)| *l = level(mu));
            return levels;
        }
        let z = noise.next4();
        if gain == 0.0 {
            let sd = read2.sqrt();
            levels.iter_mut().zip(four).zip(z).for_each(|((l, &mu), z)| *l = level(mu + z * sd));
        } else {
            for ((l, &mu), z) in levels.iter_mut().zip(four).zip(z) {
                *l = level(mu + z * (read2 + gain * (mu - black).max(0.0)).sqrt());
            }
        }
        levels
    };
    out.clear();
    if camera.depth_bits > 8 {
        out.resize(2 * expected.len(), 0);
        for (four, bytes) in expected.chunks(4).zip(out.chunks_mut(8)) {
            let levels = four_levels(four);
            bytes.chunks_exact_mut(2).zip(levels).for_each(|(b, l)| b.copy_from_slice(&l.to_le_bytes()));
        }
    } else {
        out.resize(expected.len(), 0);
        for (four, bytes) in expected.chunks(4).zip(out.chunks_mut(4)) {
            let levels = four_levels(four);
            bytes.iter_mut().zip(levels).for_each(|(b, l)| *b = l as u8);
        }
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
        for z in (0..n / 4).flat_map(|_| noise.next4()).map(f64::from) {
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
