//! A window of the image as the network sees it: area-averaged, grey, its mean 0, its contrast about 1.

use crate::error::Result;
use crate::fast::INPUT;
use crate::image::{ImageView, reflect_101};
use crate::interrupt::Interrupt;
use crate::memory;

/// Grey levels added to the deviation, so that flat windows stay flat.
const FLAT: f64 = 8.0;

/// A column of the image, and how much of it counts.
type Tap = (usize, f32);

/// Scratch memory of the crops of a thread.
#[derive(Debug, Default)]
pub(super) struct Cropper {
    /// Of each column of the crop, the columns of the image under it.
    taps: [Vec<Tap>; INPUT.0],
    /// Weighted sums down the rows under a row of the crop, one for each byte of an image's row.
    sums: Vec<f32>,
}

impl Cropper {
    pub(super) fn bytes(&self) -> usize {
        self.sums.capacity() * size_of::<f32>()
            + self.taps.iter().map(|taps| taps.capacity() * size_of::<Tap>()).sum::<usize>()
    }

    /// Cuts `window` out of `image` into `out`; what lies beyond the image is mirrored, a colour is its channels' mean.
    pub(super) fn crop(
        &mut self,
        image: ImageView,
        &[x, y, width, height]: &[f64; 4],
        interrupt: &Interrupt,
        out: &mut [f32],
    ) -> Result<()> {
        let channels = image.channels();
        for (column, taps) in self.taps.iter_mut().enumerate() {
            taps.clear();
            memory::extend(taps, under(x, width / INPUT.0 as f64, column, image.width()))?;
        }
        let columns = self.taps.iter().flatten().map(|&(column, _)| column);
        let first = columns.clone().min().unwrap_or(0);
        let bytes = channels * first..channels * (columns.max().unwrap_or(0) + 1);
        memory::resize(&mut self.sums, bytes.len(), 0.0)?;
        for (row, out) in out.chunks_exact_mut(INPUT.0).enumerate() {
            interrupt.check()?;
            let sums = &mut self.sums[..bytes.len()];
            sums.fill(0.0);
            for (y, weight) in under(y, height / INPUT.1 as f64, row, image.height()) {
                for (sum, &byte) in sums.iter_mut().zip(&image.row(y)[bytes.clone()]) {
                    *sum += weight * f32::from(byte);
                }
            }
            for (out, taps) in out.iter_mut().zip(&self.taps) {
                let tap = |&(column, weight): &Tap| {
                    weight * sums[channels * (column - first)..][..channels].iter().sum::<f32>()
                };
                *out = taps.iter().map(tap).sum::<f32>() / channels as f32;
            }
        }
        normalise(out);
        Ok(())
    }
}

/// The pixels along an axis under pixel `index` of a crop that begins at `start`, and their shares of it.
fn under(start: f64, step: f64, index: usize, len: usize) -> impl Iterator<Item = Tap> {
    let (from, to) = (start + step * index as f64, start + step * (index + 1) as f64);
    (from.floor() as i64..to.ceil() as i64).map(move |at| {
        let share = (to.min(at as f64 + 1.0) - from.max(at as f64)) / step;
        (reflect_101(at, len), share as f32)
    })
}

/// Takes the mean from the pixels, and divides them by their deviation and [`FLAT`].
fn normalise(pixels: &mut [f32]) {
    let count = pixels.len() as f64;
    let mean = pixels.iter().map(|&pixel| f64::from(pixel)).sum::<f64>() / count;
    let squares = pixels.iter().map(|&pixel| (f64::from(pixel) - mean).powi(2)).sum::<f64>();
    let scale = 1.0 / ((squares / count).sqrt() + FLAT);
    for pixel in pixels {
        *pixel = ((f64::from(*pixel) - mean) * scale) as f32;
    }
}
