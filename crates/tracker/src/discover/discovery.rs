//! Holds a rig that was found, and what a user should know of it.
//!
//! Owns: [`Discovery`].

use crate::message::Message;
use crate::rig::Rig;

/// A rig and what a user should know of it.
#[derive(Debug, Clone)]
pub struct Discovery {
    /// The rig.
    pub rig: Rig,
    /// Places that stand still and belong to no body: a ruler, a screw. px.
    pub standing: Vec<[f64; 2]>,
    /// Warnings to the user, a sentence each.
    pub warnings: Vec<Message>,
}
