//! Fits trajectories: multiple shooting on the equations of motion.
//!
//! A recording is cut into short segments, each with its own free state at its start. The residuals are measured
//! minus integrated angles, and the jumps from one segment's end to the next one's start. Sensitivities are exact
//! (dual numbers through the integrator); the normal matrix has the shape of an arrow and is solved in time linear
//! in the length; segments are integrated in parallel and summed in order, so that the result does not depend on
//! the number of threads.
//!
//! The **slack**, the standard deviation allowed to the jumps, is the knob for model error. `Slack::Learned` sets
//! it for each of the four state components to the value that makes the jumps' chi-square one, counting degrees of
//! freedom properly: `q^2 = sum d^2 / sum(1 - var(d)/q^2)` (MacKay's fixed point of the marginal likelihood).

mod arrow;
mod error;
mod fit;
mod linearise;
mod path;
mod problem;
mod slack;
mod start;
mod system;
mod trace;

pub use fit::{Fit, fit};
pub use linearise::Point;
pub use path::{End, Span, follow};
pub use problem::{
    CAMERA_NUMBERS, CameraPart, MIN_SAMPLES, Progress, Recording, Segment, Settings, ShootingError, Slack,
    Status, cut,
};
pub use start::local_state;
pub use trace::{Trace, trace, unit_powers};
