//! Measures how good a node table is against the truth of a film.
//!
//! Owns: [`Tracked`], [`Score`], [`score`]. Must not: know how the table was made.
//!
//! Names need not agree: a tracked node stands for the true node at whose place it is most often, each true node being
//! given away once. What is counted, with a place *agreeing* with a marker when it is within the limit (2 px) of it:
//!
//! - **coverage**: of all rows in which a true marker is at least half visible, the part in which its node agrees;
//! - **wrong**: rows whose place agrees with another marker and not with the node's own: a wrong identity;
//! - **switches**: how often the marker that a node agrees with changes;
//! - **false positives**: rows whose place agrees with no marker of which anything can be seen;
//! - **reacquisition**: each time a marker has been less than half visible (or is so at the start) and is fully visible
//!   again, the number of frames until its node agrees;
//! - **errors** of fully visible markers per axis, and of the angle between each body's tracked and true places.

mod compare;
mod result;
#[cfg(test)]
mod tests;

pub use compare::{LIMIT_PX, score};
pub use result::{AngleError, FULL, HALF, Match, Reacquisition, Score, Tracked};
