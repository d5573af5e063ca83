//! Solves the two equations of motion at one state: what does not depend on the accelerations is evaluated once.

use crate::parameters::{Field, Parameters};
use crate::scalar::Real;
use crate::state::{Contact, Motion, State};
use crate::terms::{Kinematics, TERMS};

/// Sines and cosines of a state, once.
#[derive(Clone, Copy)]
pub(crate) struct Trig<S> {
    s: [S; 2],
    c: [S; 2],
    s_d: S,
    c_d: S,
}

pub(crate) fn trig<S: Real>(x: &State<S>) -> Trig<S> {
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

pub(crate) fn masses<S: Real>(p: &Parameters<S>, c_d: S) -> [S; 3] {
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
/// Joint forces `[Tx1, Ty1, Tx2, Ty2]`, N (Eq. 33 corrected, erratum 15): affine in the accelerations.
pub(crate) fn joint_forces<S: Real>(p: &Parameters<S>, x: &State<S>, t: &Trig<S>, a: [S; 2]) -> [S; 4] {
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

pub(crate) fn norm<S: Real>(x: S, y: S) -> S {
    let n2 = x * x + y * y;
    if n2.value() > 0.0 { n2.sqrt() } else { S::constant(0.0) }
}

pub(crate) fn signs<S: Real>(x: &State<S>, contact: [Contact; 2]) -> [S; 2] {
    let rate = [x[2], x[3] - x[2]];
    [0, 1].map(|j| match contact[j] {
        Contact::Slip(sign) => S::constant(sign),
        Contact::Smooth(width) => (rate[j] * (1.0 / width)).tanh(),
        Contact::Stuck => S::constant(0.0),
    })
}

/// Everything of the equations that does not depend on the accelerations, evaluated once per state.
pub(crate) struct Balance<'a, S> {
    p: &'a Parameters<S>,
    x: &'a State<S>,
    t: Trig<S>,
    m: [S; 3],
    /// Forces without the load-dependent ones.
    q: [S; 2],
    pub(crate) sign: [S; 2],
    contact: [Contact; 2],
    /// Power each term takes out, without the load-dependent ones.
    pub(crate) power: [S; TERMS.len()],
}

impl<'a, S: Real> Balance<'a, S> {
    pub(crate) fn new(p: &'a Parameters<S>, x: &'a State<S>, contact: [Contact; 2]) -> Self {
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
            if !p.is_active(term.field) || matches!(term.field, Field::Rmu1 | Field::Rmu2) || !term.is_force()
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
    pub(crate) fn motion(&self, a: [S; 2]) -> Motion<S> {
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
    pub(crate) fn imbalance(&self, a: [S; 2]) -> ([S; 2], [S; 2]) {
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
    pub(crate) fn equations(&self, r: [S; 2], a: [S; 2]) -> [S; 2] {
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
    pub(crate) fn slope(&self, a: [f64; 2]) -> [f64; 4] {
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

    /// Derivative of [`Balance::equations`] with respect to one parameter, the accelerations held.
    pub(crate) fn by_parameter(&self, field: Field, a: [f64; 2]) -> [f64; 2] {
        let (p, x, t) = (self.p, self.x, &self.t);
        let [w1, w2] = [x[2], x[3]];
        let towards = |i: usize| {
            let tilt = p.get(Field::Tilt);
            (t.s[i] * tilt.cos() - t.c[i] * tilt.sin(), t.c[i] * tilt.cos() + t.s[i] * tilt.sin())
        };
        let forces = joint_forces(p, x, t, a);
        let normal = [norm(forces[0], forces[1]), norm(forces[2], forces[3])];
        // Derivative of the normal force at a joint when the moment of mass of link `i` grows by `1/g`.
        let load = |joint: usize, i: usize| {
            let [tx, ty] = [forces[2 * joint], forces[2 * joint + 1]];
            let (f, h) =
                (t.c[i] * a[i] - t.s[i] * x[2 + i].powi(2), t.s[i] * a[i] + t.c[i] * x[2 + i].powi(2));
            let grip = p.get(if joint == 0 { Field::Rmu1 } else { Field::Rmu2 }) * self.sign[joint];
            let per = grip * inverse(p.fixed.g_m_s2);
            if normal[joint] > 0.0 { per * (tx * f + ty * h) / normal[joint] } else { 0.0 }
        };
        let r = match field {
            Field::Psi => [2.0 * a[0], 0.0],
            Field::Lambda => [0.0, 2.0 * a[1]],
            Field::Zeta => [a[1], a[0]],
            Field::A3 => [t.c_d * a[1] + t.s_d * w2 * w2, t.c_d * a[0] - t.s_d * w1 * w1],
            Field::Sigma => [towards(0).0 + load(0, 0), 0.0],
            Field::Kappa => [load(0, 1) - load(1, 1), towards(1).0 + load(1, 1)],
            Field::Tilt => [-p.get(Field::Sigma) * towards(0).1, -p.get(Field::Kappa) * towards(1).1],
            Field::AddedInertia => {
                let [k0, k1, k2] = added(p);
                let c = t.c_d;
                [
                    k0 * c * c * a[0] + k1 * c * a[1]
                        - t.s_d * (c * w1 * (w1 - 2.0 * w2) * k0 - w2 * w2 * k1),
                    k1 * c * a[0] + k2 * a[1] - t.s_d * w1 * w1 * (c * k0 + k1),
                ]
            }
            _ => {
                let k = Kinematics { w: [w1, w2], cos_d: t.c_d, normal, sign: self.sign };
                let row = TERMS.iter().find(|term| term.field == field);
                row.map_or([0.0; 2], |term| term.unit_force(&k, &p.fixed))
            }
        };
        match (self.contact[0] == Contact::Stuck, self.contact[1] == Contact::Stuck) {
            (false, false) => r,
            (true, false) => [0.0, r[1]],
            (false, true) => [r[0] + r[1], 0.0],
            (true, true) => [0.0; 2],
        }
    }

    pub(crate) fn solve(&self) -> [f64; 2] {
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
pub(crate) fn solve2<S: Real>(k: [f64; 4], e: [S; 2]) -> [S; 2] {
    let inverse = 1.0 / (k[0] * k[3] - k[1] * k[2]);
    [(e[0] * k[3] - e[1] * k[1]) * inverse, (e[1] * k[0] - e[0] * k[2]) * inverse]
}
