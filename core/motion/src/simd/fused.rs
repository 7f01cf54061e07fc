//! `a * b + c` rounded once, as the processors' fused multiply-adds do, by arithmetic that is the same everywhere.
//!
//! `f32::mul_add` is an instruction on 64-bit ARM. On x86-64 it is one only in functions compiled for FMA; elsewhere it calls a
//! function of the system, which is slow, and was wrong on some systems.

/// `a * b + c`, rounded once to the nearest, ties to even: the bits of IEEE 754's fusedMultiplyAdd but for a NaN's payload.
#[cfg(target_arch = "aarch64")]
#[inline(always)]
pub(crate) fn fused_multiply_add(a: f32, b: f32, c: f32) -> f32 {
    // The only permitted use of `mul_add`, which is an instruction on this architecture.
    a.mul_add(b, c)
}

#[cfg(not(target_arch = "aarch64"))]
pub(crate) use fma_by_f64 as fused_multiply_add;

/// The product of two f32 is exact in f64, so only the sum is rounded there, and then again to f32. Where the first rounding lost
/// something, the sum is rounded to odd instead: with more than two bits more than f32 has, the second rounding then sees on which
/// side of a tie the exact sum lies (S. Boldo and G. Melquiond, "Emulation of a FMA and correctly rounded sums", 2008).
#[cfg(any(test, not(target_arch = "aarch64")))]
#[inline(always)]
pub(crate) fn fma_by_f64(a: f32, b: f32, c: f32) -> f32 {
    let (product, c) = (f64::from(a) * f64::from(b), f64::from(c));
    let sum = product + c;
    // The exact rounding error of the sum (D. Knuth's TwoSum). It is NaN where the sum is not finite; then nothing is corrected.
    let part = sum - product;
    let lost = (product - (sum - part)) + (c - part);
    let bits = sum.to_bits();
    // An even last bit becomes odd by a step towards the exact sum: away from 0 where what was lost has the sum's sign. A sum
    // of 0 has lost nothing.
    let (needs_step, outwards) = ((lost < 0.0) | (lost > 0.0), (lost < 0.0) == (sum < 0.0));
    let step = u64::from(needs_step & (bits & 1 == 0));
    f64::from_bits(if outwards { bits.wrapping_add(step) } else { bits.wrapping_sub(step) }) as f32
}

#[cfg(test)]
mod tests {
    use super::fma_by_f64;

    /// The same in whole numbers: a finite f32 is m · 2^e, so a product and a sum are exact in 640 bits, from which the nearest f32 is
    /// found bit by bit.
    fn fma_by_integers(a: f32, b: f32, c: f32) -> f32 {
        // Bit 0 of a sum is 2^-298, the square of the smallest f32.
        let mantissa_and_exponent = |v: f32| {
            let (bits, exponent) = (v.to_bits() & 0x7F_FFFF, (v.to_bits() >> 23) & 0xFF);
            (u64::from(if exponent == 0 { bits } else { bits | 1 << 23 }), exponent.max(1) - 1)
        };
        let ((am, ae), (bm, be), (cm, ce)) =
            (mantissa_and_exponent(a), mantissa_and_exponent(b), mantissa_and_exponent(c));
        let product = Wide::shifted(am * bm, ae + be);
        let addend = Wide::shifted(cm, ce + 149);
        let (product_negative, c_negative) =
            (a.is_sign_negative() != b.is_sign_negative(), c.is_sign_negative());
        let (sum, negative) = if product_negative == c_negative {
            (product.plus(&addend), c_negative)
        } else if product.0.iter().rev().lt(addend.0.iter().rev()) {
            (addend.minus(&product), c_negative)
        } else if product.0 == addend.0 {
            return 0.0;
        } else {
            (product.minus(&addend), product_negative)
        };
        let nearest = sum.nearest();
        if negative { -nearest } else { nearest }
    }

    struct Wide([u64; 10]);

    impl Wide {
        fn shifted(value: u64, by: u32) -> Wide {
            let mut words = [0; 10];
            let (word, bit) = (by as usize / 64, by % 64);
            let wide = u128::from(value) << bit;
            words[word] = wide as u64;
            words[word + 1] = (wide >> 64) as u64;
            Wide(words)
        }
        fn plus(&self, b: &Wide) -> Wide {
            let mut carry = 0u128;
            Wide(std::array::from_fn(|i| {
                carry += u128::from(self.0[i]) + u128::from(b.0[i]);
                let word = carry as u64;
                carry >>= 64;
                word
            }))
        }
        fn minus(&self, b: &Wide) -> Wide {
            let mut borrow = false;
            Wide(std::array::from_fn(|i| {
                let (first, less) = self.0[i].overflowing_sub(b.0[i]);
                let (word, again) = first.overflowing_sub(u64::from(borrow));
                borrow = less || again;
                word
            }))
        }
        fn bit(&self, at: i32) -> bool {
            at >= 0 && self.0[at as usize / 64] >> (at % 64) & 1 == 1
        }
        /// The nearest f32: 24 bits from the highest one, but none below 2^-149, which is bit 149 here.
        fn nearest(&self) -> f32 {
            let top = (0..640).rev().find(|at| self.bit(*at)).unwrap_or(0);
            let low = (top - 23).max(149);
            let mut kept = (low..low + 24).fold(0u32, |m, at| m | u32::from(self.bit(at)) << (at - low));
            let below = (0..low - 1).any(|at| self.bit(at));
            if self.bit(low - 1) && (below || kept & 1 == 1) {
                kept += 1;
            }
            // 2^24 carries into the exponent by itself.
            let exponent = if kept >= 1 << 23 { low as u32 - 148 } else { 0 };
            let bits = if exponent == 0 { kept } else { (exponent << 23) + (kept - (1 << 23)) };
            f32::from_bits(bits.min(f32::INFINITY.to_bits()))
        }
    }

    fn check_fma(a: f32, b: f32, c: f32) {
        let (found, system) = (fma_by_f64(a, b, c), a.mul_add(b, c));
        if system.is_nan() {
            assert!(found.is_nan(), "{a:e} * {b:e} + {c:e} is {found:e}");
            return;
        }
        assert_eq!(
            found.to_bits(),
            system.to_bits(),
            "{a:e} * {b:e} + {c:e} is {found:e}, the system says {system:e}"
        );
        if a.is_finite() && b.is_finite() && c.is_finite() {
            let exact = fma_by_integers(a, b, c);
            assert!(found == exact, "{a:e} * {b:e} + {c:e} is {found:e}, exactly {exact:e}");
        }
    }

    #[test]
    fn fma_of_special_numbers_and_their_neighbors_is_exact() {
        let mut numbers = vec![0.0, f32::INFINITY, f32::NAN];
        for at in [1.0f32, 2.0, 3.0, 0.1, 1e-20, 1e20, f32::MIN_POSITIVE, f32::MAX, 16_777_216.0, 1.5e-23] {
            numbers.extend([at, at.next_up(), at.next_down()]);
        }
        numbers.extend([f32::from_bits(1), f32::from_bits(2), f32::from_bits(3), f32::from_bits(0x3F_FFFF)]);
        numbers.extend(numbers.clone().iter().map(|n| -n));
        for a in &numbers {
            for b in &numbers {
                for c in &numbers {
                    check_fma(*a, *b, *c);
                }
            }
        }
    }

    /// Sums halfway between two f32, or next to halfway by the smallest difference, which rounding twice gets wrong.
    #[test]
    fn fma_of_sums_on_and_beside_ties_is_exact() {
        let mut rounded_twice = 0;
        let mut bits = 1u64;
        for i in 0..200_000 {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let [a, b] = [(bits >> 40) as u32, (bits >> 16) as u32]
                .map(|m| f32::from_bits(0x3F80_0000 | m >> 1 & 0x7F_FFFF));
            let exponent = (bits >> 8) as u32 % 60;
            let c = f32::from_bits((0x3F80_0000 - (30 << 23)) + (exponent << 23) + (i % 3));
            for c in [c, -c] {
                check_fma(a, b, c);
                let naive = (f64::from(a) * f64::from(b) + f64::from(c)) as f32;
                rounded_twice += u32::from(naive.to_bits() != fma_by_f64(a, b, c).to_bits());
            }
        }
        // The product of 1 + 2^-12 and 1 + 2^-12 is a tie; a tiny addend decides whether it is rounded up or down.
        let tie = 1.0 + 2f32.powi(-12);
        for little in [f32::from_bits(1), 1e-30, 1e-12] {
            for c in [little, -little] {
                check_fma(tie, tie, c);
                check_fma(-tie, tie, c);
                let naive = (f64::from(tie) * f64::from(tie) + f64::from(c)) as f32;
                rounded_twice += u32::from(naive.to_bits() != fma_by_f64(tie, tie, c).to_bits());
            }
        }
        assert!(rounded_twice >= 2, "no case showed the second rounding: {rounded_twice}");
    }

    #[test]
    fn fma_of_random_bits_is_exact() {
        let mut bits = 9u64;
        let mut next = || {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            f32::from_bits((bits >> 32) as u32)
        };
        for _ in 0..300_000 {
            check_fma(next(), next(), next());
        }
    }
}
