//! Stage 2: weighted block histograms, and their L2-Hys normalisation, summed in OpenCV's own order.

use crate::gradient::Gradient;
use crate::params::{HogSpec, Size};

/// What a block's pixels add to its cells: Gaussian times bilinear share, precomputed.
///
/// Pixels that reach one cell come first, then those of two, then those of four; each group column by column.
/// Single precision sums depend on that order, and descriptors are to equal OpenCV's to the last bit.
#[derive(Debug, Clone)]
pub struct BlockWeights {
    one: Vec<Pixel<1>>,
    two: Vec<Pixel<2>>,
    four: Vec<Pixel<4>>,
}

#[derive(Debug, Clone, Copy)]
struct Pixel<const CELLS: usize> {
    column: usize,
    row: usize,
    /// Where each cell's histogram begins in the block, and the weight of the pixel in it.
    cells: [(usize, f32); CELLS],
}

/// Up to two cells (index and share) that a pixel reaches along one axis.
fn cells_along(pixel: usize, cell: usize, cells: usize) -> Vec<(usize, f32)> {
    let position = (pixel as f32 + 0.5) / cell as f32 - 0.5;
    let first = position.floor();
    let share = position - first;
    let inside = |index: f32| index >= 0.0 && (index as usize) < cells;
    let mut reached = Vec::with_capacity(2);
    if inside(first) {
        reached.push((first as usize, 1.0 - share));
    }
    if inside(first + 1.0) {
        reached.push(((first + 1.0) as usize, share));
    }
    reached
}

impl BlockWeights {
    /// The weights of a block of `block` pixels in cells of `cell` pixels under a Gaussian of `sigma` pixels.
    pub fn new(block: Size, cell: Size, nbins: usize, sigma: f32) -> Self {
        let cells = Size::new(block.width / cell.width, block.height / cell.height);
        let scale = 1.0 / ((sigma * sigma) * 2.0);
        // Centred on (width / 2, height / 2), not on the middle pixel: the models were trained that way.
        let squared = |index: usize, side: usize| (index as f32 - side as f32 * 0.5).powi(2);
        let mut weights = Self { one: Vec::new(), two: Vec::new(), four: Vec::new() };
        for column in 0..block.width {
            let across = cells_along(column, cell.width, cells.width);
            for row in 0..block.height {
                let down = cells_along(row, cell.height, cells.height);
                let exponent = -(squared(row, block.height) + squared(column, block.width)) * scale;
                let gauss = f64::from(exponent).exp() as f32;
                let reached = down.iter().flat_map(|&(cy, sy)| {
                    across.iter().map(move |&(cx, sx)| ((cx * cells.height + cy) * nbins, gauss * (sx * sy)))
                });
                let reached: Vec<_> = reached.collect();
                match *reached.as_slice() {
                    [a] => weights.one.push(Pixel { column, row, cells: [a] }),
                    [a, b] => weights.two.push(Pixel { column, row, cells: [a, b] }),
                    [a, b, c, d] => weights.four.push(Pixel { column, row, cells: [a, b, c, d] }),
                    _ => {}
                }
            }
        }
        weights
    }
}

/// The normalised histograms of the block whose first pixel is (`x`, `y`) of `gradient`, into `block`
/// (`spec.block_len` elements: cells column by column, bins within).
pub fn block_histogram(gradient: &Gradient, x: usize, y: usize, spec: &HogSpec, block: &mut [f32]) {
    block.fill(0.0);
    let first = y * gradient.width + x;
    add_votes(gradient, first, &spec.weights.one, block);
    add_votes(gradient, first, &spec.weights.two, block);
    add_votes(gradient, first, &spec.weights.four, block);
    normalise(block, spec.l2_hys_threshold);
}

fn add_votes<const CELLS: usize>(
    gradient: &Gradient,
    first: usize,
    pixels: &[Pixel<CELLS>],
    block: &mut [f32],
) {
    for pixel in pixels {
        let at = first + pixel.row * gradient.width + pixel.column;
        let [g0, g1] = gradient.shares[at];
        let [b0, b1] = gradient.bins[at].map(usize::from);
        for (cell, weight) in pixel.cells {
            // Both sums start from the old values: with a single bin the second share replaces the first.
            let sums = (block[cell + b0] + g0 * weight, block[cell + b1] + g1 * weight);
            block[cell + b0] = sums.0;
            block[cell + b1] = sums.1;
        }
    }
}

/// L2-Hys: scale to unit length, clip at `threshold`, scale again. A block without gradient stays zero.
fn normalise(block: &mut [f32], threshold: f32) {
    let scale = 1.0 / (sum_of_squares(block).sqrt() + block.len() as f32 * 0.1);
    for value in block.iter_mut() {
        *value = (*value * scale).min(threshold);
    }
    let scale = 1.0 / (sum_of_squares(block).sqrt() + 1e-3);
    for value in block.iter_mut() {
        *value *= scale;
    }
}

/// The sum of squares in four lanes, then the rest one by one.
fn sum_of_squares(block: &[f32]) -> f32 {
    let (vectors, tail) = block.as_chunks::<4>();
    let mut lanes = [0.0f32; 4];
    for vector in vectors {
        for (lane, value) in lanes.iter_mut().zip(vector) {
            *lane += value * value;
        }
    }
    let sum = (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]);
    tail.iter().fold(sum, |sum, value| sum + value * value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_of_two_by_two_cells_shares_its_pixels_in_nine_zones() {
        // 1 2 1     corners reach one cell, edges two, the middle four
        // 2 4 2
        // 1 2 1     (zones of 4, 8 and 4 pixels)
        let weights = BlockWeights::new(Size::new(16, 16), Size::new(8, 8), 9, 4.0);
        assert_eq!((weights.one.len(), weights.two.len(), weights.four.len()), (4 * 16, 4 * 32, 64));
    }

    #[test]
    fn normalising_clips_and_gives_nearly_unit_length() {
        let mut block = [0.0f32; 36];
        block[..8].fill(100.0);
        block[8] = 1000.0;
        normalise(&mut block, 0.2);
        let length = block.iter().map(|v| v * v).sum::<f32>().sqrt();
        assert!((length - 1.0).abs() < 5e-3, "{length}");
        let mut flat = [0.0f32; 3];
        normalise(&mut flat, 0.2);
        assert_eq!(flat, [0.0; 3]);
    }
}
