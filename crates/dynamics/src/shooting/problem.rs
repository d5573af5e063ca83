//! Defines the fit's problem: recordings cut into segments, and what is free.

use crate::parameters::Field;

/// Numbers of a camera that angles depend on.
pub const CAMERA_NUMBERS: usize = 5;

/// The part of a recording's angles that a camera adds which is not known exactly.
#[derive(Clone, Copy, Debug)]
pub struct CameraPart<'a> {
    /// Changes of each sample's angles with the camera's numbers, each in units of its prior standard deviation, rad:
    /// measured = true + slopes . numbers. Of the length of the recording.
    pub slopes_rad: &'a [[[f64; CAMERA_NUMBERS]; 2]],
    /// Which camera it is, from 0: recordings may share one.
    pub camera: usize,
}

/// One recording's angles. All slices have the length of `t_s`.
#[derive(Clone, Copy, Debug)]
pub struct Recording<'a> {
    /// Times, ascending, s.
    pub t_s: &'a [f64],
    /// Angles, rad; NaN where not seen.
    pub phi_rad: [&'a [f64]; 2],
    /// Standard uncertainties, rad; a sample without a positive one is left out.
    pub sigma_rad: [&'a [f64]; 2],
    /// How many links were measured. With one, the lower link is not there (its constants in the model must not
    /// couple to the upper one's) and rests at zero.
    pub links: usize,
    /// The camera's part of the angles; `None` where there is none, or none is free.
    pub camera: Option<CameraPart<'a>>,
}

impl Recording<'_> {
    /// Whether link `j` is measured in sample `i`.
    #[must_use]
    pub fn seen(&self, i: usize, j: usize) -> bool {
        self.phi_rad[j][i].is_finite() && self.sigma_rad[j][i] > 0.0
    }

    /// The derivatives of the angle of link `j` in sample `i` by the camera's numbers.
    #[must_use]
    pub fn camera_slopes(&self, i: usize, j: usize) -> [f64; CAMERA_NUMBERS] {
        self.camera.map_or([0.0; CAMERA_NUMBERS], |c| c.slopes_rad[i][j])
    }
}

/// A piece of a recording with its own free state at its start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Which recording.
    pub recording: usize,
    /// Its samples, `first..last`.
    pub first: usize,
    /// One past its last sample.
    pub last: usize,
    /// Start, s.
    pub start_s: f64,
    /// End, the start of the next, s.
    pub end_s: f64,
    /// Whether the next segment in the list continues it.
    pub chained: bool,
}

/// Least number of samples of each link in a segment: two for the state, and enough to test it.
pub const MIN_SAMPLES: usize = 6;

/// Cuts `start_s..stop_s` of a recording into equal segments of about `length_s`. Segments with fewer than
/// [`MIN_SAMPLES`] samples of either link are left out, and the chain is broken there.
#[must_use]
pub fn cut(
    recording: &Recording<'_>,
    index: usize,
    [start_s, stop_s]: [f64; 2],
    length_s: f64,
    chained: bool,
) -> Vec<Segment> {
    let count = ((stop_s - start_s) / length_s).round().max(1.0);
    let length = (stop_s - start_s) / count;
    let mut out: Vec<Segment> = Vec::new();
    for k in 0..count as usize {
        let (start_s, end_s) = (start_s + k as f64 * length, start_s + (k + 1) as f64 * length);
        // A sample on an edge belongs to the later segment.
        let first = recording.t_s.partition_point(|&t| t < start_s);
        let last = recording.t_s.partition_point(|&t| t < end_s);
        let enough = |j: usize| (first..last).filter(|&i| recording.seen(i, j)).count() >= MIN_SAMPLES;
        if (0..recording.links).all(enough) {
            out.push(Segment { recording: index, first, last, start_s, end_s, chained });
        } else if let Some(before) = out.last_mut() {
            before.chained = false;
        }
    }
    if let Some(last) = out.last_mut() {
        last.chained = false;
    }
    out
}

/// Tie between the end of a segment and the start of the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Slack {
    /// Standard deviations of the jump in `[phi1, phi2, w1, w2]`, relative to how well a segment's own samples
    /// determine its state.
    Relative(f64),
    /// Given standard deviations of the jump, rad and rad/s.
    Fixed([f64; 4]),
    /// As large as makes the joints' chi-square one, but not below this relative floor.
    Learned(f64),
}

/// Settings of a fit: which parameters are free, and when it stops.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Free parameters of the motion.
    pub free: Vec<Field>,
    /// Fields among `free` that cannot be negative.
    pub bounded: Vec<Field>,
    /// Whether the recordings' clock scale is free (one for all).
    pub clock: bool,
    /// Whether each recording's two angle zeros are free.
    pub zeros: bool,
    /// Continuity.
    pub slack: Slack,
    /// Residuals beyond this many standard deviations count linearly.
    pub huber: f64,
    /// Most Gauss-Newton steps.
    pub max_iterations: usize,
}

/// Progress of a fit, after each step.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Steps taken.
    pub iteration: usize,
    /// Most there will be.
    pub max_iterations: usize,
    /// Mean squared standardised residual.
    pub chi2: f64,
}

/// Ending of a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// The next step would change nothing that matters.
    Converged,
    /// Out of iterations.
    IterationLimit,
    /// No step lowers the cost any more, though the gradient is not zero.
    Stalled,
    /// Stopped by the caller.
    Stopped,
}

/// Reason why a problem cannot be fitted.
#[derive(Debug, thiserror::Error)]
pub enum ShootingError {
    /// No segment has enough samples.
    #[error("no segment has {MIN_SAMPLES} samples of both links")]
    Empty,
    /// Too many free parameters for the dual number.
    #[error("{0} free parameters; at most {1} can be free at once")]
    TooMany(usize, usize),
    /// The states of some segment are not determined.
    #[error("the motion is not determined by these angles (the normal matrix is not positive definite)")]
    Singular,
    /// The integration left the finite numbers.
    #[error(
        "the motion that starts the fit does not stay finite; the model's constants and these angles do not belong together"
    )]
    NotFinite,
}
