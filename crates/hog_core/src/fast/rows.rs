//! Pixels for the kernels: the image as planes, shrunk to a level, each row mirrored outwards.
//!
//! ```text
//! Planes::fill:  each row of the image → one row in each channel's plane, bytes flipped to signed
//! Band::begin:   which columns of the level are made, and the taps of each column and row
//! Band::fill:    each row of the level = mix of two rows of the plane (down), of two columns (across), mirrored outwards
//! ```
//!
//! Planes are `[channel][y][x]`, a byte each, without gaps, [`SLACK`] bytes behind the last. A band is `[row][channel]` of
//! these, `plane` bytes from channel to channel and `stride` from row to row:
//!
//! ```text
//! | slack, ≥ 16 | mirrored | made: pixels of the level | mirrored | OVERREAD | up to a multiple of 64 |
//! 0                        left                                                               plane
//! ```
//!
//! Tricks: 1. columns and rows are mixed at once, all channels together, by the exact resize's fixed-point weights, so that
//! no row of mixed columns is stored. 2. Signed bytes let one instruction multiply and add two neighbours. 3. Only the columns
//! of a tile are made, whatever the level's width.

use std::ops::Range;

use crate::error::Result;
use crate::geometry::Size;
use crate::image::{ImageView, reflect_101};
use crate::memory::{self, Workspace};
use crate::pyramid::{Tap, taps};

use super::lane::{Columns, Kernel, Lane, RowPointers};
use super::layout::{OVERREAD, SLACK, STEP};

/// The image as one plane per channel, rows without gaps, every byte flipped by 0x80 (signed, for the resize).
#[derive(Debug, Default)]
pub(crate) struct Planes {
    data: Vec<u8>,
    size: Size,
    channels: usize,
}

impl Planes {
    /// Copies the pixels of `image`.
    pub(super) fn fill<L: Lane>(&mut self, l: L, image: ImageView) -> Result<()> {
        let (width, height, channels) = (image.width(), image.height(), image.channels());
        let plane = width * height;
        memory::resize(&mut self.data, plane * channels + SLACK, 0)?;
        self.size = Size::new(width, height);
        self.channels = channels;
        for y in 0..height {
            let row = image.row(y);
            if channels == 1 {
                for (to, from) in self.data[y * width..][..width].iter_mut().zip(row) {
                    *to = from ^ 0x80;
                }
            } else {
                let (first, rest) = self.data.split_at_mut(plane);
                let (second, third) = rest.split_at_mut(plane);
                let to = [first, second, third].map(|plane| plane[y * width..][..width].as_mut_ptr());
                // SAFETY: each of `to` is a row of `width` pixels.
                l.compiled(unsafe { Deinterleave::new(row, to, width) });
            }
        }
        Ok(())
    }

    /// Takes the pixels of `source`, resized to `size`.
    pub(super) fn resize<L: Lane>(&mut self, l: L, source: &Self, size: Size) -> Result<()> {
        let mut band = Band::default();
        self.channels = source.channels;
        self.size = size;
        memory::resize(&mut self.data, size.area() * source.channels + SLACK, 0)?;
        band.begin(source, size, 0..size.width as i64, L::GROUP, L::REACH)?;
        for y in 0..size.height {
            band.fill(l, source, y as i64, 1)?;
            for channel in 0..source.channels {
                let from = &band.data[channel * band.plane + band.left..][..size.width];
                let to = &mut self.data[(channel * size.height + y) * size.width..][..size.width];
                for (to, from) in to.iter_mut().zip(from) {
                    *to = from ^ 0x80;
                }
            }
        }
        Ok(())
    }

    pub(super) fn channels(&self) -> usize {
        self.channels
    }

    fn row(&self, channel: usize, y: usize) -> &[u8] {
        &self.data[(channel * self.size.height + y) * self.size.width..]
    }
}

/// Splits a row of three channels into planes.
struct Deinterleave<'a> {
    row: &'a [u8],
    /// Each with room for a third of the row.
    to: [*mut u8; 3],
}

impl<'a> Deinterleave<'a> {
    /// # Safety
    ///
    /// - `row` has three bytes for each of `width` pixels.
    /// - Each of `to` points at `width` writable bytes.
    unsafe fn new(row: &'a [u8], to: [*mut u8; 3], width: usize) -> Self {
        debug_assert_eq!(row.len(), 3 * width);
        Self { row, to }
    }
}

impl Kernel for Deinterleave<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lane>(self, l: L) {
        // SAFETY: promised to `new`.
        unsafe { l.deinterleave::<0x80>(self.row.as_ptr(), self.to, self.row.len() / 3) }
    }
}

impl Workspace for Planes {
    fn bytes(&self) -> usize {
        self.data.capacity()
    }
}

/// Rows of some columns of a level, mirrored outwards where the level ends: as many at a time as stay in the
/// second-level cache.
#[derive(Debug, Default)]
pub(super) struct Band {
    data: Vec<u8>,
    size: Size,
    /// The columns [px of the level]; negative, or beyond the level, where they are mirrored.
    wanted: Range<i64>,
    /// Those of them that are made, not mirrored, and others that are mirrored.
    made: Range<usize>,
    /// Bytes from row to row; the channels of a row lie one after the other.
    pub stride: usize,
    /// Bytes from channel to channel.
    pub plane: usize,
    /// Bytes before the first pixel that is made.
    left: usize,
    columns: Columns,
    /// Which two rows of the image make a row of the level; none if the level is the image.
    down: Vec<Tap>,
    /// The heights of the image and the level that these are of.
    heights: (usize, usize),
}

impl Band {
    /// For every channel, the second of the wanted columns in the first row; the first one is its neighbour.
    pub(super) fn origin(&self) -> [*const u8; 3] {
        let channels = self.stride / self.plane;
        std::array::from_fn(|channel| {
            self.data[channel.min(channels - 1) * self.plane + self.first() + 1..].as_ptr()
        })
    }

    /// Bytes before the first of the wanted columns.
    fn first(&self) -> usize {
        (self.left as i64 + self.wanted.start - self.made.start as i64) as usize
    }

    /// Prepares for the columns `wanted` of the level of `size` pixels.
    pub(super) fn begin(
        &mut self,
        source: &Planes,
        size: Size,
        wanted: Range<i64>,
        group: usize,
        reach: usize,
    ) -> Result<()> {
        let width = size.width as i64;
        let (before, after) = ((-wanted.start).max(0), (wanted.end - width).max(0));
        // The pixels that are mirrored lie within as many of the border as there are mirrored ones, and a chunk more.
        let chunk = MIRRORED as i64;
        let start = if after > 0 { wanted.start.min(width - after - 2 * chunk) } else { wanted.start }.max(0);
        let end = if before > 0 { wanted.end.max(before + 2 * chunk) } else { wanted.end }.min(width);
        self.made = start as usize..end as usize;
        self.left = ((start - wanted.start).max(0) as usize + 16 + MIRRORED).next_multiple_of(64);
        self.plane = (self.left + self.made.len() + after as usize + OVERREAD + STEP).next_multiple_of(64);
        self.wanted = wanted;
        self.size = size;
        self.stride = self.plane * source.channels;
        let heights = (source.size.height, size.height);
        if size == source.size {
            self.down.clear();
        } else {
            self.columns.fill((source.size.width, size.width), self.made.clone(), group, reach)?;
            // The next tile is mostly of the same level.
            if self.heights != heights || self.down.is_empty() {
                self.down.clear();
                memory::extend(&mut self.down, taps(heights.0, heights.1, 0..heights.1))?;
                self.heights = heights;
            }
        }
        Ok(())
    }

    /// How much this holds [bytes].
    pub(super) fn bytes(&self) -> usize {
        self.data.capacity() + self.columns.bytes() + self.down.capacity() * size_of::<Tap>()
    }

    /// Makes the rows `from..from + count` of the level, mirrored where there are none.
    pub(super) fn fill<L: Lane>(&mut self, l: L, source: &Planes, from: i64, count: usize) -> Result<()> {
        if self.data.len() < count * self.stride {
            memory::resize(&mut self.data, count * self.stride, 0)?;
        }
        match source.channels {
            1 => l.compiled(FillBand::<1> { band: self, source, from, count }),
            _ => l.compiled(FillBand::<3> { band: self, source, from, count }),
        }
        Ok(())
    }
}

/// The work of [`Band::fill`]: there is room for the rows.
struct FillBand<'a, const C: usize> {
    band: &'a mut Band,
    source: &'a Planes,
    from: i64,
    count: usize,
}

impl<const C: usize> Kernel for FillBand<'_, C> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lane>(self, l: L) {
        let Self { band, source, from, count } = self;
        let (width, height) = (band.made.len(), band.size.height);
        let before = (band.made.start as i64 - band.wanted.start).max(0) as usize;
        let after = (band.wanted.end - band.made.end as i64).max(0) as usize;
        for (i, all) in band.data.chunks_exact_mut(band.stride).take(count).enumerate() {
            let y = reflect_101(from + i as i64, height);
            if let Some(tap) = band.down.get(y) {
                let rows = std::array::from_fn(|channel| RowPointers {
                    upper: source.row(channel, tap.first).as_ptr(),
                    lower: source.row(channel, tap.second).as_ptr(),
                    to: all[channel * band.plane + band.left..][..width.next_multiple_of(STEP)].as_mut_ptr(),
                });
                // SAFETY: every tap lies in its row, behind which are SLACK bytes; there is room for all groups.
                unsafe { l.resize_row::<C>(rows, tap.weight as i16, &band.columns) };
            } else {
                for channel in 0..C {
                    let to = &mut all[channel * band.plane + band.left..][..width];
                    for (to, from) in to.iter_mut().zip(&source.row(channel, y)[band.made.start..]) {
                        *to = from ^ 0x80;
                    }
                }
            }
            for row in all.chunks_exact_mut(band.plane) {
                mirror(row, band.left, width, [before, after]);
            }
        }
    }
}

/// Pixels that are mirrored at a time.
const MIRRORED: usize = 16;

/// Continues the `width` pixels at `left` by `before` and `after` mirrored ones (or some more).
#[inline(always)]
fn mirror(row: &mut [u8], left: usize, width: usize, [before, after]: [usize; 2]) {
    if width <= before.max(after).next_multiple_of(MIRRORED) {
        for i in 0..before {
            row[left - 1 - i] = row[left + reflect_101(-1 - i as i64, width)];
        }
        for i in 0..after {
            row[left + width + i] = row[left + reflect_101((width + i) as i64, width)];
        }
        return;
    }
    let (outer, from) = row.split_at_mut(left);
    let (inner, behind) = from.split_at_mut(width);
    let chunk = |at: usize| -> [u8; MIRRORED] { std::array::from_fn(|k| inner[at + MIRRORED - 1 - k]) };
    for i in (0..before).step_by(MIRRORED) {
        outer[left - i - MIRRORED..][..MIRRORED].copy_from_slice(&chunk(1 + i));
    }
    for i in (0..after).step_by(MIRRORED) {
        behind[i..][..MIRRORED].copy_from_slice(&chunk(width - 1 - i - MIRRORED));
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may fail")]
mod tests {
    use super::super::backend::Backend;
    use super::super::dispatch::{OnLane, on_lane};
    use super::*;
    use crate::pyramid::resize;

    /// Rows of a level, mirrored by `pad` pixels on all sides, against the exact resize.
    fn assert_rows<L: Lane, const C: usize>(l: L, from: Size, to: Size, pad: usize) {
        let data: Vec<u8> = (0..from.width * from.height * C).map(|i| (i * i / 7 + 13 * i) as u8).collect();
        let image = ImageView::new(&data, from.width, from.height, C, from.width * C).unwrap();
        let wanted = resize(image, to).unwrap();
        let mut planes = Planes::default();
        planes.fill(l, image).unwrap();
        let mut band = Band::default();
        let columns = -(pad as i64)..(to.width + pad) as i64;
        band.begin(&planes, to, columns, L::GROUP, L::REACH).unwrap();
        let count = to.height + 2 * pad;
        band.fill(l, &planes, -(pad as i64), count).unwrap();
        for y in 0..count {
            let wanted_y = reflect_101(y as i64 - pad as i64, to.height);
            for x in 0..to.width + 2 * pad {
                let wanted_x = reflect_101(x as i64 - pad as i64, to.width);
                for channel in 0..C {
                    let found = band.data[y * band.stride + channel * band.plane + band.first() + x];
                    let wanted = wanted[(wanted_y * to.width + wanted_x) * C + channel];
                    assert_eq!(found, wanted, "{from:?} to {to:?}, {C} channels, ({x}, {y})");
                }
            }
        }
    }

    fn assert_levels<L: Lane>(l: L) {
        for width in [1, 2, 31, 32, 33, 64, 100, 129, 1000, 3000] {
            for shrunk in [1.0, 1.05, 1.9, 2.0, 3.7, 4.1, 8.3, 17.0, 40.0, 100.0] {
                let from = Size::new(width, 9);
                let to = Size::new((width as f64 / shrunk).ceil() as usize, 4);
                assert_rows::<L, 1>(l, from, to, 9);
                assert_rows::<L, 3>(l, from, to, 40);
            }
        }
        assert_rows::<L, 3>(l, Size::new(70, 50), Size::new(70, 50), 3);
    }

    struct Levels;

    impl OnLane for Levels {
        type Output = ();
        fn run<L: Lane>(self, l: L) {
            assert_levels(l);
        }
    }

    #[test]
    fn rows_are_those_of_the_exact_resize_however_much_the_image_shrinks() {
        for backend in Backend::ALL.into_iter().filter(|backend| backend.is_available()) {
            on_lane(backend, Levels);
        }
    }
}
