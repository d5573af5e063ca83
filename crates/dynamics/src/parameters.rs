//! Holds the model parameters: inertial constants, constants of the normal forces and drag, damping coefficients.

use crate::scalar::Real;

/// Constants that are never differentiated: masses carried by the joints, lengths, gravity. SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fixed {
    /// Mass carried by joint 1 besides the lower link: the upper link with its hardware, kg.
    pub m1_kg: f64,
    /// Mass carried by joint 2, the lower link, kg.
    pub m2_kg: f64,
    /// Pivot to elbow, m.
    pub l1_m: f64,
    /// Gravity, m/s^2.
    pub g_m_s2: f64,
    /// Where the lower link begins along its axis, from the elbow, m (negative: it overhangs the elbow).
    pub lower_inner_m: f64,
    /// Where the lower link ends, from the elbow, m.
    pub lower_outer_m: f64,
}

/// Every parameter of the equations of motion, in the scalar `S`. Fields in SI units; see [`Field`] for each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters<S> {
    values: [S; Field::COUNT],
    /// Which values are not identically zero, one bit each, so that absent terms cost nothing.
    active: u32,
    /// Masses, lengths and gravity.
    pub fixed: Fixed,
}

/// One parameter of the equations of motion, with its name and unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(usize)]
pub enum Field {
    /// Half the inertia of the upper link and what it carries, about the pivot.
    Psi,
    /// Half the inertia of the lower link about the elbow.
    Lambda,
    /// Constant coupling of the two rates (bearing balls).
    Zeta,
    /// Coupling `m2 d2 l1`.
    A3,
    /// Weight moment of link 1 and what it carries.
    Sigma,
    /// Weight moment of link 2.
    Kappa,
    /// Viscous coefficient of joint 1.
    MuV1,
    /// Viscous coefficient of joint 2.
    MuV2,
    /// Quadratic drag of link 1.
    MuQ1,
    /// Quadratic drag of link 2 in its own absolute rate.
    MuQ2,
    /// Bearing radius times friction coefficient, joint 1.
    Rmu1,
    /// Bearing radius times friction coefficient, joint 2.
    Rmu2,
    /// Constant dry torque of joint 1.
    TauC1,
    /// Constant dry torque of joint 2.
    TauC2,
    /// Drag of link 2 in its true relative wind; equals `MuQ2` when the elbow is at rest.
    StripDrag,
    /// Inertia about the elbow of the air that moves with the lower link's strips.
    AddedInertia,
    /// Direction of gravity in the plane of motion, counter-clockwise from the angles' zero.
    Tilt,
    /// Constant torque driving link 1.
    Offset1,
    /// Constant torque driving link 2 (reacting on link 1).
    Offset2,
}

impl Field {
    /// Number of parameters.
    pub const COUNT: usize = 19;
    /// All parameters, in order.
    pub const ALL: [Field; Field::COUNT] = [
        Field::Psi,
        Field::Lambda,
        Field::Zeta,
        Field::A3,
        Field::Sigma,
        Field::Kappa,
        Field::MuV1,
        Field::MuV2,
        Field::MuQ1,
        Field::MuQ2,
        Field::Rmu1,
        Field::Rmu2,
        Field::TauC1,
        Field::TauC2,
        Field::StripDrag,
        Field::AddedInertia,
        Field::Tilt,
        Field::Offset1,
        Field::Offset2,
    ];
    /// The name used in files and in Python.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Field::Psi => "psi",
            Field::Lambda => "lambda",
            Field::Zeta => "zeta",
            Field::A3 => "a3",
            Field::Sigma => "sigma",
            Field::Kappa => "kappa",
            Field::MuV1 => "mu_v1",
            Field::MuV2 => "mu_v2",
            Field::MuQ1 => "mu_q1",
            Field::MuQ2 => "mu_q2",
            Field::Rmu1 => "rmu1",
            Field::Rmu2 => "rmu2",
            Field::TauC1 => "tau_c1",
            Field::TauC2 => "tau_c2",
            Field::StripDrag => "strip_drag",
            Field::AddedInertia => "added_inertia",
            Field::Tilt => "tilt",
            Field::Offset1 => "offset1",
            Field::Offset2 => "offset2",
        }
    }
    /// The unit.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        match self {
            Field::Psi | Field::Lambda | Field::Zeta | Field::A3 | Field::AddedInertia => "kg m2",
            Field::Sigma | Field::Kappa => "J",
            Field::MuV1 | Field::MuV2 => "N m s",
            Field::MuQ1 | Field::MuQ2 | Field::StripDrag => "N m s2",
            Field::Rmu1 | Field::Rmu2 => "m",
            Field::TauC1 | Field::TauC2 | Field::Offset1 | Field::Offset2 => "N m",
            Field::Tilt => "rad",
        }
    }
    /// The parameter of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Field> {
        Field::ALL.into_iter().find(|field| field.name() == name)
    }
}

/// A constant of the model of which free motion determines the ratio to [`Field::Psi`] (psi itself is a common factor).
#[derive(Clone, Copy, Debug)]
pub struct Ratio {
    /// The constant.
    pub field: Field,
    /// Unit of its ratio to psi.
    pub unit: &'static str,
    /// Whether a pendulum of one link has it.
    pub is_of_one_link: bool,
    /// Words that people read for it.
    pub words: &'static str,
}

/// Every ratio, in the order of fits.
pub const RATIOS: [Ratio; 4] = [
    Ratio { field: Field::Lambda, unit: "1", is_of_one_link: false, words: "inertia of the lower link" },
    Ratio { field: Field::Sigma, unit: "1/s2", is_of_one_link: true, words: "gravity on the upper link" },
    Ratio { field: Field::Kappa, unit: "1/s2", is_of_one_link: false, words: "gravity on the lower link" },
    Ratio { field: Field::A3, unit: "1", is_of_one_link: false, words: "coupling of the links" },
];

impl<S: Real> Parameters<S> {
    /// All values zero.
    #[must_use]
    pub fn zero(fixed: Fixed) -> Self {
        Self { values: [S::constant(0.0); Field::COUNT], active: 0, fixed }
    }
    /// One value.
    #[inline]
    #[must_use]
    pub fn get(&self, field: Field) -> S {
        self.values[field as usize]
    }
    /// Sets one value.
    #[inline]
    pub fn set(&mut self, field: Field, value: S) {
        self.values[field as usize] = value;
        let bit = 1 << field as usize;
        if value.vanishes() {
            self.active &= !bit;
        } else {
            self.active |= bit;
        }
    }
    /// Whether the parameter, or any of its derivatives, is not zero: then its term is evaluated.
    #[inline]
    #[must_use]
    pub fn is_active(&self, field: Field) -> bool {
        self.active & (1 << field as usize) != 0
    }
    /// Parameters with one value replaced.
    #[must_use]
    pub fn with(mut self, field: Field, value: S) -> Self {
        self.set(field, value);
        self
    }
    /// The values alone.
    #[must_use]
    pub fn value(&self) -> Parameters<f64> {
        Parameters { values: self.values.map(|s| s.value()), active: self.active, fixed: self.fixed }
    }
    /// Parameters of the same values in another scalar, without derivatives.
    #[must_use]
    pub fn lift<T: Real>(&self) -> Parameters<T> {
        Parameters {
            values: self.values.map(|s| T::constant(s.value())),
            active: self.active,
            fixed: self.fixed,
        }
    }
}
