//! The even grid that rounded time stamps come from, if they come from one.
//!
//! Owns: [`fit`]. Stamps of a grid, rounded in whatever way, lie in a strip along a line `ticks = a + step * k` that
//! is less than one tick high; which steps such a strip allows is exact from the hull of the points.

use super::steps::Steps;
use crate::frame::TimeBase;

/// A strip this high holds whatever rounding to whole ticks does, in ticks; equal to it is one step too far.
const ROUNDED: f64 = 1.0 - 1e-9;
/// A strip this high holds what was rounded twice.
const ROUNDED_TWICE: f64 = 1.5;
/// All stamps within one tick of the grid: the highest strip that is believed.
const WITHIN_A_TICK: f64 = 2.0;
/// A round number is taken for the rate if such numbers are this many times further apart than what the stamps leave
/// open: by chance one lies there once in so many films.
const RARE: f64 = 10.0;
/// Rates of television, whose whole number is over 1.001.
const TELEVISION: [u64; 8] = [24, 30, 48, 60, 72, 96, 120, 240];
/// A grid with gaps is told from chance by steps of so many ticks, in ticks.
const CLEAR_STEP: f64 = 8.0;
/// Steps, in ticks, from which a gap shows in one step alone.
const PLAIN_STEP: f64 = 2.5;
/// Fewest frames in which time stamps at the ends may be off the grid.
const FRAMES_FOR_STRAY: u64 = 6;

/// Time from frame to frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Period {
    /// Frames per second, a fraction.
    Rate { numerator: u64, denominator: u64 },
    /// Ticks, with their standard uncertainty.
    Ticks { step: f64, sigma: f64 },
}

/// The grid of a recording's stamps.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Fit {
    pub period: Period,
    /// The rate is one that the container gives; else the stamps alone say it.
    pub is_claimed: bool,
    /// Where the grid begins, ticks.
    pub origin_ticks: f64,
    /// The stamps are on the grid without having been rounded.
    pub is_exact: bool,
    /// Place of the first frame after each gap, and frames that lack up to there.
    pub gaps: Vec<(u64, u64)>,
    /// The first, or the last, stamp is off the grid.
    pub skip_first: bool,
    pub skip_last: bool,
}

/// Ticks from frame to frame at a rate of `rate[0] / rate[1]` frames per second.
fn step_of(rate: [u64; 2], base: TimeBase) -> f64 {
    let over = u128::from(rate[1]) * u128::from(base.denominator);
    over as f64 / (u128::from(rate[0]) * u128::from(base.numerator)) as f64
}

/// The grid that all stamps lie within a tick of. `claims` are rates that the container gives, frames per second as
/// fractions, the likeliest first: one that all stamps agree with is the grid's.
pub(super) fn fit(steps: &Steps, base: TimeBase, claims: &[[u64; 2]]) -> Option<Fit> {
    if steps.len() < 2 || steps.runs().iter().any(|r| r.0 < 0) {
        return None;
    }
    let ends = if steps.len() < FRAMES_FOR_STRAY { 1 } else { 4 };
    for skip in 0..ends {
        let (skip_first, skip_last) = (skip & 2 != 0, skip & 1 != 0);
        let stamps = Stamps { steps, skip_first, skip_last };
        let found = even(&stamps, base, claims).or_else(|| with_gaps(&stamps, base, claims));
        if let Some(fit) = found.filter(|f| skip == 0 || ends_in_order(&stamps, f, base)) {
            return Some(Fit { skip_first, skip_last, ..fit });
        }
    }
    None
}

/// Stamps but for those at the ends that are left out.
struct Stamps<'a> {
    steps: &'a Steps,
    skip_first: bool,
    skip_last: bool,
}

impl Stamps<'_> {
    fn iter(&self) -> impl Iterator<Item = i64> + '_ {
        let count = self.len() as usize;
        self.steps.stamps().skip(usize::from(self.skip_first)).take(count)
    }

    fn len(&self) -> u64 {
        self.steps.len() - u64::from(self.skip_first) - u64::from(self.skip_last)
    }
}

/// Whether the stamps left out are before and after the grid's.
fn ends_in_order(stamps: &Stamps<'_>, fit: &Fit, base: TimeBase) -> bool {
    let step = match fit.period {
        Period::Rate { numerator, denominator } => step_of([numerator, denominator], base),
        Period::Ticks { step, .. } => step,
    };
    let lacking = fit.gaps.last().map_or(0, |g| g.1);
    let last = fit.origin_ticks + (stamps.len() - 1 + lacking) as f64 * step;
    let end = stamps.steps.last() as f64;
    (!stamps.skip_first || (stamps.steps.first() as f64) < fit.origin_ticks)
        && (!stamps.skip_last || end > last)
}

/// Frames one after the other, none lacking.
fn even(stamps: &Stamps<'_>, base: TimeBase, claims: &[[u64; 2]]) -> Option<Fit> {
    let mut strip = Strip::default();
    for (k, t) in stamps.iter().enumerate() {
        strip.push(k as i64, t);
    }
    chosen(&strip, base, claims, Vec::new())
}

/// Frames with some lacking here and there.
fn with_gaps(stamps: &Stamps<'_>, base: TimeBase, claims: &[[u64; 2]]) -> Option<Fit> {
    let plain = longest_stretch(stamps).and_then(|strip| chosen(&strip, base, claims, Vec::new())).map(
        |fit| match fit.period {
            Period::Rate { numerator, denominator } => (step_of([numerator, denominator], base), true),
            Period::Ticks { step, .. } => (step, false),
        },
    );
    let candidates = claims.iter().map(|&rate| (step_of(rate, base), true)).chain(plain);
    for (step, known) in candidates {
        let places = if known { placed_in_strip(stamps, step) } else { None };
        let Some(places) = places.or_else(|| placed_one_by_one(stamps, step)) else { continue };
        let gaps = gaps_of(&places);
        let most = (stamps.len() - 1) / if step >= CLEAR_STEP { 2 } else { 4 };
        if gaps.is_empty() || gaps.len() as u64 > most {
            continue;
        }
        let mut strip = Strip::default();
        for (&k, t) in places.iter().zip(stamps.iter()) {
            strip.push(k as i64, t);
        }
        let gaps = gaps.into_iter().map(|(at, n)| (at + u64::from(stamps.skip_first), n)).collect();
        if let Some(fit) = chosen(&strip, base, claims, gaps) {
            return Some(fit);
        }
    }
    None
}

/// The longest row of frames whose stamps can be those of an even rate with none lacking.
fn longest_stretch(stamps: &Stamps<'_>) -> Option<Strip> {
    let ticks: Vec<i64> = stamps.iter().collect();
    let (mut start, mut longest) = (0, 0..0);
    let (mut strip, mut step) = (Strip::default(), 0.0);
    for (i, &t) in ticks.iter().enumerate() {
        strip.push((i - start) as i64, t);
        if i > start && strip.height(step) >= ROUNDED {
            match strip.lowest() {
                Some((slope, height)) if height < ROUNDED => step = slope,
                _ => {
                    start = i;
                    strip = Strip::default();
                    strip.push(0, t);
                }
            }
        }
        if i + 1 - start > longest.len() {
            longest = start..i + 1;
        }
    }
    let mut strip = Strip::default();
    for (k, &t) in ticks[longest.clone()].iter().enumerate() {
        strip.push(k as i64, t);
    }
    (longest.len() > 2).then_some(strip)
}

/// Places on a grid of exactly known step, or `None` if some stamp is on none.
fn placed_in_strip(stamps: &Stamps<'_>, step: f64) -> Option<Vec<u64>> {
    let (mut lo, mut hi) = (0.0f64, 0.0f64);
    let mut places = Vec::with_capacity(stamps.len() as usize);
    let mut stamps = stamps.iter();
    let first = stamps.next()?;
    let mut at = 0u64;
    places.push(at);
    for t in stamps {
        at += 1;
        let mut off = ticks_between(first, t) - step * at as f64;
        if hi.max(off) - lo.min(off) >= ROUNDED {
            let lacking = ((off - (lo + hi) / 2.0) / step).round();
            off -= lacking * step;
            if lacking < 1.0 || hi.max(off) - lo.min(off) >= ROUNDED {
                return None;
            }
            at += lacking as u64;
        }
        (lo, hi) = (lo.min(off), hi.max(off));
        places.push(at);
    }
    Some(places)
}

/// Places on a grid of a step that is nearly known, each from the one before, or `None` if some stamp is on none.
fn placed_one_by_one(stamps: &Stamps<'_>, step: f64) -> Option<Vec<u64>> {
    if step < PLAIN_STEP {
        return None;
    }
    let mut places = Vec::with_capacity(stamps.len() as usize);
    let (mut at, mut before) = (0u64, None);
    for t in stamps.iter() {
        if let Some(before) = before {
            let ticks = ticks_between(before, t);
            let steps = (ticks / step).round();
            // Two stamps are rounded, and the step is known to a hundredth or better.
            if steps < 1.0 || (ticks - steps * step).abs() > 1.0 + (0.01 * ticks).min(step / 4.0) {
                return None;
            }
            at += steps as u64;
        }
        before = Some(t);
        places.push(at);
    }
    Some(places)
}

fn gaps_of(places: &[u64]) -> Vec<(u64, u64)> {
    let mut lacking = 0;
    let mut gaps = Vec::new();
    for (i, pair) in places.windows(2).enumerate() {
        if pair[1] > pair[0] + 1 {
            lacking += pair[1] - pair[0] - 1;
            gaps.push((i as u64 + 1, lacking));
        }
    }
    gaps
}

/// The grid through a strip of stamps: a rate that the container claims, else the only round number of frames per
/// second (or television's) that the stamps allow, else the middle of what they allow.
fn chosen(strip: &Strip, base: TimeBase, claims: &[[u64; 2]], gaps: Vec<(u64, u64)>) -> Option<Fit> {
    let made = |period, step: f64, is_claimed| {
        let (low, high) = strip.heights(step);
        let first = strip.first.1 as f64;
        Fit {
            period,
            is_claimed,
            // A film that begins at zero begins there; else the rounding is as likely up as down.
            origin_ticks: if strip.first.1 == 0 { 0.0 } else { first + (low + high) / 2.0 },
            is_exact: low == high && step.fract() == 0.0,
            gaps: gaps.clone(),
            skip_first: false,
            skip_last: false,
        }
    };
    let fraction = |[numerator, denominator]: [u64; 2]| Period::Rate { numerator, denominator };
    let agrees = |rate: &&[u64; 2], height: f64| strip.height(step_of(**rate, base)) < height;
    if let Some(rate) = claims.iter().find(|r| agrees(r, ROUNDED)) {
        return Some(made(fraction(*rate), step_of(*rate, base), true));
    }
    let (best, least) = strip.lowest()?;
    if best <= 0.0 || least > WITHIN_A_TICK {
        return None;
    }
    // Steps that are all the same are the truth; nothing was rounded that could be told.
    if least == 0.0 {
        return Some(made(Period::Ticks { step: best, sigma: 0.0 }, best, false));
    }
    if least < ROUNDED {
        let (short, long) = strip.steps_within(ROUNDED, best);
        if let Some(rate) = only_rate(short, long, base) {
            return Some(made(fraction(rate), step_of(rate, base), false));
        }
    }
    if let Some(rate) = claims.iter().find(|r| agrees(r, ROUNDED_TWICE.max(least))) {
        return Some(made(fraction(*rate), step_of(*rate, base), true));
    }
    let (short, long) = strip.steps_within(ROUNDED.max(least + 0.1), best);
    let step = (short + long) / 2.0;
    // Anything between is as likely: the spread of a uniform distribution.
    let sigma = (long - short) / 12f64.sqrt();
    (short > 0.0).then(|| made(Period::Ticks { step, sigma }, step, false))
}

/// The only round number of frames per second, or television's rate, whose step lies between two.
fn only_rate(short: f64, long: f64, base: TimeBase) -> Option<[u64; 2]> {
    let rate = |step: f64| base.denominator as f64 / (base.numerator as f64 * step);
    let (low, high) = (rate(long), rate(short));
    if !(short > 0.0 && high.is_finite()) {
        return None;
    }
    // Whole numbers where they are rare enough, else multiples of 2, 5, 10, 20, ...
    let apart = (RARE * (high - low)).max(1.0);
    let ten = 10f64.powf(apart.log10().floor());
    let unit = [1.0, 2.0, 5.0, 10.0].map(|n| n * ten).into_iter().find(|u| *u >= apart)?;
    let round = ((low + high) / 2.0 / unit).round() * unit;
    let television = TELEVISION.map(|n| [n * 1000, 1001]);
    let others = television.into_iter().filter(|_| unit == 1.0);
    let mut found = [[round as u64, 1]]
        .into_iter()
        .chain(others)
        .filter(|r| r[0] > 0 && (low..=high).contains(&(r[0] as f64 / r[1] as f64)));
    found.next().filter(|_| found.next().is_none())
}

/// Points (k, ticks) seen from above and from below: the hull that holds all of them.
#[derive(Debug, Default)]
struct Strip {
    first: (i64, i64),
    upper: Vec<(i64, i64)>,
    lower: Vec<(i64, i64)>,
}

/// How many ticks later `b` is than `a`. Stamps of damaged files may be as far apart as numbers go.
fn ticks_between(a: i64, b: i64) -> f64 {
    (i128::from(b) - i128::from(a)) as f64
}

/// Twice the area of a triangle; above 0 if `c` lies to the left of the way from `a` to `b`.
fn turn(a: (i64, i64), b: (i64, i64), c: (i64, i64)) -> i128 {
    let side = |p: (i64, i64)| (i128::from(p.0) - i128::from(a.0), i128::from(p.1) - i128::from(a.1));
    let ((bx, by), (cx, cy)) = (side(b), side(c));
    bx * cy - by * cx
}

impl Strip {
    /// Adds a point to the right of all others.
    fn push(&mut self, k: i64, ticks: i64) {
        let point = (k, ticks);
        if self.upper.is_empty() {
            self.first = point;
        }
        while let [.., a, b] = self.upper[..]
            && turn(a, b, point) >= 0
        {
            self.upper.pop();
        }
        self.upper.push(point);
        while let [.., a, b] = self.lower[..]
            && turn(a, b, point) <= 0
        {
            self.lower.pop();
        }
        self.lower.push(point);
    }

    /// Least and greatest of `ticks - step * k` over all points, from the first.
    fn heights(&self, step: f64) -> (f64, f64) {
        let off = |p: &(i64, i64)| ticks_between(self.first.1, p.1) - step * (p.0 - self.first.0) as f64;
        let low = self.lower.iter().map(off).fold(f64::INFINITY, f64::min);
        let high = self.upper.iter().map(off).fold(f64::NEG_INFINITY, f64::max);
        (low, high)
    }

    /// How high a strip of this slope must be to hold all points.
    fn height(&self, step: f64) -> f64 {
        let (low, high) = self.heights(step);
        high - low
    }

    /// The slope of the lowest strip, and its height; `None` for fewer than two points.
    fn lowest(&self) -> Option<(f64, f64)> {
        // The height is convex in the slope and has its corners at the slopes of the hull's edges.
        let slopes = |hull: &[(i64, i64)]| -> Vec<f64> {
            hull.windows(2).map(|w| ticks_between(w[0].1, w[1].1) / (w[1].0 - w[0].0) as f64).collect()
        };
        let mut slopes = [slopes(&self.upper), slopes(&self.lower)].concat();
        slopes.sort_by(f64::total_cmp);
        let (mut a, mut b) = (0, slopes.len().checked_sub(1)?);
        while a < b {
            let middle = (a + b) / 2;
            if self.height(slopes[middle]) <= self.height(slopes[middle + 1]) {
                b = middle;
            } else {
                a = middle + 1;
            }
        }
        Some((slopes[a], self.height(slopes[a])))
    }

    /// The smallest and the greatest slope of strips up to `height`, around that of the lowest.
    fn steps_within(&self, height: f64, best: f64) -> (f64, f64) {
        let length = self.lower.last().map_or(1, |p| p.0 - self.first.0).max(1) as f64;
        let edge = |sign: f64| {
            // Past this the ends alone are further apart.
            let (mut inside, mut outside) = (0.0, 2.0 * (height + 1.0) / length);
            for _ in 0..60 {
                let middle = (inside + outside) / 2.0;
                if self.height(best + sign * middle) < height {
                    inside = middle;
                } else {
                    outside = middle;
                }
            }
            best + sign * inside
        };
        (edge(-1.0), edge(1.0))
    }
}
