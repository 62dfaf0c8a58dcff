//! `skimage_hog`: the numbers of scikit-image's HOG, for images of any of three number types.

use numpy::{Element, PyArray2, PyArrayMethods, PyReadonlyArray4, PyUntypedArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use super::arrays::empty;
use super::{at_work, detached, threads};
use crate::skimage::{Layout, Norm, Pixel, draw};

type Array2<'py> = Bound<'py, PyArray2<f64>>;

/// Orientations, rows and columns of a cell and of a block, and the normalisation as its number.
type Parameters = (usize, (usize, usize), (usize, usize), usize);

/// The descriptors of `images` and, with `directions` (see [`draw`]), the drawing of the first.
#[pyfunction]
#[pyo3(signature = (images, parameters, directions))]
pub(super) fn skimage_hog<'py>(
    images: &Bound<'py, PyAny>,
    parameters: Parameters,
    directions: Option<Vec<(f64, f64)>>,
) -> PyResult<(Array2<'py>, Option<Array2<'py>>)> {
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
) -> PyResult<(Array2<'py>, Option<Array2<'py>>)> {
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
        let mut histograms = crate::memory::filled(layout.histograms_len(), 0.0)?;
        layout.histograms(pixels, interrupt, &mut histograms)?;
        layout.normalised(&histograms, out);
        drawn.fill(0.0);
        draw(&layout, &histograms, directions, rounded, drawn);
        Ok(())
    })?;
    Ok((descriptors, Some(drawing)))
}
