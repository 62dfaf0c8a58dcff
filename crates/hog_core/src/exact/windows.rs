//! Descriptors and scores of an image's windows: gradient → blocks → windows, every sum in OpenCV's order.
//!
//! This specifies the fast path, and decides windows whose score is too close to the threshold.

use std::collections::BTreeMap;

use crate::error::Result;
use crate::geometry::{Padding, Region, Size};
use crate::image::ImageView;
use crate::interrupt::Interrupt;
use crate::memory;
use crate::params::HogSpec;
use crate::pyramid::Grid;

use super::blocks::block_histograms;
use super::gradient::{Votes, votes};
use super::svm::Svm;
use super::tables::Tables;

/// Block histograms of an image, row of blocks by row of blocks, each computed once and dropped when no window
/// further down needs it.
struct BlockRows<'a> {
    spec: &'a HogSpec,
    tables: &'a Tables,
    votes: Votes,
    /// Padded x of every block of any window.
    columns: Vec<usize>,
    /// For each window along x and each of its blocks along x: the place in `columns`.
    places: Vec<usize>,
    rows: BTreeMap<usize, Vec<f32>>,
}

impl<'a> BlockRows<'a> {
    fn new(
        image: ImageView,
        grid: &Grid,
        spec: &'a HogSpec,
        tables: &'a Tables,
        interrupt: &Interrupt,
    ) -> Result<Self> {
        let of_window =
            |i: usize| (0..spec.blocks.width).map(move |b| i * grid.stride.width + b * spec.stride.width);
        let wanted = grid.windows.width.saturating_mul(spec.blocks.width);
        let mut columns: Vec<usize> = memory::with_room(wanted)?;
        columns.extend((0..grid.windows.width).flat_map(of_window));
        let mut places = memory::collect(columns.iter().copied())?;
        columns.sort_unstable();
        columns.dedup();
        for place in &mut places {
            *place = columns.partition_point(|column| column < place);
        }
        let votes = votes(image, grid.padding(), grid.whole(), spec, tables.kernel, interrupt)?;
        Ok(Self { spec, tables, votes, columns, places, rows: BTreeMap::new() })
    }

    /// Makes the rows of blocks that windows at padded row `y` need.
    fn advance(&mut self, y: usize) -> Result<()> {
        let Self { spec, tables, votes, columns, rows, .. } = self;
        *rows = rows.split_off(&y);
        let below = (0..spec.blocks.height).map(|block| y + block * spec.stride.height);
        let votes: &Votes = votes;
        let missing = memory::collect(below.filter(|y| !rows.contains_key(y)))?;
        let mut firsts = memory::with_room(missing.len().saturating_mul(columns.len()))?;
        firsts.extend(missing.iter().flat_map(|y| columns.iter().map(move |x| y * votes.width + x)));
        let mut blocks = memory::filled(firsts.len().saturating_mul(spec.block_len), 0.0)?;
        block_histograms(votes, &firsts, spec, tables, &mut blocks);
        for (y, row) in missing.into_iter().zip(blocks.chunks_exact(columns.len() * spec.block_len)) {
            rows.insert(y, memory::collect(row.iter().copied())?);
        }
        Ok(())
    }

    /// The rows of blocks of the windows at padded row `y`.
    fn rows(&self, y: usize) -> Result<Vec<&[f32]>> {
        let row = |by| self.rows.get(&(y + by * self.spec.stride.height)).map_or(&[][..], Vec::as_slice);
        memory::collect((0..self.spec.blocks.height).map(row))
    }

    /// The blocks of window `i` of `rows`, in descriptor order: column by column.
    fn window<'r>(&self, rows: &'r [&[f32]], i: usize) -> impl Iterator<Item = &'r [f32]> {
        let len = self.spec.block_len;
        let places = &self.places[i * self.spec.blocks.width..][..self.spec.blocks.width];
        places.iter().flat_map(move |place| rows.iter().map(move |row| &row[place * len..][..len]))
    }
}

/// The descriptors of all windows, one after the other.
pub fn descriptors(
    image: ImageView,
    grid: &Grid,
    spec: &HogSpec,
    tables: &Tables,
    interrupt: &Interrupt,
    out: &mut [f32],
) -> Result<()> {
    if spec.descriptor_len() == 0 || grid.is_empty() {
        return Ok(());
    }
    let mut blocks = BlockRows::new(image, grid, spec, tables, interrupt)?;
    let row_len = grid.windows.width * spec.descriptor_len();
    for (j, out) in out.chunks_exact_mut(row_len).enumerate() {
        let y = j * grid.stride.height;
        interrupt.check()?;
        blocks.advance(y)?;
        let rows = blocks.rows(y)?;
        let found = (0..grid.windows.width).flat_map(|i| blocks.window(&rows, i));
        for (out, block) in out.chunks_exact_mut(spec.block_len).zip(found) {
            out.copy_from_slice(block);
        }
    }
    Ok(())
}

/// The scores of all windows, row by row.
///
/// ```
/// use hog_core::exact::{Svm, Tables, scores};
/// use hog_core::pyramid::Steps;
/// use hog_core::{HogParams, HogSpec, ImageView, Interrupt, model};
/// let spec = HogSpec::new(&HogParams::default())?;
/// let (tables, svm) = (Tables::new(&spec)?, Svm::new(model::default_people(), &spec)?);
/// let image = ImageView::new(&[128; 64 * 128], 64, 128, 1, 64)?;
/// let grid = Steps::new((8, 8), (0, 0), spec.stride, &spec)?.grid(image.size(), &spec);
/// let scores = scores(image, &grid, &spec, &tables, &svm, &Interrupt::NEVER)?;
/// assert_eq!(scores, [f64::from(svm.bias())]); // an even grey has no gradient
/// # Ok::<(), hog_core::HogError>(())
/// ```
pub fn scores(
    image: ImageView,
    grid: &Grid,
    spec: &HogSpec,
    tables: &Tables,
    svm: &Svm,
    interrupt: &Interrupt,
) -> Result<Vec<f64>> {
    if grid.is_empty() || spec.descriptor_len() == 0 {
        return memory::filled(grid.len(), f64::from(svm.bias()));
    }
    let mut scores = memory::with_room(grid.len())?;
    let mut blocks = BlockRows::new(image, grid, spec, tables, interrupt)?;
    for j in 0..grid.windows.height {
        let y = j * grid.stride.height;
        interrupt.check()?;
        blocks.advance(y)?;
        let rows = blocks.rows(y)?;
        scores.extend((0..grid.windows.width).map(|i| svm.score(blocks.window(&rows, i))));
    }
    Ok(scores)
}

/// Some windows of an image, for which the gradient is computed no further than they reach.
pub struct Windows<'a> {
    spec: &'a HogSpec,
    tables: &'a Tables,
    region: Region,
    votes: Votes,
    /// First pixel of each block, and its histograms, in descriptor order.
    firsts: Vec<usize>,
    descriptor: Vec<f32>,
}

impl<'a> Windows<'a> {
    /// Prepares the windows that begin at `places` of the padded image.
    pub fn new(
        image: ImageView,
        padding: Padding,
        places: &[(usize, usize)],
        spec: &'a HogSpec,
        tables: &'a Tables,
        interrupt: &Interrupt,
    ) -> Result<Self> {
        let along = |of: fn(&(usize, usize)) -> usize, win: usize| {
            let first = places.iter().map(of).min().unwrap_or(0);
            (first, places.iter().map(of).max().map_or(0, |last| last + win - first))
        };
        let (x, width) = along(|place| place.0, spec.win.width);
        let (y, height) = along(|place| place.1, spec.win.height);
        let region = Region { x, y, width, height };
        let votes = votes(image, padding, region, spec, tables.kernel, interrupt)?;
        let firsts = memory::with_room(spec.blocks.area())?;
        let descriptor = memory::filled(spec.descriptor_len(), 0.0)?;
        Ok(Self { spec, tables, region, votes, firsts, descriptor })
    }

    /// The descriptor of the window at padded (`x`, `y`), one of those prepared.
    pub fn descriptor(&mut self, (x, y): (usize, usize)) -> &[f32] {
        let Size { width, height } = self.spec.stride;
        let (x, y) = (x - self.region.x, y - self.region.y);
        self.firsts.clear();
        for bx in 0..self.spec.blocks.width {
            let first = |by| (y + by * height) * self.votes.width + x + bx * width;
            self.firsts.extend((0..self.spec.blocks.height).map(first));
        }
        block_histograms(&self.votes, &self.firsts, self.spec, self.tables, &mut self.descriptor);
        &self.descriptor
    }

    /// The score of the window at padded (`x`, `y`), one of those prepared.
    pub fn score(&mut self, at: (usize, usize), svm: &Svm) -> f64 {
        let len = self.spec.block_len;
        svm.score(self.descriptor(at).chunks_exact(len))
    }
}

/// The score of the one window at padded (`x`, `y`).
pub fn window_score(
    image: ImageView,
    padding: Padding,
    at: (usize, usize),
    spec: &HogSpec,
    tables: &Tables,
    svm: &Svm,
    interrupt: &Interrupt,
) -> Result<f64> {
    Ok(Windows::new(image, padding, &[at], spec, tables, interrupt)?.score(at, svm))
}
