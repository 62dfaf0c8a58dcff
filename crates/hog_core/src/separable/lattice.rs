//! The blocks that windows share: those whose places differ by whole strides of blocks.

use crate::error::Result;
use crate::exact::isa::{MulAdd, Work, run};
use crate::exact::{RowVotes, normalise};
use crate::geometry::Size;
use crate::memory;
use crate::params::HogSpec;
use crate::pyramid::{Grid, gcd};

use super::plan::{Across, CHUNK, Plan};

/// Windows that are scored together, so that no sum waits for the one before it.
const TOGETHER: usize = 4;

/// Sums that are taken across together, so many that the loop's own steps hardly count: all of 36, 48, 72 and 144.
const ABREAST: usize = 24;

/// The blocks of the windows that lie on one lattice, row by row, and the windows' scores.
///
/// Pixels are summed in strides: tiles as large as the stride of blocks.
pub(super) struct Lattice<'a> {
    plan: &'a Plan,
    spec: &'a HogSpec,
    /// Where it begins [px of the padded image].
    x: usize,
    y: usize,
    /// Columns of the padded image.
    width: usize,
    /// The first window (column, row) of the grid, the windows to the next one, and the grid's windows along x.
    first: Size,
    period: Size,
    in_row: usize,
    /// Windows, and blocks from one to the next.
    windows: Size,
    step: Size,
    /// Blocks along x and y.
    blocks: Size,
    /// Votes of the rows of pixels of the row of strides that is next, as far as they are there.
    shares: Vec<[f32; 2]>,
    bins: Vec<[u8; 2]>,
    /// Rows of strides that have been summed.
    summed: usize,
    room: Room,
}

/// Room for the sums.
struct Room {
    /// `[pixel column of a stride][bin][lane]`, each column padded to `len`.
    columns: Vec<f32>,
    len: usize,
    /// `[row of strides, in turns][block][cell along x][bin][lane]`.
    partial: Vec<f32>,
    /// The normalised blocks of a row, and zeros.
    blocks: Vec<f32>,
}

impl<'a> Lattice<'a> {
    /// The first window (column, row) of each of the lattices on which the windows of `grid` lie.
    pub(super) fn firsts(spec: &HogSpec, grid: &Grid) -> impl Iterator<Item = Size> + use<> {
        let period = period(spec, grid);
        let (columns, rows) = (period.width.min(grid.windows.width), period.height.min(grid.windows.height));
        (0..rows).flat_map(move |y| (0..columns).map(move |x| Size::new(x, y)))
    }

    pub(super) fn new(plan: &'a Plan, spec: &'a HogSpec, grid: &Grid, first: Size) -> Result<Self> {
        let period = period(spec, grid);
        let step = Size::new(
            grid.stride.width * period.width / spec.stride.width,
            grid.stride.height * period.height / spec.stride.height,
        );
        let windows = Size::new(
            (grid.windows.width - first.width).div_ceil(period.width),
            (grid.windows.height - first.height).div_ceil(period.height),
        );
        let blocks = Size::new(
            (windows.width - 1) * step.width + spec.blocks.width,
            (windows.height - 1) * step.height + spec.blocks.height,
        );
        let len = (spec.nbins * plan.lanes).next_multiple_of(ABREAST);
        let pixels = grid.padded.width * spec.stride.height;
        let partial = plan.spans.height.saturating_mul(blocks.width * plan.cells.width).saturating_mul(len);
        Ok(Self {
            plan,
            spec,
            x: first.width * grid.stride.width,
            y: first.height * grid.stride.height,
            width: grid.padded.width,
            first,
            period,
            in_row: grid.windows.width,
            windows,
            step,
            blocks,
            shares: memory::with_room(pixels)?,
            bins: memory::with_room(pixels)?,
            summed: 0,
            room: Room {
                columns: memory::filled(spec.stride.width.saturating_mul(len), 0.0)?,
                len,
                partial: memory::filled(partial, 0.0)?,
                blocks: memory::filled(blocks.width * spec.block_len + CHUNK, 0.0)?,
            },
        })
    }

    /// Takes the votes of row `y` of the padded image, the rows in their order.
    pub(super) fn add_row(&mut self, y: usize, votes: &RowVotes, scores: &mut [f64]) {
        if y < self.y || self.is_whole() {
            return;
        }
        self.shares.extend_from_slice(votes.shares);
        self.bins.extend_from_slice(votes.bins);
        if self.shares.len() == self.width * self.spec.stride.height {
            self.sum(scores);
        }
    }

    /// Ends the last row of blocks where the image ends within a stride.
    pub(super) fn end(&mut self, scores: &mut [f64]) {
        if !self.is_whole() {
            self.sum(scores);
        }
    }

    fn is_whole(&self) -> bool {
        self.summed == self.blocks.height + self.plan.spans.height - 1
    }

    /// Sums the row of strides whose votes are there, and scores the row of blocks that it ends.
    fn sum(&mut self, scores: &mut [f64]) {
        match self.plan.lanes {
            4 => run(Strides::<4>(self)),
            _ => run(Strides::<16>(self)),
        }
        self.shares.clear();
        self.bins.clear();
        self.summed += 1;
        let Some(row) = self.summed.checked_sub(self.plan.spans.height) else { return };
        match self.plan.cells.height {
            2 => run(Blocks::<2>(self, row)),
            4 => run(Blocks::<4>(self, row)),
            _ => run(Blocks::<1>(self, row)),
        }
        for (y, weights) in self.plan.weights.iter().enumerate() {
            let Some(above) = row.checked_sub(y) else { continue };
            let window = above / self.step.height;
            if above.is_multiple_of(self.step.height) && window < self.windows.height {
                let at = (self.first.height + window * self.period.height) * self.in_row + self.first.width;
                run(Scores { lattice: self, weights, scores: &mut scores[at..] });
            }
        }
    }
}

/// How many windows further the next one on the same lattice is.
fn period(spec: &HogSpec, grid: &Grid) -> Size {
    let along = |win_stride: usize, stride: usize| stride / gcd(win_stride, stride);
    Size::new(along(grid.stride.width, spec.stride.width), along(grid.stride.height, spec.stride.height))
}

/// Sums a row of strides: down into pixel columns, then across into `partial`.
struct Strides<'a, 'b, const LANES: usize>(&'a mut Lattice<'b>);

impl<const LANES: usize> Work for Strides<'_, '_, LANES> {
    type Output = ();

    #[inline(always)]
    fn run<M: MulAdd>(self) {
        let Lattice { plan, spec, x, width, blocks, shares, bins, summed, room, .. } = self.0;
        let Room { columns, len, partial, .. } = room;
        let place = blocks.width * plan.cells.width * *len;
        let partial = &mut partial[*summed % plan.spans.height * place..][..place];
        for stride in 0..blocks.width + plan.spans.width - 1 {
            let first = *x + stride * spec.stride.width;
            let count = spec.stride.width.min(width.saturating_sub(first));
            columns[..count * *len].fill(0.0);
            let rows = shares.chunks_exact(*width).zip(bins.chunks_exact(*width));
            for ((shares, bins), weights) in rows.zip(plan.down.as_chunks::<LANES>().0) {
                let votes = shares[first..][..count].iter().zip(&bins[first..][..count]);
                for ((shares, bins), column) in votes.zip(columns.chunks_exact_mut(*len)) {
                    let sums = column.as_chunks_mut::<LANES>().0;
                    for (&share, &bin) in shares.iter().zip(bins) {
                        let mut sum = sums[usize::from(bin)];
                        for lane in 0..LANES {
                            sum[lane] = M::mul_add(share, weights[lane], sum[lane]);
                        }
                        sums[usize::from(bin)] = sum;
                    }
                }
            }
            for Across { span, cell, first, weights } in &plan.across {
                let Some(block) = stride.checked_sub(*span).filter(|&block| block < blocks.width) else {
                    continue;
                };
                let to = &mut partial[(block * plan.cells.width + cell) * *len..][..*len];
                for (at, to) in to.as_chunks_mut::<ABREAST>().0.iter_mut().enumerate() {
                    let mut sum = if *span == 0 { [0.0; ABREAST] } else { *to };
                    for (weight, column) in weights.iter().zip(columns[first * *len..].chunks_exact(*len)) {
                        let column = &column.as_chunks::<ABREAST>().0[at];
                        for lane in 0..ABREAST {
                            sum[lane] = M::mul_add(*weight, column[lane], sum[lane]);
                        }
                    }
                    *to = sum;
                }
            }
        }
    }
}

/// Puts the blocks of a row together from the rows of strides that they span, `CELLS` cells at a time, and normalises
/// them.
struct Blocks<'a, 'b, const CELLS: usize>(&'a mut Lattice<'b>, usize);

impl<const CELLS: usize> Work for Blocks<'_, '_, CELLS> {
    type Output = ();

    #[inline(always)]
    fn run<M: MulAdd>(self) {
        let Self(Lattice { plan, spec, blocks, room, .. }, row) = self;
        let Room { len, partial, blocks: out, .. } = room;
        let (cells, nbins) = (plan.cells, spec.nbins);
        let place = blocks.width * cells.width * *len;
        for (block, out) in out.chunks_exact_mut(spec.block_len).take(blocks.width).enumerate() {
            let out_of_block = out.as_chunks_mut::<CELLS>().0;
            for span in 0..plan.spans.height {
                let from = (row + span) % plan.spans.height * place + block * cells.width * *len;
                let columns = partial[from..][..cells.width * *len].chunks_exact(*len);
                for (from, out) in columns.zip(out_of_block.chunks_exact_mut(nbins * cells.height / CELLS)) {
                    let sums = from.chunks_exact(plan.lanes).zip(out.chunks_exact_mut(cells.height / CELLS));
                    for (from, out) in sums {
                        for (from, out) in from[span * cells.height..].as_chunks::<CELLS>().0.iter().zip(out)
                        {
                            let mut sum = if span == 0 { [0.0; CELLS] } else { *out };
                            for cell in 0..CELLS {
                                sum[cell] += from[cell];
                            }
                            *out = sum;
                        }
                    }
                }
            }
            normalise(out, spec.l2_hys_threshold);
        }
    }
}

/// Adds what a row of blocks adds to the scores of a row of windows.
struct Scores<'a, 'b> {
    lattice: &'a Lattice<'b>,
    weights: &'a [f32],
    scores: &'a mut [f64],
}

impl Work for Scores<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<M: MulAdd>(self) {
        let Self { lattice: Lattice { spec, period, windows, step, room, .. }, weights, scores } = self;
        for first in (0..windows.width).step_by(TOGETHER) {
            let from = |window: usize| {
                // Places without a window repeat the last.
                let at = (first + window).min(windows.width - 1) * step.width * spec.block_len;
                room.blocks[at..][..weights.len()].as_chunks::<CHUNK>().0
            };
            let blocks = from(0).iter().zip(from(1)).zip(from(2)).zip(from(3));
            let mut sums = [[0.0f32; CHUNK]; TOGETHER];
            for (weights, (((a, b), c), d)) in weights.as_chunks::<CHUNK>().0.iter().zip(blocks) {
                for (sums, block) in sums.iter_mut().zip([a, b, c, d]) {
                    for lane in 0..CHUNK {
                        sums[lane] = M::mul_add(block[lane], weights[lane], sums[lane]);
                    }
                }
            }
            for (window, sums) in (first..windows.width).zip(&sums) {
                scores[window * period.width] += f64::from(sums.iter().sum::<f32>());
            }
        }
    }
}
