#![doc = include_str!("../README.md")]
//! # Stages
//!
//! 1. [`params`] checks what the user asks for, once.
//! 2. [`pyramid`] shrinks the image to levels, and lists the windows of each level.
//! 3. [`exact`] computes the gradients, blocks and scores of a level, in OpenCV's order of sums: the specification.
//! 4. `fast` does the same in vector kernels, with scores up to a few millionths off.
//! 5. `separable` does the same for geometries that have no kernels.
//! 6. `rescore` takes the hits from either, and lets `exact` decide those that are too close to the threshold.
//! 7. [`group`] makes one rectangle of many overlapping ones.
//!
//! [`SecondLook`] is no HOG: a small network's opinion of the windows found.
//!
//! [`skimage`] is no part of the detector: scikit-image's descriptor, which is another.
//!
//! [`Hog`] composes these stages. Each follows Dalal and Triggs, "Histograms of Oriented Gradients for Human
//! Detection" (CVPR 2005), with OpenCV's roundings, so that its trained models give the same answers here.

pub mod error;
pub mod exact;
pub mod geometry;
pub mod group;
pub mod image;
#[cfg(feature = "models")]
pub mod model;
pub mod params;
pub mod pyramid;
pub mod skimage;

mod describe;
mod detect;
mod fast;
mod guided;
mod interrupt;
mod memory;
mod options;
mod rescore;
mod second;
mod separable;
mod threads;

pub use detect::Hog;
pub use error::{HogError, Result};
pub use fast::Backend;
pub use geometry::{Rect, Size};
pub use group::Candidate;
pub use guided::Guide;
pub use image::ImageView;
pub use interrupt::Interrupt;
pub use options::{Grouping, Search, SearchOptions};
pub use params::{HogParams, HogSpec};
pub use rescore::Hit;
pub use second::{Answer, SecondLook, Window};
