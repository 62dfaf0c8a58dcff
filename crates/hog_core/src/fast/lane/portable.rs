//! Four lanes in plain Rust, which the compiler vectorises for the architecture's baseline (SSE2 on x86-64).

use super::{Columns, Kernel, Lane, ODD, RowPointers};

/// No instruction set beyond the architecture's baseline.
#[derive(Clone, Copy)]
pub(in crate::fast) struct Portable;

/// Four numbers, aligned as a vector.
#[derive(Clone, Copy)]
#[repr(align(16))]
pub(in crate::fast) struct Four<T>([T; 4]);

/// `expression` of every lane `i`.
macro_rules! lanes {
    ($i:ident => $expression:expr) => {
        Four([
            {
                const $i: usize = 0;
                $expression
            },
            {
                const $i: usize = 1;
                $expression
            },
            {
                const $i: usize = 2;
                $expression
            },
            {
                const $i: usize = 3;
                $expression
            },
        ])
    };
}

impl Lane for Portable {
    const LANES: usize = 4;
    const WIDE: bool = false;
    const GROUP: usize = 8;
    const REACH: usize = 16;
    const PREFILTER_VECTORS: usize = 0;
    type F = Four<f32>;
    type I = Four<u32>;
    type Sum = ();
    type M = Four<bool>;
    type Masked = Four<f32>;
    /// The integer below the position, and the nearest one.
    type Slots = [Four<f32>; 2];
    type Narrow = Self;

    #[inline(always)]
    fn narrow(self) -> Self {
        self
    }
    #[inline(never)]
    fn compiled<K: Kernel>(self, kernel: K) -> K::Output {
        kernel.run(self)
    }

    #[inline(always)]
    fn splat(self, x: f32) -> Four<f32> {
        Four([x; 4])
    }
    #[inline(always)]
    unsafe fn load(self, from: *const f32) -> Four<f32> {
        // SAFETY: the caller's promise.
        Four(unsafe { from.cast::<[f32; 4]>().read_unaligned() })
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut f32, x: Four<f32>) {
        // SAFETY: the caller's promise.
        unsafe { to.cast::<[f32; 4]>().write_unaligned(x.0) };
    }
    #[inline(always)]
    fn add(self, a: Four<f32>, b: Four<f32>) -> Four<f32> {
        lanes!(I => a.0[I] + b.0[I])
    }
    #[inline(always)]
    fn sub(self, a: Four<f32>, b: Four<f32>) -> Four<f32> {
        lanes!(I => a.0[I] - b.0[I])
    }
    #[inline(always)]
    fn mul(self, a: Four<f32>, b: Four<f32>) -> Four<f32> {
        lanes!(I => a.0[I] * b.0[I])
    }
    #[inline(always)]
    fn min(self, a: Four<f32>, b: Four<f32>) -> Four<f32> {
        lanes!(I => if a.0[I] < b.0[I] { a.0[I] } else { b.0[I] })
    }
    #[inline(always)]
    fn max(self, a: Four<f32>, b: Four<f32>) -> Four<f32> {
        lanes!(I => if a.0[I] > b.0[I] { a.0[I] } else { b.0[I] })
    }
    #[inline(always)]
    fn mul_add(self, a: Four<f32>, b: Four<f32>, c: Four<f32>) -> Four<f32> {
        lanes!(I => a.0[I] * b.0[I] + c.0[I])
    }
    #[inline(always)]
    fn mul_sub(self, a: Four<f32>, b: Four<f32>, c: Four<f32>) -> Four<f32> {
        lanes!(I => a.0[I] * b.0[I] - c.0[I])
    }
    #[inline(always)]
    fn abs(self, x: Four<f32>) -> Four<f32> {
        lanes!(I => x.0[I].abs())
    }
    #[inline(always)]
    fn sqrt(self, x: Four<f32>) -> Four<f32> {
        lanes!(I => x.0[I].sqrt())
    }
    #[inline(always)]
    fn div(self, a: Four<f32>, b: Four<f32>) -> Four<f32> {
        lanes!(I => a.0[I] / b.0[I])
    }
    #[inline(always)]
    fn less(self, a: Four<f32>, b: Four<f32>) -> Four<bool> {
        lanes!(I => a.0[I] < b.0[I])
    }
    #[inline(always)]
    fn negate_where(self, mask: Four<bool>, x: Four<f32>) -> Four<f32> {
        lanes!(I => if mask.0[I] { -x.0[I] } else { x.0[I] })
    }
    #[inline(always)]
    fn zero_where(self, mask: Four<bool>, x: Four<f32>) -> Four<f32> {
        lanes!(I => if mask.0[I] { 0.0 } else { x.0[I] })
    }
    #[inline(always)]
    fn select(self, mask: Four<bool>, yes: Four<f32>, no: Four<f32>) -> Four<f32> {
        lanes!(I => if mask.0[I] { yes.0[I] } else { no.0[I] })
    }
    #[inline(always)]
    fn flip_by_signs(self, x: Four<f32>, a: Four<f32>, b: Four<f32>) -> Four<f32> {
        const SIGN: u32 = 1 << 31;
        lanes!(I => f32::from_bits(x.0[I].to_bits() ^ ((a.0[I].to_bits() ^ b.0[I].to_bits()) & SIGN)))
    }
    #[inline(always)]
    fn slots(self, position: Four<f32>) -> (Four<f32>, [Four<f32>; 2]) {
        let below = lanes!(I => whole(position.0[I]) as f32);
        let nearest = lanes!(I => whole(position.0[I] + 0.5) as f32);
        (self.abs(self.sub(position, nearest)), [below, nearest])
    }
    #[inline(always)]
    fn keep(self, x: Four<f32>, slots: [Four<f32>; 2], slot: usize) -> Four<f32> {
        let wanted = (slot % ODD) as f32;
        lanes!(I => if slots[slot / ODD].0[I] == wanted { x.0[I] } else { 0.0 })
    }
    #[inline(always)]
    fn keep_either(
        self,
        slots: [Four<f32>; 2],
        one: (Four<f32>, usize),
        other: (Four<f32>, usize),
    ) -> Four<f32> {
        let (one, other) = (self.keep(one.0, slots, one.1), self.keep(other.0, slots, other.1));
        lanes!(I => f32::from_bits(one.0[I].to_bits() | other.0[I].to_bits()))
    }
    #[inline(always)]
    fn mul_add_masked(self, x: Four<f32>, weight: Four<f32>, sum: Four<f32>) -> Four<f32> {
        self.mul_add(x, weight, sum)
    }
    #[inline(always)]
    fn shift_in(self, x: Four<f32>, next: f32) -> Four<f32> {
        Four([x.0[1], x.0[2], x.0[3], next])
    }
    #[inline(always)]
    fn shift_up(self, x: Four<f32>, before: f32) -> Four<f32> {
        Four([before, x.0[0], x.0[1], x.0[2]])
    }
    #[inline(always)]
    fn first(self, x: Four<f32>) -> f32 {
        x.0[0]
    }
    #[inline(always)]
    unsafe fn low_words(self, from: *const u8) -> Four<u32> {
        // SAFETY: the caller's promise.
        let words = unsafe { from.cast::<[[u8; 8]; 4]>().read_unaligned() };
        lanes!(I => u64::from_le_bytes(words[I]) as u32)
    }
    #[inline(always)]
    unsafe fn high_words(self, from: *const u8) -> Four<u32> {
        // SAFETY: the caller's promise.
        let words = unsafe { from.cast::<[[u8; 8]; 4]>().read_unaligned() };
        lanes!(I => (u64::from_le_bytes(words[I]) >> 32) as u32)
    }
    #[inline(always)]
    fn byte<const K: u32>(self, words: Four<u32>) -> Four<f32> {
        lanes!(I => (words.0[I] >> (8 * K) & 0xff).cast_signed() as f32)
    }
    #[inline(always)]
    unsafe fn store_bytes(self, to: *mut u32, x: [Four<f32>; 4]) {
        let byte = |x: f32, k: u32| whole(x + 0.5).cast_unsigned() << (8 * k);
        let words =
            lanes!(I => byte(x[0].0[I], 0) | byte(x[1].0[I], 1) | byte(x[2].0[I], 2) | byte(x[3].0[I], 3));
        // SAFETY: the caller's promise.
        unsafe { to.cast::<[u32; 4]>().write_unaligned(words.0) };
    }
    #[inline(always)]
    unsafe fn load_words(self, from: *const u32) -> Four<u32> {
        // SAFETY: the caller's promise.
        Four(unsafe { from.cast::<[u32; 4]>().read_unaligned() })
    }
    #[inline(always)]
    fn splat_word(self, word: u32) -> Four<u32> {
        Four([word; 4])
    }
    #[inline(always)]
    fn no_sum(self) {}
    #[inline(always)]
    fn begin_block(self, (): ()) {}
    #[inline(always)]
    fn dot_bytes(self, (): (), _: Four<u32>, _: Four<u32>) {}
    #[inline(always)]
    fn end_block(self, (): (), (): (), _: i32) {}
    #[inline(always)]
    fn at_least(self, (): (), _: i32) -> u32 {
        u32::MAX
    }

    #[inline(always)]
    unsafe fn resize_row<const C: usize>(self, rows: [RowPointers; C], weight: i16, columns: &Columns) {
        let shares = [256 - weight.cast_unsigned(), weight.cast_unsigned()];
        let pairs = columns.index.as_chunks::<16>().0.iter().zip(columns.weight.as_chunks::<16>().0);
        for (part, ((index, weight), &base)) in pairs.zip(&columns.base).enumerate() {
            for rows in &rows {
                // SAFETY: a part spans REACH pixels, and SLACK bytes behind a row are readable: the caller's promise.
                let [upper, lower] = [rows.upper, rows.lower].map(|row| unsafe {
                    row.add(base as usize).cast::<[u8; Self::REACH]>().read_unaligned()
                });
                let mut mixed = [0; Self::REACH];
                for ((mixed, upper), lower) in mixed.iter_mut().zip(upper).zip(lower) {
                    *mixed = u16::from(upper ^ 0x80) * shares[0] + u16::from(lower ^ 0x80) * shares[1];
                }
                for i in 0..8 {
                    if weight[2 * i] == 0 {
                        continue; // this pixel is another part's
                    }
                    let share = |k: usize| {
                        u32::from(mixed[usize::from(index[k]) % Self::REACH]) * u32::from(weight[k])
                    };
                    let sum = share(2 * i) + share(2 * i + 1) + (1 << 15);
                    // SAFETY: `to` has room for all groups: the caller's promise.
                    unsafe { rows.to.add(part / columns.parts * 8 + i).write((sum >> 16) as u8) };
                }
            }
        }
    }
}

/// The whole part of a number of 0..=255.5.
#[inline(always)]
fn whole(x: f32) -> i32 {
    debug_assert!((0.0..256.0).contains(&x));
    // SAFETY: the number fits.
    unsafe { x.to_int_unchecked() }
}
