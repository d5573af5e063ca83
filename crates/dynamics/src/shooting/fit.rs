//! Iterates the trajectory fit: Gauss-Newton with Levenberg's damping on the arrow-shaped problem, and the slack.

use nalgebra::{DMatrix, DVector, Matrix4, Vector4};

use super::arrow::Spread;
use super::error::{angle_information, jump_information, scores};
use super::linearise::{Local, Point};
use super::problem::{CAMERA_NUMBERS, Progress, Recording, Segment, Settings, ShootingError, Slack, Status};
use super::slack::{SLACK_TOLERANCE, apart, jump_variance_ratio, learned, own_sigma};
use super::system::{MAX_DIRECTIONS, Problem, pseudo_inverse};
use crate::parameters::Field;

/// A finished fit.
pub struct Fit {
    /// The solution.
    pub point: Point,
    /// Names of the shared parameters: free fields, then `clock`, then two zeros for each recording, then each camera's numbers.
    pub free: Vec<Field>,
    /// Marginal second derivatives of half chi-square with respect to the shared parameters, (G, G).
    pub information: DMatrix<f64>,
    /// Part of `information` that the angles give, the states following the shared parameters: the part whose errors are the angles' noise.
    pub angle_information: DMatrix<f64>,
    /// Part of `information` that the jumps give, each component times `jumps_shown`: the part whose errors are the model's.
    pub jump_information: DMatrix<f64>,
    /// Variance that the jumps show over the slack's square, per component: 1 where the slack was learned. Where it
    /// stands at its floor or was given, the data may ask for less, down to none.
    pub jumps_shown: [f64; 4],
    /// Gradient there; not zero only for parameters held at a bound.
    pub gradient: DVector<f64>,
    /// Each segment's part of the shared parameters' gradient with the states eliminated, (K, G): what a sandwich estimate of
    /// the covariance is made of.
    pub scores: DMatrix<f64>,
    /// Standard deviations allowed to the jumps of `[phi1, phi2, w1, w2]`.
    pub slack: [f64; 4],
    /// Median standard deviations of a segment's state from its own samples.
    pub own_sigma: [f64; 4],
    /// Mean squared jump over slack squared, per component, with the degrees of freedom counted.
    pub jump_chi2: [f64; 4],
    /// Logarithm of the marginal likelihood, states and common unknowns integrated out, but for a constant that only
    /// the angles, the number of chains and what is free decide.
    pub log_evidence: f64,
    /// Half the robust sum of squared residuals and jumps, each over its standard deviation.
    pub cost: f64,
    /// Sum of weighted squared residuals, per link.
    pub squares: [f64; 2],
    /// Number of residuals, per link.
    pub counts: [usize; 2],
    /// Degrees of freedom the states take up beyond the shared parameters' (trace of the states' influence).
    pub state_freedom: f64,
    /// Covariance of each segment's state, that of the common unknowns included.
    pub state_covariance: Vec<Matrix4<f64>>,
    /// Derivatives of each segment's end with respect to its start.
    pub transfer: Vec<Matrix4<f64>>,
    /// Segments in which a joint stuck.
    pub stuck: usize,
    /// Steps taken.
    pub iterations: usize,
    /// How it ended.
    pub status: Status,
}

/// Gain of half chi-square below which a step changes nothing: less than 0.05 standard deviations in any direction. Where
/// the residuals are larger than their sigmas, so are the errors.
const CONVERGED_GAIN: f64 = 1e-3;
/// Part of the cost that a step gains below which the states have settled enough for another slack.
const SETTLED_GAIN: f64 = 0.01;
/// Damping below which a step is as long as an undamped one.
const UNDAMPED: f64 = 1e-2;
/// Damping beyond which no step lowers the cost.
const LARGEST_DAMPING: f64 = 1e4;
/// Damping of the first step.
const FIRST_DAMPING: f64 = 1e-4;
/// Slack of the first steps, in units of the states' own sigma: nearly free of the jumps, so that the states settle before
/// the laws are asked.
const FIRST_SLACK: f64 = 30.0;
/// Factor by which the slack changes in one step at most: what the linear problem promises holds for moderate steps of the
/// states only.
const SLACK_STEP: f64 = 10.0;

/// Fits. `start` gives parameters, zeros and states (one per segment); `progress` may stop it by returning false.
///
/// # Errors
/// Nothing to fit, too many free parameters, or a start from which nothing is determined.
pub fn fit(
    recordings: &[Recording<'_>],
    segments: &[Segment],
    start: Point,
    settings: &Settings,
    progress: &mut dyn FnMut(&Progress) -> bool,
) -> Result<Fit, ShootingError> {
    if segments.is_empty() || start.states.len() != segments.len() {
        return Err(ShootingError::Empty);
    }
    let common = settings.free.len() + usize::from(settings.clock);
    if 4 + common > MAX_DIRECTIONS {
        return Err(ShootingError::TooMany(common, MAX_DIRECTIONS - 4));
    }
    let cameras_at = common + 2 * recordings.len() * usize::from(settings.zeros);
    let shared = cameras_at + CAMERA_NUMBERS * start.cameras.len();
    let problem = Problem { recordings, segments, settings, common, shared, cameras_at };
    let mut iteration = Iteration::start(problem, start)?;
    let status = iteration.run(progress);
    iteration.finish(status)
}

/// State of the iteration.
struct Iteration<'a> {
    problem: Problem<'a>,
    /// Whether any segment goes on from the one before it.
    chained: bool,
    point: Point,
    /// The segments' normal equations at `point`.
    locals: Vec<Local>,
    /// Median standard deviations of a segment's state from its own samples.
    own: [f64; 4],
    slack: [f64; 4],
    /// Whether the slack is final.
    settled: bool,
    jump_chi2: [f64; 4],
    damping: f64,
    iterations: usize,
}

impl<'a> Iteration<'a> {
    fn start(problem: Problem<'a>, point: Point) -> Result<Self, ShootingError> {
        let chained = problem.segments.iter().any(|s| s.chained);
        let locals = problem.locals(&point);
        if !locals.iter().all(|l| l.cost.is_finite()) {
            return Err(ShootingError::NotFinite);
        }
        let own = own_sigma(&locals).ok_or(ShootingError::Singular)?;
        let slack = match problem.settings.slack {
            Slack::Fixed(s) => s,
            Slack::Relative(f) | Slack::Learned(f) => own.map(|s| s * f.max(FIRST_SLACK)),
        };
        let settled = !chained || matches!(problem.settings.slack, Slack::Fixed(_));
        Ok(Self {
            problem,
            chained,
            point,
            locals,
            own,
            slack,
            settled,
            jump_chi2: [f64::NAN; 4],
            damping: FIRST_DAMPING,
            iterations: 0,
        })
    }

    /// Steps until nothing is gained any more, or `progress` stops it.
    fn run(&mut self, progress: &mut dyn FnMut(&Progress) -> bool) -> Status {
        let max_iterations = self.problem.settings.max_iterations;
        while self.iterations < max_iterations {
            let weight = self.weight();
            let step = self.problem.step(&self.point, &self.locals, weight, &mut self.damping);
            self.iterations += 1;
            let moved = step.next.is_some();
            if let Some(next) = step.next {
                self.point = next;
                self.locals = self.problem.locals(&self.point);
            }
            let report = Progress { iteration: self.iterations, max_iterations, chi2: self.chi2() };
            if !progress(&report) {
                return Status::Stopped;
            }
            let still = step.gain < CONVERGED_GAIN * report.chi2.max(1.0) && step.damping < UNDAMPED;
            if !self.settled && (still || step.gain < SETTLED_GAIN * step.cost) {
                let Some(change) = self.update_slack() else { return Status::Stalled };
                if change > SLACK_TOLERANCE {
                    continue;
                }
                self.settled = matches!(self.problem.settings.slack, Slack::Relative(_));
            }
            if still {
                return Status::Converged;
            }
            // Without a step the next one would be tried from the same point with the same damping.
            if !moved || step.damping > LARGEST_DAMPING {
                return Status::Stalled;
            }
        }
        Status::IterationLimit
    }

    /// Sets the next slack. By how much it changed, as a logarithm; `None` where the states are not determined.
    fn update_slack(&mut self) -> Option<f64> {
        self.own = own_sigma(&self.locals).unwrap_or(self.own);
        let (slack, lowest) = (self.slack, self.lowest_slack());
        let next = match self.problem.settings.slack {
            Slack::Learned(_) => {
                let found = learned(&self.problem, &self.point, &self.locals, slack, lowest)?;
                self.jump_chi2 = found.chi2;
                std::array::from_fn(|i| found.slack[i].clamp(slack[i] / SLACK_STEP, slack[i] * SLACK_STEP))
            }
            _ => std::array::from_fn(|i| (slack[i] / SLACK_STEP).max(lowest[i])),
        };
        self.slack = next;
        Some(apart(next, slack))
    }

    /// The least slack allowed.
    fn lowest_slack(&self) -> [f64; 4] {
        match self.problem.settings.slack {
            Slack::Relative(f) | Slack::Learned(f) => self.own.map(|s| s * f),
            Slack::Fixed(s) => s,
        }
    }

    /// Weights of the jumps; `None` where no segment goes on from another.
    fn weight(&self) -> Option<Vector4<f64>> {
        self.chained.then(|| Vector4::from(self.slack.map(|s| 1.0 / (s * s))))
    }

    /// Mean weighted squared residual.
    fn chi2(&self) -> f64 {
        let (sum, count) = self
            .locals
            .iter()
            .fold((0.0, 0), |(s, n), l| (s + l.squares[0] + l.squares[1], n + l.counts[0] + l.counts[1]));
        sum / count as f64
    }

    /// Variance that the jumps show over the slack's square, per component.
    fn jumps_shown(&self) -> [f64; 4] {
        if !self.chained {
            return [1.0; 4];
        }
        let lowest = self.lowest_slack();
        let links = self.problem.recordings.iter().map(|r| r.links).max().unwrap_or(2);
        // Components whose slack is not what their jumps ask for, but given or the least allowed. A link that is not
        // there does not jump and says nothing.
        let given = std::array::from_fn(|i| {
            let asked = matches!(self.problem.settings.slack, Slack::Learned(_))
                && self.slack[i] >= lowest[i] * (1.0 + SLACK_TOLERANCE);
            i % 2 < links && !asked
        });
        jump_variance_ratio(&self.problem, &self.point, &self.locals, self.slack, given)
    }

    /// The solution with its covariance.
    fn finish(self, status: Status) -> Result<Fit, ShootingError> {
        let (problem, weight) = (&self.problem, self.weight());
        let done = problem
            .assemble(&self.point, &self.locals, weight)
            .eliminate(0.0)
            .ok_or(ShootingError::Singular)?;
        let spreads = done.covariances();
        let corner = pseudo_inverse(&done.corner);
        let whole = |s: &Spread| {
            let through = &s.with_shared * &corner;
            s.own + Matrix4::from_fn(|i, j| through.row(i).dot(&s.with_shared.row(j)))
        };
        let absent: usize =
            problem.segments.iter().map(|s| 2 * (2 - problem.recordings[s.recording].links)).sum();
        let state_freedom: f64 = spreads
            .iter()
            .zip(&self.locals)
            .map(|(s, l)| (s.own * l.hessian.fixed_view::<4, 4>(0, 0)).trace())
            .sum();
        let chained_count = problem.segments.iter().filter(|s| s.chained).count() as f64;
        let cost = problem.local_cost(&self.point, &self.locals, weight);
        let jumps_shown = self.jumps_shown();
        let log_evidence = -cost
            - chained_count * self.slack.iter().map(|s| s.ln()).sum::<f64>()
            - 0.5 * done.log_determinant();
        let locals = &self.locals;
        let sum = |f: &dyn Fn(&Local) -> [f64; 2]| {
            locals.iter().fold([0.0; 2], |a, l| [a[0] + f(l)[0], a[1] + f(l)[1]])
        };
        Ok(Fit {
            squares: sum(&|l| l.squares),
            counts: locals.iter().fold([0; 2], |a, l| [a[0] + l.counts[0], a[1] + l.counts[1]]),
            stuck: locals.iter().filter(|l| l.stuck).count(),
            free: problem.settings.free.clone(),
            scores: scores(problem, &self.point, locals, &spreads, weight),
            angle_information: angle_information(problem, locals, &spreads),
            jump_information: jump_information(problem, locals, &spreads, weight, jumps_shown),
            jumps_shown,
            information: done.corner,
            gradient: done.corner_gradient,
            slack: self.slack,
            own_sigma: self.own,
            jump_chi2: self.jump_chi2,
            log_evidence,
            cost,
            state_freedom: state_freedom - absent as f64,
            state_covariance: spreads.iter().map(whole).collect(),
            transfer: locals.iter().map(|l| l.end_state).collect(),
            iterations: self.iterations,
            status,
            point: self.point,
        })
    }
}
