//! Computes quantiles of a set of values.
//!
//! Owns: [`sorted`], [`quantile`]. Must not: know what the values are.

/// Values in order.
pub(crate) fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut all: Vec<f64> = values.collect();
    all.sort_unstable_by(f64::total_cmp);
    all
}

/// The value below which a part of the sorted values lies; 0 of none.
pub(crate) fn quantile(sorted: &[f64], part: f64) -> f64 {
    if sorted.is_empty() {
        return 0.0;
    }
    sorted[((sorted.len() - 1) as f64 * part).round() as usize]
}
