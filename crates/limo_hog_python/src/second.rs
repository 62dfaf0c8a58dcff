//! `limo_hog._core.SecondLook`: reads arguments, calls, wraps.

use numpy::{PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use crate::arrays::{Array2, Pixels, collect, empty};
use crate::calls::{self, at_work, detached};
use crate::errors::raised;

/// A network that looks at windows; immutable, so threads may share it.
#[pyclass(frozen, module = "limo_hog._core")]
pub(crate) struct SecondLook {
    inner: hog_core::SecondLook,
}

#[pymethods]
impl SecondLook {
    #[new]
    fn new(
        py: Python<'_>,
        channels: [usize; 3],
        hidden: usize,
        weights: PyReadonlyArray1<'_, f32>,
    ) -> PyResult<Self> {
        let inner = collect(weights.as_array().iter().copied())
            .and_then(|weights| hog_core::SecondLook::new(channels, hidden, &weights));
        Ok(Self { inner: inner.map_err(|error| raised(py, &error))? })
    }

    #[pyo3(signature = (image, windows, *, threads = None))]
    fn answers<'py>(
        &self,
        image: PyReadonlyArrayDyn<'py, u8>,
        windows: PyReadonlyArray2<'py, f64>,
        threads: Option<usize>,
    ) -> PyResult<Array2<'py, f32>> {
        let py = image.py();
        let pixels = Pixels::new(py, &image)?;
        let windows =
            collect(windows.as_array().rows().into_iter().map(|row| std::array::from_fn(|i| row[i])));
        let windows: Vec<hog_core::Window> = windows.map_err(|error| raised(py, &error))?;
        let answers = empty(py, [windows.len(), 5])?;
        let mut out = answers.readwrite();
        let (out, threads) =
            (out.as_slice_mut()?.as_chunks_mut().0, at_work(threads.unwrap_or_else(calls::threads)));
        detached(py, |interrupt| self.inner.answers(pixels.view()?, &windows, threads, interrupt, out))?;
        Ok(answers)
    }
}
