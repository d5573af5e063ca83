//! Finds the even grid that rounded time stamps come from, if they come from one.
//!
//! Owns: [`fit`]. Stamps of a grid, rounded in whatever way, lie in a strip along a line `ticks = a + step * k` that
//! is less than one tick high; which steps such a strip allows is exact from the hull of the points.

use super::places::{self, Gaps, Places};
use super::steps::Steps;
use super::strip::{ROUNDED, Strip};
use crate::frame::TimeBase;

/// Height of the strip that holds what was rounded twice, ticks.
const ROUNDED_TWICE: f64 = 1.5;
/// Height of the highest strip that is believed, ticks: all stamps are within one tick of the grid.
const WITHIN_A_TICK: f64 = 2.0 + 1e-9;
/// A round number is taken for the rate if such numbers are this many times further apart than what the stamps leave
/// open: by chance one lies there once in so many films.
const RARE: f64 = 10.0;
/// Rates of television, whose whole number is over 1.001.
const TELEVISION: [u64; 8] = [24, 30, 48, 60, 72, 96, 120, 240];
/// Length of the steps by which a grid with gaps is told from chance, ticks.
const CLEAR_STEP: f64 = 8.0;
/// Rates that differ by less, relatively, are told apart by what is likelier and not by the stamps: a camera of a whole
/// tick per frame left frames out, or another camera has a rate so near to that.
const NEAR_RATE: f64 = 0.01;
/// So many gaps of a grid of whole ticks may by chance be as far apart as the rounding of another rate would put them.
const FEW_GAPS: usize = 2;
/// Least number of frames in which time stamps at the ends may be off the grid.
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
    pub gaps: Gaps,
    /// The first, or the last, stamp is off the grid.
    pub skip_first: bool,
    pub skip_last: bool,
}

/// Ticks from frame to frame at a rate of `rate[0] / rate[1]` frames per second.
fn step_of(rate: [u64; 2], base: TimeBase) -> f64 {
    let over = u128::from(rate[1]) * u128::from(base.denominator);
    over as f64 / (u128::from(rate[0]) * u128::from(base.numerator)) as f64
}

/// The gaps between stamps of an even grid: the place of the first frame after each gap, and frames that lack up to there. `None`
/// where the stamps are on no grid.
pub(crate) fn gaps(steps: &Steps, base: TimeBase, claims: &[[u64; 2]]) -> Option<Gaps> {
    fit(steps, base, claims).map(|fit| fit.gaps)
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
        let fit = found(&stamps, base, claims);
        if let Some(fit) = fit.filter(|f| skip == 0 || ends_in_order(&stamps, f, base)) {
            let gaps = fit.gaps.iter().map(|(at, n)| (at + u64::from(skip_first), *n)).collect();
            return Some(Fit { skip_first, skip_last, gaps, ..fit });
        }
    }
    None
}

/// The grid of stamps: one that rounding to whole ticks explains goes before any that is wider, and of these a rate that
/// the container gives, with or without gaps, before all others.
fn found(stamps: &Stamps<'_>, base: TimeBase, claims: &[[u64; 2]]) -> Option<Fit> {
    let ticks = stamps.ticks();
    let even = strip_of(0..ticks.len() as u64, &ticks);
    let with_gaps = |rate: &[u64; 2]| {
        let places = places::in_strip(&ticks, step_of(*rate, base))?;
        placed(&ticks, places, base, &[*rate], ROUNDED)
    };
    at_claim(&even, base, claims, ROUNDED, &Gaps::new())
        .or_else(|| claims.iter().find_map(with_gaps))
        .or_else(|| unclaimed(&ticks, &even, base))
        .or_else(|| chosen(&even, base, claims, Gaps::new(), WITHIN_A_TICK))
        .or_else(|| rough(&ticks, base, claims))
}

/// The grid of stamps, rounded to whole ticks, of which nothing but the stamps tells the rate.
fn unclaimed(ticks: &[i64], even: &Strip, base: TimeBase) -> Option<Fit> {
    let whole = places::at_commonest(ticks).and_then(|p| placed(ticks, p, base, &[], ROUNDED));
    // Every step that the stamps allow is near to the whole one.
    let is_near = |fit: &Fit| {
        let farthest = match fit.period {
            Period::Rate { .. } => step_ticks(fit, base),
            Period::Ticks { step, sigma } => step + 3f64.sqrt() * sigma,
        };
        whole.as_ref().is_some_and(|w| (farthest / step_ticks(w, base) - 1.0).abs() < NEAR_RATE)
    };
    if let Some(fit) = chosen(even, base, &[], Gaps::new(), ROUNDED) {
        let is_chance = is_near(&fit) && whole.as_ref().is_some_and(|w| w.gaps.len() <= FEW_GAPS);
        return if is_chance { whole } else { Some(fit) };
    }
    let stretch = places::longest_stretch(ticks)?;
    let plain = chosen(&strip_of(0.., &ticks[stretch.clone()]), base, &[], Gaps::new(), ROUNDED)?;
    let at_rate = |[numerator, denominator]: [u64; 2]| {
        let places = places::in_strip(ticks, step_of([numerator, denominator], base))?;
        placed(ticks, places, base, &[], ROUNDED)
    };
    let measured = match plain.period {
        Period::Rate { numerator, denominator } => at_rate([numerator, denominator]),
        Period::Ticks { .. } => None,
    };
    let grown = || placed(ticks, places::grown(ticks, &stretch)?, base, &[], ROUNDED);
    match measured.or_else(grown) {
        Some(fit) if !is_near(&fit) => Some(fit),
        // Where a frame is a few ticks long, only frames at that very rate tell what is a gap and what is rounding.
        measured if step_ticks(&plain, base) >= CLEAR_STEP || is_near(&plain) => whole.or(measured),
        measured => measured,
    }
    .or_else(|| at_rate(roundest(step_ticks(&plain, base), base)?))
}

/// The roundest number of frames per second whose step is near to this one.
fn roundest(step: f64, base: TimeBase) -> Option<[u64; 2]> {
    let rate = base.denominator as f64 / (base.numerator as f64 * step);
    let digits = (0..=12).rev().flat_map(|n| [10.0, 5.0, 2.0].map(|m| m * 10f64.powi(n - 1)));
    let near = |unit: f64| (rate / unit).round() * unit;
    let found = digits.map(near).find(|r| *r >= 1.0 && (r / rate - 1.0).abs() < NEAR_RATE)?;
    Some([found as u64, 1])
}

/// The grid of stamps that rounding to whole ticks alone does not explain, with gaps.
fn rough(ticks: &[i64], base: TimeBase, claims: &[[u64; 2]]) -> Option<Fit> {
    let stretch = places::longest_stretch(ticks);
    let plain =
        stretch.and_then(|s| chosen(&strip_of(0.., &ticks[s]), base, claims, Gaps::new(), WITHIN_A_TICK));
    let steps = claims.iter().map(|rate| step_of(*rate, base)).chain(plain.map(|fit| step_ticks(&fit, base)));
    steps
        .into_iter()
        .find_map(|step| placed(ticks, places::one_by_one(ticks, step)?, base, claims, WITHIN_A_TICK))
}

/// The grid on which stamps have these places, if there are gaps between them, and not too many to be told from chance.
fn placed(ticks: &[i64], places: Places, base: TimeBase, claims: &[[u64; 2]], highest: f64) -> Option<Fit> {
    let gaps = places::gaps_of(&places);
    let fit = chosen(&strip_of(places, ticks), base, claims, gaps, highest)?;
    let most = (ticks.len() - 1) / if step_ticks(&fit, base) >= CLEAR_STEP { 2 } else { 4 };
    (!fit.gaps.is_empty() && fit.gaps.len() <= most).then_some(fit)
}

fn strip_of(places: impl IntoIterator<Item = u64>, ticks: &[i64]) -> Strip {
    let mut strip = Strip::default();
    for (k, &t) in places.into_iter().zip(ticks) {
        strip.push(k as i64, t);
    }
    strip
}

/// Ticks from frame to frame.
fn step_ticks(fit: &Fit, base: TimeBase) -> f64 {
    match fit.period {
        Period::Rate { numerator, denominator } => step_of([numerator, denominator], base),
        Period::Ticks { step, .. } => step,
    }
}

/// Stamps but for those at the ends that are left out.
struct Stamps<'a> {
    steps: &'a Steps,
    skip_first: bool,
    skip_last: bool,
}

impl Stamps<'_> {
    fn ticks(&self) -> Vec<i64> {
        self.steps.stamps().skip(usize::from(self.skip_first)).take(self.len() as usize).collect()
    }

    fn len(&self) -> u64 {
        self.steps.len() - u64::from(self.skip_first) - u64::from(self.skip_last)
    }
}

/// Whether the stamps left out are before and after the grid's.
fn ends_in_order(stamps: &Stamps<'_>, fit: &Fit, base: TimeBase) -> bool {
    let lacking = fit.gaps.last().map_or(0, |g| g.1);
    let last = fit.origin_ticks + (stamps.len() - 1 + lacking) as f64 * step_ticks(fit, base);
    let end = stamps.steps.last() as f64;
    (!stamps.skip_first || (stamps.steps.first() as f64) < fit.origin_ticks)
        && (!stamps.skip_last || end > last)
}

/// The grid of a strip, if it is a rate that the container gives and that all stamps agree with.
fn at_claim(strip: &Strip, base: TimeBase, claims: &[[u64; 2]], height: f64, gaps: &Gaps) -> Option<Fit> {
    let rate = claims.iter().find(|r| strip.height(step_of(**r, base)) < height)?;
    let period = Period::Rate { numerator: rate[0], denominator: rate[1] };
    Some(grid_of(strip, period, step_of(*rate, base), true, gaps))
}

fn grid_of(strip: &Strip, period: Period, step: f64, is_claimed: bool, gaps: &Gaps) -> Fit {
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
}

/// The grid through a strip of stamps: a rate that the container gives, else the only round number of frames per
/// second (or television's) that the stamps allow, else the middle of what they allow. `None` for a strip of `highest`
/// ticks or more.
fn chosen(strip: &Strip, base: TimeBase, claims: &[[u64; 2]], gaps: Gaps, highest: f64) -> Option<Fit> {
    if let Some(fit) = at_claim(strip, base, claims, ROUNDED, &gaps) {
        return Some(fit);
    }
    let (best, least) = strip.lowest()?;
    if best <= 0.0 || least >= highest {
        return None;
    }
    let measured = |step, sigma| Some(grid_of(strip, Period::Ticks { step, sigma }, step, false, &gaps));
    // Steps of many ticks that are all the same are the truth; nothing was rounded that could be told.
    if least == 0.0 && best >= CLEAR_STEP {
        return measured(best, 0.0);
    }
    if least < ROUNDED {
        let (short, long) = strip.steps_within(ROUNDED, best);
        if let Some([numerator, denominator]) = only_rate(short, long, base) {
            let step = step_of([numerator, denominator], base);
            return Some(grid_of(strip, Period::Rate { numerator, denominator }, step, false, &gaps));
        }
    }
    if let Some(fit) = at_claim(strip, base, claims, ROUNDED_TWICE.max(least), &gaps) {
        return Some(fit);
    }
    let (short, long) = strip.steps_within(ROUNDED.max(least + 0.1), best);
    // Anything between is as likely: the spread of a uniform distribution.
    let sigma = (long - short) / 12f64.sqrt();
    if least == 0.0 {
        return measured(best, sigma);
    }
    if short > 0.0 { measured((short + long) / 2.0, sigma) } else { None }
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
