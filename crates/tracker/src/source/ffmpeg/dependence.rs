//! Pictures that are predicted from damaged or lost ones, and are as little to be believed as those.
//!
//! Owns: [`Dependence`]. Must not: decode, or find damage. Pure bookkeeping, in decoding order: a picture may be shown before
//! the one that it is predicted from.

use std::collections::{BTreeMap, VecDeque};

use super::reach::Reach;

/// Key frames, and packets without any, that are remembered: far more than a decoder has under way.
const REMEMBERED: usize = 4096;

/// The packets of a film in decoding order.
#[derive(Debug)]
pub(super) struct Dependence {
    /// Each picture stands for itself.
    is_intra_only: bool,
    /// Key frames: number in decoding order and display time, ticks.
    keys: VecDeque<(u64, i64)>,
    /// Reach of the packets remembered, the last one's number being `coded` - 1.
    reaches: VecDeque<Reach>,
    coded: u64,
    /// Damage by its place in decoding order: twice the packet's number, and one less for what is lost before it.
    damage: BTreeMap<u64, Reach>,
}

impl Dependence {
    pub(super) fn new(is_intra_only: bool) -> Self {
        Self {
            is_intra_only,
            keys: VecDeque::new(),
            reaches: VecDeque::new(),
            coded: 0,
            damage: BTreeMap::new(),
        }
    }

    /// The next packet in decoding order, which is shown at `time`. Returns its number, from 1.
    pub(super) fn coded(&mut self, time: i64, is_key_frame: bool, reach: Reach) -> u64 {
        self.coded += 1;
        self.reaches.push_back(reach);
        if self.reaches.len() > REMEMBERED {
            self.reaches.pop_front();
        }
        if is_key_frame {
            self.keys.push_back((self.coded, time));
        }
        if self.keys.len() > REMEMBERED
            && let Some((number, _)) = self.keys.pop_front()
        {
            self.damage = self.damage.split_off(&(2 * number));
        }
        self.coded
    }

    /// Packets before this one are lost.
    pub(super) fn lost_before(&mut self, number: u64) {
        self.add(2 * number - 1, Reach::All);
    }

    /// The picture of this packet is damaged or will not come.
    pub(super) fn damaged(&mut self, number: u64) {
        let ago = self.coded.saturating_sub(number) as usize;
        let known = self.reaches.len().checked_sub(ago + 1).and_then(|i| self.reaches.get(i));
        self.add(2 * number, known.copied().unwrap_or(Reach::All));
    }

    fn add(&mut self, place: u64, reach: Reach) {
        self.damage.insert(place, reach);
        // What reaches no further than its own picture is of no use once that is out.
        while self.damage.len() > REMEMBERED
            && let Some(old) = self.damage.iter().find(|(_, r)| **r == Reach::Itself).map(|(at, _)| *at)
        {
            self.damage.remove(&old);
        }
    }

    /// Whether the picture of packet `number`, shown at `time`, is itself whole and predicted from whole ones only.
    pub(super) fn is_whole(&self, number: u64, time: i64) -> bool {
        let place = 2 * number;
        if self.is_intra_only {
            return !self.damage.contains_key(&place);
        }
        // Decoding can start with a key frame; what is shown before it may be predicted from what comes before it.
        let key = self.keys.iter().rev().find(|(n, at)| *n <= number && *at <= time);
        let from = key.map_or(0, |(n, _)| 2 * n);
        let is_hit = |(at, reach): (&u64, &Reach)| {
            *at == place
                || match reach {
                    Reach::Itself => false,
                    Reach::All => true,
                    Reach::Leading => self
                        .keys
                        .iter()
                        .rev()
                        .find(|(n, _)| 2 * n <= *at)
                        .is_some_and(|(_, shown)| time < *shown),
                }
        };
        !self.damage.range(from..=place).any(is_hit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Decoding order I P B B P I B B, as times shown; the B's are predicted from by none.
    fn film() -> Dependence {
        let mut film = Dependence::new(false);
        for (time, is_key, reach) in [
            (0, true, Reach::All),
            (3, false, Reach::All),
            (1, false, Reach::Itself),
            (2, false, Reach::Itself),
            (4, false, Reach::All),
            (7, true, Reach::All),
            (5, false, Reach::Itself),
            (6, false, Reach::Itself),
        ] {
            film.coded(time, is_key, reach);
        }
        film
    }

    fn whole(film: &Dependence) -> Vec<i64> {
        let order = [(1, 0), (3, 1), (4, 2), (2, 3), (5, 4), (7, 5), (8, 6), (6, 7)];
        order.iter().filter(|(number, time)| film.is_whole(*number, *time)).map(|(_, time)| *time).collect()
    }

    #[test]
    fn damage_reaches_what_is_predicted_from_it_and_no_further() {
        assert_eq!(whole(&film()), [0, 1, 2, 3, 4, 5, 6, 7]);
        let damaged = |number| {
            let mut film = film();
            film.damaged(number);
            whole(&film)
        };
        // One that nothing is predicted from.
        assert_eq!(damaged(3), [0, 2, 3, 4, 5, 6, 7]);
        // The P at 3: those shown before it that are predicted from it, and those that lead into the next key frame.
        assert_eq!(damaged(2), [0, 7]);
        assert_eq!(damaged(5), [0, 1, 2, 3, 7]);
        assert_eq!(damaged(6), [0, 1, 2, 3, 4]);
    }

    #[test]
    fn what_is_lost_before_a_key_frame_reaches_what_is_shown_before_it() {
        let mut film = film();
        film.lost_before(6);
        assert_eq!(whole(&film), [0, 1, 2, 3, 4, 7]);
    }

    #[test]
    fn damage_to_a_leading_picture_ends_at_its_key_frame() {
        let mut film = Dependence::new(false);
        // A film that begins with a key frame in the middle of a stream: I, two that lead into it, P.
        for (time, is_key, reach) in [
            (2, true, Reach::All),
            (0, false, Reach::Leading),
            (1, false, Reach::Leading),
            (3, false, Reach::All),
        ] {
            film.coded(time, is_key, reach);
        }
        film.damaged(2);
        let order = [(2, 0), (3, 1), (1, 2), (4, 3)];
        let whole: Vec<i64> = order.iter().filter(|(n, t)| film.is_whole(*n, *t)).map(|(_, t)| *t).collect();
        assert_eq!(whole, [2, 3]);
    }

    #[test]
    fn pictures_that_stand_for_themselves_are_damaged_alone() {
        let mut film = Dependence::new(true);
        (0..4).for_each(|time| {
            film.coded(time, true, Reach::All);
        });
        film.damaged(2);
        assert!([1, 3, 4].iter().all(|n| film.is_whole(*n, *n as i64 - 1)) && !film.is_whole(2, 1));
    }
}
