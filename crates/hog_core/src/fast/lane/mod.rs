//! The vector that kernels are written for: one trait, one implementation per instruction set.

/// Runs intrinsics that the token `self` allows.
macro_rules! isa {
    ($e:expr) => {{
        // SAFETY: the token proves that the CPU has the instruction set; pointers are the caller's promise.
        unsafe { $e }
    }};
}

/// A type whose value proves that the CPU has the instruction set `$features`.
macro_rules! token {
    ($name:ident, $features:literal) => {
        #[doc = concat!("Proof that the CPU has ", $features, ".")]
        #[derive(Debug, Clone, Copy)]
        pub(in crate::fast) struct $name(());

        impl $name {
            #[doc = concat!("# Safety\nThe CPU has ", $features, ".")]
            #[inline(always)]
            pub(in crate::fast) const unsafe fn new() -> Self {
                Self(())
            }
        }
    };
}

/// Methods of [`Lane`] that are one instruction each, with the operands in the same order.
macro_rules! instructions {
    ($($name:ident($($operand:ident: $kind:ty),*) -> $out:ty = $intrinsic:ident;)*) => {$(
        #[inline(always)]
        fn $name(self, $($operand: $kind),*) -> $out {
            isa!($intrinsic($($operand),*))
        }
    )*};
}

/// Gives a [`Lane`] its `compiled`: a function of its own that enables `$features`.
macro_rules! compiled {
    ($features:literal) => {
        #[inline(always)]
        fn compiled<K: $crate::fast::lane::Kernel>(self, kernel: K) -> K::Output {
            #[target_feature(enable = $features)]
            #[inline(never)]
            fn enabled<L: $crate::fast::lane::Lane, K: $crate::fast::lane::Kernel>(
                l: L,
                kernel: K,
            ) -> K::Output {
                kernel.run(l)
            }
            // SAFETY: the token proves that the CPU has these features.
            unsafe { enabled(self, kernel) }
        }
    };
}

#[cfg(target_arch = "x86_64")]
pub(super) mod avx2;
#[cfg(target_arch = "x86_64")]
pub(super) mod avx512;
mod columns;
#[cfg(target_arch = "aarch64")]
pub(super) mod neon;
pub(super) mod portable;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
pub(super) mod simd128;
#[cfg(target_arch = "x86_64")]
pub(super) mod sse41;

pub(super) use columns::{Columns, RowPointers};

/// The first of the slots for odd bins.
pub(super) const ODD: usize = 8;

/// A stage of the fast path, to be compiled once for each instruction set by [`Lane::compiled`].
///
/// Each is a function of its own: together in one, a change to one stage moves the registers of the others, which cost
/// up to a tenth of the time.
pub(super) trait Kernel {
    type Output;
    /// Must be `#[inline(always)]`.
    fn run<L: Lane>(self, l: L) -> Self::Output;
}

/// The operations of one instruction set on vectors of [`LANES`](Self::LANES) single precision numbers.
///
/// A value of an implementing type is the proof that the CPU has the instruction set: it can only be made (unsafely)
/// after detection. Methods are `#[inline(always)]`, so that a [`Kernel`] is compiled whole inside the one function that
/// enables the instruction set; called elsewhere they are right, but slow.
pub(super) trait Lane: Copy {
    /// Numbers in a vector.
    const LANES: usize;
    /// Whether the registers (32) hold all 27 sums of a cell at once, or only a third of them (16 registers).
    const WIDE: bool;
    /// Single precision numbers.
    type F: Copy;
    /// 32-bit words.
    type I: Copy;
    /// Totals of the quantised prefilter.
    type Sum: Copy;
    /// One truth value per lane.
    type M: Copy;
    /// A vector of which only some lanes count; the others stand for 0.
    type Masked: Copy;
    /// The slots of the two bins that each lane votes for.
    type Slots: Copy;
    /// Output pixels that `resize_row` makes at a time.
    const GROUP: usize;
    /// Source pixels that a part of such a group may span.
    const REACH: usize;

    /// Vectors of windows that the quantised prefilter takes at a time; 0: no prefilter, all windows are scored in
    /// single precision.
    const PREFILTER_VECTORS: usize;

    /// A vector of at most [`ACROSS`](super::layout::ACROSS) lanes that this CPU has too: for single windows, and for a
    /// level's last strip where its lanes are enough.
    type Narrow: Lane;
    fn narrow(self) -> Self::Narrow;
    /// Runs `kernel` in a function that enables the instruction set.
    fn compiled<K: Kernel>(self, kernel: K) -> K::Output;

    fn splat(self, x: f32) -> Self::F;
    /// # Safety
    /// `from` points at `LANES` readable numbers.
    unsafe fn load(self, from: *const f32) -> Self::F;
    /// # Safety
    /// `to` points at `LANES` writable numbers.
    unsafe fn store(self, to: *mut f32, x: Self::F);
    fn add(self, a: Self::F, b: Self::F) -> Self::F;
    fn sub(self, a: Self::F, b: Self::F) -> Self::F;
    fn mul(self, a: Self::F, b: Self::F) -> Self::F;
    fn min(self, a: Self::F, b: Self::F) -> Self::F;
    fn max(self, a: Self::F, b: Self::F) -> Self::F;
    /// a·b + c.
    fn mul_add(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// a·b − c.
    fn mul_sub(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    fn abs(self, x: Self::F) -> Self::F;
    /// min(|a|, |b|).
    #[inline(always)]
    fn min_abs(self, a: Self::F, b: Self::F) -> Self::F {
        self.min(self.abs(a), self.abs(b))
    }
    /// max(|a|, |b|).
    #[inline(always)]
    fn max_abs(self, a: Self::F, b: Self::F) -> Self::F {
        self.max(self.abs(a), self.abs(b))
    }
    /// The square root, correctly rounded.
    fn sqrt(self, x: Self::F) -> Self::F;
    /// The square root of a whole number of 0..=255: correctly rounded, or from an estimate that
    /// [`dispatch`](super::dispatch) checks for all 256 values.
    #[inline(always)]
    fn sqrt_of_byte(self, x: Self::F) -> Self::F {
        self.sqrt(x)
    }
    /// The square root within 2 ulp; 0 of 0.
    #[inline(always)]
    fn sqrt_approx(self, x: Self::F) -> Self::F {
        self.sqrt(x)
    }
    /// a / b, correctly rounded.
    fn div(self, a: Self::F, b: Self::F) -> Self::F;
    /// a / b within 2 ulp for 0 ≤ a ≤ b; 0 where both are 0.
    #[inline(always)]
    fn div_approx(self, a: Self::F, b: Self::F) -> Self::F {
        self.div(a, self.max(b, self.splat(1e-20)))
    }
    fn less(self, a: Self::F, b: Self::F) -> Self::M;
    /// −x where `mask`, else x.
    fn negate_where(self, mask: Self::M, x: Self::F) -> Self::F;
    /// 0 where `mask`, else x.
    fn zero_where(self, mask: Self::M, x: Self::F) -> Self::F;
    /// `yes` where `mask`, else `no`.
    fn select(self, mask: Self::M, yes: Self::F, no: Self::F) -> Self::F;
    /// `x` with its sign flipped where exactly one of `a`, `b` is negative.
    fn flip_by_signs(self, x: Self::F, a: Self::F, b: Self::F) -> Self::F;
    /// For positions in 0..5: the distance to the nearest integer, and the slots of the integer below (0 to 4) and of
    /// the nearest one ([`ODD`] to `ODD` + 5).
    fn slots(self, position: Self::F) -> (Self::F, Self::Slots);
    /// `x` in those lanes that have `slot` among their slots.
    fn keep(self, x: Self::F, slots: Self::Slots, slot: usize) -> Self::Masked;
    /// `one.0` in the lanes that have slot `one.1`, `other.0` in those that have `other.1`; no lane has both.
    fn keep_either(self, slots: Self::Slots, one: (Self::F, usize), other: (Self::F, usize)) -> Self::Masked;
    /// sum + x·weight.
    fn mul_add_masked(self, x: Self::Masked, weight: Self::F, sum: Self::F) -> Self::F;
    /// The same, given `product` = vote·weight of the vote that `x` was kept from: addition and multiplication may run
    /// on different units.
    #[inline(always)]
    fn add_product(self, x: Self::Masked, product: Self::F, weight: Self::F, sum: Self::F) -> Self::F {
        let _ = product;
        self.mul_add_masked(x, weight, sum)
    }
    /// Lanes 1.. of `x`, then `next`.
    fn shift_in(self, x: Self::F, next: f32) -> Self::F;
    /// `before`, then all lanes of `x` but the last.
    fn shift_up(self, x: Self::F, before: f32) -> Self::F;
    /// Lane 0.
    fn first(self, x: Self::F) -> f32;
    /// The low halves of `LANES` 8-byte words.
    /// # Safety
    /// `from` points at `8 * LANES` readable bytes.
    unsafe fn low_words(self, from: *const u8) -> Self::I;
    /// The high halves of `LANES` 8-byte words.
    /// # Safety
    /// `from` points at `8 * LANES` readable bytes.
    unsafe fn high_words(self, from: *const u8) -> Self::I;
    /// Byte `K` of every word, as a number.
    fn byte<const K: u32>(self, words: Self::I) -> Self::F;
    /// Four numbers of 0..=255 per lane, rounded, as the four bytes of a word.
    /// # Safety
    /// `to` points at `LANES` writable words.
    unsafe fn store_bytes(self, to: *mut u32, x: [Self::F; 4]);
    /// # Safety
    /// `from` points at `LANES` readable words.
    unsafe fn load_words(self, from: *const u32) -> Self::I;
    fn splat_word(self, word: u32) -> Self::I;
    /// Totals of nothing.
    fn no_sum(self) -> Self::Sum;
    /// The value that a block's sum of `dot_bytes` starts from, if the sum is to be added to `total`.
    fn begin_block(self, total: Self::Sum) -> Self::Sum;
    /// sum + the products of the four unsigned bytes with the four signed weights of each word.
    fn dot_bytes(self, sum: Self::Sum, bytes: Self::I, weights: Self::I) -> Self::Sum;
    /// The total with a block's sum, counted `multiple` times.
    fn end_block(self, total: Self::Sum, sum: Self::Sum, multiple: i32) -> Self::Sum;
    /// One bit per lane: whether the total is at least `least`.
    fn at_least(self, total: Self::Sum, least: i32) -> u32;

    /// One row of a level in `C` channels: neighbouring pixels of two rows (each byte flipped by 0x80) mixed as
    /// `columns` says, then (upper·(256 − weight) + lower·weight) / 2¹⁶, rounded half up.
    /// # Safety
    /// The taps of `columns` and [`SLACK`](super::layout::SLACK) bytes after them are readable in all rows; `to` has
    /// room for all groups.
    unsafe fn resize_row<const C: usize>(self, rows: [RowPointers; C], weight: i16, columns: &Columns);

    /// Splits `len` interleaved pixels of three channels into planes, every byte xor `FLIP`.
    /// # Safety
    /// `from` has 3 · `len` bytes, each of `to` has `len`.
    #[inline(always)]
    unsafe fn deinterleave<const FLIP: u8>(self, from: *const u8, to: [*mut u8; 3], len: usize) {
        for i in 0..len {
            for (channel, to) in to.iter().enumerate() {
                // SAFETY: the caller's promise.
                unsafe { to.add(i).write(*from.add(3 * i + channel) ^ FLIP) };
            }
        }
    }
}
