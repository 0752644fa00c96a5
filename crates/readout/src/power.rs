//! x^α for many x at once.
//!
//! The standard library's takes longer than all the rest of a transfer, and computes one at a time. Here x = 2^k m with m around 1,
//! ln m by the series of artanh, and the exponential by that of its remainder, both truncated where the next term is below
//! rounding: Muller, *Elementary Functions* (2016), chapters 3 and 11. Terms are added in pairs, and pairs of pairs (Estrin's
//! scheme, chapter 5), so that the processor need not wait for one before it begins the next.

/// x^α for positive, finite x; relative error 1e-13 if neither x nor the result is below 1e-300. A loop over many x compiles to
/// vector instructions.
#[inline(always)]
pub(super) fn power(x: f64, alpha: f64) -> f64 {
    exp2(alpha * log2(x))
}

/// 2^52 + 2^51: adding it to a small number rounds that to an integer, which is then in the lowest bits.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// Terms of artanh(s)/s in s²: 1/(2k + 1).
const ARTANH: [f64; 11] = {
    let mut terms = [0.0; 11];
    let mut k = 0;
    while k < terms.len() {
        terms[k] = 1.0 / (2 * k + 1) as f64;
        k += 1;
    }
    terms
};

/// Terms of the exponential: 1/k!.
const EXP: [f64; 14] = {
    let mut terms = [1.0; 14];
    let mut k = 1;
    while k < terms.len() {
        terms[k] = terms[k - 1] / k as f64;
        k += 1;
    }
    terms
};

#[inline(always)]
fn log2(x: f64) -> f64 {
    const SQRT_HALF: u64 = 0x3FE6_A09E_667F_3BCD;
    const ONE: u64 = 0x3FF0_0000_0000_0000;
    // The distance of the bits above those of √½ gives the exponent for a mantissa between √½ and √2.
    let above = x.to_bits().wrapping_add(ONE - SQRT_HALF);
    let exponent = above >> 52;
    let mantissa = f64::from_bits((above & 0x000F_FFFF_FFFF_FFFF) + SQRT_HALF);
    // Converted to a number by bit operations, since AVX2 has no such conversion.
    let exponent = f64::from_bits(exponent | 0x4330_0000_0000_0000) - 4_503_599_627_370_496.0 - 1023.0;
    let s = (mantissa - 1.0) / (mantissa + 1.0);
    let z = s * s;
    let (z2, z4) = (z * z, (z * z) * (z * z));
    let pair = |k: usize| ARTANH[k] + ARTANH[k + 1] * z;
    let four = |k: usize| pair(k) + pair(k + 2) * z2;
    let series = four(0) + (four(4) + (pair(8) + ARTANH[10] * z2) * z4) * z4;
    exponent + s * series * (2.0 / std::f64::consts::LN_2)
}

/// 2^y with relative error 1e-13, for y from −1022 to 1023; beyond, the value at the nearest of them.
#[inline(always)]
pub(super) fn exp2(y: f64) -> f64 {
    let y = if y > -1022.0 { y } else { -1022.0 };
    let y = if y < 1023.0 { y } else { 1023.0 };
    let rounded = y + ROUND;
    let whole = rounded - ROUND;
    let r = (y - whole) * std::f64::consts::LN_2;
    let (r2, r4) = (r * r, (r * r) * (r * r));
    let pair = |k: usize| EXP[k] + EXP[k + 1] * r;
    let four = |k: usize| pair(k) + pair(k + 2) * r2;
    let series = (four(0) + four(4) * r4) + (four(8) + pair(12) * r4) * (r4 * r4);
    series * f64::from_bits(rounded.to_bits().wrapping_add(1023) << 52)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_is_that_of_the_standard_library() {
        let mut worst: f64 = 0.0;
        for alpha in [1e-3, 0.1, 0.33, 0.5, 0.576, 0.9, 1.0, 1.7, 3.0, 10.0] {
            for step in -2000..400 {
                let x = (f64::from(step) * 0.03).exp();
                let known = x.powf(alpha);
                if known > 1e-300 {
                    worst = worst.max((power(x, alpha) / known - 1.0).abs());
                }
            }
        }
        assert!(worst < 1e-13, "{worst:e}");
        assert!((power(1.0, 0.5) - 1.0).abs() < 1e-15);
    }
}
