//! Follows what moves, whatever it looks like: for recordings in which no markers stand out from the ground.
//!
//! Owns: [`survey`], [`follow_clicks`], [`finish`], [`Marker`], [`Film`], [`Picture`]. Must not: decode, know of bodies, or name a
//! marker that only may be the wanted one ([`Survey::confidence`] tells).
//!
//! Every picture is looked at by one filter (`response`: centre minus surround) in octaves, colour directions and both signs;
//! `ground` takes away what stands still, `spot` finds the maxima, `search` does both, `tracklet` links them, `track` joins over
//! gaps, `choose` lets every way of looking compete by what it explains (`beside` compares tracks) and `click` by how a track holds through a place that
//! was pointed at; `patch` follows what is no spot by its picture; `centre` refines the places, `rest` follows what comes to rest, and `marker` does both.

mod backdrop;
mod beside;
mod centre;
mod choose;
mod click;
mod ground;
mod limits;
mod marker;
mod model;
mod outline;
mod own_colour;
mod patch;
mod picture;
mod response;
mod rest;
mod search;
mod spot;
#[cfg(test)]
mod tests;
mod track;
mod tracklet;
mod window;
mod work;

pub use choose::{Survey, strongest, survey};
pub use click::{Click, Missed, Unheld, follow_clicks};
pub use limits::Limits;
pub use marker::{Marker, finish};
pub use model::Model;
pub use patch::Lost;
pub use picture::{Film, Picture};
pub use response::Direction;
pub use search::{Against, Search};
pub use spot::Spot;
pub use track::Track;
pub use tracklet::{End, Tracklet};
pub use work::WorkFilm;
