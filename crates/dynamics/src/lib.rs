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
//!
//! Energy is kept where nothing dissipates it:
//!
//! ```
//! use dynamics::analysis::simulate::{Settings, simulate};
//! use dynamics::{Field, Fixed, Parameters};
//!
//! let fixed = Fixed { m1_kg: 0.3, m2_kg: 0.12, l1_m: 0.17, g_m_s2: 9.81, lower_inner_m: 0.0, lower_outer_m: 0.15 };
//! let pendulum = Parameters::zero(fixed)
//!     .with(Field::Psi, 3.4e-3)
//!     .with(Field::Lambda, 4.2e-4)
//!     .with(Field::A3, 1.4e-3)
//!     .with(Field::Sigma, 0.45)
//!     .with(Field::Kappa, 0.081);
//! let run = simulate(&pendulum, [2.0, 2.5, 0.0, 0.0], &[0.0, 1.0, 2.0], &Settings::default()).unwrap();
//! let [first, .., last] = &run.samples[..] else { panic!("three times were asked for") };
//! assert!((last.energy / first.energy - 1.0).abs() < 1e-10);
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
