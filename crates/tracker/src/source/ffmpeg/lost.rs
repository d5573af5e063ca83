//! Finds frames that are not there: gaps in the time stamps of a film whose frames are otherwise evenly spaced.
//!
//! Owns: [`Lost`]. A gap is damage where the file is damaged beside it; else the recorder left frames out, where packets
//! cannot be cut out of the file without a trace or the coded film proves that none were. A film of variable rate has gaps by nature: there nothing is concluded from them.

use std::collections::{BTreeMap, BTreeSet};

use crate::frame::TimeBase;
use crate::gaps::{Cause, Gap, Gaps};
use crate::timing::{Steps, grid_gaps};

/// Maximum number of places of damage that are remembered.
const MOST_BREAKS: usize = 10_000;
/// Stretches of equal steps that are remembered (16 MiB), as many as places where film goes on; more are a variable rate.
const MOST_RUNS: usize = 1 << 20;
/// Frames that a recorder may leave out: at 100 000 per s half a day. A time that is further off is damaged.
const MOST_DROPPED: u64 = 1 << 32;
/// Part of all steps that must be the usual one, give or take a tick, for a film to be called evenly spaced.
const EVEN: f64 = 0.8;
/// Usual steps, in ticks, from which a step shows by itself whether a frame lacks, though its ends are rounded.
const CLEAR_STEP: i64 = 8;
/// Frames by which display order and decoding order may differ (H.264's and HEVC's limit).
const REORDER: i64 = 16;

/// Watches the times of frames as they are handed out.
#[derive(Debug)]
pub(super) struct Lost {
    base: TimeBase,
    /// Rates that the container gives.
    claims: Vec<[u64; 2]>,
    steps: Steps,
    /// Times before which packets are gone, ticks, and how many frames came before, once that is known.
    breaks: Vec<(i64, Option<u64>)>,
    /// Times near which the file is damaged, ticks.
    damaged: Vec<i64>,
    /// Times before which frames are not there that were not in the coded film either, ticks.
    goes_on: BTreeSet<i64>,
    /// Whether frames can be cut out of the file without a trace.
    is_blind: bool,
    /// The file is damaged before its first packet.
    begins_broken: bool,
}

/// A step between two frames, ticks, and the frames that lack in it.
#[derive(Debug, Clone, Copy)]
struct Wide {
    after: u64,
    from: i64,
    to: i64,
    frames: u64,
}

impl Lost {
    /// A film of this time base, whose container gives these rates. `is_blind` is whether frames can be cut out of the
    /// file without a trace: then a gap may be damage.
    pub(super) fn new(base: TimeBase, claims: &[[u64; 2]], is_blind: bool) -> Self {
        Self {
            base,
            claims: claims.to_vec(),
            steps: Steps::default(),
            breaks: Vec::new(),
            damaged: Vec::new(),
            goes_on: BTreeSet::new(),
            is_blind,
            begins_broken: false,
        }
    }

    /// The file is damaged before its first packet, and packets may be gone there.
    pub(super) fn begins_broken(&mut self) {
        self.begins_broken = true;
    }

    /// Packets before the one of this time are gone.
    pub(super) fn broken(&mut self, ticks: i64) {
        if self.breaks.len() < MOST_BREAKS {
            self.breaks.push((ticks, None));
        }
        self.damaged(ticks);
    }

    /// The file is damaged before the packet of this time: a gap near it is damage.
    pub(super) fn damaged(&mut self, ticks: i64) {
        if self.damaged.len() < MOST_BREAKS {
            self.damaged.push(ticks);
        }
    }

    /// There is a gap before the packet of this time, but the coded film goes on with it.
    pub(super) fn goes_on(&mut self, ticks: i64) {
        if self.goes_on.len() < MOST_RUNS {
            self.goes_on.insert(ticks);
        }
    }

    /// A frame is handed out.
    pub(super) fn frame(&mut self, index: u64, ticks: i64) {
        for (_, frames) in self.breaks.iter_mut().filter(|(at, frames)| frames.is_none() && *at <= ticks) {
            *frames = Some(index);
        }
        if self.steps.runs().len() < MOST_RUNS {
            self.steps.push(ticks);
        }
    }

    /// The frames that are not there between those handed out so far.
    pub(super) fn gaps(&self) -> Gaps {
        let mut gaps = Gaps::default();
        if self.begins_broken {
            gaps.push(Gap { after: None, frames: None, cause: Cause::Damage });
        }
        let Some((usual, wide)) = self.on_grid().or_else(|| self.by_steps()) else {
            // Where frames come at any time, a break that frames follow is all that tells of a loss.
            for frames in self.breaks.iter().filter_map(|(_, f)| *f) {
                gaps.push(Gap { after: frames.checked_sub(1), frames: None, cause: Cause::Damage });
            }
            return gaps;
        };
        let reach = (REORDER as f64 * usual) as i64;
        for wide in wide {
            let near = wide.from.saturating_sub(reach)..=wide.to.saturating_add(reach);
            let is_damaged = wide.frames > MOST_DROPPED || self.damaged.iter().any(|at| near.contains(at));
            let cause = if is_damaged {
                Cause::Damage
            } else if self.is_blind && self.goes_on.range(wide.to..=*near.end()).next().is_none() {
                Cause::Unknown
            } else {
                Cause::Recorder
            };
            gaps.push(Gap { after: Some(wide.after), frames: Some(wide.frames), cause });
        }
        gaps
    }

    /// Time from frame to frame, ticks, and the steps in which frames lack, where the stamps are those of an even rate
    /// rounded to whole ticks.
    fn on_grid(&self) -> Option<(f64, Vec<Wide>)> {
        if self.steps.runs().len() == MOST_RUNS {
            return None;
        }
        let gaps = grid_gaps(&self.steps, self.base, &self.claims)?;
        let mut wide = Vec::with_capacity(gaps.len());
        let mut lacking = 0;
        let mut pairs = self.pairs();
        let mut next = 1;
        for (place, up_to) in gaps {
            let (from, to) = pairs.nth((place - next) as usize)?;
            wide.push(Wide { after: place - 1, from, to, frames: up_to - lacking });
            (next, lacking) = (place + 1, up_to);
        }
        let steps = (self.steps.len() - 1 + lacking) as f64;
        Some((self.steps.span() as f64 / steps, wide))
    }

    /// Step and gaps where single stamps are off the grid, by the step that most frames have.
    fn by_steps(&self) -> Option<(f64, Vec<Wide>)> {
        if self.steps.runs().len() == MOST_RUNS {
            return None;
        }
        let (usual, rounding) = self.usual()?;
        // Where stamps are rounded, each is off by up to a tick.
        let rounding = rounding as f64;
        let wide = self.pairs().zip(0..).filter_map(|((from, to), after)| {
            let step = to.saturating_sub(from) as f64;
            let frames = (step / usual).round() - 1.0;
            let off = (step - (frames + 1.0) * usual).abs();
            let is_wide = step >= 1.5 * usual + rounding && off <= (0.1 * usual).max(2.0 * rounding);
            is_wide.then_some(Wide { after, from, to, frames: frames as u64 })
        });
        Some((usual, wide.collect()))
    }

    /// The usual step and by how much steps differ from it through rounding, ticks; `None` for a variable rate and for
    /// one of few ticks, where rounding cannot be told from frames that lack.
    fn usual(&self) -> Option<(f64, i64)> {
        let mut steps: BTreeMap<i64, u64> = BTreeMap::new();
        for &(step, count) in self.steps.runs().iter().filter(|(step, _)| *step > 0) {
            *steps.entry(step).or_insert(0) += count;
        }
        let all: u64 = steps.values().sum();
        [0, 1].into_iter().find_map(|rounding| {
            let near = |s: i64| steps.range(s - rounding..=s.saturating_add(rounding));
            let count = |s: i64| near(s).map(|(_, n)| *n).sum::<u64>();
            let (mode, _) = steps.iter().max_by_key(|(s, n)| (count(**s), **n))?;
            let sum: f64 = near(*mode).map(|(s, n)| *s as f64 * *n as f64).sum();
            let is_even = *mode >= CLEAR_STEP && count(*mode) as f64 >= EVEN * all as f64;
            is_even.then(|| (sum / count(*mode) as f64, rounding))
        })
    }

    /// Times of each frame and the next, ticks.
    fn pairs(&self) -> impl Iterator<Item = (i64, i64)> + '_ {
        self.steps.stamps().zip(self.steps.stamps().skip(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn watch(times: impl IntoIterator<Item = i64>, breaks: &[i64]) -> Gaps {
        let mut lost = Lost::new(TimeBase { numerator: 1, denominator: 1000 }, &[], false);
        breaks.iter().for_each(|b| lost.broken(*b));
        times.into_iter().enumerate().for_each(|(i, t)| lost.frame(i as u64, t));
        lost.gaps()
    }

    #[test]
    fn a_gap_is_damage_only_beside_damage() {
        let times = || (0..40).filter(|i| !(8..11).contains(i)).map(|i| 1000 + 33 * i + i / 3);
        let gap = |cause| Gap { after: Some(7), frames: Some(3), cause };
        assert_eq!(watch(times(), &[]).places, [gap(Cause::Recorder)]);
        assert_eq!(watch(times(), &[1000 + 33 * 11]).places, [gap(Cause::Damage)]);
        assert!(watch((0..40).map(|i| 33 * i), &[33 * 8]).places.is_empty(), "nothing is lost there");
    }

    #[test]
    fn a_variable_rate_has_no_gaps_but_where_the_file_is_broken() {
        // Steps of 1 to 5 times a sixtieth, as screen recorders make them.
        let times: Vec<i64> = (0..200)
            .scan(0, |t, i: i64| {
                *t += 1500 * (1 + i * i % 5);
                Some(*t)
            })
            .collect();
        assert!(watch(times.clone(), &[]).places.is_empty());
        let gaps = watch(times.clone(), &[times[20]]);
        assert_eq!(gaps.places, [Gap { after: Some(19), frames: None, cause: Cause::Damage }]);
    }

    #[test]
    fn stamps_that_are_now_and_then_a_tick_off_have_gaps_of_the_usual_step() {
        let jitter = |i: i64| i64::from(i % 7 == 0) - i64::from(i % 11 == 0) * 2;
        let times = (0..200).filter(|i| !(90..92).contains(i)).map(|i| 40 * i + jitter(i));
        let gap = Gap { after: Some(89), frames: Some(2), cause: Cause::Recorder };
        assert_eq!(watch(times, &[]).places, [gap]);
        // Of steps of few ticks nothing is said.
        let times = (0..200).map(|i| 2 * i + jitter(i).signum());
        assert!(watch(times, &[]).places.is_empty());
    }

    #[test]
    fn ticks_as_long_as_a_frame_are_no_gaps() {
        for rate in [600.0, 834.0, 900.0, 960.0, 990.0] {
            let gaps = watch((0..1000).map(|i| (f64::from(i) * 1000.0 / rate).round() as i64), &[]);
            assert!(gaps.places.is_empty(), "{rate}: {gaps:?}");
        }
    }
}
