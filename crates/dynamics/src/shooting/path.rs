//! One segment of motion in any scalar: fixed-order steps sized by the rates, samples from a quintic Hermite
//! interpolant, and exact crossings of the dry-friction switches.
//!
//! Where a joint's rate changes sign the step is cut at the crossing. The crossing's time is itself a scalar with
//! derivatives, so the jump of the sensitivities there is exact. A joint that dry friction can hold sticks.

use crate::motion::{Contact, Flow, Motion, State, accelerations};
use crate::parameters::{Field, Parameters};
use crate::scalar::Real;

/// Angle per step, rad: classical RK4 then errs by `0.06^5/120 = 6e-9` rad a step.
const ANGLE_PER_STEP: f64 = 0.06;
/// Rate of the pendulum's own swinging, added to the links' rates when a step is sized, rad/s.
const SWING_RATE: f64 = 8.0;

/// No link turns this fast, rad/s; a guess that does is as good as not finite, and would take for ever to follow.
const FASTEST: f64 = 1e4;

/// The end of a segment.
#[derive(Clone, Copy, Debug)]
pub struct End<S> {
    /// State at the segment's end.
    pub state: State<S>,
    /// Whether a joint stuck on the way.
    pub stuck: bool,
}

/// A state with its accelerations.
#[derive(Clone, Copy)]
struct Knot<S> {
    x: State<S>,
    a: [S; 2],
}

struct Path<'a, S> {
    flow: Flow<'a, S>,
    contact: [Contact; 2],
    /// Whether the joint has dry friction.
    dry: [bool; 2],
    stuck: bool,
}

impl<S: Real> Path<'_, S> {
    fn accelerations(&self, x: &State<S>) -> [S; 2] {
        self.flow.accelerations(x, self.contact)
    }

    /// Torques and what friction can hold, without derivatives.
    fn motion(&self, x: &State<S>) -> Motion<f64> {
        accelerations(self.flow.values(), &x.map(|v| v.value()), self.contact)
    }

    /// One RK4 step of length `h`.
    fn step(&self, k: &Knot<S>, h: S) -> Knot<S> {
        let half = h * 0.5;
        let shift = |dx: [S; 4], h: S| -> State<S> { std::array::from_fn(|i| k.x[i] + dx[i] * h) };
        let slope = |x: &State<S>| -> [S; 4] {
            let a = self.accelerations(x);
            [x[2], x[3], a[0], a[1]]
        };
        let k1 = [k.x[2], k.x[3], k.a[0], k.a[1]];
        let k2 = slope(&shift(k1, half));
        let k3 = slope(&shift(k2, half));
        let k4 = slope(&shift(k3, h));
        let sixth = h * (1.0 / 6.0);
        let x = std::array::from_fn(|i| k.x[i] + (k1[i] + (k2[i] + k3[i]) * 2.0 + k4[i]) * sixth);
        Knot { x, a: self.accelerations(&x) }
    }

    fn rates(x: &State<S>) -> [f64; 2] {
        [x[2].value(), x[3].value() - x[2].value()]
    }

    /// The joint that a step from `from` to `to` takes through zero rate.
    fn crossing(&self, from: &State<S>, to: &State<S>) -> Option<usize> {
        let (r0, r1) = (Self::rates(from), Self::rates(to));
        (0..2).filter(|&j| self.crosses(j, r1[j])).min_by(|&i, &j| {
            let at = |j: usize| r0[j].abs() / (r0[j].abs() + r1[j].abs()).max(f64::MIN_POSITIVE);
            at(i).total_cmp(&at(j))
        })
    }

    fn crosses(&self, joint: usize, rate: f64) -> bool {
        self.dry[joint] && matches!(self.contact[joint], Contact::Slip(sign) if sign * rate < 0.0)
    }

    /// Moves to exactly where joint `j`'s rate is zero within a step `h`, sets how it goes on, and returns the time
    /// used. The state's derivatives include those of the crossing's time.
    fn cross(&mut self, k: &Knot<S>, h: S, j: usize) -> (Knot<S>, S) {
        let rate = |k: &Knot<S>| if j == 0 { k.x[2] } else { k.x[3] - k.x[2] };
        let accel = |k: &Knot<S>| if j == 0 { k.a[0] } else { k.a[1] - k.a[0] };
        let whole = h.value();
        let mut fraction = 0.5;
        let (mut low, mut high) = (0.0, 1.0);
        let start = rate(k).value();
        let mut there = self.step(k, h * fraction);
        for _ in 0..40 {
            let r = rate(&there).value();
            if r * start > 0.0 {
                low = fraction
            } else {
                high = fraction
            }
            let newton = fraction - r / (accel(&there).value() * whole);
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            let done = (next - fraction).abs() < 1e-13;
            fraction = next;
            there = self.step(k, h * fraction);
            if done {
                break;
            }
        }
        // First-order move onto the crossing: exact in the derivatives, since the value is already there.
        let mut used = h * fraction;
        let slope = accel(&there).value();
        if slope != 0.0 {
            let late = rate(&there) * (-1.0 / slope);
            let rates = [there.x[2], there.x[3], there.a[0], there.a[1]];
            for (x, rate) in there.x.iter_mut().zip(rates) {
                *x += rate * late;
            }
            used += late;
        }
        self.contact[j] = Contact::Stuck;
        let held = self.motion(&there.x);
        if held.dry[j].abs() > held.capacity[j] {
            // The torque needed to hold it is more than friction has: it goes the way the torque pushes back from.
            self.contact[j] = Contact::Slip(-start.signum());
        } else {
            self.stuck = true;
        }
        there.a = self.accelerations(&there.x);
        (there, used)
    }

    /// Lets go of joints whose friction no longer holds them.
    fn release(&mut self, k: &mut Knot<S>) {
        for j in 0..2 {
            if self.contact[j] == Contact::Stuck {
                let held = self.motion(&k.x);
                if held.dry[j].abs() > held.capacity[j] {
                    self.contact[j] = Contact::Slip(held.dry[j].signum());
                    k.a = self.accelerations(&k.x);
                }
            }
        }
    }
}

/// From when to when, and where samples are wanted.
#[derive(Clone, Copy, Debug)]
pub struct Span<'a> {
    /// Start, s.
    pub start_s: f64,
    /// End, s.
    pub end_s: f64,
    /// Sample times, ascending, within the span, s.
    pub times_s: &'a [f64],
}

/// Integrates from `x0` over the span, handing `sink` the index and the angles (with `rates` also the rates) at each
/// sample. `stretch` is the true time per clock time. A motion that leaves the finite numbers ends early.
pub fn follow<S: Real>(
    p: &Parameters<S>,
    x0: State<S>,
    span: &Span<'_>,
    stretch: S,
    rates: bool,
    mut sink: impl FnMut(usize, &State<S>),
) -> End<S> {
    let dry = [[Field::Rmu1, Field::TauC1], [Field::Rmu2, Field::TauC2]]
        .map(|laws| laws.iter().any(|f| p.is_active(*f)));
    let mut path = Path { flow: Flow::new(p), contact: [Contact::Slip(1.0); 2], dry, stuck: false };
    let start = Path::<S>::rates(&x0);
    path.contact = start.map(|r| Contact::Slip(if r < 0.0 { -1.0 } else { 1.0 }));
    let mut k = Knot { x: x0, a: path.accelerations(&x0) };
    let Span { start_s, end_s, times_s } = *span;
    let mut t = start_s;
    let mut next = 0;
    while next < times_s.len() && times_s[next] <= t {
        sink(next, &k.x);
        next += 1;
    }
    while t < end_s {
        let speed = k.x[2].value().abs().max(k.x[3].value().abs()) + SWING_RATE;
        if speed.is_nan() || speed >= FASTEST {
            k.x = [S::constant(f64::NAN); 4];
            break;
        }
        let wanted = ANGLE_PER_STEP / speed;
        let steps = ((end_s - t) / wanted).ceil().max(1.0);
        let to = if steps <= 1.0 { end_s } else { t + (end_s - t) / steps };
        let h = stretch * (to - t);
        let trial = path.step(&k, h);
        let eventful = path.crossing(&k.x, &trial.x).is_some() || path.contact.contains(&Contact::Stuck);
        if eventful {
            // From sample to sample, so that no interpolant spans the switch.
            while t < to {
                let stop = if next < times_s.len() { times_s[next].min(to) } else { to };
                let mut left = stretch * (stop - t);
                for _ in 0..8 {
                    let trial = path.step(&k, left);
                    let Some(j) = path.crossing(&k.x, &trial.x) else {
                        k = trial;
                        break;
                    };
                    let (there, used) = path.cross(&k, left, j);
                    k = there;
                    left -= used;
                }
                path.release(&mut k);
                t = stop;
                while next < times_s.len() && times_s[next] <= t {
                    sink(next, &k.x);
                    next += 1;
                }
            }
        } else {
            while next < times_s.len() && times_s[next] <= to {
                sink(next, &between(&k, &trial, h, (times_s[next] - t) / (to - t), rates));
                next += 1;
            }
            k = trial;
        }
        t = to;
    }
    End { state: k.x, stuck: path.stuck }
}

/// Quintic Hermite between two knots at fraction `u` of the step `h`; the rates by the cubic of rates and
/// accelerations when wanted.
fn between<S: Real>(from: &Knot<S>, to: &Knot<S>, h: S, u: f64, rates: bool) -> State<S> {
    let (u2, u3) = (u * u, u * u * u);
    let (u4, u5) = (u2 * u2, u2 * u3);
    let b = 10.0 * u3 - 15.0 * u4 + 6.0 * u5;
    let weights = [
        1.0 - b,
        u - 6.0 * u3 + 8.0 * u4 - 3.0 * u5,
        0.5 * (u2 - 3.0 * u3 + 3.0 * u4 - u5),
        b,
        -4.0 * u3 + 7.0 * u4 - 3.0 * u5,
        0.5 * (u3 - 2.0 * u4 + u5),
    ];
    let mut x = from.x;
    for j in 0..2 {
        let first = from.x[2 + j] * weights[1] + to.x[2 + j] * weights[4];
        let second = from.a[j] * weights[2] + to.a[j] * weights[5];
        x[j] = from.x[j] * weights[0] + to.x[j] * weights[3] + (first + second * h) * h;
        if rates {
            let c = u2 * (3.0 - 2.0 * u);
            x[2 + j] = from.x[2 + j] * (1.0 - c)
                + to.x[2 + j] * c
                + (from.a[j] * (u3 - 2.0 * u2 + u) + to.a[j] * (u3 - u2)) * h;
        }
    }
    x
}
