//! Lists the laws in one table: each law of damping or driving with its generalised forces, its power and its parameter.
//!
//! Every force is linear in its coefficient: `Q = -coefficient * unit_force`, and the power it takes out of the
//! motion is `coefficient * unit_force · w`. A moment of joint 2 acts on both links (erratum 13), which the unit
//! force's two components carry. Added mass and tilt change inertia and gravity instead; they are in the table with
//! their kind, and [`crate::motion`] applies them.

use crate::parameters::{Field, Fixed};
use crate::scalar::Real;

/// Role of a term in the equations.
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

/// The joint whose share a term counts in, with the link that hangs from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Joint 1 and link 1.
    Upper,
    /// Joint 2 and link 2.
    Lower,
    /// Both.
    Both,
}

impl Place {
    /// The word in files and in Python.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Place::Upper => "upper",
            Place::Lower => "lower",
            Place::Both => "both",
        }
    }
}

/// The law a term belongs to.
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

impl Law {
    /// The word in files and in Python.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Law::Viscous => "viscous",
            Law::Quadratic => "quadratic",
            Law::Load => "load",
            Law::Constant => "constant",
            Law::Strip => "strip",
            Law::AddedMass => "added mass",
            Law::Tilt => "tilt",
            Law::Offset => "offset",
        }
    }

    /// The share of the dissipated energy in which the paper would count it: viscous, quadratic (here all drag of the
    /// air) or Coulomb (here all dry friction); `None` for what dissipates nothing.
    #[must_use]
    pub const fn share(self) -> Option<&'static str> {
        match self {
            Law::Viscous => Some("viscous"),
            Law::Quadratic | Law::Strip => Some("drag"),
            Law::Load | Law::Constant => Some("dry"),
            Law::AddedMass | Law::Tilt | Law::Offset => None,
        }
    }

    /// Whether the law is one of the paper's three (Table 5 corrected).
    #[must_use]
    pub const fn is_of_the_paper(self) -> bool {
        matches!(self, Law::Viscous | Law::Quadratic | Law::Load)
    }
}

/// One row of the table.
#[derive(Clone, Copy, Debug)]
pub struct Term {
    /// Its coefficient.
    pub field: Field,
    /// Its law.
    pub law: Law,
    /// The term's effect on energy.
    pub kind: Kind,
    /// Where.
    pub place: Place,
    /// Words that people read for its coefficient.
    pub words: &'static str,
    /// Source in the paper, or what it stands for.
    pub source: &'static str,
}

const fn term(
    field: Field,
    law: Law,
    kind: Kind,
    place: Place,
    words: &'static str,
    source: &'static str,
) -> Term {
    Term { field, law, kind, place, words, source }
}

/// Every term, in the order of works and fits.
#[rustfmt::skip]
pub const TERMS: [Term; 13] = {
    use {Field as F, Kind as K, Law as L, Place as P};
    [
        term(F::MuV1, L::Viscous, K::Drag, P::Upper, "viscous friction, upper joint", "Table 5, Eq. 37"),
        term(F::MuV2, L::Viscous, K::Drag, P::Lower, "viscous friction, lower joint", "Table 5, Eq. 37, relative rate"),
        term(F::MuQ1, L::Quadratic, K::Drag, P::Upper, "air drag, upper link", "Table 5 with |w| w, Eq. 38"),
        term(F::MuQ2, L::Quadratic, K::Drag, P::Lower, "air drag, lower link", "Table 5 with |w| w, Eq. 38"),
        term(F::Rmu1, L::Load, K::Dry, P::Upper, "dry friction with the load, upper joint", "Eqs. 33-36 corrected"),
        term(F::Rmu2, L::Load, K::Dry, P::Lower, "dry friction with the load, lower joint",
            "Eqs. 33-36 corrected, relative rate"),
        term(F::TauC1, L::Constant, K::Dry, P::Upper, "constant dry torque, upper joint",
            "preload: load-independent dry torque"),
        term(F::TauC2, L::Constant, K::Dry, P::Lower, "constant dry torque, lower joint",
            "preload: load-independent dry torque"),
        term(F::StripDrag, L::Strip, K::Drag, P::Lower, "air drag, lower link in its own wind",
            "strip theory, elbow's motion included"),
        term(F::Offset1, L::Offset, K::Drive, P::Upper, "driving torque, upper link", "constant torque on link 1"),
        term(F::Offset2, L::Offset, K::Drive, P::Lower, "driving torque, lower joint",
            "constant torque between the links"),
        term(F::AddedInertia, L::AddedMass, K::Inertial, P::Lower, "inertia of the air that moves with the lower link",
            "air carried by the strips"),
        term(F::Tilt, L::Tilt, K::Gravity, P::Both, "tilt of the stand", "direction of gravity in the plane"),
    ]
};

/// Arguments of the forces.
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
    /// Whether the term is a force, with a power and a work; else it changes inertia or gravity.
    #[must_use]
    pub const fn is_force(&self) -> bool {
        matches!(self.kind, Kind::Drag | Kind::Dry | Kind::Drive)
    }

    /// Whether the term's coefficient may be below zero: a drive and a direction have a sign, a loss and an inertia have none.
    #[must_use]
    pub const fn is_signed(&self) -> bool {
        matches!(self.kind, Kind::Drive | Kind::Gravity)
    }

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
