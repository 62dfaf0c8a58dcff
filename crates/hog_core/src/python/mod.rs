//! The Python module `limo_hog._core`: reads arguments, releases the GIL, calls, wraps, maps errors. Nothing else.

mod arrays;
mod canvas;
mod errors;
mod skimage;

use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use numpy::{
    PyArray1, PyArray2, PyArray3, PyArrayDyn, PyArrayMethods, PyReadonlyArray1, PyReadonlyArrayDyn,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyOverflowError;
use pyo3::prelude::*;

use self::arrays::{Array1, Pixels, array1, contiguous, empty};
use self::errors::{raised, raised_as};
use crate::error::{ImageError, ParameterError};
use crate::exact::RowVotes;
use crate::pyramid::Pyramid;
use crate::{Backend, Grouping, Guide, HogParams, ImageView, Interrupt, Rect, Search, Size, memory};

type Pair = (i64, i64);
type Array2<'py, T> = Bound<'py, PyArray2<T>>;
type Array3<'py, T> = Bound<'py, PyArray3<T>>;

/// Threads of a pyramid search; 0 stands for all cores.
static THREADS: AtomicUsize = AtomicUsize::new(0);

/// The cores that this process may use; 0 until they are asked for.
static CORES: AtomicUsize = AtomicUsize::new(0);

/// More threads are never used: levels are shared among them, and a pyramid has 64 levels unless asked for more.
const THREADS_MAX: usize = 256;

/// How many threads were chosen.
fn threads() -> usize {
    let threads = match THREADS.load(Ordering::Relaxed) {
        0 => cores(),
        chosen => chosen,
    };
    threads.min(THREADS_MAX)
}

/// The cores that this process may use, asked for once: the answer takes longer (28 µs) than the descriptor of a crop.
fn cores() -> usize {
    if CORES.load(Ordering::Relaxed) == 0 {
        CORES.store(std::thread::available_parallelism().map_or(1, usize::from), Ordering::Relaxed);
    }
    CORES.load(Ordering::Relaxed)
}

/// How many threads a call uses that asks for so many: no more than there are cores, as others would only cut the work into
/// smaller parts, and each of them needs scratch memory.
fn at_work(asked: usize) -> usize {
    asked.clamp(1, cores())
}

/// How often a long call looks for signals: a tenth of the second within which Ctrl-C is to end it, and so rarely that
/// taking the GIL from a busy thread costs little.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// Runs `work` without the GIL; what a signal's handler raises (Ctrl-C: `KeyboardInterrupt`) ends it.
fn detached<R: Send>(
    py: Python<'_>,
    work: impl FnOnce(&Interrupt) -> crate::Result<R> + Send,
) -> PyResult<R> {
    let (found, signal) = py.detach(|| {
        let (looked, signal) = (Cell::new(Instant::now()), Cell::new(None));
        // Python handles signals in its main thread alone: any other would take the GIL for nothing, time and again.
        let is_main = Cell::new(None);
        let ask = || {
            if is_main.get() == Some(false) || looked.get().elapsed() < LOOK_EVERY {
                return false;
            }
            // (An interpreter that is ending cannot be had; nor does it wait for this thread.)
            let seen = Python::try_attach(|py| {
                if is_main.get().is_none() {
                    is_main.set(Some(is_main_thread(py)?));
                }
                py.check_signals()
            });
            looked.set(Instant::now());
            seen.is_some_and(|seen| seen.map_err(|error| signal.set(Some(error))).is_err())
        };
        let found = work(&Interrupt::when(&ask));
        (found, signal.take())
    });
    match signal {
        Some(error) => Err(error),
        None => found.map_err(|error| raised(py, &error)),
    }
}

fn is_main_thread(py: Python<'_>) -> PyResult<bool> {
    let threading = py.import("threading")?;
    let main = threading.call_method0("main_thread")?.getattr("ident")?;
    threading.call_method0("get_ident")?.eq(main)
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
        work: impl FnOnce(&crate::Hog, ImageView, &Interrupt) -> crate::Result<R> + Send,
    ) -> PyResult<R> {
        let py = image.py();
        let pixels = Pixels::new(py, image)?;
        detached(py, |interrupt| work(&self.inner, pixels.view()?, interrupt))
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
        let detector = detector.map(|array| memory::collect(array.as_array().iter().copied())).transpose();
        let inner = detector.and_then(|detector| crate::Hog::new(&params, detector.as_deref()));
        Ok(Self { inner: inner.map_err(|error| raised(py, &error))? })
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
        let raise = |error| raised(py, &error);
        let pixels = Pixels::new(py, &image)?;
        let view = pixels.view().map_err(raise)?;
        let size = crate::Hog::gradient_size(view, padding).map_err(raise)?;
        // Every number is written, here and below: zeros would be written twice.
        let shape = [size.height, size.width, 2];
        let (shares, bins) = (empty(py, shape)?, empty(py, shape)?);
        let (mut of_shares, mut of_bins) = (shares.readwrite(), bins.readwrite());
        let out = RowVotes {
            shares: of_shares.as_slice_mut()?.as_chunks_mut().0,
            bins: of_bins.as_slice_mut()?.as_chunks_mut().0,
        };
        detached(py, |interrupt| self.inner.gradient(view, padding, interrupt, out))?;
        Ok((shares, bins))
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
        let descriptors = empty(py, [len])?;
        let mut out = descriptors.readwrite();
        let out = out.as_slice_mut()?;
        detached(py, |interrupt| self.inner.compute(view, &search, locations, interrupt, out))?;
        Ok(descriptors)
    }

    fn describe<'py>(&self, crops: PyReadonlyArrayDyn<'py, u8>) -> PyResult<Array2<'py, f32>> {
        let py = crops.py();
        let spec = self.inner.spec();
        let (count, channels) = match *crops.shape() {
            [count, height, width] if (width, height) == (spec.win.width, spec.win.height) => (count, 1),
            [count, height, width, channels] if (width, height) == (spec.win.width, spec.win.height) => {
                (count, channels)
            }
            ref shape => {
                let got = shape.len();
                return Err(raised(py, &ImageError::Dimensions { got }.into()));
            }
        };
        let elements = spec.descriptor_len();
        let data = contiguous(py, &crops)?;
        let descriptors = empty(py, [count, elements])?;
        let mut out = descriptors.readwrite();
        let out = out.as_slice_mut()?;
        detached(py, |interrupt| self.inner.describe(&data, channels, at_work(threads()), interrupt, out))?;
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
        let find = |hog: &crate::Hog, view: ImageView, interrupt: &Interrupt| {
            hog.detect(view, &search, locations.as_deref(), interrupt)
        };
        let (py, hits) = (image.py(), self.on(&image, find)?);
        let places = array1(py, hits.iter().flat_map(|hit| [hit.x as i32, hit.y as i32]))?;
        Ok((places.reshape([hits.len(), 2])?, array1(py, hits.iter().map(|hit| hit.weight))?))
    }

    #[allow(clippy::too_many_arguments, reason = "they are OpenCV's detectMultiScale arguments, and ours")]
    #[pyo3(signature = (image, hit_threshold, win_stride, padding, scale, group_threshold, mean_shift,
        first_level = None, guide = None, threads = None))]
    fn detect_multi_scale<'py>(
        &self,
        image: PyReadonlyArrayDyn<'py, u8>,
        hit_threshold: f64,
        win_stride: Pair,
        padding: Pair,
        scale: f64,
        group_threshold: f64,
        mean_shift: bool,
        first_level: Option<Pair>,
        guide: Option<(u32, f64, (f64, f64))>,
        threads: Option<usize>,
    ) -> PyResult<(Array2<'py, i32>, Array1<'py, f64>)> {
        let search = Search { hit_threshold, win_stride, padding };
        let pyramid = Pyramid { first: first_level.map(size), scale };
        let grouping = if mean_shift {
            Grouping::MeanShift(group_threshold)
        } else {
            Grouping::Similar(group_threshold as i32)
        };
        let guide = guide.map(|(halvings, margin, reach)| Guide { halvings, margin, reach });
        let threads = at_work(threads.unwrap_or_else(self::threads));
        let find = |hog: &crate::Hog, view: ImageView, interrupt: &Interrupt| {
            hog.detect_multi_scale(view, &search, &pyramid, grouping, guide, threads, interrupt)
        };
        let (py, found) = (image.py(), self.on(&image, find)?);
        Ok((rect_array(py, &found)?, array1(py, found.iter().map(|&(_, weight)| weight))?))
    }
}

/// A negative side is 0, which is refused as such.
fn size((width, height): Pair) -> Size {
    Size::new(usize::try_from(width).unwrap_or(0), usize::try_from(height).unwrap_or(0))
}

fn rect_array<'py, T>(py: Python<'py>, found: &[(Rect, T)]) -> PyResult<Array2<'py, i32>> {
    let values = found.iter().flat_map(|(r, _)| [r.x, r.y, r.width, r.height]);
    array1(py, values)?.reshape([found.len(), 4])
}

#[pymodule(gil_used = false)]
mod _core {
    use super::*;

    #[pymodule_export]
    use super::Hog;
    #[pymodule_export]
    use super::canvas::Canvas;
    #[pymodule_export]
    use super::skimage::skimage_hog;

    #[pyfunction]
    fn group_rectangles<'py>(
        py: Python<'py>,
        rects: Vec<[i32; 4]>,
        threshold: i32,
        eps: f64,
    ) -> PyResult<(Array2<'py, i32>, Array1<'py, i32>)> {
        let rect = |[x, y, width, height]: [i32; 4]| Rect { x, y, width, height };
        let found = detached(py, |interrupt| {
            let rects = memory::collect(rects.into_iter().map(rect))?;
            crate::group::group_rectangles(&rects, threshold, eps, interrupt)
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
        let resized = detached(py, |_| crate::pyramid::resize(pixels.view()?, new))?;
        let mut shape = image.shape().to_vec();
        shape[..2].copy_from_slice(&[new.height, new.width]);
        PyArray1::from_vec(py, resized).reshape(shape)
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
