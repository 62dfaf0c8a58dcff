//! Errors as the classes of `limo_hog.exceptions`.

use pyo3::exceptions::{PyKeyboardInterrupt, PyMemoryError};
use pyo3::prelude::*;

use hog_core::HogError;

/// Raises the class of `limo_hog.exceptions` that stands for `error`.
pub(crate) fn raised(py: Python<'_>, error: &HogError) -> PyErr {
    let class = match error {
        HogError::Geometry(_) => "GeometryError",
        HogError::DetectorSize { .. } => "DetectorSizeError",
        HogError::Image(_) => "ImageError",
        HogError::Parameter(_) => "ParameterError",
        HogError::Network(_) => "ModelFormatError",
        HogError::Backend(_) => "BackendError",
        HogError::Memory { .. } => return PyMemoryError::new_err(error.to_string()),
        HogError::Interrupted => return PyKeyboardInterrupt::new_err(error.to_string()),
    };
    raised_as(py, class, error.to_string())
}

/// Raises a class of `limo_hog.exceptions`.
pub(crate) fn raised_as(py: Python<'_>, class: &str, message: String) -> PyErr {
    let raise = || {
        let class = py.import("limo_hog.exceptions")?.getattr(class)?;
        Ok(PyErr::from_value(class.call1((message,))?))
    };
    raise().unwrap_or_else(|missing: PyErr| missing)
}
