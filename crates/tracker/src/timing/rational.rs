//! Writes rates as fractions, so that times are exact.

/// Greatest denominator of a rate's fraction.
const MAX_DENOMINATOR: u64 = 1_000_000;

/// The fraction that a rate, typed with a few decimals, stands for: 29.97 is 30000/1001, 1666.7 is 16667/10.
/// `rate` is finite, above 0 and at most 10^9. Within 10^-5 of it for television's rates, else 10^-9, or as
/// near as a denominator of 10^6 comes.
pub fn rational(rate: f64) -> (u64, u64) {
    // Television's rates are n * 1000 / 1001 and are written with two or three decimals.
    let nominal = (rate * 1.001).round();
    let is_whole = (rate - rate.round()).abs() <= 1e-9 * rate;
    if !is_whole && nominal <= 240.0 && (nominal / 1.001 - rate).abs() <= 1e-5 * rate {
        return (nominal as u64 * 1000, 1001);
    }
    // Continued fraction: each convergent is the nearest with so small a denominator.
    let (mut p0, mut q0, mut p1, mut q1) = (0u64, 1u64, 1u64, 0u64);
    let mut rest = rate;
    for _ in 0..64 {
        let whole = rest.floor();
        let (p, q) = (
            (whole as u64).saturating_mul(p1).saturating_add(p0),
            (whole as u64).saturating_mul(q1).saturating_add(q0),
        );
        if q > MAX_DENOMINATOR {
            break;
        }
        (p0, q0, p1, q1) = (p1, q1, p, q);
        if p1 > 0 && (p1 as f64 / q1 as f64 - rate).abs() <= 1e-9 * rate || rest == whole {
            break;
        }
        rest = 1.0 / (rest - whole);
    }
    if p1 == 0 { (1, MAX_DENOMINATOR) } else { (p1, q1) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_become_the_fractions_they_stand_for() {
        for (rate, fraction) in [
            (30.0, (30, 1)),
            (29.97, (30000, 1001)),
            (23.976, (24000, 1001)),
            (59.94, (60000, 1001)),
            (119.88, (120000, 1001)),
            (100_000.0, (100_000, 1)),
            (1666.7, (16667, 10)),
            (5000.0 / 3.0, (5000, 3)),
            (0.5, (1, 2)),
            (12.5, (25, 2)),
            (0.001, (1, 1000)),
        ] {
            assert_eq!(rational(rate), fraction, "{rate}");
        }
    }

    #[test]
    fn any_rate_is_met_within_its_tolerance() {
        for k in 1..2000u32 {
            let rate = f64::from(k).powf(1.7) / 7.3;
            let (p, q) = rational(rate);
            // 1e-5 for a television rate met by chance, else a denominator up to 1e6 leaves less than 1e-6 / q.
            assert!((p as f64 / q as f64 - rate).abs() <= 1e-5 * rate.max(1e-6), "{rate}: {p}/{q}");
        }
    }
}
