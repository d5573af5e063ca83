//! Counts the frames that lack between two that are there, and the frames that cannot be decoded.
//!
//! Owns: [`Gap`], [`Gaps`], [`Stretches`], [`Reason`], [`Damage`], how they are told. Must not: read anything.

use serde::{Deserialize, Serialize};

/// Maximum number of places that are kept; more are only counted.
const MOST_KEPT: usize = 1000;
/// Maximum number of places that a sentence names.
const MOST_TOLD: usize = 8;

/// The cause of frames that are not there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// The file is damaged: they were recorded and are lost.
    Damage,
    /// The recorder left them out: they were never in the file.
    Recorder,
    /// Dropped while recording or cut out of the file: nothing in the file tells which, so they count as lost.
    Unknown,
}

/// Frames that are not there between a frame and the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Gap {
    /// Index of the frame before the gap; `None` for a gap before the first.
    pub after: Option<u64>,
    /// How many frames are not there; `None` if nothing tells.
    pub frames: Option<u64>,
    /// Why.
    pub cause: Cause,
}

impl Gap {
    fn place(&self) -> String {
        match self.after {
            Some(after) => format!("between frames {after} and {}", after + 1),
            None => "before frame 0".into(),
        }
    }
}

/// The gaps of a recording: all are counted, the first thousand are kept.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Gaps {
    /// Gaps in the order of the recording.
    pub places: Vec<Gap>,
    /// Frames lost by damage, or for all that the container tells, as far as their number is known.
    pub lost_frames: u64,
    /// Gaps by damage, with those that are not kept.
    pub lost_places: u64,
    /// Frames that the recorder left out.
    pub dropped_frames: u64,
}

impl Gaps {
    /// Adds a gap that comes after all others.
    pub fn push(&mut self, gap: Gap) {
        let frames = gap.frames.unwrap_or(0);
        match gap.cause {
            Cause::Damage | Cause::Unknown => {
                self.lost_frames += frames;
                self.lost_places += 1;
            }
            Cause::Recorder => self.dropped_frames += frames,
        }
        if self.places.len() < MOST_KEPT {
            self.places.push(gap);
        }
    }

    /// Whether frames are lost by damage.
    pub fn is_damage(&self) -> bool {
        self.lost_places > 0
    }

    /// The gaps between frames of `range`.
    pub fn within(&self, range: &std::ops::Range<u64>) -> Self {
        let mut within = Self::default();
        let inside = |g: &&Gap| match g.after {
            Some(after) => after >= range.start && after < range.end.saturating_sub(1),
            None => range.start == 0,
        };
        self.places.iter().filter(inside).for_each(|g| within.push(*g));
        within
    }

    /// The frames lost by damage, a part of a sentence each.
    pub fn lost_words(&self) -> Vec<String> {
        let lost: Vec<&Gap> = self.places.iter().filter(|g| g.cause != Cause::Recorder).collect();
        let mut words: Vec<String> = lost
            .iter()
            .take(MOST_TOLD)
            .map(|g| match g.frames {
                Some(n) if g.cause == Cause::Unknown => {
                    let are = if n == 1 { "1 frame is".to_owned() } else { format!("{n} frames are") };
                    format!(
                        "{are} missing {}, either dropped while recording or cut out of the file",
                        g.place()
                    )
                }
                Some(1) => format!("1 frame is lost {} (gap in the time stamps)", g.place()),
                Some(n) => format!("{n} frames are lost {} (gap in the time stamps)", g.place()),
                None => format!("frames may be lost {} (how many, nothing tells)", g.place()),
            })
            .collect();
        if self.lost_places > words.len() as u64 {
            words.push(format!("frames are lost at {} more places", self.lost_places - words.len() as u64));
        }
        words
    }

    /// The frames that the recorder left out, in words; `None` if there are none.
    pub fn dropped_words(&self) -> Option<String> {
        let dropped: Vec<&Gap> = self.places.iter().filter(|g| g.cause == Cause::Recorder).collect();
        let first = dropped.first()?;
        let places = match dropped.len() {
            1 => first.place(),
            n if n <= MOST_TOLD => {
                let after: Vec<String> =
                    dropped.iter().filter_map(|g| g.after.map(|a| a.to_string())).collect();
                format!("after frames {}", listed(&after))
            }
            n => format!("at {n} places, the first {}", first.place()),
        };
        let n = self.dropped_frames;
        let were = if n == 1 { "1 frame was".to_owned() } else { format!("{n} frames were") };
        Some(format!(
            "{were} dropped by the recorder, or by a program that cut or converted the film, {places}; the times of the \
             others are right"
        ))
    }
}

/// Numbers that follow each other, as first and last of each stretch; all are counted, the first thousand stretches
/// are kept.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stretches {
    /// How many numbers.
    pub frames: u64,
    /// First and last number of each stretch.
    pub stretches: Vec<[u64; 2]>,
}

impl Stretches {
    /// Adds a number greater than all others.
    pub fn push(&mut self, number: u64) {
        self.frames += 1;
        if let Some([_, last]) = self.stretches.last_mut()
            && *last + 1 == number
        {
            *last = number;
        } else if self.stretches.len() < MOST_KEPT {
            self.stretches.push([number, number]);
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.frames == 0
    }

    /// `frame 7`, `frames 7-10, 15 and 20-22`, at most eight stretches.
    pub fn words(&self) -> String {
        let mut parts: Vec<String> = self
            .stretches
            .iter()
            .take(MOST_TOLD)
            .map(|[a, b]| if a == b { a.to_string() } else { format!("{a}-{b}") })
            .collect();
        if self.stretches.len() > MOST_TOLD {
            let told: u64 = self.stretches.iter().take(MOST_TOLD).map(|[a, b]| b - a + 1).sum();
            parts.push(format!("{} more", self.frames - told));
        }
        format!("{} {}", if self.frames == 1 { "frame" } else { "frames" }, listed(&parts))
    }
}

/// `a`, `a and b`, `a, b and c`.
fn listed(parts: &[String]) -> String {
    match parts {
        [] => String::new(),
        [one] => one.clone(),
        [all @ .., last] => format!("{} and {last}", all.join(", ")),
    }
}

/// The reason for which a frame that is there cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reason {
    /// Index of the frame.
    pub frame: u64,
    /// The damage, a clause without a full stop.
    pub words: String,
}

/// Adds a reason; the first thousand are kept.
pub fn keep_reason(reasons: &mut Vec<Reason>, frame: u64, words: String) {
    if reasons.len() < MOST_KEPT {
        reasons.push(Reason { frame, words });
    }
}

/// Damage of a recording: frames that cannot be decoded, and gaps.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Damage {
    /// Frames that are there but cannot be decoded.
    pub undecoded: Stretches,
    /// Frames that are not there.
    pub gaps: Gaps,
    /// Why the first of the undecoded frames are so, where that is more than that they cannot be decoded.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub reasons: Vec<Reason>,
}

impl Damage {
    /// Whether there is nothing to tell.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Whether anything of what was recorded is lost.
    pub fn is_damaged(&self) -> bool {
        !self.undecoded.is_empty() || self.gaps.is_damage()
    }

    fn reason_words(&self) -> Option<String> {
        if let ([only], 1) = (&self.reasons[..], self.undecoded.frames) {
            return Some(only.words.clone());
        }
        let told = self.reasons.iter().take(MOST_TOLD);
        let mut words: Vec<String> = told.map(|r| format!("frame {}: {}", r.frame, r.words)).collect();
        if !words.is_empty() && self.undecoded.frames > words.len() as u64 {
            words.push("...".into());
        }
        Some(words.join("; ")).filter(|w| !w.is_empty())
    }

    /// The frames that are lost, in a sentence; `None` if none are.
    pub fn words(&self) -> Option<String> {
        let undecoded = (!self.undecoded.is_empty()).then(|| match self.reason_words() {
            None => format!("{} cannot be decoded", self.undecoded.words()),
            Some(reasons) => format!("{} cannot be used ({reasons})", self.undecoded.words()),
        });
        let parts: Vec<String> = undecoded.into_iter().chain(self.gaps.lost_words()).collect();
        (!parts.is_empty()).then(|| format!("damaged: {}", parts.join("; ")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_are_told_as_ranges() {
        let mut s = Stretches::default();
        assert!(s.is_empty());
        s.push(7);
        assert_eq!(s.words(), "frame 7");
        [8, 9, 10, 15, 20, 21, 22].into_iter().for_each(|i| s.push(i));
        assert_eq!((s.words().as_str(), s.frames), ("frames 7-10, 15 and 20-22", 8));
        (0..3000).for_each(|i| s.push(100 + 2 * i));
        assert_eq!((s.frames, s.stretches.len()), (3008, MOST_KEPT));
        assert_eq!(s.words(), "frames 7-10, 15, 20-22, 100, 102, 104, 106, 108 and 2995 more");
    }

    #[test]
    fn frames_are_told_with_what_is_wrong_with_them() {
        let mut damage = Damage::default();
        damage.undecoded.push(3);
        keep_reason(&mut damage.reasons, 3, "a.png is 8 x 6 px".into());
        assert_eq!(damage.words().unwrap(), "damaged: frame 3 cannot be used (a.png is 8 x 6 px)");
        damage = Damage::default();
        [3, 7].into_iter().for_each(|i| damage.undecoded.push(i));
        assert_eq!(damage.words().unwrap(), "damaged: frames 3 and 7 cannot be decoded");
        keep_reason(&mut damage.reasons, 3, "a.png is 8 x 6 px".into());
        assert_eq!(
            damage.words().unwrap(),
            "damaged: frames 3 and 7 cannot be used (frame 3: a.png is 8 x 6 px; ...)"
        );
        keep_reason(&mut damage.reasons, 7, "b.png: it is cut".into());
        assert_eq!(
            damage.words().unwrap(),
            "damaged: frames 3 and 7 cannot be used (frame 3: a.png is 8 x 6 px; frame 7: b.png: it is cut)"
        );
        (8..2000).for_each(|i| keep_reason(&mut damage.reasons, i, String::new()));
        assert_eq!(damage.reasons.len(), MOST_KEPT);
        assert_eq!(damage.words().unwrap().matches(": ").count(), 2 + MOST_TOLD);
    }

    #[test]
    fn gaps_are_told_by_their_cause() {
        let mut damage = Damage::default();
        assert_eq!((damage.words(), damage.gaps.dropped_words()), (None, None));
        let gap = |after, frames, cause| Gap { after, frames, cause };
        damage.gaps.push(gap(Some(3), Some(1), Cause::Recorder));
        assert!(!damage.is_damaged() && !damage.is_none());
        assert_eq!(
            damage.gaps.dropped_words().unwrap(),
            "1 frame was dropped by the recorder, or by a program that cut or converted the film, between frames 3 and 4; \
             the times of the others are right"
        );
        damage.gaps.push(gap(Some(7), Some(2), Cause::Damage));
        damage.gaps.push(gap(Some(9), None, Cause::Damage));
        damage.gaps.push(gap(Some(11), Some(4), Cause::Recorder));
        [12, 13].into_iter().for_each(|i| damage.undecoded.push(i));
        assert_eq!(
            damage.words().unwrap(),
            "damaged: frames 12-13 cannot be decoded; 2 frames are lost between frames 7 and 8 (gap in the time \
             stamps); frames may be lost between frames 9 and 10 (how many, nothing tells)"
        );
        assert!(damage.gaps.dropped_words().unwrap().contains(" the film, after frames 3 and 11;"));
        let mut unknown = Damage::default();
        unknown.gaps.push(gap(Some(3), Some(2), Cause::Unknown));
        assert_eq!(
            unknown.words().unwrap(),
            "damaged: 2 frames are missing between frames 3 and 4, either dropped while recording or cut out of the file"
        );
        assert!(unknown.is_damaged() && unknown.gaps.dropped_words().is_none());
        assert_eq!(damage.gaps.within(&(0..8)).lost_places, 0);
        assert_eq!(damage.gaps.within(&(0..9)).lost_frames, 2);
        assert_eq!(damage.gaps.within(&(8..u64::MAX)).places.len(), 2);
    }
}
