//! One strip of a level, from pixels to normalised blocks. Lanes are neighbouring cells.
//!
//! ```text
//! for each row of cells:
//!     for each of its 8 rows of pixels:     fill: load, gamma → pixels
//!     for each of its 8 columns of pixels:
//!         for each row:                     strongest channel's dx, dy → votes
//!         for each bin:                     Σ over the rows of weight down[y] × vote → carry, sums
//!     finish: Σ over the columns of across[x] × sums → the 4 cells of each block → L2-Hys → blocks, bytes
//! ```
//!
//! ```text
//! pixels     [row -1..=8][channel][column -1..=8]                                 after gamma (colour: 3 rows, in turns)
//! gradients  [column][row][dx, dy]                                                (colour alone)
//! votes      [row]                                                                one column's, see `bins`
//! carry      [column][bin][2]                                                     the two sums that `bins` hands down
//! sums       [upper cell, lower cell][bin][column]                                of the blocks that end here
//! block      [left cell, right cell][upper cell, lower cell][bin]                 its 36 elements
//! ```
//!
//! Each of these is a vector: lane x belongs to cell x of the strip. In memory, of the whole tile:
//!
//! ```text
//! blocks     [block row][element][lane]                                           lane x: the block whose left cell is x
//! bytes      [block row][element / 4][lane]                                       4 elements in a word
//! edge       [block row][element], one number each                                what a strip adds to the block left of it
//! ```
//!
//! Tricks, each with what it gains (figures: docs/simd.md):
//!
//! 1. Eight pixels lie between the same pixel of neighbouring cells: a vector holds pixel column `phase` (0..8) of `LANES`
//!    cells. Every stage works lane by lane, without a gather; only where a block joins two cells a lane looks at the next.
//! 2. A weight is a Gaussian times a bilinear share, both products of a function of x and one of y. Summing down the rows
//!    first leaves an eighth of the work for the sums across.
//! 3. Strips are made from right to left: `edge` takes what a strip's first cells add to the block left of them, so that no
//!    strip is visited twice.
//! 4. In colour three rows of square roots are kept in turn, and of each gradient only dx and dy: all channels of ten rows
//!    would not leave room for the rest in the first-level cache.

#![allow(clippy::needless_range_loop, reason = "indices that are known when compiling name registers")]

use std::ops::Range;

use super::bins::{spread_all, vote};
use super::lane::{Kernel, Lane};
use super::layout::{BINS, BLOCK, CARRY, CELL, Gamma};
use super::plan::Geometry;

/// What the strips of a level read and write.
pub(super) struct Job<'a> {
    pub geometry: &'a Geometry,
    /// The pixel above the first cell's upper left one, of each channel.
    pub origin: [*const u8; 3],
    /// Bytes from one row of pixels to the next.
    pub stride: usize,
    /// Rows of cells to be added to the blocks.
    pub cells: Range<usize>,
    /// The row of blocks that `blocks` begins with.
    pub top: usize,
    /// Whether the row of cells above them has been added.
    pub carried: bool,
    /// Sums of the cells above, for the blocks that begin there: [`CARRY`] numbers for each lane.
    pub carry: *mut f32,
    /// Room for one strip: [`ROOM`] numbers for each of its lanes.
    pub room: *mut f32,
    /// Normalised blocks: `[block row][element][lane]`, and the same as bytes (1 stands for 255).
    pub blocks: *mut f32,
    pub bytes: *mut u32,
    /// Lanes of a row of blocks.
    pub lanes: usize,
    /// Of crops side by side: 1 for the first (last) cell of every crop, else 0.
    pub ends: Option<[&'a [f32]; 2]>,
    /// For each row of blocks, the sums that the first cells of the strip to the right add to the blocks left of them.
    pub edge: &'a mut [[f32; BLOCK]],
}

/// What a strip keeps of the row of cells it is at.
struct Room<L: Lane, const CHANNELS: usize> {
    rows: [[[L::F; CELL + 2]; CHANNELS]; CELL + 2],
    /// In colour.
    gradients: [[[L::F; 2]; CELL]; CELL],
    sums: [[L::F; CELL]; 2 * BINS],
}

/// Words per lane that a strip needs as room.
pub(super) const ROOM: usize = (CELL + 2) * 3 * (CELL + 2) + 2 * CELL * CELL + 2 * BINS * CELL;

/// Computes the blocks of the strip of cells that begins at lane `first`.
///
/// # Safety
/// As [`Strip::new`], with 1 or 3 channels.
pub(super) unsafe fn strip<L: Lane>(l: L, job: &mut Job, first: usize, channels: usize) {
    // SAFETY: the caller's promise.
    unsafe {
        match (channels, job.ends.is_some()) {
            (1, false) => l.compiled(Strip::<1, false>::new(l, job, first)),
            (_, false) => l.compiled(Strip::<3, false>::new(l, job, first)),
            (1, true) => l.compiled(Strip::<1, true>::new(l, job, first)),
            (_, true) => l.compiled(Strip::<3, true>::new(l, job, first)),
        }
    }
}

/// The work of [`strip`].
struct Strip<'a, 'b, const CHANNELS: usize, const CROPS: bool> {
    job: &'a mut Job<'b>,
    first: usize,
}

impl<'a, 'b, const CHANNELS: usize, const CROPS: bool> Strip<'a, 'b, CHANNELS, CROPS> {
    /// # Safety
    ///
    /// - `job.origin` points, for each channel, at rows `stride` bytes apart, of which those of `cells` and one above and
    ///   below are readable from 8 bytes before the strip's cells to 8 behind them.
    /// - `job.carry` has [`CARRY`] numbers for each lane up to the strip's last, `job.room` [`ROOM`] for each of `LANES`;
    ///   both are aligned to the lane's vector.
    /// - `job.blocks` and `job.bytes` have rows of `lanes` lanes from block row `top` to that above the last row of cells,
    ///   the strip's lanes among them, and are written by nobody else.
    /// - Where there are `ends`, they have the strip's lanes.
    unsafe fn new<L: Lane>(_: L, job: &'a mut Job<'b>, first: usize) -> Self {
        debug_assert!(first + L::LANES <= job.lanes, "{first} + {} of {} lanes", L::LANES, job.lanes);
        debug_assert!(job.room.cast::<Room<L, CHANNELS>>().is_aligned());
        debug_assert!(job.carry.wrapping_add(CARRY * first).cast::<L::F>().is_aligned());
        debug_assert!(size_of::<Room<L, CHANNELS>>() <= 4 * ROOM * L::LANES);
        debug_assert!(job.cells.end <= job.top + job.edge.len() + 1, "{:?} of {}", job.cells, job.edge.len());
        debug_assert!(CROPS == job.ends.is_some());
        debug_assert!(job.ends.is_none_or(|ends| ends.iter().all(|end| first + L::LANES <= end.len())));
        Self { job, first }
    }
}

impl<const CHANNELS: usize, const CROPS: bool> Kernel for Strip<'_, '_, CHANNELS, CROPS> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lane>(self, l: L) {
        // SAFETY: promised to `Strip::new`.
        unsafe { blocks_of_strip::<L, CHANNELS, CROPS>(l, self.job, self.first) }
    }
}

#[inline(always)]
unsafe fn blocks_of_strip<L: Lane, const CHANNELS: usize, const CROPS: bool>(
    l: L,
    job: &mut Job,
    first: usize,
) {
    let zero = l.splat(0.0);
    // Rows -1..=8 of a cell; the last two are the first two of the cell below. In colour only three are kept, in turn.
    // In scratch memory, as zeroing them would take a fiftieth of the time.
    // SAFETY: aligned room for one strip is the caller's promise; any bits are numbers, and all are written before they
    // are read.
    let Room { rows, gradients, sums } = unsafe { &mut *job.room.cast::<Room<L, CHANNELS>>() };
    // SAFETY: aligned room for the strip's lanes is the caller's promise; any bits are numbers.
    let carry = unsafe { &mut *job.carry.add(CARRY * first).cast::<[[[L::F; 2]; BINS]; CELL]>() };
    if !job.carried {
        *carry = [[[zero; 2]; BINS]; CELL];
    }
    let mut votes = [vote(l, [zero; 2]); CELL];
    // SAFETY: promised by the caller.
    unsafe {
        fill::<L, CHANNELS, CROPS>(l, job, first, 0, &mut rows[0]);
        fill::<L, CHANNELS, CROPS>(l, job, first, 1, &mut rows[1]);
    }
    for (i, cell_y) in job.cells.clone().enumerate() {
        for y in 0..CELL {
            let place = |y: usize| if CHANNELS > 1 { (CELL * i + y) % 3 } else { y };
            // SAFETY: promised by the caller.
            unsafe { fill::<L, CHANNELS, CROPS>(l, job, first, CELL * i + y + 2, &mut rows[place(y + 2)]) };
            if CHANNELS > 1 {
                let around = [&rows[place(y)], &rows[place(y + 1)], &rows[place(y + 2)]];
                for phase in 0..CELL {
                    gradients[phase][y] = strongest(l, around, phase);
                }
            }
        }
        for phase in 0..CELL {
            for (y, votes) in votes.iter_mut().enumerate() {
                let gradient = if CHANNELS > 1 {
                    gradients[phase][y]
                } else {
                    strongest(l, [&rows[y], &rows[y + 1], &rows[y + 2]], phase)
                };
                *votes = vote(l, gradient);
            }
            spread_all(l, &job.geometry.down, &votes, &mut carry[phase], sums, phase);
        }
        if CHANNELS == 1 {
            rows.copy_within(CELL.., 0);
        }
        if job.carried || i > 0 {
            // SAFETY: the strip's lanes of this row of blocks are the caller's promise.
            unsafe { finish(l, job, sums, cell_y - 1 - job.top, first) };
        }
    }
}

/// The pixels of row `y` of the band, of every channel.
#[inline(always)]
unsafe fn fill<L: Lane, const CHANNELS: usize, const CROPS: bool>(
    l: L,
    job: &Job,
    first: usize,
    y: usize,
    to: &mut [[L::F; CELL + 2]; CHANNELS],
) {
    for (channel, to) in to.iter_mut().enumerate() {
        // SAFETY: promised by the caller of `strip`.
        unsafe { row(l, job.geometry, job.origin[channel].add(y * job.stride + CELL * first), to) };
        if CROPS && let Some(ends) = job.ends {
            // A crop is mirrored at its edges.
            // SAFETY: promised by the caller of `strip`.
            let end = ends.map(|end| unsafe { l.less(l.splat(0.0), l.load(end.as_ptr().add(first))) });
            to[0] = l.select(end[0], to[2], to[0]);
            to[CELL + 1] = l.select(end[1], to[CELL - 1], to[CELL + 1]);
        }
    }
}

/// One row of pixels as ten vectors: columns -1..=8 of every cell, after gamma.
#[inline(always)]
unsafe fn row<L: Lane>(l: L, geometry: &Geometry, from: *const u8, to: &mut [L::F; CELL + 2]) {
    // SAFETY: the strip and 8 bytes on both sides are readable.
    let (low, high, before, after) =
        unsafe { (l.low_words(from), l.high_words(from), *from.sub(1), *from.add(CELL * L::LANES)) };
    let mut columns = [
        l.byte::<0>(low),
        l.byte::<1>(low),
        l.byte::<2>(low),
        l.byte::<3>(low),
        l.byte::<0>(high),
        l.byte::<1>(high),
        l.byte::<2>(high),
        l.byte::<3>(high),
    ];
    match geometry.gamma {
        Gamma::Off => {}
        Gamma::Estimated => {
            for value in &mut columns {
                *value = l.sqrt_of_byte(*value);
            }
        }
        Gamma::Exact => {
            for value in &mut columns {
                *value = l.sqrt(*value);
            }
        }
    }
    to[1..=CELL].copy_from_slice(&columns);
    // The neighbours are the same columns one cell on; only the outermost pixels are new.
    to[0] = l.shift_up(columns[7], geometry.table[usize::from(before)]);
    to[CELL + 1] = l.shift_in(columns[0], geometry.table[usize::from(after)]);
}

/// The gradient (dx, dy) of pixel column `phase` of every cell in its strongest channel, from the rows above, of and
/// below the pixel.
#[inline(always)]
fn strongest<L: Lane, const CHANNELS: usize>(
    l: L,
    around: [&[[L::F; CELL + 2]; CHANNELS]; 3],
    phase: usize,
) -> [L::F; 2] {
    let mut best = derive(l, around, 0, phase);
    if CHANNELS > 1 {
        let mut most = square(l, best);
        for channel in 1..CHANNELS {
            let other = derive(l, around, channel, phase);
            let squared = square(l, other);
            let stronger = l.less(most, squared);
            best = [l.select(stronger, other[0], best[0]), l.select(stronger, other[1], best[1])];
            most = l.max(most, squared);
        }
    }
    best
}

/// dx and dy in one channel.
#[inline(always)]
fn derive<L: Lane, const CHANNELS: usize>(
    l: L,
    [above, own, below]: [&[[L::F; CELL + 2]; CHANNELS]; 3],
    channel: usize,
    phase: usize,
) -> [L::F; 2] {
    let dx = l.sub(own[channel][phase + 2], own[channel][phase]);
    let dy = l.sub(below[channel][phase + 1], above[channel][phase + 1]);
    [dx, dy]
}

/// dx² + dy², never fused: a fused step could choose another channel than OpenCV.
#[inline(always)]
fn square<L: Lane>(l: L, [dx, dy]: [L::F; 2]) -> L::F {
    l.add(l.mul(dx, dx), l.mul(dy, dy))
}

/// Sums across the columns of each block's two cells, normalises (L2-Hys) and stores the blocks of one row.
#[inline(always)]
pub(super) unsafe fn finish<L: Lane>(
    l: L,
    job: &mut Job,
    sums: &[[L::F; CELL]; 2 * BINS],
    block_y: usize,
    first: usize,
) {
    let zero = l.splat(0.0);
    let mut block = [zero; BLOCK];
    let mut squares = [zero; 4];
    let across = &job.geometry.across;
    let edge = &mut job.edge[block_y];
    for (i, sums) in sums.iter().enumerate() {
        // Left cell from this and the next column of cells, right cell likewise.
        let [mut left, mut left_next, mut right, mut right_next] = [zero; 4];
        for (x, &sum) in sums.iter().enumerate() {
            left = l.mul_add(sum, l.splat(across[x][0]), left);
            right_next = l.mul_add(sum, l.splat(across[x][2]), right_next);
            if x < CELL / 2 {
                left_next = l.mul_add(sum, l.splat(across[x][1]), left_next);
            } else {
                right = l.mul_add(sum, l.splat(across[x][1]), right);
            }
        }
        for (k, (own, next)) in [(left, left_next), (right, right_next)].into_iter().enumerate() {
            let at = k * 2 * BINS + i;
            let value = l.add(own, l.shift_in(next, edge[at]));
            edge[at] = l.first(next);
            squares[2 * k + i % 2] = l.mul_add(value, value, squares[2 * k + i % 2]);
            block[at] = value;
        }
    }
    let total = l.add(l.add(squares[0], squares[1]), l.add(squares[2], squares[3]));
    let scale = l.div(l.splat(1.0), l.add(l.sqrt(total), l.splat(BLOCK as f32 * 0.1)));
    let limit = l.splat(job.geometry.l2_hys_threshold);
    let mut squares = [zero; 4];
    for (i, value) in block.iter_mut().enumerate() {
        *value = l.min(l.mul(*value, scale), limit);
        squares[i % 4] = l.mul_add(*value, *value, squares[i % 4]);
    }
    let total = l.add(l.add(squares[0], squares[1]), l.add(squares[2], squares[3]));
    let scale = l.div(l.splat(1.0), l.add(l.sqrt(total), l.splat(1e-3)));
    let byte_scale = l.mul(scale, l.splat(255.0));
    for (group, values) in block.as_chunks::<4>().0.iter().enumerate() {
        for (i, &value) in values.iter().enumerate() {
            let at = (block_y * BLOCK + 4 * group + i) * job.lanes + first;
            // SAFETY: the strip's lanes of this row of blocks.
            unsafe { l.store(job.blocks.add(at), l.mul(value, scale)) };
        }
        let at = (block_y * (BLOCK / 4) + group) * job.lanes + first;
        let bytes = [
            l.mul(values[0], byte_scale),
            l.mul(values[1], byte_scale),
            l.mul(values[2], byte_scale),
            l.mul(values[3], byte_scale),
        ];
        // SAFETY: as above.
        unsafe { l.store_bytes(job.bytes.add(at), bytes) };
    }
}
