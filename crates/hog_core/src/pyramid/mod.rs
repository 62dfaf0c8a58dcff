//! The image pyramid: its levels, their pixels, and the windows of each.

mod grid;
mod levels;
mod resize;

pub use grid::{Grid, Steps};
pub use levels::{Level, levels, to_image};
pub use resize::{Tap, resize, taps};
