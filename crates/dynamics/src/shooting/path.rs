//! Integrates one segment of motion in any scalar: fixed-order steps sized by the rates, samples from a quintic Hermite
//! interpolant, and exact crossings of the dry-friction switches.
//!
//! Where a joint's rate changes sign the step is cut at the crossing. The crossing's time is itself a scalar with
//! derivatives, so the jump of the sensitivities there is exact. A joint that dry friction can hold sticks until it no
//! longer can.
//!
//! The end is a continuous function of the start: a step's length follows the rates, the last one is what is left, and
//! nothing is rounded to a number of steps or to a sample. Near the upright errors grow a thousandfold per second: a
//! discontinuity of the integrator would become the fit's floor.

use crate::motion::{Flow, accelerations};
use crate::parameters::{Field, Parameters};
use crate::scalar::Real;
use crate::state::{Contact, Motion, State};

/// Angle per step, rad: classical RK4 then errs by `0.06^5/120 = 6e-9` rad a step.
const STEP_RAD: f64 = 0.06;
/// Rate of the pendulum's own swinging, added to the links' rates when a step is sized, rad/s.
const SWING_RATE_RAD_S: f64 = 8.0;

/// Rate of a link, rad/s, above which a guess counts as not finite: no link turns this fast, and following it would take
/// for ever.
const MAX_RATE_RAD_S: f64 = 1e4;

/// Dry-friction switches in one step, at most.
const MAX_SWITCHES: usize = 8;

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

    fn accel(k: &Knot<S>) -> [f64; 2] {
        [k.a[0].value(), k.a[1].value() - k.a[0].value()]
    }

    /// Whether joint `j` is, after a step, beyond what its contact allows: turned round, or no longer held.
    fn ends(&self, k: &Knot<S>, j: usize) -> bool {
        match self.contact[j] {
            Contact::Slip(sign) => self.dry[j] && sign * Self::rates(&k.x)[j] < 0.0,
            Contact::Stuck => self.overload(&k.x, j) > 0.0,
            Contact::Smooth(_) => false,
        }
    }

    /// Torque that holding joint `j` takes beyond what its friction has, N m.
    fn overload(&self, x: &State<S>, j: usize) -> f64 {
        let held = self.motion(x);
        held.dry[j].abs() - held.capacity[j]
    }

    /// Part of the step at which a joint that turns round twice within it turns the first time, or near that: where
    /// the cubic through rates and accelerations is least.
    fn graze(&self, from: &Knot<S>, to: &Knot<S>, h: f64) -> Option<f64> {
        let (r0, r1) = (Self::rates(&from.x), Self::rates(&to.x));
        let (a0, a1) = (Self::accel(from), Self::accel(to));
        (0..2).find_map(|j| {
            let Contact::Slip(sign) = self.contact[j] else { return None };
            let (start, end, fall, rise) = (sign * r0[j], sign * r1[j], sign * a0[j] * h, sign * a1[j] * h);
            if !self.dry[j] || start <= 0.0 || end <= 0.0 || fall >= 0.0 || rise <= 0.0 {
                return None;
            }
            // start + fall u + b u^2 + c u^3, its slope zero at u
            let b = 3.0 * (end - start) - 2.0 * fall - rise;
            let c = 2.0 * (start - end) + fall + rise;
            let root = (b * b - 3.0 * c * fall).max(0.0).sqrt();
            let u = -fall / (b + root);
            let least = start + u * (fall + u * (b + u * c));
            (u > 0.0 && u < 1.0 && least < 0.0).then_some(u)
        })
    }

    /// The part of a step `h` from `k` at which joint `j`'s contact ends, and the state there.
    fn when(&self, k: &Knot<S>, h: S, j: usize) -> (Knot<S>, f64) {
        let whole = h.value();
        let (mut low, mut high) = (0.0, 1.0);
        let mut fraction = 0.5;
        let mut there = self.step(k, h * fraction);
        for _ in 0..60 {
            if self.ends(&there, j) {
                high = fraction
            } else {
                low = fraction
            }
            let next = match self.contact[j] {
                Contact::Slip(_) => fraction - Self::rates(&there.x)[j] / (Self::accel(&there)[j] * whole),
                Contact::Stuck | Contact::Smooth(_) => 0.5 * (low + high),
            };
            let next = if next > low && next < high { next } else { 0.5 * (low + high) };
            let done = (next - fraction).abs() < 1e-13;
            fraction = next;
            there = self.step(k, h * fraction);
            if done {
                break;
            }
        }
        (there, fraction)
    }

    /// Moves to exactly where a joint's contact ends within a step `h`, sets how it goes on, and returns the time
    /// used. The state's derivatives include those of a crossing's time; where a joint is let go the accelerations are
    /// continuous, and the time makes no difference.
    fn switch(&mut self, k: &Knot<S>, h: S, ending: [bool; 2]) -> (Knot<S>, S) {
        let found = |j: usize| ending[j].then(|| (j, self.when(k, h, j)));
        let first = match (found(0), found(1)) {
            (Some(a), Some(b)) => Some(if a.1.1 <= b.1.1 { a } else { b }),
            (a, b) => a.or(b),
        };
        let Some((j, (mut there, fraction))) = first else { return (self.step(k, h), h) };
        let mut used = h * fraction;
        let Contact::Slip(before) = self.contact[j] else {
            let held = self.motion(&there.x);
            self.contact[j] = Contact::Slip(held.dry[j].signum());
            there.a = self.accelerations(&there.x);
            return (there, used);
        };
        // First-order move onto the crossing: exact in the derivatives, since the value is already there.
        let slope = Self::accel(&there)[j];
        if slope != 0.0 {
            let rate = if j == 0 { there.x[2] } else { there.x[3] - there.x[2] };
            let late = rate * (-1.0 / slope);
            let rates = [there.x[2], there.x[3], there.a[0], there.a[1]];
            for (x, rate) in there.x.iter_mut().zip(rates) {
                *x += rate * late;
            }
            used += late;
        }
        self.contact[j] = Contact::Stuck;
        if self.overload(&there.x, j) > 0.0 {
            // The torque needed to hold it is more than friction has: it goes the way the torque pushes back from.
            self.contact[j] = Contact::Slip(-before);
        } else {
            self.stuck = true;
        }
        there.a = self.accelerations(&there.x);
        (there, used)
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
/// sample. `clock_scale` is the true time per clock time. A motion that leaves the finite numbers ends early.
pub fn follow<S: Real>(
    p: &Parameters<S>,
    x0: State<S>,
    span: &Span<'_>,
    clock_scale: S,
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
        let speed = k.x[2].value().abs().max(k.x[3].value().abs()) + SWING_RATE_RAD_S;
        if speed.is_nan() || speed >= MAX_RATE_RAD_S {
            k.x = [S::constant(f64::NAN); 4];
            break;
        }
        let mut to = end_s.min(t + STEP_RAD / speed);
        let mut h = clock_scale * (to - t);
        let mut trial = path.step(&k, h);
        if let Some(part) = path.graze(&k, &trial, h.value()) {
            to = t + part * (to - t);
            h = clock_scale * (to - t);
            trial = path.step(&k, h);
        }
        let mut ending = [0, 1].map(|j| path.ends(&trial, j));
        if ending == [false; 2] {
            while next < times_s.len() && times_s[next] <= to {
                sink(next, &between(&k, &trial, h, (times_s[next] - t) / (to - t), rates));
                next += 1;
            }
        } else {
            // Piece after piece from switch to switch; `gone` is how far, in true time.
            let mut gone = S::constant(0.0);
            for _ in 0..MAX_SWITCHES {
                let left = h - gone;
                let (there, used) = path.switch(&k, left, ending);
                while next < times_s.len() && times_s[next] <= to {
                    let since = clock_scale * (times_s[next] - t) - gone;
                    if since.value() > used.value() {
                        break;
                    }
                    sink(next, &inside(&k, &there, used, since, rates));
                    next += 1;
                }
                gone += used;
                k = there;
                let left = h - gone;
                trial = path.step(&k, left);
                ending = [0, 1].map(|j| path.ends(&trial, j));
                // In so short a rest the signs of the rates are rounding.
                if ending == [false; 2] || left.value() < 1e-9 {
                    break;
                }
            }
            let left = h - gone;
            while next < times_s.len() && times_s[next] <= to {
                sink(next, &inside(&k, &trial, left, clock_scale * (times_s[next] - t) - gone, rates));
                next += 1;
            }
        }
        k = trial;
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

/// [`between`] at a time `since` the first knot that has derivatives of its own, as after a switch. The rates' own
/// derivatives leave those of the time out.
fn inside<S: Real>(from: &Knot<S>, to: &Knot<S>, h: S, since: S, rates: bool) -> State<S> {
    let u = if h.value() > 0.0 { (since.value() / h.value()).clamp(0.0, 1.0) } else { 1.0 };
    let mut x = between(from, to, h, u, true);
    let late = since - h * u;
    for j in 0..2 {
        let rate = x[2 + j];
        x[j] += rate * late;
    }
    if rates { x } else { [x[0], x[1], from.x[2], from.x[3]] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::all_terms;
    use crate::scalar::Dual;

    /// Where a second from near the upright leads, for starts so close together that the motion is straight in them:
    /// what bends it is a jump. Switches of both joints lie within.
    #[test]
    fn the_end_follows_the_start_without_jumps() {
        let p = all_terms();
        let span = Span { start_s: 0.0, end_s: 1.0, times_s: &[] };
        let dual: Parameters<Dual<4>> = p.lift();
        for start in [[3.0, 2.8, 0.1, -0.2], [0.05, -0.3, 0.0, 0.4], [2.0, 3.1, 4.0, -9.0]] {
            let at = |i: i32| {
                let mut x = start;
                x[1] += 1e-8 * f64::from(i);
                follow(&p, x, &span, 1.0, false, |_, _| {}).state
            };
            let exact: State<Dual<4>> = std::array::from_fn(|i| Dual::variable(start[i], i));
            let end = follow(&dual, exact, &span, Dual::constant(1.0), false, |_, _| {}).state;
            let ends: Vec<_> = (-200..=200).map(at).collect();
            for i in 0..4 {
                let grown = end[i].d[1].abs() + 1.0;
                let slope = (ends[400][i] - ends[0][i]) / 4e-6;
                assert!((slope - end[i].d[1]).abs() < 1e-4 * grown, "{start:?} {i}: {slope} {}", end[i].d[1]);
                // A step's own error is 6e-9; its change within 1e-8 of the start is far less.
                let bend =
                    ends.windows(3).map(|w| (w[2][i] - 2.0 * w[1][i] + w[0][i]).abs()).fold(0.0, f64::max);
                assert!(bend < 1e-12 * grown, "{start:?} {i}: {bend:e} of {grown}");
            }
        }
    }
}
