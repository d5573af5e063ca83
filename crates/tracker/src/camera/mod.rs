//! Models a camera that films a plane it need not face squarely, through a lens that need not keep lines straight.
//!
//! Owns: [`Camera`], [`Plane`]. Five numbers say what a picture of known size does to distances in the plane; what scale, turn and
//! shift the plane has is nobody's business, since bodies stay rigid under them. Must not: estimate them (`calibrate` does).

mod model;
mod plane;

pub use model::{BY_EYE, Camera, NUMBERS, Slopes};
pub use plane::Plane;
