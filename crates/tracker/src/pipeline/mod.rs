//! Calls source, detect, track and table in that order, for every front end.

mod ahead;
mod candidates;
mod clutter;
mod detecting;
mod following;
mod moving;
mod moving_bodies;
mod moving_doubts;
mod moving_nodes;
mod moving_rows;
mod observer;
mod one_place;
mod open_names;
mod opening;
mod pointed;
mod reading;
mod repeats;
mod request;
mod run;
mod settings;
mod sizes;
mod state;
mod summary;
mod times;
mod unclear;
mod unite;

pub use candidates::{Candidate, Candidates};
pub use observer::{Observer, Silent, Stage};
pub use opening::open;
pub(crate) use opening::{learn, sample};
pub use run::run;
pub use settings::{Existing, RunSettings};
pub use state::partial_path;
pub use summary::RunSummary;
pub use times::{survey, times};
