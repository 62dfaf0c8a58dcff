//! Descriptors of many crops: by the fast path, where the geometry has one.

use crate::detect::Hog;
use crate::error::{ImageError, ParameterError, Result};
use crate::exact;
use crate::fast::{self, Crops};
use crate::image::ImageView;
use crate::interrupt::Interrupt;
use crate::memory;
use crate::pyramid::Steps;
use crate::threads::for_each;

/// Crops that a thread takes at a time: 50 µs of work, so that of 200 crops on two threads neither waits long for the other.
const AT_ONCE: usize = 4;

impl Hog {
    /// Writes the descriptors of the crops in `pixels`, one after the other, into `out`: within 1e-6 of those that
    /// [`Hog::compute`] gives.
    ///
    /// Crops are windows: rows of interleaved pixels without gaps, crop after crop.
    ///
    /// ```
    /// use hog_core::{Hog, HogParams, Interrupt};
    /// let hog = Hog::new(&HogParams::default(), None)?;
    /// let crops = vec![128; 10 * 64 * 128 * 3];
    /// let mut descriptors = vec![0.0; 10 * hog.spec().descriptor_len()];
    /// hog.describe(&crops, 3, 2, &Interrupt::NEVER, &mut descriptors)?; // in colour, on two threads
    /// # Ok::<(), hog_core::HogError>(())
    /// ```
    pub fn describe(
        &self,
        pixels: &[u8],
        channels: usize,
        threads: usize,
        interrupt: &Interrupt,
        out: &mut [f32],
    ) -> Result<()> {
        let spec = self.spec();
        let (win, elements) = (spec.win, spec.descriptor_len());
        if channels != 1 && channels != 3 {
            return Err(ImageError::Channels { got: channels }.into());
        }
        let crop = win.area() * channels;
        let count = pixels.len() / crop;
        if out.len() / elements.max(1) != count || !pixels.len().is_multiple_of(crop) {
            return Err(ParameterError::Descriptors { windows: count, elements }.into());
        }
        let parts = pixels.chunks(AT_ONCE * crop).zip(out.chunks_mut((AT_ONCE * elements).max(1)));
        let grid = Steps::new((0, 0), (0, 0), spec.cell, spec)?.grid(win, spec);
        for_each(memory::collect(parts)?, threads, interrupt, |(pixels, out), interrupt| {
            if let Some(geometry) = &self.geometry {
                let crops = Crops { pixels, size: win, channels };
                return fast::describe(self.backend, geometry, crops, interrupt, out);
            }
            for (pixels, out) in pixels.chunks(crop).zip(out.chunks_mut(elements.max(1))) {
                let view = ImageView::new(pixels, win.width, win.height, channels, win.width * channels)?;
                exact::descriptors(view, &grid, spec, &self.exact.tables, interrupt, out)?;
            }
            Ok(())
        })
    }
}
