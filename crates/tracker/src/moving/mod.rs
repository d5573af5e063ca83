//! Follows what moves, whatever it looks like: for recordings in which no markers stand out from the ground.
//!
//! Owns: [`follow`], [`Followed`], [`Film`], [`Picture`]. Must not: decode, know of bodies, or name a marker that only may be the
//! wanted one ([`Followed::confidence`] tells).
//!
//! Every picture is looked at by one filter (`response`: centre minus surround) in octaves, colour directions and both signs;
//! `ground` takes away what stands still, `spot` finds the maxima, `tracklet` links them, `track` joins over gaps, `choose` lets
//! every way of looking compete by what it explains, `centre` refines the places and `rest` follows what comes to rest.

mod backdrop;
mod centre;
mod choose;
mod ground;
mod model;
mod own_colour;
mod picture;
mod response;
mod rest;
mod spot;
#[cfg(test)]
mod tests;
mod track;
mod tracklet;
mod window;
mod work;

pub use choose::{Followed, follow};
pub use model::Model;
pub use picture::{Film, Picture};
pub use response::Direction;
pub use spot::Spot;
pub use track::Track;
pub use tracklet::{End, Tracklet};
pub use work::WorkFilm;
