//! Gauss-Newton with Levenberg's damping on the arrow-shaped problem, and the slack.

use nalgebra::{DMatrix, DVector, Matrix4, Vector4};

use super::error::{angle_information, jump_information, scores};
use super::linearise::{Local, Point};
use super::problem::{Progress, Recording, Segment, Settings, ShootingError, Slack, Status};
use super::slack::{KNOWN, apart, learned, own_sigma, shown};
use super::system::{MOST, Problem, pseudo_inverse};
use crate::parameters::Field;

/// A finished fit.
pub struct Fit {
    /// The solution.
    pub point: Point,
    /// Names of the border: free fields, then `clock`, then two zeros for each recording.
    pub free: Vec<Field>,
    /// Marginal second derivatives of half chi-square with respect to the border, (G, G).
    pub information: DMatrix<f64>,
    /// What of it the angles give, the states following the border: the part whose errors are the angles' noise.
    pub angle_information: DMatrix<f64>,
    /// What of it the jumps give, each component times `jumps_shown`: the part whose errors are the model's.
    pub jump_information: DMatrix<f64>,
    /// Variance that the jumps show over the slack's square, per component: 1 where the slack was learned. Where it
    /// stands at its floor or was given, the data may ask for less, down to none.
    pub jumps_shown: [f64; 4],
    /// Gradient there; not zero only for parameters held at a bound.
    pub gradient: DVector<f64>,
    /// Each segment's part of the border's gradient with the states eliminated, (K, G): what a sandwich estimate of
    /// the covariance is made of.
    pub scores: DMatrix<f64>,
    /// Standard deviations allowed to the jumps of `[phi1, phi2, w1, w2]`.
    pub slack: [f64; 4],
    /// Median standard deviations of a segment's state from its own samples.
    pub own_sigma: [f64; 4],
    /// Mean squared jump over slack squared, per component, with the degrees of freedom counted.
    pub joint_chi2: [f64; 4],
    /// Logarithm of the marginal likelihood, states and common unknowns integrated out, but for a constant that only
    /// the angles, the number of chains and what is free decide.
    pub log_evidence: f64,
    /// Half the robust sum of squared residuals and jumps, each over its standard deviation.
    pub cost: f64,
    /// Sum of weighted squared residuals, per link.
    pub squares: [f64; 2],
    /// Number of residuals, per link.
    pub counts: [usize; 2],
    /// Degrees of freedom the states take up beyond the border's (trace of the states' influence).
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

/// Half chi-square below which a step changes nothing: less than 0.05 standard deviations in any direction. Where the
/// residuals are larger than their sigmas, so are the errors.
const SMALL: f64 = 1e-3;
/// Part of the cost below which the states have settled enough for another slack.
const NEARLY: f64 = 0.01;
/// Damping below which a step is as long as an undamped one.
const FREE: f64 = 1e-2;
/// Damping beyond which no step lowers the cost.
const STUCK: f64 = 1e4;

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
    if 4 + common > MOST {
        return Err(ShootingError::TooMany(common, MOST - 4));
    }
    let border = common + 2 * recordings.len() * usize::from(settings.zeros);
    let problem = Problem { recordings, segments, settings, common, border };
    let chained = segments.iter().any(|s| s.chained);

    let mut point = start;
    let mut locals = problem.locals(&point);
    if !locals.iter().all(|l| l.cost.is_finite()) {
        return Err(ShootingError::NotFinite);
    }
    let mut own = own_sigma(&locals).ok_or(ShootingError::Singular)?;
    // The first steps are nearly free of the joints, so that the states settle before the laws are asked.
    let floor = |own: [f64; 4]| match settings.slack {
        Slack::Relative(f) | Slack::Learned(f) => own.map(|s| s * f),
        Slack::Fixed(s) => s,
    };
    let mut slack = match settings.slack {
        Slack::Fixed(s) => s,
        Slack::Relative(f) | Slack::Learned(f) => own.map(|s| s * f.max(30.0)),
    };
    let weight = |slack: [f64; 4]| chained.then(|| Vector4::from(slack.map(|s| 1.0 / (s * s))));
    let mut damping = 1e-4;
    let mut status = Status::IterationLimit;
    let mut iterations = 0;
    let mut settled = !chained || matches!(settings.slack, Slack::Fixed(_));
    let mut joint_chi2 = [f64::NAN; 4];
    while iterations < settings.max_iterations {
        let step = problem.step(&point, &locals, weight(slack), &mut damping);
        iterations += 1;
        let moved = step.next.is_some();
        if let Some(next) = step.next {
            point = next;
            locals = problem.locals(&point);
        }
        let (sum, count) = locals
            .iter()
            .fold((0.0, 0), |(s, n), l| (s + l.squares[0] + l.squares[1], n + l.counts[0] + l.counts[1]));
        let report = Progress {
            iteration: iterations,
            max_iterations: settings.max_iterations,
            chi2: sum / count as f64,
        };
        if !progress(&report) {
            status = Status::Stopped;
            break;
        }
        let still = step.gain < SMALL * report.chi2.max(1.0) && step.damping < FREE;
        if !settled && (still || step.gain < NEARLY * step.cost) {
            own = own_sigma(&locals).unwrap_or(own);
            let lowest = floor(own);
            let next = match settings.slack {
                Slack::Learned(_) => {
                    let Some(found) = learned(&problem, &point, &locals, slack, lowest) else {
                        status = Status::Stalled;
                        break;
                    };
                    joint_chi2 = found.chi2;
                    // What the linear problem promises holds for moderate steps of the states only.
                    std::array::from_fn(|i| found.slack[i].clamp(slack[i] / 10.0, slack[i] * 10.0))
                }
                _ => std::array::from_fn(|i| (slack[i] / 10.0).max(lowest[i])),
            };
            let change = apart(next, slack);
            slack = next;
            if change > KNOWN {
                continue;
            }
            if matches!(settings.slack, Slack::Relative(_)) {
                settled = true;
            }
        }
        if still {
            status = Status::Converged;
            break;
        }
        // Without a step the next one would be tried from the same point with the same damping.
        if !moved || step.damping > STUCK {
            status = Status::Stalled;
            break;
        }
    }
    let done =
        problem.assemble(&point, &locals, weight(slack)).eliminate(0.0).ok_or(ShootingError::Singular)?;
    let spreads = done.covariances();
    let absent: usize = segments.iter().map(|s| 2 * (2 - recordings[s.recording].links)).sum();
    let state_freedom: f64 =
        spreads.iter().zip(&locals).map(|(s, l)| (s.own * l.hessian.fixed_view::<4, 4>(0, 0)).trace()).sum();
    let corner = pseudo_inverse(&done.corner);
    let whole = |s: &super::arrow::Spread| {
        let through = &s.with_border * &corner;
        s.own + Matrix4::from_fn(|i, j| through.row(i).dot(&s.with_border.row(j)))
    };
    let chained_count = segments.iter().filter(|s| s.chained).count() as f64;
    let cost = problem.local_cost(&point, &locals, weight(slack));
    // Components whose slack is not what their jumps ask for, but given or the least allowed. A link that is not there
    // does not jump and says nothing.
    let lowest = floor(own);
    let links = recordings.iter().map(|r| r.links).max().unwrap_or(2);
    let given = std::array::from_fn(|i| {
        let asked = matches!(settings.slack, Slack::Learned(_)) && slack[i] >= lowest[i] * (1.0 + KNOWN);
        i % 2 < links && !asked
    });
    let jumps_shown = if chained { shown(&problem, &point, &locals, slack, given) } else { [1.0; 4] };
    let log_evidence =
        -cost - chained_count * slack.iter().map(|s| s.ln()).sum::<f64>() - 0.5 * done.log_determinant();
    let sum = |f: &dyn Fn(&Local) -> [f64; 2]| {
        locals.iter().fold([0.0; 2], |a, l| [a[0] + f(l)[0], a[1] + f(l)[1]])
    };
    Ok(Fit {
        squares: sum(&|l| l.squares),
        counts: locals.iter().fold([0; 2], |a, l| [a[0] + l.counts[0], a[1] + l.counts[1]]),
        stuck: locals.iter().filter(|l| l.stuck).count(),
        free: settings.free.clone(),
        scores: scores(&problem, &point, &locals, &spreads, weight(slack)),
        angle_information: angle_information(&problem, &locals, &spreads),
        jump_information: jump_information(&problem, &locals, &spreads, weight(slack), jumps_shown),
        jumps_shown,
        information: done.corner,
        gradient: done.corner_gradient,
        slack,
        own_sigma: own,
        joint_chi2,
        log_evidence,
        cost,
        state_freedom: state_freedom - absent as f64,
        state_covariance: spreads.iter().map(whole).collect(),
        transfer: locals.iter().map(|l| l.end_state).collect(),
        iterations,
        status,
        point,
    })
}
