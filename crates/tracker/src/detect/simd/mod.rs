//! Does vector arithmetic with the same bits on every processor.

pub(super) mod lanes;
