//! The specification: HOG as in Dalal and Triggs (2005), with OpenCV's roundings and order of sums, bit for bit.
//!
//! Read it in this order: [`gradient`] gives every pixel two votes for the orientation bins nearest to its gradient
//! (`polar` computes magnitude and angle); `blocks` sums the votes of overlapping blocks into weighted histograms (the
//! weights are in `tables`) and normalises them; `windows` puts blocks together to descriptors; [`Svm`] scores them.
//! `isa` compiles the loops for the vectors that the CPU has.

mod blocks;
mod gradient;
pub(crate) mod isa;
mod polar;
mod svm;
mod tables;
mod windows;

pub(crate) use blocks::normalise;
pub use gradient::{Gradient, gradient};
pub(crate) use gradient::{RowVotes, each_row};
pub use svm::Svm;
pub(crate) use tables::cells_along;
pub use tables::{Tables, gamma_table};
pub use windows::{Windows, descriptors, scores, window_score};
