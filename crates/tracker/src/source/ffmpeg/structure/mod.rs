//! Follows a container's own structure beside the reader: a demuxer goes on after damage in silence, and what it
//! passed over is told by elements that do not fit together.
//!
//! Owns: [`Structure`]. Must not: decode, or decide what is lost.

mod asf;
mod boxes;
mod bytes;
mod container;
mod flv;
mod gif;
mod matroska;
mod mxf;
mod nut;
mod ogg;
mod pages;
mod program;
mod transport;
mod walk;

pub(super) use container::Structure;
pub(super) use walk::Fit;
use walk::Walk;
