use super::*;

mod sweep;

const MS: TimeBase = TimeBase { numerator: 1, denominator: 1000 };

fn claims(rates: &[[u64; 2]]) -> RateClaims {
    RateClaims { container: rates.to_vec(), ..RateClaims::default() }
}

fn captured(rate_hz: f64, rates: &[[u64; 2]]) -> RateClaims {
    let capture = Some(crate::frame::CaptureClaim { tag: "com.android.capture.fps".into(), rate_hz });
    RateClaims { capture, ..claims(rates) }
}

fn steps(stamps: impl IntoIterator<Item = i64>) -> Steps {
    let mut steps = Steps::default();
    for t in stamps {
        steps.push(t);
    }
    steps
}

fn container(stamps: &[i64], base: TimeBase, claims: &RateClaims) -> Result<(Timing, Clock), Standstill> {
    decide(&steps(stamps.iter().copied()), base, RateOrigin::Container, claims, None)
}

/// Root mean square of the clock's times minus `truth_s(k)`, less a common offset.
fn rms_s(clock: &Clock, stamps: &[i64], truth_s: impl Fn(usize) -> f64) -> f64 {
    let off: Vec<f64> =
        stamps.iter().enumerate().map(|(k, &t)| clock.seconds(k as u64, t) - truth_s(k)).collect();
    let mean = off.iter().sum::<f64>() / off.len() as f64;
    (off.iter().map(|o| (o - mean).powi(2)).sum::<f64>() / off.len() as f64).sqrt()
}

/// Rounded to nearest, down, or up.
const ROUNDINGS: [fn(f64) -> f64; 3] = [f64::round, f64::floor, f64::ceil];

/// Ticks that rounding errors of floating point do not push over an edge.
fn clean(ticks: f64) -> f64 {
    (ticks * 1e6).round() / 1e6
}

#[test]
fn rounded_stamps_give_their_grid_back() {
    // Tick, rate, what the container says.
    let cases: &[(TimeBase, f64, &[[u64; 2]])] = &[
        (MS, 600.0, &[[600, 1]]),
        (MS, 600.0, &[]),
        (MS, 1500.0, &[[1000, 1]]),
        (MS, 2000.0, &[[1000, 1]]),
        (MS, 29.97, &[[30000, 1001]]),
        (MS, 960.0, &[[960, 1]]),
        (TimeBase { numerator: 1, denominator: 600 }, 240.0, &[[288_000, 1201], [240, 1]]),
        (MS, 480.0, &[[48005, 100]]),
        (TimeBase { numerator: 1, denominator: 90_000 }, 59.94, &[[60000, 1001]]),
        (MS, 10_000.0, &[]),
    ];
    for &(base, rate, said) in cases {
        for round in ROUNDINGS {
            for start in [0.0, 67.0 / 3.0] {
                let tick = base.numerator as f64 / base.denominator as f64;
                let exact =
                    if rate == 29.97 || rate == 59.94 { (rate * 1.001).round() / 1.001 } else { rate };
                let stamps: Vec<i64> =
                    (0..2400).map(|k| round(clean((start + k as f64 / exact) / tick)) as i64).collect();
                let (timing, clock) = container(&stamps, base, &claims(said)).unwrap();
                assert_eq!(timing.kind, TimingKind::Grid, "{rate} {timing:?}");
                assert!((timing.rate_hz.unwrap() / exact - 1.0).abs() < 1e-12, "{rate}: {timing:?}");
                assert!(rms_s(&clock, &stamps, |k| k as f64 / exact) < 1e-9);
                assert_eq!((timing.gaps, timing.stray, timing.sigma_s), (0, 0, 0.0));
                let claimed = said.iter().any(|r| (r[0] as f64 / r[1] as f64 / exact - 1.0).abs() < 1e-12);
                assert_eq!(timing.rate_from_stamps, !claimed, "{rate}");
                let by = if claimed { "as the container says" } else { "by the time stamps" };
                assert!(super::super::rate_words(&timing).to_string().contains(by), "{rate}");
                // Half a tick to both sides, so never further off than the rounding was.
                let first = clock.seconds(0, stamps[0]);
                assert!((first - start).abs() <= 1.01 * tick, "{first} {start}");
            }
        }
    }
}

#[test]
fn a_rate_that_is_none_of_the_usual_is_measured_with_its_uncertainty() {
    for (i, rate) in [599.934_f64, 1234.56, 87.1234].into_iter().enumerate() {
        let stamps: Vec<i64> = (0..3000).map(|k| (k as f64 * 1000.0 / rate).round() as i64).collect();
        let (timing, clock) = container(&stamps, MS, &claims(&[])).unwrap();
        let (hz, sigma) = (timing.rate_hz.unwrap(), timing.rate_sigma_hz.unwrap());
        // Uniform: never beyond sqrt(3) standard uncertainties.
        assert!((hz - rate).abs() <= 1.8 * sigma, "{i}: {hz} +- {sigma} for {rate}");
        // Each end is known to half a tick, so the rate to a tick over the film, to both sides.
        assert!(sigma / hz < 2.0 * rate / (1000.0 * 2999.0) / 12f64.sqrt(), "{i}: {hz} +- {sigma}");
        // Two ends known to half a tick each leave less than a quarter of a tick anywhere between.
        assert!(rms_s(&clock, &stamps, |k| k as f64 / rate) < 0.25e-3);
    }
}

#[test]
fn dropped_frames_are_gaps_of_the_grid() {
    for (rate, said) in [
        (60.0, &[[60, 1]][..]),
        (600.0, &[[600, 1]]),
        (600.0, &[]),
        (240.0, &[[1000, 1]]),
        (30.0, &[[28, 1]]),
    ] {
        let dropped = |k: usize| (100..103).contains(&k) || k == 500 || (700..800).contains(&k);
        let there: Vec<usize> = (0..1200).filter(|&k| !dropped(k)).collect();
        let stamps: Vec<i64> = there.iter().map(|&k| (k as f64 * 1000.0 / rate).round() as i64).collect();
        let (timing, clock) = container(&stamps, MS, &claims(said)).unwrap();
        assert_eq!(
            (timing.kind, timing.gaps, timing.lacking),
            (TimingKind::Grid, 3, 104),
            "{rate}: {timing:?}"
        );
        assert!(rms_s(&clock, &stamps, |i| there[i] as f64 / rate) < 1e-9, "{rate}");
        assert!(timing.notes[0].contains("grid"), "{:?}", timing.notes);
        assert!(
            timing.notes.iter().any(|n| n.contains("3 gaps, where 104 frames lack")),
            "{:?}",
            timing.notes
        );
    }
}

#[test]
fn even_stamps_stay_to_the_last_bit_also_with_gaps() {
    let fine = TimeBase { numerator: 1, denominator: 15360 };
    for gap in [0, 4] {
        let stamps: Vec<i64> = (0..100).map(|k| 512 * (k + if k < 50 { 0 } else { gap })).collect();
        let (timing, clock) = container(&stamps, fine, &claims(&[[30, 1]])).unwrap();
        assert_eq!((timing.gaps, timing.lacking), (u64::from(gap > 0), gap as u64));
        assert_eq!(timing.rate_hz, Some(30.0));
        for (k, &t) in stamps.iter().enumerate() {
            assert_eq!(clock.seconds(k as u64, t), fine.seconds(t));
        }
    }
}

#[test]
fn a_variable_rate_stays_and_says_its_range_and_half_a_tick() {
    // From 22 to 30 frames per second and back.
    let mut at = 0.0;
    let stamps: Vec<i64> = (0..300)
        .map(|k| {
            let now = at;
            at += 1.0 / (26.0 + 4.0 * (0.1 * f64::from(k)).sin());
            (now * 1000.0).round() as i64
        })
        .collect();
    let (timing, clock) = container(&stamps, MS, &claims(&[[26, 1], [30, 1]])).unwrap();
    assert_eq!(timing.kind, TimingKind::Variable);
    assert_eq!(timing.sigma_s, 1e-3 / 12f64.sqrt());
    assert_eq!(clock.seconds(7, stamps[7]), MS.seconds(stamps[7]));
    assert!(timing.notes[0].starts_with("variable frame rate, 21.7 to 30.3 per s"), "{:?}", timing.notes);
}

#[test]
fn equal_stamps_off_any_grid_are_refused_by_their_place() {
    let still = container(&[0, 40, 40, 95, 170], MS, &claims(&[])).unwrap_err();
    assert_eq!(still, Standstill { place: 2, ticks: 40 });
    assert!(container(&[7, 7, 7, 7], MS, &claims(&[])).is_err());
    // Two frames in one tick are a grid if the container says so.
    let (timing, clock) = container(&[0, 0], MS, &claims(&[[1500, 1]])).unwrap();
    assert_eq!(timing.kind, TimingKind::Grid);
    assert!((clock.seconds(1, 0) - 1.0 / 1500.0).abs() < 1e-15);
}

#[test]
fn one_and_two_frames_and_none() {
    let (timing, _) = container(&[], MS, &claims(&[[25, 1]])).unwrap();
    assert_eq!(timing.frames, 0);
    let (timing, clock) = container(&[67], MS, &claims(&[[25, 1]])).unwrap();
    assert_eq!((timing.kind, clock.seconds(0, 67)), (TimingKind::Even, 0.067));
    let (timing, clock) = container(&[67, 107], MS, &claims(&[])).unwrap();
    assert_eq!((timing.kind, clock.seconds(1, 107)), (TimingKind::Even, 0.107));
    assert_eq!(timing.rate_hz, Some(25.0));
}

#[test]
fn a_stamp_at_the_end_that_is_off_the_grid_stays() {
    let grid: Vec<i64> = (0..200).map(|k| (f64::from(k) * 1000.0 / 240.0).round() as i64).collect();
    for (first, last) in [(0, 11), (-10, 0), (-10, 11)] {
        let mut stamps = grid.clone();
        stamps[0] += first;
        stamps[199] += last;
        let (timing, clock) = container(&stamps, MS, &claims(&[[240, 1]])).unwrap();
        assert_eq!((timing.kind, timing.gaps), (TimingKind::Grid, 0), "{timing:?}");
        assert_eq!(timing.stray, u64::from(first != 0) + u64::from(last != 0));
        assert!(clock.seconds(199, stamps[199]) > clock.seconds(198, stamps[198]));
        if last != 0 {
            assert_eq!(clock.seconds(199, stamps[199]), MS.seconds(stamps[199]));
        }
        let step = clock.seconds(100, stamps[100]) - clock.seconds(99, stamps[99]);
        assert!((step - 1.0 / 240.0).abs() < 1e-12);
    }
}

#[test]
fn a_capture_tag_gives_the_true_times_where_it_agrees() {
    let fine = TimeBase { numerator: 1, denominator: 15360 };
    let even: Vec<i64> = (0..100).map(|k| 512 * k).collect();
    // What the tag says; the rate that comes out; whether the tag was used.
    for (tag, rate, used) in [
        (240.0, 240.0, true),
        (120.0, 120.0, true),
        (960.0, 960.0, true),
        (30.0, 30.0, true),
        (29.97, 30.0, true),
        (24.0, 30.0, false),
        (1.0, 30.0, false),
        (1e6, 30.0, false),
    ] {
        let (timing, clock) = container(&even, fine, &captured(tag, &[[30, 1]])).unwrap();
        assert_eq!(timing.rate_hz, Some(rate), "{tag}");
        let capture = timing.capture.as_ref().unwrap();
        assert_eq!((capture.used, timing.rate_origin == RateOrigin::CaptureTag), (used, used), "{tag}");
        assert_eq!(timing.doubt, (!used).then_some(Doubt::Player), "{tag}");
        assert!((clock.seconds(50, even[50]) - 50.0 / rate).abs() < 1e-14, "{tag}");
        assert_eq!(timing.notes.iter().any(|n| n.contains("com.android.capture.fps")), rate != 30.0 || !used);
    }
    let (timing, _) = container(&even, fine, &captured(240.0, &[[30, 1]])).unwrap();
    assert_eq!(
        timing.notes,
        ["240 frames per s by the camera's own tag com.android.capture.fps; the file plays at 30"]
    );
}

#[test]
fn a_capture_tag_keeps_gaps_and_the_jitter_of_variable_stamps() {
    let fine = TimeBase { numerator: 1, denominator: 90_000 };
    let gap: Vec<i64> = (0..100).map(|k| 3000 * (k + if k < 50 { 0 } else { 2 })).collect();
    let (_, clock) = container(&gap, fine, &captured(240.0, &[[30, 1]])).unwrap();
    assert!((clock.seconds(60, gap[60]) - 62.0 / 240.0).abs() < 1e-14);
    // In ticks of 1 ms the same, through the grid.
    let coarse: Vec<i64> = gap.iter().map(|t| (*t as f64 / 90.0).round() as i64).collect();
    let (timing, clock) = container(&coarse, MS, &captured(240.0, &[[30, 1]])).unwrap();
    assert_eq!((timing.gaps, timing.plays_at_hz), (1, Some(30.0)));
    assert!((clock.seconds(60, coarse[60]) - 62.0 / 240.0).abs() < 1e-12);
    // Stamps that are not even are played eight times slower, each.
    let wild: Vec<i64> = (0..100).map(|k| 3000 * k + (k * k * 7919) % 200).collect();
    let (timing, clock) = container(&wild, fine, &captured(240.0, &[[30, 1]])).unwrap();
    assert_eq!((timing.kind, timing.rate_origin), (TimingKind::Variable, RateOrigin::CaptureTag));
    assert!((clock.seconds(60, wild[60]) - fine.seconds(wild[60]) / 8.0).abs() < 1e-14);
    // A phone in the dark: 24 to 30 frames a second, with the tag of 30. That is no slow motion.
    let dark: Vec<i64> = (0..100).map(|k| 3600 * k + (k * k * 7919) % 600).collect();
    let (timing, clock) = container(&dark, fine, &captured(30.0, &[[25, 1]])).unwrap();
    assert!(!timing.capture.unwrap().used);
    assert_eq!(clock.seconds(60, dark[60]), fine.seconds(dark[60]));
}

#[test]
fn a_players_rate_is_doubted_with_the_factor() {
    let fine = TimeBase { numerator: 1, denominator: 15360 };
    let even: Vec<i64> = (0..100).map(|k| 512 * k).collect();
    let (timing, _) = container(&even, fine, &claims(&[[30, 1]])).unwrap();
    assert_eq!(timing.doubt, Some(Doubt::Player));
    assert!(
        timing.notes[0].contains("if it was filmed at 240 frames per s, every rate is 8 times too small"),
        "{:?}",
        timing.notes
    );
    // Faster than players, given by the user, by the camera's header: no doubt.
    let fast: Vec<i64> = (0..100).map(|k| 30 * k).collect();
    assert!(container(&fast, fine, &claims(&[[512, 1]])).unwrap().0.notes.is_empty());
    for origin in [RateOrigin::User, RateOrigin::CameraHeader, RateOrigin::TimeStamps] {
        let (timing, _) =
            decide(&steps(even.clone()), fine, origin, &captured(f64::MAX, &[]), Some(30.0)).unwrap();
        assert_eq!(timing.doubt, None, "{origin:?}");
    }
    let (timing, _) = decide(&steps(0..9), MS, RateOrigin::Unknown, &claims(&[]), None).unwrap();
    assert_eq!(timing.doubt, Some(Doubt::Unknown));
}

#[test]
fn the_camera_s_own_fine_stamps_are_never_moved() {
    let base = TimeBase { numerator: 1, denominator: 1 << 32 };
    let stamps: Vec<i64> = (0..500).map(|k| 4_294_967 * k + (k * 7919) % 3).collect();
    let (timing, clock) =
        decide(&steps(stamps.clone()), base, RateOrigin::TimeStamps, &claims(&[[1000, 1]]), None).unwrap();
    assert!(timing.notes.is_empty());
    for (k, &t) in stamps.iter().enumerate() {
        assert_eq!(clock.seconds(k as u64, t), base.seconds(t));
    }
}
