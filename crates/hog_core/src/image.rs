//! Borrowed views of 8-bit images, and the border rule.

use crate::error::{ImageError, Result};
use crate::geometry::Size;

/// The longest side of an image [px]: with its padding it is an `i32`, as OpenCV's.
pub(crate) const SIDE_MAX: usize = i32::MAX as usize / 4;

/// A borrowed 8-bit image: rows of interleaved pixels, `row_stride` bytes apart.
///
/// ```
/// use hog_core::ImageView;
/// // Two rows of three pixels in colour, each row padded to 12 bytes.
/// let data = [0; 24];
/// let image = ImageView::new(&data, 3, 2, 3, 12)?;
/// assert_eq!(image.row(1).len(), 9);
/// // An image that does not lie within its data is refused.
/// assert!(ImageView::new(&data, 3, 3, 3, 12).is_err());
/// # Ok::<(), hog_core::HogError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct ImageView<'a> {
    data: &'a [u8],
    width: usize,
    height: usize,
    channels: usize,
    row_stride: usize,
}

impl<'a> ImageView<'a> {
    /// A view of `data`; the image has 1 or 3 channels, at least one pixel, and lies within `data`.
    pub fn new(
        data: &'a [u8],
        width: usize,
        height: usize,
        channels: usize,
        row_stride: usize,
    ) -> Result<Self> {
        if channels != 1 && channels != 3 {
            return Err(ImageError::Channels { got: channels }.into());
        }
        if width == 0 || height == 0 {
            return Err(ImageError::Empty { width, height }.into());
        }
        if width > SIDE_MAX || height > SIDE_MAX {
            return Err(ImageError::TooLarge { width, height }.into());
        }
        let row = width * channels;
        let needed = row_stride.checked_mul(height - 1).and_then(|bytes| bytes.checked_add(row));
        if row_stride < row || needed.is_none_or(|bytes| bytes > data.len()) {
            return Err(ImageError::Data { len: data.len(), row_stride, width, height, channels }.into());
        }
        Ok(Self { data, width, height, channels, row_stride })
    }

    /// Width \[px\].
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height \[px\].
    pub fn height(&self) -> usize {
        self.height
    }

    /// Width and height \[px\].
    pub fn size(&self) -> Size {
        Size::new(self.width, self.height)
    }

    /// 1 (gray) or 3 (colour, in any order).
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// The `width * channels` bytes of row `y`.
    pub fn row(&self, y: usize) -> &'a [u8] {
        &self.data[y * self.row_stride..][..self.width * self.channels]
    }
}

/// An image of its own, without gaps between its rows.
#[derive(Debug)]
pub(crate) struct Image {
    pub data: Vec<u8>,
    pub size: Size,
    pub channels: usize,
}

impl Image {
    pub(crate) fn view(&self) -> Result<ImageView<'_>> {
        let Size { width, height } = self.size;
        ImageView::new(&self.data, width, height, self.channels, width * self.channels)
    }
}

/// Mirrors `index` into `0..len` without repeating the edge pixel (reflect-101), as often as it takes.
pub fn reflect_101(index: i64, len: usize) -> usize {
    if len == 1 {
        return 0;
    }
    let period = 2 * (len as i64 - 1);
    let folded = index.rem_euclid(period);
    folded.min(period - folded) as usize
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may fail")]
mod tests {
    use super::*;
    use crate::error::HogError;

    #[test]
    fn reflection_repeats_until_inside() {
        //           image 0 1 2 |  ...2 1 0 1 2 1 0...
        let mirrored: Vec<_> = (-5..8).map(|i| reflect_101(i, 3)).collect();
        assert_eq!(mirrored, [1, 0, 1, 2, 1, 0, 1, 2, 1, 0, 1, 2, 1]);
        assert_eq!(reflect_101(-7, 1), 0);
    }

    #[test]
    fn a_view_that_leaves_its_data_is_refused() {
        assert!(ImageView::new(&[0; 12], 4, 3, 1, 4).is_ok());
        assert!(ImageView::new(&[0; 11], 4, 3, 1, 4).is_err());
        assert!(ImageView::new(&[0; 12], 4, 3, 1, 3).is_err());
        assert!(ImageView::new(&[0; 12], 1, 3, 4, 4).is_err());
        assert!(ImageView::new(&[0; 36], 4, 3, 3, 4).is_err());
        assert!(ImageView::new(&[], 0, 3, 1, 4).is_err());
        assert!(ImageView::new(&[0; 12], 4, 3, 1, usize::MAX).is_err());
    }

    #[test]
    fn the_longest_side_is_a_quarter_of_the_largest_32_bit_number() {
        let most = (1 << 29) - 1;
        for (width, height) in [(most, 1), (1, most)] {
            // Refused for its data alone, of which there are none.
            let error = ImageView::new(&[], width, height, 1, width).unwrap_err();
            assert!(matches!(error, HogError::Image(ImageError::Data { .. })));
        }
        for (width, height) in [(most + 1, 1), (1, most + 1)] {
            let error = ImageView::new(&[], width, height, 1, width).unwrap_err();
            assert!(matches!(error, HogError::Image(ImageError::TooLarge { .. })));
        }
    }
}
