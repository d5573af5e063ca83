//! Computes accelerations, normal forces and energies of a state.
//!
//! Dry friction depends on the normal forces, these on the accelerations, and these on the friction. The two
//! equations are solved together: Newton's method in `f64`, then one step in the scalar wanted, which carries the
//! derivatives exactly (implicit function theorem).

use crate::balance::{Balance, joint_forces, masses, norm, signs, solve2, trig};
use crate::parameters::{Field, Parameters};
use crate::scalar::{Dual, Real};
use crate::state::{Contact, Motion, State};
use crate::terms::{Kinematics, TERMS};

/// The symmetric mass matrix `[m11, m12, m22]` at these angles, kg m^2 (`T = w' M w / 2`).
pub fn mass_matrix<S: Real>(p: &Parameters<S>, phi: [S; 2]) -> [S; 3] {
    let (_, c_d) = (phi[0] - phi[1]).sin_cos();
    masses(p, c_d)
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

/// The parameters in a scalar, with what [`Flow::accelerations`] needs of them once.
pub struct Flow<'a, S> {
    p: &'a Parameters<S>,
    values: Parameters<f64>,
    lifted: Parameters<Dual<4>>,
    varied: Vec<Field>,
}

impl<'a, S: Real> Flow<'a, S> {
    /// Looks up which parameters carry derivatives.
    pub fn new(p: &'a Parameters<S>) -> Self {
        let values = p.value();
        let carries = |field: &Field| {
            let parameter = p.get(*field);
            S::DIRECTIONS > 0 && !(parameter - S::constant(parameter.value())).vanishes()
        };
        let varied = Field::ALL.into_iter().filter(carries).collect();
        Self { p, lifted: values.lift(), values, varied }
    }

    /// The parameters without derivatives.
    #[must_use]
    pub fn values(&self) -> &Parameters<f64> {
        &self.values
    }

    /// The accelerations of [`accelerations`], in a fraction of its time for many directions: the derivatives with
    /// respect to the four state variables and each parameter are found first, and the chain rule does the rest.
    #[must_use]
    pub fn accelerations(&self, x: &State<S>, contact: [Contact; 2]) -> [S; 2] {
        let at = x.map(|v| v.value());
        let balance = Balance::new(&self.values, &at, contact);
        let start = balance.solve();
        let mut a = start.map(S::constant);
        if S::DIRECTIONS == 0 {
            return a;
        }
        let slope = balance.slope(start);
        let state = std::array::from_fn(|i| Dual::<4>::variable(at[i], i));
        let local = Balance::new(&self.lifted, &state, contact);
        let held = start.map(Dual::constant);
        let (r, _) = local.imbalance(held);
        let by_state = solve2(slope, local.equations(r, held));
        for (link, out) in a.iter_mut().enumerate() {
            for (i, variable) in x.iter().enumerate() {
                out.carry(-by_state[link].d[i], variable);
            }
        }
        for field in &self.varied {
            let by = solve2(slope, balance.by_parameter(*field, start));
            for (link, out) in a.iter_mut().enumerate() {
                out.carry(-by[link], &self.p.get(*field));
            }
        }
        a
    }
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
    use crate::fixture::all_terms;

    const SLIPS: [[Contact; 2]; 4] = [
        [Contact::Slip(1.0), Contact::Slip(-1.0)],
        [Contact::Smooth(0.3), Contact::Slip(1.0)],
        [Contact::Slip(-1.0), Contact::Stuck],
        [Contact::Stuck, Contact::Slip(1.0)],
    ];

    /// Every term, and friction large enough that its implicitness matters in the first digit.
    fn heavy_friction() -> Parameters<f64> {
        let mut p = all_terms();
        p.set(Field::Rmu1, 4e-3);
        p.set(Field::Rmu2, 2e-3);
        p
    }

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
        let p = all_terms();
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
        let p = heavy_friction();
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

    /// The two ways to the derivatives are written apart; they must agree to rounding.
    #[test]
    fn the_chain_rule_gives_the_same_derivatives() {
        let p = heavy_friction();
        const N: usize = 4 + Field::COUNT;
        let mut dual: Parameters<Dual<N>> = p.lift();
        for (i, field) in Field::ALL.into_iter().enumerate() {
            dual.set(field, Dual::variable(p.get(field), 4 + i));
        }
        for contact in SLIPS.into_iter().chain([[Contact::Stuck; 2]]) {
            let x = state(contact);
            let xd: State<Dual<N>> = std::array::from_fn(|i| Dual::variable(x[i], i));
            let (whole, chained) =
                (accelerations(&dual, &xd, contact).a, Flow::new(&dual).accelerations(&xd, contact));
            for link in 0..2 {
                assert!((whole[link].v - chained[link].v).abs() < 1e-12 * (1.0 + whole[link].v.abs()));
                for i in 0..N {
                    let (w, c) = (whole[link].d[i], chained[link].d[i]);
                    assert!((w - c).abs() < 1e-9 * (1.0 + w.abs()), "{contact:?} {link} {i}: {w} {c}");
                }
            }
        }
    }

    #[test]
    fn a_stuck_joint_stays_and_its_torque_is_the_missing_one() {
        let p = all_terms();
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
        let mut p = Parameters::zero(all_terms().fixed);
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
