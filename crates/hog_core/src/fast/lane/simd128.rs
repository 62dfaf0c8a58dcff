//! WebAssembly's simd128: 4 lanes, the 16 registers of the CPUs that browsers compile it for, no fused multiply-add.
#![allow(unused_unsafe, reason = "a module has simd128 or not, so that most intrinsics are safe here")]

use std::arch::wasm32::*;

use super::{Columns, Lane, ODD, RowPointers};

token!(Simd128, "simd128");

impl Lane for Simd128 {
    const LANES: usize = 4;
    const WIDE: bool = false;
    const GROUP: usize = 8;
    const REACH: usize = 32;
    const PREFILTER_VECTORS: usize = 1;
    type F = v128;
    /// The even bytes of each word as two numbers of 16 bits, and the odd ones: there is no product of bytes.
    type I = [v128; 2];
    type Sum = v128;
    type M = v128;
    type Masked = v128;
    /// The integer below the position, and the nearest one.
    type Slots = [v128; 2];

    type Narrow = Self;

    #[inline(always)]
    fn narrow(self) -> Self {
        self
    }
    compiled!("simd128");

    instructions! {
        splat(x: f32) -> v128 = f32x4_splat;
        add(a: v128, b: v128) -> v128 = f32x4_add;
        sub(a: v128, b: v128) -> v128 = f32x4_sub;
        mul(a: v128, b: v128) -> v128 = f32x4_mul;
        min(a: v128, b: v128) -> v128 = f32x4_pmin;
        max(a: v128, b: v128) -> v128 = f32x4_pmax;
        abs(x: v128) -> v128 = f32x4_abs;
        sqrt(x: v128) -> v128 = f32x4_sqrt;
        div(a: v128, b: v128) -> v128 = f32x4_div;
        less(a: v128, b: v128) -> v128 = f32x4_lt;
    }

    #[inline(always)]
    unsafe fn load(self, from: *const f32) -> v128 {
        isa!(v128_load(from.cast()))
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut f32, x: v128) {
        isa!(v128_store(to.cast(), x));
    }
    #[inline(always)]
    fn mul_add(self, a: v128, b: v128, c: v128) -> v128 {
        self.add(self.mul(a, b), c)
    }
    #[inline(always)]
    fn mul_sub(self, a: v128, b: v128, c: v128) -> v128 {
        self.sub(self.mul(a, b), c)
    }
    #[inline(always)]
    fn negate_where(self, mask: v128, x: v128) -> v128 {
        isa!(v128_xor(x, v128_and(mask, f32x4_splat(-0.0))))
    }
    #[inline(always)]
    fn zero_where(self, mask: v128, x: v128) -> v128 {
        isa!(v128_andnot(x, mask))
    }
    #[inline(always)]
    fn select(self, mask: v128, yes: v128, no: v128) -> v128 {
        isa!(v128_bitselect(yes, no, mask))
    }
    #[inline(always)]
    fn flip_by_signs(self, x: v128, a: v128, b: v128) -> v128 {
        isa!(v128_xor(x, v128_and(v128_xor(a, b), f32x4_splat(-0.0))))
    }
    #[inline(always)]
    fn slots(self, position: v128) -> (v128, [v128; 2]) {
        let (below, nearest) = isa!((f32x4_floor(position), f32x4_nearest(position)));
        (self.abs(self.sub(position, nearest)), [below, nearest])
    }
    #[inline(always)]
    fn keep(self, x: v128, slots: [v128; 2], slot: usize) -> v128 {
        isa!(v128_and(x, f32x4_eq(slots[slot / ODD], f32x4_splat((slot % ODD) as f32))))
    }
    #[inline(always)]
    fn keep_either(self, slots: [v128; 2], one: (v128, usize), other: (v128, usize)) -> v128 {
        let (one, other) = (self.keep(one.0, slots, one.1), self.keep(other.0, slots, other.1));
        isa!(v128_or(one, other))
    }
    #[inline(always)]
    fn mul_add_masked(self, x: v128, weight: v128, sum: v128) -> v128 {
        self.mul_add(x, weight, sum)
    }
    #[inline(always)]
    fn shift_in(self, x: v128, next: f32) -> v128 {
        isa!(i32x4_shuffle::<1, 2, 3, 4>(x, f32x4_splat(next)))
    }
    #[inline(always)]
    fn shift_up(self, x: v128, before: f32) -> v128 {
        isa!(i32x4_shuffle::<3, 4, 5, 6>(f32x4_splat(before), x))
    }
    #[inline(always)]
    fn first(self, x: v128) -> f32 {
        isa!(f32x4_extract_lane::<0>(x))
    }
    #[inline(always)]
    unsafe fn low_words(self, from: *const u8) -> [v128; 2] {
        isa!({
            let (a, b) = (v128_load(from.cast()), v128_load(from.add(16).cast()));
            split(i32x4_shuffle::<0, 2, 4, 6>(a, b))
        })
    }
    #[inline(always)]
    unsafe fn high_words(self, from: *const u8) -> [v128; 2] {
        isa!({
            let (a, b) = (v128_load(from.cast()), v128_load(from.add(16).cast()));
            split(i32x4_shuffle::<1, 3, 5, 7>(a, b))
        })
    }
    #[inline(always)]
    fn byte<const K: u32>(self, words: [v128; 2]) -> v128 {
        isa!({
            let pair = words[K as usize % 2];
            f32x4_convert_i32x4(if K < 2 { v128_and(pair, i32x4_splat(0xffff)) } else { u32x4_shr(pair, 16) })
        })
    }
    #[inline(always)]
    unsafe fn store_bytes(self, to: *mut u32, x: [v128; 4]) {
        isa!({
            // 2²³ leaves no bits behind the point: the sum rounds, and its lowest byte is the number.
            let [a, b, c, d] = x.map(|x| f32x4_add(x, f32x4_splat(8_388_608.0)));
            let (a, b) = (v128_and(a, i32x4_splat(0xff)), i32x4_shl(b, 8));
            let word = v128_or(v128_or(a, b), v128_or(i32x4_shl(c, 16), i32x4_shl(d, 24)));
            v128_store(to.cast(), word);
        });
    }
    #[inline(always)]
    unsafe fn load_words(self, from: *const u32) -> [v128; 2] {
        isa!(split(v128_load(from.cast())))
    }
    #[inline(always)]
    fn splat_word(self, word: u32) -> [v128; 2] {
        isa!({
            let words = u32x4_splat(word);
            [i16x8_shr(i16x8_shl(words, 8), 8), i16x8_shr(words, 8)]
        })
    }
    #[inline(always)]
    fn no_sum(self) -> v128 {
        isa!(i32x4_splat(0))
    }
    #[inline(always)]
    fn begin_block(self, total: v128) -> v128 {
        total
    }
    #[inline(always)]
    fn dot_bytes(self, sum: v128, bytes: [v128; 2], weights: [v128; 2]) -> v128 {
        isa!({
            let sum = i32x4_add(sum, i32x4_dot_i16x8(bytes[0], weights[0]));
            i32x4_add(sum, i32x4_dot_i16x8(bytes[1], weights[1]))
        })
    }
    #[inline(always)]
    fn end_block(self, _total: v128, sum: v128, _multiple: i32) -> v128 {
        sum // every multiple is 1
    }
    #[inline(always)]
    fn at_least(self, total: v128, least: i32) -> u32 {
        isa!(u32::from(i32x4_bitmask(i32x4_ge(total, i32x4_splat(least)))))
    }

    #[inline(always)]
    unsafe fn resize_row<const C: usize>(self, rows: [RowPointers; C], weight: i16, columns: &Columns) {
        isa!({
            let (parts, one_vector) = (columns.parts, columns.span <= 16);
            let shares = i32x4_splat(i32::from(weight) << 16 | i32::from(256 - weight));
            let bias = i32x4_splat((1 << 23) + (1 << 15)); // undoes −2¹⁵ of both rows, rounds half up
            for group in 0..columns.base.len() / parts {
                let mut above = [i16x8_splat(0); C];
                let mut below = [i16x8_splat(0); C];
                for part in group * parts..(group + 1) * parts {
                    let index = v128_load(columns.index.as_ptr().add(16 * part).cast());
                    let weights = split(v128_load(columns.weight.as_ptr().add(16 * part).cast()));
                    let at = *columns.base.get_unchecked(part) as usize;
                    for (c, rows) in rows.iter().enumerate() {
                        let upper = pairs(rows.upper.add(at), index, weights, one_vector);
                        let lower = pairs(rows.lower.add(at), index, weights, one_vector);
                        above[c] = i16x8_add(above[c], upper);
                        below[c] = i16x8_add(below[c], lower);
                    }
                }
                for (c, rows) in rows.iter().enumerate() {
                    let (u, v) = (above[c], below[c]);
                    let low = i16x8_shuffle::<0, 8, 1, 9, 2, 10, 3, 11>(u, v);
                    let high = i16x8_shuffle::<4, 12, 5, 13, 6, 14, 7, 15>(u, v);
                    let low = u32x4_shr(i32x4_add(i32x4_dot_i16x8(low, shares), bias), 16);
                    let high = u32x4_shr(i32x4_add(i32x4_dot_i16x8(high, shares), bias), 16);
                    let halves = u16x8_narrow_i32x4(low, high);
                    v128_store64_lane::<0>(u8x16_narrow_i16x8(halves, halves), rows.to.add(8 * group).cast());
                }
            }
        });
    }
}

/// The even and the odd bytes of each word.
#[inline(always)]
fn split(words: v128) -> [v128; 2] {
    isa!([v128_and(words, i16x8_splat(0xff)), u16x8_shr(words, 8)])
}

/// 8 pairs of neighbours, brought together by table look-ups, then weighed and added: products of a weight (up to 255) and
/// a signed pixel fit 16 bits, and so does the sum of a pair.
#[inline(always)]
unsafe fn pairs(row: *const u8, index: v128, weights: [v128; 2], one_vector: bool) -> v128 {
    isa!({
        let mut pixels = i8x16_swizzle(v128_load(row.cast()), index);
        if !one_vector {
            // A look-up beyond the vector gives 0.
            let far = i8x16_swizzle(v128_load(row.add(16).cast()), i8x16_sub(index, i8x16_splat(16)));
            pixels = v128_or(pixels, far);
        }
        let (first, second) = (i16x8_shr(i16x8_shl(pixels, 8), 8), i16x8_shr(pixels, 8));
        i16x8_add(i16x8_mul(first, weights[0]), i16x8_mul(second, weights[1]))
    })
}
