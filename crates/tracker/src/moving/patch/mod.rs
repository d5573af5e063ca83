//! Follows what is no blob by its picture: a screw, a printed target, speckle, a toy car.
//!
//! Owns: [`follow_picture`], [`Lost`]. Must not: choose what is followed, or go on where it is not certain.
//!
//! `surface` makes a smooth surface of a part of a picture, `template` keeps what the thing looks like with its gradient,
//! `search` finds where it may be by its likeness, `align` finds its place there to a hundredth of a pixel, `still` tells it from what
//! stands still, and `follow` goes from picture to picture.

mod align;
mod follow;
mod search;
mod still;
mod surface;
mod template;
#[cfg(test)]
mod tests;

pub use follow::{Lost, follow_picture};
pub use still::Still;
