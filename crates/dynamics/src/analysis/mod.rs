//! Analyses motions: a simulation sampled at given times, many of them, Poincaré sections, Lyapunov exponents.

pub mod ensemble;
pub mod lyapunov;
pub mod section;
pub mod simulate;
