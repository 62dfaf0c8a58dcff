//! scikit-image's HOG: the numbers of `skimage.feature.hog`, which are not OpenCV's.
//!
//! 1. Each pixel's gradient is the difference of its neighbours, 0 across the border; of several channels the one with
//!    the longest gradient counts.
//! 2. The pixel votes with the gradient's magnitude for one of `bins` orientations over 180°, in its own cell alone.
//! 3. Blocks of cells, one at each cell, are normalised.
//!
//! Three details decide the last digits, and all are kept: a cell adds its pixels row by row in float32; an angle of
//! -1e-20° becomes 180° and votes for no bin; NaN votes for all bins.
//!
//! The loops over a row are left to the compiler, which `isa` lets use AVX2. A polynomial tells the bin; pixels within a
//! hundred-thousandth of 180° from a bin's bound are decided by `atan2`, as scikit-image decides them.

use crate::error::{ParameterError, Result};
use crate::exact::isa;
use crate::interrupt::Interrupt;
use crate::memory;
use crate::threads::for_each;

mod norm;

pub use norm::Norm;
use norm::normalise;

/// What is computed of images of one size.
///
/// ```
/// use hog_core::Interrupt;
/// use hog_core::skimage::{Layout, Norm};
/// let layout =
///     Layout { size: (16, 16), channels: 1, bins: 9, cell: (8, 8), block: (2, 2), norm: Norm::L2Hys };
/// let image: Vec<u8> = (0..=255).collect();
/// let mut descriptor = vec![0.0; layout.descriptor_len()];
/// layout.describe(&image, 1, &Interrupt::NEVER, &mut descriptor)?;
/// assert_eq!(descriptor.len(), 36);
/// # Ok::<(), hog_core::HogError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Layout {
    /// Rows and columns of an image \[px\].
    pub size: (usize, usize),
    /// Channels of an image, one plane after the other.
    pub channels: usize,
    /// Orientation bins over 180°.
    pub bins: usize,
    /// Rows and columns of a cell \[px\].
    pub cell: (usize, usize),
    /// Rows and columns of a block \[cells\].
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
    fn minus(self, other: Self) -> f64 {
        f64::from(i32::from(self) - i32::from(other))
    }
}

impl Pixel for f32 {
    fn minus(self, other: Self) -> f64 {
        f64::from(self - other)
    }
    fn rounded(magnitude: f64) -> f64 {
        f64::from(magnitude as f32)
    }
}

impl Pixel for f64 {
    fn minus(self, other: Self) -> f64 {
        self - other
    }
}

impl Layout {
    fn cells(&self) -> (usize, usize) {
        (self.size.0 / self.cell.0.max(1), self.size.1 / self.cell.1.max(1))
    }

    /// Rows and columns of blocks; 0 where none fits.
    fn blocks(&self) -> (usize, usize) {
        let (rows, columns) = self.cells();
        ((rows + 1).saturating_sub(self.block.0), (columns + 1).saturating_sub(self.block.1))
    }

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

    /// Writes the descriptors of the images in `pixels`, one after the other: blocks, their cells, bins; all row by row.
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
    pub fn histograms<P: Pixel>(&self, pixels: &[P], interrupt: &Interrupt, out: &mut [f64]) -> Result<()> {
        let (bins, columns) = (Bins::new(self.bins)?, self.cells().1);
        let mut gradients = [Gradients::new(self.size.1)?, Gradients::new(self.size.1)?];
        let mut votes = memory::filled(self.size.1, 0)?;
        let mut totals = memory::filled(columns * self.bins, 0.0_f32)?;
        for (cells, out) in out.chunks_exact_mut(totals.len().max(1)).enumerate() {
            interrupt.check()?;
            totals.fill(0.0);
            for y in cells * self.cell.0..(cells + 1) * self.cell.0 {
                isa::run(VoteRow {
                    layout: self,
                    pixels,
                    y,
                    bins: &bins,
                    gradients: &mut gradients,
                    votes: &mut votes,
                    totals: &mut totals,
                });
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
        let (row, across) = (self.cells().1 * self.bins, self.blocks().1);
        for (index, out) in out.chunks_exact_mut(self.block_len().max(1)).enumerate() {
            let first = index / across * row + index % across * self.bins;
            for (y, out) in out.chunks_exact_mut(self.block.1 * self.bins).enumerate() {
                out.copy_from_slice(&histograms[first + y * row..][..out.len()]);
            }
            normalise(self.norm, out);
        }
    }
}

/// Bounds of the bins [°].
struct Bins {
    bounds: Vec<f64>,
    round: Round,
}

/// The number of bins, and those of 45°, 90° and 135°, which many pixels have exactly.
#[derive(Clone, Copy)]
struct Round {
    count: f64,
    diagonal: f64,
    vertical: f64,
    opposite: f64,
}

impl Bins {
    fn new(bins: usize) -> Result<Self> {
        let width = 180.0 / bins as f64;
        let bounds = memory::collect((0..=bins).map(|bin| width * bin as f64))?;
        let of = |degrees: f64| bounds.iter().skip(1).filter(|&&bound| bound <= degrees).count() as f64;
        let round = Round { count: bins as f64, diagonal: of(45.0), vertical: of(90.0), opposite: of(135.0) };
        Ok(Self { bounds, round })
    }

    /// Adds a pixel's vote as scikit-image does, comparison by comparison.
    #[inline(never)]
    fn vote(&self, across: f64, down: f64, length: f64, totals: &mut [f32]) {
        let degrees = down.atan2(across).to_degrees() % 180.0;
        let degrees = if degrees < 0.0 { degrees + 180.0 } else { degrees };
        for (total, bound) in totals.iter_mut().zip(self.bounds.windows(2)) {
            if !(degrees >= bound[1] || degrees < bound[0]) {
                *total = (f64::from(*total) + length) as f32;
            }
        }
    }
}

/// Gradients of a row of pixels.
struct Gradients {
    across: Vec<f64>,
    down: Vec<f64>,
    lengths: Vec<f64>,
}

impl Gradients {
    fn new(columns: usize) -> Result<Self> {
        let room = || memory::filled(columns, 0.0);
        Ok(Self { across: room()?, down: room()?, lengths: room()? })
    }

    /// Takes the gradients of row `y` of one channel.
    #[inline(always)]
    fn fill<P: Pixel>(&mut self, layout: &Layout, pixels: &[P], y: usize) {
        let (rows, columns) = layout.size;
        let row = |y: usize| &pixels[y * columns..][..columns];
        if y == 0 || y + 1 == rows {
            self.down.fill(0.0);
        } else {
            for ((down, &below), &above) in self.down.iter_mut().zip(row(y + 1)).zip(row(y - 1)) {
                *down = below.minus(above);
            }
        }
        if columns > 2 {
            let (left, right) = (&row(y)[..columns - 2], &row(y)[2..]);
            for ((across, &right), &left) in self.across[1..columns - 1].iter_mut().zip(right).zip(left) {
                *across = right.minus(left);
            }
        }
        for ((&x, &y), length) in self.across.iter().zip(&self.down).zip(&mut self.lengths) {
            *length = hypot(x, y);
        }
        for ((&x, &y), length) in self.across.iter().zip(&self.down).zip(&mut self.lengths) {
            if !RANGE.contains(length) && (x != 0.0 || y != 0.0) {
                *length = x.hypot(y);
            }
        }
    }

    /// Takes the gradients of another channel where they are longer. Of equal ones the first stays; NaN is longest.
    #[inline(always)]
    fn keep_longer<P: Pixel>(&mut self, others: &Self) {
        let own = self.across.iter_mut().zip(&mut self.down).zip(&mut self.lengths);
        let others = others.across.iter().zip(&others.down).zip(&others.lengths);
        for (((across, down), length), ((&other_across, &other_down), &other)) in own.zip(others) {
            let (ours, theirs) = (P::rounded(*length), P::rounded(other));
            let is_longer = (theirs > ours) | (theirs.is_nan() & !ours.is_nan());
            *across = if is_longer { other_across } else { *across };
            *down = if is_longer { other_down } else { *down };
            *length = if is_longer { other } else { *length };
        }
    }
}

/// The votes of row `y`, added to the totals of its cells.
struct VoteRow<'a, P> {
    layout: &'a Layout,
    pixels: &'a [P],
    y: usize,
    bins: &'a Bins,
    /// Room for the gradients: the longest, and the next channel's.
    gradients: &'a mut [Gradients; 2],
    /// Room for the bin that each pixel votes for, `u32::MAX` where the polynomial cannot tell.
    votes: &'a mut [u32],
    totals: &'a mut [f32],
}

impl<P: Pixel> isa::Work for VoteRow<'_, P> {
    type Output = ();

    #[inline(always)]
    fn run<M: isa::MulAdd>(self) {
        let Self { layout, pixels, y, bins, gradients: [longest, next], votes, totals } = self;
        for (channel, pixels) in pixels.chunks_exact(layout.size.0 * layout.size.1).enumerate() {
            if channel == 0 {
                longest.fill(layout, pixels, y);
            } else {
                next.fill(layout, pixels, y);
                longest.keep_longer::<P>(next);
            }
        }
        let Gradients { across, down, lengths } = longest;
        let round = bins.round; // a copy, as the loop could not be vectorised if its stores might change it
        for ((&x, &y), vote) in across.iter().zip(&*down).zip(&mut *votes) {
            *vote = nearest(x, y, round);
        }
        let width = layout.cell.1;
        // Neighbouring pixels mostly vote for one bin, and each addition would wait for the one before: cells in turn.
        for offset in 0..width {
            for (cell, totals) in totals.chunks_exact_mut(layout.bins.max(1)).enumerate() {
                let x = cell * width + offset;
                match totals.get_mut(votes[x] as usize) {
                    Some(total) => *total = (f64::from(*total) + lengths[x]) as f32,
                    None => bins.vote(across[x], down[x], lengths[x], totals),
                }
            }
        }
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
    if root > 0.0 { root - if is_steep { steep } else { flat } / (2.0 * root) } else { 0.0 }
}

/// The bin of the gradient (x, y), or `u32::MAX` close to a bound and outside `RANGE`.
#[inline(always)]
fn nearest(x: f64, y: f64, round: Round) -> u32 {
    /// atan(√z) / √z for z from 0 to 1, ±4e-6.
    const ATAN: [f64; 6] =
        [0.999_995_507, -0.332_988_631, 0.195_589_051, -0.121_109_461, 0.057_330_552, -0.013_422_18];
    /// Added to a number of less than 2^31, it leaves the nearest integer in the lowest bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let (a, b) = (x.abs(), y.abs());
    let (long, short) = if a > b { (a, b) } else { (b, a) };
    let ratio = short / long;
    let z = ratio * ratio;
    let angle = ratio * ATAN.iter().rev().fold(0.0, |sum, &factor| sum * z + factor);
    let half = std::f64::consts::FRAC_PI_2;
    let angle = if b > a { half - angle } else { angle };
    let angle = if (x < 0.0) != (y < 0.0) { 2.0 * half - angle } else { angle };
    let place = angle * (round.count / (2.0 * half));
    let bound = (place + ROUND) - ROUND;
    let bin = if place < bound { bound - 1.0 } else { bound };
    let is_near = (place - bound).abs() < round.count * 1e-5;
    // What lies exactly on an axis or a diagonal is no close call.
    let is_diagonal = a == b;
    let diagonal = if (x < 0.0) == (y < 0.0) { round.diagonal } else { round.opposite };
    let bin = if is_diagonal { diagonal } else { bin };
    let bin = if a == 0.0 { round.vertical } else { bin };
    let bin = if b == 0.0 { 0.0 } else { bin };
    let is_exact = is_diagonal | (a == 0.0) | (b == 0.0);
    let is_inside = ((long >= RANGE.start) & (a + b < RANGE.end)) | (a + b == 0.0);
    let is_told = (is_exact | !is_near) & is_inside;
    (ROUND + if is_told { bin } else { f64::from(u32::MAX) }).to_bits() as u32
}
