//! Composes the stages: descriptors and hits of one image, and of a whole pyramid on several threads.

use crate::error::{BackendError, ParameterError, Result};
use crate::exact::{self, Gradient, Svm, Tables};
use crate::fast::{self, Backend, Plan, Planes};
use crate::geometry::{Padding, Rect, Size};
use crate::group::{Candidate, clip, group_candidates, mean_shift};
use crate::image::ImageView;
use crate::interrupt::Interrupt;
use crate::memory::{self, Pool};
use crate::params::{HogParams, HogSpec};
use crate::pyramid::{Level, Pyramid, Steps, check, levels, to_image};
use crate::rescore::{Fast, Hit, SCRATCH, Scorer};
use crate::threads::in_order;

/// A detector: a geometry and, for finding things, a linear SVM. Immutable, so threads may share it.
#[derive(Debug, Clone)]
pub struct Hog {
    spec: HogSpec,
    tables: Tables,
    svm: Option<Svm>,
    /// The fast path, where the geometry has one.
    plan: Option<Plan>,
    backend: Backend,
}

/// The image in planes for the fast path, shared by all levels of a call.
static PLANES: Pool<Planes> = Pool::new();

/// Where the fast path's scores may be further off than this, it only finds the hits: the exact path weighs them all.
const SCORE_ERROR_MAX: f64 = 1e-4;

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

impl Hog {
    /// A detector of this geometry; `coefficients` of the SVM, if any, must fit it.
    pub fn new(params: &HogParams, coefficients: Option<&[f32]>) -> Result<Self> {
        Self::with_backend(params, coefficients, Backend::current()?)
    }

    /// [`new`](Self::new) with a backend other than the one in force; this CPU must have it.
    pub fn with_backend(params: &HogParams, coefficients: Option<&[f32]>, backend: Backend) -> Result<Self> {
        if !backend.is_available() {
            return Err(BackendError::Missing { name: backend.name() }.into());
        }
        let spec = HogSpec::new(params)?;
        let svm = coefficients.map(|c| Svm::new(c, &spec)).transpose()?;
        let plan = svm.as_ref().and_then(|svm| fast::plan(backend, &spec, svm));
        Ok(Self { tables: Tables::new(&spec)?, spec, svm, plan, backend })
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
        interrupt: &Interrupt,
    ) -> Result<(Gradient, Size)> {
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
        let padding = Padding { left, top, size };
        Ok((exact::gradient(image, padding, &self.spec, &self.tables, interrupt)?, size))
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
        let grid = self.steps(search, self.spec.cell)?.grid(image.size(), &self.spec);
        let windows = locations.map_or(grid.len(), <[_]>::len);
        let elements = self.spec.descriptor_len();
        let all = windows.saturating_mul(elements);
        if all > i32::MAX as usize {
            return Err(ParameterError::Descriptors { windows, elements }.into());
        }
        Ok(all)
    }

    /// Writes the descriptors whose elements [`Hog::compute_len`] counts, one after the other, into `out`.
    ///
    /// A location whose window leaves the padded image has a descriptor of zeros.
    pub fn compute(
        &self,
        image: ImageView,
        search: &Search,
        locations: Option<&[(i64, i64)]>,
        interrupt: &Interrupt,
        out: &mut [f32],
    ) -> Result<()> {
        let grid = self.steps(search, self.spec.cell)?.grid(image.size(), &self.spec);
        let Some(locations) = locations else {
            return exact::descriptors(image, &grid, &self.spec, &self.tables, interrupt, out);
        };
        let places = memory::collect(locations.iter().map(|&at| grid.to_padded(at, &self.spec)))?;
        let inside = memory::collect(places.iter().flatten().copied())?;
        let mut windows = exact::Windows::new(image, &grid, &inside, &self.spec, &self.tables, interrupt)?;
        for (place, out) in places.into_iter().zip(out.chunks_exact_mut(self.spec.descriptor_len().max(1))) {
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
    pub fn detect(
        &self,
        image: ImageView,
        search: &Search,
        locations: Option<&[(i64, i64)]>,
        interrupt: &Interrupt,
    ) -> Result<Vec<Hit>> {
        let grid = self.steps(search, self.spec.cell)?.grid(image.size(), &self.spec);
        let Some(svm) = &self.svm else { return Ok(Vec::new()) };
        let Some(locations) = locations else {
            let find = |scorer: &Scorer| scorer.hits(image.size(), &grid, interrupt);
            return self.with_scorer(image, image.size(), svm, search, false, find);
        };
        let inside = memory::collect(locations.iter().filter_map(|&at| grid.to_padded(at, &self.spec)))?;
        let mut windows = exact::Windows::new(image, &grid, &inside, &self.spec, &self.tables, interrupt)?;
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

    /// Rectangles of all hits of the pyramid, grouped and clipped to its first level, in whose pixels they are.
    ///
    /// Levels are shared among `threads` threads; hits are in level order, whatever their number. The stride (0, 0)
    /// is the block stride.
    pub fn detect_multi_scale(
        &self,
        image: ImageView,
        search: &Search,
        pyramid: &Pyramid,
        grouping: Grouping,
        threads: usize,
        interrupt: &Interrupt,
    ) -> Result<Vec<(Rect, f64)>> {
        let steps = self.steps(search, self.spec.stride)?;
        let Some(svm) = &self.svm else { return Ok(Vec::new()) };
        let first = pyramid.first.unwrap_or(image.size());
        check(first)?;
        let levels = levels(first, pyramid.scale, &self.spec, interrupt)?;
        // Mean-shift truncates to whole pixels: there the last bit of a weight can move a rectangle.
        let exact_weights = matches!(grouping, Grouping::MeanShift(_));
        let search_levels = |scorer: &Scorer| -> Result<Vec<Candidate>> {
            let of_level = |level: &Level, interrupt: &Interrupt| {
                self.level_candidates(scorer, level, &steps, interrupt)
            };
            let mut candidates = Vec::new();
            for found in in_order(&levels, threads, interrupt, of_level)? {
                memory::reserve_some(&mut candidates, found.len())?;
                candidates.extend(found);
            }
            Ok(candidates)
        };
        let candidates = self.with_scorer(image, first, svm, search, exact_weights, search_levels)?;
        let win = self.spec.win;
        let found = match grouping {
            Grouping::Similar(threshold) => group_candidates(&candidates, threshold, interrupt)?,
            Grouping::MeanShift(threshold) => {
                mean_shift(&candidates, threshold, (win.width as i32, win.height as i32), interrupt)?
            }
        };
        Ok(clip(found, first.width as i32, first.height as i32))
    }

    fn steps(&self, search: &Search, default_stride: Size) -> Result<Steps> {
        Steps::new(search.win_stride, search.padding, default_stride, &self.spec)
    }

    /// Runs `work` with a scorer of the image at the size `first`: by the fast path, where the geometry has one.
    fn with_scorer<R>(
        &self,
        image: ImageView,
        first: Size,
        svm: &Svm,
        search: &Search,
        exact_weights: bool,
        work: impl FnOnce(&Scorer) -> Result<R>,
    ) -> Result<R> {
        let Self { spec, tables, plan, backend, .. } = self;
        let hit_threshold = search.hit_threshold;
        let exact = Scorer { image, first, spec, tables, svm, hit_threshold, fast: None };
        let Some(plan) = plan else { return work(&exact) };
        let error = plan.score_error_bound();
        let rescore_margin = if exact_weights || error > SCORE_ERROR_MAX { f64::INFINITY } else { error };
        let found = PLANES.with(|planes| {
            let search = |planes: &Planes| {
                work(&Scorer {
                    fast: Some(Fast { backend: *backend, plan, planes, rescore_margin }),
                    ..exact
                })
            };
            fast::fill_planes(*backend, planes, image)?;
            if first == image.size() {
                return search(planes);
            }
            PLANES.with(|resized| {
                SCRATCH.with(|scratch| fast::resize_planes(*backend, planes, resized, first, scratch))?;
                search(resized)
            })
        });
        // Not after each level: the levels of a large image use large workspaces again.
        PLANES.trim();
        SCRATCH.trim();
        found
    }

    fn level_candidates(
        &self,
        scorer: &Scorer,
        level: &Level,
        steps: &Steps,
        interrupt: &Interrupt,
    ) -> Result<Vec<Candidate>> {
        let hits = scorer.hits(level.size, &steps.grid(level.size, &self.spec), interrupt)?;
        let candidate = |hit: &Hit| Candidate {
            rect: to_image(hit.x, hit.y, level.scale, &self.spec),
            weight: hit.weight,
            scale: level.scale,
        };
        memory::collect(hits.iter().map(candidate))
    }
}
