//! Groups of similar rectangles: OpenCV's `groupRectangles`.

use crate::error::Result;
use crate::geometry::Rect;
use crate::interrupt::Interrupt;
use crate::memory;

use super::candidate::Candidate;

/// How far apart the edges of two members of a group may lie, relative to their size, in HOG's own grouping.
pub const HOG_EPS: f64 = 0.2;

/// Groups detections as `HOGDescriptor::groupRectangles` does: the mean rectangle and the largest weight of each
/// group of more than `threshold` members. A threshold below 1 changes nothing.
///
/// ```
/// use hog_core::{Candidate, Interrupt, Rect, group};
/// let at = |x, weight| Candidate { rect: Rect { x, y: 0, width: 64, height: 128 }, weight, scale: 1.0 };
/// let found = group::group_candidates(&[at(0, 0.5), at(8, 0.9), at(300, 2.0)], 1, &Interrupt::NEVER)?;
/// assert_eq!(found, [(Rect { x: 4, y: 0, width: 64, height: 128 }, 0.9)]); // the third one is alone
/// # Ok::<(), hog_core::HogError>(())
/// ```
pub fn group_candidates(
    candidates: &[Candidate],
    threshold: i32,
    interrupt: &Interrupt,
) -> Result<Vec<(Rect, f64)>> {
    if threshold <= 0 || candidates.is_empty() {
        return memory::collect(candidates.iter().map(|c| (c.rect, c.weight)));
    }
    let rects = memory::collect(candidates.iter().map(|c| c.rect))?;
    let (labels, classes) = partition(&rects, HOG_EPS, interrupt)?;
    let mut weights = memory::filled(classes, f64::NEG_INFINITY)?;
    for (candidate, &label) in candidates.iter().zip(&labels) {
        weights[label] = weights[label].max(candidate.weight);
    }
    let mean = |sum: i64, count: usize| (sum as f64 * (1.0 / count as f64)).round_ties_even() as i32;
    let groups = class_means(&rects, &labels, classes, mean)?;
    let kept = surviving(&groups, threshold, HOG_EPS, interrupt)?;
    memory::collect(kept.into_iter().map(|i| (groups[i].0, weights[i])))
}

/// `cv2.groupRectangles`: the mean rectangle of each group of more than `threshold` members, and how many they were.
///
/// ```
/// use hog_core::{Interrupt, Rect, group};
/// let at = |x| Rect { x, y: 0, width: 64, height: 128 };
/// assert_eq!(group::group_rectangles(&[at(0), at(8), at(300)], 1, 0.2, &Interrupt::NEVER)?, [(at(4), 2)]);
/// # Ok::<(), hog_core::HogError>(())
/// ```
pub fn group_rectangles(
    rects: &[Rect],
    threshold: i32,
    eps: f64,
    interrupt: &Interrupt,
) -> Result<Vec<(Rect, i32)>> {
    if threshold <= 0 || rects.is_empty() {
        return memory::collect(rects.iter().map(|&rect| (rect, 1)));
    }
    let (labels, classes) = partition(rects, eps, interrupt)?;
    let mean = |sum: i64, count: usize| (sum as f32 * (1.0 / count as f32)).round_ties_even() as i32;
    let groups = class_means(rects, &labels, classes, mean)?;
    let kept = surviving(&groups, threshold, eps, interrupt)?;
    memory::collect(kept.into_iter().map(|i| (groups[i].0, groups[i].1 as i32)))
}

fn similar(a: &Rect, b: &Rect, eps: f64) -> bool {
    let apart = |p: i32, q: i32| (i64::from(p) - i64::from(q)).abs() as f64;
    let far = |p: i32, length: i32| i64::from(p) + i64::from(length);
    let apart_far = |p: i64, q: i64| (p - q).abs() as f64;
    let smaller = i64::from(a.width.min(b.width)) + i64::from(a.height.min(b.height));
    let delta = eps * smaller as f64 * 0.5;
    apart(a.x, b.x) <= delta
        && apart(a.y, b.y) <= delta
        && apart_far(far(a.x, a.width), far(b.x, b.width)) <= delta
        && apart_far(far(a.y, a.height), far(b.y, b.height)) <= delta
}

/// The connected components of [`similar`]: each rectangle's class, numbered by first member, and how many there are.
fn partition(rects: &[Rect], eps: f64, interrupt: &Interrupt) -> Result<(Vec<usize>, usize)> {
    let mut parent = memory::collect(0..rects.len())?;
    fn root(parent: &mut [usize], mut node: usize) -> usize {
        while parent[node] != node {
            parent[node] = parent[parent[node]];
            node = parent[node];
        }
        node
    }
    let mut by_x = memory::collect(0..rects.len())?;
    by_x.sort_unstable_by_key(|&i| rects[i].x);
    for (place, &i) in by_x.iter().enumerate() {
        interrupt.check()?;
        let size = i64::from(rects[i].width) + i64::from(rects[i].height);
        // No rectangle further to the right than this can be similar.
        let reach = if eps >= 0.0 { eps * size as f64 * 0.5 } else { f64::INFINITY };
        for &j in &by_x[place + 1..] {
            if (i64::from(rects[j].x) - i64::from(rects[i].x)) as f64 > reach {
                break;
            }
            if similar(&rects[i], &rects[j], eps) {
                let (a, b) = (root(&mut parent, i), root(&mut parent, j));
                parent[a.max(b)] = a.min(b);
            }
        }
    }
    // The root of a class is its first member, so classes are met in the order of their first members.
    let mut labels = memory::filled(rects.len(), 0)?;
    let mut classes = 0;
    for i in 0..rects.len() {
        let first = root(&mut parent, i);
        labels[i] = if first == i {
            classes += 1;
            classes - 1
        } else {
            labels[first]
        };
    }
    Ok((labels, classes))
}

/// Mean rectangle and size of each class.
fn class_means(
    rects: &[Rect],
    labels: &[usize],
    classes: usize,
    mean: impl Fn(i64, usize) -> i32,
) -> Result<Vec<(Rect, usize)>> {
    let mut sums = memory::filled(classes, ([0i64; 4], 0usize))?;
    for (rect, &label) in rects.iter().zip(labels) {
        let (sum, count) = &mut sums[label];
        for (total, value) in sum.iter_mut().zip([rect.x, rect.y, rect.width, rect.height]) {
            *total += i64::from(value);
        }
        *count += 1;
    }
    let rect_of = |&([x, y, width, height], count): &([i64; 4], usize)| {
        let of = |sum| mean(sum, count);
        (Rect { x: of(x), y: of(y), width: of(width), height: of(height) }, count)
    };
    memory::collect(sums.iter().map(rect_of))
}

/// The classes with more than `threshold` members that do not lie within a much stronger one.
fn surviving(
    groups: &[(Rect, usize)],
    threshold: i32,
    eps: f64,
    interrupt: &Interrupt,
) -> Result<Vec<usize>> {
    let threshold = usize::try_from(threshold).unwrap_or(0);
    let swallowed = |i: usize| {
        let (inner, count) = groups[i];
        groups.iter().enumerate().any(|(j, &(outer, outer_count))| {
            let dx = (f64::from(outer.width) * eps).round_ties_even() as i64;
            let dy = (f64::from(outer.height) * eps).round_ties_even() as i64;
            let end = |start: i32, length: i32| i64::from(start) + i64::from(length);
            j != i
                && outer_count > threshold
                && i64::from(inner.x) >= i64::from(outer.x).saturating_sub(dx)
                && i64::from(inner.y) >= i64::from(outer.y).saturating_sub(dy)
                && end(inner.x, inner.width) <= end(outer.x, outer.width).saturating_add(dx)
                && end(inner.y, inner.height) <= end(outer.y, outer.height).saturating_add(dy)
                && (outer_count > count.max(3) || count < 3)
        })
    };
    let mut kept = Vec::new();
    for (i, &(_, count)) in groups.iter().enumerate() {
        interrupt.check()?;
        if count > threshold && !swallowed(i) {
            memory::push(&mut kept, i)?;
        }
    }
    Ok(kept)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rect(x: i32, y: i32, width: i32, height: i32) -> Rect {
        Rect { x, y, width, height }
    }

    #[test]
    fn three_alike_become_one_and_a_loner_is_dropped() {
        let rects = [rect(0, 0, 10, 20), rect(1, 0, 10, 20), rect(2, 0, 10, 20), rect(50, 50, 10, 20)];
        let group = |threshold| group_rectangles(&rects, threshold, 0.2, &Interrupt::NEVER).unwrap();
        assert_eq!(group(2), [(rect(1, 0, 10, 20), 3)]);
        assert_eq!(group(0).len(), 4);
    }

    #[test]
    fn classes_are_connected_through_their_members() {
        let chain: Vec<Rect> = (0..20).map(|i| rect(i * 2, 0, 10, 20)).collect();
        assert_eq!(partition(&chain, 0.2, &Interrupt::NEVER).unwrap(), (vec![0; 20], 1));
    }

    proptest! {
        #[test]
        fn classes_are_those_of_all_pairs(
            sides in prop::collection::vec((-60..60i32, -60..60i32, -3..40i32, -3..40i32), 0..60),
            eps in -0.5..1.0f64,
        ) {
            let rects: Vec<Rect> = sides.iter().map(|&(x, y, w, h)| rect(x, y, w, h)).collect();
            let mut classes: Vec<usize> = (0..rects.len()).collect();
            for i in 0..rects.len() {
                for j in 0..i {
                    if similar(&rects[i], &rects[j], eps) {
                        let (kept, gone) = (classes[i].min(classes[j]), classes[i].max(classes[j]));
                        classes.iter_mut().filter(|class| **class == gone).for_each(|class| *class = kept);
                    }
                }
            }
            let mut numbers: Vec<usize> = Vec::new();
            let renumbered: Vec<usize> = classes.iter().map(|class| {
                numbers.iter().position(|number| number == class).unwrap_or_else(|| {
                    numbers.push(*class);
                    numbers.len() - 1
                })
            }).collect();
            prop_assert_eq!(partition(&rects, eps, &Interrupt::NEVER).unwrap(), (renumbered, numbers.len()));
        }
    }

    #[test]
    fn extreme_coordinates_do_not_overflow() {
        let far =
            [rect(i32::MAX, i32::MIN, i32::MAX, i32::MAX), rect(i32::MIN, i32::MAX, i32::MAX, i32::MIN)];
        assert!(group_rectangles(&far, 1, 0.2, &Interrupt::NEVER).unwrap().is_empty());
    }

    #[test]
    fn a_tolerance_beyond_all_integers_does_not_overflow() {
        // Each three are alike; of the two kinds, neither lies within the other by any tolerance.
        let (flat, slim) = (rect(0, 0, 100, -90), rect(0, 0, -90, 100));
        let rects = [[flat; 3], [slim; 3]].concat();
        for eps in [1e300, f64::MAX] {
            let found = group_rectangles(&rects, 2, eps, &Interrupt::NEVER).unwrap();
            assert_eq!(found, [(flat, 3), (slim, 3)]);
        }
    }
}
