//! Walks MPEG transport streams: packets of one length, each with a mark, the number of its stream and a counter
//! (ISO/IEC 13818-1, 2.4.3.2).

use super::bytes::Bytes;
use super::{Fit, Walk};

const MARK: u8 = 0x47;
/// A packet's length, and how far into it the mark is: plain, with a time before it, with parity behind it.
const FORMS: [(u64, u64); 3] = [(188, 0), (192, 4), (204, 0)];
/// Marks in a row that are no chance.
const MARKS: u64 = 4;

/// State of the walk through a transport stream.
#[derive(Debug)]
pub(super) struct Transport {
    at: u64,
    length: u64,
    mark: u64,
    stream: u16,
    counter: Option<u8>,
    /// Where the picture begins that the walk stands in or before.
    picture: u64,
    /// A picture begins between two packets of the reader: it passed over it.
    passed: bool,
}

impl Transport {
    /// `stream` is the number of the stream whose counter is heeded; `None` if the file begins with no packets.
    pub(super) fn new(file: &mut Bytes, stream: i32) -> Option<Self> {
        let stream = u16::try_from(stream).ok()?;
        let (length, mark) = FORMS.into_iter().find(|&form| aligned(file, 0, form))?;
        Some(Self { at: 0, length, mark, stream, counter: None, picture: 0, passed: false })
    }

    /// Goes over one packet. Whether it is one, and follows the one before it.
    fn step(&mut self, file: &mut Bytes) -> bool {
        let Some(head) = file.array::<6>(self.at + self.mark) else {
            self.at = file.length();
            return false;
        };
        if head[0] != MARK || self.at + self.length > file.length() {
            self.find(file);
            return false;
        }
        let at = self.at;
        self.at += self.length;
        if u16::from_be_bytes([head[1] & 0x1F, head[2]]) != self.stream {
            return true;
        }
        let damaged = head[1] & 0x80 != 0;
        let has_fields = head[3] & 0x20 != 0;
        let has_payload = head[3] & 0x10 != 0;
        let jumps = has_fields && head[4] > 0 && head[5] & 0x80 != 0;
        let counter = head[3] & 0x0F;
        // The counter goes on with each payload; a packet may be sent twice.
        let follows = match self.counter.filter(|_| !jumps) {
            Some(last) if has_payload => counter == (last + 1) & 0x0F || counter == last,
            Some(last) => counter == last,
            None => true,
        };
        self.counter = Some(counter);
        let begins = head[1] & 0x40 != 0 && has_payload;
        let fields = if has_fields { 1 + u64::from(head[4]) } else { 0 };
        follows && !damaged && (!begins || self.picture_begins(file, at, at + self.mark + 4 + fields))
    }

    /// A picture's own header lies at `place` in the packet at `at`. Whether it is one.
    fn picture_begins(&mut self, file: &mut Bytes, at: u64, place: u64) -> bool {
        let Some(header) = file.array::<8>(place) else { return false };
        // A part without a time of its own goes on with the picture before it.
        if header[7] & 0x80 != 0 && at > self.picture {
            self.passed = true;
        }
        header.starts_with(&[0, 0, 1])
    }

    /// Goes on to the next place where packets are.
    fn find(&mut self, file: &mut Bytes) {
        self.counter = None;
        let form = (self.length, self.mark);
        for at in self.at + 1..file.length() {
            if aligned(file, at, form) {
                self.at = at;
                return;
            }
        }
        self.at = file.length();
    }
}

/// Whether packets of a form begin at `at`, as far as the file goes.
fn aligned(file: &mut Bytes, at: u64, (length, mark): (u64, u64)) -> bool {
    (0..MARKS).all(|k| match file.array(at + k * length + mark) {
        Some([byte]) => byte == MARK,
        None => k > 0,
    })
}

impl Walk for Transport {
    fn reach(&mut self, file: &mut Bytes, to: u64) -> Fit {
        let mut whole = true;
        self.passed = false;
        while self.at < to.min(file.length()) {
            whole &= self.step(file);
        }
        self.picture = to;
        match (whole, self.passed) {
            (false, _) => Fit::Broken,
            (true, true) => Fit::Jump,
            (true, false) => Fit::Whole,
        }
    }

    fn rest(&mut self, file: &mut Bytes) -> Fit {
        self.reach(file, u64::MAX)
    }
}
