//! `limo_hog._core.Canvas`: reads arguments, checks that the arrays are those of the image, calls.

use numpy::{
    Element, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray2, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;

use crate::errors::raised_as;
use limo_canvas::{self, Ellipse, Frustum, Pinhole, Room, Shadow, Slab, Solid, Strip, Sun, Window};

/// The largest side of an image [px].
const SIDE_MAX: usize = 1 << 14;

/// A canvas for an image of one size; its memory is kept from object to object.
#[pyclass(module = "limo_hog._core")]
pub(crate) struct Canvas {
    inner: limo_canvas::Canvas,
    height: usize,
    width: usize,
    pinhole: Pinhole,
}

/// Pixels of an object, those that are seen, and the window that they fill.
type Counts = (usize, usize, Option<(usize, usize, usize, usize)>);

fn refused(py: Python<'_>, message: String) -> PyErr {
    raised_as(py, "ParameterError", message)
}

impl Canvas {
    fn window(&self, py: Python<'_>, window: Window) -> PyResult<Window> {
        let [left, top, right, bottom] = window;
        if left <= right && right <= self.width && top <= bottom && bottom <= self.height {
            return Ok(window);
        }
        let (width, height) = (self.width, self.height);
        Err(refused(py, format!("the window {window:?} is not within {width} x {height} pixels")))
    }

    /// Refuses an array that is not of the image's size, or not in C order.
    fn check(&self, array: &Bound<'_, PyUntypedArray>) -> PyResult<()> {
        let (got, wanted) = (array.shape(), [self.height, self.width]);
        if got == wanted && array.is_c_contiguous() {
            return Ok(());
        }
        Err(refused(array.py(), format!("an array is {got:?}; {wanted:?} in C order is wanted")))
    }

    fn check_mut<T: Element>(&self, array: &PyReadwriteArray2<'_, T>) -> PyResult<()> {
        self.check(array.as_untyped())
    }

    fn cast_rows<S: Solid>(
        &mut self,
        rows: &PyReadonlyArray2<'_, f64>,
        light: [f64; 5],
        solid: impl Fn([f64; 12], &Sun) -> S,
    ) -> PyResult<()> {
        let sun = Sun::from(light);
        for row in rows.as_array().rows() {
            if row.len() != 12 {
                return Err(refused(rows.py(), format!("a row has {} numbers; 12 are wanted", row.len())));
            }
            self.inner.cast(&solid(std::array::from_fn(|column| row[column]), &sun));
        }
        Ok(())
    }
}

#[pymethods]
impl Canvas {
    #[new]
    fn new(py: Python<'_>, height: usize, width: usize, focal: f32) -> PyResult<Self> {
        if !(1..=SIDE_MAX).contains(&height) || !(1..=SIDE_MAX).contains(&width) {
            return Err(refused(
                py,
                format!("the image is {width} x {height}; sides of 1 to {SIDE_MAX} are wanted"),
            ));
        }
        let centre = [width, height].map(|side| (side - 1) as f32 / 2.0);
        Ok(Self { inner: limo_canvas::Canvas::default(), height, width, pinhole: Pinhole { focal, centre } })
    }

    fn begin(&mut self, py: Python<'_>, window: Window) -> PyResult<()> {
        let window = self.window(py, window)?;
        self.inner.begin(window).map_err(|error| PyMemoryError::new_err(error.to_string()))
    }

    fn strips(&mut self, rows: PyReadonlyArray2<'_, f64>, light: [f64; 5]) -> PyResult<()> {
        self.cast_rows(&rows, light, Strip::new)
    }

    fn ellipses(&mut self, rows: PyReadonlyArray2<'_, f64>, light: [f64; 5]) -> PyResult<()> {
        self.cast_rows(&rows, light, Ellipse::new)
    }

    fn frustum(&mut self, row: [f64; 13], light: [f64; 5]) {
        self.inner.cast(&Frustum::new(row, &Sun::from(light), self.pinhole));
    }

    fn slab(&mut self, row: [f64; 17]) {
        self.inner.cast(&Slab::new(row, self.pinhole));
    }

    #[pyo3(signature = (image, depth, palette, owners = None, owner = 0))]
    fn draw(
        &self,
        image: Option<PyReadwriteArray2<'_, u32>>,
        mut depth: PyReadwriteArray2<'_, f32>,
        palette: PyReadonlyArray1<'_, u32>,
        owners: Option<PyReadwriteArray2<'_, i16>>,
        owner: i16,
    ) -> PyResult<usize> {
        let (mut image, mut owners) = (image, owners);
        self.check_mut(&depth)?;
        image.as_ref().map_or(Ok(()), |image| self.check_mut(image))?;
        owners.as_ref().map_or(Ok(()), |owners| self.check_mut(owners))?;
        let palette = palette.as_slice()?;
        if palette.is_empty() {
            return Err(refused(depth.py(), "the palette is empty".to_owned()));
        }
        let image = match &mut image {
            Some(image) => Some((image.as_slice_mut()?, palette)),
            None => None,
        };
        let owners = match &mut owners {
            Some(owners) => Some((owners.as_slice_mut()?, owner)),
            None => None,
        };
        Ok(self.inner.draw(self.width, image, depth.as_slice_mut()?, owners))
    }

    fn seen(&self, depth: PyReadonlyArray2<'_, f32>) -> PyResult<Counts> {
        self.check(depth.as_untyped())?;
        let seen = self.inner.seen(self.width, depth.as_slice()?);
        Ok((
            seen.inside,
            seen.visible,
            seen.bounds.map(|[left, top, right, bottom]| (left, top, right, bottom)),
        ))
    }

    #[allow(clippy::too_many_arguments, reason = "a picture of the room, and a shadow")]
    fn shade_floor(
        &self,
        mut grey: PyReadwriteArray2<'_, u8>,
        depth: PyReadonlyArray2<'_, f32>,
        floor: PyReadonlyArray1<'_, f32>,
        columns: PyReadonlyArray1<'_, f32>,
        window: Window,
        at: (f32, f32),
        radius: f64,
        strength: f32,
    ) -> PyResult<()> {
        let py = grey.py();
        self.check_mut(&grey)?;
        self.check(depth.as_untyped())?;
        let (floor, columns) = (floor.as_slice()?, columns.as_slice()?);
        if (floor.len(), columns.len()) != (self.height, self.width) {
            let got = (floor.len(), columns.len());
            return Err(refused(py, format!("{got:?} rows and columns came; those of the image are wanted")));
        }
        let room = Room { grey: grey.as_slice_mut()?, depth: depth.as_slice()?, floor, columns };
        let radius2 = (radius * radius) as f32;
        Shadow { across: at.0, ahead: at.1, radius2, strength }.fall(room, self.window(py, window)?);
        Ok(())
    }
}
