//! Draws nodes, names, bodies, trails and gaps into a recording, as pictures and as a film.
//!
//! Owns: [`Overlay`], [`still`], [`candidates`], [`film`]. Must not: track: it draws what a table says.

mod draw;
#[cfg(feature = "ffmpeg")]
mod film;
mod picture;
mod stills;

pub use draw::Overlay;
#[cfg(feature = "ffmpeg")]
pub use film::{FilmSettings, Filmed, film};
pub use picture::Picture;
pub use stills::{candidates, still};
