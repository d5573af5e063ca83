//! Defines the state of the pendulum, the contact of its joints, and what the equations give for them.

/// `[phi1, phi2, w1, w2]`, rad and rad/s.
pub type State<S> = [S; 4];

/// Contact of a joint's dry friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Contact {
    /// Sliding with this sign (+1 or -1) of the joint's rate (`w1`, `w2 - w1`).
    Slip(f64),
    /// The smooth law: sign replaced by `tanh(rate / width)`, width in rad/s.
    Smooth(f64),
    /// Not sliding: the joint's rate stays as it is and the torque is whatever that needs. A pinned joint, too.
    Stuck,
}

/// Accelerations and forces of a state, as [`accelerations`] gives them.
#[derive(Clone, Copy, Debug)]
pub struct Motion<S> {
    /// Accelerations of the links, rad/s^2.
    pub a: [S; 2],
    /// Magnitude of the normal forces at the joints, N (Eq. 34 with erratum 16).
    pub normal: [S; 2],
    /// Dry torque at each joint, N m: `sign * capacity` when sliding, the constraint's torque when stuck. The
    /// torque on link 1 is `-dry[0] + dry[1]`, on link 2 `-dry[1]`.
    pub dry: [S; 2],
    /// Greatest moment that dry friction holds at each joint, N m: `r mu N + tau_c`.
    pub capacity: [S; 2],
}
