//! Takes one step of DOP853 (order 8, error estimates of orders 5 and 3) and its dense output (order 7), for autonomous
//! equations over any [`Real`] scalar.

use crate::integrate::tableau::{A, ALL_STAGES, B, D as DENSE_WEIGHTS, DENSE, E3, E5, STAGES};
use crate::scalar::Real;

/// A step that was tried: its two ends and its stages.
pub struct Step<S, const N: usize> {
    /// State at the start.
    pub start: [S; N],
    /// State at the end.
    pub end: [S; N],
    /// Derivative at the end: the next step's first stage.
    pub slope: [S; N],
    h: f64,
    k: [[S; N]; ALL_STAGES],
}

#[inline]
fn combine<S: Real, const N: usize>(k: &[[S; N]], row: &[(usize, f64)]) -> [S; N] {
    let mut out = [S::constant(0.0); N];
    for (stage, weight) in row {
        for (o, x) in out.iter_mut().zip(&k[*stage]) {
            *o += *x * *weight;
        }
    }
    out
}

#[inline]
fn advance<S: Real, const N: usize>(from: &[S; N], k: &[[S; N]], row: &[(usize, f64)], h: f64) -> [S; N] {
    let change = combine(k, row);
    std::array::from_fn(|i| from[i] + change[i] * h)
}

impl<S: Real, const N: usize> Step<S, N> {
    /// A step of size `h` from `start`, where the derivative is `slope`.
    pub fn take(f: &mut impl FnMut(&[S; N]) -> [S; N], start: &[S; N], slope: &[S; N], h: f64) -> Self {
        let mut k = [[S::constant(0.0); N]; ALL_STAGES];
        k[0] = *slope;
        for stage in 1..STAGES {
            k[stage] = f(&advance(start, &k, A[stage], h));
        }
        let end = advance(start, &k, B, h);
        let slope = f(&end);
        k[STAGES] = slope;
        Self { start: *start, end, slope, h, k }
    }

    /// Size of the local error in units of `scale` per component: 1 is just good enough. Not finite when the step
    /// left the region where the equations can be evaluated.
    pub fn error(&self, scale: &[f64; N]) -> f64 {
        let (e5, e3) = (combine(&self.k, E5), combine(&self.k, E3));
        let (mut fifth, mut third) = (0.0, 0.0);
        for i in 0..N {
            fifth += (e5[i].value() / scale[i]).powi(2);
            third += (e3[i].value() / scale[i]).powi(2);
        }
        if fifth == 0.0 && third == 0.0 {
            return 0.0;
        }
        #[allow(clippy::cast_precision_loss)] // N is a small dimension
        let size = N as f64;
        self.h.abs() * fifth / ((fifth + 0.01 * third) * size).sqrt()
    }

    /// The continuous solution within the step.
    pub fn dense(&mut self, f: &mut impl FnMut(&[S; N]) -> [S; N]) -> Dense<S, N> {
        for (stage, row) in A.iter().enumerate().skip(STAGES + 1) {
            self.k[stage] = f(&advance(&self.start, &self.k, row, self.h));
        }
        let change: [S; N] = std::array::from_fn(|i| self.end[i] - self.start[i]);
        let first = self.k[0].map(|x| x * self.h);
        let mut terms = [change; DENSE];
        terms[1] = std::array::from_fn(|i| first[i] - change[i]);
        terms[2] = std::array::from_fn(|i| change[i] * 2.0 - (self.slope[i] * self.h + first[i]));
        for (row, weights) in DENSE_WEIGHTS.iter().enumerate() {
            let sum = combine(&self.k, weights);
            terms[3 + row] = sum.map(|x| x * self.h);
        }
        Dense { start: self.start, terms }
    }
}

/// The continuous solution of one step.
pub struct Dense<S, const N: usize> {
    start: [S; N],
    terms: [[S; N]; DENSE],
}

impl<S: Real, const N: usize> Dense<S, N> {
    /// The state at the fraction `x` of the step, 0 to 1.
    #[must_use]
    pub fn at(&self, x: f64) -> [S; N] {
        self.first(x)
    }

    /// The first `M` components of [`Dense::at`].
    #[must_use]
    pub fn first<const M: usize>(&self, x: f64) -> [S; M] {
        let mut y = [S::constant(0.0); M];
        for (i, term) in self.terms.iter().rev().enumerate() {
            let factor = if i % 2 == 0 { x } else { 1.0 - x };
            for (o, t) in y.iter_mut().zip(term) {
                *o = (*o + *t) * factor;
            }
        }
        for (o, s) in y.iter_mut().zip(&self.start) {
            *o += *s;
        }
        y
    }
}

/// Step size from the error of the last step: DOP853's own controller with its usual bounds.
pub fn next_factor(error: f64, rejected_before: bool) -> f64 {
    let best = if error == 0.0 { 10.0 } else { 0.9 * error.powf(-0.125) };
    best.clamp(0.2, if rejected_before { 1.0 } else { 10.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrate::tableau::C;
    use crate::scalar::Dual;

    #[test]
    fn rows_sum_to_their_nodes() {
        for (row, c) in A.iter().zip(C) {
            let sum: f64 = row.iter().map(|(_, a)| a).sum();
            // sixteen numbers of order one added up
            assert!((sum - c).abs() < 1e-13, "{sum} {c}");
        }
    }

    /// y'' = -y from (1, 0): the exact solution is a cosine.
    fn turn<S: Real>(y: &[S; 2]) -> [S; 2] {
        [y[1], -y[0]]
    }

    #[test]
    fn a_step_is_of_order_eight_and_its_dense_output_of_order_seven() {
        let errors: Vec<(f64, f64)> = [0.8, 0.4]
            .iter()
            .map(|h| {
                let start = [1.0, 0.0];
                let mut f = |y: &[f64; 2]| turn(y);
                let mut step = Step::take(&mut f, &start, &turn(&start), *h);
                let dense = step.dense(&mut f);
                let middle = dense.at(0.37);
                ((step.end[0] - h.cos()).abs(), (middle[0] - (0.37 * h).cos()).abs())
            })
            .collect();
        // local errors fall as h^9 and h^8; half a power of slack for the next term
        assert!(errors[0].0 / errors[1].0 > 2f64.powf(8.5), "{errors:?}");
        assert!(errors[0].1 / errors[1].1 > 2f64.powf(7.5), "{errors:?}");
    }

    #[test]
    fn derivatives_by_the_start_are_carried() {
        let start = [Dual::<1>::variable(1.0, 0), Dual::constant(0.0)];
        let mut f = |y: &[Dual<1>; 2]| turn(y);
        let step = Step::take(&mut f, &start, &turn(&start), 0.3);
        // linear in the start, so the derivative is the solution itself
        assert!((step.end[0].d[0] - step.end[0].v).abs() < 1e-15);
    }
}
