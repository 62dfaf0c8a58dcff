//! Stage 1: gamma, derivative, strongest channel, angle, and the two orientation votes of each pixel.
//!
//! Equal to OpenCV 4.14's `computeGradient` to the last bit, by loops and, where the CPU has them, by kernels.

use std::ops::Range;

use crate::error::Result;
use crate::geometry::{Padding, Region, Size};
use crate::image::{ImageView, reflect_101};
use crate::interrupt::Interrupt;
use crate::memory;
use crate::params::HogSpec;

use super::isa::{MulAdd, Work, run};
use super::kernel::{RowKernel, RowVotes, Turn};
use super::polar::polar;

/// A pixel's two votes: `shares` for `bins`.
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(16))]
pub(super) struct Vote {
    /// Gradient magnitude shared between the two bins.
    pub shares: [f32; 2],
    /// The two neighbouring orientation bins.
    pub bins: [u8; 2],
}

/// The votes of the pixels of a region.
#[derive(Debug, Clone, Default)]
pub(super) struct Votes {
    /// Columns of the region.
    pub width: usize,
    /// Row by row.
    pub pixels: Vec<Vote>,
}

/// OpenCV computes angles in runs of this many columns ...
const POLAR_RUN: usize = 1024;
/// ... and a run shorter than this (two vectors) with a differently rounded last step.
const POLAR_VECTOR_MIN: usize = 16;

/// Pixels whose channels are split at a time.
const SPLIT: usize = 128;

/// How many rows are made between two looks at the interrupt: a look takes as long as ten pixels.
const CHECK_EVERY: usize = 16;

/// The gradient of the whole padded image as OpenCV returns it, into `out`, which has a place for each pixel.
pub(crate) fn gradient(
    image: ImageView,
    padding: Padding,
    spec: &HogSpec,
    kernel: &dyn RowKernel,
    interrupt: &Interrupt,
    out: RowVotes,
) -> Result<()> {
    let Size { width, height } = padding.size;
    let mut shares = out.shares.chunks_exact_mut(width);
    let mut bins = out.bins.chunks_exact_mut(width);
    let mut next =
        || RowVotes { shares: shares.next().unwrap_or_default(), bins: bins.next().unwrap_or_default() };
    let first = next();
    let region = Region { x: 0, y: 0, width, height };
    run(Rows::new(image, padding, region, spec, kernel, interrupt, first, &mut |_, row| *row = next())?)
}

/// The votes of `region` of the padded image, as if the whole padded image had been computed.
pub(super) fn votes(
    image: ImageView,
    padding: Padding,
    region: Region,
    spec: &HogSpec,
    kernel: &dyn RowKernel,
    interrupt: &Interrupt,
) -> Result<Votes> {
    let mut pixels = memory::with_room(region.width.saturating_mul(region.height))?;
    let mut put = |_, row: &RowVotes| {
        let votes = row.shares.iter().zip(&*row.bins);
        pixels.extend(votes.map(|(&shares, &bins)| Vote { shares, bins }));
    };
    each_row(image, padding, region, spec, kernel, interrupt, &mut put)?;
    Ok(Votes { width: region.width, pixels })
}

/// Hands the votes of a region to `put`, row by row, with the number of each.
pub(crate) fn each_row(
    image: ImageView,
    padding: Padding,
    region: Region,
    spec: &HogSpec,
    kernel: &dyn RowKernel,
    interrupt: &Interrupt,
    put: &mut dyn FnMut(usize, &RowVotes),
) -> Result<()> {
    let mut shares = memory::filled(region.width, [0.0; 2])?;
    let mut bins = memory::filled(region.width, [0; 2])?;
    let row = RowVotes { shares: &mut shares, bins: &mut bins };
    run(Rows::new(image, padding, region, spec, kernel, interrupt, row, &mut |y, row| put(y, row))?)
}

/// The work of [`each_row`] and [`gradient`], and its memory.
struct Rows<'a, 'b> {
    padding: Padding,
    region: Region,
    turn: Turn,
    kernel: &'a dyn RowKernel,
    interrupt: &'a Interrupt<'a>,
    /// Where the votes of a row go.
    votes: RowVotes<'b>,
    /// Takes them, with the row's number, and may change where those of the next one go.
    put: &'a mut dyn FnMut(usize, &mut RowVotes<'b>),
    source: Source<'a>,
    /// Of one row: derivatives along x and y, then magnitude and angle.
    lines: [Vec<f32>; 2],
    /// Three neighbouring rows of the padded image.
    padded: [Vec<f32>; 3],
}

impl<'a, 'b> Rows<'a, 'b> {
    #[allow(clippy::too_many_arguments, reason = "they are its fields, and what others are made of")]
    fn new(
        image: ImageView<'a>,
        padding: Padding,
        region: Region,
        spec: &HogSpec,
        kernel: &'a dyn RowKernel,
        interrupt: &'a Interrupt<'a>,
        votes: RowVotes<'b>,
        put: &'a mut dyn FnMut(usize, &mut RowVotes<'b>),
    ) -> Result<Self> {
        let range = if spec.signed_gradient { 2.0 * std::f64::consts::PI } else { std::f64::consts::PI };
        let turn = Turn { bins: spec.nbins as f32, bins_per_radian: (spec.nbins as f64 / range) as f32 };
        let source = Source::new(image, padding, region, spec)?;
        let line = || memory::filled(region.width, 0.0f32);
        let padded = || memory::filled((region.width + 2) * image.channels(), 0.0f32);
        let (lines, padded) = ([line()?, line()?], [padded()?, padded()?, padded()?]);
        Ok(Self { padding, region, turn, kernel, interrupt, votes, put, source, lines, padded })
    }
}

impl Work for Rows<'_, '_> {
    type Output = Result<()>;

    #[inline(always)]
    fn run<M: MulAdd>(self) -> Result<()> {
        let Self { padding, region, turn, kernel, interrupt, mut votes, put, source, lines, padded } = self;
        let ([mut dx, mut dy], mut rows) = (lines, padded);
        let (width, whole) = (region.width, padding.size.width);
        if width == 0 {
            return Ok(());
        }
        // Columns where the lowest channel wins among equals, and where angles are rounded as in vectors.
        let until = |column: usize| column.saturating_sub(region.x).min(width);
        let is_colour = source.image.channels() == 3;
        let first_of_tail = if is_colour { until(whole / 4 * 4) } else { width };
        let last_run = whole % POLAR_RUN;
        let vectors = if last_run < POLAR_VECTOR_MIN { until(whole - last_run) } else { width };
        source.fill(kernel, 0, &mut rows[0]);
        source.fill(kernel, 1, &mut rows[1]);
        for y in 0..region.height {
            if y.is_multiple_of(CHECK_EVERY) {
                interrupt.check()?;
            }
            source.fill(kernel, y + 2, &mut rows[(y + 2) % 3]);
            let neighbours = [y, y + 1, y + 2].map(|row| rows[row % 3].as_slice());
            let made =
                kernel.votes(neighbours, first_of_tail.min(vectors), turn, [&mut dx, &mut dy], &mut votes);
            if made < width {
                if is_colour {
                    derive_colour::<false>(neighbours, made..first_of_tail.max(made), &mut dx, &mut dy);
                    derive_colour::<true>(neighbours, first_of_tail.max(made)..width, &mut dx, &mut dy);
                } else {
                    derive_gray(neighbours.map(|row| &row[made..]), &mut dx[made..], &mut dy[made..]);
                }
                polar_row::<M>(region.x + made, whole, &mut dx[made..], &mut dy[made..]);
                let (shares, bins) = (&mut votes.shares[made..], &mut votes.bins[made..]);
                vote(turn, &dx[made..], &dy[made..], &mut RowVotes { shares, bins });
            }
            put(y, &mut votes);
        }
        Ok(())
    }
}

/// Rows of the padded image with gamma applied, one column and row wider than the region on every side.
struct Source<'a> {
    image: ImageView<'a>,
    gamma_correction: bool,
    /// Columns, and image row before mirroring, of the upper left corner.
    width: usize,
    left: i64,
    top: i64,
    /// Columns that lie in the image.
    inside: Range<usize>,
    /// Columns so far outside that what they mirror is no column of the region, and the pixels that they read.
    beyond: Vec<(usize, usize)>,
}

impl<'a> Source<'a> {
    fn new(image: ImageView<'a>, padding: Padding, region: Region, spec: &HogSpec) -> Result<Self> {
        let left = region.x as i64 - 1 - padding.left;
        let width = region.width + 2;
        let within = |x: i64| x.clamp(0, width as i64) as usize;
        let inside = within(-left)..within(image.width() as i64 - left);
        let outside = (0..inside.start).chain(inside.end..width);
        let beyond =
            outside.filter(|&i| i + inside.len() <= inside.start || i + 1 >= inside.end + inside.len());
        Ok(Self {
            image,
            gamma_correction: spec.gamma_correction,
            width,
            left,
            top: region.y as i64 - 1 - padding.top,
            beyond: memory::collect(beyond.map(|i| (i, reflect_101(left + i as i64, image.width()))))?,
            inside,
        })
    }

    /// Writes the channels of row `y`, one after the other.
    #[inline(always)]
    fn fill(&self, kernel: &dyn RowKernel, y: usize, out: &mut [f32]) {
        if self.gamma_correction {
            let roots = |pixels: &[u8], to: &mut [f32]| kernel.roots(pixels, to);
            self.fill_with(y, out, |pixel| f32::from(pixel).sqrt(), roots);
        } else {
            self.fill_with(y, out, f32::from, |_, _| false);
        }
    }

    /// As `value` makes numbers of pixels; `values` may make many at once.
    #[inline(always)]
    fn fill_with(
        &self,
        y: usize,
        out: &mut [f32],
        value: impl Fn(u8) -> f32,
        values: impl Fn(&[u8], &mut [f32]) -> bool,
    ) {
        let Self { image, width, .. } = self;
        let row = image.row(reflect_101(self.top + y as i64, image.height()));
        // (A region may lie beyond the image altogether.)
        let first = (self.left + self.inside.start as i64).clamp(0, image.width() as i64) as usize;
        if image.channels() == 3 {
            let pixels = &row.as_chunks::<3>().0[first..];
            for (part, pixels) in pixels[..self.inside.len()].chunks(SPLIT).enumerate() {
                // Split as bytes, then converted: only so does the compiler vectorise both.
                let mut split = [[0u8; SPLIT]; 3];
                let [blue, green, red] = &mut split;
                for (((b, g), r), pixel) in blue.iter_mut().zip(green).zip(red).zip(pixels) {
                    [*b, *g, *r] = *pixel;
                }
                for (plane, split) in out.chunks_exact_mut(*width).zip(&split) {
                    let plane = &mut plane[self.inside.start + part * SPLIT..][..pixels.len()];
                    if !values(&split[..plane.len()], plane) {
                        plane.iter_mut().zip(split).for_each(|(to, &pixel)| *to = value(pixel));
                    }
                }
            }
        } else {
            let (inside, pixels) = (&mut out[self.inside.clone()], &row[first..][..self.inside.len()]);
            if !values(pixels, inside) {
                inside.iter_mut().zip(pixels).for_each(|(to, &pixel)| *to = value(pixel));
            }
        }
        for (c, plane) in out.chunks_exact_mut(*width).enumerate() {
            let (left, rest) = plane.split_at_mut(self.inside.start);
            let (made, right) = rest.split_at_mut(self.inside.len());
            left.iter_mut().rev().zip(made.iter().skip(1)).for_each(|(to, from)| *to = *from);
            right.iter_mut().zip(made.iter().rev().skip(1)).for_each(|(to, from)| *to = *from);
            for &(to, from) in &self.beyond {
                plane[to] = value(row[from * image.channels() + c]);
            }
        }
    }
}

#[inline(always)]
fn derive_gray([above, here, below]: [&[f32]; 3], dx: &mut [f32], dy: &mut [f32]) {
    let horizontal = here.iter().zip(&here[2..]);
    let vertical = above[1..].iter().zip(&below[1..]);
    for ((dx, dy), ((left, right), (up, down))) in dx.iter_mut().zip(dy).zip(horizontal.zip(vertical)) {
        (*dx, *dy) = (right - left, down - up);
    }
}

/// Takes the channel with the largest squared magnitude (two products and a sum, no fused step). Among equals the
/// lowest channel wins, but in the last `padded_width % 4` columns the highest.
#[inline(always)]
fn derive_colour<const HIGHEST_WINS: bool>(
    [above, here, below]: [&[f32]; 3],
    columns: Range<usize>,
    dx: &mut [f32],
    dy: &mut [f32],
) {
    let plane = here.len() / 3;
    let (first, len) = (columns.start, columns.len());
    let (dx, dy) = (&mut dx[columns.clone()], &mut dy[columns]);
    let neighbours = |c: usize| {
        let at = c * plane + first;
        [&here[at..][..len], &here[at + 2..][..len], &above[at + 1..][..len], &below[at + 1..][..len]]
    };
    let channels = [neighbours(0), neighbours(1), neighbours(2)];
    for i in 0..len {
        let of_channel = |c: usize| {
            let [left, right, up, down] = channels[c];
            let (dx, dy) = (right[i] - left[i], down[i] - up[i]);
            (dx * dx + dy * dy, dx, dy)
        };
        let mut best = of_channel(0);
        for candidate in [of_channel(1), of_channel(2)] {
            if candidate.0 > best.0 || (HIGHEST_WINS && candidate.0 == best.0) {
                best = candidate;
            }
        }
        (dx[i], dy[i]) = (best.1, best.2);
    }
}

/// Makes magnitude and angle of a row's gradients, run by run as the whole padded row would be split.
#[inline(always)]
fn polar_row<M: MulAdd>(first_column: usize, padded_width: usize, dx: &mut [f32], dy: &mut [f32]) {
    let end = first_column + dx.len();
    let mut x = first_column;
    while x < end {
        let run_start = x / POLAR_RUN * POLAR_RUN;
        let run_end = (run_start + POLAR_RUN).min(padded_width);
        let part = x - first_column..run_end.min(end) - first_column;
        polar::<M>(&mut dx[part.clone()], &mut dy[part], run_end - run_start >= POLAR_VECTOR_MIN);
        x = run_end;
    }
}

/// Splits each gradient between the two bins whose centres are nearest.
#[inline(always)]
fn vote(turn: Turn, magnitude: &[f32], angle: &[f32], votes: &mut RowVotes) {
    let Turn { bins: nbins, bins_per_radian } = turn;
    let votes = votes.shares.iter_mut().zip(&mut *votes.bins);
    for ((magnitude, angle), (shares, bins)) in magnitude.iter().zip(angle).zip(votes) {
        let position = bins_per_radian * angle - 0.5;
        let floor = position.floor();
        let share = position - floor;
        let turn = if floor < 0.0 { nbins } else { 0.0 } - if floor >= nbins { nbins } else { 0.0 };
        let first = floor + turn;
        let second = if first + 1.0 < nbins { first + 1.0 } else { 0.0 };
        *shares = [magnitude * (1.0 - share), magnitude * share];
        *bins = [byte(first), byte(second)];
    }
}

/// A whole number of 0..=255 as a byte. (A cast checks for other numbers and is not vectorised.)
#[inline(always)]
fn byte(whole: f32) -> u8 {
    const LAST_BIT_IS_ONE: f32 = (1 << 23) as f32;
    (whole + LAST_BIT_IS_ONE).to_bits() as u8
}

#[cfg(test)]
mod tests {
    use super::super::kernel::Loops;
    use super::*;
    use crate::fast::{Backend, row_kernel};
    use crate::params::HogParams;

    #[test]
    fn a_region_votes_as_it_does_in_the_whole_image_by_loops_and_by_every_kernel() {
        let spec = HogSpec::new(&HogParams::default()).unwrap();
        let data: Vec<u8> = (0..3 * 1030 * 2).map(|i| (i * i % 251) as u8).collect();
        let available = Backend::ALL.into_iter().filter(|backend| backend.is_available());
        let kernels = std::iter::once(&Loops as &dyn RowKernel).chain(available.map(row_kernel));
        for (kernel, channels) in kernels.flat_map(|kernel| [(kernel, 1), (kernel, 3)]) {
            for (width, height, step) in [(1, 1, 1), (1, 9, 1), (5, 3, 1), (20, 5, 1), (1030, 2, 97)] {
                let image = ImageView::new(&data, width, height, channels, width * channels).unwrap();
                let padding = Padding { left: 12, top: 3, size: Size::new(width + 30, height + 6) };
                let Size { width, height } = padding.size;
                let all = Region { x: 0, y: 0, width, height };
                let never = &Interrupt::NEVER;
                let whole = votes(image, padding, all, &spec, &Loops, never).unwrap();
                for x in (0..width).step_by(step) {
                    let region = Region { x, y: 2, width: width - x, height: 2 };
                    let part = votes(image, padding, region, &spec, kernel, never).unwrap();
                    for (i, vote) in part.pixels.iter().enumerate() {
                        let there = whole.pixels[(2 + i / part.width) * width + x + i % part.width];
                        let at = (width, x, i % part.width);
                        assert_eq!((vote.shares, vote.bins), (there.shares, there.bins), "{kernel:?} {at:?}");
                    }
                }
            }
        }
    }
}
