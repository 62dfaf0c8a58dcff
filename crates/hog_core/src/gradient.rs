//! Stage 1: gamma, derivative, strongest channel, angle, and the two orientation votes of each pixel.
//!
//! The scalar form, equal to OpenCV 4.14's `computeGradient` to the last bit.

use std::ops::Range;

use crate::image::{ImageView, reflect_101};
use crate::params::{HogSpec, Size};
use crate::simd::{MulAdd, Work, polar, run};

/// A part of the padded image, in padded coordinates: image pixel (x, y) is at (x + left, y + top).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Region {
    /// First column.
    pub x: usize,
    /// First row.
    pub y: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// How far the padded image reaches beyond the image [px]; may be negative (a crop).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Padding {
    /// Columns before the first.
    pub left: i64,
    /// Rows before the first.
    pub top: i64,
    /// Columns and rows of the padded image.
    pub size: Size,
}

/// The two votes of each pixel of a region: `shares` weigh `bins`.
#[derive(Debug, Clone, Default)]
pub struct Gradient {
    /// Columns of the region.
    pub width: usize,
    /// Gradient magnitude shared between the two bins, row by row.
    pub shares: Vec<[f32; 2]>,
    /// The two neighbouring orientation bins, row by row.
    pub bins: Vec<[u8; 2]>,
}

/// OpenCV computes angles in runs of this many columns ...
const POLAR_RUN: usize = 1024;
/// ... and a run shorter than this (two vectors) with a differently rounded last step.
const POLAR_VECTOR_MIN: usize = 16;

/// The gradient of `region` of the padded image, as if the whole padded image had been computed.
pub fn gradient(image: ImageView, padding: Padding, region: Region, spec: &HogSpec) -> Gradient {
    let mut out = Gradient::default();
    gradient_into(image, padding, region, spec, &mut out);
    out
}

/// [`gradient`] into memory that is used again.
pub fn gradient_into(image: ImageView, padding: Padding, region: Region, spec: &HogSpec, out: &mut Gradient) {
    out.width = region.width;
    out.shares = vec![[0.0; 2]; region.width * region.height];
    out.bins = vec![[0; 2]; region.width * region.height];
    if region.width > 0 && region.height > 0 {
        run(Rows { image, padding, region, spec, out });
    }
}

struct Rows<'a> {
    image: ImageView<'a>,
    padding: Padding,
    region: Region,
    spec: &'a HogSpec,
    out: &'a mut Gradient,
}

impl Work for Rows<'_> {
    #[inline(always)]
    fn run<M: MulAdd>(self) {
        let Self { image, padding, region, spec, out } = self;
        let source = Source::new(image, padding, region, spec);
        let mut buffer = [(); 4].map(|()| vec![0.0f32; region.width]);
        let [dx, dy, magnitude, angle] = &mut buffer;
        let mut rows = [(); 3].map(|()| vec![0.0; (region.width + 2) * image.channels()]);
        source.fill(0, &mut rows[0]);
        source.fill(1, &mut rows[1]);
        let out = out.shares.chunks_exact_mut(region.width).zip(out.bins.chunks_exact_mut(region.width));
        for (y, (shares, bins)) in out.enumerate() {
            source.fill(y + 2, &mut rows[(y + 2) % 3]);
            let neighbours = [y, y + 1, y + 2].map(|row| rows[row % 3].as_slice());
            if image.channels() == 1 {
                derive_gray(neighbours, dx, dy);
            } else {
                let first_of_tail = (padding.size.width / 4 * 4).saturating_sub(region.x).min(region.width);
                derive_colour::<false>(neighbours, 0..first_of_tail, dx, dy);
                derive_colour::<true>(neighbours, first_of_tail..region.width, dx, dy);
            }
            polar_row::<M>(region.x, padding.size.width, [dx, dy], [magnitude, angle]);
            vote(spec, magnitude, angle, shares, bins);
        }
    }
}

/// What each pixel value stands for: its square root, or itself.
pub(crate) fn gamma_table(gamma_correction: bool) -> [f32; 256] {
    std::array::from_fn(|value| if gamma_correction { (value as f32).sqrt() } else { value as f32 })
}

/// Rows of the padded image with gamma applied, one column and row wider than the region on every side.
struct Source<'a> {
    image: ImageView<'a>,
    gamma: [f32; 256],
    /// Where in an image row each column reads.
    columns: Vec<usize>,
    /// Image row, before mirroring, of the row above the region.
    first: i64,
}

impl<'a> Source<'a> {
    fn new(image: ImageView<'a>, padding: Padding, region: Region, spec: &HogSpec) -> Self {
        let left = region.x as i64 - 1 - padding.left;
        let column = |i: usize| reflect_101(left + i as i64, image.width()) * image.channels();
        Self {
            image,
            gamma: gamma_table(spec.gamma_correction),
            columns: (0..region.width + 2).map(column).collect(),
            first: region.y as i64 - 1 - padding.top,
        }
    }

    /// Writes the channels of row `y`, one after the other.
    #[inline(always)]
    fn fill(&self, y: usize, out: &mut [f32]) {
        let row = self.image.row(reflect_101(self.first + y as i64, self.image.height()));
        for (c, plane) in out.chunks_exact_mut(self.columns.len()).enumerate() {
            for (value, &column) in plane.iter_mut().zip(&self.columns) {
                *value = self.gamma[row[column + c] as usize];
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
    let channels = [0, 1, 2].map(|c| {
        let at = c * plane + first;
        [&here[at..][..len], &here[at + 2..][..len], &above[at + 1..][..len], &below[at + 1..][..len]]
    });
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

/// Magnitude and angle of a row, run by run as the whole padded row would be split.
#[inline(always)]
fn polar_row<M: MulAdd>(
    first_column: usize,
    padded_width: usize,
    [dx, dy]: [&[f32]; 2],
    [magnitude, angle]: [&mut [f32]; 2],
) {
    let end = first_column + dx.len();
    let mut x = first_column;
    while x < end {
        let run_start = x / POLAR_RUN * POLAR_RUN;
        let run_end = (run_start + POLAR_RUN).min(padded_width);
        let part = x - first_column..run_end.min(end) - first_column;
        polar::<M>(
            &dx[part.clone()],
            &dy[part.clone()],
            run_end - run_start >= POLAR_VECTOR_MIN,
            &mut magnitude[part.clone()],
            &mut angle[part],
        );
        x = run_end;
    }
}

/// Splits each gradient between the two bins whose centres are nearest.
#[inline(always)]
fn vote(spec: &HogSpec, magnitude: &[f32], angle: &[f32], shares: &mut [[f32; 2]], bins: &mut [[u8; 2]]) {
    let range = if spec.signed_gradient { 2.0 * std::f64::consts::PI } else { std::f64::consts::PI };
    let bins_per_radian = (spec.nbins as f64 / range) as f32;
    let nbins = spec.nbins as i32;
    let votes = shares.iter_mut().zip(bins);
    for ((magnitude, angle), (shares, bins)) in magnitude.iter().zip(angle).zip(votes) {
        let position = bins_per_radian * angle - 0.5;
        let floor = position.floor();
        let share = position - floor;
        let floor = floor as i32;
        let turn = if floor < 0 { nbins } else { 0 } - if floor >= nbins { nbins } else { 0 };
        let first = floor + turn;
        let second = if first + 1 < nbins { first + 1 } else { 0 };
        *shares = [magnitude * (1.0 - share), magnitude * share];
        *bins = [first as u8, second as u8];
    }
}
