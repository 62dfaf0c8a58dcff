//! What the user asks for ([`HogParams`]) and the counts that follow from it ([`HogSpec`]), checked once.

use crate::error::{GeometryError, Result};
use crate::geometry::Size;

/// The constructor arguments of `cv2.HOGDescriptor`, unchecked; sizes are (x, y) \[px\].
///
/// ```
/// use hog_core::HogParams;
/// let finer = HogParams { nbins: 12, ..HogParams::default() };
/// assert_eq!(finer.effective_win_sigma(), 4.0);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct HogParams {
    /// Detection window.
    pub win_size: (i64, i64),
    /// Block of cells that is normalised as one.
    pub block_size: (i64, i64),
    /// Distance between neighbouring blocks.
    pub block_stride: (i64, i64),
    /// Cell, the carrier of one orientation histogram.
    pub cell_size: (i64, i64),
    /// Orientation bins of a cell.
    pub nbins: i64,
    /// Gaussian window of a block \[px\]; not positive: (block width + block height) / 8.
    pub win_sigma: f64,
    /// Clipping value of L2-Hys.
    pub l2_hys_threshold: f64,
    /// Square root of the pixel values before the gradient.
    pub gamma_correction: bool,
    /// Most levels a pyramid may have.
    pub nlevels: i64,
    /// Bins over 2π instead of π.
    pub signed_gradient: bool,
}

impl Default for HogParams {
    /// The geometry of OpenCV's default people detector.
    fn default() -> Self {
        Self {
            win_size: (64, 128),
            block_size: (16, 16),
            block_stride: (8, 8),
            cell_size: (8, 8),
            nbins: 9,
            win_sigma: -1.0,
            l2_hys_threshold: 0.2,
            gamma_correction: true,
            nlevels: 64,
            signed_gradient: false,
        }
    }
}

impl HogParams {
    /// The Gaussian's sigma \[px\] in force: the given one, or the default where none is given.
    pub fn effective_win_sigma(&self) -> f64 {
        if self.win_sigma > 0.0 {
            self.win_sigma
        } else {
            (self.block_size.0 + self.block_size.1) as f64 / 8.0
        }
    }
}

/// A checked geometry with its derived counts. Functions that take a `HogSpec` cannot fail on geometry.
///
/// ```
/// use hog_core::{HogParams, HogSpec, Size};
/// let spec = HogSpec::new(&HogParams::default())?;
/// assert_eq!((spec.blocks, spec.descriptor_len()), (Size::new(7, 15), 3780));
/// let odd = HogParams { cell_size: (5, 5), ..HogParams::default() };
/// assert!(HogSpec::new(&odd).unwrap_err().to_string().contains("16"));
/// # Ok::<(), hog_core::HogError>(())
/// ```
#[derive(Debug, Clone)]
pub struct HogSpec {
    /// Detection window \[px\].
    pub win: Size,
    /// Block \[px\].
    pub block: Size,
    /// Block stride \[px\].
    pub stride: Size,
    /// Cell \[px\].
    pub cell: Size,
    /// Orientation bins, 1..=256.
    pub nbins: usize,
    /// Blocks of a window along x and y; 0 where the window is smaller than the block.
    pub blocks: Size,
    /// Elements of a block: bins × cells.
    pub block_len: usize,
    /// Clipping value of L2-Hys.
    pub l2_hys_threshold: f32,
    /// Square root before the gradient.
    pub gamma_correction: bool,
    /// Most levels of a pyramid.
    pub nlevels: usize,
    /// Bins over 2π instead of π.
    pub signed_gradient: bool,
    /// The block's Gaussian \[px\].
    pub sigma: f32,
}

/// Largest side that keeps every derived count far from overflow.
const SIDE_MAX: i64 = 1 << 15;

fn positive(name: &'static str, (x, y): (i64, i64)) -> Result<Size> {
    if (1..=SIDE_MAX).contains(&x) && (1..=SIDE_MAX).contains(&y) {
        return Ok(Size::new(x as usize, y as usize));
    }
    Err(GeometryError::Side { name, x, y, most: SIDE_MAX }.into())
}

/// Blocks along one axis; the window must hold a whole number of strides beyond the first block.
fn blocks_along(axis: &'static str, window: usize, block: usize, stride: usize) -> Result<usize> {
    if !window.abs_diff(block).is_multiple_of(stride) {
        return Err(GeometryError::Stride { axis, window, block, stride }.into());
    }
    Ok(if window < block { 0 } else { (window - block) / stride + 1 })
}

impl HogSpec {
    /// Checks `params` and derives everything from it; names the first pair of sizes that does not fit.
    pub fn new(params: &HogParams) -> Result<Self> {
        let win = positive("winSize", params.win_size)?;
        let block = positive("blockSize", params.block_size)?;
        let stride = positive("blockStride", params.block_stride)?;
        let cell = positive("cellSize", params.cell_size)?;
        if !(1..=256).contains(&params.nbins) {
            return Err(GeometryError::Bins { got: params.nbins }.into());
        }
        if !block.width.is_multiple_of(cell.width) || !block.height.is_multiple_of(cell.height) {
            return Err(GeometryError::Cells { block, cell }.into());
        }
        if params.nlevels < 1 {
            return Err(GeometryError::Levels { got: params.nlevels }.into());
        }
        let blocks = Size::new(
            blocks_along("width", win.width, block.width, stride.width)?,
            blocks_along("height", win.height, block.height, stride.height)?,
        );
        let nbins = params.nbins as usize;
        let cells = Size::new(block.width / cell.width, block.height / cell.height);
        let block_len = cells.width.saturating_mul(cells.height).saturating_mul(nbins);
        let elements = block_len.saturating_mul(blocks.width).saturating_mul(blocks.height);
        if elements > i32::MAX as usize {
            return Err(GeometryError::DescriptorLength { elements }.into());
        }
        Ok(Self {
            win,
            block,
            stride,
            cell,
            nbins,
            blocks,
            block_len,
            l2_hys_threshold: params.l2_hys_threshold as f32,
            gamma_correction: params.gamma_correction,
            nlevels: params.nlevels.min(i64::from(i32::MAX)) as usize,
            signed_gradient: params.signed_gradient,
            sigma: params.effective_win_sigma() as f32,
        })
    }

    /// Elements of a window's descriptor.
    pub fn descriptor_len(&self) -> usize {
        self.block_len * self.blocks.width * self.blocks.height
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_window_has_7_by_15_blocks_of_36() {
        let spec = HogSpec::new(&HogParams::default()).unwrap();
        assert_eq!((spec.blocks.width, spec.blocks.height, spec.block_len), (7, 15, 36));
        assert_eq!(spec.descriptor_len(), 3780);
    }

    #[test]
    fn a_geometry_that_does_not_fit_is_named_with_its_numbers() {
        let odd = HogParams { win_size: (65, 128), ..HogParams::default() };
        let refused = |params: &HogParams| HogSpec::new(params).unwrap_err();
        let stride = GeometryError::Stride { axis: "width", window: 65, block: 16, stride: 8 };
        assert_eq!(refused(&odd), stride.into());
        assert_eq!(
            refused(&odd).to_string(),
            "window width 65 minus block width 16 must be a multiple of block stride 8"
        );
        let zero = HogParams { block_stride: (8, 0), ..HogParams::default() };
        assert!(refused(&zero).to_string().contains("blockStride is (8, 0); both sides must be 1 to 32768"));
        let many = HogParams { nbins: 300, ..HogParams::default() };
        assert_eq!(refused(&many), GeometryError::Bins { got: 300 }.into());
    }

    #[test]
    fn a_window_smaller_than_its_block_has_no_blocks() {
        let small = HogParams { win_size: (8, 8), ..HogParams::default() };
        assert_eq!(HogSpec::new(&small).unwrap().descriptor_len(), 0);
    }
}
