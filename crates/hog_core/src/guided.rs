//! A faster search that may miss some hits: a few levels are searched whole, those between them around what was found.
//!
//! Kept for `PeopleDetector(search="guided")` and `limo-hog detect --search guided`; docs/simd.md says what it gains and
//! loses. The halving is kept, too: on ten photographs of 640 px (gray, one thread, processor time, interleaved) the search
//! took 1.3 times as long where every second level guided the one behind it, with every fourth 1.06, every sixteenth 1.03.
//!
//! A person's hits lie on several neighbouring levels, at nearly the same place in the image. So where nothing came near to
//! the threshold on the levels around it, a level has rarely a hit. The middle between two levels is searched around what
//! these show; then the middles of the halves, and so on: the nearer a level is, the better it tells. What is searched, is
//! searched exactly.

use std::ops::Range;

use crate::error::Result;
use crate::fast::{Found, Region};
use crate::geometry::Size;
use crate::memory;
use crate::params::HogSpec;
use crate::pyramid::{Grid, Level};

/// How the search is guided; by default it is not: every level is searched whole.
///
/// ```
/// use hog_core::{Guide, Hog, HogParams, ImageView, Interrupt, SearchOptions, model};
/// let people = Hog::new(&HogParams::default(), Some(model::default_people()))?;
/// let grey = vec![128; 640 * 480];
/// let image = ImageView::new(&grey, 640, 480, 1, 640)?;
/// // Every eighth level whole, then the middle of those between, and so on: the one that limo-hog uses.
/// let guide = Some(Guide { halvings: 3, margin: 0.75, reach: (0.75, 1.25) });
/// let found = people.detect(image, &SearchOptions { guide, ..SearchOptions::default() }, &Interrupt::NEVER)?;
/// # Ok::<(), hog_core::HogError>(())
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Guide {
    /// How often the levels between two that are searched whole are halved: of 2 to this power, one is.
    pub halvings: u32,
    /// By how much the threshold is lowered where the level next to one is looked at [SVM margin]; √d times as much
    /// where it is the d-th: a person's scores fall the more the further off a level is.
    pub margin: f64,
    /// How far around a place windows are searched along x and y, and at least the nearest one [window strides].
    pub reach: (f64, f64),
}

impl Guide {
    /// Every how many levels one is searched whole.
    fn every(&self) -> usize {
        1 << self.halvings.min(16)
    }

    /// The distances of levels from those that guide them, in the order in which they are searched; the first is that of
    /// the levels searched whole.
    pub(crate) fn steps(&self) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(self.every()), |step| (*step > 1).then_some(step / 2))
    }

    /// By how much the threshold is lowered on levels that guide others `distance` off [SVM margin].
    pub(crate) fn lowered(&self, distance: usize) -> f64 {
        self.margin * (distance as f64).sqrt()
    }

    /// Where to search on the levels of a `step`: those of the first one whole, others around the windows `found` so far on
    /// the levels a step before and behind.
    pub(crate) fn regions(
        &self,
        step: usize,
        levels: &[Level],
        grids: &[(Size, Grid)],
        found: &[Vec<Found>],
        threshold: f64,
        spec: &HogSpec,
    ) -> Result<Vec<Region>> {
        let (is_whole, least) = (step == self.every(), threshold - self.lowered(step));
        let mut regions = Vec::new();
        for (number, (level, (_, grid))) in levels.iter().zip(grids).enumerate() {
            let is_of_step = number % step == 0 && (is_whole || number % (2 * step) != 0);
            if grid.is_empty() || !is_of_step {
                continue;
            }
            if is_whole {
                memory::push(&mut regions, Region::whole(number, grid))?;
                continue;
            }
            let first = regions.len();
            for guide in [number - step, number + step] {
                let (Some(guiding), Some((_, from)), Some(found)) =
                    (levels.get(guide), grids.get(guide), found.get(guide))
                else {
                    continue;
                };
                // (A search gives some windows more than those above its threshold: all that its prefilter let through.)
                for &(x, y, _) in found.iter().filter(|&&(_, _, score)| score >= least) {
                    let place = |at: usize, pads: [usize; 2], win: usize, stride: usize| {
                        let half = win as f64 / 2.0;
                        let centre = (at as f64 - pads[0] as f64 + half) * guiding.scale;
                        (centre / level.scale - half + pads[1] as f64) / stride as f64
                    };
                    let Grid { pad, stride, windows, .. } = grid;
                    let x = place(x, [from.pad.width, pad.width], spec.win.width, stride.width);
                    let y = place(y, [from.pad.height, pad.height], spec.win.height, stride.height);
                    let x = around(x, self.reach.0, windows.width, stride.width);
                    let y = around(y, self.reach.1, windows.height, stride.height);
                    memory::push(&mut regions, Region { level: number, x, y })?;
                }
            }
            merge(&mut regions, first, spec.win);
            let parts: usize = regions[first..].iter().map(|region| region_cost(region, spec.win)).sum();
            if parts >= cost(grid.padded.width, grid.padded.height) {
                regions.truncate(first);
                memory::push(&mut regions, Region::whole(number, grid))?;
            }
        }
        Ok(regions)
    }
}

/// The corners of the windows within `reach` of place `at` [strides], as far as there are any; at least the nearest one's
/// [px].
fn around(at: f64, reach: f64, windows: usize, stride: usize) -> Range<usize> {
    let last = (windows - 1) as f64;
    let nearest = at.round();
    let from = (at - reach).ceil().min(nearest).clamp(0.0, last);
    let to = (at + reach).floor().max(nearest).clamp(0.0, last);
    from as usize * stride..to as usize * stride + 1
}

/// Makes one of two regions from `first` on, until no two cost less together.
fn merge(regions: &mut Vec<Region>, first: usize, win: Size) {
    regions[first..].sort_unstable_by_key(|Region { x, y, .. }| (y.start, x.start, y.end, x.end));
    let mut at = first;
    while at < regions.len() {
        let mut other = at + 1;
        while other < regions.len() {
            let both = union(&regions[at], &regions[other]);
            if region_cost(&both, win) <= region_cost(&regions[at], win) + region_cost(&regions[other], win) {
                regions[at] = both;
                regions.swap_remove(other);
                other = at + 1;
            } else {
                other += 1;
            }
        }
        at += 1;
    }
}

fn union(a: &Region, b: &Region) -> Region {
    let along = |a: &Range<usize>, b: &Range<usize>| a.start.min(b.start)..a.end.max(b.end);
    Region { level: a.level, x: along(&a.x, &b.x), y: along(&a.y, &b.y) }
}

/// What a region costs.
fn region_cost(region: &Region, win: Size) -> usize {
    cost(region.x.len() - 1 + win.width, region.y.len() - 1 + win.height)
}

/// What so many pixels cost: rows of whole vectors of 16 cells, of which half a one costs eleven twentieths, and a row of
/// cells more. All backends reckon so, that they search the same windows.
fn cost(width: usize, height: usize) -> usize {
    let cells = width.div_ceil(8);
    let rest = match cells % 16 {
        0 => 0,
        1..=8 => 11,
        _ => 20,
    };
    (20 * (cells / 16) + rest) * (height + 8)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may fail")]
mod tests {
    use super::*;
    use crate::interrupt::Interrupt;
    use crate::params::HogParams;
    use crate::pyramid::{Steps, levels};

    const WIN: Size = Size { width: 64, height: 128 };

    fn region(x: usize, y: usize) -> Region {
        Region { level: 1, x: x..x + 17, y: y..y + 17 }
    }

    #[test]
    fn neighbouring_regions_become_one_and_distant_ones_stay_apart() {
        let mut regions = vec![region(0, 0), region(600, 0), region(24, 8), region(8, 0)];
        merge(&mut regions, 0, WIN);
        assert_eq!(regions.len(), 2);
        assert!(regions.iter().any(|region| region.x == (0..41) && region.y == (0..25)));
    }

    #[test]
    fn the_order_in_which_regions_are_found_does_not_matter() {
        let merged = |places: &[(usize, usize)]| {
            let mut regions: Vec<_> = places.iter().map(|&(x, y)| region(x, y)).collect();
            merge(&mut regions, 0, WIN);
            let corners = |region: &Region| (region.x.start, region.x.end, region.y.start, region.y.end);
            let mut corners: Vec<_> = regions.iter().map(corners).collect();
            corners.sort_unstable();
            corners
        };
        for seed in 0..100 {
            let place = |i: usize| (8 * ((i * i * 7 + 31 * seed) % 97), 8 * ((i * 29 + seed * i) % 41));
            let mut places: Vec<_> = (1..13).map(place).collect();
            let wanted = merged(&places);
            places.reverse();
            assert_eq!(merged(&places), wanted, "{seed}");
        }
    }

    #[test]
    fn two_regions_that_cost_less_together_become_one() {
        for other in [(8, 0), (0, 8), (24, 16), (0, 152)] {
            let mut regions = vec![region(0, 0), region(other.0, other.1)];
            merge(&mut regions, 0, WIN);
            assert_eq!(regions.len(), 1, "{other:?}");
        }
    }

    #[test]
    fn a_region_costs_rows_of_vectors_of_16_cells_or_halves_and_a_row_of_cells_more() {
        let region =
            |columns: usize, rows: usize| Region { level: 1, x: 8..8 * columns + 1, y: 0..8 * rows - 7 };
        // A window is 8 cells wide, so that nine side by side fill a vector.
        for (columns, vectors) in [(1, 11), (2, 20), (9, 20), (10, 31), (17, 31), (18, 40), (25, 40)] {
            assert_eq!(region_cost(&region(columns, 3), WIN), vectors * (8 * 2 + 128 + 8), "{columns}");
        }
    }

    #[test]
    fn windows_around_a_place_are_within_reach_and_on_the_level() {
        assert_eq!(around(3.0, 1.0, 10, 8), 16..33);
        assert_eq!(around(3.3, 0.75, 10, 8), 24..33);
        assert_eq!(around(3.1, 0.75, 10, 8), 24..25);
        assert_eq!(around(-5.0, 1.0, 10, 8), 0..1);
        assert_eq!(around(12.0, 2.0, 10, 8), 72..73);
        // The nearest one always.
        assert_eq!(around(3.4, 0.0, 10, 8), 24..25);
        assert_eq!(around(3.6, f64::NEG_INFINITY, 10, 8), 32..33);
        assert_eq!(around(3.6, f64::INFINITY, 10, 8), 0..73);
    }

    #[test]
    fn levels_are_searched_by_halves_each_once_and_guided_by_those_before() {
        let guide = Guide { halvings: 3, margin: 0.5, reach: (0.0, 0.0) };
        assert_eq!(guide.steps().collect::<Vec<_>>(), [8, 4, 2, 1]);
        // A level d off is looked at where the threshold is lowered by √d; the last ones guide none.
        let lowered: Vec<_> = guide.steps().map(|step| guide.lowered(step / 2)).collect();
        assert_eq!(lowered, [0.5 * 2.0, 0.5 * f64::sqrt(2.0), 0.5, 0.0]);

        let spec = HogSpec::new(&HogParams::default()).unwrap();
        let steps = Steps::new((8, 8), (0, 0), spec.cell, &spec).unwrap();
        let levels = levels(Size::new(640, 480), 1.05, &spec, &Interrupt::NEVER).unwrap();
        let grids: Vec<_> = levels.iter().map(|level| (level.size, steps.grid(level.size, &spec))).collect();
        // Each level that was searched shows one window, in the middle.
        let mut found = vec![Vec::new(); levels.len()];
        let mut searched = Vec::new();
        for step in guide.steps() {
            let regions = guide.regions(step, &levels, &grids, &found, 0.0, &spec).unwrap();
            for region in regions {
                assert!(region.level.is_multiple_of(step), "{step}");
                searched.push(region.level);
                let middle = |windows: usize| windows / 2 * 8;
                let windows = grids[region.level].1.windows;
                found[region.level] = vec![(middle(windows.width), middle(windows.height), 1.0)];
            }
        }
        searched.sort_unstable();
        assert_eq!(searched, (0..levels.len()).collect::<Vec<_>>());
    }

    #[test]
    fn only_windows_near_the_threshold_are_looked_around_nearer_the_nearer_the_level_is() {
        let spec = HogSpec::new(&HogParams::default()).unwrap();
        let steps = Steps::new((8, 8), (0, 0), spec.cell, &spec).unwrap();
        let levels = levels(Size::new(1280, 960), 1.05, &spec, &Interrupt::NEVER).unwrap();
        let grids: Vec<_> = levels.iter().map(|level| (level.size, steps.grid(level.size, &spec))).collect();
        let guide = Guide { halvings: 2, margin: 0.25, reach: (1.0, 1.0) };
        let mut found = vec![Vec::new(); levels.len()];
        found[0] = vec![(400, 400, -0.2), (800, 400, -0.3), (800, 800, -0.4)];
        for (step, level, wanted) in [(2, 2, vec![(360, 360), (728, 360)]), (1, 1, vec![(384, 384)])] {
            let regions = guide.regions(step, &levels, &grids, &found, 0.0, &spec).unwrap();
            assert!(regions.iter().all(|region| region.level == level));
            let is_around = |&(x, y): &(usize, usize)| {
                regions.iter().any(|region| region.x.contains(&x) && region.y.contains(&y))
            };
            assert_eq!(regions.len(), wanted.len(), "{step}");
            assert!(wanted.iter().all(is_around), "{step}");
        }
    }

    #[test]
    fn the_level_between_is_searched_where_its_window_is_nearest_to_the_one_found() {
        let spec = HogSpec::new(&HogParams::default()).unwrap();
        let steps = Steps::new((8, 8), (16, 24), spec.cell, &spec).unwrap();
        let guide = Guide { halvings: 1, margin: 0.0, reach: (0.0, 0.0) };
        for step in [1.1, 1.6, 2.0] {
            let levels = levels(Size::new(640, 480), step, &spec, &Interrupt::NEVER).unwrap();
            let grids: Vec<_> =
                levels.iter().map(|level| (level.size, steps.grid(level.size, &spec))).collect();
            let grid = &grids[1].1;
            // How far a window's centre is from that of the window found [px of the image].
            let off = |at: usize, corner: usize, pad: usize, win: usize| {
                let centre = |corner: usize| corner as f64 - pad as f64 + win as f64 / 2.0;
                (centre(corner) * levels[1].scale - centre(at)).abs()
            };
            for (x, y) in [(0, 0), (304, 200), (600, 8), (160, 392)] {
                let mut found = vec![Vec::new(); levels.len()];
                found[0].push((x, y, 1.0));
                let regions = guide.regions(1, &levels, &grids, &found, 0.5, &spec).unwrap();
                assert_eq!(regions.len(), 1);
                let Region { level, x: across, y: down } = &regions[0];
                assert_eq!((*level, across.len(), down.len()), (1, 1, 1));
                let least = |at: usize, pad: usize, win: usize, windows: usize| {
                    (0..windows).map(|k| off(at, 8 * k, pad, win)).fold(f64::INFINITY, f64::min)
                };
                let (dx, dy) = (off(x, across.start, 16, 64), off(y, down.start, 24, 128));
                assert!(dx <= least(x, 16, 64, grid.windows.width) + 1e-9, "{step} {x}: {dx}");
                assert!(dy <= least(y, 24, 128, grid.windows.height) + 1e-9, "{step} {y}: {dy}");
            }
        }
    }
}
