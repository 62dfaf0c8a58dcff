//! Composes the stages: descriptors and hits of one image, and of a whole pyramid on several threads.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::error::{HogError, Result};
use crate::gradient::{Gradient, Padding, gradient};
use crate::grid::{Grid, Steps};
use crate::group::{Candidate, Rect, clip, group_candidates, mean_shift};
use crate::image::ImageView;
use crate::params::{HogParams, HogSpec, Size};
use crate::pyramid::{Level, levels, resize, to_image};
use crate::reference;
use crate::simd::{self, Backend};
use crate::svm::Svm;
use crate::workspace::Pool;

/// A detector: a geometry and, for finding things, a linear SVM. Immutable, so threads may share it.
#[derive(Debug, Clone)]
pub struct Hog {
    spec: HogSpec,
    svm: Option<Svm>,
    /// The fast path, where the geometry has one.
    fast: Option<simd::Plan>,
    backend: Backend,
}

/// The image as the fast path wants it, shared by all levels of a call.
static PLANES: Pool<simd::Planes> = Pool::new();
/// Scratch memory of the fast path, one per thread at work.
static SCRATCH: Pool<simd::Scratch> = Pool::new();

/// Where and how densely to look.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Search {
    /// A window whose score is at least this is a hit.
    pub hit_threshold: f64,
    /// Distance of neighbouring windows (x, y) [px of the level]; (0, 0): the default of the method.
    pub win_stride: (i64, i64),
    /// Border around the image (x, y) [px of the level], mirrored.
    pub padding: (i64, i64),
}

/// How hits become the rectangles that are returned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Grouping {
    /// Groups of more than this many similar rectangles; below 1 every hit is returned.
    Similar(i32),
    /// Modes of the hits' density with more than this weight.
    MeanShift(f64),
}

/// A window that scored at least the threshold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Left edge of the window; negative inside the padding [px].
    pub x: i64,
    /// Upper edge [px].
    pub y: i64,
    /// SVM score with its bias.
    pub weight: f64,
}

impl Hit {
    fn new(grid: &Grid, (x, y): (usize, usize), weight: f64) -> Self {
        let (x, y) = grid.to_image(x, y);
        Self { x, y, weight }
    }
}

/// The fast path at work on one image.
#[derive(Clone, Copy)]
struct Fast<'a> {
    plan: &'a simd::Plan,
    planes: &'a simd::Planes,
    /// Windows scored closer than this to the threshold are scored again by the exact sums, as OpenCV orders them.
    doubt: f64,
}

/// A path whose scores may be further off than this only finds the hits: the exact sums weigh them.
const NOISE_MAX: f64 = 1e-4;

impl Hog {
    /// A detector of this geometry; `coefficients` of the SVM, if any, must fit it.
    pub fn new(params: &HogParams, coefficients: Option<&[f32]>) -> Result<Self> {
        Self::with_backend(params, coefficients, Backend::current()?)
    }

    /// [`new`](Self::new) with a backend other than the one in force; this CPU must have it.
    pub fn with_backend(params: &HogParams, coefficients: Option<&[f32]>, backend: Backend) -> Result<Self> {
        if !backend.is_available() {
            return Err(HogError::Backend(format!("this machine has no {}", backend.name())));
        }
        let spec = HogSpec::new(params)?;
        let svm = coefficients.map(|c| Svm::new(c, &spec)).transpose()?;
        let fast = svm.as_ref().and_then(|svm| simd::Plan::new(&spec, svm, backend));
        Ok(Self { spec, svm, fast, backend })
    }

    /// The checked geometry.
    pub fn spec(&self) -> &HogSpec {
        &self.spec
    }

    /// The gradient of the image with `left`, `top`, `right`, `bottom` columns and rows more (or fewer) around it.
    pub fn gradient(
        &self,
        image: ImageView,
        [left, top, right, bottom]: [i64; 4],
    ) -> Result<(Gradient, Size)> {
        let side = |name: &str, length: usize, before: i64, after: i64| {
            let padded = (length as i64).saturating_add(before).saturating_add(after);
            if (1..=i64::from(i32::MAX)).contains(&padded) {
                return Ok(padded as usize);
            }
            Err(HogError::Parameter(format!(
                "the padded {name} would be {padded} pixels; at least 1 is wanted"
            )))
        };
        let size = Size::new(
            side("width", image.width(), left, right)?,
            side("height", image.height(), top, bottom)?,
        );
        if size.width.saturating_mul(size.height) > i32::MAX as usize {
            return Err(HogError::Parameter(format!(
                "the padded image would have {} x {} pixels; at most 2^31 - 1 are allowed",
                size.width, size.height
            )));
        }
        Ok((gradient(image, Padding { left, top, size }, &self.spec), size))
    }

    /// Elements of the descriptors of the windows at `locations` (of all windows if none are given).
    ///
    /// The stride (0, 0) is the cell size.
    pub fn compute_len(
        &self,
        image: ImageView,
        search: &Search,
        locations: Option<&[(i64, i64)]>,
    ) -> Result<usize> {
        let grid = self.steps(search, self.spec.cell)?.grid(size_of(image), &self.spec);
        let count = locations.map_or(grid.len(), <[_]>::len);
        let elements = count.saturating_mul(self.spec.descriptor_len());
        if elements > i32::MAX as usize {
            return Err(HogError::Parameter(format!(
                "{count} windows of {} elements are too many for one array; use a larger winStride",
                self.spec.descriptor_len()
            )));
        }
        Ok(elements)
    }

    /// Writes the descriptors whose elements [`Hog::compute_len`] counts, one after the other, into `out`.
    ///
    /// A location whose window leaves the padded image has a descriptor of zeros.
    pub fn compute(
        &self,
        image: ImageView,
        search: &Search,
        locations: Option<&[(i64, i64)]>,
        out: &mut [f32],
    ) -> Result<()> {
        let grid = self.steps(search, self.spec.cell)?.grid(size_of(image), &self.spec);
        let Some(locations) = locations else {
            reference::descriptors(image, &grid, &self.spec, out);
            return Ok(());
        };
        let places: Vec<_> = locations.iter().map(|&at| grid.to_padded(at, &self.spec)).collect();
        let inside: Vec<_> = places.iter().flatten().copied().collect();
        let mut windows = reference::Windows::new(image, &grid, &inside, &self.spec);
        for (place, out) in places.into_iter().zip(out.chunks_exact_mut(self.spec.descriptor_len().max(1))) {
            match place {
                Some(at) => out.copy_from_slice(windows.descriptor(at)),
                None => out.fill(0.0),
            }
        }
        Ok(())
    }

    /// The windows that are hits, of those at `locations` (of all, if none are given), in their order.
    ///
    /// A location whose window leaves the padded image is passed over. The stride (0, 0) is the cell size.
    pub fn detect(
        &self,
        image: ImageView,
        search: &Search,
        locations: Option<&[(i64, i64)]>,
    ) -> Result<Vec<Hit>> {
        let grid = self.steps(search, self.spec.cell)?.grid(size_of(image), &self.spec);
        let Some(svm) = &self.svm else { return Ok(Vec::new()) };
        let Some(locations) = locations else {
            let hits =
                |fast: Option<Fast>| self.hits(image, fast, size_of(image), &grid, search.hit_threshold, svm);
            return self.with_fast(image, false, hits);
        };
        let inside: Vec<_> = locations.iter().filter_map(|&at| grid.to_padded(at, &self.spec)).collect();
        let mut windows = reference::Windows::new(image, &grid, &inside, &self.spec);
        let scored = inside.iter().map(|&at| Hit::new(&grid, at, windows.score(at, svm)));
        Ok(scored.filter(|hit| hit.weight >= search.hit_threshold).collect())
    }

    /// Rectangles of all hits of the pyramid whose levels shrink by `scale`, grouped and clipped to the image.
    ///
    /// Levels are shared among `threads` threads; hits are in level order, whatever their number. The stride (0, 0)
    /// is the block stride.
    pub fn detect_multi_scale(
        &self,
        image: ImageView,
        search: &Search,
        scale: f64,
        grouping: Grouping,
        threads: usize,
    ) -> Result<Vec<(Rect, f64)>> {
        let steps = self.steps(search, self.spec.stride)?;
        let Some(svm) = &self.svm else { return Ok(Vec::new()) };
        let levels = levels(size_of(image), scale, &self.spec);
        let mut candidates = Vec::new();
        // Mean-shift truncates to whole pixels: there the last bit of a weight may tell.
        let exact_weights = matches!(grouping, Grouping::MeanShift(_));
        self.with_fast(image, exact_weights, |fast| {
            let of_level =
                |level: &Level| self.level_candidates(image, fast, level, &steps, search.hit_threshold, svm);
            for found in in_order(&levels, threads, of_level) {
                candidates.append(&mut found?);
            }
            Ok(())
        })?;
        let win = self.spec.win;
        let found = match grouping {
            Grouping::Similar(threshold) => group_candidates(&candidates, threshold),
            Grouping::MeanShift(threshold) => {
                mean_shift(&candidates, threshold, (win.width as i32, win.height as i32))
            }
        };
        Ok(clip(found, image.width() as i32, image.height() as i32))
    }

    fn steps(&self, search: &Search, default_stride: Size) -> Result<Steps> {
        Steps::new(search.win_stride, search.padding, default_stride, &self.spec)
    }

    /// Runs `work` with the fast path, if there is one.
    fn with_fast<R>(&self, image: ImageView, exact_weights: bool, work: impl FnOnce(Option<Fast>) -> R) -> R {
        let Some(plan) = &self.fast else { return work(None) };
        let doubt = if exact_weights || plan.noise() > NOISE_MAX { f64::INFINITY } else { plan.noise() };
        PLANES.with(|planes| {
            simd::split(self.backend, planes, image);
            work(Some(Fast { plan, planes, doubt }))
        })
    }

    fn level_candidates(
        &self,
        image: ImageView,
        fast: Option<Fast>,
        level: &Level,
        steps: &Steps,
        hit_threshold: f64,
        svm: &Svm,
    ) -> Result<Vec<Candidate>> {
        let grid = steps.grid(level.size, &self.spec);
        let hits = self.hits(image, fast, level.size, &grid, hit_threshold, svm)?;
        let candidate = |hit: &Hit| Candidate {
            rect: to_image(hit.x, hit.y, level.scale, &self.spec),
            weight: hit.weight,
            scale: level.scale,
        };
        Ok(hits.iter().map(candidate).collect())
    }

    /// The hits among all windows of the image shrunk to `size`, row by row.
    fn hits(
        &self,
        image: ImageView,
        fast: Option<Fast>,
        size: Size,
        grid: &Grid,
        hit_threshold: f64,
        svm: &Svm,
    ) -> Result<Vec<Hit>> {
        if let Some(Fast { plan, planes, doubt }) = fast
            && simd::serves(grid)
        {
            return SCRATCH.with(|scratch| {
                simd::detect(self.backend, plan, planes, size, grid, hit_threshold, scratch);
                let sure = |score: f64| (score - hit_threshold).abs() > doubt;
                let hits = |weigh: &dyn Fn(usize, usize, f64) -> f64| {
                    let found = scratch.found.iter();
                    let weighed = found.map(|&(x, y, score)| Hit::new(grid, (x, y), weigh(x, y, score)));
                    Ok(weighed.filter(|hit| hit.weight >= hit_threshold).collect())
                };
                let close = scratch.found.iter().filter(|&&(_, _, score)| !sure(score)).count();
                if close == 0 {
                    return hits(&|_, _, score| score);
                }
                let level = Shrunk::new(image, size)?;
                let level = level.view()?;
                // Neighbouring windows share pixels and blocks: many are scored all at once.
                let many = close * self.spec.win.area() > grid.padded.area();
                let all = if many { reference::scores(level, grid, &self.spec, svm) } else { Vec::new() };
                hits(&|x, y, score| {
                    let index = y / grid.stride.height * grid.windows.width + x / grid.stride.width;
                    let one = || reference::window_score(level, grid, (x, y), &self.spec, svm);
                    if sure(score) { score } else { all.get(index).copied().unwrap_or_else(one) }
                })
            });
        }
        let level = Shrunk::new(image, size)?;
        let scores = reference::scores(level.view()?, grid, &self.spec, svm);
        let place = |index: usize| {
            let (i, j) = (index % grid.windows.width, index / grid.windows.width);
            (i * grid.stride.width, j * grid.stride.height)
        };
        let found = scores.into_iter().enumerate().filter(|&(_, weight)| weight >= hit_threshold);
        Ok(found.map(|(index, weight)| Hit::new(grid, place(index), weight)).collect())
    }
}

/// The image at a level's size.
struct Shrunk<'a> {
    image: ImageView<'a>,
    /// Its size and pixels, unless it is the image itself.
    pixels: Option<(Size, Vec<u8>)>,
}

impl<'a> Shrunk<'a> {
    fn new(image: ImageView<'a>, size: Size) -> Result<Self> {
        let pixels = if size == size_of(image) { None } else { Some((size, resize(image, size)?)) };
        Ok(Self { image, pixels })
    }

    fn view(&self) -> Result<ImageView<'_>> {
        let Some((size, pixels)) = &self.pixels else { return Ok(self.image) };
        let channels = self.image.channels();
        ImageView::new(pixels, size.width, size.height, channels, size.width * channels)
    }
}

fn size_of(image: ImageView) -> Size {
    Size::new(image.width(), image.height())
}

/// `work` of every item, on up to `threads` threads fed from one queue; results in the items' order.
fn in_order<T: Sync, R: Send>(items: &[T], threads: usize, work: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let threads = threads.clamp(1, items.len().max(1));
    if threads == 1 {
        return items.iter().map(work).collect();
    }
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::with_capacity(items.len()));
    let worker = || {
        while let Some((index, item)) = {
            let index = next.fetch_add(1, Ordering::Relaxed);
            items.get(index).map(|item| (index, item))
        } {
            let result = work(item);
            done.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push((index, result));
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(worker);
        }
        worker();
    });
    let mut done = done.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    done.sort_unstable_by_key(|&(index, _)| index);
    done.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_order_whatever_the_number_of_threads() {
        let items: Vec<usize> = (0..100).collect();
        for threads in [1, 2, 8, 200] {
            assert_eq!(
                in_order(&items, threads, |&i| i * i),
                items.iter().map(|i| i * i).collect::<Vec<_>>()
            );
        }
        assert!(in_order(&[] as &[u8], 4, |_| 0).is_empty());
    }
}
