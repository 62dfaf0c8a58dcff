//! The normalisation of a block, as scikit-image rounds it.

/// How a block is normalised; each adds 1e-5 to the norm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Norm {
    /// Divided by the sum.
    L1,
    /// Divided by the sum, then the square root.
    L1Sqrt,
    /// Divided by the root of the squares' sum.
    L2,
    /// As `L2`, cut off at 0.2, as `L2` again.
    L2Hys,
}

/// Added to a norm, so that a block without gradients is 0.
const EPSILON: f64 = 1e-5;

pub(super) fn normalise(norm: Norm, block: &mut [f64]) {
    match norm {
        Norm::L1 | Norm::L1Sqrt => {
            let factor = 1.0 / (sum(block, |value| value) + EPSILON);
            block.iter_mut().for_each(|value| *value *= factor);
            if norm == Norm::L1Sqrt {
                block.iter_mut().for_each(|value| *value = value.sqrt());
            }
        }
        Norm::L2 | Norm::L2Hys => {
            let scale = |block: &[f64]| 1.0 / (sum(block, |value| value * value) + EPSILON * EPSILON).sqrt();
            let factor = scale(block);
            block.iter_mut().for_each(|value| *value *= factor);
            if norm == Norm::L2Hys {
                // (NaN stays, as `min` would not let it.)
                block.iter_mut().for_each(|value| *value = if *value > 0.2 { 0.2 } else { *value });
                let factor = scale(block);
                block.iter_mut().for_each(|value| *value *= factor);
            }
        }
    }
}

/// The sum over a block, eight numbers at a time.
#[inline(always)]
fn sum(block: &[f64], of: impl Fn(f64) -> f64) -> f64 {
    let (eights, rest) = block.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for eight in eights {
        for (sum, &value) in sums.iter_mut().zip(eight) {
            *sum += of(value);
        }
    }
    sums.iter().sum::<f64>() + rest.iter().map(|&value| of(value)).sum::<f64>()
}
