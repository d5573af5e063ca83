//! Decides what the frames' times are: [`decide`].

use super::clock::{Clock, Grid, Seconds};
use super::facts::{Captured, Doubt, Timing, TimingKind};
use super::grid::{self, Fit, Period};
use super::rational::rational;
use super::steps::{Standstill, Steps};
use super::words;
use crate::frame::{RateClaims, RateOrigin, TimeBase};

/// Greatest rate of films made for players, Hz; cameras for motion are faster.
const PLAYERS_RATE_HZ: f64 = 60.0;
/// Relative difference up to which a capture tag and the stamps say the same rate.
const SAME_RATE: f64 = 0.02;
/// Largest ratio of the capture rate to the player's; a tag beyond is a mistake, as no camera plays 1000 times slower.
const MOST_SLOWING: f64 = 1000.0;

/// Decides what the times of frames with these stamps are. `steps` never fall.
///
/// # Errors
/// [`Standstill`] if two frames have one stamp and the stamps are not those of an even grid.
pub fn decide(
    steps: &Steps,
    time_base: TimeBase,
    origin: RateOrigin,
    claims: &RateClaims,
    claimed_hz: Option<f64>,
) -> Result<(Timing, Clock), Standstill> {
    let tick_s = time_base.numerator as f64 / time_base.denominator as f64;
    let mut timing = Timing {
        kind: TimingKind::Even,
        rate_hz: claimed_hz,
        rate_origin: origin,
        rate_from_stamps: false,
        rate_sigma_hz: None,
        range_hz: None,
        tick_s,
        sigma_s: 0.0,
        frames: steps.len(),
        gaps: 0,
        lacking: 0,
        stray: 0,
        plays_at_hz: None,
        capture: None,
        camera: None,
        doubt: None,
        notes: Vec::new(),
    };
    let mut clock = Clock { time_base, scale: 1.0, grid: None };
    match origin {
        RateOrigin::User => {
            timing.kind = TimingKind::Given;
            return Ok((timing, clock));
        }
        // Times are frame numbers, of the camera's rate or of none.
        RateOrigin::CameraHeader | RateOrigin::Unknown => {}
        RateOrigin::TimeStamps | RateOrigin::Container | RateOrigin::CaptureTag => {
            // The camera's own stamps are fine, and a clock that drifts is not a grid.
            let rounded = origin != RateOrigin::TimeStamps;
            match rounded.then(|| grid::fit(steps, time_base, &claims.container)).flatten() {
                Some(fit) => apply(&fit, steps, &mut timing, &mut clock),
                None => stamped(steps, &mut timing)?,
            }
        }
    }
    if let Some(tag) = &claims.capture {
        capture(&tag.tag, tag.rate_hz, steps, &mut timing, &mut clock);
    }
    timing.doubt = match (timing.rate_origin, timing.rate_hz) {
        (RateOrigin::Unknown, _) | (_, None) => Some(Doubt::Unknown),
        (RateOrigin::Container, Some(hz)) if hz <= PLAYERS_RATE_HZ * (1.0 + SAME_RATE) => Some(Doubt::Player),
        _ => None,
    };
    if timing.doubt == Some(Doubt::Player) {
        timing.camera.clone_from(&claims.camera);
    }
    timing.notes = words::notes(&timing).iter().map(ToString::to_string).collect();
    Ok((timing, clock))
}

/// Times are the stamps, even or not.
fn stamped(steps: &Steps, timing: &mut Timing) -> Result<(), Standstill> {
    if let Some(standstill) = steps.standstill() {
        return Err(standstill);
    }
    let Some((least, most)) = steps.range() else { return Ok(()) };
    let mean = steps.span() as f64 / (steps.len() - 1) as f64;
    timing.rate_hz = Some(1.0 / (mean * timing.tick_s));
    timing.rate_from_stamps = true;
    if least != most {
        timing.kind = TimingKind::Variable;
        timing.range_hz = Some([1.0 / (most as f64 * timing.tick_s), 1.0 / (least as f64 * timing.tick_s)]);
        timing.sigma_s = timing.tick_s / 12f64.sqrt();
    }
    Ok(())
}

/// Times are a grid's.
fn apply(fit: &Fit, steps: &Steps, timing: &mut Timing, clock: &mut Clock) {
    let (rate_hz, period) = match fit.period {
        Period::Rate { numerator, denominator } => (
            numerator as f64 / denominator as f64,
            Seconds::Exact { numerator: denominator, denominator: numerator },
        ),
        Period::Ticks { step, .. } => (1.0 / (step * timing.tick_s), Seconds::Measured(step * timing.tick_s)),
    };
    timing.rate_hz = Some(rate_hz);
    timing.rate_from_stamps = !fit.is_claimed;
    if let Period::Ticks { sigma, step } = fit.period {
        timing.rate_sigma_hz = (sigma > 0.0).then_some(rate_hz * sigma / step);
    }
    timing.gaps = fit.gaps.len() as u64;
    timing.lacking = fit.gaps.last().map_or(0, |g| g.1);
    timing.stray = u64::from(fit.skip_first) + u64::from(fit.skip_last);
    timing.kind = if fit.is_exact && timing.stray == 0 { TimingKind::Even } else { TimingKind::Grid };
    // Stamps that need no change are the times, to the last bit.
    if !fit.is_exact || timing.stray > 0 {
        let first = u64::from(fit.skip_first);
        clock.grid = Some(Grid {
            origin_s: fit.origin_ticks * timing.tick_s,
            period,
            gaps: fit.gaps.clone(),
            first,
            last: steps.len() - 1 - u64::from(fit.skip_last),
        });
    }
}

/// Takes the camera's tag of its capture rate for the truth, where it does not contradict the stamps.
fn capture(tag: &str, rate_hz: f64, steps: &Steps, timing: &mut Timing, clock: &mut Clock) {
    let mut used = false;
    if let Some(file_hz) = timing.rate_hz {
        let ratio = rate_hz / file_hz;
        // Between variable stamps only a whole factor is sure: a dark scene makes a phone slower than its tag.
        let factor = match timing.kind {
            TimingKind::Variable => Some(ratio.round()).filter(|f| (ratio / f - 1.0).abs() <= SAME_RATE),
            _ => Some(ratio),
        };
        if let Some(factor) = factor.filter(|_| (ratio - 1.0).abs() > SAME_RATE)
            && (1.0..=MOST_SLOWING).contains(&factor)
        {
            used = true;
            slowed(factor, rate_hz, steps, timing, clock);
        } else if (ratio - 1.0).abs() <= SAME_RATE {
            used = true;
        }
    }
    if used {
        timing.rate_origin = RateOrigin::CaptureTag;
    }
    timing.capture = Some(Captured { tag: tag.to_owned(), rate_hz, used });
}

/// The file plays `factor` times slower than the frames were taken.
fn slowed(factor: f64, rate_hz: f64, steps: &Steps, timing: &mut Timing, clock: &mut Clock) {
    timing.plays_at_hz = timing.rate_hz;
    timing.tick_s /= factor;
    timing.sigma_s /= factor;
    timing.range_hz = timing.range_hz.map(|r| r.map(|hz| hz * factor));
    timing.rate_sigma_hz = None;
    timing.rate_from_stamps = timing.kind == TimingKind::Variable;
    clock.scale = 1.0 / factor;
    if timing.kind == TimingKind::Variable {
        timing.rate_hz = timing.rate_hz.map(|hz| hz * factor);
        return;
    }
    timing.rate_hz = Some(rate_hz);
    let (numerator, denominator) = rational(rate_hz);
    let period = Seconds::Exact { numerator: denominator, denominator: numerator };
    let grid = clock.grid.take().unwrap_or_else(|| Grid {
        origin_s: clock.time_base.seconds(steps.first()),
        period,
        gaps: steps.gaps_of_even(),
        first: 0,
        last: steps.len().saturating_sub(1),
    });
    clock.grid = Some(Grid { origin_s: grid.origin_s / factor, period, ..grid });
}

#[cfg(test)]
mod tests;
