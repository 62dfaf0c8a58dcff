//! The hits of one level: found by the fast path, close calls decided by the exact path.

use crate::error::Result;
use crate::exact::{self, Svm, Tables};
use crate::fast::{self, Backend, Plan, Planes};
use crate::geometry::Size;
use crate::image::ImageView;
use crate::interrupt::Interrupt;
use crate::memory::{self, Pool};
use crate::params::HogSpec;
use crate::pyramid::{Grid, resize};

/// Scratch memory of the fast path, one per thread at work.
pub(crate) static SCRATCH: Pool<fast::Scratch> = Pool::new();

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
    pub(crate) fn new(grid: &Grid, (x, y): (usize, usize), weight: f64) -> Self {
        let (x, y) = grid.to_image(x, y);
        Self { x, y, weight }
    }
}

/// The fast path at work on one image.
#[derive(Clone, Copy)]
pub(crate) struct Fast<'a> {
    pub backend: Backend,
    pub plan: &'a Plan,
    pub planes: &'a Planes,
    /// Windows whose fast score is no further than this from the threshold are scored again by the exact path.
    pub rescore_margin: f64,
}

/// A window of a level: padded x, padded y, score.
type Found = (usize, usize, f64);

/// One search of an image for windows that score at least `hit_threshold`, on any of its levels.
#[derive(Clone, Copy)]
pub(crate) struct Scorer<'a> {
    pub image: ImageView<'a>,
    /// Size of the first level, of which the others are made.
    pub first: Size,
    pub spec: &'a HogSpec,
    pub tables: &'a Tables,
    pub svm: &'a Svm,
    /// The fast path, where the geometry has one.
    pub fast: Option<Fast<'a>>,
    pub hit_threshold: f64,
}

impl Scorer<'_> {
    /// The hits among all windows of the level of `size` pixels, row by row.
    pub(crate) fn hits(&self, size: Size, grid: &Grid, interrupt: &Interrupt) -> Result<Vec<Hit>> {
        match &self.fast {
            Some(fast) if fast::serves(grid) => self.fast_hits(fast, size, grid, interrupt),
            _ => self.exact_hits(size, grid, interrupt),
        }
    }

    /// The hits by the exact path alone.
    fn exact_hits(&self, size: Size, grid: &Grid, interrupt: &Interrupt) -> Result<Vec<Hit>> {
        let level = LevelImage::new(self.image, self.first, size)?;
        let scores = exact::scores(level.view()?, grid, self.spec, self.tables, self.svm, interrupt)?;
        let place = |index: usize| {
            let (column, row) = (index % grid.windows.width, index / grid.windows.width);
            (column * grid.stride.width, row * grid.stride.height)
        };
        let hits = scores.into_iter().enumerate().filter(|&(_, score)| score >= self.hit_threshold);
        memory::collect(hits.map(|(index, score)| Hit::new(grid, place(index), score)))
    }

    /// The hits by the fast path, each close call decided by the exact path.
    fn fast_hits(&self, fast: &Fast, size: Size, grid: &Grid, interrupt: &Interrupt) -> Result<Vec<Hit>> {
        SCRATCH.with(|scratch| {
            let Fast { backend, plan, planes, rescore_margin } = *fast;
            let threshold = self.hit_threshold;
            let task = fast::Task { plan, source: planes, size, grid, threshold, interrupt };
            fast::detect(backend, task, scratch)?;
            self.rescore_close_calls(rescore_margin, size, grid, interrupt, &mut scratch.found)?;
            let hits = scratch.found.iter().filter(|&&(_, _, score)| score >= self.hit_threshold);
            memory::collect(hits.map(|&(x, y, score)| Hit::new(grid, (x, y), score)))
        })
    }

    /// Gives the exact score to every window of `found` whose score is within `margin` of the threshold.
    fn rescore_close_calls(
        &self,
        margin: f64,
        size: Size,
        grid: &Grid,
        interrupt: &Interrupt,
        found: &mut [Found],
    ) -> Result<()> {
        // A score that is not a number is never sure.
        let is_sure = |score: f64| (score - self.hit_threshold).abs() > margin;
        let close = found.iter().filter(|&&(_, _, score)| !is_sure(score)).count();
        if close == 0 {
            return Ok(());
        }
        let level = LevelImage::new(self.image, self.first, size)?;
        let level = level.view()?;
        let Self { spec, tables, svm, .. } = self;
        // Neighbouring windows share pixels and blocks: scoring all at once is cheaper than scoring many one by one.
        let at_once = close * spec.win.area() > grid.padded.area();
        let all =
            if at_once { exact::scores(level, grid, spec, tables, svm, interrupt)? } else { Vec::new() };
        for (x, y, score) in found.iter_mut().filter(|(_, _, score)| !is_sure(*score)) {
            let index = *y / grid.stride.height * grid.windows.width + *x / grid.stride.width;
            *score = match all.get(index) {
                Some(&score) => score,
                None => exact::window_score(level, grid, (*x, *y), spec, tables, svm, interrupt)?,
            };
        }
        Ok(())
    }
}

/// The image at a level's size.
struct LevelImage<'a> {
    image: ImageView<'a>,
    /// Its size and pixels, unless it is the image itself.
    pixels: Option<(Size, Vec<u8>)>,
}

impl<'a> LevelImage<'a> {
    /// The image resized to `first`, and that to `size`.
    fn new(image: ImageView<'a>, first: Size, size: Size) -> Result<Self> {
        let mut level = Self { image, pixels: None };
        for size in [first, size] {
            let view = level.view()?;
            if size != view.size() {
                level.pixels = Some((size, resize(view, size)?));
            }
        }
        Ok(level)
    }

    fn view(&self) -> Result<ImageView<'_>> {
        let Some((size, pixels)) = &self.pixels else { return Ok(self.image) };
        let channels = self.image.channels();
        ImageView::new(pixels, size.width, size.height, channels, size.width * channels)
    }
}
