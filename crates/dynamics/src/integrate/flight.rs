//! Integrates a motion: DOP853 steps between located changes of contact.

use crate::friction::{Friction, Joints, rate};
use crate::integrate::dop853::{Dense, Step, next_factor};
use crate::motion::{energies, flow};
use crate::parameters::{Field, Parameters};
use crate::state::{Contact, State};
use crate::terms::TERMS;

/// Length of the integrated vector: the state and the work taken out by each of [`TERMS`].
pub const SIZE: usize = 4 + TERMS.len();
/// Number of points of each step at which contacts are examined, so that a joint that stops and turns back is not missed.
const LOOKS: u32 = 8;
/// Largest rate that counts as not yet across zero, rad/s: rounding of rates of order 10 that cancel.
const RATE_ZERO: f64 = 1e-13;
/// Maximum number of steps of a run.
const MAX_STEPS: usize = 10_000_000;

/// Settings of a simulation.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Local error allowed per step, relative to one radian, to the larger of the rate and 1 rad/s, and to the
    /// energy's scale.
    pub tolerance: f64,
    /// Dry friction's law.
    pub friction: Friction,
    /// Whether joint 2 is pinned.
    pub pinned: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self { tolerance: 3e-13, friction: Friction::Exact, pinned: false }
    }
}

/// A change of contact.
#[derive(Clone, Copy, Debug)]
pub struct Event {
    /// When, s.
    pub t_s: f64,
    /// Joint, 0 or 1.
    pub joint: usize,
    /// The contact it left.
    pub from: Contact,
    /// The contact it went into.
    pub to: Contact,
}

/// The reason for which a simulation could not be done.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Failure {
    /// The state is not finite, or a pinned joint turns.
    #[error("state: {0}")]
    State(String),
    /// The times do not increase.
    #[error("t_s, index {index}: {now} s does not come after {before} s")]
    Times {
        /// Where.
        index: usize,
        /// The time before.
        before: f64,
        /// The time there.
        now: f64,
    },
    /// A setting out of range.
    #[error("{0}")]
    Settings(String),
    /// The step became too small, or there were too many.
    #[error("simulation, t = {t_s} s: {problem}. Check the coefficients and the tolerance")]
    Stalled {
        /// When.
        t_s: f64,
        /// The reason, a clause.
        problem: String,
    },
}

/// A pendulum on its way: the state, its contact, and the size of the next step.
pub struct Flight<'a> {
    p: &'a Parameters<f64>,
    joints: Joints,
    /// Time, s.
    pub t_s: f64,
    /// State and works.
    pub y: [f64; SIZE],
    /// Contact of each joint.
    pub contact: [Contact; 2],
    slope: [f64; SIZE],
    h: f64,
    tolerance: f64,
    energy_scale: f64,
    /// Steps accepted so far.
    pub steps: usize,
    idle: usize,
}

/// One step of a motion, as [`Flight::step`] took it.
pub struct Leg {
    /// When it began, s.
    pub from_s: f64,
    /// How long it is, s.
    pub h: f64,
    /// The motion within.
    pub dense: Dense<f64, SIZE>,
    /// The contact during it.
    pub contact: [Contact; 2],
    /// The change of contact at its end, if it ended by one.
    pub event: Option<Event>,
}

pub(crate) fn state(y: &[f64; SIZE]) -> State<f64> {
    [y[0], y[1], y[2], y[3]]
}

fn derivative(p: &Parameters<f64>, y: &[f64; SIZE], contact: [Contact; 2]) -> [f64; SIZE] {
    let x = state(y);
    let (m, power) = flow(p, &x, contact);
    let mut out = [0.0; SIZE];
    out[..4].copy_from_slice(&[x[2], x[3], m.a[0], m.a[1]]);
    out[4..].copy_from_slice(&power);
    out
}

impl<'a> Flight<'a> {
    /// Starts at `x` and `t_s`.
    ///
    /// # Errors
    /// A state that is not finite, a pinned joint that turns, a tolerance that is not one.
    pub fn new(
        p: &'a Parameters<f64>,
        x: State<f64>,
        t_s: f64,
        settings: &Settings,
    ) -> Result<Self, Failure> {
        if !x.iter().all(|v| v.is_finite()) {
            return Err(Failure::State(format!("{x:?} is not finite")));
        }
        if settings.pinned && x[2] != x[3] {
            return Err(Failure::State(format!(
                "joint 2 is pinned, but w1 = {} and w2 = {} differ",
                x[2], x[3]
            )));
        }
        if !(1e-15..=1e-3).contains(&settings.tolerance) {
            return Err(Failure::Settings(format!(
                "tolerance is {}. Choose one from 1e-15 to 1e-3",
                settings.tolerance
            )));
        }
        if let Friction::Smooth(width) = settings.friction
            && !(width > 0.0 && width.is_finite())
        {
            return Err(Failure::Settings(format!(
                "the smooth law's width is {width} rad/s. Choose a positive one"
            )));
        }
        let joints = Joints::new(p, settings.friction, settings.pinned);
        let contact = joints.resolve(p, &x, None, None);
        let mut y = [0.0; SIZE];
        y[..4].copy_from_slice(&x);
        let [kinetic, potential] = energies(p, &x);
        let slope = derivative(p, &y, contact);
        Ok(Self {
            p,
            joints,
            t_s,
            y,
            contact,
            slope,
            h: 1e-3,
            tolerance: settings.tolerance,
            energy_scale: (kinetic + potential).abs().max(1e-3 * weight(p)),
            steps: 0,
            idle: 0,
        })
    }

    /// Whether both joints are stuck at rest: nothing will ever change.
    #[must_use]
    pub fn at_rest(&self) -> bool {
        self.contact == [Contact::Stuck; 2] && self.y[2] == 0.0 && self.y[3] == 0.0
    }

    /// One step, at most to `until_s`, ended early by a change of contact.
    ///
    /// # Errors
    /// [`Failure::Stalled`].
    pub fn step(&mut self, until_s: f64) -> Result<Leg, Failure> {
        let contact = self.contact;
        let p = self.p;
        let mut f = |y: &[f64; SIZE]| derivative(p, y, contact);
        let mut rejected = false;
        let (mut step, h) = loop {
            let last = self.t_s + self.h >= until_s;
            let h = if last { until_s - self.t_s } else { self.h };
            if h < 1e-13 * (1.0 + self.t_s.abs()) && !last {
                return Err(self.stalled("the step became too small"));
            }
            let step = Step::take(&mut f, &self.y, &self.slope, h);
            let error = step.error(&self.scale(&step.end));
            if error <= 1.0 {
                let factor = next_factor(error, rejected);
                // A step cut short by the end says little about the next.
                self.h = if last { self.h.max(h * factor) } else { h * factor };
                break (step, h);
            }
            self.h = if error.is_finite() { h * next_factor(error, true) } else { h * 0.1 };
            rejected = true;
        };
        self.steps += 1;
        if self.steps > MAX_STEPS {
            return Err(self.stalled("too many steps"));
        }
        let from_s = self.t_s;
        let dense = step.dense(&mut f);
        if let Some((fraction, joint)) = self.first_event(&dense) {
            return self.stop_at(h, fraction, joint);
        }
        self.idle = 0;
        self.t_s = if h == until_s - from_s { until_s } else { from_s + h };
        self.y = step.end;
        self.slope = step.slope;
        Ok(Leg { from_s, h, dense, contact, event: None })
    }

    fn stalled(&self, problem: &str) -> Failure {
        Failure::Stalled { t_s: self.t_s, problem: problem.to_owned() }
    }

    fn scale(&self, end: &[f64; SIZE]) -> [f64; SIZE] {
        let mut scale = [self.tolerance; SIZE];
        for i in 2..4 {
            scale[i] *= self.y[i].abs().max(end[i].abs()).max(1.0);
        }
        for s in &mut scale[4..] {
            *s *= self.energy_scale;
        }
        scale
    }

    /// Value at which the margin of `joint` counts as zero.
    fn zero(&self, joint: usize) -> f64 {
        match self.contact[joint] {
            Contact::Slip(_) => -RATE_ZERO,
            _ => -1e-13 * weight(self.p),
        }
    }

    /// The first fraction of the step at which a contact ends, and the joint.
    fn first_event(&self, dense: &Dense<f64, SIZE>) -> Option<(f64, usize)> {
        let mut first: Option<(f64, usize)> = None;
        for joint in 0..2 {
            if !self.joints.watched(joint, self.contact[joint]) {
                continue;
            }
            let margin = |x: f64| self.joints.margin(self.p, &dense.first::<4>(x), self.contact, joint);
            let mut before = 0.0;
            for look in 1..=LOOKS {
                let here = f64::from(look) / f64::from(LOOKS);
                if first.is_some_and(|(f, _)| before >= f) {
                    break;
                }
                if margin(here) < self.zero(joint) {
                    let root = bisect(before, here, margin);
                    if first.is_none_or(|(f, _)| root < f) {
                        first = Some((root, joint));
                    }
                    break;
                }
                before = here;
            }
        }
        first
    }

    /// Goes to the event with a step of its own, and changes contact.
    fn stop_at(&mut self, h: f64, fraction: f64, joint: usize) -> Result<Leg, Failure> {
        let (from_s, contact, p) = (self.t_s, self.contact, self.p);
        let mut f = |y: &[f64; SIZE]| derivative(p, y, contact);
        let mut short = h * fraction;
        let mut step = Step::take(&mut f, &self.y, &self.slope, short);
        if let Contact::Slip(_) = contact[joint] {
            // One Newton correction from the dense output's root to the step's own.
            let v = rate(&state(&step.end), joint);
            let push = if joint == 0 { step.slope[2] } else { step.slope[3] - step.slope[2] };
            let better = short - v / push;
            if better > 0.0 && (better - short).abs() < 0.01 * h {
                short = better;
                step = Step::take(&mut f, &self.y, &self.slope, short);
            }
        }
        let dense = step.dense(&mut f);
        if short <= 1e-12 {
            self.idle += 1;
            if self.idle > 20 {
                return Err(self.stalled("contacts change without end"));
            }
        } else {
            self.idle = 0;
        }
        self.t_s = from_s + short;
        self.y = step.end;
        let mut loose = None;
        match contact[joint] {
            Contact::Stuck => loose = Some(joint),
            _ if joint == 0 => self.y[2] = 0.0,
            _ => self.y[3] = self.y[2],
        }
        // A joint that stays stuck keeps its rate exactly.
        if contact[0] == Contact::Stuck {
            self.y[2] = 0.0;
        }
        if contact[1] == Contact::Stuck {
            self.y[3] = self.y[2];
        }
        self.contact = self.joints.resolve(p, &state(&self.y), Some(contact), loose);
        self.slope = derivative(p, &self.y, self.contact);
        let event = Event { t_s: self.t_s, joint, from: contact[joint], to: self.contact[joint] };
        Ok(Leg { from_s, h: short, dense, contact, event: Some(event) })
    }
}

/// Weight moments: the scale of energies and torques.
fn weight(p: &Parameters<f64>) -> f64 {
    let w = p.get(Field::Sigma).abs() + p.get(Field::Kappa).abs();
    if w > 0.0 { w } else { 1.0 }
}

/// Place at which `f` falls through zero between `a` (not below) and `b` (below).
fn bisect(mut a: f64, mut b: f64, f: impl Fn(f64) -> f64) -> f64 {
    for _ in 0..60 {
        let middle = 0.5 * (a + b);
        if middle <= a || middle >= b {
            break;
        }
        if f(middle) < 0.0 { b = middle } else { a = middle }
    }
    0.5 * (a + b)
}
