//! Matches pictures to the packets that they came from, and finds packets that became none.
//!
//! Owns: [`Order`]. A decoder says nothing about a packet that gives no picture; it is found out here, because
//! pictures come in display order: once a later one is out, an earlier one is lost. Pure bookkeeping.

use std::collections::BTreeMap;

/// A packet given to the decoder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Sent {
    /// Display time in ticks, or, in a stream without display times, its number in decoding order.
    pub key: i64,
    /// Byte offset in the file.
    pub byte: Option<u64>,
    /// Its number in decoding order, from 1.
    pub number: u64,
}

/// The conclusions from a picture's arrival.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Arrival {
    /// Packets whose pictures will not come any more, in display order.
    pub lost: Vec<Sent>,
    /// The picture's own packet; `None` if no packet of its key is waiting.
    pub own: Option<Sent>,
    /// A picture of a later time is out: decoders of damaged film hand some out late, when their frames count as lost already.
    pub is_late: bool,
    /// Times of those lost, or of the late picture, of which it was not known before that they would be lost.
    pub untold: Vec<i64>,
}

/// Packets whose pictures have not come yet.
#[derive(Debug, Default)]
pub(super) struct Order {
    waiting: BTreeMap<(i64, u64), Sent>,
    /// Greatest key of a picture that came out.
    latest: Option<i64>,
    count: u64,
    /// Keys by which a picture may come later than a following one; 0 where keys are display times.
    delay: i64,
}

impl Order {
    /// `delay` is 0 where keys are display times or frames are not reordered, else the most by which decoding
    /// order and display order differ.
    pub(super) fn new(delay: i64) -> Self {
        Self { delay, ..Self::default() }
    }

    /// A packet was given to the decoder.
    pub(super) fn sent(&mut self, packet: Sent) {
        self.waiting.insert((packet.key, self.count), packet);
        self.count += 1;
    }

    /// A picture of this key came out.
    pub(super) fn arrived(&mut self, key: i64) -> Arrival {
        let mut arrival = Arrival::default();
        let own = self.waiting.range((key, 0)..=(key, u64::MAX)).next().map(|(k, _)| *k);
        arrival.own = own.and_then(|k| self.waiting.remove(&k));
        let before = self.latest.filter(|_| self.delay == 0);
        arrival.is_late = before.is_some_and(|latest| key < latest);
        if arrival.is_late {
            arrival.untold.extend(arrival.own.map(|own| own.key));
            return arrival;
        }
        self.latest = Some(key);
        let limit = (key.saturating_sub(self.delay), 0);
        while let Some(entry) = self.waiting.first_entry() {
            if *entry.key() >= limit {
                break;
            }
            let lost = entry.remove();
            match before {
                Some(latest) if lost.key < latest => arrival.untold.push(lost.key),
                _ => arrival.lost.push(lost),
            }
        }
        arrival
    }

    /// No more pictures will come: all that still wait are lost.
    pub(super) fn rest(&mut self) -> Vec<Sent> {
        std::mem::take(&mut self.waiting).into_values().collect()
    }

    /// The number of packets that wait.
    pub(super) fn waiting(&self) -> usize {
        self.waiting.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packet(key: i64) -> Sent {
        Sent { key, byte: None, number: 0 }
    }

    #[test]
    fn a_picture_that_does_not_come_is_lost_when_a_later_one_is_out() {
        let mut order = Order::new(0);
        // Decoding order I P B B P: display times 0 3 1 2 4.
        for key in [0, 3, 1, 2, 4] {
            order.sent(packet(key));
        }
        assert_eq!(order.arrived(0), Arrival { own: Some(packet(0)), ..Arrival::default() });
        assert_eq!(
            order.arrived(2),
            Arrival { lost: vec![packet(1)], own: Some(packet(2)), ..Arrival::default() }
        );
        assert_eq!(order.arrived(3), Arrival { own: Some(packet(3)), ..Arrival::default() });
        assert_eq!(order.rest(), vec![packet(4)]);
        assert_eq!(order.waiting(), 0);
    }

    #[test]
    fn a_picture_that_comes_behind_a_later_one_has_no_place_any_more() {
        let mut order = Order::new(0);
        [0, 1, 2].into_iter().for_each(|key| order.sent(packet(key)));
        assert_eq!(order.arrived(2).lost, vec![packet(0), packet(1)]);
        assert_eq!(order.arrived(1), Arrival { is_late: true, ..Arrival::default() });
        // Packets of earlier times that are read later: one gives a late picture, one none.
        [1, 0, 3].into_iter().for_each(|key| order.sent(packet(key)));
        let late = Arrival { own: Some(packet(1)), is_late: true, untold: vec![1], ..Arrival::default() };
        assert_eq!(order.arrived(1), late);
        let next = Arrival { own: Some(packet(3)), untold: vec![0], ..Arrival::default() };
        assert_eq!(order.arrived(3), next);
    }

    #[test]
    fn without_display_times_a_picture_may_come_late_by_the_delay() {
        let mut order = Order::new(2);
        for key in 0..6 {
            order.sent(packet(key));
        }
        assert!(order.arrived(0).lost.is_empty());
        // 3 before 1 and 2: both may still come.
        assert!(order.arrived(3).lost.is_empty());
        assert!(order.arrived(2).lost.is_empty());
        // 4 is out and 1 is three behind: lost.
        assert_eq!(order.arrived(4).lost, vec![packet(1)]);
    }

    #[test]
    fn equal_display_times_are_two_pictures() {
        let mut order = Order::new(0);
        order.sent(packet(5));
        order.sent(packet(5));
        assert!(order.arrived(5).own.is_some());
        assert!(order.arrived(5).own.is_some());
        assert!(order.arrived(5).own.is_none());
    }
}
