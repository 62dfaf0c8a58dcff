//! What to look for, and how.

use crate::geometry::Size;
use crate::guided::Guide;

/// Where and how densely to look on one level.
///
/// ```
/// use hog_core::Search;
/// let strict = Search { hit_threshold: 0.5, win_stride: (8, 8), padding: (16, 16) };
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq)]
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
    /// Every hit is returned.
    None,
    /// Groups of more than this many similar rectangles; below 1 every hit is returned, as OpenCV does.
    Similar(i32),
    /// Modes of the hits' density with more than this weight (Dalal's thesis, 2006, chapter 5).
    MeanShift(f64),
}

/// How a pyramid is searched; the defaults are OpenCV's, on one thread.
///
/// ```
/// use hog_core::{Grouping, SearchOptions};
/// let options = SearchOptions { scale: 1.1, grouping: Grouping::None, ..SearchOptions::default() };
/// assert_eq!(options.threads, 1);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SearchOptions {
    /// On each level.
    pub search: Search,
    /// How much each level is smaller than the one before; 1 or less: one level alone.
    pub scale: f64,
    /// Size of the first level, to which the image is resized before all else; none: the image's own.
    pub searched_size: Option<Size>,
    /// What becomes of the hits.
    pub grouping: Grouping,
    /// Where to look between the levels that are searched whole: faster, and some hits may be missed. None: everywhere.
    pub guide: Option<Guide>,
    /// How many threads share the work; the result is the same whatever their number.
    pub threads: usize,
}

impl Default for SearchOptions {
    fn default() -> Self {
        Self {
            search: Search::default(),
            scale: 1.05,
            searched_size: None,
            grouping: Grouping::Similar(2),
            guide: None,
            threads: 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_are_those_of_opencvs_detect_multi_scale() {
        let wanted = SearchOptions {
            search: Search { hit_threshold: 0.0, win_stride: (0, 0), padding: (0, 0) },
            scale: 1.05,
            searched_size: None,
            grouping: Grouping::Similar(2),
            guide: None,
            threads: 1,
        };
        assert_eq!(SearchOptions::default(), wanted);
    }
}
