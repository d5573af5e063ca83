//! Finds where on an even grid each frame is, if some lack.
//!
//! Owns: the ways to find [`Places`]. Must not: choose between grids.

use std::ops::Range;

use super::strip::{ROUNDED, Strip, ticks_between};

/// The place of each frame on the grid, the first at 0.
pub(super) type Places = Vec<u64>;
/// Place of the first frame after each gap among those that are there, and frames that lack up to there.
pub(crate) type Gaps = Vec<(u64, u64)>;

/// Length of a step from which on a gap shows in one step alone, ticks.
const PLAIN_STEP: f64 = 2.5;
/// Part of all steps that must be the commonest, for all others to be gaps of it.
const EVEN: f64 = 0.75;
/// Frames after a gap that tell how many lack in it, where a frame is less than a tick.
const LOOKED_AHEAD: usize = 256;
/// Maximum number of frames lacking in one gap that is tried.
const MOST_TRIED: i64 = 64;

/// The gaps between frames in these places.
pub(super) fn gaps_of(places: &[u64]) -> Gaps {
    let mut lacking = 0;
    let mut gaps = Gaps::new();
    for (i, pair) in places.windows(2).enumerate() {
        if pair[1] > pair[0] + 1 {
            lacking += pair[1] - pair[0] - 1;
            gaps.push((i as u64 + 1, lacking));
        }
    }
    gaps
}

/// The longest row of frames whose stamps can be those of an even rate with none lacking, if it is one of three or more.
pub(super) fn longest_stretch(ticks: &[i64]) -> Option<Range<usize>> {
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
    (longest.len() > 2).then_some(longest)
}

/// Places by the commonest step, if nearly all steps are that and the others multiples of it.
pub(super) fn at_commonest(ticks: &[i64]) -> Option<Places> {
    let mut counts = std::collections::BTreeMap::new();
    let steps = || ticks.windows(2).map(|w| w[1].saturating_sub(w[0]));
    steps().for_each(|step| *counts.entry(step).or_insert(0usize) += 1);
    let (&step, &count) = counts.iter().max_by_key(|(step, count)| (**count, -**step))?;
    let is_whole = |s: &i64| *s > 0 && s % step == 0;
    if step <= 0 || !counts.keys().all(is_whole) || (count as f64) < EVEN * (ticks.len() - 1) as f64 {
        return None;
    }
    let mut at = 0u64;
    let rest = steps().map(|s| {
        at += (s / step) as u64;
        at
    });
    Some(std::iter::once(0).chain(rest).collect())
}

/// Offsets of stamps from a line of known slope.
struct Offsets {
    low: f64,
    high: f64,
}

impl Offsets {
    /// With one more, if rounding to whole ticks explains all.
    fn with(&self, off: f64) -> Option<Self> {
        let (low, high) = (self.low.min(off), self.high.max(off));
        (high - low < ROUNDED).then_some(Self { low, high })
    }
}

/// Places on a grid of exactly known step, or `None` if some stamp is on none.
pub(super) fn in_strip(ticks: &[i64], step: f64) -> Option<Places> {
    let first = *ticks.first()?;
    let off = |i: usize, place: u64| ticks_between(first, ticks[i]) - step * place as f64;
    let mut seen = Offsets { low: 0.0, high: 0.0 };
    let mut places = Places::with_capacity(ticks.len());
    places.push(0);
    for i in 1..ticks.len() {
        let at = places[i - 1] + 1;
        if let Some(with) = seen.with(off(i, at)) {
            seen = with;
            places.push(at);
            continue;
        }
        // Where more than one number of frames may lack, those that follow tell which.
        let least = (((off(i, at) - seen.low - ROUNDED) / step).floor() as i64).max(1);
        let follow = |lacking: u64| {
            let mut with = seen.with(off(i, at + lacking))?;
            let ahead = (i + 1..ticks.len()).take(LOOKED_AHEAD);
            let fits = ahead.take_while(|&j| match with.with(off(j, at + lacking + (j - i) as u64)) {
                Some(w) => {
                    with = w;
                    true
                }
                None => false,
            });
            Some((fits.count(), lacking))
        };
        let tried = (least..least + MOST_TRIED).filter_map(|n| follow(n as u64));
        let (_, lacking) = tried.max_by_key(|(count, n)| (*count, std::cmp::Reverse(*n)))?;
        seen = seen.with(off(i, at + lacking))?;
        places.push(at + lacking);
    }
    Some(places)
}

/// Places on a grid of a step that is nearly known, each from the one before, or `None` if some stamp is on none.
pub(super) fn one_by_one(ticks: &[i64], step: f64) -> Option<Places> {
    if step < PLAIN_STEP {
        return None;
    }
    let mut at = 0u64;
    let mut places = Places::with_capacity(ticks.len());
    places.push(at);
    for pair in ticks.windows(2) {
        let ticks = ticks_between(pair[0], pair[1]);
        let steps = (ticks / step).round();
        // Two stamps are rounded, and the step is known to a hundredth or better.
        if steps < 1.0 || (ticks - steps * step).abs() > 1.0 + (0.01 * ticks).min(step / 4.0) {
            return None;
        }
        at += steps as u64;
        places.push(at);
    }
    Some(places)
}

/// Places on the grid of a stretch of frames, whose step becomes better known with each frame beside it.
pub(super) fn grown(ticks: &[i64], stretch: &Range<usize>) -> Option<Places> {
    let later = continued(&ticks[stretch.start..], stretch.len())?;
    let backwards: Vec<i64> = ticks[..stretch.end].iter().rev().map(|t| t.saturating_neg()).collect();
    let earlier = continued(&backwards, stretch.len())?;
    let before = earlier.last()? + 1 - stretch.len() as u64;
    let first = earlier[stretch.len() - 1..].iter().rev().map(|k| before + stretch.len() as u64 - 1 - k);
    Some(first.chain(later.into_iter().skip(1).map(|k| before + k)).collect())
}

/// Places of stamps of which the first `known` are those of frames without a gap.
fn continued(ticks: &[i64], known: usize) -> Option<Places> {
    let mut places: Places = (0..known as u64).collect();
    let mut strip = Strip::default();
    for (&k, &t) in places.iter().zip(ticks) {
        strip.push(k as i64, t);
    }
    let mut step = strip.lowest()?.0;
    let with = |strip: &Strip, step: f64, place: u64, t: i64| {
        let mut with = strip.clone();
        with.push(place as i64, t);
        if with.height(step) < ROUNDED {
            return Some((with, step));
        }
        with.lowest().filter(|l| l.1 < ROUNDED && l.0 > 0.0).map(|l| (with, l.0))
    };
    for i in known..ticks.len() {
        let at = places[i - 1] + 1;
        if let Some(next) = with(&strip, step, at, ticks[i]) {
            (strip, step) = next;
            places.push(at);
            continue;
        }
        let (low, high) = strip.heights(step);
        let off = ticks_between(strip.first.1, ticks[i]) - step * at as f64 - (low + high) / 2.0;
        let around = (1.0 / step).ceil() as i64 + 1;
        let guess = (off / step).round() as i64;
        let follow = |lacking: u64| {
            let mut grown = with(&strip, step, at + lacking, ticks[i])?;
            let ahead = (i + 1..ticks.len()).take(LOOKED_AHEAD);
            let fits = ahead.take_while(|&j| {
                let more = with(&grown.0, grown.1, at + lacking + (j - i) as u64, ticks[j]);
                more.map(|m| grown = m).is_some()
            });
            Some((fits.count(), lacking))
        };
        let tried = ((guess - around).max(1)..=guess + around).filter_map(|n| follow(n as u64));
        let (_, lacking) = tried.max_by_key(|(count, n)| (*count, std::cmp::Reverse(*n)))?;
        (strip, step) = with(&strip, step, at + lacking, ticks[i])?;
        places.push(at + lacking);
    }
    Some(places)
}
