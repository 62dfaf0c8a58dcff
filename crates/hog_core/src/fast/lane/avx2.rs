//! AVX2 and FMA: 8 lanes, 16 registers.

use std::arch::x86_64::*;

use super::{Columns, Lane, ODD, RowPointers};

token!(Avx2, "AVX2 and FMA");

impl Lane for Avx2 {
    const LANES: usize = 8;
    const WIDE: bool = false;
    const GROUP: usize = 8;
    const REACH: usize = 32;
    const PREFILTER_VECTORS: usize = 1;
    type F = __m256;
    type I = __m256i;
    type Sum = __m256i;
    type M = __m256;
    type Masked = __m256;
    /// The integer below the position, and the nearest one.
    type Slots = [__m256; 2];

    type Narrow = Self;

    #[inline(always)]
    fn narrow(self) -> Self {
        self
    }
    compiled!("avx2,fma");

    instructions! {
        splat(x: f32) -> __m256 = _mm256_set1_ps;
        add(a: __m256, b: __m256) -> __m256 = _mm256_add_ps;
        sub(a: __m256, b: __m256) -> __m256 = _mm256_sub_ps;
        mul(a: __m256, b: __m256) -> __m256 = _mm256_mul_ps;
        min(a: __m256, b: __m256) -> __m256 = _mm256_min_ps;
        max(a: __m256, b: __m256) -> __m256 = _mm256_max_ps;
        mul_add(a: __m256, b: __m256, c: __m256) -> __m256 = _mm256_fmadd_ps;
        mul_sub(a: __m256, b: __m256, c: __m256) -> __m256 = _mm256_fmsub_ps;
        sqrt(x: __m256) -> __m256 = _mm256_sqrt_ps;
        div(a: __m256, b: __m256) -> __m256 = _mm256_div_ps;
        zero_where(mask: __m256, x: __m256) -> __m256 = _mm256_andnot_ps;
        first(x: __m256) -> f32 = _mm256_cvtss_f32;
    }

    #[inline(always)]
    unsafe fn load(self, from: *const f32) -> __m256 {
        isa!(_mm256_loadu_ps(from))
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut f32, x: __m256) {
        isa!(_mm256_storeu_ps(to, x));
    }
    #[inline(always)]
    fn abs(self, x: __m256) -> __m256 {
        isa!(_mm256_andnot_ps(_mm256_set1_ps(-0.0), x))
    }
    #[inline(always)]
    fn less(self, a: __m256, b: __m256) -> __m256 {
        isa!(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b))
    }
    #[inline(always)]
    fn negate_where(self, mask: __m256, x: __m256) -> __m256 {
        isa!(_mm256_xor_ps(x, _mm256_and_ps(mask, _mm256_set1_ps(-0.0))))
    }
    #[inline(always)]
    fn select(self, mask: __m256, yes: __m256, no: __m256) -> __m256 {
        isa!(_mm256_blendv_ps(no, yes, mask))
    }
    #[inline(always)]
    fn flip_by_signs(self, x: __m256, a: __m256, b: __m256) -> __m256 {
        isa!(_mm256_xor_ps(x, _mm256_and_ps(_mm256_xor_ps(a, b), _mm256_set1_ps(-0.0))))
    }
    #[inline(always)]
    fn slots(self, position: __m256) -> (__m256, [__m256; 2]) {
        let below = isa!(_mm256_floor_ps(position));
        let nearest = isa!(_mm256_round_ps::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>(position));
        (self.abs(self.sub(position, nearest)), [below, nearest])
    }
    #[inline(always)]
    fn keep(self, x: __m256, slots: [__m256; 2], slot: usize) -> __m256 {
        // Small whole numbers are equal exactly where their bits are.
        isa!({
            let wanted = _mm256_set1_epi32(((slot % ODD) as f32).to_bits().cast_signed());
            let mask = _mm256_cmpeq_epi32(_mm256_castps_si256(slots[slot / ODD]), wanted);
            _mm256_and_ps(x, _mm256_castsi256_ps(mask))
        })
    }
    #[inline(always)]
    fn keep_either(self, slots: [__m256; 2], one: (__m256, usize), other: (__m256, usize)) -> __m256 {
        let (one, other) = (self.keep(one.0, slots, one.1), self.keep(other.0, slots, other.1));
        isa!(_mm256_or_ps(one, other))
    }
    #[inline(always)]
    fn mul_add_masked(self, x: __m256, weight: __m256, sum: __m256) -> __m256 {
        self.mul_add(x, weight, sum)
    }
    #[inline(always)]
    fn shift_in(self, x: __m256, next: f32) -> __m256 {
        isa!({
            let rotated = _mm256_permutevar8x32_ps(x, _mm256_set_epi32(0, 7, 6, 5, 4, 3, 2, 1));
            _mm256_blend_ps::<0x80>(rotated, _mm256_set1_ps(next))
        })
    }
    #[inline(always)]
    fn shift_up(self, x: __m256, before: f32) -> __m256 {
        isa!({
            let rotated = _mm256_permutevar8x32_ps(x, _mm256_set_epi32(6, 5, 4, 3, 2, 1, 0, 7));
            _mm256_blend_ps::<0x01>(rotated, _mm256_set1_ps(before))
        })
    }
    #[inline(always)]
    unsafe fn low_words(self, from: *const u8) -> __m256i {
        isa!({
            let (a, b) = eight_words(from);
            _mm256_castps_si256(_mm256_shuffle_ps::<0x88>(a, b))
        })
    }
    #[inline(always)]
    unsafe fn high_words(self, from: *const u8) -> __m256i {
        isa!({
            let (a, b) = eight_words(from);
            _mm256_castps_si256(_mm256_shuffle_ps::<0xdd>(a, b))
        })
    }
    #[inline(always)]
    fn byte<const K: u32>(self, words: __m256i) -> __m256 {
        isa!({
            let low = _mm256_set1_epi32(0xff);
            _mm256_cvtepi32_ps(match K {
                0 => _mm256_and_si256(words, low),
                1 => _mm256_and_si256(_mm256_srli_epi32::<8>(words), low),
                2 => _mm256_and_si256(_mm256_srli_epi32::<16>(words), low),
                _ => _mm256_srli_epi32::<24>(words),
            })
        })
    }
    #[inline(always)]
    unsafe fn store_bytes(self, to: *mut u32, [a, b, c, d]: [__m256; 4]) {
        isa!({
            let (a, b) = (_mm256_cvtps_epi32(a), _mm256_slli_epi32::<8>(_mm256_cvtps_epi32(b)));
            let (c, d) = (
                _mm256_slli_epi32::<16>(_mm256_cvtps_epi32(c)),
                _mm256_slli_epi32::<24>(_mm256_cvtps_epi32(d)),
            );
            let word = _mm256_or_si256(_mm256_or_si256(a, b), _mm256_or_si256(c, d));
            _mm256_storeu_si256(to.cast(), word);
        });
    }
    #[inline(always)]
    unsafe fn load_words(self, from: *const u32) -> __m256i {
        isa!(_mm256_loadu_si256(from.cast()))
    }
    #[inline(always)]
    fn splat_word(self, word: u32) -> __m256i {
        isa!(_mm256_set1_epi32(word.cast_signed()))
    }
    #[inline(always)]
    fn no_sum(self) -> __m256i {
        isa!(_mm256_setzero_si256())
    }
    #[inline(always)]
    fn begin_block(self, _total: __m256i) -> __m256i {
        isa!(_mm256_setzero_si256())
    }
    #[inline(always)]
    fn dot_bytes(self, sum: __m256i, bytes: __m256i, weights: __m256i) -> __m256i {
        isa!(_mm256_add_epi16(sum, _mm256_maddubs_epi16(bytes, weights)))
    }
    #[inline(always)]
    fn end_block(self, total: __m256i, sum: __m256i, multiple: i32) -> __m256i {
        isa!(_mm256_add_epi32(total, _mm256_madd_epi16(sum, _mm256_set1_epi16(multiple as i16))))
    }
    #[inline(always)]
    fn at_least(self, words: __m256i, least: i32) -> u32 {
        isa!({
            let less = _mm256_cmpgt_epi32(_mm256_set1_epi32(least), words);
            !_mm256_movemask_ps(_mm256_castsi256_ps(less)).cast_unsigned() & 0xff
        })
    }

    #[inline(always)]
    unsafe fn resize_row<const C: usize>(self, rows: [RowPointers; C], weight: i16, columns: &Columns) {
        // Two groups at a time, one in each half of a vector.
        isa!({
            let (index, weights) = (columns.index.as_ptr(), columns.weight.as_ptr());
            let (base, parts, one_vector) = (columns.base.as_ptr(), columns.parts, columns.span <= 16);
            let shares = _mm256_set1_epi32(i32::from(weight) << 16 | i32::from(256 - weight));
            let bias = _mm256_set1_epi32((1 << 23) + (1 << 15)); // undoes −2¹⁵ of both rows, rounds half up
            for pair in 0..columns.base.len() / (2 * parts) {
                let mut above = [_mm256_setzero_si256(); C];
                let mut below = [_mm256_setzero_si256(); C];
                for part in 2 * pair * parts..(2 * pair + 1) * parts {
                    let other = part + parts;
                    let index =
                        _mm256_loadu2_m128i(index.add(16 * other).cast(), index.add(16 * part).cast());
                    let weight =
                        _mm256_loadu2_m128i(weights.add(16 * other).cast(), weights.add(16 * part).cast());
                    let at = [*base.add(part) as usize, *base.add(other) as usize];
                    for (c, rows) in rows.iter().enumerate() {
                        let upper = pairs(rows.upper, at, index, weight, one_vector);
                        let lower = pairs(rows.lower, at, index, weight, one_vector);
                        above[c] = _mm256_add_epi16(above[c], upper);
                        below[c] = _mm256_add_epi16(below[c], lower);
                    }
                }
                for (c, rows) in rows.iter().enumerate() {
                    let low = _mm256_madd_epi16(_mm256_unpacklo_epi16(above[c], below[c]), shares);
                    let high = _mm256_madd_epi16(_mm256_unpackhi_epi16(above[c], below[c]), shares);
                    let low = _mm256_srli_epi32::<16>(_mm256_add_epi32(low, bias));
                    let high = _mm256_srli_epi32::<16>(_mm256_add_epi32(high, bias));
                    let words = _mm256_packus_epi32(low, high);
                    let (first, second) =
                        (_mm256_castsi256_si128(words), _mm256_extracti128_si256::<1>(words));
                    _mm_storeu_si128(rows.to.add(16 * pair).cast(), _mm_packus_epi16(first, second));
                }
            }
        });
    }
    #[inline(always)]
    unsafe fn deinterleave<const FLIP: u8>(self, from: *const u8, to: [*mut u8; 3], len: usize) {
        // SAFETY: AVX2 implies SSSE3; the rest is the caller's promise.
        unsafe { super::sse41::deinterleave::<FLIP>(from, to, len) };
    }
}

/// Eight 8-byte words, ordered so that an in-lane shuffle of the two vectors leaves them in order.
#[inline(always)]
unsafe fn eight_words(from: *const u8) -> (__m256, __m256) {
    isa!({
        let a = _mm256_loadu2_m128i(from.add(32).cast(), from.cast());
        let b = _mm256_loadu2_m128i(from.add(48).cast(), from.add(16).cast());
        (_mm256_castsi256_ps(a), _mm256_castsi256_ps(b))
    })
}

/// 8 pairs of neighbours from each of two places, brought together by shuffles, then weighed and added.
#[inline(always)]
unsafe fn pairs(
    row: *const u8,
    at: [usize; 2],
    index: __m256i,
    weight: __m256i,
    one_vector: bool,
) -> __m256i {
    isa!({
        let (a, b) = (row.add(at[0]), row.add(at[1]));
        let mut pixels = _mm256_shuffle_epi8(_mm256_loadu2_m128i(b.cast(), a.cast()), index);
        if !one_vector {
            // The shuffle looks at the low four bits of an index.
            let far = _mm256_loadu2_m128i(b.add(16).cast(), a.add(16).cast());
            let beyond = _mm256_cmpgt_epi8(index, _mm256_set1_epi8(15));
            pixels = _mm256_blendv_epi8(pixels, _mm256_shuffle_epi8(far, index), beyond);
        }
        _mm256_maddubs_epi16(weight, pixels)
    })
}
