//! The constants of a geometry and its SVM, in the order in which sums are taken.

use crate::error::Result;
use crate::exact::{Svm, cells_along};
use crate::geometry::Size;
use crate::memory;
use crate::params::HogSpec;

/// Numbers that loops take at a time; rows of sums and of weights are padded to multiples.
pub(super) const CHUNK: usize = 16;

/// Most sums of a bin and a pixel column: cells along y, for each row of strides that a block spans.
const LANES_MAX: usize = 16;

/// How far a score may be from the exact path's, as a share of Σ‖w‖ over the SVM's blocks; see `fast/plan.rs`. Measured:
/// 2e-8 over the windows of a street in six geometries, 2.1e-7 over random geometries, in blocks of 2 × 6 px.
const SCORE_ERROR: f64 = 1e-6;

/// The constants of one detector.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    /// Strides that a block spans along x and y, the last perhaps in part.
    pub(super) spans: Size,
    /// Cells of a block along x and y.
    pub(super) cells: Size,
    /// 4 or 16: sums of a bin and a pixel column; `span · cells.height + cell` of them are used.
    pub(super) lanes: usize,
    /// `[pixel row of a stride][lane]`: the row's weight in each cell of the block that began `span` strides above.
    pub(super) down: Vec<f32>,
    /// What the pixel columns of a stride add to blocks, blocks that begin there first.
    pub(super) across: Vec<Across>,
    /// `[block row]`: the weights of the window's blocks in this row, from left to right, padded with zeros.
    pub(super) weights: Vec<Vec<f32>>,
    pub(super) bias: f64,
    score_error_bound: f64,
}

/// The weights of a stride's pixel columns in one cell of the blocks that began `span` strides before.
#[derive(Debug, Clone)]
pub(super) struct Across {
    pub span: usize,
    /// The cell along x.
    pub cell: usize,
    /// The first pixel column with a weight.
    pub first: usize,
    pub weights: Vec<f32>,
}

impl Plan {
    /// The plan of this geometry and SVM, if its sums are served.
    pub(crate) fn new(spec: &HogSpec, svm: &Svm) -> Result<Option<Self>> {
        let cells = Size::new(spec.block.width / spec.cell.width, spec.block.height / spec.cell.height);
        let spans = Size::new(
            spec.block.width.div_ceil(spec.stride.width),
            spec.block.height.div_ceil(spec.stride.height),
        );
        let used = spans.height * cells.height;
        let served = used <= LANES_MAX
            && spec.nbins > 1 // (of a single bin's two votes only one counts)
            && spec.blocks.area() > 0
            && spec.l2_hys_threshold.is_finite()
            && spec.l2_hys_threshold > 0.0
            // What the exact path divides by in single precision; the weights of a narrower Gaussian are no numbers.
            && (spec.sigma * spec.sigma).is_normal()
            && svm.bias().is_finite()
            && svm.weights().iter().all(|weight| weight.is_finite() && weight.abs() < 1e6);
        if !served {
            return Ok(None);
        }
        let lanes = if used <= 4 { 4 } else { LANES_MAX };
        let sigma = spec.sigma;
        let rows = profile(spec.block.height, spec.cell.height, sigma)?;
        let mut down = memory::filled(spec.stride.height * lanes, 0.0)?;
        for (y, reached) in rows.iter().enumerate() {
            let (span, row) = (y / spec.stride.height, y % spec.stride.height);
            for &(cell, weight) in reached {
                down[row * lanes + span * cells.height + cell] = weight;
            }
        }
        let columns = profile(spec.block.width, spec.cell.width, sigma)?;
        let mut across = memory::with_room(spans.width * cells.width)?;
        for (span, columns) in columns.chunks(spec.stride.width).enumerate() {
            for cell in 0..cells.width {
                let of_cell =
                    |reached: &Vec<(usize, f32)>| reached.iter().find(|&&(c, _)| c == cell).map(|&(_, w)| w);
                let first = columns.iter().position(|reached| of_cell(reached).is_some()).unwrap_or(0);
                let weights = memory::collect(columns[first..].iter().map_while(of_cell))?;
                across.push(Across { span, cell, first, weights });
            }
        }
        let norm = |block: &[f32]| block.iter().map(|&w| f64::from(w).powi(2)).sum::<f64>().sqrt();
        let norms: f64 = svm.weights().chunks_exact(spec.block_len).map(norm).sum();
        Ok(Some(Self {
            spans,
            cells,
            lanes,
            down,
            across,
            weights: by_rows(svm.weights(), spec)?,
            bias: f64::from(svm.bias()),
            score_error_bound: SCORE_ERROR * norms,
        }))
    }

    /// How far a score can be from the exact path's.
    pub(crate) fn score_error_bound(&self) -> f64 {
        self.score_error_bound
    }
}

/// The cells that each pixel along an axis of a block reaches, and its weights: a Gaussian times the bilinear share.
fn profile(block: usize, cell: usize, sigma: f32) -> Result<Vec<Vec<(usize, f32)>>> {
    memory::collect((0..block).map(|pixel| {
        let off = pixel as f64 - block as f64 * 0.5;
        let gauss = (-off.powi(2) / (2.0 * f64::from(sigma).powi(2))).exp();
        let reached = cells_along(pixel, cell, block / cell).into_iter();
        reached.map(|(cell, share)| (cell, (gauss * f64::from(share)) as f32)).collect()
    }))
}

/// The weights, column by column of blocks, as rows of blocks, in which a bin's cells of one column lie together.
fn by_rows(weights: &[f32], spec: &HogSpec) -> Result<Vec<Vec<f32>>> {
    let (Size { width, height }, len) = (spec.blocks, spec.block_len);
    let down = spec.block.height / spec.cell.height;
    let mut rows = memory::with_room(height)?;
    for y in 0..height {
        let mut row = memory::filled((width * len).next_multiple_of(CHUNK), 0.0)?;
        for (x, block) in row.chunks_exact_mut(len).take(width).enumerate() {
            let of_block = &weights[(x * height + y) * len..][..len];
            for (i, &weight) in of_block.iter().enumerate() {
                let (cell, bin) = (i / spec.nbins, i % spec.nbins);
                block[(cell / down * spec.nbins + bin) * down + cell % down] = weight;
            }
        }
        rows.push(row);
    }
    Ok(rows)
}
