//! The rows that [`resize_row`](super::Lane::resize_row) reads and writes, and which pixels it mixes.

use std::ops::Range;

use crate::error::Result;
use crate::fast::layout::STEP;
use crate::memory;
use crate::pyramid::{Tap, taps};

/// How a row is shrunk: for every output pixel two neighbours and their weights, in groups that one shuffle fills.
///
/// Where the pixels of a group lie further apart than a shuffle reaches, the group is a sum of several parts, each of
/// which gives the output pixels of the others the weight 0.
#[derive(Debug, Default)]
pub(in crate::fast) struct Columns {
    /// Parts of a group.
    pub(super) parts: usize,
    /// First source pixel of each part.
    pub(super) base: Vec<u32>,
    /// Two offsets per output pixel, from its part's base.
    pub(super) index: Vec<u8>,
    /// Two weights per output pixel, together 256.
    pub(super) weight: Vec<u8>,
    /// Most source pixels that a part spans.
    pub(super) span: usize,
    taps: Vec<Tap>,
}

impl Columns {
    /// Prepares to shrink rows of `from` pixels to `to`, of which the pixels `wanted` are, in groups of `group` whose
    /// parts span at most `reach`.
    pub(in crate::fast) fn fill(
        &mut self,
        (from, to): (usize, usize),
        wanted: Range<usize>,
        group: usize,
        reach: usize,
    ) -> Result<()> {
        let count = wanted.len();
        self.taps.clear();
        memory::extend(&mut self.taps, taps(from, to, wanted))?;
        let spanned = |taps: &[Tap]| match taps {
            [first, .., last] => last.second + 1 - first.first,
            _ => 2,
        };
        self.parts = 1;
        loop {
            self.span = self.taps.chunks(group / self.parts).map(spanned).max().unwrap_or(0);
            if self.span <= reach {
                break;
            }
            self.parts *= 2;
        }
        let all = count.div_ceil(STEP) * (STEP / group) * self.parts;
        for list in [&mut self.index, &mut self.weight] {
            list.clear();
            memory::resize(list, 2 * group * all, 0)?;
        }
        self.base.clear();
        memory::resize(&mut self.base, all, 0)?;
        let size = group / self.parts;
        for (part, taps) in self.taps.chunks(size).enumerate() {
            let base = taps.first().map_or(0, |tap| tap.first);
            self.base[part] = base as u32;
            for (i, tap) in taps.iter().enumerate() {
                // A weight of 256 does not fit a byte: the one pixel then counts 255 times and once more.
                let (first, second, weight) = match tap.weight {
                    0 => (tap.first, tap.first, 1),
                    256 => (tap.second, tap.second, 1),
                    weight => (tap.first, tap.second, weight),
                };
                let at = 2 * (part * group + part % self.parts * size + i);
                self.index[at..at + 2].copy_from_slice(&[(first - base) as u8, (second - base) as u8]);
                self.weight[at..at + 2].copy_from_slice(&[(256 - weight) as u8, weight as u8]);
            }
        }
        Ok(())
    }

    /// How much this holds [bytes].
    pub(in crate::fast) fn bytes(&self) -> usize {
        self.base.capacity() * size_of::<u32>()
            + self.index.capacity()
            + self.weight.capacity()
            + self.taps.capacity() * size_of::<Tap>()
    }
}

/// Where a channel's row of a level comes from, and where it goes.
#[derive(Clone, Copy)]
pub(in crate::fast) struct RowPointers {
    pub upper: *const u8,
    pub lower: *const u8,
    pub to: *mut u8,
}
