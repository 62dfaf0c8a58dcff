//! The Python module `limo_hog._core`.
use pyo3::prelude::*;

#[pymodule(gil_used = false)]
mod _core {}
