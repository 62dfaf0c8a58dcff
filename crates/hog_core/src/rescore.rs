//! The hits of one level: found by the fast path, close calls decided by the exact path.

use crate::error::Result;
use crate::exact::{self, Svm, Tables};
use crate::fast::Found;
use crate::geometry::Size;
use crate::image::{Image, ImageView};
use crate::interrupt::Interrupt;
use crate::memory;
use crate::params::HogSpec;
use crate::pyramid::{Grid, resize};
use crate::separable;

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

/// What the exact path needs to score windows.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scorer<'a> {
    pub spec: &'a HogSpec,
    pub tables: &'a Tables,
    pub svm: &'a Svm,
    /// How levels that the fast path has not searched are, where the geometry allows it.
    pub separable: Option<&'a separable::Plan>,
    /// A window whose score is at least this is a hit.
    pub hit_threshold: f64,
    /// Windows whose fast score, or that by sums that separate, is no further than this from the threshold are scored again by the exact path.
    pub margin: f64,
}

/// One level of an image.
#[derive(Debug)]
pub(crate) struct LevelWindows {
    pub size: Size,
    pub grid: Grid,
    /// What the fast path found, row by row; none where the exact path is to score all windows.
    pub found: Option<Vec<Found>>,
}

impl Scorer<'_> {
    /// Whether the exact path has to look at this level.
    pub(crate) fn is_needed(&self, level: &LevelWindows) -> bool {
        level.found.as_ref().is_none_or(|found| found.iter().any(|found| self.is_close(found)))
    }

    /// The hits of a level, row by row.
    pub(crate) fn hits(
        &self,
        image: ImageView,
        level: &LevelWindows,
        interrupt: &Interrupt,
    ) -> Result<Vec<Hit>> {
        let LevelWindows { size, grid, found } = level;
        let hit = |&(x, y, score): &Found| Hit::new(grid, (x, y), score);
        let is_hit = |&&(_, _, score): &&Found| score >= self.hit_threshold;
        let Some(found) = found else {
            let level = LevelImage::new(image, *size)?;
            if let Some(plan) = self.separable {
                let least = self.hit_threshold - plan.score_error_bound();
                let found = separable::search(level.view()?, grid, self.spec, plan, least, interrupt)?;
                return memory::collect(
                    self.rescored(level.view()?, grid, found, interrupt)?.iter().filter(is_hit).map(hit),
                );
            }
            let scores = exact::scores(level.view()?, grid, self.spec, self.tables, self.svm, interrupt)?;
            let place = |index: usize, score: f64| {
                let (column, row) = (index % grid.windows.width, index / grid.windows.width);
                (column * grid.stride.width, row * grid.stride.height, score)
            };
            let all = scores.into_iter().enumerate().map(|(index, score)| place(index, score));
            return memory::collect(all.filter(|found| is_hit(&found)).map(|found| hit(&found)));
        };
        if !found.iter().any(|found| self.is_close(found)) {
            return memory::collect(found.iter().filter(is_hit).map(hit));
        }
        let level = LevelImage::new(image, *size)?;
        let found = memory::collect(found.iter().copied())?;
        let rescored = self.rescored(level.view()?, grid, found, interrupt)?;
        memory::collect(rescored.iter().filter(is_hit).map(hit))
    }

    /// Whether the fast score is too near to the threshold; one that is not a number is never sure.
    fn is_close(&self, &(_, _, score): &Found) -> bool {
        let is_sure = (score - self.hit_threshold).abs() > self.margin;
        !is_sure
    }

    /// `found` with the exact score of every close call.
    fn rescored(
        &self,
        level: ImageView,
        grid: &Grid,
        mut found: Vec<Found>,
        interrupt: &Interrupt,
    ) -> Result<Vec<Found>> {
        let close = found.iter().filter(|found| self.is_close(found)).count();
        let Self { spec, tables, svm, .. } = *self;
        // Neighbouring windows share pixels and blocks: scoring all at once is cheaper than scoring many one by one.
        let at_once = close * spec.win.area() > grid.padded.area();
        let all =
            if at_once { exact::scores(level, grid, spec, tables, svm, interrupt)? } else { Vec::new() };
        for found in found.iter_mut().filter(|found| self.is_close(found)) {
            let (x, y, _) = *found;
            let index = y / grid.stride.height * grid.windows.width + x / grid.stride.width;
            found.2 = match all.get(index) {
                Some(&score) => score,
                None => exact::window_score(level, grid, (x, y), spec, tables, svm, interrupt)?,
            };
        }
        Ok(found)
    }
}

/// The image at a level's size.
enum LevelImage<'a> {
    Same(ImageView<'a>),
    Shrunk(Image),
}

impl<'a> LevelImage<'a> {
    fn new(image: ImageView<'a>, size: Size) -> Result<Self> {
        if size == image.size() {
            return Ok(Self::Same(image));
        }
        Ok(Self::Shrunk(Image { data: resize(image, size)?, size, channels: image.channels() }))
    }

    fn view(&self) -> Result<ImageView<'_>> {
        match self {
            Self::Same(view) => Ok(*view),
            Self::Shrunk(image) => image.view(),
        }
    }
}
