//! A tile of a level, from planes to hits: bands of rows, strips, scores.
//!
//! ```text
//! begin:       the columns of the tile
//! make:        for some rows of cells at a time: Band::fill → strips from right to left → the band's blocks
//! score_band:  the windows that begin in the band, from its blocks and those of the band below → found
//! ```
//!
//! Blocks lie as `[block row][element 0..36][lane]`, a lane for each column of cells of the tile, and some more, since whole
//! vectors of windows are scored. 1. Two bands of blocks are kept, not a level: a thread needs less than 4 MB. 2. `carry`
//! goes from band to band, so that no row of cells is made twice but at a cut between threads.

use std::ops::Range;

use crate::error::Result;
use crate::geometry::Size;
use crate::interrupt::Interrupt;
use crate::memory::{self, Workspace};
use crate::pyramid::Grid;

use super::lane::Lane;
use super::layout::{BAND, BLOCK, CARRY, CELL, WORDS};
use super::plan::Plan;
use super::rows::{Band, Planes};
use super::score::{Thresholds, WindowGrid, score};
use super::strip::{Job, ROOM, strip};

/// Rows of blocks that are made, scored and handed on together, unless a window needs more.
const ROWS: usize = 16;

/// Most windows along x of a tile: its blocks then stay in the second-level cache, and a thread's memory below 4 MB. What
/// it costs are the cells of one window that neighbouring tiles both make, 3 %.
pub(super) const COLUMNS_MAX: usize = 249;

/// A window of a level: padded x, padded y, score.
pub(crate) type Found = (usize, usize, f64);

/// A part of a level's windows, on one lattice of blocks.
#[derive(Debug, Clone)]
pub(super) struct Tile {
    /// Which level.
    pub level: usize,
    /// Where the lattice begins [padded px]: 0 or 4 along x and y.
    pub origin: (usize, usize),
    /// Windows of the lattice along x and y, every 8 pixels.
    pub columns: Range<usize>,
    pub rows: Range<usize>,
}

/// What all tiles of one search have in common with one of its levels.
#[derive(Clone, Copy)]
pub(super) struct Context<'a> {
    pub plan: &'a Plan,
    pub source: &'a Planes,
    pub size: Size,
    pub grid: &'a Grid,
    pub thresholds: Thresholds,
}

impl Tile {
    /// Rows of blocks.
    fn block_rows(&self, plan: &Plan) -> usize {
        self.rows.len() + plan.blocks.height - 1
    }

    /// Rows of blocks of a band: a window of the last one of a band ends in the next.
    fn band_rows(plan: &Plan) -> usize {
        ROWS.max(plan.blocks.height - 1)
    }

    /// In how many bands it is made.
    pub fn bands(&self, plan: &Plan) -> usize {
        self.block_rows(plan).div_ceil(Self::band_rows(plan))
    }

    /// Columns of cells.
    fn cells(&self, plan: &Plan) -> usize {
        self.columns.len() + plan.blocks.width
    }

    /// What a band costs, in cells.
    pub fn band_cost(&self, plan: &Plan) -> usize {
        self.cells(plan) * Self::band_rows(plan)
    }

    /// Lanes of a row of blocks, some more than there are: whole vectors of windows are scored.
    fn lanes(&self, plan: &Plan) -> usize {
        self.cells(plan).next_multiple_of(32) + 32 + plan.blocks.width.next_multiple_of(16)
    }
}

/// The normalised blocks of a band.
#[derive(Debug, Default)]
pub(super) struct Blocks {
    /// `[block row][element][lane]`.
    numbers: Lines,
    /// The same as bytes (1 stands for 255).
    bytes: Lines,
}

/// Scratch memory of one thread, used again from tile to tile and call to call.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    band: Band,
    carry: Lines,
    room: Lines,
    edge: Vec<[f32; BLOCK]>,
    masks: Vec<u32>,
    /// Windows found.
    pub found: Vec<Found>,
}

/// Words in cache lines, so that vectors do not straddle them.
#[derive(Debug, Default)]
pub(super) struct Lines(Vec<Line>);

#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
struct Line(#[allow(dead_code, reason = "read through a pointer")] [u32; 16]);

impl Lines {
    /// Room for `len` words; old ones stay.
    pub fn reserve(&mut self, len: usize) -> Result<*mut u32> {
        let lines = len.div_ceil(16);
        if self.0.len() < lines {
            memory::resize(&mut self.0, lines, Line([0; 16]))?;
        }
        Ok(self.0.as_mut_ptr().cast())
    }

    /// `len` zeros.
    pub fn zeros(&mut self, len: usize) -> Result<&mut [f32]> {
        let pointer = self.reserve(len)?.cast::<f32>();
        // SAFETY: `reserve` has made `len` initialised words; a word has the size of an `f32`, and every bit pattern is one.
        let numbers = unsafe { std::slice::from_raw_parts_mut(pointer, len) };
        numbers.fill(0.0);
        Ok(numbers)
    }

    pub fn pointer(&self) -> *const u32 {
        self.0.as_ptr().cast()
    }

    /// The words as numbers.
    pub fn numbers(&self) -> &[f32] {
        // SAFETY: as many numbers as there are words, of the same size; any bits are a number.
        unsafe { std::slice::from_raw_parts(self.pointer().cast(), 16 * self.0.len()) }
    }

    pub fn bytes(&self) -> usize {
        self.0.capacity() * size_of::<Line>()
    }
}

impl Workspace for Blocks {
    fn bytes(&self) -> usize {
        self.numbers.bytes() + self.bytes.bytes()
    }
}

impl Workspace for Scratch {
    fn bytes(&self) -> usize {
        self.band.bytes()
            + self.carry.bytes()
            + self.room.bytes()
            + self.edge.capacity() * size_of::<[f32; BLOCK]>()
            + self.masks.capacity() * size_of::<u32>()
            + self.found.capacity() * size_of::<Found>()
    }
}

/// Prepares `scratch` for bands of `tile`.
pub(super) fn begin<L: Lane>(_: L, context: &Context, tile: &Tile, scratch: &mut Scratch) -> Result<()> {
    let Context { plan, source, size, grid, .. } = *context;
    let left = (tile.origin.0 + CELL * tile.columns.start) as i64 - grid.pad.width as i64;
    let columns = left - 1..left + (CELL * tile.cells(plan)) as i64 + 1;
    scratch.band.begin(source, size, columns, L::GROUP, L::REACH)
}

/// Makes the blocks of band `index` of `tile`. If `first`, no band was made before it by the same scratch memory;
/// otherwise that was the band above.
pub(super) fn make<L: Lane>(
    l: L,
    context: &Context,
    tile: &Tile,
    (index, first): (usize, bool),
    scratch: &mut Scratch,
    blocks: &mut Blocks,
    interrupt: &Interrupt,
) -> Result<()> {
    let Context { plan, source, grid, .. } = *context;
    let (height, lanes) = (Tile::band_rows(plan), tile.lanes(plan));
    let top = index * height;
    let bottom = (top + height).min(tile.block_rows(plan));
    let cells_x = tile.cells(plan);
    let Scratch { band, carry, room, edge, .. } = scratch;
    let numbers: *mut f32 = blocks.numbers.reserve(height * BLOCK * lanes + 64)?.cast();
    let bytes = blocks.bytes.reserve(height * WORDS * lanes + 64)?;
    let carry: *mut f32 = carry.reserve(cells_x.div_ceil(L::LANES) * CARRY * L::LANES)?.cast();
    let room: *mut f32 = room.reserve(ROOM * L::LANES)?.cast();
    edge.clear();
    memory::resize(edge, height, [0.0; BLOCK])?;
    // A row of blocks ends in the row of cells below it; that of the band above did so too.
    let mut cells = if first { top..bottom + 1 } else { top + 1..bottom + 1 };
    let at_once = (BAND / (CELL * band.stride)).max(1);
    let mut carried = !first;
    while !cells.is_empty() {
        interrupt.check()?;
        let now = cells.start..(cells.start + at_once).min(cells.end);
        cells.start = now.end;
        let above =
            (tile.origin.1 + CELL * (tile.rows.start + now.start)) as i64 - 1 - grid.pad.height as i64;
        band.fill(l, source, above, CELL * now.len() + 2)?;
        let origin = band.origin();
        let stride = band.stride;
        let mut job = Job {
            geometry: &plan.geometry,
            origin,
            stride,
            cells: now,
            top,
            carried,
            carry,
            room,
            blocks: numbers,
            bytes,
            lanes,
            ends: None,
            edge,
        };
        // From right to left: a strip adds to the last blocks of the strip left of it.
        let rest = cells_x % L::LANES;
        let mut end = cells_x - rest;
        // SAFETY: the band's rows have 16 bytes more on the left and OVERREAD on the right than the tile; blocks and
        // bytes were reserved for all lanes.
        unsafe {
            if rest > L::Narrow::LANES {
                strip(l, &mut job, end, source.channels());
            } else if rest > 0 {
                strip(l.narrow(), &mut job, end, source.channels());
            }
            while end > 0 {
                end -= L::LANES;
                strip(l, &mut job, end, source.channels());
            }
        }
        carried = true;
    }
    Ok(())
}

/// Adds to `scratch.found` the windows of band `index` that may be hits and nearly all that guide. They begin in `own` and
/// end in `next`, the blocks of the band below, if there is one.
pub(super) fn score_band<L: Lane>(
    l: L,
    context: &Context,
    tile: &Tile,
    index: usize,
    (own, next): (&Blocks, Option<&Blocks>),
    scratch: &mut Scratch,
    interrupt: &Interrupt,
) -> Result<()> {
    let Context { plan, grid, thresholds, .. } = *context;
    let rows = Tile::band_rows(plan);
    let top = index * rows;
    let height = tile.rows.len().saturating_sub(top).min(rows);
    if height == 0 {
        return Ok(());
    }
    let next = next.unwrap_or(own);
    let windows = WindowGrid {
        plan,
        blocks: [own, next].map(|blocks| blocks.numbers.pointer().cast()),
        bytes: [own, next].map(|blocks| blocks.bytes.pointer()),
        rows,
        lanes: tile.lanes(plan),
        width: tile.columns.len(),
        height,
    };
    let before = scratch.found.len();
    // SAFETY: the blocks of all windows were made, those beyond the band's in the next one; `lanes` is as wide as wanted.
    unsafe { score(l, &windows, thresholds, interrupt, &mut scratch.masks, &mut scratch.found) }?;
    let (left, top) = (tile.origin.0 + 8 * tile.columns.start, tile.origin.1 + 8 * (tile.rows.start + top));
    let mut kept = before;
    for index in before..scratch.found.len() {
        let (x, y, score) = scratch.found[index];
        let (x, y) = (left + 8 * x, top + 8 * y);
        if x.is_multiple_of(grid.stride.width) && y.is_multiple_of(grid.stride.height) {
            scratch.found[kept] = (x, y, score);
            kept += 1;
        }
    }
    scratch.found.truncate(kept);
    Ok(())
}
