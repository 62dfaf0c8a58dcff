//! `skimage_hog`: the numbers of scikit-image's HOG, for images of any of three number types.

use numpy::{Element, PyArrayMethods, PyReadonlyArray4, PyUntypedArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use hog_core::skimage::{Layout, Norm, Pixel};

use crate::arrays::{Array2, collect, empty};
use crate::calls::{at_work, detached, threads};

/// Orientations, rows and columns of a cell and of a block, and the normalisation as its number.
type Parameters = (usize, (usize, usize), (usize, usize), usize);

/// The descriptors of `images` and, with `directions` (see [`draw`]), the drawing of the first.
#[pyfunction]
#[pyo3(signature = (images, parameters, directions))]
pub(crate) fn skimage_hog<'py>(
    images: &Bound<'py, PyAny>,
    parameters: Parameters,
    directions: Option<Vec<(f64, f64)>>,
) -> PyResult<(Array2<'py, f64>, Option<Array2<'py, f64>>)> {
    let directions = directions.as_deref();
    if let Ok(images) = images.extract::<PyReadonlyArray4<'py, u8>>() {
        of(&images, parameters, directions, |value| value)
    } else if let Ok(images) = images.extract::<PyReadonlyArray4<'py, f64>>() {
        of(&images, parameters, directions, |value| value)
    } else if let Ok(images) = images.extract::<PyReadonlyArray4<'py, f32>>() {
        of(&images, parameters, directions, |value| f64::from(value as f32))
    } else {
        Err(PyTypeError::new_err("images are uint8, float32 or float64 (N, channels, rows, columns)"))
    }
}

fn of<'py, P: Pixel + Element>(
    images: &PyReadonlyArray4<'py, P>,
    (bins, cell, block, norm): Parameters,
    directions: Option<&[(f64, f64)]>,
    rounded: fn(f64) -> f64,
) -> PyResult<(Array2<'py, f64>, Option<Array2<'py, f64>>)> {
    let py = images.py();
    let [count, channels, rows, columns] = *images.shape() else { unreachable!("it has four axes") };
    let norm = [Norm::L1, Norm::L1Sqrt, Norm::L2, Norm::L2Hys][norm.min(3)];
    let layout = Layout { size: (rows, columns), channels, bins, cell, block, norm };
    let pixels = images.as_slice()?;
    let descriptors = empty(py, [count, layout.descriptor_len()])?;
    let mut out = descriptors.readwrite();
    let out = out.as_slice_mut()?;
    let Some(directions) = directions else {
        detached(py, |interrupt| layout.describe(pixels, at_work(threads()), interrupt, out))?;
        return Ok((descriptors, None));
    };
    let drawing = empty(py, [rows, columns])?;
    let mut drawn = drawing.readwrite();
    let drawn = drawn.as_slice_mut()?;
    detached(py, |interrupt| {
        let mut histograms = collect(std::iter::repeat_n(0.0, layout.histograms_len()))?;
        layout.histograms(pixels, interrupt, &mut histograms)?;
        layout.normalised(&histograms, out);
        drawn.fill(0.0);
        draw(&layout, &histograms, directions, rounded, drawn);
        Ok(())
    })?;
    Ok((descriptors, Some(drawing)))
}

/// Draws the histograms of an image's cells: a line for each bin through the cell's middle, as bright as the bin is high.
///
/// `directions` has for each bin how far its line reaches from the middle, rows and columns [px]; less than half a cell.
/// `rounded` is applied to each sum.
fn draw(
    layout: &Layout,
    histograms: &[f64],
    directions: &[(f64, f64)],
    rounded: fn(f64) -> f64,
    out: &mut [f64],
) {
    let ((_, columns), (height, width)) = (layout.size, layout.cell);
    let cells = columns / width;
    for (cell, histogram) in histograms.chunks_exact(layout.bins.max(1)).enumerate() {
        let row = (cell / cells * height + height / 2) as f64;
        let column = (cell % cells * width + width / 2) as f64;
        for (&value, &(down, across)) in histogram.iter().zip(directions) {
            let from = ((row - across) as i64, (column + down) as i64);
            let to = ((row + across) as i64, (column - down) as i64);
            line(from, to, |row, column| {
                // (Lines of cells of one pixel leave the image: there scikit-image fails.)
                if (0..columns as i64).contains(&column)
                    && let Some(pixel) = out.get_mut((row * columns as i64 + column) as usize)
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
