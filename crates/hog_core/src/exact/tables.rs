//! Tables of a geometry: the value of each pixel after gamma correction, and its weight in each cell of a block; and the
//! kernels that help with its gradient.

use crate::error::Result;
use crate::geometry::Size;
use crate::memory;
use crate::params::HogSpec;

use super::kernel::{Loops, RowKernel};

/// The tables of one geometry.
#[derive(Debug, Clone)]
pub struct Tables {
    /// Makes the votes of what it can of a row, to the same bits as the loops.
    pub(crate) kernel: &'static dyn RowKernel,
    /// Which pixel of a block adds how much to which cell.
    pub(super) weights: BlockWeights,
}

impl Tables {
    /// The tables of the geometry `spec`, without kernels.
    pub fn new(spec: &HogSpec) -> Result<Self> {
        Self::with_kernel(spec, &Loops)
    }

    /// The tables of the geometry `spec`, and a kernel for its gradient.
    pub(crate) fn with_kernel(spec: &HogSpec, kernel: &'static dyn RowKernel) -> Result<Self> {
        Ok(Self { kernel, weights: BlockWeights::new(spec.block, spec.cell, spec.sigma)? })
    }
}

/// The value of each pixel after gamma correction: its square root, or itself.
///
/// ```
/// use hog_core::exact::gamma_table;
/// assert_eq!((gamma_table(true)[144], gamma_table(false)[144]), (12.0, 144.0));
/// ```
pub fn gamma_table(gamma_correction: bool) -> [f32; 256] {
    std::array::from_fn(|value| if gamma_correction { (value as f32).sqrt() } else { value as f32 })
}

/// Weights of a block's pixels in its cells: Gaussian times bilinear share.
///
/// Pixels that reach one cell come first, then those of two, then those of four; each group column by column.
/// Single precision sums depend on that order, and descriptors are to equal OpenCV's to the last bit.
#[derive(Debug, Clone, Default)]
pub(super) struct BlockWeights {
    pub(super) one: Vec<Pixel<1>>,
    pub(super) two: Vec<Pixel<2>>,
    pub(super) four: Vec<Pixel<4>>,
    /// The same pixels in the same order, for blocks of up to 4 and up to 16 cells.
    pub(super) abreast_4: Vec<Abreast<4>>,
    pub(super) abreast_16: Vec<Abreast<16>>,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Pixel<const CELLS: usize> {
    pub(super) column: usize,
    pub(super) row: usize,
    /// The cells that the pixel reaches, and its weight in each.
    pub(super) cells: [(usize, f32); CELLS],
}

/// A pixel with its weight in every cell of the block: zero in those it does not reach.
#[derive(Debug, Clone, Copy)]
pub(super) struct Abreast<const LANES: usize> {
    pub(super) column: usize,
    pub(super) row: usize,
    pub(super) weights: [f32; LANES],
}

impl<const CELLS: usize> Pixel<CELLS> {
    fn abreast<const LANES: usize>(&self) -> Abreast<LANES> {
        let mut weights = [0.0; LANES];
        self.cells.iter().for_each(|&(cell, weight)| weights[cell] = weight);
        Abreast { column: self.column, row: self.row, weights }
    }
}

/// How many of the pixels along one axis reach one cell, and how many two.
fn reach_along(cell: usize, cells: usize) -> [usize; 2] {
    let reaching = |wanted: usize| {
        (0..cell * cells).filter(|&pixel| cells_along(pixel, cell, cells).len() == wanted).count()
    };
    [reaching(1), reaching(2)]
}

/// Up to two cells (index and share) that a pixel reaches along one axis.
pub(crate) fn cells_along(pixel: usize, cell: usize, cells: usize) -> Vec<(usize, f32)> {
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
    pub(super) fn new(block: Size, cell: Size, sigma: f32) -> Result<Self> {
        let cells = Size::new(block.width / cell.width, block.height / cell.height);
        let scale = 1.0 / ((sigma * sigma) * 2.0);
        // Centred on (width / 2, height / 2), not on the middle pixel: the models were trained that way.
        let squared = |index: usize, side: usize| (index as f32 - side as f32 * 0.5).powi(2);
        let (across, down) = (reach_along(cell.width, cells.width), reach_along(cell.height, cells.height));
        let mut weights = Self::with_room(
            [across[0] * down[0], across[0] * down[1] + across[1] * down[0], across[1] * down[1]],
            cells.area(),
        )?;
        for column in 0..block.width {
            let across = cells_along(column, cell.width, cells.width);
            for row in 0..block.height {
                let down = cells_along(row, cell.height, cells.height);
                let exponent = -(squared(row, block.height) + squared(column, block.width)) * scale;
                let gauss = f64::from(exponent).exp() as f32;
                let reached = down.iter().flat_map(|&(cy, sy)| {
                    across.iter().map(move |&(cx, sx)| (cx * cells.height + cy, gauss * (sx * sy)))
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
        let mut abreast_4 = std::mem::take(&mut weights.abreast_4);
        let mut abreast_16 = std::mem::take(&mut weights.abreast_16);
        match cells.area() {
            0..=4 => abreast_4.extend(weights.abreast()),
            5..=16 => abreast_16.extend(weights.abreast()),
            _ => {}
        }
        Ok(Self { abreast_4, abreast_16, ..weights })
    }

    /// No weights yet, but room for those of so many pixels that reach one, two and four cells: a block may be so large
    /// that its weights do not fit the memory, and then this is known before they are computed.
    fn with_room([one, two, four]: [usize; 3], cells: usize) -> Result<Self> {
        let abreast = |least: usize, most: usize| {
            if (least..=most).contains(&cells) { one + two + four } else { 0 }
        };
        Ok(Self {
            one: memory::with_room(one)?,
            two: memory::with_room(two)?,
            four: memory::with_room(four)?,
            abreast_4: memory::with_room(abreast(0, 4))?,
            abreast_16: memory::with_room(abreast(5, 16))?,
        })
    }

    fn abreast<const LANES: usize>(&self) -> impl Iterator<Item = Abreast<LANES>> {
        let one = self.one.iter().map(Pixel::abreast);
        one.chain(self.two.iter().map(Pixel::abreast)).chain(self.four.iter().map(Pixel::abreast))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_of_two_by_two_cells_shares_its_pixels_in_nine_zones() {
        // 1 2 1     corners reach one cell, edges two, the middle four
        // 2 4 2
        // 1 2 1     (zones of 4, 8 and 4 pixels)
        let weights = BlockWeights::new(Size::new(16, 16), Size::new(8, 8), 4.0).unwrap();
        assert_eq!((weights.one.len(), weights.two.len(), weights.four.len()), (4 * 16, 4 * 32, 64));
    }

    #[test]
    fn room_is_made_for_as_many_weights_as_come() {
        for (cells, cell) in
            [((1, 1), (8, 8)), ((2, 2), (5, 5)), ((3, 2), (7, 4)), ((5, 4), (1, 3)), ((2, 3), (2, 1))]
        {
            let block = Size::new(cells.0 * cell.0, cells.1 * cell.1);
            let weights = BlockWeights::new(block, Size::new(cell.0, cell.1), 4.0).unwrap();
            assert_eq!(weights.one.capacity(), weights.one.len());
            assert_eq!(weights.two.capacity(), weights.two.len());
            assert_eq!(weights.four.capacity(), weights.four.len());
            assert_eq!(
                weights.abreast_4.capacity() + weights.abreast_16.capacity(),
                weights.abreast_4.len() + weights.abreast_16.len()
            );
        }
    }
}
