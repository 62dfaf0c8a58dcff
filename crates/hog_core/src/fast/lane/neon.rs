//! NEON: 4 lanes, 32 registers.
#![allow(unused_unsafe, reason = "NEON is a baseline feature, so that most of its intrinsics are safe here")]

use std::arch::aarch64::*;

use super::{Columns, Lane, ODD, RowPointers};

token!(Neon, "NEON");

impl Lane for Neon {
    const LANES: usize = 4;
    const WIDE: bool = true;
    const GROUP: usize = 8;
    const REACH: usize = 32;
    const PREFILTER_VECTORS: usize = 1;
    type F = float32x4_t;
    type I = uint32x4_t;
    /// The sums of words 0 and 1, two halves each, and of words 2 and 3.
    type Sum = [int32x4_t; 2];
    type M = uint32x4_t;
    type Masked = float32x4_t;
    /// The integer below the position, and the nearest one.
    type Slots = [float32x4_t; 2];

    type Narrow = Self;

    #[inline(always)]
    fn narrow(self) -> Self {
        self
    }
    compiled!("neon");

    instructions! {
        splat(x: f32) -> float32x4_t = vdupq_n_f32;
        add(a: float32x4_t, b: float32x4_t) -> float32x4_t = vaddq_f32;
        sub(a: float32x4_t, b: float32x4_t) -> float32x4_t = vsubq_f32;
        mul(a: float32x4_t, b: float32x4_t) -> float32x4_t = vmulq_f32;
        min(a: float32x4_t, b: float32x4_t) -> float32x4_t = vminq_f32;
        max(a: float32x4_t, b: float32x4_t) -> float32x4_t = vmaxq_f32;
        abs(x: float32x4_t) -> float32x4_t = vabsq_f32;
        sqrt(x: float32x4_t) -> float32x4_t = vsqrtq_f32;
        div(a: float32x4_t, b: float32x4_t) -> float32x4_t = vdivq_f32;
        less(a: float32x4_t, b: float32x4_t) -> uint32x4_t = vcltq_f32;
        select(mask: uint32x4_t, yes: float32x4_t, no: float32x4_t) -> float32x4_t = vbslq_f32;
        splat_word(word: u32) -> uint32x4_t = vdupq_n_u32;
    }

    #[inline(always)]
    unsafe fn load(self, from: *const f32) -> float32x4_t {
        isa!(vld1q_f32(from))
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut f32, x: float32x4_t) {
        isa!(vst1q_f32(to, x));
    }
    #[inline(always)]
    fn mul_add(self, a: float32x4_t, b: float32x4_t, c: float32x4_t) -> float32x4_t {
        isa!(vfmaq_f32(c, a, b))
    }
    #[inline(always)]
    fn mul_sub(self, a: float32x4_t, b: float32x4_t, c: float32x4_t) -> float32x4_t {
        isa!(vnegq_f32(vfmsq_f32(c, a, b)))
    }
    #[inline(always)]
    fn negate_where(self, mask: uint32x4_t, x: float32x4_t) -> float32x4_t {
        isa!(vbslq_f32(mask, vnegq_f32(x), x))
    }
    #[inline(always)]
    fn zero_where(self, mask: uint32x4_t, x: float32x4_t) -> float32x4_t {
        isa!(vreinterpretq_f32_u32(vbicq_u32(vreinterpretq_u32_f32(x), mask)))
    }
    #[inline(always)]
    fn flip_by_signs(self, x: float32x4_t, a: float32x4_t, b: float32x4_t) -> float32x4_t {
        isa!({
            let signs = veorq_u32(vreinterpretq_u32_f32(a), vreinterpretq_u32_f32(b));
            let flip = vandq_u32(signs, vdupq_n_u32(1 << 31));
            vreinterpretq_f32_u32(veorq_u32(vreinterpretq_u32_f32(x), flip))
        })
    }
    #[inline(always)]
    fn slots(self, position: float32x4_t) -> (float32x4_t, [float32x4_t; 2]) {
        let below = isa!(vrndmq_f32(position));
        let nearest = isa!(vrndnq_f32(position));
        (self.abs(self.sub(position, nearest)), [below, nearest])
    }
    #[inline(always)]
    fn keep(self, x: float32x4_t, slots: [float32x4_t; 2], slot: usize) -> float32x4_t {
        isa!({
            let mask = vceqq_f32(slots[slot / ODD], vdupq_n_f32((slot % ODD) as f32));
            vreinterpretq_f32_u32(vandq_u32(vreinterpretq_u32_f32(x), mask))
        })
    }
    #[inline(always)]
    fn keep_either(
        self,
        slots: [float32x4_t; 2],
        one: (float32x4_t, usize),
        other: (float32x4_t, usize),
    ) -> float32x4_t {
        let (one, other) = (self.keep(one.0, slots, one.1), self.keep(other.0, slots, other.1));
        isa!(vreinterpretq_f32_u32(vorrq_u32(vreinterpretq_u32_f32(one), vreinterpretq_u32_f32(other))))
    }
    #[inline(always)]
    fn mul_add_masked(self, x: float32x4_t, weight: float32x4_t, sum: float32x4_t) -> float32x4_t {
        self.mul_add(x, weight, sum)
    }
    #[inline(always)]
    fn shift_in(self, x: float32x4_t, next: f32) -> float32x4_t {
        isa!(vextq_f32::<1>(x, vdupq_n_f32(next)))
    }
    #[inline(always)]
    fn shift_up(self, x: float32x4_t, before: f32) -> float32x4_t {
        isa!(vextq_f32::<3>(vdupq_n_f32(before), x))
    }
    #[inline(always)]
    fn first(self, x: float32x4_t) -> f32 {
        isa!(vgetq_lane_f32::<0>(x))
    }
    #[inline(always)]
    unsafe fn low_words(self, from: *const u8) -> uint32x4_t {
        isa!({
            let (a, b) = (vld1q_u8(from), vld1q_u8(from.add(16)));
            vuzp1q_u32(vreinterpretq_u32_u8(a), vreinterpretq_u32_u8(b))
        })
    }
    #[inline(always)]
    unsafe fn high_words(self, from: *const u8) -> uint32x4_t {
        isa!({
            let (a, b) = (vld1q_u8(from), vld1q_u8(from.add(16)));
            vuzp2q_u32(vreinterpretq_u32_u8(a), vreinterpretq_u32_u8(b))
        })
    }
    #[inline(always)]
    fn byte<const K: u32>(self, words: uint32x4_t) -> float32x4_t {
        isa!({
            let low = vdupq_n_u32(0xff);
            vcvtq_f32_u32(match K {
                0 => vandq_u32(words, low),
                1 => vandq_u32(vshrq_n_u32::<8>(words), low),
                2 => vandq_u32(vshrq_n_u32::<16>(words), low),
                _ => vshrq_n_u32::<24>(words),
            })
        })
    }
    #[inline(always)]
    unsafe fn store_bytes(self, to: *mut u32, [a, b, c, d]: [float32x4_t; 4]) {
        isa!({
            let word = vcvtnq_u32_f32(a);
            let word = vsliq_n_u32::<8>(word, vcvtnq_u32_f32(b));
            let word = vsliq_n_u32::<16>(word, vcvtnq_u32_f32(c));
            vst1q_u32(to, vsliq_n_u32::<24>(word, vcvtnq_u32_f32(d)));
        });
    }
    #[inline(always)]
    unsafe fn load_words(self, from: *const u32) -> uint32x4_t {
        isa!(vld1q_u32(from))
    }
    #[inline(always)]
    fn no_sum(self) -> [int32x4_t; 2] {
        isa!([vdupq_n_s32(0); 2])
    }
    #[inline(always)]
    fn begin_block(self, total: [int32x4_t; 2]) -> [int32x4_t; 2] {
        total
    }
    #[inline(always)]
    fn dot_bytes(self, sum: [int32x4_t; 2], bytes: uint32x4_t, weights: uint32x4_t) -> [int32x4_t; 2] {
        // A byte times a weight fits 16 bits; pairs of products are added in 32.
        isa!({
            let (bytes, weights) = (vreinterpretq_u8_u32(bytes), vreinterpretq_s8_u32(weights));
            let weights = vmovl_s8(vget_low_s8(weights));
            let low = vmulq_s16(vreinterpretq_s16_u16(vmovl_u8(vget_low_u8(bytes))), weights);
            let high = vmulq_s16(vreinterpretq_s16_u16(vmovl_high_u8(bytes)), weights);
            [vpadalq_s16(sum[0], low), vpadalq_s16(sum[1], high)]
        })
    }
    #[inline(always)]
    fn end_block(self, _total: [int32x4_t; 2], sum: [int32x4_t; 2], _multiple: i32) -> [int32x4_t; 2] {
        sum // every multiple is 1
    }
    #[inline(always)]
    fn at_least(self, total: [int32x4_t; 2], least: i32) -> u32 {
        isa!({
            let words = vpaddq_s32(total[0], total[1]);
            let bits = vld1q_u32([1u32, 2, 4, 8].as_ptr());
            vaddvq_u32(vandq_u32(vcgeq_s32(words, vdupq_n_s32(least)), bits))
        })
    }

    #[inline(always)]
    unsafe fn resize_row<const C: usize>(self, rows: [RowPointers; C], weight: i16, columns: &Columns) {
        isa!({
            let bias = vdupq_n_s32((1 << 23) + (1 << 15)); // undoes −2¹⁵ of both rows, rounds half up
            let parts = columns.parts;
            for group in 0..columns.base.len() / parts {
                let mut above = [vdupq_n_s16(0); C];
                let mut below = [vdupq_n_s16(0); C];
                for part in group * parts..(group + 1) * parts {
                    let index = vld1q_u8(columns.index.as_ptr().add(16 * part));
                    let weight = vld1q_u8(columns.weight.as_ptr().add(16 * part));
                    let at = *columns.base.get_unchecked(part) as usize;
                    for (c, rows) in rows.iter().enumerate() {
                        above[c] = vaddq_s16(above[c], pairs(rows.upper.add(at), index, weight));
                        below[c] = vaddq_s16(below[c], pairs(rows.lower.add(at), index, weight));
                    }
                }
                for (c, rows) in rows.iter().enumerate() {
                    let (u, v) = (above[c], below[c]);
                    let low = vmlal_n_s16(bias, vget_low_s16(u), 256 - weight);
                    let low = vmlal_n_s16(low, vget_low_s16(v), weight);
                    let high = vmlal_high_n_s16(vmlal_high_n_s16(bias, u, 256 - weight), v, weight);
                    let low = vshrn_n_u32::<16>(vreinterpretq_u32_s32(low));
                    let high = vshrn_n_u32::<16>(vreinterpretq_u32_s32(high));
                    vst1_u8(rows.to.add(8 * group), vmovn_u16(vcombine_u16(low, high)));
                }
            }
        });
    }

    #[inline(always)]
    unsafe fn deinterleave(self, from: *const u8, to: [*mut u8; 3], len: usize) {
        isa!({
            let whole = len - len % 16;
            let flip = vdupq_n_u8(0x80);
            for at in (0..whole).step_by(16) {
                let planes = vld3q_u8(from.add(3 * at));
                vst1q_u8(to[0].add(at), veorq_u8(planes.0, flip));
                vst1q_u8(to[1].add(at), veorq_u8(planes.1, flip));
                vst1q_u8(to[2].add(at), veorq_u8(planes.2, flip));
            }
            super::portable::Portable.deinterleave(
                from.add(3 * whole),
                to.map(|to| to.add(whole)),
                len - whole,
            );
        });
    }
}

/// 8 pairs of neighbours brought together by a table look-up, then weighed and added: products of a weight (up to 255)
/// and a signed pixel fit 16 bits, and so does the sum of a pair.
#[inline(always)]
unsafe fn pairs(from: *const u8, index: uint8x16_t, weight: uint8x16_t) -> int16x8_t {
    isa!({
        let near = uint8x16x2_t(vld1q_u8(from), vld1q_u8(from.add(16)));
        let pixels = vreinterpretq_s8_u8(vqtbl2q_u8(near, index));
        let low =
            vmulq_s16(vmovl_s8(vget_low_s8(pixels)), vreinterpretq_s16_u16(vmovl_u8(vget_low_u8(weight))));
        let high = vmulq_s16(vmovl_high_s8(pixels), vreinterpretq_s16_u16(vmovl_high_u8(weight)));
        vpaddq_s16(low, high)
    })
}
