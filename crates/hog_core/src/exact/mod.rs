//! The specification: HOG as in Dalal and Triggs (2005), with OpenCV's roundings and order of sums, bit for bit.
//!
//! Read it in this order: `gradient` gives every pixel two votes for the orientation bins nearest to its gradient
//! (`polar` computes magnitude and angle); `blocks` sums the votes of overlapping blocks into weighted histograms (the
//! weights are in `tables`) and normalises them; `windows` puts blocks together to descriptors; [`Svm`] scores them.
//! `isa` compiles the loops for the vectors that the CPU has; `kernel` is what kernels may do for those of the gradient.

mod blocks;
mod gradient;
pub(crate) mod isa;
mod kernel;
pub(crate) mod polar;
mod svm;
mod tables;
mod windows;

pub(crate) use blocks::normalise;
pub(crate) use gradient::{each_row, gradient};
pub use kernel::RowVotes;
#[cfg(target_arch = "x86_64")]
pub(crate) use kernel::Turn;
pub(crate) use kernel::{Loops, RowKernel};
pub use svm::Svm;
pub(crate) use tables::cells_along;
pub use tables::{Tables, gamma_table};
pub use windows::{Windows, descriptors, scores, window_score};
