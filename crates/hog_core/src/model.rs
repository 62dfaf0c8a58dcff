//! The two people models that OpenCV ships, read from the data files in `models/`.

use std::sync::OnceLock;

/// OpenCV's default people detector: 3780 weights of the 64 × 128 window, then the bias.
///
/// ```
/// use hog_core::{Hog, HogParams, model};
/// let people = Hog::new(&HogParams::default(), Some(model::default_people()))?;
/// # Ok::<(), hog_core::HogError>(())
/// ```
pub fn default_people() -> &'static [f32] {
    static COEFFICIENTS: OnceLock<Vec<f32>> = OnceLock::new();
    COEFFICIENTS.get_or_init(|| parse(include_str!("../models/default_people_64x128.txt")))
}

/// OpenCV's Daimler people detector: 1980 weights of the 48 × 96 window, then the bias.
///
/// ```
/// use hog_core::{Hog, HogParams, model};
/// let geometry = HogParams { win_size: (48, 96), ..HogParams::default() };
/// let people = Hog::new(&geometry, Some(model::daimler_people()))?;
/// # Ok::<(), hog_core::HogError>(())
/// ```
pub fn daimler_people() -> &'static [f32] {
    static COEFFICIENTS: OnceLock<Vec<f32>> = OnceLock::new();
    COEFFICIENTS.get_or_init(|| parse(include_str!("../models/daimler_people_48x96.txt")))
}

fn parse(text: &str) -> Vec<f32> {
    let lines = text.lines().filter(|line| !line.starts_with('#'));
    lines.flat_map(str::split_whitespace).filter_map(|word| word.parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_coefficient_of_both_models_is_read() {
        assert_eq!((default_people().len(), daimler_people().len()), (3781, 1981));
        assert!(default_people().iter().chain(daimler_people()).all(|c| c.is_finite()));
    }
}
