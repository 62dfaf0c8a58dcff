//! A hit as a rectangle of the image, and the part of it that lies inside.

use crate::geometry::Rect;

/// A rectangle with its weight, and the pyramid scale it was found at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// Where, in image pixels.
    pub rect: Rect,
    /// SVM score.
    pub weight: f64,
    /// Scale of the level.
    pub scale: f64,
}

/// The part of each rectangle inside an image of `width` by `height`; those outside are dropped with their weights.
///
/// ```
/// use hog_core::{Rect, group};
/// let rect = Rect { x: -5, y: 2, width: 10, height: 20 };
/// let inside = Rect { x: 0, y: 2, width: 5, height: 14 };
/// assert_eq!(group::clip(vec![(rect, 1.5)], 32, 16), [(inside, 1.5)]);
/// ```
pub fn clip(found: Vec<(Rect, f64)>, width: i32, height: i32) -> Vec<(Rect, f64)> {
    // (Collected in the memory of `found`.)
    let clipped = found.into_iter().filter_map(|(rect, weight)| {
        let (x, y) = (rect.x.max(0), rect.y.max(0));
        let right = rect.x.saturating_add(rect.width).min(width);
        let bottom = rect.y.saturating_add(rect.height).min(height);
        (right > x && bottom > y).then_some((Rect { x, y, width: right - x, height: bottom - y }, weight))
    });
    clipped.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rect(x: i32, y: i32, width: i32, height: i32) -> Rect {
        Rect { x, y, width, height }
    }

    #[test]
    fn only_what_lies_inside_the_image_is_kept_whatever_the_coordinates() {
        let far =
            [rect(i32::MAX, i32::MIN, i32::MAX, i32::MAX), rect(i32::MIN, i32::MAX, i32::MAX, i32::MIN)];
        let found = clip(vec![(far[0], 1.0), (far[1], 1.0), (rect(-5, -5, 10, 10), 2.0)], 8, 8);
        assert_eq!(found, [(rect(0, 0, 5, 5), 2.0)]);
        // What only touches the image has no part in it.
        let beside = [rect(8, 2, 4, 4), rect(2, 8, 4, 4), rect(-4, 2, 4, 4), rect(2, -4, 4, 4)];
        assert_eq!(clip(beside.map(|rect| (rect, 1.0)).to_vec(), 8, 8), []);
    }
}
