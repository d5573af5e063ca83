//! Traces the fitted motion at every sample, and the power of each term along it.

use rayon::prelude::*;

use super::linearise::Point;
use super::path::{Span, follow};
use super::problem::{Recording, Segment};
use crate::motion::{accelerations, normal_forces};
use crate::parameters::Parameters;
use crate::state::{Contact, State};
use crate::terms::{Kinematics, TERMS};

/// One row per sample of a segment, in the order of the segments.
#[derive(Clone, Debug, Default)]
pub struct Trace {
    /// Recording of each row.
    pub recording: Vec<usize>,
    /// Sample of each row.
    pub sample: Vec<usize>,
    /// Segment of each row.
    pub segment: Vec<usize>,
    /// States, zeros not added, rad and rad/s.
    pub state: Vec<[f64; 4]>,
    /// Power of each row of [`TERMS`] for a coefficient of one, W per unit.
    pub unit_power: Vec<[f64; TERMS.len()]>,
}

/// Power of each row of [`TERMS`] for a coefficient of one, W per unit, in a state with given accelerations.
#[must_use]
pub fn unit_powers(p: &Parameters<f64>, x: &State<f64>, a: [f64; 2]) -> [f64; TERMS.len()] {
    let sign = [x[2], x[3] - x[2]].map(f64::signum);
    let normal = normal_forces(p, x, a);
    let k = Kinematics { w: [x[2], x[3]], cos_d: (x[0] - x[1]).cos(), normal, sign };
    std::array::from_fn(|i| TERMS[i].unit_power(&k, &p.fixed))
}

/// Follows every segment from its state in `point`.
#[must_use]
pub fn trace(recordings: &[Recording<'_>], segments: &[Segment], point: &Point) -> Trace {
    let one = |(k, segment): (usize, &Segment)| {
        let recording = &recordings[segment.recording];
        let span = Span {
            start_s: segment.start_s,
            end_s: segment.end_s,
            times_s: &recording.t_s[segment.first..segment.last],
        };
        let mut out = Trace::default();
        let p = &point.parameters;
        follow(p, point.states[k], &span, point.clock_scale, true, |n, x| {
            let sign = [x[2], x[3] - x[2]].map(f64::signum);
            let motion = accelerations(p, x, sign.map(Contact::Slip));
            out.recording.push(segment.recording);
            out.sample.push(segment.first + n);
            out.segment.push(k);
            out.state.push(*x);
            out.unit_power.push(unit_powers(p, x, motion.a));
        });
        out
    };
    let pieces: Vec<Trace> = threads::install(|| segments.par_iter().enumerate().map(one).collect());
    let mut all = Trace::default();
    for mut piece in pieces {
        all.recording.append(&mut piece.recording);
        all.sample.append(&mut piece.sample);
        all.segment.append(&mut piece.segment);
        all.state.append(&mut piece.state);
        all.unit_power.append(&mut piece.unit_power);
    }
    all
}
