//! The exact linear resize, bit for bit OpenCV's INTER_LINEAR_EXACT.

use std::ops::Range;

use crate::error::{ImageError, Result};
use crate::geometry::Size;
use crate::image::{ImageView, SIDE_MAX};
use crate::memory;

/// Where one output pixel reads along one axis: two neighbours and the weight of the second, in 1/256.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tap {
    /// First source pixel.
    pub first: usize,
    /// Second source pixel; the first again at the edges.
    pub second: usize,
    /// Weight of the second, 0..=256; the first has the rest.
    pub weight: u32,
}

/// The taps of OpenCV's INTER_LINEAR_EXACT from `from` pixels to `to`, those of the pixels `wanted`.
///
/// ```
/// use hog_core::pyramid::{Tap, taps};
/// // Pixel 1 of two, made of four: half of pixel 2 and half of pixel 3.
/// assert_eq!(taps(4, 2, 1..2).next(), Some(Tap { first: 2, second: 3, weight: 128 }));
/// ```
pub fn taps(from: usize, to: usize, wanted: Range<usize>) -> impl ExactSizeIterator<Item = Tap> + Clone {
    let step = 1.0 / (to as f64 / from as f64);
    let tap = move |index: usize| {
        let position = step * (index as f64 + 0.5) - 0.5;
        let first = position.floor();
        if first < 0.0 || from == 1 {
            return Tap { first: 0, second: 0, weight: 0 };
        }
        if first >= (from - 1) as f64 {
            return Tap { first: from - 1, second: from - 1, weight: 0 };
        }
        let weight = ((position - first) * 256.0).round_ties_even() as u32;
        Tap { first: first as usize, second: first as usize + 1, weight }
    };
    wanted.map(tap)
}

/// Refuses sizes that no image can have.
pub(crate) fn check(size: Size) -> Result<()> {
    let Size { width, height } = size;
    if width == 0 || height == 0 {
        return Err(ImageError::Resize { width, height }.into());
    }
    if width > SIDE_MAX || height > SIDE_MAX {
        return Err(ImageError::TooLarge { width, height }.into());
    }
    Ok(())
}

/// `image` at `size`, bit for bit as OpenCV's INTER_LINEAR_EXACT; rows without gaps, channels interleaved.
///
/// ```
/// use hog_core::{ImageView, Size, pyramid};
/// let image = ImageView::new(&[0, 100, 0, 100], 4, 1, 1, 4)?;
/// assert_eq!(pyramid::resize(image, Size::new(2, 1))?, [50, 50]);
/// # Ok::<(), hog_core::HogError>(())
/// ```
pub fn resize(image: ImageView, size: Size) -> Result<Vec<u8>> {
    resize_part(image, size, 0..size.width, 0..size.height)
}

/// Some columns and rows of `image` at `size`.
pub(crate) fn resize_part(
    image: ImageView,
    size: Size,
    columns: Range<usize>,
    rows: Range<usize>,
) -> Result<Vec<u8>> {
    let channels = image.channels();
    check(size)?;
    let part = Size::new(columns.len(), rows.len());
    let across = memory::collect(taps(image.width(), size.width, columns))?;
    let down = taps(image.height(), size.height, rows);
    let shrink_row = |y: usize, out: &mut Vec<u32>| {
        let row = image.row(y);
        out.clear();
        for tap in &across {
            let (first, second) = (&row[tap.first * channels..], &row[tap.second * channels..]);
            for c in 0..channels {
                out.push(u32::from(first[c]) * (256 - tap.weight) + u32::from(second[c]) * tap.weight);
            }
        }
    };
    let mut out = memory::with_room(part.area().saturating_mul(channels))?;
    let row = || memory::with_room(part.width.saturating_mul(channels));
    let (mut upper, mut lower) = (row()?, row()?);
    let (mut upper_row, mut lower_row) = (usize::MAX, usize::MAX);
    for tap in down {
        if tap.first != upper_row {
            if tap.first == lower_row {
                std::mem::swap(&mut upper, &mut lower);
                lower_row = usize::MAX;
            } else {
                shrink_row(tap.first, &mut upper);
            }
            upper_row = tap.first;
        }
        if tap.second != lower_row {
            shrink_row(tap.second, &mut lower);
            lower_row = tap.second;
        }
        let mixed = upper.iter().zip(&lower);
        out.extend(mixed.map(|(a, b)| ((a * (256 - tap.weight) + b * tap.weight + (1 << 15)) >> 16) as u8));
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halving_averages_four_pixels_rounding_up() {
        let data = [1, 2, 10, 10, 3, 4, 10, 11];
        let image = ImageView::new(&data, 4, 2, 1, 4).unwrap();
        assert_eq!(resize(image, Size::new(2, 1)).unwrap(), [(1 + 2 + 3 + 4 + 2) / 4, (41 + 2) / 4]);
    }

    #[test]
    fn a_part_is_cut_from_the_whole() {
        let data: Vec<u8> = (0..30 * 20 * 3).map(|i| (i * i / 7) as u8).collect();
        let image = ImageView::new(&data, 30, 20, 3, 90).unwrap();
        let size = Size::new(23, 11);
        let whole = resize(image, size).unwrap();
        let part = resize_part(image, size, 4..17, 3..9).unwrap();
        for (y, row) in (3..9).zip(part.chunks_exact(13 * 3)) {
            assert_eq!(row, &whole[(y * 23 + 4) * 3..][..13 * 3]);
        }
    }

    #[test]
    fn the_same_size_gives_the_same_image() {
        let data: Vec<u8> = (0..60).collect();
        let image = ImageView::new(&data, 5, 4, 3, 15).unwrap();
        assert_eq!(resize(image, Size::new(5, 4)).unwrap(), data);
    }
}
