//! A row's gradients and votes with the exact path's roundings, by vectors: for all that computes gradients as OpenCV does.
//!
//! ```text
//! polar: for each vector of columns: dx, dy of the strongest channel → magnitude, position along the bins
//! share: for each vector of columns: position → two bins; magnitude → two shares, interleaved
//! ```
//!
//! ```text
//! neighbours           3 rows (above, here, below) of [channel][column -1..=columns]   square roots, or pixels
//! magnitude, position  [column]                                                        between the two loops
//! shares, bins         [column][first bin, second bin]                                 what is given back
//! ```
//!
//! Lanes are neighbouring columns. 1. Two loops: the steps from a pixel to its votes are too many for a CPU to overlap two
//! vectors' of one loop. 2. The last vector ends at the last column and makes some votes again: no rest loop. 3. The two bins
//! are the bytes of one whole number, so that wrapping them takes comparisons that do not wait for each other.

use std::arch::x86_64::*;
use std::fmt::Debug;
use std::panic::RefUnwindSafe;
use std::sync::atomic::{AtomicU8, Ordering};

use crate::exact::{RowKernel, RowVotes, Turn, polar};

use super::lane::{Kernel, Lane, avx2::Avx2, avx512::Avx512};

/// What the votes need beyond a [`Lane`], where multiply-add is fused: without it OpenCV rounds otherwise.
pub(super) trait VoteLane: Lane + Debug + Sync + RefUnwindSafe {
    /// Writes the square root of each of `pixels`, and gives whether it has: where that is faster than the CPU's own.
    fn roots(self, pixels: &[u8], roots: &mut [f32]) -> bool;
    fn floor(self, x: Self::F) -> Self::F;
    /// Writes `first` and `second` by turns.
    /// # Safety
    /// `to` points at twice `LANES` writable numbers.
    unsafe fn store_pairs(self, to: *mut f32, first: Self::F, second: Self::F);
    /// Writes whole numbers of 0..65536 as two bytes each, the lower one first.
    /// # Safety
    /// `to` points at twice `LANES` writable bytes.
    unsafe fn store_words(self, to: *mut u8, words: Self::F);
}

/// The kernels of an instruction set.
#[derive(Debug)]
pub(super) struct Votes<L>(pub L);

impl<L: VoteLane> RowKernel for Votes<L> {
    fn votes(
        &self,
        neighbours: [&[f32]; 3],
        columns: usize,
        turn: Turn,
        [magnitude, position]: [&mut [f32]; 2],
        votes: &mut RowVotes,
    ) -> usize {
        let (plane, padded) = (magnitude.len() + 2, neighbours[0].len());
        let lengths = [magnitude.len(), position.len(), votes.shares.len(), votes.bins.len()];
        let fits = lengths.iter().all(|&length| columns <= length)
            && neighbours.iter().all(|row| row.len() == padded)
            && (padded == plane || padded == 3 * plane);
        if columns < L::LANES || !fits {
            return 0;
        }
        let row = Row { neighbours, plane, columns, turn, magnitude, position, votes };
        // SAFETY: all lengths were compared just now.
        self.0.compiled(unsafe { RowOn::new(row, self.0) });
        columns
    }

    fn roots(&self, pixels: &[u8], roots: &mut [f32]) -> bool {
        self.0.roots(pixels, roots)
    }
}

/// The first `columns` votes of a row, at least a vector of them; all that is written has room for them.
pub(super) struct Row<'a, 'b> {
    /// Three rows of one or three planes of `plane` numbers, at least two more than there are columns.
    neighbours: [&'a [f32]; 3],
    plane: usize,
    columns: usize,
    turn: Turn,
    /// Of each gradient, and where its angle lies, in bins: between the two loops.
    magnitude: &'a mut [f32],
    position: &'a mut [f32],
    votes: &'a mut RowVotes<'b>,
}

/// A row, and its lane: a [`Kernel`] is given one that knows less.
struct RowOn<'a, 'b, L>(Row<'a, 'b>, L);

impl<'a, 'b, L: Lane> RowOn<'a, 'b, L> {
    /// # Safety
    ///
    /// - Each of the row's `neighbours` is one or three planes of `plane` numbers, `plane` at least `columns + 2`.
    /// - `columns` is at least `LANES` and at most the length of all that is written.
    unsafe fn new(row: Row<'a, 'b>, l: L) -> Self {
        let planes = row.neighbours.map(|neighbour| neighbour.len() / row.plane);
        debug_assert!(planes == [1; 3] || planes == [3; 3], "{planes:?} planes");
        debug_assert!(
            (L::LANES..=row.magnitude.len()).contains(&row.columns) && row.columns + 2 <= row.plane
        );
        Self(row, l)
    }
}

impl<V: VoteLane> Kernel for RowOn<'_, '_, V> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lane>(self, _: L) {
        self.0.run(self.1);
    }
}

impl Row<'_, '_> {
    /// In two loops: the steps from a pixel to its votes are too many for a CPU to overlap those of two vectors.
    #[inline(always)]
    fn run<L: VoteLane>(mut self, l: L) {
        if self.neighbours[0].len() == self.plane {
            self.polar::<L, 1>(l)
        } else {
            self.polar::<L, 3>(l)
        }
        self.share(l);
    }

    /// Where the vectors begin: the last one ends at the last column, and makes some votes again.
    #[inline(always)]
    fn vectors<L: Lane>(columns: usize) -> impl Iterator<Item = usize> {
        (0..columns).step_by(L::LANES).map(move |column| column.min(columns - L::LANES))
    }

    #[inline(always)]
    fn polar<L: VoteLane, const C: usize>(&mut self, l: L) {
        let [above, here, below] = self.neighbours.map(<[f32]>::as_ptr);
        let (magnitudes, positions) = (self.magnitude.as_mut_ptr(), self.position.as_mut_ptr());
        let n = |x: f32| l.splat(x);
        for column in Self::vectors::<L>(self.columns) {
            let derive = |c: usize| {
                let at = c * self.plane + column;
                // SAFETY: `column + LANES + 2` is at most `plane`, and all rows have `C` planes.
                let [left, right, up, down] = unsafe {
                    [here.add(at), here.add(at + 2), above.add(at + 1), below.add(at + 1)].map(|p| l.load(p))
                };
                (l.sub(right, left), l.sub(down, up))
            };
            let (mut dx, mut dy) = derive(0);
            if C == 3 {
                // Two products and a sum, no fused step; the lowest channel wins among equals.
                let square = |(dx, dy)| l.add(l.mul(dx, dx), l.mul(dy, dy));
                let mut best = square((dx, dy));
                for candidate in [derive(1), derive(2)] {
                    let is_larger = l.less(best, square(candidate));
                    best = l.max(best, square(candidate));
                    (dx, dy) = (l.select(is_larger, candidate.0, dx), l.select(is_larger, candidate.1, dy));
                }
            }
            // As `exact::polar`.
            let magnitude = l.sqrt(l.mul_add(dx, dx, l.mul(dy, dy)));
            let (ax, ay) = (l.abs(dx), l.abs(dy));
            let c = l.div(l.min(ax, ay), l.add(l.max(ax, ay), n(polar::TINY)));
            let cc = l.mul(c, c);
            let t = l.mul_add(l.mul_add(n(polar::P7), cc, n(polar::P5)), cc, n(polar::P3));
            let flat = l.mul(l.mul_add(t, cc, n(polar::P1)), c);
            let degrees = l.select(l.less(ax, ay), l.sub(n(90.0), flat), flat);
            let degrees = l.select(l.less(dx, n(0.0)), l.sub(n(180.0), degrees), degrees);
            let degrees = l.select(l.less(dy, n(0.0)), l.sub(n(360.0), degrees), degrees);
            let angle = l.mul(degrees, n(polar::RADIANS));
            let position = l.sub(l.mul(n(self.turn.bins_per_radian), angle), n(0.5));
            // SAFETY: `column + LANES` is at most the length of both.
            unsafe {
                l.store(magnitudes.add(column), magnitude);
                l.store(positions.add(column), position);
            }
        }
    }

    #[inline(always)]
    fn share<L: VoteLane>(self, l: L) {
        let shares = self.votes.shares.as_mut_ptr().cast::<f32>();
        let bins = self.votes.bins.as_mut_ptr().cast::<u8>();
        let n = |x: f32| l.splat(x);
        let turn = self.turn.bins;
        for column in Self::vectors::<L>(self.columns) {
            // SAFETY: `column + LANES` is at most the length of both.
            let (magnitude, position) = unsafe {
                (l.load(self.magnitude.as_ptr().add(column)), l.load(self.position.as_ptr().add(column)))
            };
            let floor = l.floor(position);
            let share = l.sub(position, floor);
            // The bins `floor` and `floor + 1`, each brought into one turn, are the two bytes of a whole number: 257 · floor
            // + 256, and a turn more (below 0) or less for the lower byte, the upper one or both.
            let word = l.select(l.less(position, n(0.0)), n(256.0 + turn), n(256.0));
            let word = l.select(l.less(position, n(turn - 1.0)), word, n(256.0 - 256.0 * turn));
            let word = l.select(l.less(position, n(turn)), word, n(256.0 - 257.0 * turn));
            let word = l.select(l.less(position, n(2.0 * turn - 1.0)), word, n(256.0 - 513.0 * turn));
            // SAFETY: `column + LANES` is at most the length of both.
            unsafe {
                let of_first = l.mul(magnitude, l.sub(n(1.0), share));
                l.store_pairs(shares.add(2 * column), of_first, l.mul(magnitude, share));
                l.store_words(bins.add(2 * column), l.mul_add(floor, n(257.0), word));
            }
        }
    }
}

/// Square roots of at least a vector of bytes, from the CPU's estimate.
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512dq")]
fn roots_of_bytes(l: Avx512, pixels: &[u8], roots: &mut [f32]) {
    let last = pixels.len() - Avx512::LANES;
    for at in (0..pixels.len()).step_by(Avx512::LANES) {
        let at = at.min(last);
        // SAFETY: `at + LANES` is at most the length of both.
        unsafe {
            let bytes = _mm_loadu_si128(pixels.as_ptr().add(at).cast());
            let root = l.sqrt_of_byte(_mm512_cvtepi32_ps(_mm512_cvtepu8_epi32(bytes)));
            l.store(roots.as_mut_ptr().add(at), root);
        }
    }
}

impl Avx512 {
    /// Whether the square roots of all bytes are those of the CPU's own instruction: asked of the CPU once.
    ///
    /// Without a lock, for a child forked meanwhile would wait for it: two threads may ask at once, for the same answer.
    fn roots_are_exact(self) -> bool {
        const UNKNOWN: u8 = 2;
        static ARE_EXACT: AtomicU8 = AtomicU8::new(UNKNOWN);
        let known = ARE_EXACT.load(Ordering::Relaxed);
        if known != UNKNOWN {
            return known == 1;
        }
        let bytes: [u8; 256] = std::array::from_fn(|i| i as u8);
        let mut roots = [0.0; 256];
        // SAFETY: the token proves that the CPU has the instructions.
        unsafe { roots_of_bytes(self, &bytes, &mut roots) };
        let are_exact = roots == bytes.map(|byte| f32::from(byte).sqrt());
        ARE_EXACT.store(u8::from(are_exact), Ordering::Relaxed);
        are_exact
    }
}

impl VoteLane for Avx512 {
    #[inline(always)]
    fn roots(self, pixels: &[u8], roots: &mut [f32]) -> bool {
        let fits = pixels.len() >= Self::LANES && pixels.len() == roots.len();
        if fits && self.roots_are_exact() {
            // SAFETY: the token proves that the CPU has the instructions.
            unsafe { roots_of_bytes(self, pixels, roots) };
            return true;
        }
        false
    }

    #[inline(always)]
    fn floor(self, x: __m512) -> __m512 {
        // SAFETY: the token proves that the CPU has the instructions.
        unsafe { _mm512_roundscale_ps::<{ _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC }>(x) }
    }
    #[inline(always)]
    unsafe fn store_pairs(self, to: *mut f32, first: __m512, second: __m512) {
        // SAFETY: as above.
        unsafe {
            let low = _mm512_setr_epi32(0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
            let high = _mm512_setr_epi32(8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30, 15, 31);
            _mm512_storeu_ps(to, _mm512_permutex2var_ps(first, low, second));
            _mm512_storeu_ps(to.add(16), _mm512_permutex2var_ps(first, high, second));
        }
    }
    #[inline(always)]
    unsafe fn store_words(self, to: *mut u8, words: __m512) {
        // SAFETY: as above.
        unsafe { _mm256_storeu_si256(to.cast(), _mm512_cvtepi32_epi16(_mm512_cvtps_epi32(words))) }
    }
}

impl VoteLane for Avx2 {
    #[inline(always)]
    fn roots(self, _pixels: &[u8], _roots: &mut [f32]) -> bool {
        false // it has no estimate that one Newton step makes exact
    }
    #[inline(always)]
    fn floor(self, x: __m256) -> __m256 {
        // SAFETY: as above.
        unsafe { _mm256_floor_ps(x) }
    }
    #[inline(always)]
    unsafe fn store_pairs(self, to: *mut f32, first: __m256, second: __m256) {
        // SAFETY: as above.
        unsafe {
            let (low, high) = (_mm256_unpacklo_ps(first, second), _mm256_unpackhi_ps(first, second));
            _mm256_storeu_ps(to, _mm256_permute2f128_ps::<0x20>(low, high));
            _mm256_storeu_ps(to.add(8), _mm256_permute2f128_ps::<0x31>(low, high));
        }
    }
    #[inline(always)]
    unsafe fn store_words(self, to: *mut u8, words: __m256) {
        // SAFETY: as above.
        unsafe {
            let words = _mm256_cvtps_epi32(words);
            let packed =
                _mm_packus_epi32(_mm256_castsi256_si128(words), _mm256_extracti128_si256::<1>(words));
            _mm_storeu_si128(to.cast(), packed);
        }
    }
}
