//! Keeps the time stamps of a recording in little memory: equal steps in a row are one entry.

/// A frame that is not after the one before it, where the stamps are no grid's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Standstill {
    /// Place of the later frame, from 0.
    pub place: u64,
    /// Its time stamp, which is that of the frame before.
    pub ticks: i64,
}

/// Time stamps in the order of the frames.
#[derive(Debug, Clone, Default)]
pub struct Steps {
    first: i64,
    last: i64,
    len: u64,
    /// A step in ticks and how many times it comes in a row.
    runs: Vec<(i64, u64)>,
}

impl Steps {
    /// Adds the next frame's stamp.
    pub fn push(&mut self, ticks: i64) {
        if self.len == 0 {
            self.first = ticks;
        } else {
            let step = ticks.saturating_sub(self.last);
            match self.runs.last_mut() {
                Some((same, count)) if *same == step => *count += 1,
                _ => self.runs.push((step, 1)),
            }
        }
        self.last = ticks;
        self.len += 1;
    }

    /// Number of frames.
    pub fn len(&self) -> u64 {
        self.len
    }

    /// Whether there are no frames.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The first stamp, ticks.
    pub fn first(&self) -> i64 {
        self.first
    }

    /// The last stamp, ticks.
    pub fn last(&self) -> i64 {
        self.last
    }

    /// From the first to the last stamp, ticks.
    pub fn span(&self) -> i64 {
        self.last.saturating_sub(self.first)
    }

    /// Steps in a row, each with how many times it comes.
    pub(crate) fn runs(&self) -> &[(i64, u64)] {
        &self.runs
    }

    /// Least and greatest step; `None` for fewer than two frames.
    pub fn range(&self) -> Option<(i64, i64)> {
        let least = self.runs.iter().map(|r| r.0).min()?;
        let most = self.runs.iter().map(|r| r.0).max()?;
        Some((least, most))
    }

    /// The stamps.
    pub(crate) fn stamps(&self) -> impl Iterator<Item = i64> + '_ {
        let mut at = self.first;
        let steps = self.runs.iter().flat_map(|&(step, count)| std::iter::repeat_n(step, count as usize));
        let first = (self.len > 0).then_some(self.first);
        first.into_iter().chain(steps.map(move |step| {
            at = at.saturating_add(step);
            at
        }))
    }

    /// The first frame that is not after the one before it.
    pub(super) fn standstill(&self) -> Option<Standstill> {
        let (mut place, mut ticks) = (0, self.first);
        for &(step, count) in &self.runs {
            if step <= 0 {
                return Some(Standstill { place: place + 1, ticks: ticks.saturating_add(step) });
            }
            place += count;
            ticks = ticks.saturating_add(step.saturating_mul(count as i64));
        }
        None
    }

    /// Gaps of stamps that are all on a grid of the commonest step: the place after each, and frames that lack up
    /// to there.
    pub(super) fn gaps_of_even(&self) -> Vec<(u64, u64)> {
        let Some(step) = self.commonest().filter(|s| *s > 0) else { return Vec::new() };
        let (mut gaps, mut place, mut lacking) = (Vec::new(), 0, 0u64);
        for &(long, count) in &self.runs {
            for _ in 0..if long > step { count } else { 0 } {
                lacking += (long / step) as u64 - 1;
                place += 1;
                gaps.push((place, lacking));
            }
            place += if long > step { 0 } else { count };
        }
        gaps
    }

    /// The step that most frames have.
    pub(super) fn commonest(&self) -> Option<i64> {
        let mut counts = std::collections::BTreeMap::new();
        for &(step, count) in &self.runs {
            *counts.entry(step).or_insert(0) += count;
        }
        counts.into_iter().max_by_key(|&(step, count)| (count, -step)).map(|(step, _)| step)
    }
}
