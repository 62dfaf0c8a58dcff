//! OpenCV's HOG people detector: the same rectangles as `cv2.HOGDescriptor` 4.14.
//!
//! An image becomes a pyramid of smaller and smaller levels ([`pyramid`]). On each level, [`gradient`] gives every
//! pixel two votes for the orientation bins nearest to its gradient; [`blocks`] sums the votes of overlapping blocks
//! into weighted histograms and normalises them; [`svm`] scores each window of blocks with a linear classifier.
//! Windows that score high enough are carried back to the image and grouped ([`group`]). [`detect`] composes these
//! stages, [`grid`] tells which windows there are, [`params`] checks what the user asks for, once.
//!
//! Each stage follows Dalal and Triggs, "Histograms of Oriented Gradients for Human Detection" (CVPR 2005), with the
//! roundings and the order of sums of OpenCV, so that its trained models mean the same here.

pub mod blocks;
pub mod detect;
pub mod error;
pub mod gradient;
pub mod grid;
pub mod group;
pub mod image;
pub mod model;
pub mod params;
pub mod pyramid;
pub mod reference;
pub mod svm;

mod simd;
mod workspace;

#[cfg(feature = "python")]
mod python;

pub use detect::{Grouping, Hit, Hog, Search};
pub use error::{HogError, Result};
pub use group::{Candidate, Rect};
pub use image::ImageView;
pub use params::{HogParams, HogSpec, Size};
pub use simd::Backend;
