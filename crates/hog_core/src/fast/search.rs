//! A search of many levels at once, shared among threads: tiles, cut into bands, of which any thread may take the rest.
//!
//! ```text
//! each thread, until nothing is left:
//!     take:  the next tile; or, of that with most work left, the lower half of the bands that its thread has before it
//!     for each band, from the top:  make its blocks; score the windows that begin in the band above
//!     at a cut (a `Seam`):  the first thread there leaves its blocks; the second scores the windows across it
//! ```
//!
//! Trick: windows across a cut need the blocks of both threads, yet neither waits for the other.

use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::error::Result;
use crate::geometry::Size;
use crate::interrupt::Interrupt;
use crate::memory::{self, Pool};
use crate::pyramid::Grid;
use crate::threads::together;

use super::backend::Backend;
use super::dispatch::{OnLane, on_lane};
use super::lane::Lane;
use super::plan::Plan;
use super::rows::Planes;
use super::score::Thresholds;
use super::tile::{self, Blocks, COLUMNS_MAX, Context, Found, Scratch, Tile};

/// Scratch memory, one per thread at work.
static SCRATCH: Pool<Scratch> = Pool::new();

/// Blocks, two per thread at work and one per seam.
static BLOCKS: Pool<Blocks> = Pool::new();

/// Frees scratch memory that is too large to be kept.
pub(crate) fn trim() {
    SCRATCH.trim();
    BLOCKS.trim();
}

/// What to search.
#[derive(Debug)]
pub(crate) struct Task<'a> {
    pub backend: Backend,
    pub plan: &'a Plan,
    pub planes: &'a Planes,
    /// The size and the windows of each level.
    pub levels: &'a [(Size, Grid)],
    pub regions: Vec<Region>,
    pub thresholds: Thresholds,
}

/// A part of a level: the windows whose corners lie in it.
#[derive(Debug, Clone)]
pub(crate) struct Region {
    pub level: usize,
    /// Padded pixels.
    pub x: Range<usize>,
    pub y: Range<usize>,
}

impl Region {
    /// All of a level.
    pub(crate) fn whole(level: usize, grid: &Grid) -> Self {
        Self { level, x: 0..grid.padded.width, y: 0..grid.padded.height }
    }
}

/// For each level of `task`, every window of its regions that may be a hit and nearly every one that guides, row by row.
pub(crate) fn search(task: Task, threads: usize, interrupt: &Interrupt) -> Result<Vec<Vec<Found>>> {
    let mut tiles = Vec::new();
    for region in &task.regions {
        if let Some((_, grid)) = task.levels.get(region.level) {
            tiles_of(region, grid, task.plan, &mut tiles)?;
        }
    }
    let bands = tiles.iter().map(|tile| tile.bands(task.plan)).sum();
    let found = memory::filled(task.levels.len(), Vec::new())?;
    let search = Search {
        task,
        tiles,
        progress: Mutex::new(Progress {
            next_tile: 0,
            runs: memory::with_room(threads.min(bands))?,
            numbers: 0,
        }),
        found: Mutex::new(found),
    };
    together(&|interrupt: &Interrupt| search.work(interrupt), threads.min(bands), interrupt)?;
    let mut found = search.found.into_inner().unwrap_or_else(PoisonError::into_inner);
    for level in &mut found {
        level.sort_unstable_by(|a, b| (a.1, a.0).cmp(&(b.1, b.0)).then(a.2.total_cmp(&b.2)));
    }
    Ok(found)
}

/// Adds the tiles of a region's windows to `tiles`.
fn tiles_of(region: &Region, grid: &Grid, plan: &Plan, tiles: &mut Vec<Tile>) -> Result<()> {
    if grid.is_empty() {
        return Ok(());
    }
    // Windows whose distance is no multiple of 8 lie on several lattices of blocks.
    let origins = |stride: usize| if stride.is_multiple_of(8) { 0..1 } else { 0..2 };
    let along = |padded: usize, blocks: usize, origin: usize, wanted: &Range<usize>| {
        let all = (padded - origin).checked_sub(8 * (blocks + 1)).map_or(0, |room| room / 8 + 1);
        let at = |end: usize| end.saturating_sub(origin).div_ceil(8).min(all);
        at(wanted.start)..at(wanted.end)
    };
    for y in origins(grid.stride.height) {
        for x in origins(grid.stride.width) {
            let origin = (4 * x, 4 * y);
            let all = along(grid.padded.width, plan.blocks.width, origin.0, &region.x);
            let rows = along(grid.padded.height, plan.blocks.height, origin.1, &region.y);
            if all.is_empty() || rows.is_empty() {
                continue;
            }
            let parts = all.len().div_ceil(COLUMNS_MAX);
            for part in 0..parts {
                let at = |part: usize| all.start + part * all.len() / parts;
                let columns = at(part)..at(part + 1);
                memory::push(tiles, Tile { level: region.level, origin, columns, rows: rows.clone() })?;
            }
        }
    }
    Ok(())
}

/// A search at work.
struct Search<'a> {
    task: Task<'a>,
    tiles: Vec<Tile>,
    progress: Mutex<Progress>,
    /// What was found on each level.
    found: Mutex<Vec<Vec<Found>>>,
}

/// Which bands are taken.
struct Progress {
    /// Tiles before this one are taken by a thread.
    next_tile: usize,
    runs: Vec<Run>,
    /// How many runs there have been.
    numbers: usize,
}

/// Bands of one tile, which one thread makes from the top.
#[derive(Clone)]
struct Run {
    number: usize,
    tile: usize,
    /// The first band, the next one to be made, and the end of those that are this thread's.
    begin: usize,
    next: usize,
    end: usize,
    /// Where another thread's bands lie above or below.
    above: Option<Arc<Seam>>,
    below: Option<Arc<Seam>>,
}

impl Run {
    /// Where another thread may take over: it leaves half, and the first band, which the seam above waits for.
    fn cut(&self) -> usize {
        (self.next + (self.end - self.next) / 2).max(self.begin + 1)
    }
}

/// The blocks of the bands on both sides of a cut, from the thread that was there first.
struct Seam(Mutex<Option<Arc<Blocks>>>);

impl Seam {
    /// The blocks of the other side, if they are there; else leaves `own` for the other side.
    fn meet(&self, own: &Arc<Blocks>) -> Option<Arc<Blocks>> {
        let mut first = lock(&self.0);
        let other = first.take();
        if other.is_none() {
            *first = Some(Arc::clone(own));
        }
        other
    }
}

impl Search<'_> {
    /// A thread's part: runs, until there are none left.
    fn work(&self, interrupt: &Interrupt) -> Result<()> {
        SCRATCH.with(|scratch| {
            while let Some(run) = self.take()? {
                on_lane(self.task.backend, Bands { search: self, run, scratch, interrupt })?;
            }
            Ok(())
        })
    }

    /// A run for a thread that has nothing to do: a tile of its own, or half of what another thread has before it.
    fn take(&self) -> Result<Option<Run>> {
        let mut progress = lock(&self.progress);
        let number = progress.numbers;
        let plan = self.task.plan;
        let run = if let Some(tile) = self.tiles.get(progress.next_tile) {
            let (tile, end) = (progress.next_tile, tile.bands(plan));
            progress.next_tile += 1;
            Run { number, tile, begin: 0, next: 0, end, above: None, below: None }
        } else {
            let cost = |run: &&mut Run| (run.end - run.cut()) * self.tiles[run.tile].band_cost(plan);
            let others = progress.runs.iter_mut().filter(|run| run.cut() < run.end);
            let Some(other) = others.max_by_key(cost) else { return Ok(None) };
            let (tile, begin, end) = (other.tile, other.cut(), other.end);
            let seam = Arc::new(Seam(Mutex::new(None)));
            let below = other.below.replace(Arc::clone(&seam));
            other.end = begin;
            Run { number, tile, begin, next: begin, end, above: Some(seam), below }
        };
        progress.numbers += 1;
        memory::push(&mut progress.runs, run.clone())?;
        Ok(Some(run))
    }

    /// The next band of the run `number`; where it has ended, what lies below it.
    fn next(&self, number: usize) -> std::result::Result<usize, Option<Arc<Seam>>> {
        let mut progress = lock(&self.progress);
        let Some(at) = progress.runs.iter().position(|run| run.number == number) else { return Err(None) };
        let run = &mut progress.runs[at];
        if run.next < run.end {
            run.next += 1;
            return Ok(run.next - 1);
        }
        Err(progress.runs.swap_remove(at).below)
    }
}

/// The work of one run.
struct Bands<'a> {
    search: &'a Search<'a>,
    run: Run,
    scratch: &'a mut Scratch,
    interrupt: &'a Interrupt<'a>,
}

impl OnLane for Bands<'_> {
    type Output = Result<()>;

    fn run<L: Lane>(self, l: L) -> Result<()> {
        let Self { search, run, scratch, interrupt } = self;
        let Task { plan, planes, levels, thresholds, .. } = search.task;
        let tile = &search.tiles[run.tile];
        let (size, grid) = &levels[tile.level];
        let context = Context { plan, source: planes, size: *size, grid, thresholds };
        scratch.found.clear();
        tile::begin(l, &context, tile, scratch)?;
        let mut last: Option<(usize, Arc<Blocks>)> = None;
        let below = loop {
            let band = match search.next(run.number) {
                Ok(band) => band,
                Err(below) => break below,
            };
            let mut blocks = BLOCKS.take();
            tile::make(l, &context, tile, (band, last.is_none()), scratch, &mut blocks, interrupt)?;
            let blocks = Arc::new(blocks);
            let above = match last.take() {
                Some((_, above)) => Some(above),
                None => run.above.as_ref().and_then(|seam| seam.meet(&blocks)),
            };
            if let Some(above) = above {
                let both = (&*above, Some(&*blocks));
                tile::score_band(l, &context, tile, band - 1, both, scratch, interrupt)?;
                give(above);
            }
            last = Some((band, blocks));
        };
        if let Some((band, own)) = last {
            let next = below.as_ref().map(|seam| seam.meet(&own));
            if !matches!(next, Some(None)) {
                let next = next.flatten();
                tile::score_band(l, &context, tile, band, (&own, next.as_deref()), scratch, interrupt)?;
                next.into_iter().for_each(give);
            }
            give(own);
        }
        let mut found = lock(&search.found);
        memory::extend(&mut found[tile.level], scratch.found.iter().copied())
    }
}

/// Keeps blocks that nothing else needs for another band.
fn give(blocks: Arc<Blocks>) {
    if let Ok(blocks) = Arc::try_unwrap(blocks) {
        BLOCKS.give(blocks);
    }
}

/// The lock, which another thread of this call holds for a moment.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may fail")]
mod tests {
    use super::super::dispatch::{fill_planes, geometry, plan};
    use super::*;
    use crate::exact::Svm;
    use crate::image::ImageView;
    use crate::model;
    use crate::params::{HogParams, HogSpec};
    use crate::pyramid::Steps;

    /// The windows of squares of noise that a search with these thresholds finds.
    fn found(backend: Backend, thresholds: Thresholds) -> Vec<Found> {
        let spec = HogSpec::new(&HogParams::default()).unwrap();
        let size = Size::new(320, 240);
        let noise = |i: usize| ((i * i * 2_654_435_761) >> 7) as u8;
        let pixel = |i: usize| noise(i / 320 / 12 * 27 + i % 320 / 12) / 2 + noise(i) / 4;
        let pixels: Vec<u8> = (0..size.area()).map(pixel).collect();
        let mut planes = Planes::default();
        fill_planes(backend, &mut planes, ImageView::new(&pixels, 320, 240, 1, 320).unwrap()).unwrap();
        let geometry = geometry(backend, &spec).unwrap();
        let svm = Svm::new(model::default_people(), &spec).unwrap();
        let grid = Steps::new((8, 8), (8, 8), spec.cell, &spec).unwrap().grid(size, &spec);
        let task = Task {
            backend,
            plan: &plan(backend, &geometry, &svm).unwrap(),
            planes: &planes,
            levels: &[(size, grid)],
            regions: vec![Region::whole(0, &grid)],
            thresholds,
        };
        search(task, 1, &Interrupt::NEVER).unwrap().remove(0)
    }

    #[test]
    fn windows_that_only_guide_are_found_although_the_prefilter_may_be_further_off() {
        for backend in Backend::ALL.into_iter().filter(|backend| backend.is_available()) {
            let all = found(backend, Thresholds { hit: f64::NEG_INFINITY, guide: f64::NEG_INFINITY });
            assert_eq!(all.len(), 35 * 17);
            let mut scores: Vec<f64> = all.iter().map(|&(_, _, score)| score).collect();
            scores.sort_unstable_by(f64::total_cmp);
            for guide in scores.iter().copied().step_by(31) {
                let some = found(backend, Thresholds { hit: f64::INFINITY, guide });
                let wanted = || all.iter().filter(|&&(_, _, score)| score >= guide);
                assert!(wanted().all(|window| some.contains(window)), "{backend:?} {guide}");
                // The scalar kernels have no prefilter. With their whole bound the others let in up to 430 more.
                let most = if backend == Backend::Scalar { all.len() } else { wanted().count() + 90 };
                assert!(some.len() <= most, "{backend:?} {guide}: {} of {most}", some.len());
            }
        }
    }
}
