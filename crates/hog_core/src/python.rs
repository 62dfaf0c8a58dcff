//! The Python module `limo_hog._core`: reads arguments, releases the GIL, calls, wraps, maps errors. Nothing else.

use std::borrow::Cow;
use std::sync::atomic::{AtomicUsize, Ordering};

use numpy::{
    PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArrayDyn, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::error::ImageError;
use crate::{Backend, Grouping, HogError, HogParams, ImageView, Rect, Search};

type Pair = (i64, i64);
type Array1<'py, T> = Bound<'py, PyArray1<T>>;
type Array2<'py, T> = Bound<'py, PyArray2<T>>;
type Array3<'py, T> = Bound<'py, PyArray3<T>>;

/// Threads of a pyramid search; 0 stands for all cores.
static THREADS: AtomicUsize = AtomicUsize::new(0);

fn threads() -> usize {
    match THREADS.load(Ordering::Relaxed) {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        chosen => chosen,
    }
}

/// Raises the class of `limo_hog.exceptions` that stands for `error`.
fn raised(py: Python<'_>, error: &HogError) -> PyErr {
    let class = match error {
        HogError::Geometry(_) => "GeometryError",
        HogError::DetectorSize { .. } => "DetectorSizeError",
        HogError::Image(_) => "ImageError",
        HogError::Parameter(_) => "ParameterError",
        HogError::Backend(_) => "BackendError",
    };
    let raise = || {
        let class = py.import("limo_hog.exceptions")?.getattr(class)?;
        Ok(PyErr::from_value(class.call1((error.to_string(),))?))
    };
    raise().unwrap_or_else(|missing: PyErr| missing)
}

/// The pixels of a numpy image: borrowed where it is contiguous, else copied.
struct Pixels<'a> {
    data: Cow<'a, [u8]>,
    width: usize,
    height: usize,
    channels: usize,
}

impl<'a> Pixels<'a> {
    fn new(py: Python<'_>, array: &'a PyReadonlyArrayDyn<'_, u8>) -> PyResult<Self> {
        let (height, width, channels) = match *array.shape() {
            [height, width] => (height, width, 1),
            [height, width, channels] => (height, width, channels),
            ref shape => {
                return Err(raised(py, &ImageError::Dimensions { got: shape.len() }.into()));
            }
        };
        // `as_slice` also succeeds on Fortran order, with the pixels in that order.
        let data = match array.as_slice() {
            Ok(slice) if array.is_c_contiguous() => Cow::Borrowed(slice),
            _ => Cow::Owned(array.as_array().iter().copied().collect()),
        };
        Ok(Self { data, width, height, channels })
    }

    fn view(&self) -> crate::Result<ImageView<'_>> {
        ImageView::new(&self.data, self.width, self.height, self.channels, self.width * self.channels)
    }
}

/// A geometry with or without an SVM; immutable, so threads may share it.
#[pyclass(frozen, module = "limo_hog._core")]
struct Hog {
    inner: crate::Hog,
}

impl Hog {
    /// Runs `work` on the image without the GIL.
    fn on<R: Send>(
        &self,
        image: &PyReadonlyArrayDyn<'_, u8>,
        work: impl FnOnce(&crate::Hog, ImageView) -> crate::Result<R> + Send,
    ) -> PyResult<R> {
        let py = image.py();
        let pixels = Pixels::new(py, image)?;
        py.detach(|| work(&self.inner, pixels.view()?)).map_err(|error| raised(py, &error))
    }
}

#[pymethods]
impl Hog {
    #[new]
    #[allow(clippy::too_many_arguments, reason = "they are OpenCV's constructor arguments")]
    fn new(
        py: Python<'_>,
        win_size: Pair,
        block_size: Pair,
        block_stride: Pair,
        cell_size: Pair,
        nbins: i64,
        win_sigma: f64,
        l2_hys_threshold: f64,
        gamma_correction: bool,
        nlevels: i64,
        signed_gradient: bool,
        detector: Option<PyReadonlyArray1<'_, f32>>,
    ) -> PyResult<Self> {
        let params = HogParams {
            win_size,
            block_size,
            block_stride,
            cell_size,
            nbins,
            win_sigma,
            l2_hys_threshold,
            gamma_correction,
            nlevels,
            signed_gradient,
        };
        let detector = detector.map(|array| array.as_array().to_vec());
        let inner = crate::Hog::new(&params, detector.as_deref()).map_err(|error| raised(py, &error))?;
        Ok(Self { inner })
    }

    #[getter]
    fn descriptor_len(&self) -> usize {
        self.inner.spec().descriptor_len()
    }

    fn gradient<'py>(
        &self,
        image: PyReadonlyArrayDyn<'py, u8>,
        padding: [i64; 4],
    ) -> PyResult<(Array3<'py, f32>, Array3<'py, u8>)> {
        let py = image.py();
        let (found, size) = self.on(&image, |hog, view| hog.gradient(view, padding))?;
        let shape = [size.height, size.width, 2];
        let shares = PyArray1::from_vec(py, found.shares.into_flattened()).reshape(shape)?;
        Ok((shares, PyArray1::from_vec(py, found.bins.into_flattened()).reshape(shape)?))
    }

    fn compute<'py>(
        &self,
        image: PyReadonlyArrayDyn<'py, u8>,
        win_stride: Pair,
        padding: Pair,
        locations: Option<Vec<Pair>>,
    ) -> PyResult<Array1<'py, f32>> {
        let py = image.py();
        let raise = |error| raised(py, &error);
        let search = Search { hit_threshold: 0.0, win_stride, padding };
        let pixels = Pixels::new(py, &image)?;
        let (view, locations) = (pixels.view().map_err(raise)?, locations.as_deref());
        let len = self.inner.compute_len(view, &search, locations).map_err(raise)?;
        // In memory of numpy's, which asks for large pages: small ones take longer to come than to be filled.
        let descriptors = PyArray1::zeros(py, len, false);
        let mut out = descriptors.readwrite();
        let out = out.as_slice_mut()?;
        py.detach(|| self.inner.compute(view, &search, locations, out)).map_err(raise)?;
        Ok(descriptors)
    }

    fn detect<'py>(
        &self,
        image: PyReadonlyArrayDyn<'py, u8>,
        hit_threshold: f64,
        win_stride: Pair,
        padding: Pair,
        locations: Option<Vec<Pair>>,
    ) -> PyResult<(Array2<'py, i32>, Array1<'py, f64>)> {
        let search = Search { hit_threshold, win_stride, padding };
        let hits = self.on(&image, |hog, view| hog.detect(view, &search, locations.as_deref()))?;
        let places = hits.iter().flat_map(|hit| [hit.x as i32, hit.y as i32]).collect();
        let weights = hits.iter().map(|hit| hit.weight).collect();
        let py = image.py();
        Ok((PyArray1::from_vec(py, places).reshape([hits.len(), 2])?, PyArray1::from_vec(py, weights)))
    }

    #[allow(clippy::too_many_arguments, reason = "they are OpenCV's detectMultiScale arguments")]
    fn detect_multi_scale<'py>(
        &self,
        image: PyReadonlyArrayDyn<'py, u8>,
        hit_threshold: f64,
        win_stride: Pair,
        padding: Pair,
        scale: f64,
        group_threshold: f64,
        mean_shift: bool,
    ) -> PyResult<(Array2<'py, i32>, Array1<'py, f64>)> {
        let search = Search { hit_threshold, win_stride, padding };
        let grouping = if mean_shift {
            Grouping::MeanShift(group_threshold)
        } else {
            Grouping::Similar(group_threshold as i32)
        };
        let found =
            self.on(&image, |hog, view| hog.detect_multi_scale(view, &search, scale, grouping, threads()))?;
        let (rects, weights): (Vec<Rect>, Vec<f64>) = found.into_iter().unzip();
        Ok((rect_array(image.py(), &rects)?, PyArray1::from_vec(image.py(), weights)))
    }
}

fn rect_array<'py>(py: Python<'py>, rects: &[Rect]) -> PyResult<Array2<'py, i32>> {
    let values = rects.iter().flat_map(|r| [r.x, r.y, r.width, r.height]).collect();
    PyArray1::from_vec(py, values).reshape([rects.len(), 4])
}

#[pymodule(gil_used = false)]
mod _core {
    use super::*;

    #[pymodule_export]
    use super::Hog;

    #[pyfunction]
    fn group_rectangles<'py>(
        py: Python<'py>,
        rects: Vec<[i32; 4]>,
        threshold: i32,
        eps: f64,
    ) -> PyResult<(Array2<'py, i32>, Array1<'py, i32>)> {
        let rect = |[x, y, width, height]: [i32; 4]| Rect { x, y, width, height };
        let rects: Vec<Rect> = rects.into_iter().map(rect).collect();
        let found = py.detach(|| crate::group::group_rectangles(&rects, threshold, eps));
        let (rects, counts): (Vec<Rect>, Vec<i32>) = found.into_iter().unzip();
        Ok((rect_array(py, &rects)?, PyArray1::from_vec(py, counts)))
    }

    #[pyfunction]
    fn default_people_detector(py: Python<'_>) -> Array1<'_, f32> {
        PyArray1::from_slice(py, crate::model::default_people())
    }

    #[pyfunction]
    fn daimler_people_detector(py: Python<'_>) -> Array1<'_, f32> {
        PyArray1::from_slice(py, crate::model::daimler_people())
    }

    #[pyfunction]
    fn set_num_threads(count: usize) {
        THREADS.store(count, Ordering::Relaxed);
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
