//! Defines the scalar of the equations: `f64`, or a forward-mode dual number with `N` directions.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// A number as the equations of motion need it. Comparisons are made on [`Real::value`].
pub trait Real:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
    + AddAssign
    + SubAssign
{
    /// A number without derivatives.
    fn constant(value: f64) -> Self;
    /// The value, its derivatives left away.
    fn value(&self) -> f64;
    /// Whether the value and every derivative are zero.
    fn vanishes(&self) -> bool;
    /// A function of this number with the given value and derivative there.
    fn chain(self, value: f64, slope: f64) -> Self;
    /// Number of directions in which the scalar carries derivatives.
    const DIRECTIONS: usize;
    /// Adds `slope` times the derivatives of `inner` to the derivatives, the value left as it is.
    fn carry(&mut self, slope: f64, inner: &Self);

    /// Sine and cosine.
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = self.value().sin_cos();
        (self.chain(s, c), self.chain(c, -s))
    }
    /// Square root of a positive number.
    #[inline]
    fn sqrt(self) -> Self {
        let r = self.value().sqrt();
        self.chain(r, 0.5 / r)
    }
    /// Hyperbolic tangent.
    #[inline]
    fn tanh(self) -> Self {
        let t = self.value().tanh();
        self.chain(t, 1.0 - t * t)
    }
    /// Absolute value; the derivative at zero is taken as that of the positive side.
    #[inline]
    fn abs(self) -> Self {
        if self.value() < 0.0 { -self } else { self }
    }
}

impl Real for f64 {
    #[inline]
    fn constant(value: f64) -> Self {
        value
    }
    #[inline]
    fn value(&self) -> f64 {
        *self
    }
    #[inline]
    fn vanishes(&self) -> bool {
        *self == 0.0
    }
    #[inline]
    fn chain(self, value: f64, _slope: f64) -> Self {
        value
    }
    const DIRECTIONS: usize = 0;
    #[inline]
    fn carry(&mut self, _slope: f64, _inner: &Self) {}
}

/// A value and its derivatives in `N` directions: `v + d·e`, with `e_i e_j = 0`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<const N: usize> {
    /// Value.
    pub v: f64,
    /// Derivatives.
    pub d: [f64; N],
}

impl<const N: usize> Dual<N> {
    /// An independent variable: value `v`, derivative one in direction `i` and zero in the others.
    /// A direction out of range gives a constant.
    #[must_use]
    pub fn variable(v: f64, i: usize) -> Self {
        let mut d = [0.0; N];
        if let Some(slot) = d.get_mut(i) {
            *slot = 1.0;
        }
        Self { v, d }
    }
    #[inline]
    fn map(mut self, v: f64, f: impl Fn(f64) -> f64) -> Self {
        for x in &mut self.d {
            *x = f(*x);
        }
        self.v = v;
        self
    }
    #[inline]
    fn zip(mut self, other: &Self, v: f64, f: impl Fn(f64, f64) -> f64) -> Self {
        for (x, y) in self.d.iter_mut().zip(&other.d) {
            *x = f(*x, *y);
        }
        self.v = v;
        self
    }
}

impl<const N: usize> Real for Dual<N> {
    #[inline]
    fn constant(value: f64) -> Self {
        Self { v: value, d: [0.0; N] }
    }
    #[inline]
    fn value(&self) -> f64 {
        self.v
    }
    #[inline]
    fn vanishes(&self) -> bool {
        self.v == 0.0 && self.d.iter().all(|x| *x == 0.0)
    }
    #[inline]
    fn chain(self, value: f64, slope: f64) -> Self {
        self.map(value, |x| x * slope)
    }
    const DIRECTIONS: usize = N;
    #[inline]
    fn carry(&mut self, slope: f64, inner: &Self) {
        for (x, y) in self.d.iter_mut().zip(&inner.d) {
            *x += slope * y;
        }
    }
}

impl<const N: usize> Add for Dual<N> {
    type Output = Self;
    #[inline]
    fn add(self, o: Self) -> Self {
        self.zip(&o, self.v + o.v, |x, y| x + y)
    }
}
impl<const N: usize> Sub for Dual<N> {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        self.zip(&o, self.v - o.v, |x, y| x - y)
    }
}
impl<const N: usize> Mul for Dual<N> {
    type Output = Self;
    #[inline]
    #[expect(clippy::suspicious_arithmetic_impl, reason = "the product rule adds")]
    fn mul(self, o: Self) -> Self {
        let (a, b) = (self.v, o.v);
        self.zip(&o, a * b, |x, y| x * b + a * y)
    }
}
impl<const N: usize> Div for Dual<N> {
    type Output = Self;
    #[inline]
    fn div(self, o: Self) -> Self {
        let inverse = 1.0 / o.v;
        let q = self.v * inverse;
        self.zip(&o, q, |x, y| (x - q * y) * inverse)
    }
}
impl<const N: usize> Neg for Dual<N> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        self.map(-self.v, |x| -x)
    }
}
impl<const N: usize> Add<f64> for Dual<N> {
    type Output = Self;
    #[inline]
    fn add(mut self, o: f64) -> Self {
        self.v += o;
        self
    }
}
impl<const N: usize> Sub<f64> for Dual<N> {
    type Output = Self;
    #[inline]
    fn sub(mut self, o: f64) -> Self {
        self.v -= o;
        self
    }
}
impl<const N: usize> Mul<f64> for Dual<N> {
    type Output = Self;
    #[inline]
    fn mul(self, o: f64) -> Self {
        self.map(self.v * o, |x| x * o)
    }
}
impl<const N: usize> AddAssign for Dual<N> {
    #[inline]
    fn add_assign(&mut self, o: Self) {
        self.v += o.v;
        for (x, y) in self.d.iter_mut().zip(&o.d) {
            *x += y;
        }
    }
}
impl<const N: usize> SubAssign for Dual<N> {
    #[inline]
    fn sub_assign(&mut self, o: Self) {
        self.v -= o.v;
        for (x, y) in self.d.iter_mut().zip(&o.d) {
            *x -= y;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_those_of_calculus() {
        // f(x, y) = sqrt(x) tanh(y) / (1 + sin x cos y), derivatives by central differences
        fn f<S: Real>(x: S, y: S) -> S {
            let (s, _) = x.sin_cos();
            let (_, c) = y.sin_cos();
            x.sqrt() * y.tanh() / (s * c + 1.0) - (-(x * y)).abs() * 0.5
        }
        let (x, y, h) = (1.3, 0.4, 1e-6);
        let dual = f(Dual::<2>::variable(x, 0), Dual::<2>::variable(y, 1));
        assert_eq!(dual.v, f(x, y));
        let dx = (f(x + h, y) - f(x - h, y)) / (2.0 * h);
        let dy = (f(x, y + h) - f(x, y - h)) / (2.0 * h);
        // central differences: truncation h^2, rounding eps/h: 1e-9 covers both
        assert!((dual.d[0] - dx).abs() < 1e-9, "{} {dx}", dual.d[0]);
        assert!((dual.d[1] - dy).abs() < 1e-9, "{} {dy}", dual.d[1]);
    }
}
