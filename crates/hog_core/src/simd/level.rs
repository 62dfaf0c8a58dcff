//! One level, from planes to hits: lattices, strips, scores, and the choice of instruction set.

use crate::grid::Grid;
use crate::image::ImageView;
use crate::params::Size;

use super::backend::Backend;
use super::lane::Lane;
use super::plan::{Plan, WORDS};
use super::portable::Portable;
use super::rows::{Band, Planes};
use super::score::{Windows, score};
use super::strip::{BLOCK, CARRY, CELL, Job, strip};

/// Scratch memory of one level, used again from level to level and call to call.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    band: Band,
    carry: Lines,
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
    fn reserve(&mut self, len: usize) -> *mut u32 {
        let lines = len.div_ceil(16);
        if self.0.len() < lines {
            self.0.resize(lines, Line([0; 16]));
        }
        self.0.as_mut_ptr().cast()
    }
}

/// Bytes of pixels that the strips work on at a time: a part of the second-level cache.
const BAND: usize = 384 << 10;

/// What to look at.
#[derive(Clone, Copy)]
struct Task<'a> {
    plan: &'a Plan,
    source: &'a Planes,
    size: Size,
    grid: &'a Grid,
    threshold: f64,
}

/// Whether the backend's estimated square root is right for every pixel value; CPUs differ in their estimates.
pub(super) fn gamma_is_exact(backend: Backend) -> bool {
    match backend {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a backend is only chosen where it is available.
        Backend::Avx512 => unsafe { avx512_gamma_is_exact() },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        Backend::Avx2 => unsafe { avx2_gamma_is_exact() },
        _ => false,
    }
}

#[inline(always)]
fn is_exact<L: Lane>(l: L) -> bool {
    (0..=255u8).all(|value| {
        let value = f32::from(value);
        l.first(l.gamma(l.splat(value))) == value.sqrt()
    })
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,avx512f,avx512bw,avx512vl,avx512dq,avx512vbmi,avx512vnni")]
fn avx512_gamma_is_exact() -> bool {
    use super::{avx2::Avx2, avx512::Avx512};
    // SAFETY: this function's features are the tokens'; a level's last strip is AVX2's.
    unsafe { is_exact(Avx512::new()) && is_exact(Avx2::new()) }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn avx2_gamma_is_exact() -> bool {
    // SAFETY: this function's features are the token's.
    unsafe { is_exact(super::avx2::Avx2::new()) }
}

/// Whether the kernels can serve windows of this stride.
pub(crate) fn serves(grid: &Grid) -> bool {
    grid.stride.width.is_multiple_of(4) && grid.stride.height.is_multiple_of(4)
}

/// Puts into `scratch.found` every window of `grid` whose score is at least `threshold`, up to the plan's noise: x, y
/// in padded pixels, row by row.
pub(crate) fn detect(
    backend: Backend,
    plan: &Plan,
    source: &Planes,
    size: Size,
    grid: &Grid,
    threshold: f64,
    scratch: &mut Scratch,
) {
    scratch.found.clear();
    if grid.is_empty() {
        return;
    }
    let task = Task { plan, source, size, grid, threshold };
    match backend {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a backend is only chosen where it is available.
        Backend::Avx512 => unsafe { avx512(task, scratch) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        Backend::Avx2 => unsafe { avx2(task, scratch) },
        #[cfg(target_arch = "aarch64")]
        Backend::Neon => neon(task, scratch),
        _ => level(Portable, Portable, task, scratch),
    }
    scratch.found.sort_unstable_by_key(|&(x, y, _)| (y, x));
}

/// Fills `planes` with the pixels of `image`.
pub(crate) fn split(backend: Backend, planes: &mut Planes, image: ImageView) {
    match backend {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a backend is only chosen where it is available; who has AVX-512 has AVX2.
        Backend::Avx512 | Backend::Avx2 => unsafe { avx2_split(planes, image) },
        #[cfg(target_arch = "aarch64")]
        // SAFETY: as in `neon`.
        Backend::Neon => planes.fill(unsafe { super::neon::Neon::new() }, image),
        _ => planes.fill(Portable, image),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn avx2_split(planes: &mut Planes, image: ImageView) {
    // SAFETY: this function's features are the token's.
    planes.fill(unsafe { super::avx2::Avx2::new() }, image);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,avx512f,avx512bw,avx512vl,avx512dq,avx512vbmi,avx512vnni")]
fn avx512(task: Task, scratch: &mut Scratch) {
    use super::{avx2::Avx2, avx512::Avx512};
    // SAFETY: this function's features are the tokens'.
    unsafe { level(Avx512::new(), Avx2::new(), task, scratch) }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn avx2(task: Task, scratch: &mut Scratch) {
    use super::avx2::Avx2;
    // SAFETY: this function's features are the token's.
    let l = unsafe { Avx2::new() };
    level(l, l, task, scratch);
}

#[cfg(target_arch = "aarch64")]
fn neon(task: Task, scratch: &mut Scratch) {
    // SAFETY: every aarch64 CPU that Rust's standard targets run on has NEON.
    let l = unsafe { super::neon::Neon::new() };
    level(l, l, task, scratch);
}

/// `tail` serves what is narrow: single windows, and a level's last strip if that is at most half a vector of `l`.
#[inline(always)]
fn level<L: Lane, T: Lane>(l: L, tail: T, task: Task, scratch: &mut Scratch) {
    scratch.band.begin(task.source, task.size, task.grid.pad.width, L::GROUP, L::REACH);
    let Task { grid, .. } = task;
    // Windows whose distance is no multiple of 8 lie on several lattices of blocks.
    let lattices = |stride: usize| if stride.is_multiple_of(8) { 0..1 } else { 0..2 };
    for y in lattices(grid.stride.height) {
        for x in lattices(grid.stride.width) {
            lattice(l, tail, task, (4 * x, 4 * y), scratch);
        }
    }
}

#[inline(always)]
fn lattice<L: Lane, T: Lane>(l: L, tail: T, task: Task, (left, top): (usize, usize), scratch: &mut Scratch) {
    let Task { plan, source, grid, threshold, .. } = task;
    let along = |padded: usize, blocks: usize, origin: usize| {
        (padded - origin).checked_sub(8 * (blocks + 1)).map_or(0, |room| room / 8 + 1)
    };
    let width = along(grid.padded.width, plan.blocks.width, left);
    let height = along(grid.padded.height, plan.blocks.height, top);
    if width == 0 || height == 0 {
        return;
    }
    let (cells_x, cells_y) = (width + plan.blocks.width, height + plan.blocks.height);
    let lanes = cells_x.next_multiple_of(32) + 32 + plan.blocks.width.next_multiple_of(16);
    let Scratch { band, carry, blocks, bytes, edge, masks, found } = scratch;
    let blocks: *mut f32 = blocks.reserve((cells_y - 1) * BLOCK * lanes + 64).cast();
    let bytes = bytes.reserve((cells_y - 1) * WORDS * lanes + 64);
    let carry: *mut f32 = carry.reserve(cells_x.div_ceil(L::LANES) * CARRY * L::LANES).cast();
    edge.clear();
    edge.resize(cells_y, [0.0; BLOCK]);
    let at_once = (BAND / (CELL * band.stride)).max(1);
    for begin in (0..cells_y).step_by(at_once) {
        let cells = begin..(begin + at_once).min(cells_y);
        let above = (top + CELL * begin) as i64 - 1 - grid.pad.height as i64;
        match source.channels() {
            1 => band.fill::<L, 1>(l, source, above, CELL * cells.len() + 2),
            _ => band.fill::<L, 3>(l, source, above, CELL * cells.len() + 2),
        }
        let mut origin = [band.pixels().as_ptr(); 3];
        for (channel, origin) in origin.iter_mut().enumerate().take(source.channels()) {
            *origin = band.pixels()[channel * band.plane + band.left + left - grid.pad.width..].as_ptr();
        }
        let stride = band.stride;
        let mut job = Job { plan, origin, stride, cells, carry, blocks, bytes, lanes, edge };
        // From right to left: a strip adds to the last blocks of the strip left of it.
        let rest = cells_x % L::LANES;
        let mut end = cells_x - rest;
        if rest > T::LANES {
            strip_of(l, &mut job, end, source.channels());
        } else if rest > 0 {
            strip_of(tail, &mut job, end, source.channels());
        }
        while end > 0 {
            end -= L::LANES;
            strip_of(l, &mut job, end, source.channels());
        }
    }
    let before = found.len();
    let windows = Windows { plan, blocks, bytes, lanes, width, height };
    // SAFETY: the strips have filled the blocks of all windows; `lanes` is as wide as wanted.
    unsafe { score(l, tail, &windows, threshold, masks, found) };
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
}

#[inline(always)]
fn strip_of<L: Lane>(l: L, job: &mut Job, first: usize, channels: usize) {
    // SAFETY: the level's rows have 16 bytes more on the left and OVERREAD on the right than the padded image;
    // blocks and bytes were reserved for all lanes.
    unsafe {
        if channels == 1 {
            strip::<L, 1>(l, job, first);
        } else {
            strip::<L, 3>(l, job, first);
        }
    }
}
