//! A faster search that may miss some hits: a few levels are searched whole, those between them around what was found.
//!
//! A person's hits lie on several neighbouring levels, at nearly the same place in the image. So where nothing came near to
//! the threshold on the levels around it, a level has rarely a hit. What is searched, is searched exactly.

use std::ops::Range;

use crate::error::Result;
use crate::fast::{Found, Region};
use crate::geometry::Size;
use crate::memory;
use crate::params::HogSpec;
use crate::pyramid::{Grid, Level};

/// How the search is guided.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Guide {
    /// Every how many levels one is searched whole; below 2 all are.
    pub every: usize,
    /// By how much the threshold is lowered there [SVM margin].
    pub margin: f64,
    /// How many windows around a place are searched on the levels between.
    pub reach: usize,
}

impl Guide {
    /// Whether this level is searched whole.
    pub(crate) fn is_whole(&self, level: usize) -> bool {
        self.every < 2 || level.is_multiple_of(self.every)
    }

    /// Where to search on the levels between those that were searched whole: around the windows `found` there whose
    /// score is at least `least`.
    pub(crate) fn between(
        &self,
        levels: &[Level],
        grids: &[(Size, Grid)],
        found: &[Vec<Found>],
        least: f64,
        spec: &HogSpec,
    ) -> Result<Vec<Region>> {
        let mut regions = Vec::new();
        for (number, (level, (_, grid))) in levels.iter().zip(grids).enumerate() {
            if self.is_whole(number) || grid.is_empty() {
                continue;
            }
            let before = number - number % self.every;
            let first = regions.len();
            for guide in [before, before + self.every] {
                let (Some(guiding), Some((_, from)), Some(found)) =
                    (levels.get(guide), grids.get(guide), found.get(guide))
                else {
                    continue;
                };
                // (A search gives some windows more than those above its threshold: all that its prefilter let through.)
                for &(x, y, _) in found.iter().filter(|&&(_, _, score)| score >= least) {
                    let along = |at: usize, pads: [usize; 2], win: usize, stride: usize, windows: usize| {
                        let half = win as f64 / 2.0;
                        let centre = (at as f64 - pads[0] as f64 + half) * guiding.scale;
                        let at = centre / level.scale - half + pads[1] as f64;
                        around((at / stride as f64).round(), self.reach, windows, stride)
                    };
                    let pads = [from.pad.width, grid.pad.width];
                    let x = along(x, pads, spec.win.width, grid.stride.width, grid.windows.width);
                    let pads = [from.pad.height, grid.pad.height];
                    let y = along(y, pads, spec.win.height, grid.stride.height, grid.windows.height);
                    memory::push(&mut regions, Region { level: number, x, y })?;
                }
            }
            merge(&mut regions, first, spec.win);
            let whole = Region::whole(number, grid);
            let cost: usize = regions[first..].iter().map(|region| cost(region, spec.win)).sum();
            if cost >= grid.padded.area() {
                regions.truncate(first);
                memory::push(&mut regions, whole)?;
            }
        }
        Ok(regions)
    }
}

/// The corners of the windows within `reach` of window `at` [px], as far as there are any.
fn around(at: f64, reach: usize, windows: usize, stride: usize) -> Range<usize> {
    let last = (windows - 1) as f64;
    let (from, to) = ((at - reach as f64).clamp(0.0, last), (at + reach as f64).clamp(0.0, last));
    from as usize * stride..to as usize * stride + 1
}

/// Makes one of two regions from `first` on, until no two cost less together.
fn merge(regions: &mut Vec<Region>, first: usize, win: Size) {
    regions[first..].sort_unstable_by_key(|region| (region.y.start, region.x.start));
    let mut at = first;
    while at < regions.len() {
        let mut other = at + 1;
        while other < regions.len() {
            let both = union(&regions[at], &regions[other]);
            if cost(&both, win) <= cost(&regions[at], win) + cost(&regions[other], win) {
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

/// What a region costs: the pixels of its windows, in whole vectors of 16 cells, and a row of cells and of pixels more.
fn cost(region: &Region, win: Size) -> usize {
    (region.x.len() + win.width).next_multiple_of(128) * (region.y.len() + win.height + 16)
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
        for other in [(8, 0), (0, 8), (24, 16), (0, 160)] {
            let mut regions = vec![region(0, 0), region(other.0, other.1)];
            merge(&mut regions, 0, WIN);
            assert_eq!(regions.len(), 1, "{other:?}");
        }
    }

    #[test]
    fn a_region_costs_the_pixels_of_its_windows_in_vectors_of_128_and_16_rows_more() {
        let wide = Region { level: 1, x: 8..8 + 65, y: 0..9 };
        assert_eq!(cost(&region(24, 40), WIN), 128 * (17 + 128 + 16));
        assert_eq!(cost(&wide, WIN), 256 * (9 + 128 + 16));
    }

    #[test]
    fn windows_around_a_place_stay_on_the_level() {
        assert_eq!(around(3.0, 1, 10, 8), 16..33);
        assert_eq!(around(-5.0, 1, 10, 8), 0..1);
        assert_eq!(around(12.0, 2, 10, 8), 72..73);
    }

    #[test]
    fn only_windows_near_the_threshold_are_looked_around() {
        let spec = HogSpec::new(&HogParams::default()).unwrap();
        let steps = Steps::new((8, 8), (0, 0), spec.cell, &spec).unwrap();
        let levels = [1.0, 1.05].map(|scale| {
            let size = Size::new((1280.0 / scale) as usize, (960.0 / scale) as usize);
            Level { scale, size }
        });
        let grids = levels.each_ref().map(|level| (level.size, steps.grid(level.size, &spec)));
        let guide = Guide { every: 2, margin: 0.25, reach: 1 };
        // A search also gives windows that its prefilter let through.
        let found = [vec![(400, 400, -0.2), (800, 400, -0.9)], Vec::new()];
        let regions = guide.between(&levels, &grids, &found, -0.25, &spec).unwrap();
        assert_eq!(regions.len(), 1);
        assert!(regions[0].level == 1 && regions[0].x.contains(&384));
    }

    #[test]
    fn the_level_between_is_searched_where_its_window_is_nearest_to_the_one_found() {
        let spec = HogSpec::new(&HogParams::default()).unwrap();
        let steps = Steps::new((8, 8), (16, 24), spec.cell, &spec).unwrap();
        let guide = Guide { every: 2, margin: 0.0, reach: 0 };
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
                let regions = guide.between(&levels, &grids, &found, 0.5, &spec).unwrap();
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
