//! Which windows of an image are looked at: window stride, padding, and where each window lies.

use crate::error::{ParameterError, Result};
use crate::geometry::{Padding, Region, Size};
use crate::params::HogSpec;

/// The windows of one image, row by row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Grid {
    /// Padding on the left and right, top and bottom \[px\].
    pub pad: Size,
    /// Image with its padding \[px\].
    pub padded: Size,
    /// Distance between neighbouring windows \[px\].
    pub stride: Size,
    /// Windows along x and y.
    pub windows: Size,
}

/// Window stride and padding in (x, y) pixels as the user gave them, checked.
///
/// ```
/// use hog_core::pyramid::Steps;
/// use hog_core::{HogParams, HogSpec, Size};
/// let spec = HogSpec::new(&HogParams::default())?;
/// let grid = Steps::new((8, 8), (8, 8), spec.stride, &spec)?.grid(Size::new(64, 128), &spec);
/// assert_eq!((grid.windows, grid.to_image(0, 0)), (Size::new(3, 3), (-8, -8)));
/// # Ok::<(), hog_core::HogError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Steps {
    stride: Size,
    pad: Size,
}

/// More padding than this on a side is a mistake, and would only cost memory.
const PADDING_MAX: i64 = 1 << 14;

impl Steps {
    /// Checks a window stride and a padding; the stride (0, 0) stands for `default_stride`, negative padding for none.
    ///
    /// Padding is rounded up the way OpenCV does it, with a mask of gcd(window stride, block stride); that is a
    /// multiple only for powers of two, but the windows' places depend on it.
    pub fn new(
        stride: (i64, i64),
        padding: (i64, i64),
        default_stride: Size,
        spec: &HogSpec,
    ) -> Result<Self> {
        let stride = match stride {
            (0, 0) => default_stride,
            (x @ 1.., y @ 1..) => Size::new(x as usize, y as usize),
            (x, y) => return Err(ParameterError::WinStride { x, y }.into()),
        };
        let along = |pad: i64, win_stride: usize, block_stride: usize| {
            let common = gcd(win_stride, block_stride) as i64;
            if pad > PADDING_MAX {
                return Err(ParameterError::Padding { got: pad, most: PADDING_MAX });
            }
            Ok(((pad.max(0) + common - 1) & -common) as usize)
        };
        let pad = Size::new(
            along(padding.0, stride.width, spec.stride.width)?,
            along(padding.1, stride.height, spec.stride.height)?,
        );
        Ok(Self { stride, pad })
    }

    /// The windows of an image of `image` pixels; none where the padded image is smaller than the window.
    pub fn grid(&self, image: Size, spec: &HogSpec) -> Grid {
        let padded = Size::new(image.width + 2 * self.pad.width, image.height + 2 * self.pad.height);
        let along = |padded: usize, win: usize, stride: usize| {
            padded.checked_sub(win).map_or(0, |room| room / stride + 1)
        };
        let nx = along(padded.width, spec.win.width, self.stride.width);
        let ny = along(padded.height, spec.win.height, self.stride.height);
        let windows = if nx == 0 || ny == 0 { Size::new(0, 0) } else { Size::new(nx, ny) };
        Grid { pad: self.pad, padded, stride: self.stride, windows }
    }
}

impl Grid {
    /// The padding in the form that the gradient takes.
    pub fn padding(&self) -> Padding {
        Padding { left: self.pad.width as i64, top: self.pad.height as i64, size: self.padded }
    }

    /// The whole padded image.
    pub fn whole(&self) -> Region {
        Region { x: 0, y: 0, width: self.padded.width, height: self.padded.height }
    }

    /// How many windows there are.
    pub fn len(&self) -> usize {
        self.windows.width * self.windows.height
    }

    /// Whether there is no window.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Where a window at padded (x, y) begins in the image; negative inside the padding.
    pub fn to_image(&self, x: usize, y: usize) -> (i64, i64) {
        (x as i64 - self.pad.width as i64, y as i64 - self.pad.height as i64)
    }

    /// The padded place of a window that begins at image (x, y), if all of it lies within the padded image.
    pub fn to_padded(&self, (x, y): (i64, i64), spec: &HogSpec) -> Option<(usize, usize)> {
        let along = |at: i64, pad: usize, padded: usize, win: usize| {
            let at = usize::try_from(at.checked_add(pad as i64)?).ok()?;
            (at.checked_add(win)? <= padded).then_some(at)
        };
        let x = along(x, self.pad.width, self.padded.width, spec.win.width)?;
        let y = along(y, self.pad.height, self.padded.height, spec.win.height)?;
        Some((x, y))
    }
}

pub(crate) fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::HogParams;

    #[test]
    fn padding_is_rounded_up_by_mask() {
        let spec = HogSpec::new(&HogParams::default()).unwrap();
        let of = |stride, padding| Steps::new(stride, padding, spec.cell, &spec).unwrap().pad;
        assert_eq!(of((8, 8), (4, 4)), Size::new(8, 8));
        assert_eq!(of((6, 6), (5, 7)), Size::new(6, 8));
        assert_eq!(of((8, 8), (-3, 0)), Size::new(0, 0));
        let six = HogParams {
            win_size: (48, 96),
            block_size: (12, 12),
            block_stride: (6, 6),
            ..HogParams::default()
        };
        let spec = HogSpec::new(&HogParams { cell_size: (6, 6), ..six }).unwrap();
        assert_eq!(Steps::new((6, 6), (5, 7), spec.cell, &spec).unwrap().pad, Size::new(10, 8));
    }

    #[test]
    fn an_image_smaller_than_the_window_has_no_windows() {
        let spec = HogSpec::new(&HogParams::default()).unwrap();
        let steps = Steps::new((8, 8), (0, 0), spec.cell, &spec).unwrap();
        for (w, h) in [(63, 128), (64, 127), (10, 10), (1, 1000), (16, 193)] {
            assert!(steps.grid(Size::new(w, h), &spec).is_empty());
        }
        assert_eq!(steps.grid(Size::new(80, 136), &spec).windows, Size::new(3, 2));
    }

    #[test]
    fn a_stride_that_does_not_move_is_refused() {
        let spec = HogSpec::new(&HogParams::default()).unwrap();
        for stride in [(0, 8), (8, 0), (-8, 8)] {
            assert!(Steps::new(stride, (0, 0), spec.cell, &spec).is_err());
        }
    }
}
