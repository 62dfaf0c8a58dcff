//! The Python module `limo_hog._core`: reads arguments, releases the GIL, calls, wraps, maps errors. Nothing else.

mod arrays;
mod calls;
mod canvas;
mod errors;
mod hog;
mod second;
mod skimage;

use std::sync::atomic::Ordering;

use hog_core::error::ParameterError;
use hog_core::{Backend, Rect};
use numpy::{PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyOverflowError;
use pyo3::prelude::*;

use crate::arrays::{Array1, Array2, Pixels, array1, collect, rect_array, size};
use crate::calls::{THREADS, THREADS_MAX, detached, threads};
use crate::errors::{raised, raised_as};

#[pymodule(gil_used = false)]
mod _core {
    use super::*;

    #[pymodule_export]
    use crate::canvas::Canvas;
    #[pymodule_export]
    use crate::hog::Hog;
    #[pymodule_export]
    use crate::second::SecondLook;
    #[pymodule_export]
    use crate::skimage::skimage_hog;

    #[pyfunction]
    fn group_rectangles<'py>(
        py: Python<'py>,
        rects: Vec<[i32; 4]>,
        threshold: i32,
        eps: f64,
    ) -> PyResult<(Array2<'py, i32>, Array1<'py, i32>)> {
        let rect = |[x, y, width, height]: [i32; 4]| Rect { x, y, width, height };
        let found = detached(py, |interrupt| {
            let rects = collect(rects.into_iter().map(rect))?;
            hog_core::group::group_rectangles(&rects, threshold, eps, interrupt)
        })?;
        Ok((rect_array(py, &found)?, array1(py, found.iter().map(|&(_, count)| count))?))
    }

    #[pyfunction]
    fn resize<'py>(
        image: PyReadonlyArrayDyn<'py, u8>,
        width: i64,
        height: i64,
    ) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
        let py = image.py();
        let pixels = Pixels::new(py, &image)?;
        let new = size((width, height));
        let resized = detached(py, |_| hog_core::pyramid::resize(pixels.view()?, new))?;
        let mut shape = image.shape().to_vec();
        shape[..2].copy_from_slice(&[new.height, new.width]);
        PyArray1::from_vec(py, resized).reshape(shape)
    }

    #[pyfunction]
    fn default_people_detector(py: Python<'_>) -> Array1<'_, f32> {
        PyArray1::from_slice(py, hog_core::model::default_people())
    }

    #[pyfunction]
    fn daimler_people_detector(py: Python<'_>) -> Array1<'_, f32> {
        PyArray1::from_slice(py, hog_core::model::daimler_people())
    }

    #[pyfunction]
    fn set_num_threads(count: &Bound<'_, PyAny>) -> PyResult<()> {
        let py = count.py();
        let refused = |error: PyErr| {
            if error.is_instance_of::<PyOverflowError>(py) {
                return raised(py, &ParameterError::Threads { most: THREADS_MAX }.into());
            }
            raised_as(py, "ParameterTypeError", format!("the number of threads must be an integer: {error}"))
        };
        THREADS.store(count.extract().map_err(refused)?, Ordering::Relaxed);
        Ok(())
    }

    #[pyfunction]
    fn get_num_threads() -> usize {
        threads()
    }

    #[pyfunction]
    fn backend(py: Python<'_>) -> PyResult<&'static str> {
        Backend::current().map(Backend::name).map_err(|error| raised(py, &error))
    }

    #[pyfunction]
    fn available_backends() -> Vec<&'static str> {
        Backend::ALL.into_iter().filter(|backend| backend.is_available()).map(Backend::name).collect()
    }
}
