//! The SVM over a level's blocks: a quantised prefilter for every window, single precision for those that pass it.
//!
//! ```text
//! for each 8 rows of windows:                       Prefilter: lanes are neighbouring windows
//!     for each row of blocks that these lie on:
//!         for each block column, word of 4 bytes:   total[window row] += dot(bytes, weights)
//!     mask[window] = total ≥ least
//! for each window of the mask:                      ScoreWindows: lanes are neighbouring blocks of one window
//!     score = bias + Σ block × weight
//!     found.push(window, score)
//! ```
//!
//! ```text
//! blocks     [block row][element 0..36][lane]          lane x: block column x of the tile, the first one of window x
//! bytes      [block row][word 0..9][lane]              the same, 4 elements in a word, 255 for 1
//! weights    [block row][element][block column]        of the window, columns padded with 0 to a multiple of 8
//! words      [block column][word][8 + block row + 8]   the weights as bytes; 8 rows of 0 above and below
//! multiples  [block column][8 + block row + 8]         what a block's sum of bytes is multiplied by
//! masks      [window row][vector of windows]           a bit for each lane
//! ```
//!
//! `blocks` and `bytes` come in two parts: the rows of a band, and those of the band below.
//!
//! Tricks, each with what it gains (figures: docs/simd.md):
//!
//! 1. Bytes times signed bytes, four at a time: a window costs a quarter of its numbers. The bound on what that loses
//!    (`plan.rs`) lets no hit be missed; a few windows in a hundred go on.
//! 2. A row of blocks is loaded once for the eight rows of windows that it is part of; rows of zeros around the weights make
//!    the first and last of them the same code as the others (seven bodies instead of 36).
//! 3. Windows that pass lie alone: each is summed with its own blocks as lanes, not with its neighbours.

#![allow(clippy::needless_range_loop, reason = "indices that are known when compiling name registers")]

use crate::error::Result;
use crate::geometry::Size;
use crate::interrupt::Interrupt;
use crate::memory;

use super::lane::{Kernel, Lane};
use super::layout::{ACROSS, BLOCK, ROWS, WORDS};
use super::plan::Plan;

/// From which scores on windows are found.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Thresholds {
    /// Every window that scores at least this is found.
    pub hit: f64,
    /// Windows that score at least this guide the search of other levels; the prefilter may, very rarely, miss such a window.
    pub guide: f64,
}

/// The part of the prefilter's bound beyond which its errors are hardly ever seen: blocks err on their own, so that the error of
/// `blocks` grows with their root, the bound with their number. Measured with the people model's 105 in 9,595 windows
/// of photographs: the largest was .36 of this and the standard deviation .08, with sums of 16 bits and of 32.
fn likely(blocks: Size) -> f64 {
    1.0 / (blocks.area() as f64).sqrt()
}

/// The windows of a band and the blocks they are made of.
pub(super) struct WindowGrid<'a> {
    pub plan: &'a Plan,
    /// Of the first rows of blocks, and of those after them.
    pub blocks: [*const f32; 2],
    pub bytes: [*const u32; 2],
    /// How many rows the first ones are.
    pub rows: usize,
    /// Lanes of a row of blocks.
    pub lanes: usize,
    /// Windows along x and y.
    pub width: usize,
    pub height: usize,
}

impl WindowGrid<'_> {
    /// Row `y` of one of `blocks` and `bytes`, whose rows have `elements` of each lane.
    ///
    /// # Safety
    /// There is such a row.
    #[inline(always)]
    unsafe fn row<T>(&self, parts: [*const T; 2], y: usize, elements: usize) -> *const T {
        debug_assert!(y < 2 * self.rows, "row {y} of twice {}", self.rows);
        let (part, y) = if y < self.rows { (parts[0], y) } else { (parts[1], y - self.rows) };
        // SAFETY: the caller's promise.
        unsafe { part.add(y * elements * self.lanes) }
    }
}

/// Adds (x, y, score) to `found` for every window that may be a hit and nearly every one that guides, row by row, and for
/// some others.
///
/// # Safety
///
/// - `blocks` and `bytes` hold the blocks of all windows: `rows` rows of `lanes` lanes in the first part, and in the second as
///   many as the last windows reach beyond these.
/// - `lanes` is at least `width` rounded up to 32, plus the blocks of a window along x, plus 16.
pub(super) unsafe fn score<L: Lane>(
    l: L,
    windows: &WindowGrid,
    thresholds: Thresholds,
    interrupt: &Interrupt,
    masks: &mut Vec<u32>,
    found: &mut Vec<(usize, usize, f64)>,
) -> Result<()> {
    let plan = windows.plan;
    let groups = windows.width.div_ceil(L::LANES);
    debug_assert!(windows.lanes >= windows.width.next_multiple_of(32) + plan.blocks.width + 16);
    masks.clear();
    memory::resize(masks, groups * windows.height, u32::MAX)?;
    let Thresholds { hit, guide } = thresholds;
    let bound = plan.prefilter.bound;
    let least = (hit - plan.score_error_bound - bound).min(guide - likely(plan.blocks) * bound);
    let least = (least - plan.bias) / plan.prefilter.unit;
    let least = least.floor().clamp(f64::from(i32::MIN), f64::from(i32::MAX)) as i32;
    if L::PREFILTER_VECTORS > 0 {
        for top in (0..windows.height).step_by(ROWS) {
            interrupt.check()?;
            let rows = (windows.height - top).min(ROWS);
            // SAFETY: the caller's promise; `masks` was made for all windows.
            l.compiled(unsafe { Prefilter::new(l, windows, least, top..top + rows, masks) });
        }
    }
    for (y, masks) in masks.chunks_exact(groups).enumerate() {
        interrupt.check()?;
        for (group, &mask) in masks.iter().enumerate() {
            let x = group * L::LANES;
            let inside = (windows.width - x).min(L::LANES);
            let mask = mask & (((1u64 << inside) - 1) as u32);
            if mask != 0 {
                memory::reserve_some(found, mask.count_ones() as usize)?;
                // SAFETY: the caller's promise; the mask names windows within the width.
                l.narrow().compiled(unsafe { ScoreWindows::new(windows, x, y, mask, found) });
            }
        }
    }
    Ok(())
}

/// Prefilters `rows` rows of windows.
struct Prefilter<'a> {
    windows: &'a WindowGrid<'a>,
    least: i32,
    top: usize,
    rows: usize,
    masks: &'a mut [u32],
}

impl<'a> Prefilter<'a> {
    /// # Safety
    ///
    /// - `windows` are as [`score`] wants them, and `rows`, at most [`ROWS`] of them, are among their rows.
    /// - `masks` has a word for each `LANES` windows of each row.
    unsafe fn new<L: Lane>(
        _: L,
        windows: &'a WindowGrid<'a>,
        least: i32,
        rows: std::ops::Range<usize>,
        masks: &'a mut [u32],
    ) -> Self {
        debug_assert!(rows.len() <= ROWS && rows.end <= windows.height);
        debug_assert!(masks.len() >= windows.width.div_ceil(L::LANES) * windows.height);
        Self { windows, least, top: rows.start, rows: rows.len(), masks }
    }
}

impl Kernel for Prefilter<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lane>(self, l: L) {
        let Self { windows, least, top, rows, masks } = self;
        let groups = windows.width.div_ceil(L::LANES);
        let mut group = 0;
        while group < groups {
            // SAFETY: promised to `Prefilter::new`.
            unsafe {
                if L::PREFILTER_VECTORS == 2 && group + 1 < groups {
                    prefilter::<L, 2>(l, windows, least, top, rows, group, groups, masks);
                    group += 2;
                } else {
                    prefilter::<L, 1>(l, windows, least, top, rows, group, groups, masks);
                    group += 1;
                }
            }
        }
    }
}

/// Scores those of the windows `x..x + 32` of row `y` that `mask` names.
struct ScoreWindows<'a> {
    windows: &'a WindowGrid<'a>,
    x: usize,
    y: usize,
    mask: u32,
    found: &'a mut Vec<(usize, usize, f64)>,
}

impl<'a> ScoreWindows<'a> {
    /// # Safety
    ///
    /// - `windows` are as [`score`] wants them, and `y` is one of their rows.
    /// - `mask` names windows within their width alone.
    unsafe fn new(
        windows: &'a WindowGrid<'a>,
        x: usize,
        y: usize,
        mask: u32,
        found: &'a mut Vec<(usize, usize, f64)>,
    ) -> Self {
        debug_assert!(y < windows.height && x + 32 - (mask.leading_zeros() as usize) <= windows.width);
        Self { windows, x, y, mask, found }
    }
}

impl Kernel for ScoreWindows<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lane>(self, l: L) {
        let mut mask = self.mask;
        while mask != 0 {
            let x = self.x + mask.trailing_zeros() as usize;
            mask &= mask - 1;
            // SAFETY: promised to `ScoreWindows::new`.
            self.found.push((x, self.y, unsafe { score_window(l, self.windows, x, self.y) }));
        }
    }
}

/// The score of one window in single precision. Lanes are neighbouring blocks of the window.
#[inline(always)]
unsafe fn score_window<L: Lane>(l: L, windows: &WindowGrid, x: usize, y: usize) -> f64 {
    let plan = windows.plan;
    let padded = plan.blocks.width.next_multiple_of(ACROSS);
    let mut score = plan.bias;
    for (block_y, weights) in plan.weights.chunks_exact(BLOCK * padded).enumerate() {
        debug_assert!(weights.len() == BLOCK * padded && y + block_y < 2 * windows.rows);
        // SAFETY: promised by the caller of `score`; lanes beyond the window's have the weight 0.
        let blocks = unsafe { windows.row(windows.blocks, y + block_y, BLOCK).add(x) };
        for part in (0..plan.blocks.width).step_by(L::LANES) {
            let mut sums = [l.splat(0.0); 4];
            for (i, weights) in weights.chunks_exact(padded).enumerate() {
                // SAFETY: as above; `padded` is a multiple of LANES.
                let (value, weight) = unsafe {
                    (l.load(blocks.add(i * windows.lanes + part)), l.load(weights.as_ptr().add(part)))
                };
                sums[i % 4] = l.mul_add(value, weight, sums[i % 4]);
            }
            let total = l.add(l.add(sums[0], sums[1]), l.add(sums[2], sums[3]));
            let mut of_blocks = [0.0f32; ACROSS];
            // SAFETY: LANES is at most ACROSS.
            unsafe { l.store(of_blocks.as_mut_ptr(), total) };
            for sum in &of_blocks[..L::LANES] {
                score += f64::from(*sum);
            }
        }
    }
    score
}

/// Prefilters `rows` rows of `V` vectors of windows.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a tile is named by all of them")]
unsafe fn prefilter<L: Lane, const V: usize>(
    l: L,
    windows: &WindowGrid,
    least: i32,
    top: usize,
    rows: usize,
    group: usize,
    groups: usize,
    masks: &mut [u32],
) {
    let mut totals = [[l.no_sum(); V]; ROWS];
    let height = windows.plan.blocks.height;
    for y in 0..rows + height - 1 {
        // Row y of blocks takes part in window rows from..to, as their block row y - window row. Pairs of rows are as
        // cheap, for most of the time all eight are needed; other rows than those meet weights of 0 or are not asked for.
        let from = (y + 1).saturating_sub(height) & !1;
        let to = if from > 0 { ROWS } else { (y + 1).min(rows).next_multiple_of(2) };
        // SAFETY: promised by the caller of `score`.
        let bytes = unsafe { windows.row(windows.bytes, top + y, WORDS).add(group * L::LANES) };
        macro_rules! step {
            ($($from:literal $to:literal),*) => {
                match (from, to) {
                    // SAFETY: as above.
                    $(($from, $to) => unsafe { block_row::<L, V, $from, $to>(l, windows, bytes, y, &mut totals) },)*
                    _ => {}
                }
            };
        }
        step!(
        0 2, 0 4, 0 6, 0 8, 2 8, 4 8, 6 8
                );
    }
    for (row, totals) in totals[..rows].iter().enumerate() {
        for (v, &total) in totals.iter().enumerate() {
            masks[(top + row) * groups + group + v] = l.at_least(total, least);
        }
    }
}

/// Adds one row of blocks to the totals of window rows `FROM..TO`.
#[inline(always)]
unsafe fn block_row<L: Lane, const V: usize, const FROM: usize, const TO: usize>(
    l: L,
    windows: &WindowGrid,
    bytes: *const u32,
    y: usize,
    totals: &mut [[L::Sum; V]; ROWS],
) {
    let size = windows.plan.blocks;
    let prefilter = &windows.plan.prefilter;
    let padded = ROWS + size.height + ROWS;
    let mut total = *totals;
    for block_x in 0..size.width {
        let mut sum = total;
        for row in FROM..TO {
            for v in 0..V {
                sum[row][v] = l.begin_block(total[row][v]);
            }
        }
        for word in 0..WORDS {
            let mut values = [l.splat_word(0); V];
            for (v, value) in values.iter_mut().enumerate() {
                // SAFETY: promised by the caller of `score`.
                *value = unsafe { l.load_words(bytes.add(word * windows.lanes + block_x + v * L::LANES)) };
            }
            let weights = &prefilter.words[(block_x * WORDS + word) * padded..][..padded];
            for row in FROM..TO {
                debug_assert!(ROWS + y - row < weights.len());
                // SAFETY: row < ROWS, and y < ROWS + size.height - 1, as the caller has no more rows of blocks. A check
                // for each of these would cost as much as the sum.
                let weight = l.splat_word(unsafe { *weights.get_unchecked(ROWS + y - row) });
                for v in 0..V {
                    sum[row][v] = l.dot_bytes(sum[row][v], values[v], weight);
                }
            }
        }
        for row in FROM..TO {
            let multiple = prefilter.multiples[block_x * padded + ROWS + y - row];
            for v in 0..V {
                total[row][v] = l.end_block(total[row][v], sum[row][v], multiple);
            }
        }
    }
    *totals = total;
}
