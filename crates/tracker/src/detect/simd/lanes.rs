//! Computes with eight single-precision numbers at once: on every processor, and by AVX2 where that is found at run time.
//!
//! Owns: [`Eight`], [`Job`], [`work`]. Must not: round differently from one processor to another; there are only operations
//! that IEEE 754 defines to the bit: none is fused, and minima and maxima are of numbers, never of NaN or of zeros of both signs.

use std::ops::{Add, AddAssign, Mul, Sub};

use wide::f32x8;

/// Numbers in a vector.
pub(crate) const LANES: usize = 8;

/// A vector of eight single-precision numbers. A `Token` proves that the processor has the instructions for it.
pub(crate) trait Eight:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + AddAssign
{
    type Token: Copy;
    /// The vector of eight numbers in memory.
    fn load(token: Self::Token, values: &[f32; LANES]) -> Self;
    /// The vector of eight bytes in memory, each as a number.
    fn load_bytes(token: Self::Token, bytes: &[u8; LANES]) -> Self;
    /// The vector of one number eight times.
    fn splat(token: Self::Token, value: f32) -> Self;
    /// The first numbers of eight pairs, and the second ones.
    fn pairs(token: Self::Token, entries: [&[f32; 2]; LANES]) -> (Self, Self);
    /// The eight numbers.
    fn array(self) -> [f32; LANES];
    /// Whole parts; the numbers are at least 0 and below 2^31.
    fn trunc(self) -> [i32; LANES];
    /// Quotients, number by number.
    fn div(self, other: Self) -> Self;
    /// Square roots.
    fn sqrt(self) -> Self;
    /// Absolute values.
    fn abs(self) -> Self;
    /// Minima, number by number; none is NaN.
    fn min(self, other: Self) -> Self;
    /// Maxima, number by number; none is NaN.
    fn max(self, other: Self) -> Self;
    /// Each number where `first` or `second` is below the limit there, elsewhere 0.
    fn where_below(self, first: Self, second: Self, limit: Self) -> Self;
}

impl Eight for f32x8 {
    type Token = ();

    #[inline(always)]
    fn load((): (), values: &[f32; LANES]) -> Self {
        Self::new(*values)
    }
    #[inline(always)]
    fn load_bytes((): (), bytes: &[u8; LANES]) -> Self {
        Self::new(bytes.map(f32::from))
    }
    #[inline(always)]
    fn splat((): (), value: f32) -> Self {
        Self::splat(value)
    }
    #[inline(always)]
    fn pairs((): (), entries: [&[f32; 2]; LANES]) -> (Self, Self) {
        (Self::new(entries.map(|e| e[0])), Self::new(entries.map(|e| e[1])))
    }
    #[inline(always)]
    fn array(self) -> [f32; LANES] {
        self.to_array()
    }
    #[inline(always)]
    fn trunc(self) -> [i32; LANES] {
        self.fast_trunc_int().to_array()
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self / other
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.sqrt()
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.abs()
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.fast_min(other)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.fast_max(other)
    }
    #[inline(always)]
    fn where_below(self, first: Self, second: Self, limit: Self) -> Self {
        self & (first.simd_lt(limit) | second.simd_lt(limit))
    }
}

/// A computation on vectors of any kind. What `run` calls has to be always inlined: only what becomes part of `run` gets
/// the instructions of that kind.
pub(crate) trait Job {
    type Outcome;
    fn run<V: Eight>(self, token: V::Token) -> Self::Outcome;
}

/// Runs a job with the best instructions that the processor has.
#[inline]
pub(crate) fn work<J: Job>(job: J) -> J::Outcome {
    #[cfg(target_arch = "x86_64")]
    if let Some(token) = avx2::Avx2::found() {
        // SAFETY: an `Avx2` is there, so the processor has it.
        return unsafe { avx2::work(token, job) };
    }
    job.run::<f32x8>(())
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::*;

    use super::*;

    /// Shows that the processor has AVX2: there is no way to one but [`Avx2::found`].
    #[derive(Debug, Clone, Copy)]
    pub(crate) struct Avx2(());

    impl Avx2 {
        /// Whether this processor has it.
        #[inline]
        pub fn found() -> Option<Self> {
            is_x86_feature_detected!("avx2").then_some(Self(()))
        }
    }

    #[target_feature(enable = "avx2")]
    pub(super) fn work<J: Job>(token: Avx2, job: J) -> J::Outcome {
        job.run::<Register>(token)
    }

    /// Eight numbers in one register. Made from an [`Avx2`] or from others of them and in no other way, so where there
    /// is one the processor has AVX2; that is what each `unsafe` below stands on.
    #[derive(Clone, Copy)]
    pub(crate) struct Register(__m256);

    macro_rules! operator {
        ($trait:ident, $name:ident, $instruction:ident) => {
            impl $trait for Register {
                type Output = Self;
                #[inline(always)]
                fn $name(self, other: Self) -> Self {
                    // SAFETY: a `Register` is there, so the processor has AVX2.
                    Self(unsafe { $instruction(self.0, other.0) })
                }
            }
        };
    }
    operator!(Add, add, _mm256_add_ps);
    operator!(Sub, sub, _mm256_sub_ps);
    operator!(Mul, mul, _mm256_mul_ps);

    impl AddAssign for Register {
        #[inline(always)]
        fn add_assign(&mut self, other: Self) {
            *self = *self + other;
        }
    }

    impl Eight for Register {
        type Token = Avx2;

        #[inline(always)]
        fn load(_: Avx2, values: &[f32; LANES]) -> Self {
            // SAFETY: an `Avx2` is there, so the processor has it; eight numbers are read from an array of eight.
            Self(unsafe { _mm256_loadu_ps(values.as_ptr()) })
        }
        #[inline(always)]
        fn load_bytes(_: Avx2, bytes: &[u8; LANES]) -> Self {
            // SAFETY: an `Avx2` is there, so the processor has it; eight bytes, which need not be aligned, are read from
            // an array of eight.
            unsafe {
                let bytes = _mm_loadl_epi64(bytes.as_ptr().cast());
                Self(_mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(bytes)))
            }
        }
        #[inline(always)]
        fn splat(_: Avx2, value: f32) -> Self {
            // SAFETY: an `Avx2` is there, so the processor has it.
            Self(unsafe { _mm256_set1_ps(value) })
        }
        #[inline(always)]
        fn pairs(_: Avx2, entries: [&[f32; 2]; LANES]) -> (Self, Self) {
            // SAFETY: an `Avx2` is there, so the processor has it; each load reads the 8 bytes of one pair, which need
            // not be aligned.
            unsafe {
                let two = |a: &[f32; 2], b: &[f32; 2]| {
                    _mm_castpd_ps(_mm_loadh_pd(_mm_load_sd(a.as_ptr().cast()), b.as_ptr().cast()))
                };
                let [a, b, c, d, e, f, g, h] = entries;
                let outer = _mm256_set_m128(two(e, f), two(a, b));
                let inner = _mm256_set_m128(two(g, h), two(c, d));
                // Pairs 0, 1, 4, 5 and 2, 3, 6, 7: of each half of 128 bits the first numbers, then the second ones.
                (
                    Self(_mm256_shuffle_ps::<0b10_00_10_00>(outer, inner)),
                    Self(_mm256_shuffle_ps::<0b11_01_11_01>(outer, inner)),
                )
            }
        }
        #[inline(always)]
        fn array(self) -> [f32; LANES] {
            let mut values = [0.0; LANES];
            // SAFETY: a `Register` is there, so the processor has AVX2; eight numbers go into an array of eight.
            unsafe { _mm256_storeu_ps(values.as_mut_ptr(), self.0) };
            values
        }
        #[inline(always)]
        fn trunc(self) -> [i32; LANES] {
            let mut values = [0; LANES];
            // SAFETY: a `Register` is there, so the processor has AVX2; eight numbers go into an array of eight, which
            // need not be aligned.
            unsafe { _mm256_storeu_si256(values.as_mut_ptr().cast(), _mm256_cvttps_epi32(self.0)) };
            values
        }
        #[inline(always)]
        fn div(self, other: Self) -> Self {
            // SAFETY: a `Register` is there, so the processor has AVX2.
            Self(unsafe { _mm256_div_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn sqrt(self) -> Self {
            // SAFETY: a `Register` is there, so the processor has AVX2.
            Self(unsafe { _mm256_sqrt_ps(self.0) })
        }
        #[inline(always)]
        fn abs(self) -> Self {
            // SAFETY: a `Register` is there, so the processor has AVX2.
            Self(unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0) })
        }
        #[inline(always)]
        fn min(self, other: Self) -> Self {
            // SAFETY: a `Register` is there, so the processor has AVX2.
            Self(unsafe { _mm256_min_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn max(self, other: Self) -> Self {
            // SAFETY: a `Register` is there, so the processor has AVX2.
            Self(unsafe { _mm256_max_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn where_below(self, first: Self, second: Self, limit: Self) -> Self {
            // SAFETY: a `Register` is there, so the processor has AVX2.
            unsafe {
                let below = _mm256_or_ps(
                    _mm256_cmp_ps::<_CMP_LT_OQ>(first.0, limit.0),
                    _mm256_cmp_ps::<_CMP_LT_OQ>(second.0, limit.0),
                );
                Self(_mm256_and_ps(self.0, below))
            }
        }
    }
}
#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::avx2::{Avx2, Register};
    use super::*;

    /// The results of every operation for some numbers.
    fn all_of<V: Eight>(
        t: V::Token,
        a: &[f32; LANES],
        b: &[f32; LANES],
        pairs: &[[f32; 2]; LANES],
    ) -> Vec<u32> {
        let (x, y) = (V::load(t, a), V::load(t, b));
        let (first, second) = V::pairs(t, pairs.each_ref());
        let mut sum = x;
        sum += y;
        let whole = x.abs().min(V::splat(t, 1e6)).trunc();
        let values = [
            x + y,
            x - y,
            x * y,
            x.div(y),
            x.abs().sqrt(),
            x.min(y),
            x.max(y),
            x.where_below(x, y, V::splat(t, 0.5)),
            first,
            second,
            sum,
            V::load_bytes(t, &a.map(|v| v.to_bits() as u8)),
        ];
        values.iter().flat_map(|v| v.array()).map(f32::to_bits).chain(whole.map(|v| v as u32)).collect()
    }

    #[test]
    fn avx2_gives_the_bits_that_every_processor_gives() {
        let Some(token) = Avx2::found() else { return };
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for k in 0..2000 {
            let size = 10f32.powi(k % 12 - 6);
            let mut some =
                || -> [f32; LANES] { std::array::from_fn(|_| size * rng.random_range(-1.0f32..1.0)) };
            let (a, b) = (some(), some());
            let pairs = std::array::from_fn(|i| [b[i], a[LANES - 1 - i]]);
            assert_eq!(all_of::<f32x8>((), &a, &b, &pairs), all_of::<Register>(token, &a, &b, &pairs));
        }
    }
}
