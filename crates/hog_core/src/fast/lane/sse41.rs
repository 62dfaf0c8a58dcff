//! SSE4.1: 4 lanes, 16 registers, no fused multiply-add.
#![allow(unused_unsafe, reason = "SSE2 is a baseline feature, so that many of its intrinsics are safe here")]

use std::arch::x86_64::*;

use super::{Columns, Lane, ODD, RowPointers};

token!(Sse41, "SSSE3 and SSE4.1");

impl Lane for Sse41 {
    const LANES: usize = 4;
    const WIDE: bool = false;
    const GROUP: usize = 8;
    const REACH: usize = 32;
    const PREFILTER_VECTORS: usize = 1;
    type F = __m128;
    type I = __m128i;
    type Sum = __m128i;
    type M = __m128;
    type Masked = __m128;
    /// The integer below the position, and the nearest one.
    type Slots = [__m128; 2];

    type Narrow = Self;

    #[inline(always)]
    fn narrow(self) -> Self {
        self
    }
    compiled!("ssse3,sse4.1");

    instructions! {
        splat(x: f32) -> __m128 = _mm_set1_ps;
        add(a: __m128, b: __m128) -> __m128 = _mm_add_ps;
        sub(a: __m128, b: __m128) -> __m128 = _mm_sub_ps;
        mul(a: __m128, b: __m128) -> __m128 = _mm_mul_ps;
        min(a: __m128, b: __m128) -> __m128 = _mm_min_ps;
        max(a: __m128, b: __m128) -> __m128 = _mm_max_ps;
        sqrt(x: __m128) -> __m128 = _mm_sqrt_ps;
        div(a: __m128, b: __m128) -> __m128 = _mm_div_ps;
        less(a: __m128, b: __m128) -> __m128 = _mm_cmplt_ps;
        zero_where(mask: __m128, x: __m128) -> __m128 = _mm_andnot_ps;
        first(x: __m128) -> f32 = _mm_cvtss_f32;
    }

    #[inline(always)]
    unsafe fn load(self, from: *const f32) -> __m128 {
        isa!(_mm_loadu_ps(from))
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut f32, x: __m128) {
        isa!(_mm_storeu_ps(to, x));
    }
    #[inline(always)]
    fn mul_add(self, a: __m128, b: __m128, c: __m128) -> __m128 {
        self.add(self.mul(a, b), c)
    }
    #[inline(always)]
    fn mul_sub(self, a: __m128, b: __m128, c: __m128) -> __m128 {
        self.sub(self.mul(a, b), c)
    }
    #[inline(always)]
    fn abs(self, x: __m128) -> __m128 {
        isa!(_mm_andnot_ps(_mm_set1_ps(-0.0), x))
    }
    #[inline(always)]
    fn negate_where(self, mask: __m128, x: __m128) -> __m128 {
        isa!(_mm_xor_ps(x, _mm_and_ps(mask, _mm_set1_ps(-0.0))))
    }
    #[inline(always)]
    fn select(self, mask: __m128, yes: __m128, no: __m128) -> __m128 {
        isa!(_mm_blendv_ps(no, yes, mask))
    }
    #[inline(always)]
    fn flip_by_signs(self, x: __m128, a: __m128, b: __m128) -> __m128 {
        isa!(_mm_xor_ps(x, _mm_and_ps(_mm_xor_ps(a, b), _mm_set1_ps(-0.0))))
    }
    #[inline(always)]
    fn slots(self, position: __m128) -> (__m128, [__m128; 2]) {
        let below = isa!(_mm_floor_ps(position));
        let nearest = isa!(_mm_round_ps::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>(position));
        (self.abs(self.sub(position, nearest)), [below, nearest])
    }
    #[inline(always)]
    fn keep(self, x: __m128, slots: [__m128; 2], slot: usize) -> __m128 {
        // Small whole numbers are equal exactly where their bits are.
        isa!({
            let wanted = _mm_set1_epi32(((slot % ODD) as f32).to_bits().cast_signed());
            let mask = _mm_cmpeq_epi32(_mm_castps_si128(slots[slot / ODD]), wanted);
            _mm_and_ps(x, _mm_castsi128_ps(mask))
        })
    }
    #[inline(always)]
    fn keep_either(self, slots: [__m128; 2], one: (__m128, usize), other: (__m128, usize)) -> __m128 {
        let (one, other) = (self.keep(one.0, slots, one.1), self.keep(other.0, slots, other.1));
        isa!(_mm_or_ps(one, other))
    }
    #[inline(always)]
    fn mul_add_masked(self, x: __m128, weight: __m128, sum: __m128) -> __m128 {
        self.mul_add(x, weight, sum)
    }
    #[inline(always)]
    fn shift_in(self, x: __m128, next: f32) -> __m128 {
        isa!({
            let next = _mm_castps_si128(_mm_set_ss(next));
            _mm_castsi128_ps(_mm_alignr_epi8::<4>(next, _mm_castps_si128(x)))
        })
    }
    #[inline(always)]
    fn shift_up(self, x: __m128, before: f32) -> __m128 {
        isa!({
            let before = _mm_castps_si128(_mm_set1_ps(before));
            _mm_castsi128_ps(_mm_alignr_epi8::<12>(_mm_castps_si128(x), before))
        })
    }
    #[inline(always)]
    unsafe fn low_words(self, from: *const u8) -> __m128i {
        isa!({
            let (a, b) = (_mm_loadu_ps(from.cast()), _mm_loadu_ps(from.add(16).cast()));
            _mm_castps_si128(_mm_shuffle_ps::<0x88>(a, b))
        })
    }
    #[inline(always)]
    unsafe fn high_words(self, from: *const u8) -> __m128i {
        isa!({
            let (a, b) = (_mm_loadu_ps(from.cast()), _mm_loadu_ps(from.add(16).cast()));
            _mm_castps_si128(_mm_shuffle_ps::<0xdd>(a, b))
        })
    }
    #[inline(always)]
    fn byte<const K: u32>(self, words: __m128i) -> __m128 {
        isa!({
            let low = _mm_set1_epi32(0xff);
            _mm_cvtepi32_ps(match K {
                0 => _mm_and_si128(words, low),
                1 => _mm_and_si128(_mm_srli_epi32::<8>(words), low),
                2 => _mm_and_si128(_mm_srli_epi32::<16>(words), low),
                _ => _mm_srli_epi32::<24>(words),
            })
        })
    }
    #[inline(always)]
    unsafe fn store_bytes(self, to: *mut u32, [a, b, c, d]: [__m128; 4]) {
        isa!({
            let (a, b) = (_mm_cvtps_epi32(a), _mm_slli_epi32::<8>(_mm_cvtps_epi32(b)));
            let (c, d) = (_mm_slli_epi32::<16>(_mm_cvtps_epi32(c)), _mm_slli_epi32::<24>(_mm_cvtps_epi32(d)));
            let word = _mm_or_si128(_mm_or_si128(a, b), _mm_or_si128(c, d));
            _mm_storeu_si128(to.cast(), word);
        });
    }
    #[inline(always)]
    unsafe fn load_words(self, from: *const u32) -> __m128i {
        isa!(_mm_loadu_si128(from.cast()))
    }
    #[inline(always)]
    fn splat_word(self, word: u32) -> __m128i {
        isa!(_mm_set1_epi32(word.cast_signed()))
    }
    #[inline(always)]
    fn no_sum(self) -> __m128i {
        isa!(_mm_setzero_si128())
    }
    #[inline(always)]
    fn begin_block(self, _total: __m128i) -> __m128i {
        isa!(_mm_setzero_si128())
    }
    #[inline(always)]
    fn dot_bytes(self, sum: __m128i, bytes: __m128i, weights: __m128i) -> __m128i {
        isa!(_mm_add_epi16(sum, _mm_maddubs_epi16(bytes, weights)))
    }
    #[inline(always)]
    fn end_block(self, total: __m128i, sum: __m128i, multiple: i32) -> __m128i {
        isa!(_mm_add_epi32(total, _mm_madd_epi16(sum, _mm_set1_epi16(multiple as i16))))
    }
    #[inline(always)]
    fn at_least(self, words: __m128i, least: i32) -> u32 {
        isa!({
            let less = _mm_cmpgt_epi32(_mm_set1_epi32(least), words);
            !_mm_movemask_ps(_mm_castsi128_ps(less)).cast_unsigned() & 0xf
        })
    }

    #[inline(always)]
    unsafe fn resize_row<const C: usize>(self, rows: [RowPointers; C], weight: i16, columns: &Columns) {
        isa!({
            let (index, weights) = (columns.index.as_ptr(), columns.weight.as_ptr());
            let (base, parts, one_vector) = (columns.base.as_ptr(), columns.parts, columns.span <= 16);
            let shares = _mm_set1_epi32(i32::from(weight) << 16 | i32::from(256 - weight));
            let bias = _mm_set1_epi32((1 << 23) + (1 << 15)); // undoes −2¹⁵ of both rows, rounds half up
            for group in 0..columns.base.len() / parts {
                let mut above = [_mm_setzero_si128(); C];
                let mut below = [_mm_setzero_si128(); C];
                for part in group * parts..(group + 1) * parts {
                    let index = _mm_loadu_si128(index.add(16 * part).cast());
                    let weight = _mm_loadu_si128(weights.add(16 * part).cast());
                    let at = *base.add(part) as usize;
                    for (c, rows) in rows.iter().enumerate() {
                        let upper = pairs(rows.upper.add(at), index, weight, one_vector);
                        let lower = pairs(rows.lower.add(at), index, weight, one_vector);
                        above[c] = _mm_add_epi16(above[c], upper);
                        below[c] = _mm_add_epi16(below[c], lower);
                    }
                }
                for (c, rows) in rows.iter().enumerate() {
                    let low = _mm_madd_epi16(_mm_unpacklo_epi16(above[c], below[c]), shares);
                    let high = _mm_madd_epi16(_mm_unpackhi_epi16(above[c], below[c]), shares);
                    let low = _mm_srli_epi32::<16>(_mm_add_epi32(low, bias));
                    let high = _mm_srli_epi32::<16>(_mm_add_epi32(high, bias));
                    let words = _mm_packus_epi32(low, high);
                    _mm_storel_epi64(rows.to.add(8 * group).cast(), _mm_packus_epi16(words, words));
                }
            }
        });
    }
    #[inline(always)]
    unsafe fn deinterleave<const FLIP: u8>(self, from: *const u8, to: [*mut u8; 3], len: usize) {
        // SAFETY: the token proves that the CPU has SSSE3; the rest is the caller's promise.
        unsafe { deinterleave::<FLIP>(from, to, len) };
    }
}

/// 8 pairs of neighbours, brought together by shuffles, then weighed and added.
#[inline(always)]
unsafe fn pairs(row: *const u8, index: __m128i, weight: __m128i, one_vector: bool) -> __m128i {
    isa!({
        let mut pixels = _mm_shuffle_epi8(_mm_loadu_si128(row.cast()), index);
        if !one_vector {
            // The shuffle looks at the low four bits of an index.
            let far = _mm_shuffle_epi8(_mm_loadu_si128(row.add(16).cast()), index);
            let beyond = _mm_cmpgt_epi8(index, _mm_set1_epi8(15));
            pixels = _mm_blendv_epi8(pixels, far, beyond);
        }
        _mm_maddubs_epi16(weight, pixels)
    })
}

/// [`Lane::deinterleave`] by shuffles.
///
/// # Safety
/// As there; and the CPU has SSSE3.
#[inline(always)]
pub(super) unsafe fn deinterleave<const FLIP: u8>(from: *const u8, to: [*mut u8; 3], len: usize) {
    // 16 pixels are three vectors; each plane takes its bytes from all three.
    isa!({
        let whole = len - len % 16;
        let flip = _mm_set1_epi8(FLIP.cast_signed());
        let shuffle = |channel: usize, vector: usize| {
            let mut index = [0x80u8; 16];
            let mut i = 0;
            while i < 16 {
                let at = 3 * i + channel;
                if at / 16 == vector {
                    index[i] = (at % 16) as u8;
                }
                i += 1;
            }
            index
        };
        let index = [0, 1, 2].map(|channel| [0, 1, 2].map(|vector| shuffle(channel, vector)));
        for at in (0..whole).step_by(16) {
            for (channel, to) in to.iter().enumerate() {
                let mut plane = flip;
                for (vector, index) in index[channel].iter().enumerate() {
                    let pixels = _mm_loadu_si128(from.add(3 * at + 16 * vector).cast());
                    let part = _mm_shuffle_epi8(pixels, _mm_loadu_si128(index.as_ptr().cast()));
                    plane = _mm_xor_si128(plane, part);
                }
                _mm_storeu_si128(to.add(at).cast(), plane);
            }
        }
        super::portable::Portable.deinterleave::<FLIP>(
            from.add(3 * whole),
            to.map(|to| to.add(whole)),
            len - whole,
        );
    });
}
