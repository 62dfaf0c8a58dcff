//! The kernel of the second look's network.
//!
//! ```text
//! for each row and block of OUTPUTS channels of the layer's output:
//!     for each PLACES neighbouring places:
//!         sums = bias + Σ weight · number      over the kernel's rows, then columns and channels, which lie in a row
//!         output = max(sums, 0)
//! ```
//!
//! A weight is loaded once for PLACES vectors, a number once for OUTPUTS weights.

use super::Layer;
use crate::fast::lane::{Kernel, Lane};

/// Output channels and neighbouring places whose sums are made at a time: as many as 16 registers hold.
pub(super) const OUTPUTS: usize = 4;
const PLACES: usize = 2;

/// The output of a layer.
pub(super) struct Make<'a> {
    layer: &'a Layer,
    from: &'a [f32],
    to: *mut f32,
}

impl<'a> Make<'a> {
    /// # Safety
    /// `to` has room for the layer's output with its border, in vectors of the lane that [`on`](Self::on) takes.
    pub(super) unsafe fn new(layer: &'a Layer, from: &'a [f32], to: *mut f32) -> Self {
        Self { layer, from, to }
    }

    pub(super) fn on<L: Lane>(self, l: L) {
        l.compiled(self);
    }
}

impl Kernel for Make<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lane>(self, l: L) {
        if self.layer.size.0.is_multiple_of(PLACES) {
            self.places::<L, PLACES>(l)
        } else {
            self.places::<L, 1>(l)
        }
    }
}

impl Make<'_> {
    #[inline(always)]
    fn places<L: Lane, const N: usize>(&self, l: L) {
        let layer = self.layer;
        // A kernel of stride 2 moves by two places of the input, each of which has as many numbers as channels.
        let step = if layer.rows > 1 { 2 * layer.run / layer.rows } else { 0 };
        let row = step / 2 * (2 * layer.size.0 + layer.rows - 2);
        let block = layer.rows * layer.run * OUTPUTS;
        let out_row = layer.padded().0 * layer.outputs;
        for y in 0..layer.size.1 {
            for (index, (weights, bias)) in
                layer.weights.chunks_exact(block).zip(layer.bias.as_chunks::<OUTPUTS>().0).enumerate()
            {
                for x in (0..layer.size.0).step_by(N) {
                    let from = &self.from[(2 * y * row + x * step) * L::LANES..];
                    let sums = sums::<L, N>(l, layer, from, (row, step), (weights, bias));
                    let at =
                        (y + layer.border) * out_row + (x + layer.border) * layer.outputs + OUTPUTS * index;
                    for (place, sums) in sums.into_iter().enumerate() {
                        for (output, sum) in sums.into_iter().enumerate() {
                            let at = (at + place * layer.outputs + output) * L::LANES;
                            let sum = if layer.is_last { sum } else { l.max(sum, l.splat(0.0)) };
                            // SAFETY: the promise given to `new`: there is room for every place and output.
                            unsafe { l.store(self.to.add(at), sum) };
                        }
                    }
                }
            }
        }
    }
}

/// The sums of `N` neighbouring places; `from` begins at the first of what the kernel covers at the first of them.
#[inline(always)]
fn sums<L: Lane, const N: usize>(
    l: L,
    layer: &Layer,
    from: &[f32],
    (row, step): (usize, usize),
    (weights, bias): (&[f32], &[f32; OUTPUTS]),
) -> [[L::F; OUTPUTS]; N] {
    let mut sums = [bias.map(|bias| l.splat(bias)); N];
    for (y, weights) in weights.chunks_exact(layer.run * OUTPUTS).enumerate() {
        let from = &from[y * row * L::LANES..][..((N - 1) * step + layer.run) * L::LANES];
        for (i, weights) in weights.as_chunks::<OUTPUTS>().0.iter().enumerate() {
            for (place, sums) in sums.iter_mut().enumerate() {
                // SAFETY: i < run, place < N: within the slice above.
                let number = unsafe { l.load(from.as_ptr().add((place * step + i) * L::LANES)) };
                for (sum, &weight) in sums.iter_mut().zip(weights) {
                    *sum = l.mul_add(number, l.splat(weight), *sum);
                }
            }
        }
    }
    sums
}
