//! Makes the time base of a rate that the user gives.
//!
//! Owns: [`time_base`]. Must not: read anything.

use crate::error::{Error, Fault, Result};
use crate::frame::TimeBase;
use crate::message::Setting;
use crate::timing::rational;

/// Greatest rate that is believed, frames per second.
const MAX_RATE_HZ: f64 = 1e9;

/// The time base in which frame `i` has tick `i`, for `fps` frames per second.
///
/// # Errors
/// [`Error::Argument`] if `fps` is not a number above 0 and up to 10^9.
pub fn time_base(fps: f64) -> Result<TimeBase> {
    if !(fps.is_finite() && fps > 0.0 && fps <= MAX_RATE_HZ) {
        return Err(Error::Argument(
            Fault::of(Setting::Fps, format!("{fps} is not a rate")).advice("Give frames per second, above 0"),
        ));
    }
    let (numerator, denominator) = rational(fps);
    Ok(TimeBase { numerator: denominator, denominator: numerator })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_that_is_none_is_refused() {
        for fps in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e10] {
            assert!(matches!(time_base(fps), Err(Error::Argument(_))), "{fps}");
        }
        assert_eq!(time_base(29.97).unwrap(), TimeBase { numerator: 1001, denominator: 30000 });
    }
}
