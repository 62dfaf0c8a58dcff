//! Composes the stages: descriptors and hits of one image, and of a whole pyramid on several threads.

use crate::error::{ParameterError, Result};
use crate::exact::{self, RowVotes, Svm, Tables};
use crate::fast::{self, Backend, Found, Plan, Planes, Thresholds};
use crate::geometry::{Padding, Rect, Size};
use crate::group::{Candidate, clip, group_candidates, mean_shift};
use crate::image::{Image, ImageView};
use crate::interrupt::Interrupt;
use crate::memory::{self, Pool};
use crate::options::{Grouping, Search, SearchOptions};
use crate::params::{HogParams, HogSpec};
use crate::pyramid::{Grid, Level, Steps, check, levels, resize, to_image};
use crate::rescore::{Hit, LevelWindows, Scorer};
use crate::separable;
use crate::threads::in_order;

/// A detector: a geometry and, for finding things, a linear SVM. Immutable, so threads may share it.
///
/// ```
/// # #[cfg(feature = "models")] {
/// use hog_core::{Hog, HogParams, ImageView, Interrupt, SearchOptions, model};
/// let people = Hog::new(&HogParams::default(), Some(model::default_people()))?;
/// let grey = vec![128; 320 * 240];
/// let image = ImageView::new(&grey, 320, 240, 1, 320)?;
/// let found = people.detect(image, &SearchOptions::default(), &Interrupt::NEVER)?;
/// assert!(found.is_empty());
/// # }
/// # Ok::<(), hog_core::HogError>(())
/// ```
#[derive(Debug)]
pub struct Hog {
    pub(crate) exact: Exact,
    /// The fast path, where the geometry has one, and the search by it, where the SVM has one too.
    pub(crate) geometry: Option<fast::Geometry>,
    plan: Option<Plan>,
    pub(crate) backend: Backend,
}

/// What the exact path needs.
#[derive(Debug)]
pub(crate) struct Exact {
    spec: HogSpec,
    pub tables: Tables,
    svm: Option<Svm>,
    /// How its levels are searched where there is no fast path, if their sums separate.
    separable: Option<separable::Plan>,
}

/// The image in planes for the fast path, shared by all levels of a call.
static PLANES: Pool<Planes> = Pool::new();

/// Where the fast path's scores may be further off than this, it only finds the hits: the exact path weighs them all.
const SCORE_ERROR_MAX: f64 = 1e-4;

impl Hog {
    /// A detector of this geometry; `coefficients` of the SVM, if any, must fit it.
    pub fn new(params: &HogParams, coefficients: Option<&[f32]>) -> Result<Self> {
        Self::with_backend(params, coefficients, Backend::current()?)
    }

    /// [`new`](Self::new) with a backend other than the one in force; this CPU must have it.
    pub fn with_backend(params: &HogParams, coefficients: Option<&[f32]>, backend: Backend) -> Result<Self> {
        let backend = backend.checked()?;
        let spec = HogSpec::new(params)?;
        let svm = coefficients.map(|c| Svm::new(c, &spec)).transpose()?;
        let geometry = fast::geometry(backend, &spec);
        let plan = geometry.as_ref().zip(svm.as_ref());
        let plan = plan.and_then(|(geometry, svm)| fast::plan(backend, geometry, svm));
        let separable = svm.as_ref().map(|svm| separable::Plan::new(&spec, svm)).transpose()?.flatten();
        let exact =
            Exact { tables: Tables::with_kernel(&spec, fast::row_kernel(backend))?, spec, svm, separable };
        Ok(Self { exact, geometry, plan, backend })
    }

    /// The checked geometry.
    pub fn spec(&self) -> &HogSpec {
        &self.exact.spec
    }

    /// The size of the image with `left`, `top`, `right`, `bottom` columns and rows more (or fewer) around it.
    pub fn gradient_size(image: ImageView, [left, top, right, bottom]: [i64; 4]) -> Result<Size> {
        let side = |axis: &'static str, length: usize, before: i64, after: i64| {
            let padded = (length as i64).saturating_add(before).saturating_add(after);
            if (1..=i64::from(i32::MAX)).contains(&padded) {
                return Ok(padded as usize);
            }
            Err(ParameterError::PaddedSide { axis, got: padded })
        };
        let size = Size::new(
            side("width", image.width(), left, right)?,
            side("height", image.height(), top, bottom)?,
        );
        if size.width.saturating_mul(size.height) > i32::MAX as usize {
            return Err(ParameterError::PaddedArea { width: size.width, height: size.height }.into());
        }
        Ok(size)
    }

    /// The gradient of that image as OpenCV returns it, into `out`, which has a place for each of its pixels.
    ///
    /// ```
    /// use hog_core::exact::RowVotes;
    /// use hog_core::{Hog, HogParams, ImageView, Interrupt};
    /// let hog = Hog::new(&HogParams::default(), None)?;
    /// let ramp: Vec<u8> = (0..64).map(|i| 16 * (i % 8)).collect();
    /// let image = ImageView::new(&ramp, 8, 8, 1, 8)?;
    /// let pixels = Hog::gradient_size(image, [0; 4])?.area();
    /// let (mut shares, mut bins) = (vec![[0.0; 2]; pixels], vec![[0; 2]; pixels]);
    /// hog.gradient(image, [0; 4], &Interrupt::NEVER, RowVotes { shares: &mut shares, bins: &mut bins })?;
    /// assert_eq!(bins[9], [8, 0]); // brighter to the right: half of the vote for either bin beside 0°
    /// # Ok::<(), hog_core::HogError>(())
    /// ```
    pub fn gradient(
        &self,
        image: ImageView,
        borders: [i64; 4],
        interrupt: &Interrupt,
        out: RowVotes,
    ) -> Result<()> {
        let [left, top, ..] = borders;
        let padding = Padding { left, top, size: Self::gradient_size(image, borders)? };
        exact::gradient(image, padding, self.spec(), self.exact.tables.kernel, interrupt, out)
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
        let grid = self.steps(search, self.spec().cell)?.grid(image.size(), self.spec());
        let windows = locations.map_or(grid.len(), <[_]>::len);
        let elements = self.spec().descriptor_len();
        let all = windows.saturating_mul(elements);
        if all > i32::MAX as usize {
            return Err(ParameterError::Descriptors { windows, elements }.into());
        }
        Ok(all)
    }

    /// Writes the descriptors whose elements [`Hog::compute_len`] counts, one after the other, into `out`.
    ///
    /// A location whose window leaves the padded image has a descriptor of zeros.
    ///
    /// ```
    /// use hog_core::{Hog, HogParams, ImageView, Interrupt, Search};
    /// let hog = Hog::new(&HogParams::default(), None)?;
    /// let window = vec![128; 64 * 128];
    /// let image = ImageView::new(&window, 64, 128, 1, 64)?;
    /// let mut descriptor = vec![0.0; hog.compute_len(image, &Search::default(), None)?];
    /// hog.compute(image, &Search::default(), None, &Interrupt::NEVER, &mut descriptor)?;
    /// assert_eq!(descriptor.len(), 3780);
    /// # Ok::<(), hog_core::HogError>(())
    /// ```
    pub fn compute(
        &self,
        image: ImageView,
        search: &Search,
        locations: Option<&[(i64, i64)]>,
        interrupt: &Interrupt,
        out: &mut [f32],
    ) -> Result<()> {
        let grid = self.steps(search, self.spec().cell)?.grid(image.size(), self.spec());
        let Some(locations) = locations else {
            return exact::descriptors(image, &grid, self.spec(), &self.exact.tables, interrupt, out);
        };
        let places = memory::collect(locations.iter().map(|&at| grid.to_padded(at, self.spec())))?;
        let inside = memory::collect(places.iter().flatten().copied())?;
        let mut windows =
            exact::Windows::new(image, grid.padding(), &inside, self.spec(), &self.exact.tables, interrupt)?;
        for (place, out) in places.into_iter().zip(out.chunks_exact_mut(self.spec().descriptor_len().max(1)))
        {
            interrupt.check()?;
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
    ///
    /// ```
    /// use hog_core::{Hog, HogParams, ImageView, Interrupt, Search, model};
    /// let people = Hog::new(&HogParams::default(), Some(model::default_people()))?;
    /// let grey = vec![128; 320 * 240];
    /// let image = ImageView::new(&grey, 320, 240, 1, 320)?;
    /// let all = Search { hit_threshold: f64::NEG_INFINITY, ..Search::default() };
    /// let scores = people.detect_windows(image, &all, Some(&[(0, 0), (64, 40)]), &Interrupt::NEVER)?;
    /// assert_eq!((scores[1].x, scores[1].y), (64, 40));
    /// # Ok::<(), hog_core::HogError>(())
    /// ```
    pub fn detect_windows(
        &self,
        image: ImageView,
        search: &Search,
        locations: Option<&[(i64, i64)]>,
        interrupt: &Interrupt,
    ) -> Result<Vec<Hit>> {
        let Exact { spec, tables, svm, .. } = &self.exact;
        let steps = self.steps(search, spec.cell)?;
        let grid = steps.grid(image.size(), spec);
        let Some(svm) = svm else { return Ok(Vec::new()) };
        let Some(locations) = locations else {
            let level = memory::collect([Level { scale: 1.0, size: image.size() }])?;
            let options = SearchOptions { search: *search, ..SearchOptions::default() };
            let mut hits = self.hits(image, &level, &steps, svm, &options, interrupt)?;
            return Ok(hits.pop().unwrap_or_default());
        };
        let inside = memory::collect(locations.iter().filter_map(|&at| grid.to_padded(at, spec)))?;
        let mut windows = exact::Windows::new(image, grid.padding(), &inside, spec, tables, interrupt)?;
        let mut hits = Vec::new();
        for at in inside {
            interrupt.check()?;
            let hit = Hit::new(&grid, at, windows.score(at, svm));
            if hit.weight >= search.hit_threshold {
                memory::push(&mut hits, hit)?;
            }
        }
        Ok(hits)
    }

    /// Rectangles of all hits of the pyramid with their scores, grouped and clipped to its first level, in whose pixels
    /// they are.
    ///
    /// Hits are in the order of the levels, whatever the number of threads. The stride (0, 0) is the block stride. With a
    /// guide, some hits may be missed; a geometry without a fast path is searched whole.
    pub fn detect(
        &self,
        image: ImageView,
        options: &SearchOptions,
        interrupt: &Interrupt,
    ) -> Result<Vec<(Rect, f64)>> {
        let spec = self.spec();
        let steps = self.steps(&options.search, spec.stride)?;
        let Some(svm) = &self.exact.svm else { return Ok(Vec::new()) };
        let first = options.searched_size.unwrap_or(image.size());
        check(first)?;
        let levels = levels(first, options.scale, spec, interrupt)?;
        let hits = self.hits(image, &levels, &steps, svm, options, interrupt)?;
        let mut candidates = memory::with_room(hits.iter().map(Vec::len).sum())?;
        for (level, hits) in levels.iter().zip(&hits) {
            candidates.extend(hits.iter().map(|hit| self.candidate(level, hit)));
        }
        let win = spec.win;
        let found = match options.grouping {
            Grouping::None => memory::collect(candidates.iter().map(|c| (c.rect, c.weight)))?,
            Grouping::Similar(threshold) => group_candidates(&candidates, threshold, interrupt)?,
            Grouping::MeanShift(threshold) => {
                mean_shift(&candidates, threshold, (win.width as i32, win.height as i32), interrupt)?
            }
        };
        Ok(clip(found, first.width as i32, first.height as i32))
    }

    fn steps(&self, search: &Search, default_stride: Size) -> Result<Steps> {
        Steps::new(search.win_stride, search.padding, default_stride, self.spec())
    }

    fn candidate(&self, level: &Level, hit: &Hit) -> Candidate {
        let rect = to_image(hit.x, hit.y, level.scale, self.spec());
        Candidate { rect, weight: hit.weight, scale: level.scale }
    }

    /// The hits of each of `levels` of the image at the size of the first one.
    fn hits(
        &self,
        image: ImageView,
        levels: &[Level],
        steps: &Steps,
        svm: &Svm,
        options: &SearchOptions,
        interrupt: &Interrupt,
    ) -> Result<Vec<Vec<Hit>>> {
        let Exact { spec, tables, separable, .. } = &self.exact;
        let separable = separable.as_ref();
        let grids = memory::collect(levels.iter().map(|level| (level.size, steps.grid(level.size, spec))))?;
        let mut windows =
            memory::collect(grids.iter().map(|&(size, grid)| LevelWindows { size, grid, found: None }))?;
        let fast = self.plan.as_ref().filter(|_| grids.iter().all(|(_, grid)| fast::serves(grid)));
        if let Some(plan) = fast {
            let planes = self.planes(image, levels)?;
            let found = self.find(&planes, plan, levels, &grids, options, interrupt);
            PLANES.give(planes);
            PLANES.trim();
            fast::trim();
            for (level, found) in windows.iter_mut().zip(found?) {
                level.found = Some(found);
            }
        }
        let error = fast.map(Plan::score_error_bound).or(separable.map(separable::Plan::score_error_bound));
        // Mean-shift truncates to whole pixels: there the last bit of a weight can move a rectangle.
        let exact_weights = matches!(options.grouping, Grouping::MeanShift(_));
        let margin = error.filter(|&error| !exact_weights && error <= SCORE_ERROR_MAX);
        let scorer = Scorer {
            spec,
            tables,
            svm,
            separable,
            hit_threshold: options.search.hit_threshold,
            margin: margin.unwrap_or(f64::INFINITY),
        };
        rescored(image, &scorer, &windows, options.threads, interrupt)
    }

    /// The image in planes, at the size of the first level.
    fn planes(&self, image: ImageView, levels: &[Level]) -> Result<Planes> {
        let mut planes = PLANES.take();
        fast::fill_planes(self.backend, &mut planes, image)?;
        if let Some(first) = levels.first().filter(|first| first.size != image.size()) {
            let mut resized = PLANES.take();
            fast::resize_planes(self.backend, &planes, &mut resized, first.size)?;
            PLANES.give(std::mem::replace(&mut planes, resized));
        }
        Ok(planes)
    }

    /// What the fast path finds on each of `levels`: on all, or by steps that a guide leads.
    fn find(
        &self,
        planes: &Planes,
        plan: &Plan,
        levels: &[Level],
        grids: &[(Size, Grid)],
        options: &SearchOptions,
        interrupt: &Interrupt,
    ) -> Result<Vec<Vec<Found>>> {
        let (hit, guide) = (options.search.hit_threshold, options.guide.unwrap_or_default());
        let mut found = memory::filled(grids.len(), Vec::new())?;
        for step in guide.steps() {
            let regions = guide.regions(step, levels, grids, &found, hit, self.spec())?;
            // What is found here guides levels half as far off, those of the last step none.
            let thresholds = Thresholds { hit, guide: hit - guide.lowered(step / 2) };
            let task = fast::Task { backend: self.backend, plan, planes, levels: grids, regions, thresholds };
            let here = fast::search(task, options.threads, interrupt)?;
            for (found, mut here) in found.iter_mut().zip(here) {
                // Regions may share windows; their scores differ by the order of their sums.
                here.dedup_by_key(|&mut (x, y, _)| (x, y));
                if !here.is_empty() {
                    *found = here;
                }
            }
        }
        Ok(found)
    }
}

/// The hits of `levels`, close calls decided by the exact path on the image at the size of the first level.
fn rescored(
    image: ImageView,
    scorer: &Scorer,
    levels: &[LevelWindows],
    threads: usize,
    interrupt: &Interrupt,
) -> Result<Vec<Vec<Hit>>> {
    let is_needed = levels.iter().any(|level| scorer.is_needed(level));
    let first = levels.first().map_or(image.size(), |level| level.size);
    let resized = if is_needed && first != image.size() {
        Some(Image { data: resize(image, first)?, size: first, channels: image.channels() })
    } else {
        None
    };
    let image = resized.as_ref().map_or(Ok(image), Image::view)?;
    let threads = if is_needed { threads } else { 1 };
    in_order(levels, threads, interrupt, |level, interrupt| scorer.hits(image, level, interrupt))
}
