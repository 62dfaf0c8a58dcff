//! The hits of one level: found by the fast path, close calls decided by the exact path.

use std::ops::Range;

use crate::error::Result;
use crate::exact::{self, Svm, Tables};
use crate::fast::Found;
use crate::geometry::Size;
use crate::image::{Image, ImageView};
use crate::interrupt::Interrupt;
use crate::memory;
use crate::params::HogSpec;
use crate::pyramid::{Grid, resize, resize_part};
use crate::separable;

/// A window that scored at least the threshold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Left edge of the window; negative inside the padding \[px\].
    pub x: i64,
    /// Upper edge \[px\].
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
    /// The exact path scores again what `fast` or `separable` scored no further than this from the threshold.
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
        let is_hit = |&&(_, _, score): &&Found| score >= self.hit_threshold;
        let hit = |&(x, y, score): &Found| Hit::new(grid, (x, y), score);
        let found = match found {
            Some(found) if !self.is_needed(level) => {
                return memory::collect(found.iter().filter(is_hit).map(hit));
            }
            Some(found) => {
                let found = memory::collect(found.iter().copied())?;
                self.rescored(image, *size, grid, found, interrupt)?
            }
            None => self.searched(LevelImage::new(image, *size)?.view()?, grid, interrupt)?,
        };
        memory::collect(found.iter().filter(is_hit).map(hit))
    }

    /// The hits of a level without a fast path, and perhaps some windows more.
    fn searched(&self, level: ImageView, grid: &Grid, interrupt: &Interrupt) -> Result<Vec<Found>> {
        let Self { spec, tables, svm, .. } = *self;
        if let Some(plan) = self.separable {
            let least = self.hit_threshold - plan.score_error_bound();
            let found = separable::search(level, grid, spec, tables.kernel, plan, least, interrupt)?;
            return self.rescored(level, level.size(), grid, found, interrupt);
        }
        let scores = exact::scores(level, grid, spec, tables, svm, interrupt)?;
        let place = |(index, score): (usize, f64)| {
            let (column, row) = (index % grid.windows.width, index / grid.windows.width);
            (column * grid.stride.width, row * grid.stride.height, score)
        };
        let hits = scores.into_iter().enumerate().filter(|&(_, score)| score >= self.hit_threshold);
        memory::collect(hits.map(place))
    }

    /// Whether the fast score is too near to the threshold; one that is not a number is never sure.
    fn is_close(&self, &(_, _, score): &Found) -> bool {
        let is_sure = (score - self.hit_threshold).abs() > self.margin;
        !is_sure
    }

    /// What was found on the level of `size` pixels, with the exact score of every close call.
    fn rescored(
        &self,
        image: ImageView,
        size: Size,
        grid: &Grid,
        mut found: Vec<Found>,
        interrupt: &Interrupt,
    ) -> Result<Vec<Found>> {
        let close = found.iter().filter(|found| self.is_close(found)).count();
        let Self { spec, tables, svm, .. } = *self;
        // Neighbouring windows share pixels and blocks: scoring all at once is cheaper than scoring many one by one.
        let at_once = close * spec.win.area() > grid.padded.area();
        let all = if at_once {
            let level = LevelImage::new(image, size)?;
            exact::scores(level.view()?, grid, spec, tables, svm, interrupt)?
        } else {
            Vec::new()
        };
        for found in found.iter_mut().filter(|found| self.is_close(found)) {
            let (x, y, _) = *found;
            let index = y / grid.stride.height * grid.windows.width + x / grid.stride.width;
            found.2 = match all.get(index) {
                Some(&score) => score,
                None => self.exact_score(image, size, grid, (x, y), interrupt)?,
            };
        }
        Ok(found)
    }

    /// The exact score of one window of the level of `size` pixels; no others than its own are made.
    fn exact_score(
        &self,
        image: ImageView,
        size: Size,
        grid: &Grid,
        at: (usize, usize),
        interrupt: &Interrupt,
    ) -> Result<f64> {
        let Self { spec, tables, svm, .. } = *self;
        let mut padding = grid.padding();
        if size == image.size() {
            return exact::window_score(image, padding, at, spec, tables, svm, interrupt);
        }
        let columns = seen(at.0, grid.pad.width, spec.win.width, size.width);
        let rows = seen(at.1, grid.pad.height, spec.win.height, size.height);
        padding.left += columns.start as i64;
        padding.top += rows.start as i64;
        let part = Size::new(columns.len(), rows.len());
        let data = resize_part(image, size, columns, rows)?;
        let part = Image { data, size: part, channels: image.channels() };
        exact::window_score(part.view()?, padding, at, spec, tables, svm, interrupt)
    }
}

/// The pixels that a window at padded `at` sees along one axis of a level: its own and a neighbour on both sides; where some
/// of these are mirrored, all there are.
fn seen(at: usize, pad: usize, win: usize, length: usize) -> Range<usize> {
    let end = (at + win + 1).saturating_sub(pad);
    match at.checked_sub(pad + 1) {
        Some(start) if end <= length => start..end,
        _ => 0..length,
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

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may fail")]
mod tests {
    use super::*;
    use crate::model;
    use crate::params::HogParams;
    use crate::pyramid::Steps;

    /// Every window of a level, alone and with all others, also where it sees mirrored pixels.
    fn assert_alone_as_together(image: Size, level: Size, channels: usize, padding: (i64, i64)) {
        let data: Vec<u8> = (0..image.area() * channels).map(|i| (i * i / 11 + 5 * i) as u8).collect();
        let image =
            ImageView::new(&data, image.width, image.height, channels, image.width * channels).unwrap();
        let spec = HogSpec::new(&HogParams::default()).unwrap();
        let (tables, svm) = (Tables::new(&spec).unwrap(), Svm::new(model::default_people(), &spec).unwrap());
        let scorer = Scorer {
            spec: &spec,
            tables: &tables,
            svm: &svm,
            separable: None,
            hit_threshold: 0.0,
            margin: 0.0,
        };
        let grid = Steps::new((8, 8), padding, spec.cell, &spec).unwrap().grid(level, &spec);
        assert!(!grid.is_empty());
        let shrunk = LevelImage::new(image, level).unwrap();
        let all =
            exact::scores(shrunk.view().unwrap(), &grid, &spec, &tables, &svm, &Interrupt::NEVER).unwrap();
        for (index, score) in all.into_iter().enumerate() {
            let at = (8 * (index % grid.windows.width), 8 * (index / grid.windows.width));
            let alone = scorer.exact_score(image, level, &grid, at, &Interrupt::NEVER).unwrap();
            assert_eq!(alone, score, "{channels} channels, {level:?}, {at:?}");
        }
    }

    #[test]
    fn a_window_alone_scores_as_among_all_of_its_level() {
        assert_alone_as_together(Size::new(190, 290), Size::new(131, 203), 1, (4, 4));
        assert_alone_as_together(Size::new(190, 290), Size::new(130, 200), 3, (0, 0));
        assert_alone_as_together(Size::new(190, 290), Size::new(99, 150), 3, (40, 24));
        assert_alone_as_together(Size::new(40, 60), Size::new(20, 30), 1, (80, 96));
        assert_alone_as_together(Size::new(90, 150), Size::new(90, 150), 3, (8, 8));
    }
}
