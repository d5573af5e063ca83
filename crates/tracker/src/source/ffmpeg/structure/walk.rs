//! Defines the walk through one container's elements, and how elements fit together.
//!
//! Owns: [`Walk`], [`Fit`].

use super::bytes::Bytes;

/// Fit of the elements between two packets, the better first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(in super::super) enum Fit {
    /// As they should.
    Whole,
    /// Each is whole, but something between them is gone.
    Jump,
    /// The elements do not fit: bytes between them are damaged, and the packet before may be.
    Broken,
}

/// One container's walk through its elements. Each walk is resumed after a break as well as it can be.
pub(super) trait Walk: Send {
    /// Goes on to the packet of the stream whose first byte is at `to`. How all elements up to there fit together.
    fn reach(&mut self, file: &mut Bytes, to: u64) -> Fit;

    /// Goes on to the end of the file. How all elements up to there fit together.
    fn rest(&mut self, file: &mut Bytes) -> Fit;

    /// After [`Walk::rest`]: whether the file ends inside something that holds pictures, so that some lack whatever length
    /// the file declares.
    fn ends_in_pictures(&self) -> bool {
        false
    }
}

/// A container of elements one after the other, each of which says where it ends.
pub(super) trait Elements {
    /// The byte at which the walk stands.
    fn at(&mut self) -> &mut u64;

    /// Goes over one element. `None` where there is none that is whole.
    fn step(&mut self, file: &mut Bytes) -> Option<()>;
}

impl<E: Elements + Send> Walk for E {
    fn reach(&mut self, file: &mut Bytes, to: u64) -> Fit {
        let mut whole = true;
        while whole && *self.at() < to {
            whole = self.step(file).is_some();
        }
        whole &= *self.at() == to;
        *self.at() = to;
        if whole { Fit::Whole } else { Fit::Broken }
    }

    fn rest(&mut self, file: &mut Bytes) -> Fit {
        while *self.at() < file.length() {
            if self.step(file).is_none() {
                return Fit::Broken;
            }
        }
        Fit::Whole
    }
}
