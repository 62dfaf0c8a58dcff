//! Stage 1: gamma, derivative, strongest channel, angle, and the two orientation votes of each pixel.
//!
//! The scalar form, equal to OpenCV 4.14's `computeGradient` to the last bit.

use crate::image::{ImageView, reflect_101};
use crate::params::{HogSpec, Size};
use crate::simd::polar;

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

/// Buffers of one row, kept between rows.
struct RowBuffers {
    dx: Vec<f32>,
    dy: Vec<f32>,
    magnitude: Vec<f32>,
    angle: Vec<f32>,
}

/// The gradient of `region` of the padded image, as if the whole padded image had been computed.
pub fn gradient(image: ImageView, padding: Padding, region: Region, spec: &HogSpec) -> Gradient {
    let mut out = Gradient::default();
    gradient_into(image, padding, region, spec, &mut out);
    out
}

/// [`gradient`] into memory that is used again.
pub fn gradient_into(image: ImageView, padding: Padding, region: Region, spec: &HogSpec, out: &mut Gradient) {
    let lut = gamma_table(spec.gamma_correction);
    let columns: Vec<usize> = (0..region.width + 2)
        .map(|i| reflect_101((region.x + i) as i64 - 1 - padding.left, image.width()) * image.channels())
        .collect();
    let row_at = |y: i64| image.row(reflect_101(y - padding.top, image.height()));
    let mut row = RowBuffers {
        dx: vec![0.0; region.width],
        dy: vec![0.0; region.width],
        magnitude: vec![0.0; region.width],
        angle: vec![0.0; region.width],
    };
    let binning = Binning::new(spec);
    out.width = region.width;
    out.shares.clear();
    out.bins.clear();
    out.shares.reserve(region.width * region.height);
    out.bins.reserve(region.width * region.height);
    for y in region.y as i64..(region.y + region.height) as i64 {
        let rows = [row_at(y - 1), row_at(y), row_at(y + 1)];
        if image.channels() == 1 {
            derive_gray(&lut, &columns, rows, &mut row);
        } else {
            derive_colour(&lut, &columns, rows, region.x, padding.size.width, &mut row);
        }
        polar_row(region.x, padding.size.width, &mut row);
        for (&magnitude, &angle) in row.magnitude.iter().zip(&row.angle) {
            let (shares, bins) = binning.vote(magnitude, angle);
            out.shares.push(shares);
            out.bins.push(bins);
        }
    }
}

/// What each pixel value stands for: its square root, or itself.
pub(crate) fn gamma_table(gamma_correction: bool) -> [f32; 256] {
    std::array::from_fn(|value| if gamma_correction { (value as f32).sqrt() } else { value as f32 })
}

fn derive_gray(lut: &[f32; 256], columns: &[usize], [above, here, below]: [&[u8]; 3], row: &mut RowBuffers) {
    for (i, (dx, dy)) in row.dx.iter_mut().zip(&mut row.dy).enumerate() {
        *dx = lut[here[columns[i + 2]] as usize] - lut[here[columns[i]] as usize];
        *dy = lut[below[columns[i + 1]] as usize] - lut[above[columns[i + 1]] as usize];
    }
}

/// Takes the channel with the largest squared magnitude (two products and a sum, no fused step). Among equals the
/// lowest channel wins, but in the last `padded_width % 4` columns the highest.
fn derive_colour(
    lut: &[f32; 256],
    columns: &[usize],
    [above, here, below]: [&[u8]; 3],
    first_column: usize,
    padded_width: usize,
    row: &mut RowBuffers,
) {
    let tail = padded_width / 4 * 4;
    for (i, (dx, dy)) in row.dx.iter_mut().zip(&mut row.dy).enumerate() {
        let [left, mid, right] = [columns[i], columns[i + 1], columns[i + 2]];
        let of_channel = |c: usize| {
            let dx = lut[here[right + c] as usize] - lut[here[left + c] as usize];
            let dy = lut[below[mid + c] as usize] - lut[above[mid + c] as usize];
            (dx * dx + dy * dy, dx, dy)
        };
        let highest_wins = first_column + i >= tail;
        let mut best = of_channel(0);
        for candidate in [of_channel(1), of_channel(2)] {
            if candidate.0 > best.0 || (highest_wins && candidate.0 == best.0) {
                best = candidate;
            }
        }
        (*dx, *dy) = (best.1, best.2);
    }
}

/// Magnitude and angle of a row, run by run as the whole padded row would be split.
fn polar_row(first_column: usize, padded_width: usize, row: &mut RowBuffers) {
    let end = first_column + row.dx.len();
    let mut x = first_column;
    while x < end {
        let run_start = x / POLAR_RUN * POLAR_RUN;
        let run_end = (run_start + POLAR_RUN).min(padded_width);
        let part = x - first_column..run_end.min(end) - first_column;
        polar(
            &row.dx[part.clone()],
            &row.dy[part.clone()],
            run_end - run_start >= POLAR_VECTOR_MIN,
            &mut row.magnitude[part.clone()],
            &mut row.angle[part],
        );
        x = run_end;
    }
}

/// Splits a gradient between the two bins whose centres are nearest.
struct Binning {
    bins_per_radian: f32,
    nbins: i32,
}

impl Binning {
    fn new(spec: &HogSpec) -> Self {
        let range = if spec.signed_gradient { 2.0 * std::f64::consts::PI } else { std::f64::consts::PI };
        Self { bins_per_radian: (spec.nbins as f64 / range) as f32, nbins: spec.nbins as i32 }
    }

    #[inline]
    fn vote(&self, magnitude: f32, angle: f32) -> ([f32; 2], [u8; 2]) {
        let position = self.bins_per_radian * angle - 0.5;
        let floor = position.floor();
        let share = position - floor;
        let mut first = floor as i32;
        if first < 0 {
            first += self.nbins;
        } else if first >= self.nbins {
            first -= self.nbins;
        }
        let second = if first + 1 < self.nbins { first + 1 } else { 0 };
        ([magnitude * (1.0 - share), magnitude * share], [first as u8, second as u8])
    }
}
