//! Lists the laws in one table: each law of damping or driving with its generalised forces, its power and its parameter.
//!
//! Every force is linear in its coefficient: `Q = -coefficient * unit_force`, and the power it takes out of the
//! motion is `coefficient * unit_force · w`. A moment of joint 2 acts on both links (erratum 13), which the unit
//! force's two components carry. Added mass and tilt change inertia and gravity instead; they are in the table with
//! their kind, and [`crate::motion`] applies them.

use crate::parameters::{Field, Fixed};
use crate::scalar::Real;

/// What a term does to the equations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Takes energy out, smooth in the state.
    Drag,
    /// Takes energy out with the sign of the sliding rate; may stick.
    Dry,
    /// Puts energy in or takes it out.
    Drive,
    /// Changes the inertia.
    Inertial,
    /// Changes the potential energy.
    Gravity,
}

/// Where a term acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Joint 1 and link 1.
    Upper,
    /// Joint 2 and link 2.
    Lower,
    /// Both.
    Both,
}

/// The law a term belongs to, the unit in which shares are counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// `mu_v * rate`, in the bearing.
    Viscous,
    /// `mu_q |w| w`, in the air.
    Quadratic,
    /// `r mu N sgn(rate)`, in the bearing.
    Load,
    /// `tau_c sgn(rate)`, in the bearing.
    Constant,
    /// Strip theory in the true relative wind.
    Strip,
    /// Air moving with the link.
    AddedMass,
    /// Direction of gravity.
    Tilt,
    /// A driving torque.
    Offset,
}

/// One row of the table.
#[derive(Clone, Copy, Debug)]
pub struct Term {
    /// Its coefficient.
    pub field: Field,
    /// Its law.
    pub law: Law,
    /// What it does.
    pub kind: Kind,
    /// Where.
    pub place: Place,
    /// Source in the paper, or what it stands for.
    pub source: &'static str,
}

const fn term(field: Field, law: Law, kind: Kind, place: Place, source: &'static str) -> Term {
    Term { field, law, kind, place, source }
}

/// Every term, in the order of works and fits.
pub const TERMS: [Term; 13] = [
    term(Field::MuV1, Law::Viscous, Kind::Drag, Place::Upper, "Table 5, Eq. 37"),
    term(Field::MuV2, Law::Viscous, Kind::Drag, Place::Lower, "Table 5, Eq. 37, relative rate"),
    term(Field::MuQ1, Law::Quadratic, Kind::Drag, Place::Upper, "Table 5 with |w| w, Eq. 38"),
    term(Field::MuQ2, Law::Quadratic, Kind::Drag, Place::Lower, "Table 5 with |w| w, Eq. 38"),
    term(Field::Rmu1, Law::Load, Kind::Dry, Place::Upper, "Eqs. 33-36 corrected"),
    term(Field::Rmu2, Law::Load, Kind::Dry, Place::Lower, "Eqs. 33-36 corrected, relative rate"),
    term(Field::TauC1, Law::Constant, Kind::Dry, Place::Upper, "preload: load-independent dry torque"),
    term(Field::TauC2, Law::Constant, Kind::Dry, Place::Lower, "preload: load-independent dry torque"),
    term(Field::StripDrag, Law::Strip, Kind::Drag, Place::Both, "strip theory, elbow's motion included"),
    term(Field::Offset1, Law::Offset, Kind::Drive, Place::Upper, "constant torque on link 1"),
    term(Field::Offset2, Law::Offset, Kind::Drive, Place::Lower, "constant torque between the links"),
    term(Field::AddedInertia, Law::AddedMass, Kind::Inertial, Place::Both, "air carried by the strips"),
    term(Field::Tilt, Law::Tilt, Kind::Gravity, Place::Both, "direction of gravity in the plane"),
];

/// What the forces are functions of.
#[derive(Clone, Copy, Debug)]
pub struct Kinematics<S> {
    /// Rates of the links, rad/s.
    pub w: [S; 2],
    /// `cos(phi1 - phi2)`.
    pub cos_d: S,
    /// Magnitude of the normal forces at the joints, N.
    pub normal: [S; 2],
    /// Sign of the dry friction at the joints, in [-1, 1]; zero where stuck (then the constraint gives the torque).
    pub sign: [S; 2],
}

impl Term {
    /// Generalised forces on the two links for a coefficient of one, with opposite sign: `Q = -c * unit_force`.
    /// Zero for terms that are not forces.
    #[inline]
    pub fn unit_force<S: Real>(&self, k: &Kinematics<S>, fixed: &Fixed) -> [S; 2] {
        let zero = S::constant(0.0);
        let joint2 = |m: S| [-m, m];
        match self.field {
            Field::MuV1 => [k.w[0], zero],
            Field::MuV2 => joint2(k.w[1] - k.w[0]),
            Field::MuQ1 => [k.w[0].abs() * k.w[0], zero],
            Field::MuQ2 => [zero, k.w[1].abs() * k.w[1]],
            Field::Rmu1 => [k.normal[0] * k.sign[0], zero],
            Field::Rmu2 => joint2(k.normal[1] * k.sign[1]),
            Field::TauC1 => [k.sign[0], zero],
            Field::TauC2 => joint2(k.sign[1]),
            Field::StripDrag => strip_force(k, fixed),
            Field::Offset1 => [S::constant(-1.0), zero],
            Field::Offset2 => joint2(S::constant(-1.0)),
            _ => [zero, zero],
        }
    }

    /// Power the term takes out for a coefficient of one, W per unit (paper Eqs. 35, 37, 38).
    #[inline]
    pub fn unit_power<S: Real>(&self, k: &Kinematics<S>, fixed: &Fixed) -> S {
        let f = self.unit_force(k, fixed);
        f[0] * k.w[0] + f[1] * k.w[1]
    }
}

/// Strip theory: the element at distance `s` along the lower link moves with the normal velocity
/// `v = l1 w1 cos d + s w2`, and its drag is `c |v| v ds`. `c` is scaled so that the coefficient is that of
/// `|w2| w2` when the elbow rests. Exact: the integral is split where `v` changes sign.
fn strip_force<S: Real>(k: &Kinematics<S>, fixed: &Fixed) -> [S; 2] {
    let (inner, outer) = (fixed.lower_inner_m, fixed.lower_outer_m);
    let scale = 4.0 / (outer.powi(3) * outer.abs() - inner.powi(3) * inner.abs());
    let arm = k.cos_d * fixed.l1_m;
    let u = arm * k.w[0];
    let w = k.w[1];
    // Moments of |v| v of order 0 and 1 over [a, b], where v does not change sign.
    let part = |a: f64, b: f64, sign: f64| {
        let m: [f64; 4] =
            [b - a, (b * b - a * a) / 2.0, (b.powi(3) - a.powi(3)) / 3.0, (b.powi(4) - a.powi(4)) / 4.0];
        let uw = u * w * 2.0;
        let (uu, ww) = (u * u, w * w);
        [(uu * m[0] + uw * m[1] + ww * m[2]) * sign, (uu * m[1] + uw * m[2] + ww * m[3]) * sign]
    };
    let at = |s: f64| u.value() + s * w.value();
    let (v_in, v_out) = (at(inner), at(outer));
    let [force, moment] = if v_in * v_out < 0.0 {
        // v is zero at the split, so the split's own derivative does not enter.
        let split = inner + (outer - inner) * v_in / (v_in - v_out);
        let (p, q) = (part(inner, split, v_in.signum()), part(split, outer, v_out.signum()));
        [p[0] + q[0], p[1] + q[1]]
    } else {
        let sign = if v_in + v_out < 0.0 { -1.0 } else { 1.0 };
        part(inner, outer, sign)
    };
    [force * arm * scale, moment * scale]
}
