//! The exact scalar pipeline of one image: gradient → blocks → windows, every sum in OpenCV's order.
//!
//! It is the specification of the fast path, and the judge of windows whose score is too close to the threshold.

use std::collections::BTreeMap;

use crate::blocks::block_histogram;
use crate::gradient::{Gradient, Region, gradient};
use crate::grid::Grid;
use crate::image::ImageView;
use crate::params::HogSpec;
use crate::svm::Svm;

/// Block histograms of an image, row of blocks by row of blocks, each computed once and dropped when no window
/// further down needs it.
struct BlockRows<'a> {
    spec: &'a HogSpec,
    gradient: Gradient,
    /// Padded x of every block of any window.
    columns: Vec<usize>,
    /// For each window along x and each of its blocks along x: the place in `columns`.
    places: Vec<usize>,
    rows: BTreeMap<usize, Vec<f32>>,
}

impl<'a> BlockRows<'a> {
    fn new(image: ImageView, grid: &Grid, spec: &'a HogSpec) -> Self {
        let of_window =
            |i: usize| (0..spec.blocks.width).map(move |b| i * grid.stride.width + b * spec.stride.width);
        let mut columns: Vec<usize> = (0..grid.windows.width).flat_map(of_window).collect();
        let wanted = columns.clone();
        columns.sort_unstable();
        columns.dedup();
        let places = wanted.iter().map(|x| columns.partition_point(|column| column < x)).collect();
        let gradient = gradient(image, grid.padding(), grid.whole(), spec);
        Self { spec, gradient, columns, places, rows: BTreeMap::new() }
    }

    /// Makes the rows of blocks that windows at padded row `y` need.
    fn advance(&mut self, y: usize) {
        let Self { spec, gradient, columns, rows, .. } = self;
        let mut spare: Vec<Vec<f32>> = Vec::new();
        while let Some(entry) = rows.first_entry().filter(|entry| *entry.key() < y) {
            spare.push(entry.remove());
        }
        for block in 0..spec.blocks.height {
            let y = y + block * spec.stride.height;
            rows.entry(y).or_insert_with(|| {
                let mut row = spare.pop().unwrap_or_default();
                row.resize(columns.len() * spec.block_len, 0.0);
                for (&x, block) in columns.iter().zip(row.chunks_exact_mut(spec.block_len)) {
                    block_histogram(gradient, x, y, spec, block);
                }
                row
            });
        }
    }

    /// Block `index` (in descriptor order: column by column) of window `i` of the row of windows at padded row `y`.
    fn block(&self, y: usize, i: usize, index: usize) -> &[f32] {
        let (bx, by) = (index / self.spec.blocks.height, index % self.spec.blocks.height);
        let at = self.places[i * self.spec.blocks.width + bx] * self.spec.block_len;
        self.rows
            .get(&(y + by * self.spec.stride.height))
            .map_or(&[], |row| &row[at..at + self.spec.block_len])
    }
}

/// The descriptors of all windows, one after the other.
pub fn descriptors(image: ImageView, grid: &Grid, spec: &HogSpec) -> Vec<f32> {
    let mut out = Vec::with_capacity(grid.len() * spec.descriptor_len());
    if spec.descriptor_len() == 0 || grid.is_empty() {
        return out;
    }
    let mut blocks = BlockRows::new(image, grid, spec);
    for j in 0..grid.windows.height {
        let y = j * grid.stride.height;
        blocks.advance(y);
        for i in 0..grid.windows.width {
            for index in 0..spec.blocks.width * spec.blocks.height {
                out.extend_from_slice(blocks.block(y, i, index));
            }
        }
    }
    out
}

/// The scores of all windows, row by row.
pub fn scores(image: ImageView, grid: &Grid, spec: &HogSpec, svm: &Svm) -> Vec<f64> {
    if grid.is_empty() || spec.descriptor_len() == 0 {
        return vec![f64::from(svm.bias()); grid.len()];
    }
    let mut blocks = BlockRows::new(image, grid, spec);
    let mut scores = Vec::with_capacity(grid.len());
    for j in 0..grid.windows.height {
        let y = j * grid.stride.height;
        blocks.advance(y);
        scores.extend(
            (0..grid.windows.width).map(|i| svm.score(spec.block_len, |index| blocks.block(y, i, index))),
        );
    }
    scores
}

/// The descriptor of the one window at padded (`x`, `y`), without computing the rest of the image.
pub fn window_descriptor(image: ImageView, grid: &Grid, (x, y): (usize, usize), spec: &HogSpec) -> Vec<f32> {
    let region = Region { x, y, width: spec.win.width, height: spec.win.height };
    let gradient = gradient(image, grid.padding(), region, spec);
    let mut descriptor = vec![0.0; spec.descriptor_len()];
    for (index, block) in descriptor.chunks_exact_mut(spec.block_len).enumerate() {
        let (bx, by) = (index / spec.blocks.height, index % spec.blocks.height);
        block_histogram(&gradient, bx * spec.stride.width, by * spec.stride.height, spec, block);
    }
    descriptor
}

/// The score of the one window at padded (`x`, `y`).
pub fn window_score(image: ImageView, grid: &Grid, at: (usize, usize), spec: &HogSpec, svm: &Svm) -> f64 {
    let descriptor = window_descriptor(image, grid, at, spec);
    svm.score(spec.block_len, |index| &descriptor[index * spec.block_len..][..spec.block_len])
}
