//! Modes of the hits' density: OpenCV's `groupRectangles_meanshift`.

use crate::error::Result;
use crate::geometry::Rect;
use crate::interrupt::Interrupt;
use crate::memory;

use super::candidate::Candidate;

/// A place in the space that mean-shift climbs: centre [px] and logarithm of the scale.
type Place = [f64; 3];

/// Bandwidth of the kernel at scale 1; ln 1.3 along the scale.
fn bandwidth(log_scale: f64) -> Place {
    [8.0 * log_scale.exp(), 16.0 * log_scale.exp(), 1.3_f64.ln()]
}

/// The modes of the candidates' density whose weight exceeds `threshold`, as rectangles of the window `win`.
///
/// Non-maximum suppression after Dalal's thesis (2006), chapter 5, with OpenCV's bandwidths and rounding.
///
/// ```
/// use hog_core::{Candidate, Interrupt, Rect, group};
/// let at = |x, weight| Candidate { rect: Rect { x, y: 0, width: 64, height: 128 }, weight, scale: 1.0 };
/// let found = group::mean_shift(&[at(0, 1.0), at(4, 1.0), at(300, 1.0)], 0.0, (64, 128), &Interrupt::NEVER)?;
/// assert_eq!(found.len(), 2);
/// # Ok::<(), hog_core::HogError>(())
/// ```
pub fn mean_shift(
    candidates: &[Candidate],
    threshold: f64,
    win: (i32, i32),
    interrupt: &Interrupt,
) -> Result<Vec<(Rect, f64)>> {
    let points = memory::collect(candidates.iter().map(Point::new))?;
    let mut modes: Vec<Place> = Vec::new();
    for point in &points {
        let mut place = shifted(&points, point.place);
        for _ in 0..100 {
            interrupt.check()?;
            let previous = place;
            place = shifted(&points, previous);
            if distance(place, previous) <= 1e-5 {
                break;
            }
        }
        if !modes.iter().any(|&mode| distance(place, mode) < 1.0) {
            memory::push(&mut modes, place)?;
        }
    }
    let mut kept = Vec::new();
    for mode in modes {
        interrupt.check()?;
        let weight = points.iter().map(|p| p.density(mode)).sum::<f64>();
        if weight > threshold {
            memory::push(&mut kept, (mode_rect(mode, win), weight))?;
        }
    }
    Ok(kept)
}

struct Point {
    place: Place,
    bandwidth: Place,
    /// What its density is divided by.
    norm: f64,
    weight: f64,
}

impl Point {
    fn new(candidate: &Candidate) -> Self {
        let Rect { x, y, width, height } = candidate.rect;
        let middle =
            |start: i32, length: i32| ((2.0 * f64::from(start) + f64::from(length)) / 2.0).round_ties_even();
        let log_scale = candidate.scale.ln();
        let bandwidth = bandwidth(log_scale);
        Self {
            place: [middle(x, width), middle(y, height), log_scale],
            norm: bandwidth.iter().sum::<f64>().sqrt(),
            bandwidth,
            weight: candidate.weight,
        }
    }

    fn density(&self, at: Place) -> f64 {
        let squared: f64 = (0..3).map(|i| ((self.place[i] - at[i]) / self.bandwidth[i]).powi(2)).sum();
        self.weight * (-0.5 * squared).exp() / self.norm
    }
}

/// One mean-shift step from `at`.
fn shifted(points: &[Point], at: Place) -> Place {
    let (mut sum, mut total) = ([0.0; 3], [0.0; 3]);
    for point in points {
        let density = point.density(at);
        for i in 0..3 {
            sum[i] += density * point.place[i] / point.bandwidth[i];
            total[i] += density / point.bandwidth[i];
        }
    }
    std::array::from_fn(|i| sum[i] / total[i])
}

/// Squared distance of `a` from `b` in bandwidths at `b`.
fn distance(a: Place, b: Place) -> f64 {
    let bandwidth = bandwidth(b[2]);
    (0..3).map(|i| ((b[i] - a[i]) / bandwidth[i]).powi(2)).sum()
}

fn mode_rect([x, y, log_scale]: Place, win: (i32, i32)) -> Rect {
    let scale = log_scale.exp();
    let (width, height) = ((f64::from(win.0) * scale) as i32, (f64::from(win.1) * scale) as i32);
    Rect { x: (x - f64::from(width / 2)) as i32, y: (y - f64::from(height / 2)) as i32, width, height }
}
