//! From many overlapping rectangles to one a person: OpenCV's `groupRectangles` and mean-shift.

mod candidate;
mod mean_shift;
mod similar;

pub use candidate::{Candidate, clip};
pub use mean_shift::mean_shift;
pub use similar::{HOG_EPS, group_candidates, group_rectangles};
