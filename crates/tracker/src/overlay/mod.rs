//! Draws nodes, names, bodies, trails and gaps into a recording, as pictures and as a film.
//!
//! Owns: [`Overlay`], [`still`], [`film`]. Must not: track: it draws what a table says.

mod draw;
mod film;
mod picture;

pub use draw::{Overlay, still};
pub use film::{FilmSettings, Filmed, film};
pub use picture::{rgb, save, size};
