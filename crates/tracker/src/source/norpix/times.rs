//! Computes the times of the pictures of a NorPix sequence from their time stamps, where these make sense.
//!
//! Owns: [`Times`], [`times`], [`oldest`]. Must not: read anything.

use crate::error::Result;
use crate::frame::{RateOrigin, TimeBase};
use crate::message::{Message, Setting};
use crate::source::cine::header::plausible;
use crate::source::clock;

/// Relative difference from which on the header's rate is another than the stamps': far above a clock's error, far below a
/// dropped frame.
const RATE_DIFFERS: f64 = 0.01;
/// Largest part of the stamps that may be replaced for the others to be believed.
const MOST_REPLACED: f64 = 0.1;
/// Steps of the search for an even grid; each leaves two thirds: 10^-7 of two ticks.
const SEARCHES: u32 = 40;

/// Times of all frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Times {
    pub time_base: TimeBase,
    pub rate_hz: Option<f64>,
    pub rate_origin: RateOrigin,
    /// Ticks of the frames; `None` if they are the frames' numbers.
    pub ticks: Option<Vec<i64>>,
    pub warnings: Vec<Message>,
}

/// The picture that was taken first, where the recorder wrote them in a ring: the one at which time falls back, if it
/// rises everywhere else and from the last one to the first too.
pub fn oldest(stamps_us: &[u64]) -> usize {
    let mut falls = (1..stamps_us.len()).filter(|i| stamps_us[*i] < stamps_us[i - 1]);
    match (falls.next(), falls.next(), stamps_us.first(), stamps_us.last()) {
        (Some(at), None, Some(first), Some(last)) if last < first => at,
        _ => 0,
    }
}

/// Times from stamps in the order in which pictures were taken. `tick_us` is the stamps' step, µs; `header_hz` the rate that
/// the recorder was set to.
pub fn times(stamps_us: &[u64], tick_us: u64, header_hz: Option<f64>) -> Result<Times> {
    let mut warnings = Vec::new();
    if let Some(rate) = even_rate(stamps_us, tick_us, header_hz) {
        differs(rate, header_hz, &mut warnings);
        let (time_base, rate_hz) = (clock::time_base(rate)?, Some(rate));
        return Ok(Times { time_base, rate_hz, rate_origin: RateOrigin::TimeStamps, ticks: None, warnings });
    }
    if let Some(stamps) =
        plausible(stamps_us).filter(|s| s.replaced.len() as f64 <= MOST_REPLACED * stamps_us.len() as f64)
    {
        let rate = 1e6 / stamps.step as f64;
        differs(rate, header_hz, &mut warnings);
        if !stamps.replaced.is_empty() {
            let some: Vec<String> = stamps.replaced.iter().take(5).map(u64::to_string).collect();
            let more = if stamps.replaced.len() > some.len() { ", ..." } else { "" };
            warnings.push(
                format!(
                    "{} time stamps make no sense and were replaced (frames {}{more})",
                    stamps.replaced.len(),
                    some.join(", ")
                )
                .into(),
            );
        }
        return Ok(Times {
            time_base: TimeBase { numerator: 1, denominator: 1_000_000 },
            rate_hz: Some(rate),
            rate_origin: RateOrigin::TimeStamps,
            ticks: Some(stamps.ticks),
            warnings,
        });
    }
    let Some(rate) = header_hz else {
        warnings.push("neither time stamps nor header give a rate; give it with " + Setting::Fps);
        let time_base = TimeBase { numerator: 1, denominator: 1 };
        return Ok(Times {
            time_base,
            rate_hz: None,
            rate_origin: RateOrigin::Unknown,
            ticks: None,
            warnings,
        });
    };
    if stamps_us.len() > 1 {
        warnings.push(format!(
            "the time stamps make no sense or are too coarse; the header's {rate} frames per second are used"
        ).into());
    }
    let time_base = clock::time_base(rate)?;
    Ok(Times { time_base, rate_hz: Some(rate), rate_origin: RateOrigin::CameraHeader, ticks: None, warnings })
}

/// The rate of an even grid of which all stamps are the times in whole ticks: the header's if it is one of those, else the
/// one to which the stamps lie nearest.
fn even_rate(stamps_us: &[u64], tick_us: u64, header_hz: Option<f64>) -> Option<f64> {
    let (first, last) = (*stamps_us.first()?, *stamps_us.last()?);
    let steps = stamps_us.len().checked_sub(1).filter(|n| *n > 0)? as f64;
    let span = last.checked_sub(first).filter(|s| *s > 0)? as f64;
    let tick = tick_us as f64;
    // How far the stamps are apart from each other beside the grid; where a grid begins is free.
    let apart = |step_us: f64| {
        let off = |(i, s): (usize, &u64)| s.wrapping_sub(first) as i64 as f64 - i as f64 * step_us;
        let ends = (f64::INFINITY, f64::NEG_INFINITY);
        let (low, high) = stamps_us.iter().enumerate().map(off).fold(ends, |(l, h), d| (l.min(d), h.max(d)));
        high - low
    };
    if let Some(rate) = header_hz.filter(|r| apart(1e6 / r) <= tick) {
        return Some(rate);
    }
    // It has one minimum, and the first and the last stamp are off by less than a tick each.
    let (mut low, mut high) = ((span - tick).max(0.0) / steps, (span + tick) / steps);
    for _ in 0..SEARCHES {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if apart(a) <= apart(b) { high = b } else { low = a }
    }
    let step = (low + high) / 2.0;
    (step > 0.0 && apart(step) <= tick).then_some(1e6 / step)
}

fn differs(rate: f64, header_hz: Option<f64>, warnings: &mut Vec<Message>) {
    if let Some(header) = header_hz.filter(|h| (h / rate - 1.0).abs() > RATE_DIFFERS) {
        warnings.push(
            format!(
                "the header says {header} frames per second, the time stamps {rate:.6}; the stamps are used"
            )
            .into(),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stamps(count: u64, rate: f64, tick_us: u64) -> Vec<u64> {
        (0..count)
            .map(|i| 1_700_000_000_000_000 + (i as f64 * 1e6 / rate) as u64 / tick_us * tick_us)
            .collect()
    }

    #[test]
    fn stamps_within_a_tick_of_an_even_grid_are_that_grid() {
        // 1 kHz and 2.5 kHz by milliseconds: some stamps are equal.
        for (rate, tick) in [(500.0, 1), (333.3, 1), (500.0, 1000), (999.0, 1000), (2500.0, 1000)] {
            let all = stamps(2000, rate, tick);
            let times = times(&all, tick, Some(rate)).unwrap();
            assert_eq!(
                (times.rate_hz, times.ticks, times.rate_origin),
                (Some(rate), None, RateOrigin::TimeStamps)
            );
            assert!(times.warnings.is_empty());
        }
        // Without a header's rate that fits, the rate is that of first and last stamp, to a tick over their distance.
        for header in [None, Some(30.0)] {
            let found = times(&stamps(2000, 500.0, 1000), 1000, header).unwrap();
            assert!((found.rate_hz.unwrap() / 500.0 - 1.0).abs() < 1000.0 / (1999.0 * 2000.0), "{found:?}");
            assert_eq!(found.warnings.len(), usize::from(header.is_some()));
        }
    }

    #[test]
    fn a_dropped_frame_keeps_its_gap_and_odd_stamps_are_replaced() {
        let mut all = stamps(100, 200.0, 1);
        all.remove(40);
        let found = times(&all, 1, Some(200.0)).unwrap();
        let ticks = found.ticks.unwrap();
        assert_eq!((ticks[39], ticks[40], found.warnings.len()), (39 * 5000, 41 * 5000, 0));
        all[70] = 0;
        let found = times(&all, 1, Some(200.0)).unwrap();
        assert!(
            found.warnings[0].to_string().contains("1 time stamps make no sense"),
            "{:?}",
            found.warnings
        );
        assert_eq!(found.ticks.unwrap()[71], 72 * 5000);
    }

    #[test]
    fn stamps_that_say_nothing_leave_the_header() {
        for all in [vec![], vec![7], vec![0; 50]] {
            let found = times(&all, 1, Some(250.0)).unwrap();
            assert_eq!((found.rate_hz, found.rate_origin), (Some(250.0), RateOrigin::CameraHeader));
            assert_eq!(times(&all, 1, None).unwrap().rate_origin, RateOrigin::Unknown);
        }
    }

    #[test]
    fn a_ring_begins_at_its_oldest_picture() {
        let mut all = stamps(50, 100.0, 1);
        assert_eq!(oldest(&all), 0);
        all.rotate_left(13);
        assert_eq!(oldest(&all), 37);
        // A clock that was set back once is no ring.
        assert_eq!(oldest(&[10, 20, 30, 15, 25, 35]), 0);
        assert_eq!(oldest(&[]), 0);
    }
}
