//! `limo_hog._core.Hog`: reads arguments, calls, wraps.

use hog_core::error::ImageError;
use hog_core::exact::RowVotes;
use hog_core::{Grouping, Guide, HogParams, ImageView, Interrupt, Search, SearchOptions};
use numpy::{PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::arrays::{Array1, Array2, Pair, Pixels, array1, collect, contiguous, empty, rect_array, size};
use crate::calls::{self, at_work, detached};
use crate::errors::{raised, raised_as};

type Array3<'py, T> = Bound<'py, PyArray3<T>>;

/// A geometry with or without an SVM; immutable, so threads may share it.
#[pyclass(frozen, module = "limo_hog._core")]
pub(crate) struct Hog {
    inner: hog_core::Hog,
}

impl Hog {
    /// Runs `work` on the image without the GIL.
    fn on<R: Send>(
        &self,
        image: &PyReadonlyArrayDyn<'_, u8>,
        work: impl FnOnce(&hog_core::Hog, ImageView, &Interrupt) -> hog_core::Result<R> + Send,
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
        let detector = detector.map(|array| collect(array.as_array().iter().copied())).transpose();
        let inner = detector.and_then(|detector| hog_core::Hog::new(&params, detector.as_deref()));
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
        let size = hog_core::Hog::gradient_size(view, padding).map_err(raise)?;
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
        detached(py, |interrupt| {
            self.inner.describe(&data, channels, at_work(calls::threads()), interrupt, out)
        })?;
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
        let find = |hog: &hog_core::Hog, view: ImageView, interrupt: &Interrupt| {
            hog.detect_windows(view, &search, locations.as_deref(), interrupt)
        };
        let (py, hits) = (image.py(), self.on(&image, find)?);
        let places = array1(py, hits.iter().flat_map(|hit| [hit.x as i32, hit.y as i32]))?;
        Ok((places.reshape([hits.len(), 2])?, array1(py, hits.iter().map(|hit| hit.weight))?))
    }

    #[allow(clippy::too_many_arguments, reason = "they are OpenCV's detectMultiScale arguments, and ours")]
    #[pyo3(signature = (image, *, hit_threshold = 0.0, win_stride = (0, 0), padding = (0, 0), scale = 1.05,
        similar = None, mean_shift = None, searched_size = None, guide = None, threads = None))]
    fn detect_multi_scale<'py>(
        &self,
        image: PyReadonlyArrayDyn<'py, u8>,
        hit_threshold: f64,
        win_stride: Pair,
        padding: Pair,
        scale: f64,
        similar: Option<f64>,
        mean_shift: Option<f64>,
        searched_size: Option<Pair>,
        guide: Option<(u32, f64, (f64, f64))>,
        threads: Option<usize>,
    ) -> PyResult<(Array2<'py, i32>, Array1<'py, f64>)> {
        let grouping = match (similar, mean_shift) {
            (None, None) => Grouping::None,
            (Some(more_than), None) => Grouping::Similar(more_than as i32),
            (None, Some(density)) => Grouping::MeanShift(density),
            (Some(_), Some(_)) => {
                let both = "similar and mean_shift are two ways to group; give one of them";
                return Err(raised_as(image.py(), "ParameterError", both.to_owned()));
            }
        };
        let options = SearchOptions {
            search: Search { hit_threshold, win_stride, padding },
            scale,
            searched_size: searched_size.map(size),
            grouping,
            guide: guide.map(|(halvings, margin, reach)| Guide { halvings, margin, reach }),
            threads: at_work(threads.unwrap_or_else(calls::threads)),
        };
        let find = |hog: &hog_core::Hog, view: ImageView, interrupt: &Interrupt| {
            hog.detect(view, &options, interrupt)
        };
        let (py, found) = (image.py(), self.on(&image, find)?);
        Ok((rect_array(py, &found)?, array1(py, found.iter().map(|&(_, weight)| weight))?))
    }
}
