//! Frames that are not there: gaps in the time stamps of a film whose frames are otherwise evenly spaced.
//!
//! Owns: [`Lost`]. A gap is damage where the file is damaged beside it; else the recorder left frames out. A film of
//! variable rate has gaps by nature: there nothing is concluded from them.

use crate::gaps::{Cause, Gap, Gaps};

/// Different steps that are counted; more are a variable rate.
const MOST_STEPS: usize = 64;
/// Wide steps that are remembered; more are a variable rate.
const MOST_WIDE: usize = 10_000;
/// Part of all steps that must be the usual one, give or take a tick, for a film to be called evenly spaced.
const EVEN: f64 = 0.8;
/// Frames by which display order and decoding order may differ (H.264's and HEVC's limit).
const REORDER: i64 = 16;

/// A step between two frames that is wider than most.
#[derive(Debug, Clone, Copy)]
struct Wide {
    after: u64,
    from: i64,
    to: i64,
}

/// Watches the times of frames as they are handed out.
#[derive(Debug, Default)]
pub(super) struct Lost {
    last: Option<(u64, i64)>,
    /// Each step seen, ticks, and how often.
    steps: Vec<(i64, u64)>,
    least: Option<i64>,
    wide: Vec<Wide>,
    variable: bool,
    /// Times beside which the file is damaged, ticks, and how many frames came before, once that is known.
    breaks: Vec<(i64, Option<u64>)>,
}

impl Lost {
    /// The file is damaged before the packet of this time.
    pub(super) fn broken(&mut self, ticks: i64) {
        if self.breaks.len() < MOST_WIDE {
            self.breaks.push((ticks, None));
        }
    }

    /// A frame is handed out.
    pub(super) fn frame(&mut self, index: u64, ticks: i64) {
        for (_, frames) in self.breaks.iter_mut().filter(|(at, frames)| frames.is_none() && *at <= ticks) {
            *frames = Some(index);
        }
        if let Some((after, from)) = self.last
            && let Some(step) = ticks.checked_sub(from).filter(|s| *s > 0)
        {
            self.step(Wide { after, from, to: ticks }, step);
        }
        self.last = Some((index, ticks));
    }

    fn step(&mut self, wide: Wide, step: i64) {
        let least = *self.least.get_or_insert(step);
        self.least = Some(least.min(step));
        if let Some((_, count)) = self.steps.iter_mut().find(|(s, _)| *s == step) {
            *count += 1;
        } else if self.steps.len() < MOST_STEPS {
            self.steps.push((step, 1));
        } else {
            self.variable = true;
        }
        if step > least.saturating_add(least / 4) {
            if self.wide.len() < MOST_WIDE {
                self.wide.push(wide);
            } else {
                self.variable = true;
            }
        }
    }

    /// The usual step and by how much steps differ from it through rounding, ticks; `None` for a variable rate.
    fn usual(&self) -> Option<(f64, i64)> {
        let all: u64 = self.steps.iter().map(|(_, n)| n).sum();
        if self.variable {
            return None;
        }
        [0, 1].into_iter().find_map(|rounding| {
            let near = |s: i64| self.steps.iter().filter(move |(t, _)| t.abs_diff(s) <= rounding as u64);
            let count = |s: i64| near(s).map(|(_, n)| *n).sum::<u64>();
            let (mode, _) = self.steps.iter().max_by_key(|(s, n)| (count(*s), *n))?;
            let sum: f64 = near(*mode).map(|(s, n)| *s as f64 * *n as f64).sum();
            (count(*mode) as f64 >= EVEN * all as f64).then(|| (sum / count(*mode) as f64, rounding))
        })
    }

    /// What is not there between the frames handed out so far.
    pub(super) fn gaps(&self) -> Gaps {
        let mut gaps = Gaps::default();
        let Some((usual, rounding)) = self.usual() else {
            // Where frames come at any time, a break that frames follow is all that tells of a loss.
            for frames in self.breaks.iter().filter_map(|(_, f)| *f) {
                gaps.push(Gap { after: frames.checked_sub(1), frames: None, cause: Cause::Damage });
            }
            return gaps;
        };
        for wide in &self.wide {
            let step = (wide.to - wide.from) as f64;
            let frames = (step / usual).round() - 1.0;
            // Where stamps are rounded, each is off by up to a tick.
            let rounding = rounding as f64;
            let off = (step - (frames + 1.0) * usual).abs();
            if step < 1.5 * usual + rounding || off > (0.1 * usual).max(2.0 * rounding) {
                continue;
            }
            let reach = (REORDER as f64 * usual) as i64;
            let near = wide.from.saturating_sub(reach)..=wide.to.saturating_add(reach);
            let damaged = self.breaks.iter().any(|(at, _)| near.contains(at));
            let cause = if damaged { Cause::Damage } else { Cause::Recorder };
            gaps.push(Gap { after: Some(wide.after), frames: Some(frames as u64), cause });
        }
        gaps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn watch(times: impl IntoIterator<Item = i64>, breaks: &[i64]) -> Gaps {
        let mut lost = Lost::default();
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
    fn coarse_ticks_are_no_gaps() {
        // 600 frames per second in milliseconds: steps of 1 and 2.
        let gaps = watch((0..1000).map(|i| (i as f64 / 0.6).round() as i64), &[]);
        assert!(gaps.places.is_empty(), "{gaps:?}");
    }
}
