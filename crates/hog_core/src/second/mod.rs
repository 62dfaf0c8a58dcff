//! A second look: a small convolutional network's opinion of windows that the detector found, and of where in them the
//! person stands.
//!
//! `crop` cuts a window out of the image at the network's size; `fast::network` has the kernels.

mod crop;

use crate::error::{ParameterError, Result};
use crate::fast::{ANSWER, Backend, INPUT, Network};
use crate::image::ImageView;
use crate::interrupt::Interrupt;
use crate::memory::{self, Pool, Workspace};
use crate::threads::for_each;

use crop::Cropper;

/// Windows that a thread takes at a time: a vector of any backend is full.
const ABREAST: usize = 16;
/// Longest side and farthest place of a window [px].
const SIDE_MAX: f64 = (1 << 20) as f64;
const PLACE_MAX: f64 = (1 << 30) as f64;

/// A window of the image: x, y, width, height \[px\], in fractions where it likes.
pub type Window = [f64; 4];

/// The network's answer to a window: a logit, above 0 where it is rather a person; then how its person's box differs from
/// the box that every window of the model has: right and down by these shares of the window's sides, and the logarithms
/// by how much it is wider and higher.
pub type Answer = [f32; ANSWER];

/// Scratch memory, one per thread at work.
static SCRATCH: Pool<Scratch> = Pool::new();

#[derive(Debug, Default)]
struct Scratch {
    cropper: Cropper,
    inputs: Vec<f32>,
}

impl Workspace for Scratch {
    fn bytes(&self) -> usize {
        self.cropper.bytes() + self.inputs.capacity() * size_of::<f32>()
    }
}

/// A network of three convolutions and two dense layers over 32 × 64 grey pixels. Immutable, so threads may share it.
///
/// ```
/// use hog_core::{ImageView, Interrupt, SecondLook};
/// let weights = [0.0; 26 * 4 + 37 * 4 + 37 * 4 + 129 * 4 + 5 * 5];
/// let look = SecondLook::new([4, 4, 4], 4, &weights)?;
/// let image = ImageView::new(&[128; 64 * 128], 64, 128, 1, 64)?;
/// let mut answers = [[1.0; 5]];
/// look.answers(image, &[[0.0, 0.0, 64.0, 128.0]], 1, &Interrupt::NEVER, &mut answers)?;
/// assert_eq!(answers, [[0.0; 5]]);
/// # Ok::<(), hog_core::HogError>(())
/// ```
#[derive(Debug)]
pub struct SecondLook {
    network: Network,
    backend: Backend,
}

impl SecondLook {
    /// A network with these channels of its convolutions (kernels 5, 3, 3; stride 2) and `hidden` units.
    ///
    /// `weights` has, layer by layer, the weights \[row\]\[column\]\[input\]\[output\], then the biases.
    pub fn new(channels: [usize; 3], hidden: usize, weights: &[f32]) -> Result<Self> {
        Self::with_backend(channels, hidden, weights, Backend::current()?)
    }

    /// [`new`](Self::new) with a backend other than the one in force; this CPU must have it.
    pub fn with_backend(
        channels: [usize; 3],
        hidden: usize,
        weights: &[f32],
        backend: Backend,
    ) -> Result<Self> {
        Ok(Self { network: Network::new(channels, hidden, weights)?, backend: backend.checked()? })
    }

    /// The network's answer to each window, into `out`, which has a place for each.
    ///
    /// What lies beyond the image is mirrored. The same bits whatever the number of threads.
    pub fn answers(
        &self,
        image: ImageView,
        windows: &[Window],
        threads: usize,
        interrupt: &Interrupt,
        out: &mut [Answer],
    ) -> Result<()> {
        if let Some(window) = windows.iter().find(|window| !is_fair(window)) {
            let [x, y, width, height] = window.map(|side| side as i64);
            return Err(ParameterError::Window { x, y, width, height, most: SIDE_MAX as usize }.into());
        }
        let parts = memory::collect(windows.chunks(ABREAST).zip(out.chunks_mut(ABREAST)))?;
        let done = for_each(parts, threads, interrupt, |(windows, out), interrupt| {
            SCRATCH.with(|Scratch { cropper, inputs }| {
                inputs.clear();
                memory::resize(inputs, windows.len() * INPUT.0 * INPUT.1, 0.0)?;
                for (window, input) in windows.iter().zip(inputs.chunks_exact_mut(INPUT.0 * INPUT.1)) {
                    cropper.crop(image, window, interrupt, input)?;
                }
                self.network.answers(self.backend, inputs, interrupt, out)
            })
        });
        SCRATCH.trim();
        done
    }
}

fn is_fair(&[x, y, width, height]: &Window) -> bool {
    let is_side = |side: f64| side > 0.0 && side <= SIDE_MAX;
    x.abs() <= PLACE_MAX && y.abs() <= PLACE_MAX && is_side(width) && is_side(height)
}
