//! Arrays of numpy's: images read from them, results made in their memory.

use std::borrow::Cow;

use numpy::ndarray::{Dim, Dimension};
use numpy::{Element, PyArray, PyArray1, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;

use super::errors::raised;
use crate::error::ImageError;
use crate::{HogError, ImageView, memory};

pub(super) type Array1<'py, T> = Bound<'py, PyArray1<T>>;

/// Numbers as an array of numpy's.
pub(super) fn array1<T: Element>(
    py: Python<'_>,
    values: impl IntoIterator<Item = T>,
) -> PyResult<Array1<'_, T>> {
    let values = memory::collect(values).map_err(|error| raised(py, &error))?;
    Ok(PyArray1::from_vec(py, values))
}

/// Numbers of any value in memory of numpy's, which asks for large pages: small ones take longer to come than to be
/// filled. (`PyArray::new` would panic where there is no memory.)
pub(super) fn empty<T: Element, const N: usize>(
    py: Python<'_>,
    shape: [usize; N],
) -> PyResult<Bound<'_, PyArray<T, Dim<[usize; N]>>>>
where
    Dim<[usize; N]>: Dimension,
{
    static EMPTY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    match EMPTY.import(py, "numpy", "empty")?.call1((shape, T::get_dtype(py))) {
        Err(error) if error.is_instance_of::<PyMemoryError>(py) => {
            let bytes = shape.iter().fold(size_of::<T>(), |bytes, &side| bytes.saturating_mul(side));
            Err(raised(py, &HogError::Memory { bytes }))
        }
        array => Ok(array?.cast_into()?),
    }
}

/// The bytes of an array in C order: borrowed where they lie so, else copied.
pub(super) fn contiguous<'a>(
    py: Python<'_>,
    array: &'a PyReadonlyArrayDyn<'_, u8>,
) -> PyResult<Cow<'a, [u8]>> {
    // `as_slice` also succeeds on Fortran order, with the pixels in that order.
    match array.as_slice() {
        Ok(slice) if array.is_c_contiguous() => Ok(Cow::Borrowed(slice)),
        _ => {
            let copy = memory::collect(array.as_array().iter().copied());
            Ok(Cow::Owned(copy.map_err(|error| raised(py, &error))?))
        }
    }
}

/// The pixels of a numpy image: borrowed where it is contiguous, else copied.
pub(super) struct Pixels<'a> {
    data: Cow<'a, [u8]>,
    width: usize,
    height: usize,
    channels: usize,
}

impl<'a> Pixels<'a> {
    pub(super) fn new(py: Python<'_>, array: &'a PyReadonlyArrayDyn<'_, u8>) -> PyResult<Self> {
        let (height, width, channels) = match *array.shape() {
            [height, width] => (height, width, 1),
            [height, width, channels] => (height, width, channels),
            ref shape => {
                return Err(raised(py, &ImageError::Dimensions { got: shape.len() }.into()));
            }
        };
        Ok(Self { data: contiguous(py, array)?, width, height, channels })
    }

    pub(super) fn view(&self) -> crate::Result<ImageView<'_>> {
        ImageView::new(&self.data, self.width, self.height, self.channels, self.width * self.channels)
    }
}
