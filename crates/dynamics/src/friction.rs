//! Decides stick and slip: which contact each joint is in, what ends it, and what follows.

use crate::motion::flow;
use crate::parameters::{Field, Parameters};
use crate::state::{Contact, State};

/// Law of dry friction: exact or smooth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Friction {
    /// Exact: joints stick and slip at located instants.
    Exact,
    /// The sign replaced by `tanh(rate / width)`, width in rad/s: no sticking, joints creep under load.
    Smooth(f64),
}

/// Joints of a pendulum that can slide or stick.
#[derive(Clone, Copy, Debug)]
pub struct Joints {
    /// Joint has dry friction at all.
    pub dry: [bool; 2],
    /// Joint 2 is pinned (Section 3.1's second pin): it never moves.
    pub pinned: bool,
    /// The law.
    pub friction: Friction,
}

/// A joint's rate: `w1` or `w2 - w1`.
#[must_use]
pub fn rate(x: &State<f64>, joint: usize) -> f64 {
    if joint == 0 { x[2] } else { x[3] - x[2] }
}

impl Joints {
    /// From the parameters: joints without dry coefficients never stick.
    #[must_use]
    pub fn new(p: &Parameters<f64>, friction: Friction, pinned: bool) -> Self {
        let any = |a: Field, b: Field| p.get(a) > 0.0 || p.get(b) > 0.0;
        Self { dry: [any(Field::Rmu1, Field::TauC1), any(Field::Rmu2, Field::TauC2)], pinned, friction }
    }

    /// Whether the joint's contact can end.
    #[must_use]
    pub fn watched(&self, joint: usize, contact: Contact) -> bool {
        match contact {
            Contact::Smooth(_) => false,
            Contact::Slip(_) => self.dry[joint],
            Contact::Stuck => !(self.pinned && joint == 1),
        }
    }

    /// Positive while the joint's contact holds: the rate in the sliding direction (rad/s), or what friction holds
    /// beyond what is asked of it (N m).
    #[must_use]
    pub fn margin(&self, p: &Parameters<f64>, x: &State<f64>, contact: [Contact; 2], joint: usize) -> f64 {
        match contact[joint] {
            Contact::Slip(sign) => sign * rate(x, joint),
            Contact::Stuck => {
                let m = flow(p, x, contact).0;
                m.capacity[joint] - m.dry[joint].abs()
            }
            Contact::Smooth(_) => f64::INFINITY,
        }
    }

    /// The contact that agrees with its own forces. `loose` is a stuck joint that friction can no longer hold;
    /// joints at rest stick if they can, else slip the way they are pushed.
    #[must_use]
    pub fn resolve(
        &self,
        p: &Parameters<f64>,
        x: &State<f64>,
        before: Option<[Contact; 2]>,
        loose: Option<usize>,
    ) -> [Contact; 2] {
        let choices = [0, 1].map(|j| self.choices(p, x, before, loose, j));
        let mut best = ([choices[0][0], choices[1][0]], f64::INFINITY);
        for c0 in &choices[0] {
            for c1 in &choices[1] {
                let contact = [*c0, *c1];
                let m = flow(p, x, contact).0;
                let push = [m.a[0], m.a[1] - m.a[0]];
                let mut violation = 0.0_f64;
                for j in 0..2 {
                    if choices[j].len() == 1 {
                        continue;
                    }
                    violation = violation.max(match contact[j] {
                        Contact::Stuck => m.dry[j].abs() - m.capacity[j],
                        Contact::Slip(sign) => -sign * push[j],
                        Contact::Smooth(_) => 0.0,
                    });
                }
                if violation <= 0.0 {
                    return contact;
                }
                if violation < best.1 {
                    best = (contact, violation);
                }
            }
        }
        best.0
    }

    fn choices(
        &self,
        p: &Parameters<f64>,
        x: &State<f64>,
        before: Option<[Contact; 2]>,
        loose: Option<usize>,
        joint: usize,
    ) -> Vec<Contact> {
        if self.pinned && joint == 1 {
            return vec![Contact::Stuck];
        }
        if !self.dry[joint] {
            return vec![Contact::Slip(1.0)];
        }
        if let Friction::Smooth(width) = self.friction {
            return vec![Contact::Smooth(width)];
        }
        let v = rate(x, joint);
        if v != 0.0 {
            return vec![Contact::Slip(v.signum())];
        }
        if let (Some(contact), true) = (before, loose == Some(joint)) {
            // It moves the way it was pushed: the dry torque opposes that.
            let push = flow(p, x, contact).0.dry[joint];
            return vec![Contact::Slip(push.signum())];
        }
        vec![Contact::Stuck, Contact::Slip(1.0), Contact::Slip(-1.0)]
    }
}
