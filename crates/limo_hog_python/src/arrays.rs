//! Arrays of numpy's: images read from them, results made in their memory.

use std::borrow::Cow;

use numpy::ndarray::{Dim, Dimension};
use numpy::{
    Element, PyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;

use hog_core::error::ImageError;
use hog_core::{HogError, ImageView, Rect, Size};

use crate::errors::raised;

pub(crate) type Array1<'py, T> = Bound<'py, PyArray1<T>>;
pub(crate) type Array2<'py, T> = Bound<'py, PyArray2<T>>;
/// Along x and y.
pub(crate) type Pair = (i64, i64);

/// A list of as many items as the iterator promises; where there is no memory for them, the call fails, not the process.
pub(crate) fn collect<T>(items: impl IntoIterator<Item = T>) -> hog_core::Result<Vec<T>> {
    let (items, mut list) = (items.into_iter(), Vec::new());
    let len = items.size_hint().0;
    list.try_reserve_exact(len)
        .map_err(|_| HogError::Memory { bytes: len.saturating_mul(size_of::<T>()) })?;
    list.extend(items);
    Ok(list)
}

/// Numbers as an array of numpy's.
pub(crate) fn array1<T: Element>(
    py: Python<'_>,
    values: impl IntoIterator<Item = T>,
) -> PyResult<Array1<'_, T>> {
    let values = collect(values).map_err(|error| raised(py, &error))?;
    Ok(PyArray1::from_vec(py, values))
}

/// Numbers of any value in memory of numpy's, which asks for large pages: small ones take longer to come than to be
/// filled. (`PyArray::new` would panic where there is no memory.)
pub(crate) fn empty<T: Element, const N: usize>(
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
pub(crate) fn contiguous<'a>(
    py: Python<'_>,
    array: &'a PyReadonlyArrayDyn<'_, u8>,
) -> PyResult<Cow<'a, [u8]>> {
    // `as_slice` also succeeds on Fortran order, with the pixels in that order.
    match array.as_slice() {
        Ok(slice) if array.is_c_contiguous() => Ok(Cow::Borrowed(slice)),
        _ => {
            let copy = collect(array.as_array().iter().copied());
            Ok(Cow::Owned(copy.map_err(|error| raised(py, &error))?))
        }
    }
}

/// The pixels of a numpy image: borrowed where it is contiguous, else copied.
pub(crate) struct Pixels<'a> {
    data: Cow<'a, [u8]>,
    width: usize,
    height: usize,
    channels: usize,
}

impl<'a> Pixels<'a> {
    pub(crate) fn new(py: Python<'_>, array: &'a PyReadonlyArrayDyn<'_, u8>) -> PyResult<Self> {
        let (height, width, channels) = match *array.shape() {
            [height, width] => (height, width, 1),
            [height, width, channels] => (height, width, channels),
            ref shape => {
                return Err(raised(py, &ImageError::Dimensions { got: shape.len() }.into()));
            }
        };
        Ok(Self { data: contiguous(py, array)?, width, height, channels })
    }

    pub(crate) fn view(&self) -> hog_core::Result<ImageView<'_>> {
        ImageView::new(&self.data, self.width, self.height, self.channels, self.width * self.channels)
    }
}

/// A negative side is 0, which is refused as such.
pub(crate) fn size((width, height): Pair) -> Size {
    Size::new(usize::try_from(width).unwrap_or(0), usize::try_from(height).unwrap_or(0))
}

pub(crate) fn rect_array<'py, T>(py: Python<'py>, found: &[(Rect, T)]) -> PyResult<Array2<'py, i32>> {
    let values = found.iter().flat_map(|(r, _)| [r.x, r.y, r.width, r.height]);
    array1(py, values)?.reshape([found.len(), 4])
}
