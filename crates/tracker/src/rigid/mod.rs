//! Fits, predicts and finds planar rigid bodies: their poses, joints and motion.
//!
//! Owns: the modules below. Must not: follow a body through a recording (`track` does), or know of pixels' values.

pub mod body;
pub mod forecast;
pub mod hypothesis;
pub mod index;
pub mod joint;
pub mod pose;
pub mod search;
pub mod work;
