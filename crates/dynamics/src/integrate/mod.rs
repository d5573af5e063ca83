//! Integrates the equations of motion: one step of DOP853, and steps between located changes of contact.

pub mod dop853;
pub mod flight;
mod tableau;
