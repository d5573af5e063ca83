//! Rates from 24 to 5000 frames per second in ticks of 1/600 s to 1/90000 s: whole films have no gaps, and frames that are
//! left out are counted.

use super::*;

const FRAMES: usize = 420;
const TICKS: [u64; 4] = [600, 1000, 10_000, 90_000];
const RATES: [f64; 18] = [
    24.0, 30.0, 60.0, 120.0, 240.0, 300.0, 480.0, 500.0, 600.0, 834.0, 850.0, 900.0, 960.0, 990.0, 1000.0,
    1200.0, 2400.0, 5000.0,
];
/// Frames that are left out: one, two, seven, and at several places.
const LEFT_OUT: [&[usize]; 5] = [
    &[200],
    &[150, 151],
    &[100, 101, 102, 103, 104, 105, 106],
    &[90, 190, 333],
    &[50, 120, 121, 250, 300, 301, 302, 303, 304, 305, 306],
];

fn ticks_of(per_s: u64) -> TimeBase {
    TimeBase { numerator: 1, denominator: per_s }
}

/// Stamps of a film that begins at zero, rounded to whole ticks.
fn film(rate: f64, per_s: u64, left_out: &[usize], round: fn(f64) -> f64) -> Vec<i64> {
    let there = (0..FRAMES).filter(|k| !left_out.contains(k));
    there.map(|k| round(clean(k as f64 * per_s as f64 / rate)) as i64).collect()
}

#[test]
fn whole_films_have_no_gaps() {
    for per_s in TICKS {
        for rate in RATES {
            for said in [&[][..], &[[rate as u64, 1]]] {
                for round in ROUNDINGS {
                    let stamps = film(rate, per_s, &[], round);
                    let (timing, _) = container(&stamps, ticks_of(per_s), &claims(said)).unwrap();
                    let case = format!("{rate} in 1/{per_s} s, {said:?}: {timing:?}");
                    assert_eq!((timing.gaps, timing.lacking), (0, 0), "{case}");
                    let hz = timing.rate_hz.unwrap();
                    // Every rate that the stamps allow is as likely: up to sqrt(3) standard uncertainties from the middle.
                    let most = timing.rate_sigma_hz.map_or(1e-9 * rate, |s| 1.8 * s);
                    assert!((hz - rate).abs() <= most, "{case}");
                }
            }
        }
    }
}

#[test]
fn frames_that_are_left_out_are_counted() {
    for per_s in TICKS {
        for rate in RATES {
            let step = per_s as f64 / rate;
            for said in [&[][..], &[[rate as u64, 1]]] {
                for left_out in LEFT_OUT {
                    // Frames that take less than two ticks in all, and of which nothing but the stamps tells, may as well
                    // be the rounding of another rate.
                    let shortest = if left_out.len() == 2 { 2.0 } else { 1.0 };
                    if step < 1.5 && step != 1.0 && (said.is_empty() || step < 1.001) && shortest * step < 2.0
                    {
                        continue;
                    }
                    let stamps = film(rate, per_s, left_out, f64::round);
                    let (timing, clock) = container(&stamps, ticks_of(per_s), &claims(said)).unwrap();
                    let case = format!("{rate} in 1/{per_s} s, {said:?}, {left_out:?}: {timing:?}");
                    assert_eq!(timing.lacking, left_out.len() as u64, "{case}");
                    let there: Vec<usize> = (0..FRAMES).filter(|k| !left_out.contains(k)).collect();
                    let tick_s = 1.0 / per_s as f64;
                    assert!(rms_s(&clock, &stamps, |i| there[i] as f64 / rate) < 0.3 * tick_s, "{case}");
                }
            }
        }
    }
}

#[test]
fn empty_slots_are_gaps_though_a_tick_is_a_frame() {
    // AVI: the container's rate is that of the slots.
    for rate in [24, 500, 990, 1000] {
        for left_out in LEFT_OUT.iter().copied().chain([&[9usize, 19, 29, 39, 49, 59, 69, 79, 89][..]]) {
            let stamps = film(rate as f64, rate, left_out, f64::round);
            let (timing, _) = container(&stamps, ticks_of(rate), &claims(&[[rate, 1]])).unwrap();
            assert_eq!(
                (timing.lacking, timing.rate_hz),
                (left_out.len() as u64, Some(rate as f64)),
                "{timing:?}"
            );
        }
    }
}

#[test]
fn few_frames_of_a_tick_each_leave_their_rate_open() {
    for rate in [960.0_f64, 990.0, 1000.0] {
        for count in [3, 6, 12, 24, 60, 119] {
            let stamps: Vec<i64> =
                (0..count).map(|k| (f64::from(k) * 1000.0 / rate).round() as i64).collect();
            let (timing, _) = container(&stamps, MS, &claims(&[])).unwrap();
            let case = format!("{count} at {rate}: {timing:?}");
            assert_eq!((timing.gaps, timing.rate_from_stamps), (0, true), "{case}");
            let off = (timing.rate_hz.unwrap() - rate).abs();
            // Round numbers are taken where others are ten times further away than what the stamps leave open.
            let most = timing.rate_sigma_hz.map_or(0.05 * rate / f64::from(count) * 12.0, |s| 1.8 * s);
            assert!(off <= most, "{case}");
            if count < 20 {
                assert!(timing.rate_sigma_hz.is_some(), "{case}");
            }
        }
    }
}
