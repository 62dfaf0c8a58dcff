//! scikit-image's HOG: the numbers of `skimage.feature.hog`, which are not OpenCV's.
//!
//! 1. Each pixel's gradient is the difference of its neighbours, 0 across the border; of several channels the one with
//!    the longest gradient counts.
//! 2. The pixel votes with the gradient's magnitude for one of `bins` orientations over 180°, in its own cell alone.
//! 3. Blocks of cells, one at each cell, are normalised.
//!
//! Three details decide the last digits, and all are kept: a cell adds its pixels row by row in float32, whose rounding
//! depends on the order; an angle is compared in degrees, so that -1e-20° becomes 180° and votes for no bin; and NaN
//! votes for all bins.
//!
//! The loops over a row are left to the compiler, which `isa` lets use AVX2. A polynomial tells the bin; pixels within
//! 0.1 % of a bin's width from a bound, 0.2 % of all, are decided by `atan2` as scikit-image decides them.

use crate::error::{ParameterError, Result};
use crate::exact::isa;
use crate::interrupt::Interrupt;
use crate::memory;
use crate::threads::for_each;

/// How a block's numbers are brought to a common size; each adds 1e-5 to the norm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Norm {
    /// Divided by the sum.
    L1,
    /// Divided by the sum, then the square root.
    L1Sqrt,
    /// Divided by the root of the squares' sum.
    L2,
    /// As `L2`, cut off at 0.2, as `L2` again.
    L2Hys,
}

/// What is computed of images of one size.
#[derive(Debug, Clone, Copy)]
pub struct Layout {
    /// Rows and columns of an image [px].
    pub size: (usize, usize),
    /// Channels of an image, one plane after the other.
    pub channels: usize,
    /// Orientation bins over 180°.
    pub bins: usize,
    /// Rows and columns of a cell [px].
    pub cell: (usize, usize),
    /// Rows and columns of a block [cells].
    pub block: (usize, usize),
    /// How blocks are normalised.
    pub norm: Norm,
}

/// The number type of an image, and how scikit-image rounds in it.
pub trait Pixel: Copy + Sync {
    /// `self - other`.
    fn minus(self, other: Self) -> f64;
    /// A magnitude, as channels are compared by.
    fn rounded(magnitude: f64) -> f64 {
        magnitude
    }
}

impl Pixel for u8 {
    #[inline(always)]
    fn minus(self, other: Self) -> f64 {
        f64::from(i32::from(self) - i32::from(other))
    }
}

impl Pixel for f32 {
    #[inline(always)]
    fn minus(self, other: Self) -> f64 {
        f64::from(self - other)
    }
    #[inline(always)]
    fn rounded(magnitude: f64) -> f64 {
        f64::from(magnitude as f32)
    }
}

impl Pixel for f64 {
    #[inline(always)]
    fn minus(self, other: Self) -> f64 {
        self - other
    }
}

impl Layout {
    /// Rows and columns of whole cells.
    fn cells(&self) -> (usize, usize) {
        (self.size.0 / self.cell.0.max(1), self.size.1 / self.cell.1.max(1))
    }

    /// Rows and columns of blocks; 0 where none fits.
    fn blocks(&self) -> (usize, usize) {
        let (rows, columns) = self.cells();
        ((rows + 1).saturating_sub(self.block.0), (columns + 1).saturating_sub(self.block.1))
    }

    /// Numbers of a block.
    fn block_len(&self) -> usize {
        self.block.0 * self.block.1 * self.bins
    }

    /// Numbers of an image's cells.
    pub fn histograms_len(&self) -> usize {
        let (rows, columns) = self.cells();
        rows * columns * self.bins
    }

    /// Numbers of an image's descriptor.
    pub fn descriptor_len(&self) -> usize {
        let (rows, columns) = self.blocks();
        rows * columns * self.block_len()
    }

    /// Writes the descriptors of the images in `pixels`, one after the other, into `out`: of each its blocks row by row,
    /// of a block its cells row by row, of a cell its bins.
    pub fn describe<P: Pixel>(
        &self,
        pixels: &[P],
        threads: usize,
        interrupt: &Interrupt,
        out: &mut [f64],
    ) -> Result<()> {
        let image = (self.size.0 * self.size.1 * self.channels).max(1);
        let (count, elements) = (pixels.len() / image, self.descriptor_len());
        if out.len() != count * elements || !pixels.len().is_multiple_of(image) {
            return Err(ParameterError::Descriptors { windows: count, elements }.into());
        }
        // A thread takes images worth 50 µs at a time.
        let at_once = 8192_usize.div_ceil(image);
        let parts = pixels.chunks(at_once * image).zip(out.chunks_mut((at_once * elements).max(1)));
        for_each(memory::collect(parts)?, threads, interrupt, |(pixels, out), interrupt| {
            let mut histograms = memory::filled(self.histograms_len(), 0.0)?;
            for (pixels, out) in pixels.chunks(image).zip(out.chunks_mut(elements.max(1))) {
                self.histograms(pixels, interrupt, &mut histograms)?;
                self.normalised(&histograms, out);
            }
            Ok(())
        })
    }

    /// Writes the histograms of the cells of one image: row by row, of a cell the mean vote for each bin.
    pub fn histograms<P: Pixel>(
        &self,
        pixels: &[P],
        interrupt: &Interrupt,
        out: &mut [f64],
    ) -> Result<()> {
        let mut row = Row::new(self)?;
        let columns = self.cells().1;
        let mut totals = memory::filled(columns * self.bins, 0.0_f32)?;
        for (cells, out) in out.chunks_exact_mut(totals.len().max(1)).enumerate() {
            interrupt.check()?;
            totals.fill(0.0);
            for y in cells * self.cell.0..(cells + 1) * self.cell.0 {
                isa::run(VoteRow { layout: self, pixels, y, row: &mut row, totals: &mut totals });
            }
            let area = (self.cell.0 * self.cell.1) as f32;
            for (out, total) in out.iter_mut().zip(&totals) {
                *out = f64::from(total / area);
            }
        }
        Ok(())
    }

    /// Writes the blocks of the image whose cells are `histograms`.
    pub fn normalised(&self, histograms: &[f64], out: &mut [f64]) {
        if self.block_len() > 0 {
            isa::run(Normalise { layout: self, histograms, out });
        }
    }
}

/// Bounds of the bins [°], and what the polynomial's bins become.
struct Bins {
    bounds: Vec<f64>,
    /// Bins of 45°, 90° and 135°, which many pixels have exactly.
    diagonal: f64,
    vertical: f64,
    opposite: f64,
}

impl Bins {
    fn new(bins: usize) -> Result<Self> {
        let width = 180.0 / bins as f64;
        let bounds = memory::collect((0..=bins).map(|bin| width * bin as f64))?;
        let of = |degrees: f64| bounds.iter().skip(1).filter(|&&bound| bound <= degrees).count() as f64;
        Ok(Self { diagonal: of(45.0), vertical: of(90.0), opposite: of(135.0), bounds })
    }

    /// Adds a pixel's vote as scikit-image does, comparison by comparison.
    #[inline(never)]
    fn vote(&self, (across, down): (f64, f64), totals: &mut [f32]) {
        let (magnitude, degrees) = (across.hypot(down), down.atan2(across).to_degrees() % 180.0);
        let degrees = if degrees < 0.0 { degrees + 180.0 } else { degrees };
        for (total, bound) in totals.iter_mut().zip(self.bounds.windows(2)) {
            if !(degrees >= bound[1] || degrees < bound[0]) {
                *total = (f64::from(*total) + magnitude) as f32;
            }
        }
    }
}

/// Room for a row of pixels.
struct Row {
    bins: Bins,
    /// The gradients; of several channels those of the longest so far, and those of the next.
    across: Vec<f64>,
    down: Vec<f64>,
    longest: Vec<f64>,
    other_across: Vec<f64>,
    other_down: Vec<f64>,
    magnitudes: Vec<f64>,
    /// The bin a pixel votes for; `u32::MAX` where the polynomial cannot tell.
    votes: Vec<u32>,
}

impl Row {
    fn new(layout: &Layout) -> Result<Self> {
        let room = || memory::filled(layout.size.1, 0.0);
        Ok(Self {
            bins: Bins::new(layout.bins)?,
            across: room()?,
            down: room()?,
            longest: room()?,
            other_across: room()?,
            other_down: room()?,
            magnitudes: room()?,
            votes: memory::filled(layout.size.1, 0)?,
        })
    }

    /// Puts the next channel's gradients where they are longer. Of equal ones the first stays; NaN is longest.
    #[inline(always)]
    fn keep_longer(&mut self) {
        let others = self.other_across.iter().zip(&self.other_down).zip(&self.magnitudes);
        let kept = self.across.iter_mut().zip(&mut self.down).zip(&mut self.longest);
        for (((across, down), longest), ((&other_across, &other_down), &length)) in kept.zip(others) {
            let is_longer = length > *longest || (length.is_nan() && !longest.is_nan());
            *across = if is_longer { other_across } else { *across };
            *down = if is_longer { other_down } else { *down };
            *longest = if is_longer { length } else { *longest };
        }
    }
}

/// The votes of row `y`, added to the totals of its cells.
struct VoteRow<'a, P> {
    layout: &'a Layout,
    pixels: &'a [P],
    y: usize,
    row: &'a mut Row,
    totals: &'a mut [f32],
}

impl<P: Pixel> isa::Work for VoteRow<'_, P> {
    type Output = ();

    #[inline(always)]
    fn run<M: isa::MulAdd>(self) {
        let Self { layout, pixels, y, row, totals } = self;
        let plane = layout.size.0 * layout.size.1;
        differences(layout, &pixels[..plane], y, &mut row.across, &mut row.down);
        if layout.channels > 1 {
            lengths::<P>(&row.across, &row.down, &mut row.longest);
            for channel in 1..layout.channels {
                let pixels = &pixels[channel * plane..][..plane];
                differences(layout, pixels, y, &mut row.other_across, &mut row.other_down);
                lengths::<P>(&row.other_across, &row.other_down, &mut row.magnitudes);
                row.keep_longer();
            }
        }
        let Row { bins, across, down, magnitudes, votes, .. } = row;
        for (((&x, &y), magnitude), vote) in across.iter().zip(&*down).zip(&mut *magnitudes).zip(&mut *votes) {
            *magnitude = hypot(x, y);
            *vote = nearest(x, y, bins);
        }
        let width = layout.cell.1;
        // Neighbouring pixels mostly vote for one bin, and each addition would wait for the one before: cells in turn.
        for offset in 0..width {
            for (cell, totals) in totals.chunks_exact_mut(layout.bins.max(1)).enumerate() {
                let x = cell * width + offset;
                match totals.get_mut(votes[x] as usize) {
                    Some(total) => *total = (f64::from(*total) + magnitudes[x]) as f32,
                    None => bins.vote((across[x], down[x]), totals),
                }
            }
        }
    }
}

/// The gradients of row `y` of one channel.
#[inline(always)]
fn differences<P: Pixel>(layout: &Layout, pixels: &[P], y: usize, across: &mut [f64], down: &mut [f64]) {
    let (rows, columns) = layout.size;
    let row = |y: usize| &pixels[y * columns..][..columns];
    if y == 0 || y + 1 == rows {
        down.fill(0.0);
    } else {
        for ((down, &below), &above) in down.iter_mut().zip(row(y + 1)).zip(row(y - 1)) {
            *down = below.minus(above);
        }
    }
    across.fill(0.0);
    let here = row(y);
    for ((across, &right), &left) in across.iter_mut().skip(1).zip(here.iter().skip(2)).zip(here) {
        *across = right.minus(left);
    }
}

/// The lengths by which channels are compared.
#[inline(always)]
fn lengths<P: Pixel>(across: &[f64], down: &[f64], lengths: &mut [f64]) {
    for ((&x, &y), length) in across.iter().zip(down).zip(&mut *lengths) {
        *length = hypot(x, y);
    }
    for ((&x, &y), length) in across.iter().zip(down).zip(lengths) {
        if !RANGE.contains(length) && (x != 0.0 || y != 0.0) {
            *length = x.hypot(y);
        }
        *length = P::rounded(*length);
    }
}

/// Where neither squares nor quotients leave the range of numbers.
const RANGE: std::ops::Range<f64> = 1e-140..1e140;

/// The length of (x, y), rounded as by `f64::hypot` in `RANGE`: the root of the squares' sum with a correction, after
/// Borges, "An Improved Algorithm for hypot(a,b)" (2019).
#[inline(always)]
fn hypot(x: f64, y: f64) -> f64 {
    let (a, b) = (x.abs(), y.abs());
    let (long, short) = if a > b { (a, b) } else { (b, a) };
    let root = (long * long + short * short).sqrt();
    let is_steep = root <= 2.0 * short;
    let rest = root - if is_steep { short } else { long };
    let steep = long * (2.0 * rest - long) + (rest - 2.0 * (long - short)) * rest;
    let flat = 2.0 * rest * (long - 2.0 * short) + ((4.0 * rest - short) * short + rest * rest);
    let excess = if is_steep { steep } else { flat };
    if root > 0.0 { root - excess / (2.0 * root) } else { 0.0 }
}

/// The bin of the gradient (x, y), or `u32::MAX` within 0.1 % of a bin from a bound, and outside `RANGE`.
#[inline(always)]
fn nearest(x: f64, y: f64, bins: &Bins) -> u32 {
    /// atan(√z) / √z for z from 0 to 1, ±4e-6.
    const ATAN: [f64; 6] =
        [0.999_995_507, -0.332_988_631, 0.195_589_051, -0.121_109_461, 0.057_330_552, -0.013_422_18];
    /// Added to a number of less than 2^31, it leaves the nearest integer in the lowest bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let (a, b) = (x.abs(), y.abs());
    let (long, short) = if a > b { (a, b) } else { (b, a) };
    let ratio = short / long;
    let z = ratio * ratio;
    let series = ATAN.iter().rev().fold(0.0, |sum, &factor| sum * z + factor);
    let angle = ratio * series;
    let half = std::f64::consts::FRAC_PI_2;
    let angle = if b > a { half - angle } else { angle };
    let angle = if (x < 0.0) != (y < 0.0) { 2.0 * half - angle } else { angle };
    let count = (bins.bounds.len() - 1) as f64;
    let place = angle * (count / (2.0 * half));
    let bound = (place + ROUND) - ROUND;
    let bin = if place < bound { bound - 1.0 } else { bound };
    let is_near = (place - bound).abs() < count * 1e-5;
    // What lies exactly on an axis or a diagonal is no close call.
    let is_diagonal = a == b;
    let diagonal = if (x < 0.0) == (y < 0.0) { bins.diagonal } else { bins.opposite };
    let bin = if is_diagonal { diagonal } else { bin };
    let bin = if a == 0.0 { bins.vertical } else { bin };
    let bin = if b == 0.0 { 0.0 } else { bin };
    let is_exact = is_diagonal || a == 0.0 || b == 0.0;
    let is_inside = long >= RANGE.start && a + b < RANGE.end;
    let is_told = (is_exact || !is_near) && (is_inside || a + b == 0.0);
    let told = if is_told { bin } else { f64::from(u32::MAX) };
    (told + ROUND).to_bits() as u32
}

/// The blocks of an image, normalised.
struct Normalise<'a> {
    layout: &'a Layout,
    histograms: &'a [f64],
    out: &'a mut [f64],
}

impl isa::Work for Normalise<'_> {
    type Output = ();

    #[inline(always)]
    fn run<M: isa::MulAdd>(self) {
        let Self { layout, histograms, out } = self;
        let (columns, bins) = (layout.cells().1, layout.bins);
        let across = layout.blocks().1;
        for (index, out) in out.chunks_exact_mut(layout.block_len()).enumerate() {
            let first = (index / across * columns + index % across) * bins;
            for (row, out) in out.chunks_exact_mut(layout.block.1 * bins).enumerate() {
                out.copy_from_slice(&histograms[first + row * columns * bins..][..out.len()]);
            }
            normalise(layout.norm, out);
        }
    }
}

/// Added to a norm, so that a block without gradients is 0.
const EPSILON: f64 = 1e-5;

#[inline(always)]
fn normalise(norm: Norm, block: &mut [f64]) {
    match norm {
        Norm::L1 | Norm::L1Sqrt => {
            let factor = 1.0 / (sum(block, |value| value) + EPSILON);
            block.iter_mut().for_each(|value| *value *= factor);
            if norm == Norm::L1Sqrt {
                block.iter_mut().for_each(|value| *value = value.sqrt());
            }
        }
        Norm::L2 | Norm::L2Hys => {
            let scale = |block: &[f64]| {
                1.0 / (sum(block, |value| value * value) + EPSILON * EPSILON).sqrt()
            };
            let factor = scale(block);
            block.iter_mut().for_each(|value| *value *= factor);
            if norm == Norm::L2Hys {
                // (NaN stays, as `min` would not let it.)
                block.iter_mut().for_each(|value| *value = if *value > 0.2 { 0.2 } else { *value });
                let factor = scale(block);
                block.iter_mut().for_each(|value| *value *= factor);
            }
        }
    }
}

/// The sum over a block, eight numbers at a time.
#[inline(always)]
fn sum(block: &[f64], of: impl Fn(f64) -> f64) -> f64 {
    let (eights, rest) = block.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for eight in eights {
        for (sum, &value) in sums.iter_mut().zip(eight) {
            *sum += of(value);
        }
    }
    sums.iter().sum::<f64>() + rest.iter().map(|&value| of(value)).sum::<f64>()
}

/// Draws the histograms of an image's cells: a line for each bin through the cell's middle, as bright as the bin is high.
///
/// `directions` has for each bin how far its line reaches from the middle, rows and columns [px]; less than half a cell.
/// `rounded` is applied to each sum.
pub fn draw(
    layout: &Layout,
    histograms: &[f64],
    directions: &[(f64, f64)],
    rounded: fn(f64) -> f64,
    out: &mut [f64],
) {
    let ((_, columns), (height, width)) = (layout.cells(), layout.cell);
    for (cell, histogram) in histograms.chunks_exact(layout.bins.max(1)).enumerate() {
        let row = (cell / columns * height + height / 2) as f64;
        let column = (cell % columns * width + width / 2) as f64;
        for (&value, &(down, across)) in histogram.iter().zip(directions) {
            let from = ((row - across) as i64, (column + down) as i64);
            let to = ((row + across) as i64, (column - down) as i64);
            line(from, to, |row, column| {
                // (Lines of cells of one pixel leave the image: there scikit-image fails.)
                if (0..layout.size.1 as i64).contains(&column)
                    && let Some(pixel) = out.get_mut((row * layout.size.1 as i64 + column) as usize)
                {
                    *pixel = rounded(*pixel + value);
                }
            });
        }
    }
}

/// The pixels of a line, after Bresenham.
fn line(from: (i64, i64), to: (i64, i64), mut visit: impl FnMut(i64, i64)) {
    let (down, across) = ((to.0 - from.0).abs(), (to.1 - from.1).abs());
    let (steps, rises) = (down.max(across), down.min(across));
    let step = ((to.0 - from.0).signum(), (to.1 - from.1).signum());
    let (mut row, mut column) = from;
    let mut lag = 2 * rises - steps;
    for _ in 0..steps {
        visit(row, column);
        let is_due = lag >= 0;
        lag += 2 * rises - if is_due { 2 * steps } else { 0 };
        row += if is_due || down > across { step.0 } else { 0 };
        column += if is_due || down <= across { step.1 } else { 0 };
    }
    visit(to.0, to.1);
}
