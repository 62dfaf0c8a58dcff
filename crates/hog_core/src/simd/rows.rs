//! Pixels for the kernels: the image as planes, shrunk to a level, each row mirrored outwards.

use crate::image::{ImageView, reflect_101};
use crate::params::Size;
use crate::pyramid::{Tap, taps};

use super::lane::Lane;

/// Bytes that a kernel may read (and ignore) behind a plane.
pub(super) const SLACK: usize = 192;
/// Rows of mixed columns and of bytes are written in steps of this many elements.
const STEP: usize = 64;
/// A strip reads this far beyond the padded row: the rest of its last vector, and one neighbour.
const OVERREAD: usize = 8 * 16 + 16;

/// The image as one plane per channel, rows without gaps, every byte flipped by 0x80 (signed, as the resize wants it).
#[derive(Debug, Default)]
pub(crate) struct Planes {
    data: Vec<u8>,
    size: Option<Size>,
    channels: usize,
}

impl Planes {
    /// Takes over the pixels of `image`.
    #[inline(always)]
    pub(super) fn fill<L: Lane>(&mut self, l: L, image: ImageView) {
        let (width, height, channels) = (image.width(), image.height(), image.channels());
        let plane = width * height;
        self.size = Some(Size::new(width, height));
        self.channels = channels;
        self.data.resize(plane * channels + SLACK, 0);
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
                // SAFETY: a row of the image and of each plane has `width` pixels.
                unsafe { l.split(row.as_ptr(), to, width) };
            }
        }
    }

    pub(super) fn channels(&self) -> usize {
        self.channels
    }

    fn size(&self) -> Size {
        self.size.unwrap_or(Size::new(0, 0))
    }

    fn row(&self, channel: usize, y: usize) -> &[u8] {
        let size = self.size();
        &self.data[(channel * size.height + y) * size.width..]
    }
}

/// How a row is shrunk: for every output pixel two neighbours and their weights, in groups that one shuffle fills.
#[derive(Debug, Default)]
pub(super) struct Columns {
    /// First source pixel of each group.
    pub base: Vec<u32>,
    /// Two offsets per output pixel, from its group's base.
    pub index: Vec<u8>,
    /// Two weights per output pixel, together 256.
    pub weight: Vec<u8>,
    /// Most source pixels that a group spans.
    pub span: usize,
    taps: Vec<Tap>,
}

impl Columns {
    fn fill(&mut self, from: usize, to: usize, group: usize) {
        self.taps.clear();
        self.taps.extend(taps(from, to));
        let groups = to.div_ceil(STEP) * (STEP / group);
        for list in [&mut self.index, &mut self.weight] {
            list.clear();
            list.resize(2 * group * groups, 0);
        }
        self.base.clear();
        self.base.resize(groups, 0);
        self.span = 0;
        for (g, taps) in self.taps.chunks(group).enumerate() {
            let base = taps.first().map_or(0, |tap| tap.first);
            self.base[g] = base as u32;
            for (i, tap) in taps.iter().enumerate() {
                // A weight of 256 does not fit a byte: the one pixel then counts 255 times and once more.
                let (first, second, weight) = match tap.weight {
                    0 => (tap.first, tap.first, 1),
                    256 => (tap.second, tap.second, 1),
                    weight => (tap.first, tap.second, weight),
                };
                self.span = self.span.max(second - base + 1);
                let at = 2 * (g * group + i);
                self.index[at..at + 2].copy_from_slice(&[(first - base) as u8, (second - base) as u8]);
                self.weight[at..at + 2].copy_from_slice(&[(256 - weight) as u8, weight as u8]);
            }
        }
    }

    #[inline(always)]
    fn mix<L: Lane>(&self, l: L, source: &[u8], to: &mut [i16]) {
        if self.span <= L::REACH {
            debug_assert!(to.len() >= L::GROUP * self.base.len());
            // SAFETY: every tap lies in the row, behind which are SLACK bytes; `to` holds all groups.
            unsafe { l.mix_columns(source.as_ptr(), self, to.as_mut_ptr()) }
            return;
        }
        for (tap, to) in self.taps.iter().zip(to) {
            let pixel = |at: usize| i32::from(source[at].cast_signed());
            let weight = tap.weight as i32;
            *to = (pixel(tap.first) * (256 - weight) + pixel(tap.second) * weight) as i16;
        }
    }
}

/// What shrinking needs between rows.
#[derive(Debug, Default)]
pub(super) struct Shrink {
    columns: Columns,
    mixed: [Vec<i16>; 2],
    /// Which pixels stand left and right of a row, from the inside out.
    mirrored: Vec<[usize; 2]>,
}

/// The planes of one level, each row mirrored outwards by the padding and one pixel more.
#[derive(Debug, Default)]
pub(super) struct LevelImage {
    data: Vec<u8>,
    /// Bytes from row to row.
    pub stride: usize,
    /// Bytes before the first pixel of a row.
    pub left: usize,
    /// Bytes from plane to plane.
    pub plane: usize,
}

impl LevelImage {
    pub(super) fn pixels(&self) -> &[u8] {
        &self.data
    }

    /// Makes the level of `size` pixels, with room for `pad` pixels of border.
    #[inline(always)]
    pub(super) fn fill<L: Lane>(
        &mut self,
        l: L,
        source: &Planes,
        size: Size,
        pad: usize,
        shrink: &mut Shrink,
    ) {
        self.left = (pad + 16).next_multiple_of(64);
        self.stride = (self.left + size.width + pad + OVERREAD + STEP).next_multiple_of(64);
        self.plane = self.stride * size.height;
        self.data.resize(self.plane * source.channels, 0);
        let same = size == source.size();
        if !same {
            shrink.columns.fill(source.size().width, size.width, L::GROUP);
        }
        for channel in 0..source.channels {
            if same {
                for y in 0..size.height {
                    let row = self.row(channel, y, size.width);
                    for (to, from) in row.iter_mut().zip(source.row(channel, y)) {
                        *to = from ^ 0x80;
                    }
                }
            } else {
                self.shrink(l, source, channel, size, shrink);
            }
        }
        shrink.mirrored.clear();
        let width = size.width;
        let reflect = |i: usize| [reflect_101(-1 - i as i64, width), reflect_101((width + i) as i64, width)];
        shrink.mirrored.extend((0..=pad).map(reflect));
        for row in self.data.chunks_exact_mut(self.stride) {
            let row = &mut row[self.left - pad - 1..][..width + 2 * (pad + 1)];
            for (i, &[before, after]) in shrink.mirrored.iter().enumerate() {
                row[pad - i] = row[pad + 1 + before];
                row[pad + 1 + width + i] = row[pad + 1 + after];
            }
        }
    }

    fn row(&mut self, channel: usize, y: usize, width: usize) -> &mut [u8] {
        &mut self.data[channel * self.plane + y * self.stride + self.left..][..width]
    }

    #[inline(always)]
    fn shrink<L: Lane>(&mut self, l: L, source: &Planes, channel: usize, size: Size, shrink: &mut Shrink) {
        let Shrink { columns, mixed: [upper, lower], .. } = shrink;
        let room = size.width.next_multiple_of(STEP);
        upper.resize(room, 0);
        lower.resize(room, 0);
        let (mut upper_row, mut lower_row) = (usize::MAX, usize::MAX);
        for (y, tap) in taps(source.size().height, size.height).enumerate() {
            if upper_row != tap.first {
                if lower_row == tap.first {
                    std::mem::swap(upper, lower);
                    lower_row = usize::MAX;
                } else {
                    columns.mix(l, source.row(channel, tap.first), upper);
                }
                upper_row = tap.first;
            }
            if lower_row != tap.second {
                columns.mix(l, source.row(channel, tap.second), lower);
                lower_row = tap.second;
            }
            let to = self.row(channel, y, room).as_mut_ptr();
            // SAFETY: both rows and the level's row hold `room` elements.
            unsafe { l.mix_rows(upper.as_ptr(), lower.as_ptr(), tap.weight as i16, to, room) };
        }
    }
}
