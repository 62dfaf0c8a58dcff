//! The exact path's loops, left to the compiler to vectorise, compiled for the vectors that this CPU has.
//!
//! OpenCV fuses multiply and add where the CPU can, so this path must do so too, and that is a property of the CPU at
//! hand: the one call of a function that enables AVX2 and FMA is `unsafe`.
#![allow(
    unsafe_code,
    reason = "a function that enables an instruction set may only be called where the CPU has it"
)]

/// a·b + c with one rounding or two: OpenCV fuses where the CPU can, so equal bits need the same.
pub(crate) trait MulAdd {
    fn mul_add(a: f32, b: f32, c: f32) -> f32;
}

#[allow(dead_code, reason = "which of the two is used depends on the architecture")]
pub(crate) struct Fused;
#[allow(dead_code, reason = "which of the two is used depends on the architecture")]
pub(crate) struct Separate;

impl MulAdd for Fused {
    #[inline(always)]
    fn mul_add(a: f32, b: f32, c: f32) -> f32 {
        a.mul_add(b, c)
    }
}

impl MulAdd for Separate {
    #[inline(always)]
    fn mul_add(a: f32, b: f32, c: f32) -> f32 {
        a * b + c
    }
}

/// A loop to be compiled for several instruction sets; `run` must be `#[inline(always)]`.
pub(crate) trait Work {
    type Output;
    fn run<M: MulAdd>(self) -> Self::Output;
}

/// Runs `work` as compiled for this CPU.
pub(crate) fn run<W: Work>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        // SAFETY: both instruction sets were found on this CPU.
        return unsafe { run_avx2(work) };
    }
    #[cfg(target_arch = "aarch64")]
    type Plain = Fused;
    #[cfg(not(target_arch = "aarch64"))]
    type Plain = Separate;
    work.run::<Plain>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn run_avx2<W: Work>(work: W) -> W::Output {
    work.run::<Fused>()
}
