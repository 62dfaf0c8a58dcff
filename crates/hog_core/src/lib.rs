//! OpenCV's HOG people detector.
#[cfg(feature = "python")]
mod python;
