//! Eliminates the arrow-shaped normal matrix of a multiple-shooting fit: chains of 4x4 blocks with a common border.
//!
//! Segment states come first, each coupled to the next of its chain; the common unknowns (coefficients, ratios,
//! angle zeros) form the border: the shared parameters. One forward elimination and one back substitution solve it in time linear in the
//! number of segments, and give the blocks of the inverse that the slack and the covariances need.

use nalgebra::{DMatrix, DVector, Matrix4, Matrix4xX, Vector4};

/// One segment's part of the normal equations.
#[derive(Clone, Debug)]
pub struct Block {
    /// Second derivatives with respect to the segment's state.
    pub own: Matrix4<f64>,
    /// With respect to this state and the next one's; `None` at the end of a chain.
    pub next: Option<Matrix4<f64>>,
    /// With respect to this state and the shared parameters, (4, G).
    pub shared: Matrix4xX<f64>,
    /// Gradient.
    pub gradient: Vector4<f64>,
    /// The samples' part of `own`'s diagonal.
    pub damped: Vector4<f64>,
}

/// The whole system.
#[derive(Clone, Debug)]
pub struct Arrow {
    /// Segments in order.
    pub blocks: Vec<Block>,
    /// Of the shared parameters with each other, (G, G).
    pub corner: DMatrix<f64>,
    /// Border's gradient.
    pub gradient: DVector<f64>,
    /// The samples' part of `corner`'s diagonal.
    pub damped: DVector<f64>,
}

/// The system after the forward elimination.
pub struct Eliminated {
    inverse: Vec<Matrix4<f64>>,
    next: Vec<Option<Matrix4<f64>>>,
    shared: Vec<Matrix4xX<f64>>,
    gradient: Vec<Vector4<f64>>,
    /// Marginal second derivatives of half chi-square by the shared parameters.
    pub corner: DMatrix<f64>,
    /// And gradient.
    pub corner_gradient: DVector<f64>,
}

impl Arrow {
    /// The gradient along a step of states and shared parameters.
    #[must_use]
    pub fn slope(&self, states: &[Vector4<f64>], shared: &DVector<f64>) -> f64 {
        let along: f64 = self.blocks.iter().zip(states).map(|(b, s)| b.gradient.dot(s)).sum();
        along + self.gradient.dot(shared)
    }

    /// Eliminates the states, with `damping` times the samples' part of the diagonal added to it (the joints' part
    /// would hold back steps along the continuous motion, the more the tighter they are). `None` when a block is not
    /// positive definite.
    #[must_use]
    pub fn eliminate(&self, damping: f64) -> Option<Eliminated> {
        let n = self.blocks.len();
        let mut out = Eliminated {
            inverse: Vec::with_capacity(n),
            next: Vec::with_capacity(n),
            shared: Vec::with_capacity(n),
            gradient: Vec::with_capacity(n),
            corner: self.corner.clone(),
            corner_gradient: self.gradient.clone(),
        };
        for i in 0..self.corner.nrows() {
            out.corner[(i, i)] += damping * self.damped[i];
        }
        let mut carry: Option<(Matrix4<f64>, Matrix4xX<f64>, Vector4<f64>)> = None;
        for block in &self.blocks {
            let mut own = block.own;
            for i in 0..4 {
                own[(i, i)] += damping * block.damped[i];
            }
            let (mut shared, mut gradient) = (block.shared.clone(), block.gradient);
            if let Some((o, b, g)) = carry.take() {
                own -= o;
                shared -= b;
                gradient -= g;
            }
            let inverse = scaled_inverse(&own)?;
            let through: Matrix4xX<f64> = inverse * &shared;
            out.corner.gemm_tr(-1.0, &shared, &through, 1.0);
            out.corner_gradient.gemv_tr(-1.0, &through, &gradient, 1.0);
            if let Some(next) = block.next {
                let back = next.transpose() * inverse;
                carry = Some((back * next, back * &shared, back * gradient));
            }
            out.inverse.push(inverse);
            out.next.push(block.next);
            out.shared.push(shared);
            out.gradient.push(gradient);
        }
        Some(out)
    }
}

/// Inverse of a symmetric positive definite block, scaled to a unit diagonal first (angles and rates differ by far).
fn scaled_inverse(m: &Matrix4<f64>) -> Option<Matrix4<f64>> {
    let mut scale = Vector4::zeros();
    for i in 0..4 {
        let d = m[(i, i)];
        if !(d > 0.0 && d.is_finite()) {
            return None;
        }
        scale[i] = 1.0 / d.sqrt();
    }
    let s = Matrix4::from_diagonal(&scale);
    let inverse = (s * m * s).cholesky()?.inverse();
    Some(s * inverse * s)
}

impl Eliminated {
    /// The states' steps for a given step of the shared parameters: the minimiser of the quadratic model.
    #[must_use]
    pub fn states(&self, shared: &DVector<f64>) -> Vec<Vector4<f64>> {
        let mut steps = vec![Vector4::zeros(); self.inverse.len()];
        let mut after = Vector4::zeros();
        for k in (0..self.inverse.len()).rev() {
            let mut right =
                -self.gradient[k] - Vector4::from_iterator((&self.shared[k] * shared).iter().copied());
            if let Some(next) = self.next[k] {
                right -= next * after;
            }
            after = self.inverse[k] * right;
            steps[k] = after;
        }
        steps
    }

    /// Logarithm of the determinant of the whole matrix.
    #[must_use]
    pub fn log_determinant(&self) -> f64 {
        let states: f64 = self.inverse.iter().map(|m| -m.determinant().ln()).sum();
        if self.corner.nrows() == 0 {
            return states;
        }
        let scale = self.corner.diagonal().map(|d| d.max(f64::MIN_POSITIVE).sqrt());
        let n = scale.len();
        let scaled = DMatrix::from_fn(n, n, |r, c| self.corner[(r, c)] / (scale[r] * scale[c]));
        let values = scaled.symmetric_eigenvalues();
        let shared: f64 = values.iter().map(|v| v.max(1e-14).ln()).sum();
        states + shared + scale.iter().map(|s| 2.0 * s.ln()).sum::<f64>()
    }

    /// Covariance blocks of the states: for each segment its own block, and the block with the next segment's state,
    /// both for known shared parameters; and how the states move with the shared parameters, (4, G).
    #[must_use]
    pub fn covariances(&self) -> Vec<Spread> {
        let n = self.inverse.len();
        let mut out: Vec<Spread> = Vec::with_capacity(n);
        let mut after: Option<Spread> = None;
        for k in (0..n).rev() {
            let inverse = self.inverse[k];
            let mut own = inverse;
            let mut with_next = Matrix4::zeros();
            let mut pull = self.shared[k].clone();
            if let (Some(next), Some(later)) = (self.next[k], &after) {
                let gain = inverse * next;
                with_next = -gain * later.own;
                own += gain * later.own * gain.transpose();
                pull += next * &later.with_shared;
            }
            let spread = Spread { own, with_next, with_shared: -(inverse * pull) };
            after = Some(spread.clone());
            out.push(spread);
        }
        out.reverse();
        out
    }
}

/// Covariance of one segment's state; see [`Eliminated::covariances`].
#[derive(Clone, Debug)]
pub struct Spread {
    /// Covariance of this state for known shared parameters.
    pub own: Matrix4<f64>,
    /// With the next segment's state.
    pub with_next: Matrix4<f64>,
    /// Derivative of this state with respect to the shared parameters, (4, G).
    pub with_shared: Matrix4xX<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_dense_matrix() {
        let (n, g) = (5, 3);
        let size = 4 * n + g;
        let root = DMatrix::from_fn(size, size, |i, j| ((i * 7 + j * 13 + i * j) % 11) as f64 / 11.0 - 0.4);
        let mut dense = DMatrix::identity(size, size) * 9.0;
        let mut arrow = Arrow {
            blocks: Vec::new(),
            corner: DMatrix::zeros(g, g),
            gradient: DVector::from_fn(g, |i, _| i as f64 - 0.7),
            damped: DVector::zeros(g),
        };
        for i in 0..size {
            for j in 0..size {
                let (bi, bj) = (i / 4, j / 4);
                let chained = bi.max(bj) >= n || bi.abs_diff(bj) <= 1;
                // one chain of three segments and one of two
                let broken = bi.min(bj) == 2 && bi.max(bj) == 3;
                if chained && !broken {
                    dense[(i, j)] += 0.5 * (root[(i, j)] + root[(j, i)]);
                }
            }
        }
        for k in 0..n {
            let block = |r: usize, c: usize| Matrix4::from_fn(|i, j| dense[(4 * r + i, 4 * c + j)]);
            arrow.blocks.push(Block {
                own: block(k, k),
                next: (k != 2 && k != 4).then(|| block(k, k + 1)),
                shared: Matrix4xX::from_fn(g, |i, j| dense[(4 * k + i, 4 * n + j)]),
                gradient: Vector4::from_fn(|i, _| (i + k) as f64 * 0.3 - 1.0),
                damped: Vector4::zeros(),
            });
        }
        arrow.corner = DMatrix::from_fn(g, g, |i, j| dense[(4 * n + i, 4 * n + j)]);
        let gradient = DVector::from_iterator(
            size,
            arrow
                .blocks
                .iter()
                .flat_map(|b| b.gradient.iter().copied())
                .chain(arrow.gradient.iter().copied()),
        );
        let inverse = dense.clone().try_inverse().map(|m| (m.clone(), -(m * &gradient)));
        let (inverse, step) = inverse.ok_or("singular").unwrap_or((dense.clone(), gradient));
        let done = arrow.eliminate(0.0);
        assert!(done.is_some());
        let Some(done) = done else { return };
        let determinant = dense.clone().cholesky().map(|c| c.determinant().ln());
        assert!(determinant.is_some_and(|d| (done.log_determinant() - d).abs() < 1e-10));
        let corner = done.corner.clone().try_inverse().ok_or("singular").unwrap_or(DMatrix::zeros(g, g));
        let shared = -(&corner * &done.corner_gradient);
        // rounding of a well-conditioned 23x23 system
        assert!((&shared - step.rows(4 * n, g)).amax() < 1e-12);
        for (k, s) in done.states(&shared).iter().enumerate() {
            assert!((s - step.fixed_rows::<4>(4 * k)).amax() < 1e-12);
        }
        for (k, spread) in done.covariances().iter().enumerate() {
            let full = spread.own
                + Matrix4::from_iterator(
                    (&spread.with_shared * &corner * spread.with_shared.transpose()).iter().copied(),
                );
            assert!((full - inverse.view((4 * k, 4 * k), (4, 4))).amax() < 1e-12);
        }
    }
}
