//! What the detector refuses, each with its numbers.

use thiserror::Error;

/// Every way in which input can be refused; nothing else can fail.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum HogError {
    /// Window, block, stride and cell sizes do not fit together.
    #[error("{0}")]
    Geometry(String),
    /// The linear SVM has not one coefficient per descriptor element (and perhaps a bias).
    #[error("the detector has {got} coefficients; this geometry needs {wanted} or {} (with bias last)", wanted + 1)]
    DetectorSize {
        /// How many coefficients came.
        got: usize,
        /// How many elements a window's descriptor has.
        wanted: usize,
    },
    /// The image is not one this detector can read.
    #[error("{0}")]
    Image(String),
    /// A search parameter lies outside its range.
    #[error("{0}")]
    Parameter(String),
    /// The forced instruction set is unknown, or this CPU has not got it.
    #[error("{0}")]
    Backend(String),
}

/// Shorthand for this crate's results.
pub type Result<T> = std::result::Result<T, HogError>;
