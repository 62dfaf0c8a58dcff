//! The constants that the kernels need of a detector, computed once from its geometry and SVM.

use crate::exact::{Svm, gamma_table};
use crate::geometry::Size;
use crate::params::HogSpec;

use super::layout::{ACROSS, BLOCK, Gamma, ROWS, WORDS};

/// Most blocks of a window. A block adds less than 2 · 2¹⁵ · [`MULTIPLE_MAX`] to the prefilter's 32-bit sum, so that
/// 2³¹ / (2 · 2¹⁵ · 64) = 512 blocks cannot overflow it; no more than 400 were ever tested.
const BLOCKS_MAX: usize = 400;

/// Largest norm of the quantised weights that are summed in 16 bits, before they are rounded to whole numbers.
///
/// Of a word's four bytes, two are summed in its lower half and two in its upper half: 18 bytes f of a block in each,
/// with weights q. f = round(255 x) and ‖x‖ ≤ 1, so ‖f‖ ≤ 255 + ½√18 = 257.13; rounding the weights makes
/// ‖q‖ ≤ 125 + ½√18 = 127.13. By Cauchy-Schwarz every partial sum is at most ‖f‖·‖q‖ ≤ 32 688 < 2¹⁵. (The rounding
/// of x itself, a few 1e-7, changes that by less than 1.)
const HALF_NORM_MAX: f64 = 125.0;

/// Steps of blocks are multiples of one unit, up to this: products with it must fit 32 bits.
const MULTIPLE_MAX: f64 = 64.0;

/// What a feature's byte may be off, in units of 1/255: half a unit of rounding, and 8 ε of 255 for the rounding of
/// the product that is rounded.
const BYTE_ERROR: f64 = 0.5 + 255.0 * 8.0 * f32::EPSILON as f64;

/// How far a score of the kernels may be from the exact path's, as a share of Σ‖w‖ over the SVM's blocks.
///
/// A block's features have at most unit length, so errors δ of the features change the score by at most Σ‖w‖·‖δ‖. The
/// value is measured, not derived: the largest error is 0.6e-7 over 400,000 windows of both people models (30
/// photographs at 640 pixels, in gray and in colour, and 100 generated images of noise, edges and soft gradients), alike
/// on AVX-512, AVX2 and the portable kernels. So the value is more than six times the largest error seen; tests fail
/// from half of it on.
const SCORE_ERROR: f64 = 4e-7;

/// The constants of a geometry: what the kernels need to make blocks.
#[derive(Debug, Clone)]
pub(crate) struct Geometry {
    pub(super) gamma: Gamma,
    /// The value of each pixel after gamma correction.
    pub(super) table: [f32; 256],
    pub(super) l2_hys_threshold: f32,
    /// Blocks of a window.
    pub(super) blocks: Size,
    /// For each pixel row of a cell, its weight in the upper cell of the blocks that begin in this row of cells, then
    /// (rows 0..4) in the upper cell of those that end here or (rows 4..8) in the lower cell of those that begin here,
    /// then in the lower cell of those that end here. Doubled, as votes are halved.
    pub(super) down: [[f32; 3]; 8],
    /// The same across, not doubled.
    pub(super) across: [[f32; 3]; 8],
}

/// The constants of the fast path of one detector.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    pub(super) geometry: Geometry,
    /// Blocks of a window.
    pub(super) blocks: Size,
    /// `[block row][element][block column]`, padded with zeros to [`ACROSS`] columns.
    pub(super) weights: Vec<f32>,
    pub(super) bias: f64,
    pub(super) prefilter: Prefilter,
    /// How far a score of the kernels may be from the exact path's: [`SCORE_ERROR`] of this SVM.
    pub(super) score_error_bound: f64,
}

/// The SVM quantised to bytes: a score from it is at most `bound` below the score in single precision.
///
/// With features f = round(255 x) and weights w ≈ step·q (step = 255 · unit · multiple of the block), the score is
/// bias + Σ step·q·f / 255 plus an error of at most Σ|step·q|·[`BYTE_ERROR`]/255 (the features' rounding) + Σ over
/// blocks of ‖w − step·q‖ (the weights' rounding, as ‖x‖ ≤ 1 in a block).
#[derive(Debug, Clone)]
pub(super) struct Prefilter {
    /// `[block column][word][block row]`: four weights each; [`ROWS`] rows of zeros lie before and after a column's.
    pub words: Vec<u32>,
    /// `[block column][block row]`, with as many rows around: what the block's sum is multiplied by.
    pub multiples: Vec<i32>,
    /// The score that a unit of the weighted sum of bytes stands for.
    pub unit: f64,
    /// Largest error of a score.
    pub bound: f64,
}

impl Geometry {
    /// The constants of `spec`, if the kernels can serve it.
    ///
    /// `gamma_is_exact`: the estimated square root is right for every pixel value.
    pub(super) fn new(spec: &HogSpec, gamma_is_exact: bool) -> Option<Self> {
        let eight = Size::new(8, 8);
        let served = spec.block == Size::new(16, 16)
            && spec.cell == eight
            && spec.stride == eight
            && spec.nbins == 9
            && !spec.signed_gradient
            && spec.l2_hys_threshold.is_finite()
            && spec.l2_hys_threshold > 0.0
            && spec.blocks.width > 0
            && spec.blocks.height > 0
            && spec.blocks.width * spec.blocks.height <= BLOCKS_MAX
            // What the exact path divides by in single precision; the weights of a narrower Gaussian are no numbers.
            && (spec.sigma * spec.sigma).is_normal();
        if !served {
            return None;
        }
        let across = profile(spec.sigma);
        Some(Self {
            gamma: match (spec.gamma_correction, gamma_is_exact) {
                (false, _) => Gamma::Off,
                (true, true) => Gamma::Estimated,
                (true, false) => Gamma::Exact,
            },
            table: gamma_table(spec.gamma_correction),
            l2_hys_threshold: spec.l2_hys_threshold,
            blocks: spec.blocks,
            down: across.map(|row| row.map(|weight| 2.0 * weight)),
            across,
        })
    }
}

impl Plan {
    /// The plan of `geometry` and `svm`, if the kernels can serve it.
    ///
    /// `wide_sums`: the prefilter sums in 32 bits, not in 16.
    pub(super) fn new(geometry: Geometry, svm: &Svm, wide_sums: bool) -> Option<Self> {
        if !(svm.bias().is_finite() && svm.weights().iter().all(|w| w.is_finite() && w.abs() < 1e6)) {
            return None;
        }
        let norms: f64 = svm.weights().as_chunks::<BLOCK>().0.iter().map(|block| norm(block)).sum();
        let blocks = geometry.blocks;
        Some(Self {
            geometry,
            blocks,
            weights: by_rows(svm.weights(), blocks),
            bias: f64::from(svm.bias()),
            prefilter: Prefilter::new(svm.weights(), blocks, wide_sums),
            score_error_bound: SCORE_ERROR * norms,
        })
    }
}

impl Plan {
    /// How far a score of the kernels can be from the exact path's.
    pub(crate) fn score_error_bound(&self) -> f64 {
        self.score_error_bound
    }
}

fn norm(values: &[f32]) -> f64 {
    values.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>().sqrt()
}

/// The weights, column by column of blocks, as `[block row][element][block column]`.
fn by_rows(weights: &[f32], blocks: Size) -> Vec<f32> {
    let padded = blocks.width.next_multiple_of(ACROSS);
    let mut rows = vec![0.0; blocks.height * BLOCK * padded];
    for (index, block) in weights.as_chunks::<BLOCK>().0.iter().enumerate() {
        let (x, y) = (index / blocks.height, index % blocks.height);
        for (i, &weight) in block.iter().enumerate() {
            rows[(y * BLOCK + i) * padded + x] = weight;
        }
    }
    rows
}

/// A block's weights along one axis: a Gaussian centred on pixel 8, times the bilinear share.
fn profile(sigma: f32) -> [[f32; 3]; 8] {
    let gauss = |at: f64| (-(at - 8.0).powi(2) / (2.0 * f64::from(sigma).powi(2))).exp();
    std::array::from_fn(|pixel| {
        let at = pixel as f64;
        let up = (at + 0.5) / 8.0; // 0..1 across the cell
        let begin = gauss(at);
        let end = gauss(at + 8.0);
        // Pixels in the block's outer half cells vote in one cell only, with their bilinear share.
        let first_begin = begin * if pixel < 4 { up + 0.5 } else { 1.5 - up };
        let second_begin = begin * (up - 0.5);
        let first_end = end * (0.5 - up);
        let second_end = end * if pixel < 4 { up + 0.5 } else { 1.5 - up };
        let middle = if pixel < 4 { first_end } else { second_begin };
        [first_begin as f32, middle as f32, second_end as f32]
    })
}

impl Prefilter {
    /// `wide_sums`: sums are kept in 32 bits; otherwise a block's half sums must fit 16 bits.
    fn new(weights: &[f32], blocks: Size, wide_sums: bool) -> Self {
        let list = weights.as_chunks::<BLOCK>().0;
        let largest = weights.iter().fold(f64::MIN_POSITIVE, |most, &w| most.max(f64::from(w.abs())));
        // In 16 bits, elements 4k, 4k + 1 are summed in one half of a word, 4k + 2, 4k + 3 in the other.
        let half_norm = |block: &[f32; BLOCK]| {
            let half = |from: usize| {
                let squares = block.as_chunks::<4>().0.iter().flat_map(|word| &word[from..from + 2]);
                squares.map(|&w| f64::from(w).powi(2)).sum::<f64>().sqrt()
            };
            half(0).max(half(2))
        };
        let steps: Vec<f64> = list
            .iter()
            .map(|block| if wide_sums { largest / 127.0 } else { half_norm(block) / HALF_NORM_MAX })
            .collect();
        let most = steps.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let unit = if wide_sums { most } else { most / MULTIPLE_MAX };
        let padded = ROWS + blocks.height + ROWS;
        let mut prefilter = Self {
            words: vec![0; WORDS * blocks.width * padded],
            multiples: vec![1; blocks.width * padded],
            unit: unit / 255.0,
            bound: 0.0,
        };
        for (index, block) in list.iter().enumerate() {
            let (x, y) = (index / blocks.height, index % blocks.height);
            let multiple = (steps[index] / unit).ceil().max(1.0);
            let step = unit * multiple;
            prefilter.multiples[x * padded + ROWS + y] = multiple as i32;
            let quantised = block.map(|w| (f64::from(w) / step).round());
            let rest: f64 =
                block.iter().zip(quantised).map(|(&w, q)| (f64::from(w) - step * q).powi(2)).sum();
            prefilter.bound +=
                rest.sqrt() + quantised.iter().map(|q| q.abs() * step * BYTE_ERROR / 255.0).sum::<f64>();
            for (word, q) in quantised.as_chunks::<4>().0.iter().enumerate() {
                let bytes = q.map(|q| (q as i8).cast_unsigned());
                prefilter.words[(x * WORDS + word) * padded + ROWS + y] = u32::from_le_bytes(bytes);
            }
        }
        prefilter
    }
}
