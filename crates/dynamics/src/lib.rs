//! The double pendulum: equations of motion, and everything that integrates them.
//!
//! ```text
//! scalar ──▶ parameters ──▶ terms ──▶ balance ──▶ motion ──▶ friction ──▶ integrate ──▶ analysis
//!                                                                      └──▶ shooting
//! ```
//!
//! Conventions: SI units and radians. `phi1`, `phi2` are absolute link angles, counter-clockwise positive, zero
//! hanging down; `w` their rates and `a` their accelerations. Both equations are written once, generic over a
//! [`Real`] scalar: with `f64` they give values, with a [`Dual`] number also the exact derivatives in as many
//! directions as wanted.
//!
//! The equations (paper Eqs. 28-29 with the reaction of joint 2 on both links, erratum 13):
//!
//! ```text
//! 2 psi a1 + (zeta + A3 cos d) a2 + A3 sin d w2^2 + sigma sin(phi1) = Q1        d = phi1 - phi2
//! 2 lambda a2 + (zeta + A3 cos d) a1 - A3 sin d w1^2 + kappa sin(phi2) = Q2
//! ```

pub mod analysis;
mod balance;
#[cfg(test)]
mod fixture;
pub mod friction;
pub mod integrate;
pub mod motion;
pub mod parameters;
pub mod scalar;
pub mod shooting;
pub mod smoother;
pub mod state;
pub mod terms;

pub use motion::{accelerations, energies, mass_matrix, normal_forces};
pub use parameters::{Field, Fixed, Parameters, RATIOS, Ratio};
pub use scalar::{Dual, Real};
pub use state::{Contact, Motion, State};
pub use terms::{Kind, Law, Place, TERMS, Term};
