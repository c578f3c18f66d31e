//! The square root, which `core` lacks. IEEE 754 rounds it exactly, so both versions give the same bits.

#[inline(always)]
pub(crate) fn sqrt(value: f32) -> f32 {
    #[cfg(feature = "std")]
    return value.sqrt();
    #[cfg(not(feature = "std"))]
    return libm::sqrtf(value);
}

#[inline(always)]
pub(crate) fn sqrt_f64(value: f64) -> f64 {
    #[cfg(feature = "std")]
    return value.sqrt();
    #[cfg(not(feature = "std"))]
    return libm::sqrt(value);
}
