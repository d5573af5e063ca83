//! Defines the walk through one container's elements, and how elements fit together.
//!
//! Owns: [`Walk`], [`Fit`].

use super::bytes::Bytes;

/// How the elements between two packets fit together, the better first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(in super::super) enum Fit {
    /// As they should.
    Whole,
    /// Each is whole, but something between them is gone.
    Jump,
    /// They do not: what lies between is damaged, and the packet before it may be.
    Broken,
}

/// One container's walk through its elements. Each walk is resumed after a break as well as it can be.
pub(super) trait Walk: Send {
    /// Goes on to the packet of the stream whose first byte is at `to`. How all elements up to there fit together.
    fn reach(&mut self, file: &mut Bytes, to: u64) -> Fit;

    /// Goes on to the end of the file. How all elements up to there fit together.
    fn rest(&mut self, file: &mut Bytes) -> Fit;
}
