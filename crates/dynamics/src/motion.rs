//! Accelerations, normal forces and energies.
//!
//! Dry friction depends on the normal forces, these on the accelerations, and these on the friction. The two
//! equations are solved together: Newton's method in `f64`, then one step in the scalar wanted, which carries the
//! derivatives exactly (implicit function theorem).

use crate::parameters::{Field, Parameters};
use crate::scalar::Real;
use crate::terms::{Kind, Kinematics, TERMS};

/// `[phi1, phi2, w1, w2]`, rad and rad/s.
pub type State<S> = [S; 4];

/// How a joint's dry friction acts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Contact {
    /// Sliding with this sign (+1 or -1) of the joint's rate (`w1`, `w2 - w1`).
    Slip(f64),
    /// The smooth law: sign replaced by `tanh(rate / width)`, width in rad/s.
    Smooth(f64),
    /// Not sliding: the joint's rate stays as it is and the torque is whatever that needs. A pinned joint, too.
    Stuck,
}

/// What [`accelerations`] gives.
#[derive(Clone, Copy, Debug)]
pub struct Motion<S> {
    /// Accelerations of the links, rad/s^2.
    pub a: [S; 2],
    /// Magnitude of the normal forces at the joints, N (Eq. 34 with erratum 16).
    pub normal: [S; 2],
    /// Dry torque at each joint, N m: `sign * capacity` when sliding, the constraint's torque when stuck. The
    /// torque on link 1 is `-dry[0] + dry[1]`, on link 2 `-dry[1]`.
    pub dry: [S; 2],
    /// What dry friction can hold at each joint, N m: `r mu N + tau_c`.
    pub capacity: [S; 2],
}

/// Sines and cosines of a state, once.
#[derive(Clone, Copy)]
struct Trig<S> {
    s: [S; 2],
    c: [S; 2],
    s_d: S,
    c_d: S,
}

fn trig<S: Real>(x: &State<S>) -> Trig<S> {
    let (s1, c1) = x[0].sin_cos();
    let (s2, c2) = x[1].sin_cos();
    Trig { s: [s1, s2], c: [c1, c2], s_d: s1 * c2 - c1 * s2, c_d: c1 * c2 + s1 * s2 }
}

/// Added-mass constants `(A, B, C)` for an added inertia of one: `T = 1/2 (A c^2 w1^2 + 2 B c w1 w2 + C w2^2)`.
fn added<S: Real>(p: &Parameters<S>) -> [f64; 3] {
    let (a, b, l) = (p.fixed.lower_inner_m, p.fixed.lower_outer_m, p.fixed.l1_m);
    let second = (b.powi(3) - a.powi(3)) / 3.0;
    if second > 0.0 { [l * l * (b - a) / second, l * (b * b - a * a) / 2.0 / second, 1.0] } else { [0.0; 3] }
}

fn masses<S: Real>(p: &Parameters<S>, c_d: S) -> [S; 3] {
    let mut m11 = p.get(Field::Psi) * 2.0;
    let mut m12 = p.get(Field::Zeta) + p.get(Field::A3) * c_d;
    let mut m22 = p.get(Field::Lambda) * 2.0;
    let extra = p.get(Field::AddedInertia);
    if p.is_active(Field::AddedInertia) {
        let k = added(p);
        m11 += extra * c_d * c_d * k[0];
        m12 += extra * c_d * k[1];
        m22 += extra * k[2];
    }
    [m11, m12, m22]
}

/// The symmetric mass matrix `[m11, m12, m22]` at these angles, kg m^2 (`T = w' M w / 2`).
pub fn mass_matrix<S: Real>(p: &Parameters<S>, phi: [S; 2]) -> [S; 3] {
    let (_, c_d) = (phi[0] - phi[1]).sin_cos();
    masses(p, c_d)
}

/// Joint forces `[Tx1, Ty1, Tx2, Ty2]`, N (Eq. 33 corrected, erratum 15): affine in the accelerations.
fn joint_forces<S: Real>(p: &Parameters<S>, x: &State<S>, t: &Trig<S>, a: [S; 2]) -> [S; 4] {
    let g = p.fixed.g_m_s2;
    let (ga, gk) = (p.get(Field::Sigma) * inverse(g), p.get(Field::Kappa) * inverse(g));
    let b1 = p.fixed.m2_kg * p.fixed.l1_m;
    let f = |i: usize| t.c[i] * a[i] - t.s[i] * x[2 + i] * x[2 + i];
    let h = |i: usize| t.s[i] * a[i] + t.c[i] * x[2 + i] * x[2 + i];
    let (f1, f2, h1, h2) = (f(0), f(1), h(0), h(1));
    [
        ga * f1 + gk * f2,
        ga * h1 + gk * h2 + (p.fixed.m1_kg + p.fixed.m2_kg) * g,
        f1 * b1 + gk * f2,
        h1 * b1 + gk * h2 + p.fixed.m2_kg * g,
    ]
}

/// First moments of mass are weight moments over g; without gravity they are not known from them and taken as zero.
fn inverse(g: f64) -> f64 {
    if g > 0.0 { 1.0 / g } else { 0.0 }
}

fn norm<S: Real>(x: S, y: S) -> S {
    let n2 = x * x + y * y;
    if n2.value() > 0.0 { n2.sqrt() } else { S::constant(0.0) }
}

/// Normal forces at both joints for given accelerations, N (Eq. 34 with the constants of erratum 16).
pub fn normal_forces<S: Real>(p: &Parameters<S>, x: &State<S>, a: [S; 2]) -> [S; 2] {
    let t = joint_forces(p, x, &trig(x), a);
    [norm(t[0], t[1]), norm(t[2], t[3])]
}

/// Kinetic and potential energy, J (Eqs. 26-27; zero potential hanging along gravity).
pub fn energies<S: Real>(p: &Parameters<S>, x: &State<S>) -> [S; 2] {
    let m = mass_matrix(p, [x[0], x[1]]);
    let kinetic = m[0] * x[2] * x[2] * 0.5 + m[1] * x[2] * x[3] + m[2] * x[3] * x[3] * 0.5;
    let tilt = p.get(Field::Tilt);
    let (_, c1) = (x[0] - tilt).sin_cos();
    let (_, c2) = (x[1] - tilt).sin_cos();
    let potential = p.get(Field::Sigma) * (-c1 + 1.0) + p.get(Field::Kappa) * (-c2 + 1.0);
    [kinetic, potential]
}

fn signs<S: Real>(x: &State<S>, contact: [Contact; 2]) -> [S; 2] {
    let rate = [x[2], x[3] - x[2]];
    [0, 1].map(|j| match contact[j] {
        Contact::Slip(sign) => S::constant(sign),
        Contact::Smooth(width) => (rate[j] * (1.0 / width)).tanh(),
        Contact::Stuck => S::constant(0.0),
    })
}

/// Everything of the equations that does not depend on the accelerations, evaluated once per state.
struct Balance<'a, S> {
    p: &'a Parameters<S>,
    x: &'a State<S>,
    t: Trig<S>,
    m: [S; 3],
    /// Forces without the load-dependent ones.
    q: [S; 2],
    sign: [S; 2],
    contact: [Contact; 2],
    /// Power each term takes out, without the load-dependent ones.
    power: [S; TERMS.len()],
}

impl<'a, S: Real> Balance<'a, S> {
    fn new(p: &'a Parameters<S>, x: &'a State<S>, contact: [Contact; 2]) -> Self {
        let t = trig(x);
        let m = masses(p, t.c_d);
        let (w1, w2) = (x[2], x[3]);
        let a3s = p.get(Field::A3) * t.s_d;
        let mut down = t.s;
        if p.is_active(Field::Tilt) {
            let (st, ct) = p.get(Field::Tilt).sin_cos();
            down = [0, 1].map(|i| t.s[i] * ct - t.c[i] * st);
        }
        let mut q =
            [-(a3s * w2 * w2) - p.get(Field::Sigma) * down[0], a3s * w1 * w1 - p.get(Field::Kappa) * down[1]];
        if p.is_active(Field::AddedInertia) {
            let k = added(p);
            let s = p.get(Field::AddedInertia) * t.s_d;
            q[0] += s * (t.c_d * w1 * (w1 - w2 * 2.0) * k[0] - w2 * w2 * k[1]);
            q[1] += s * w1 * w1 * (t.c_d * k[0] + k[1]);
        }
        let sign = signs(x, contact);
        let zero = S::constant(0.0);
        let k = Kinematics { w: [w1, w2], cos_d: t.c_d, normal: [zero, zero], sign };
        let mut power = [zero; TERMS.len()];
        for (term, watt) in TERMS.iter().zip(&mut power) {
            // The load-dependent terms see no load here; they are added with the accelerations.
            if !p.is_active(term.field)
                || matches!(term.field, Field::Rmu1 | Field::Rmu2)
                || !matches!(term.kind, Kind::Drag | Kind::Dry | Kind::Drive)
            {
                continue;
            }
            let f = term.unit_force(&k, &p.fixed);
            let c = p.get(term.field);
            q[0] -= c * f[0];
            q[1] -= c * f[1];
            *watt = c * (f[0] * w1 + f[1] * w2);
        }
        Self { p, x, t, m, q, sign, contact, power }
    }

    /// Normal forces and dry torques that belong to these accelerations.
    fn motion(&self, a: [S; 2]) -> Motion<S> {
        let (r, normal) = self.imbalance(a);
        let capacity = [
            self.p.get(Field::Rmu1) * normal[0] + self.p.get(Field::TauC1),
            self.p.get(Field::Rmu2) * normal[1] + self.p.get(Field::TauC2),
        ];
        // Where a joint is stuck, the imbalance left is what its constraint must give.
        let sliding = |j: usize| self.sign[j] * capacity[j];
        let dry = match (self.contact[0] == Contact::Stuck, self.contact[1] == Contact::Stuck) {
            (false, false) => [sliding(0), sliding(1)],
            (true, false) => [-r[0], sliding(1)],
            (false, true) => [sliding(0), -r[1]],
            (true, true) => [-r[0] - r[1], -r[1]],
        };
        Motion { a, normal, dry, capacity }
    }

    /// Inertia minus force on both links, without constraint torques, and the normal forces.
    fn imbalance(&self, a: [S; 2]) -> ([S; 2], [S; 2]) {
        let mut r = [
            self.m[0] * a[0] + self.m[1] * a[1] - self.q[0],
            self.m[1] * a[0] + self.m[2] * a[1] - self.q[1],
        ];
        let t = joint_forces(self.p, self.x, &self.t, a);
        let n = [norm(t[0], t[1]), norm(t[2], t[3])];
        let load =
            [self.p.get(Field::Rmu1) * n[0] * self.sign[0], self.p.get(Field::Rmu2) * n[1] * self.sign[1]];
        r[0] += load[0] - load[1];
        r[1] += load[1];
        (r, n)
    }

    /// The two equations that determine the accelerations, given the imbalance.
    fn equations(&self, r: [S; 2], a: [S; 2]) -> [S; 2] {
        match (self.contact[0] == Contact::Stuck, self.contact[1] == Contact::Stuck) {
            (false, false) => r,
            (true, false) => [a[0], r[1]],
            (false, true) => [r[0] + r[1], a[1] - a[0]],
            (true, true) => [a[0], a[1] - a[0]],
        }
    }
}

impl Balance<'_, f64> {
    /// Derivative of [`Balance::equations`] with respect to the accelerations, `[d1/da1, d1/da2, d2/da1, d2/da2]`.
    fn slope(&self, a: [f64; 2]) -> [f64; 4] {
        let f = joint_forces(self.p, self.x, &self.t, a);
        let (t, p) = (&self.t, self.p);
        let g = p.fixed.g_m_s2;
        let (ga, gk) = (p.get(Field::Sigma) * inverse(g), p.get(Field::Kappa) * inverse(g));
        let b1 = p.fixed.m2_kg * p.fixed.l1_m;
        let of = |x: f64, y: f64, k1: f64| {
            let n = x.hypot(y);
            if n > 0.0 {
                [(x * t.c[0] + y * t.s[0]) * k1 / n, (x * t.c[1] + y * t.s[1]) * gk / n]
            } else {
                [0.0; 2]
            }
        };
        let (n1, n2) = (of(f[0], f[1], ga), of(f[2], f[3], b1));
        let (c1, c2) = (p.get(Field::Rmu1) * self.sign[0], p.get(Field::Rmu2) * self.sign[1]);
        let row1 = [0, 1].map(|i| self.m[i] + c1 * n1[i] - c2 * n2[i]);
        let row2 = [0, 1].map(|i| self.m[1 + i] + c2 * n2[i]);
        match (self.contact[0] == Contact::Stuck, self.contact[1] == Contact::Stuck) {
            (false, false) => [row1[0], row1[1], row2[0], row2[1]],
            (true, false) => [1.0, 0.0, row2[0], row2[1]],
            (false, true) => [row1[0] + row2[0], row1[1] + row2[1], -1.0, 1.0],
            (true, true) => [1.0, 0.0, -1.0, 1.0],
        }
    }

    fn solve(&self) -> [f64; 2] {
        let mut a = [0.0; 2];
        // Without friction by load the equations are linear, and Newton's first step is the solution.
        let linear = !self.p.is_active(Field::Rmu1) && !self.p.is_active(Field::Rmu2);
        for _ in 0..50 {
            let (r, _) = self.imbalance(a);
            let e = self.equations(r, a);
            let step = solve2(self.slope(a), e);
            a = [a[0] - step[0], a[1] - step[1]];
            if linear {
                break;
            }
            // Newton converges quadratically: after a step of 1e-7 relative the next would be below rounding.
            if step[0].abs() + step[1].abs() <= 1e-7 * (1.0 + a[0].abs() + a[1].abs()) {
                break;
            }
        }
        a
    }
}

#[inline]
fn solve2<S: Real>(k: [f64; 4], e: [S; 2]) -> [S; 2] {
    let inverse = 1.0 / (k[0] * k[3] - k[1] * k[2]);
    [(e[0] * k[3] - e[1] * k[1]) * inverse, (e[1] * k[0] - e[0] * k[2]) * inverse]
}

/// Accelerations, normal forces and dry torques in state `x`, with each joint's dry friction as `contact` says.
///
/// Solved to rounding for the implicit normal forces. In a scalar with derivatives these are exact. The mass matrix
/// must be positive definite (checked where parameters come in); then the solution is finite for finite input.
pub fn accelerations<S: Real>(p: &Parameters<S>, x: &State<S>, contact: [Contact; 2]) -> Motion<S> {
    let (pv, xv) = (p.value(), x.map(|v| v.value()));
    let values = Balance::new(&pv, &xv, contact);
    let start = values.solve();
    let balance = Balance::new(p, x, contact);
    let mut a = start.map(S::constant);
    let (r, _) = balance.imbalance(a);
    let step = solve2(values.slope(start), balance.equations(r, a));
    a = [a[0] - step[0], a[1] - step[1]];
    balance.motion(a)
}

/// [`accelerations`] and [`dissipation`] in plain numbers and one pass: what a simulation evaluates at every stage.
#[must_use]
pub fn flow(p: &Parameters<f64>, x: &State<f64>, contact: [Contact; 2]) -> (Motion<f64>, [f64; TERMS.len()]) {
    let balance = Balance::new(p, x, contact);
    let motion = balance.motion(balance.solve());
    let mut power = balance.power;
    let rate = [x[2], x[3] - x[2]];
    for (term, watt) in TERMS.iter().zip(&mut power) {
        match term.field {
            Field::Rmu1 => *watt = p.get(Field::Rmu1) * motion.normal[0] * balance.sign[0] * rate[0],
            Field::Rmu2 => *watt = p.get(Field::Rmu2) * motion.normal[1] * balance.sign[1] * rate[1],
            _ => {}
        }
    }
    (motion, power)
}

/// Power each row of [`TERMS`] takes out of the motion, W; dry terms of a stuck joint take none. Their sum is
/// `-dE/dt`.
pub fn dissipation<S: Real>(
    p: &Parameters<S>,
    x: &State<S>,
    contact: [Contact; 2],
    normal: [S; 2],
) -> [S; TERMS.len()] {
    let (_, cos_d) = (x[0] - x[1]).sin_cos();
    let k = Kinematics { w: [x[2], x[3]], cos_d, normal, sign: signs(x, contact) };
    std::array::from_fn(|i| p.get(TERMS[i].field) * TERMS[i].unit_power(&k, &p.fixed))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::Fixed;
    use crate::scalar::Dual;

    fn pendulum() -> Parameters<f64> {
        let fixed = Fixed {
            m1_kg: 0.3057,
            m2_kg: 0.1225,
            l1_m: 0.1719,
            g_m_s2: 9.81,
            lower_inner_m: -0.02,
            lower_outer_m: 0.19,
        };
        let mut p = Parameters::zero(fixed);
        for (field, value) in [
            (Field::Psi, 3.431e-3),
            (Field::Lambda, 4.193e-4),
            (Field::Zeta, 1.86e-8),
            (Field::A3, 1.4257e-3),
            (Field::Sigma, 0.4502),
            (Field::Kappa, 0.08136),
            (Field::MuV1, 1.76e-5),
            (Field::MuV2, 5.08e-6),
            (Field::MuQ1, 1.43e-5),
            (Field::MuQ2, 3e-7),
            (Field::Rmu1, 4.5e-5),
            (Field::Rmu2, 3.7e-5),
            (Field::TauC1, 1e-4),
            (Field::TauC2, 2e-5),
            (Field::StripDrag, 1e-6),
            (Field::AddedInertia, 1e-5),
            (Field::Tilt, 0.01),
            (Field::Offset1, 1e-5),
            (Field::Offset2, -2e-5),
        ] {
            p.set(field, value);
        }
        p
    }

    const SLIPS: [[Contact; 2]; 4] = [
        [Contact::Slip(1.0), Contact::Slip(-1.0)],
        [Contact::Smooth(0.3), Contact::Slip(1.0)],
        [Contact::Slip(-1.0), Contact::Stuck],
        [Contact::Stuck, Contact::Slip(1.0)],
    ];

    /// A state that the contact allows: a stuck joint does not move.
    fn state(contact: [Contact; 2]) -> State<f64> {
        let mut x = [0.7, -1.9, 3.1, -8.2];
        if contact[0] == Contact::Stuck {
            x[2] = 0.0;
        }
        if contact[1] == Contact::Stuck {
            x[3] = x[2];
        }
        x
    }

    #[test]
    fn power_balances_in_every_contact() {
        let p = pendulum();
        for contact in SLIPS {
            let x = state(contact);
            let motion = accelerations(&p, &x, contact);
            // dE/dt by the chain rule in one direction: time
            let rates = [x[2], x[3], motion.a[0], motion.a[1]];
            let moving: State<Dual<1>> = std::array::from_fn(|i| Dual { v: x[i], d: [rates[i]] });
            let [kinetic, potential] = energies(&p.lift(), &moving);
            let gain = kinetic.d[0] + potential.d[0];
            let loss: f64 = dissipation(&p, &x, contact, motion.normal).iter().sum();
            let scale = x[3].abs() * (p.get(Field::Kappa) + p.get(Field::Sigma));
            // rounding of a few dozen operations of size `scale`
            assert!((gain + loss).abs() < 1e-13 * scale, "{contact:?}: {gain} {loss}");
        }
    }

    #[test]
    fn derivatives_pass_through_the_implicit_normal_forces() {
        let mut p = pendulum();
        // friction large enough that its implicitness matters in the first digit
        p.set(Field::Rmu1, 4e-3);
        p.set(Field::Rmu2, 2e-3);
        for contact in SLIPS {
            let x = state(contact);
            let loads =
                [Field::Rmu1, Field::Psi, Field::Kappa, Field::StripDrag, Field::Tilt, Field::AddedInertia];
            let mut dual: Parameters<Dual<10>> = p.lift();
            for (i, field) in loads.into_iter().enumerate() {
                dual.set(field, Dual::variable(p.get(field), 4 + i));
            }
            let xd: State<Dual<10>> = std::array::from_fn(|i| Dual::variable(x[i], i));
            let exact = accelerations(&dual, &xd, contact).a;
            for i in 0..10 {
                let size = if i < 4 { 1.0 } else { p.get(loads[i - 4]) };
                let h = 1e-5 * size;
                let at = |s: f64| {
                    let (mut q, mut y) = (p, x);
                    if i < 4 {
                        y[i] += s * h
                    } else {
                        q.set(loads[i - 4], size + s * h)
                    }
                    accelerations(&q, &y, contact).a
                };
                let (up, down) = (at(1.0), at(-1.0));
                for link in 0..2 {
                    let difference = (up[link] - down[link]) / (2.0 * h);
                    let error = (exact[link].d[i] - difference).abs() * size;
                    // central differences: h^2 of third derivatives (up to 1e3 here) and rounding 1e-13/h
                    assert!(
                        error < 3e-6,
                        "{contact:?} direction {i} link {link}: {} {difference}",
                        exact[link].d[i]
                    );
                }
            }
        }
    }

    #[test]
    fn a_stuck_joint_stays_and_its_torque_is_the_missing_one() {
        let p = pendulum();
        for contact in
            [[Contact::Stuck, Contact::Slip(1.0)], [Contact::Slip(1.0), Contact::Stuck], [Contact::Stuck; 2]]
        {
            let x = state(contact);
            let m = accelerations(&p, &x, contact);
            if contact[0] == Contact::Stuck {
                assert!(m.a[0].abs() < 1e-12);
            }
            if contact[1] == Contact::Stuck {
                assert!((m.a[1] - m.a[0]).abs() < 1e-12);
            }
            // the same torques applied as drives to a frictionless pendulum give the same motion
            let mut free = p;
            for field in [Field::Rmu1, Field::Rmu2, Field::TauC1, Field::TauC2] {
                free.set(field, 0.0);
            }
            free.set(Field::Offset1, p.get(Field::Offset1) - m.dry[0]);
            free.set(Field::Offset2, p.get(Field::Offset2) - m.dry[1]);
            let b = accelerations(&free, &x, [Contact::Slip(1.0); 2]).a;
            assert!((b[0] - m.a[0]).abs() + (b[1] - m.a[1]).abs() < 1e-10, "{contact:?}");
        }
    }

    #[test]
    fn strip_drag_with_the_elbow_at_rest_is_its_coefficient() {
        let mut p = Parameters::zero(pendulum().fixed);
        p.set(Field::StripDrag, 2.5e-6);
        let row = TERMS.iter().find(|t| t.field == Field::StripDrag).copied();
        let row = row.ok_or("no row").unwrap_or(TERMS[0]);
        let k = Kinematics { w: [0.0, -7.0], cos_d: 0.4, normal: [0.0; 2], sign: [0.0; 2] };
        let f = row.unit_force(&k, &p.fixed);
        assert!((f[1] + 49.0).abs() < 1e-12, "{f:?}");
        // split integral against a sum over many elements
        let k = Kinematics { w: [5.0, -7.0], ..k };
        let f = row.unit_force(&k, &p.fixed);
        let (a, b, n) = (p.fixed.lower_inner_m, p.fixed.lower_outer_m, 200_000);
        let scale = 4.0 / (b.powi(4) + a.powi(4));
        let (mut force, mut moment) = (0.0, 0.0);
        for i in 0..n {
            let s = a + (b - a) * (f64::from(i) + 0.5) / f64::from(n);
            let v = p.fixed.l1_m * k.w[0] * k.cos_d + s * k.w[1];
            force += v.abs() * v * (b - a) / f64::from(n);
            moment += s * v.abs() * v * (b - a) / f64::from(n);
        }
        assert!((f[0] - force * p.fixed.l1_m * 0.4 * scale).abs() < 1e-8);
        assert!((f[1] - moment * scale).abs() < 1e-8);
    }
}
