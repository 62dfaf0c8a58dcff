//! One level, from planes to hits: lattices of blocks, bands of rows, strips, scores.

use crate::error::Result;
use crate::geometry::Size;
use crate::interrupt::Interrupt;
use crate::memory::{self, Workspace};
use crate::pyramid::Grid;

use super::lane::Lane;
use super::layout::{BAND, BLOCK, CARRY, CELL, WORDS};
use super::plan::Plan;
use super::rows::{Band, Planes};
use super::score::{WindowGrid, score};
use super::strip::{Job, ROOM, strip};

/// Scratch memory of one level, used again from level to level and call to call.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    pub(super) band: Band,
    carry: Lines,
    room: Lines,
    blocks: Lines,
    bytes: Lines,
    edge: Vec<[f32; BLOCK]>,
    masks: Vec<u32>,
    /// Windows found: padded x, padded y, score.
    pub(crate) found: Vec<(usize, usize, f64)>,
}

/// Words in cache lines, so that vectors do not straddle them.
#[derive(Debug, Default)]
struct Lines(Vec<Line>);

#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
struct Line(#[allow(dead_code, reason = "read through a pointer")] [u32; 16]);

impl Lines {
    /// Room for `len` words; old ones stay.
    fn reserve(&mut self, len: usize) -> Result<*mut u32> {
        let lines = len.div_ceil(16);
        if self.0.len() < lines {
            memory::resize(&mut self.0, lines, Line([0; 16]))?;
        }
        Ok(self.0.as_mut_ptr().cast())
    }

    fn bytes(&self) -> usize {
        self.0.capacity() * size_of::<Line>()
    }
}

impl Workspace for Scratch {
    fn bytes(&self) -> usize {
        self.band.bytes()
            + self.carry.bytes()
            + self.room.bytes()
            + self.blocks.bytes()
            + self.bytes.bytes()
            + self.edge.capacity() * size_of::<[f32; BLOCK]>()
            + self.masks.capacity() * size_of::<u32>()
            + self.found.capacity() * size_of::<(usize, usize, f64)>()
    }
}

/// The search of one level.
#[derive(Clone, Copy)]
pub(crate) struct Task<'a> {
    pub plan: &'a Plan,
    pub source: &'a Planes,
    pub size: Size,
    pub grid: &'a Grid,
    pub threshold: f64,
    pub interrupt: &'a Interrupt<'a>,
}

/// Adds the windows that the search finds to `scratch.found`.
pub(super) fn level<L: Lane>(l: L, task: Task, scratch: &mut Scratch) -> Result<()> {
    scratch.band.begin(task.source, task.size, task.grid.pad.width, L::GROUP, L::REACH)?;
    let Task { grid, .. } = task;
    // Windows whose distance is no multiple of 8 lie on several lattices of blocks.
    let lattices = |stride: usize| if stride.is_multiple_of(8) { 0..1 } else { 0..2 };
    for y in lattices(grid.stride.height) {
        for x in lattices(grid.stride.width) {
            lattice(l, task, (4 * x, 4 * y), scratch)?;
        }
    }
    Ok(())
}

fn lattice<L: Lane>(l: L, task: Task, (left, top): (usize, usize), scratch: &mut Scratch) -> Result<()> {
    let Task { plan, source, grid, threshold, interrupt, .. } = task;
    let along = |padded: usize, blocks: usize, origin: usize| {
        (padded - origin).checked_sub(8 * (blocks + 1)).map_or(0, |room| room / 8 + 1)
    };
    let width = along(grid.padded.width, plan.blocks.width, left);
    let height = along(grid.padded.height, plan.blocks.height, top);
    if width == 0 || height == 0 {
        return Ok(());
    }
    let (cells_x, cells_y) = (width + plan.blocks.width, height + plan.blocks.height);
    let lanes = cells_x.next_multiple_of(32) + 32 + plan.blocks.width.next_multiple_of(16);
    let Scratch { band, carry, room, blocks, bytes, edge, masks, found } = scratch;
    let blocks: *mut f32 = blocks.reserve((cells_y - 1) * BLOCK * lanes + 64)?.cast();
    let bytes = bytes.reserve((cells_y - 1) * WORDS * lanes + 64)?;
    let carry: *mut f32 = carry.reserve(cells_x.div_ceil(L::LANES) * CARRY * L::LANES)?.cast();
    let room: *mut f32 = room.reserve(ROOM * L::LANES)?.cast();
    edge.clear();
    memory::resize(edge, cells_y, [0.0; BLOCK])?;
    let at_once = (BAND / (CELL * band.stride)).max(1);
    for begin in (0..cells_y).step_by(at_once) {
        interrupt.check()?;
        let cells = begin..(begin + at_once).min(cells_y);
        let above = (top + CELL * begin) as i64 - 1 - grid.pad.height as i64;
        band.fill(l, source, above, CELL * cells.len() + 2)?;
        let mut origin = [band.pixels().as_ptr(); 3];
        for (channel, origin) in origin.iter_mut().enumerate().take(source.channels()) {
            *origin = band.pixels()[channel * band.plane + band.left + left - grid.pad.width..].as_ptr();
        }
        let stride = band.stride;
        let mut job = Job { plan, origin, stride, cells, carry, room, blocks, bytes, lanes, edge };
        // From right to left: a strip adds to the last blocks of the strip left of it.
        let rest = cells_x % L::LANES;
        let mut end = cells_x - rest;
        // SAFETY: the level's rows have 16 bytes more on the left and OVERREAD on the right than the padded image;
        // blocks and bytes were reserved for all lanes.
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
    }
    let before = found.len();
    let windows = WindowGrid { plan, blocks, bytes, lanes, width, height };
    // SAFETY: the strips have filled the blocks of all windows; `lanes` is as wide as wanted.
    unsafe { score(l, &windows, threshold, interrupt, masks, found) }?;
    let mut kept = before;
    for index in before..found.len() {
        let (x, y, score) = found[index];
        let (x, y) = (left + 8 * x, top + 8 * y);
        if x.is_multiple_of(grid.stride.width) && y.is_multiple_of(grid.stride.height) {
            found[kept] = (x, y, score);
            kept += 1;
        }
    }
    found.truncate(kept);
    Ok(())
}
