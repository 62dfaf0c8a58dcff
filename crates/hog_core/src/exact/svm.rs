//! Stage 3: the linear SVM's score of a window, summed in OpenCV's own order.

use crate::error::{HogError, Result};
use crate::memory;
use crate::params::HogSpec;

/// A linear SVM over window descriptors.
///
/// ```
/// use hog_core::exact::Svm;
/// use hog_core::{HogParams, HogSpec, model};
/// let spec = HogSpec::new(&HogParams::default())?;
/// assert_eq!(Svm::new(model::default_people(), &spec)?.weights().len(), 3780);
/// assert!(Svm::new(model::daimler_people(), &spec).is_err()); // of another window
/// # Ok::<(), hog_core::HogError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Svm {
    weights: Vec<f32>,
    bias: f32,
}

impl Svm {
    /// `coefficients` are one weight per descriptor element, with or without a bias after them.
    pub fn new(coefficients: &[f32], spec: &HogSpec) -> Result<Self> {
        let wanted = spec.descriptor_len();
        let bias = match coefficients.len() {
            got if got == wanted => 0.0,
            got if got == wanted + 1 => coefficients[wanted],
            got => return Err(HogError::DetectorSize { got, wanted }),
        };
        Ok(Self { weights: memory::collect(coefficients[..wanted].iter().copied())?, bias })
    }

    /// One weight per descriptor element.
    pub fn weights(&self) -> &[f32] {
        &self.weights
    }

    /// The bias, added to every score.
    pub fn bias(&self) -> f32 {
        self.bias
    }

    /// The score of the window with these blocks, in descriptor order.
    pub fn score<'a>(&self, blocks: impl Iterator<Item = &'a [f32]>) -> f64 {
        let mut rest = self.weights.as_slice();
        let mut score = f64::from(self.bias);
        for block in blocks {
            let (weights, others) = rest.split_at(block.len());
            score = add_block(score, weights, block);
            rest = others;
        }
        score
    }
}

/// Adds a block's dot product: four single precision lanes, then the rest one by one.
fn add_block(score: f64, weights: &[f32], block: &[f32]) -> f64 {
    let (weights, weights_tail) = weights.as_chunks::<4>();
    let (block, block_tail) = block.as_chunks::<4>();
    let mut lanes = [0.0f32; 4];
    for (weight, value) in weights.iter().zip(block) {
        for lane in 0..4 {
            lanes[lane] += value[lane] * weight[lane];
        }
    }
    let sum = f64::from(lanes[0] + lanes[1]) + f64::from(lanes[2] + lanes[3]);
    let tail = weights_tail.iter().zip(block_tail);
    tail.fold(score + sum, |score, (weight, value)| score + f64::from(value * weight))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may fail")]
mod tests {
    use super::*;
    use crate::params::HogParams;

    #[test]
    fn a_detector_without_a_bias_scores_as_one_whose_bias_is_zero() {
        let spec = HogSpec::new(&HogParams::default()).unwrap();
        let mut coefficients = vec![0.5; spec.descriptor_len()];
        let without = Svm::new(&coefficients, &spec).unwrap();
        coefficients.push(0.0);
        let with = Svm::new(&coefficients, &spec).unwrap();
        let block = vec![0.25; spec.block_len];
        assert_eq!(without, with);
        let score = without.score([block.as_slice()].into_iter());
        assert_eq!(score, 0.5 * 0.25 * spec.block_len as f64);
    }
}
