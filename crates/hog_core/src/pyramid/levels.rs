//! The levels of a pyramid: their scales and sizes, and windows back in the image.

use crate::error::Result;
use crate::geometry::{Rect, Size};
use crate::interrupt::Interrupt;
use crate::memory;
use crate::params::HogSpec;

/// One level: the image shrunk by `scale`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    /// How many image pixels a level pixel spans.
    pub scale: f64,
    /// Size of the level's image \[px\].
    pub size: Size,
}

/// The levels of an image: scale 1, then `step` times more each, while the window still fits.
///
/// A step that does not shrink (≤ 1, NaN, infinite) leaves level 0 alone. Level 0 is there even if the image is
/// smaller than the window.
///
/// ```
/// use hog_core::pyramid::levels;
/// use hog_core::{HogParams, HogSpec, Interrupt, Size};
/// let spec = HogSpec::new(&HogParams::default())?;
/// let levels = levels(Size::new(640, 480), 2.0, &spec, &Interrupt::NEVER)?;
/// assert_eq!(levels[1].size, Size::new(320, 240));
/// assert_eq!(levels.len(), 2); // 160 × 120 is lower than the window
/// # Ok::<(), hog_core::HogError>(())
/// ```
pub fn levels(image: Size, step: f64, spec: &HogSpec, interrupt: &Interrupt) -> Result<Vec<Level>> {
    let mut levels = memory::with_room(at_most(image, step, spec))?;
    levels.push(Level { scale: 1.0, size: image });
    let mut scale = 1.0;
    while step > 1.0 && levels.len() < spec.nlevels {
        scale *= step;
        let width = (image.width as f64 / scale).round_ties_even();
        let height = (image.height as f64 / scale).round_ties_even();
        if !(width >= spec.win.width as f64 && height >= spec.win.height as f64) {
            break;
        }
        interrupt.check()?;
        memory::push(&mut levels, Level { scale, size: Size::new(width as usize, height as usize) })?;
    }
    Ok(levels)
}

/// How many levels there are, or a few more: known before they are made, as their list may not fit the memory.
fn at_most(image: Size, step: f64, spec: &HogSpec) -> usize {
    let along = |image: usize, win: usize| (image as f64 / (win as f64 - 0.5)).ln() / step.ln();
    let shrunk = along(image.width, spec.win.width).min(along(image.height, spec.win.height));
    if step > 1.0 { (shrunk.max(0.0) as usize).saturating_add(2).min(spec.nlevels) } else { 1 }
}

/// The window at (`x`, `y`) of a level, in image pixels.
pub fn to_image(x: i64, y: i64, scale: f64, spec: &HogSpec) -> Rect {
    let back = |value: f64| (value * scale).round_ties_even() as i32;
    Rect {
        x: back(x as f64),
        y: back(y as f64),
        width: back(spec.win.width as f64),
        height: back(spec.win.height as f64),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::HogParams;

    #[test]
    fn levels_shrink_until_the_window_no_longer_fits() {
        let spec = HogSpec::new(&HogParams::default()).unwrap();
        let of = |w, h, step| levels(Size::new(w, h), step, &spec, &Interrupt::NEVER).unwrap();
        assert_eq!(of(640, 480, 1.05).len(), 28);
        assert_eq!(of(640, 480, 1.0).len(), 1);
        assert_eq!(of(640, 480, f64::NAN).len(), 1);
        assert_eq!(of(640, 480, f64::INFINITY).len(), 1);
        assert_eq!(of(10, 10, 1.05).len(), 1);
        assert_eq!(of(64, 128, 1.001).len(), 4); // 128 / 1.001³ still rounds to 128, 127.5 no longer
        assert!(of(640, 480, 1.05).capacity() <= 30);
    }
}
