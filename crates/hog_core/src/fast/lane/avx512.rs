//! AVX-512 (F, BW, VL, DQ, VBMI, VNNI): 16 lanes, 32 registers, masks.

use std::arch::x86_64::*;

use super::avx2::Avx2;
use super::{Columns, Lane, ODD, RowPointers};

token!(Avx512, "AVX-512 F, BW, VL, DQ, VBMI and VNNI");

impl Lane for Avx512 {
    const LANES: usize = 16;
    const WIDE: bool = true;
    const GROUP: usize = 32;
    const REACH: usize = 128;
    const PREFILTER_VECTORS: usize = 2;
    type F = __m512;
    type I = __m512i;
    type Sum = __m512i;
    type M = __mmask16;
    type Masked = (__m512, __mmask16);
    /// The integer below the position, and the nearest one.
    type Slots = [__m512; 2];

    type Narrow = Avx2;

    #[inline(always)]
    fn narrow(self) -> Avx2 {
        isa!(Avx2::new()) // AVX-512 implies AVX2
    }
    compiled!("avx2,fma,avx512f,avx512bw,avx512vl,avx512dq,avx512vbmi,avx512vnni");

    instructions! {
        splat(x: f32) -> __m512 = _mm512_set1_ps;
        add(a: __m512, b: __m512) -> __m512 = _mm512_add_ps;
        sub(a: __m512, b: __m512) -> __m512 = _mm512_sub_ps;
        mul(a: __m512, b: __m512) -> __m512 = _mm512_mul_ps;
        min(a: __m512, b: __m512) -> __m512 = _mm512_min_ps;
        max(a: __m512, b: __m512) -> __m512 = _mm512_max_ps;
        mul_add(a: __m512, b: __m512, c: __m512) -> __m512 = _mm512_fmadd_ps;
        mul_sub(a: __m512, b: __m512, c: __m512) -> __m512 = _mm512_fmsub_ps;
        abs(x: __m512) -> __m512 = _mm512_abs_ps;
        sqrt(x: __m512) -> __m512 = _mm512_sqrt_ps;
        div(a: __m512, b: __m512) -> __m512 = _mm512_div_ps;
        first(x: __m512) -> f32 = _mm512_cvtss_f32;
        dot_bytes(sum: __m512i, bytes: __m512i, weights: __m512i) -> __m512i = _mm512_dpbusd_epi32;
    }

    #[inline(always)]
    unsafe fn load(self, from: *const f32) -> __m512 {
        isa!(_mm512_loadu_ps(from))
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut f32, x: __m512) {
        isa!(_mm512_storeu_ps(to, x));
    }
    #[inline(always)]
    fn min_abs(self, a: __m512, b: __m512) -> __m512 {
        isa!(_mm512_range_ps::<0b1010>(a, b)) // the smaller absolute value, sign cleared
    }
    #[inline(always)]
    fn max_abs(self, a: __m512, b: __m512) -> __m512 {
        isa!(_mm512_range_ps::<0b1011>(a, b))
    }
    #[inline(always)]
    fn sqrt_of_byte(self, x: __m512) -> __m512 {
        // Clamped to a normal number: a subnormal one would make every step slow.
        let r = isa!(_mm512_rsqrt14_ps(_mm512_max_ps(x, _mm512_set1_ps(1e-30))));
        let s = self.mul(x, r);
        let rest = isa!(_mm512_fnmadd_ps(s, s, x));
        self.mul_add(rest, self.mul(r, self.splat(0.5)), s)
    }
    #[inline(always)]
    fn less(self, a: __m512, b: __m512) -> __mmask16 {
        isa!(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b))
    }
    #[inline(always)]
    fn negate_where(self, mask: __mmask16, x: __m512) -> __m512 {
        isa!(_mm512_mask_xor_ps(x, mask, x, _mm512_set1_ps(-0.0)))
    }
    #[inline(always)]
    fn zero_where(self, mask: __mmask16, x: __m512) -> __m512 {
        isa!(_mm512_maskz_mov_ps(!mask, x))
    }
    #[inline(always)]
    fn select(self, mask: __mmask16, yes: __m512, no: __m512) -> __m512 {
        isa!(_mm512_mask_blend_ps(mask, no, yes))
    }
    #[inline(always)]
    fn flip_by_signs(self, x: __m512, a: __m512, b: __m512) -> __m512 {
        isa!({
            let sign = _mm512_set1_epi32(i32::MIN);
            let (a, b) = (_mm512_castps_si512(a), _mm512_castps_si512(b));
            let flip = _mm512_ternarylogic_epi32::<0x28>(a, b, sign); // (a ^ b) & sign
            _mm512_castsi512_ps(_mm512_xor_si512(_mm512_castps_si512(x), flip))
        })
    }
    #[inline(always)]
    fn slots(self, position: __m512) -> (__m512, [__m512; 2]) {
        let below = isa!(_mm512_roundscale_ps::<{ _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC }>(position));
        let nearest =
            isa!(_mm512_roundscale_ps::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>(position));
        (self.abs(self.sub(position, nearest)), [below, nearest])
    }
    #[inline(always)]
    fn keep(self, x: __m512, slots: [__m512; 2], slot: usize) -> (__m512, __mmask16) {
        // Small whole numbers are equal exactly where their bits are.
        let mask = isa!({
            let wanted = _mm512_set1_epi32(((slot % ODD) as f32).to_bits().cast_signed());
            _mm512_cmpeq_epi32_mask(_mm512_castps_si512(slots[slot / ODD]), wanted)
        });
        (x, mask)
    }
    #[inline(always)]
    fn keep_either(
        self,
        slots: [__m512; 2],
        one: (__m512, usize),
        other: (__m512, usize),
    ) -> (__m512, __mmask16) {
        let (x, mask) = self.keep(one.0, slots, one.1);
        let (y, other) = self.keep(other.0, slots, other.1);
        (isa!(_mm512_mask_mov_ps(x, other, y)), mask | other)
    }
    #[inline(always)]
    fn mul_add_masked(self, (x, mask): (__m512, __mmask16), weight: __m512, sum: __m512) -> __m512 {
        isa!(_mm512_mask3_fmadd_ps(x, weight, sum, mask))
    }
    #[inline(always)]
    fn add_product(
        self,
        (_, mask): (__m512, __mmask16),
        product: __m512,
        _weight: __m512,
        sum: __m512,
    ) -> __m512 {
        isa!(_mm512_mask_add_ps(sum, mask, sum, product))
    }
    #[inline(always)]
    fn shift_in(self, x: __m512, next: f32) -> __m512 {
        isa!({
            let next = _mm512_castps_si512(_mm512_set1_ps(next));
            _mm512_castsi512_ps(_mm512_alignr_epi32::<1>(next, _mm512_castps_si512(x)))
        })
    }
    #[inline(always)]
    fn shift_up(self, x: __m512, before: f32) -> __m512 {
        isa!({
            let before = _mm512_castps_si512(_mm512_set1_ps(before));
            _mm512_castsi512_ps(_mm512_alignr_epi32::<15>(_mm512_castps_si512(x), before))
        })
    }
    #[inline(always)]
    unsafe fn low_words(self, from: *const u8) -> __m512i {
        isa!({
            let even = _mm512_set_epi32(30, 28, 26, 24, 22, 20, 18, 16, 14, 12, 10, 8, 6, 4, 2, 0);
            let (a, b) = (_mm512_loadu_si512(from.cast()), _mm512_loadu_si512(from.add(64).cast()));
            _mm512_permutex2var_epi32(a, even, b)
        })
    }
    #[inline(always)]
    unsafe fn high_words(self, from: *const u8) -> __m512i {
        isa!({
            let odd = _mm512_set_epi32(31, 29, 27, 25, 23, 21, 19, 17, 15, 13, 11, 9, 7, 5, 3, 1);
            let (a, b) = (_mm512_loadu_si512(from.cast()), _mm512_loadu_si512(from.add(64).cast()));
            _mm512_permutex2var_epi32(a, odd, b)
        })
    }
    #[inline(always)]
    fn byte<const K: u32>(self, words: __m512i) -> __m512 {
        isa!({
            let low = _mm512_set1_epi32(0xff);
            _mm512_cvtepi32_ps(match K {
                0 => _mm512_and_si512(words, low),
                1 => _mm512_and_si512(_mm512_srli_epi32::<8>(words), low),
                2 => _mm512_and_si512(_mm512_srli_epi32::<16>(words), low),
                _ => _mm512_srli_epi32::<24>(words),
            })
        })
    }
    #[inline(always)]
    unsafe fn store_bytes(self, to: *mut u32, [a, b, c, d]: [__m512; 4]) {
        isa!({
            let (a, b) = (_mm512_cvtps_epi32(a), _mm512_slli_epi32::<8>(_mm512_cvtps_epi32(b)));
            let (c, d) = (
                _mm512_slli_epi32::<16>(_mm512_cvtps_epi32(c)),
                _mm512_slli_epi32::<24>(_mm512_cvtps_epi32(d)),
            );
            let low = _mm512_ternarylogic_epi32::<0xfe>(a, b, c);
            _mm512_storeu_si512(to.cast(), _mm512_or_si512(low, d));
        });
    }
    #[inline(always)]
    unsafe fn load_words(self, from: *const u32) -> __m512i {
        isa!(_mm512_loadu_si512(from.cast()))
    }
    #[inline(always)]
    fn splat_word(self, word: u32) -> __m512i {
        isa!(_mm512_set1_epi32(word.cast_signed()))
    }
    #[inline(always)]
    fn no_sum(self) -> __m512i {
        isa!(_mm512_setzero_si512())
    }
    #[inline(always)]
    fn begin_block(self, total: __m512i) -> __m512i {
        total
    }
    #[inline(always)]
    fn end_block(self, _total: __m512i, sum: __m512i, _multiple: i32) -> __m512i {
        sum // every multiple is 1
    }
    #[inline(always)]
    fn at_least(self, words: __m512i, least: i32) -> u32 {
        isa!(u32::from(_mm512_cmpge_epi32_mask(words, _mm512_set1_epi32(least))))
    }

    #[inline(always)]
    unsafe fn resize_row<const C: usize>(self, rows: [RowPointers; C], weight: i16, columns: &Columns) {
        isa!({
            let (index, weights) = (columns.index.as_ptr(), columns.weight.as_ptr());
            let (base, parts, one_vector) = (columns.base.as_ptr(), columns.parts, columns.span <= 64);
            let shares = _mm512_set1_epi32(i32::from(weight) << 16 | i32::from(256 - weight));
            let bias = _mm512_set1_epi32((1 << 23) + (1 << 15)); // undoes −2¹⁵ of both rows, rounds half up
            let third_bytes = _mm512_loadu_si512(THIRD_BYTES.as_ptr().cast());
            for group in 0..columns.base.len() / parts {
                let mut above = [_mm512_setzero_si512(); C];
                let mut below = [_mm512_setzero_si512(); C];
                for part in group * parts..(group + 1) * parts {
                    let index = _mm512_loadu_si512(index.add(64 * part).cast());
                    let weight = _mm512_loadu_si512(weights.add(64 * part).cast());
                    let at = *base.add(part) as usize;
                    for (c, rows) in rows.iter().enumerate() {
                        let upper = pairs(rows.upper.add(at), index, weight, one_vector);
                        let lower = pairs(rows.lower.add(at), index, weight, one_vector);
                        above[c] = _mm512_add_epi16(above[c], upper);
                        below[c] = _mm512_add_epi16(below[c], lower);
                    }
                }
                for (c, rows) in rows.iter().enumerate() {
                    let low = _mm512_dpwssd_epi32(bias, _mm512_unpacklo_epi16(above[c], below[c]), shares);
                    let high = _mm512_dpwssd_epi32(bias, _mm512_unpackhi_epi16(above[c], below[c]), shares);
                    let bytes = _mm512_permutex2var_epi8(low, third_bytes, high);
                    _mm256_storeu_si256(rows.to.add(32 * group).cast(), _mm512_castsi512_si256(bytes));
                }
            }
        });
    }
}

/// 32 pairs of neighbours brought together by one shuffle, then weighed and added.
#[inline(always)]
unsafe fn pairs(from: *const u8, index: __m512i, weight: __m512i, one_vector: bool) -> __m512i {
    isa!({
        let low = _mm512_loadu_si512(from.cast());
        let pixels = if one_vector {
            _mm512_permutexvar_epi8(index, low)
        } else {
            _mm512_permutex2var_epi8(low, index, _mm512_loadu_si512(from.add(64).cast()))
        };
        _mm512_maddubs_epi16(weight, pixels)
    })
}

/// Where `resize_row` finds its pixels: the third bytes of words that lie as `unpacklo` and `unpackhi` leave them.
const THIRD_BYTES: [u8; 64] = {
    let mut index = [0; 64];
    let mut i = 0;
    while i < 32 {
        let word = i / 8 * 4 + i % 4 + if i % 8 < 4 { 0 } else { 16 };
        index[i] = (4 * word + 2) as u8;
        i += 1;
    }
    index
};
