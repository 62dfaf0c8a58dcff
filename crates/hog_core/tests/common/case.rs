//! One random search, geometry × image × options, for proptest and for libFuzzer: it is read from bytes.

use super::{Detector, Picture, available, compare, reached_by};
use hog_core::pyramid::Steps;
use hog_core::{Grouping, Hog, HogParams, HogSpec, Interrupt, Search, SearchOptions};

/// Reads numbers from bytes; after their end all are the least.
struct Draw<'a>(&'a [u8]);

impl Draw<'_> {
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        std::array::from_fn(|_| {
            let (&first, rest) = self.0.split_first().unwrap_or((&0, &[]));
            self.0 = rest;
            first
        })
    }

    fn flag(&mut self) -> bool {
        self.bytes::<1>()[0] & 1 != 0
    }

    /// From `low` to `high - 1`.
    fn number(&mut self, low: i64, high: i64) -> i64 {
        low + i64::from(u16::from_le_bytes(self.bytes())) % (high - low)
    }

    fn pair(&mut self, low: i64, high: i64) -> (i64, i64) {
        (self.number(low, high), self.number(low, high))
    }

    fn params(&mut self) -> HogParams {
        let mut params = HogParams { gamma_correction: self.flag(), ..HogParams::default() };
        match self.number(0, 8) {
            // The windows of the people models.
            0 => {}
            1 => params.win_size = (48, 96),
            // What else has kernels.
            2..=3 => {
                let blocks = self.pair(0, 4);
                params.win_size = (16 + 8 * blocks.0, 16 + 8 * blocks.1);
            }
            4..=6 => {
                let cells = self.pair(1, 5);
                params.cell_size = self.pair(1, 12);
                params.block_size = (params.cell_size.0 * cells.0, params.cell_size.1 * cells.1);
                params.block_stride = self.pair(1, 20);
                let (blocks, (x, y)) = (self.pair(0, 4), params.block_stride);
                params.win_size = (params.block_size.0 + blocks.0 * x, params.block_size.1 + blocks.1 * y);
                params.nbins = self.number(1, 20);
                params.signed_gradient = self.flag();
            }
            // Anything may be refused; what is not, is small enough to be worked on.
            _ => {
                let mut any = || i64::from(i16::from_le_bytes(self.bytes()));
                params.win_size = (any(), any());
                params.block_size = (any(), any());
                params.block_stride = (any(), any());
                params.cell_size = (any(), any());
                params.nbins = any();
            }
        }
        if self.number(0, 4) == 3 {
            params.win_sigma = f64::from(f32::from_le_bytes(self.bytes()));
            params.l2_hys_threshold = f64::from(f32::from_le_bytes(self.bytes()));
            params.nlevels = i64::from(i16::from_le_bytes(self.bytes()));
        }
        params
    }

    /// Weights of either sign, as loud as a trained detector's, with or without a bias; or a people model.
    fn coefficients(&mut self, params: &HogParams, len: usize) -> Vec<f32> {
        for known in [Detector::people(), Detector::daimler()] {
            if known.params.win_size == params.win_size && known.coefficients.len() == len + 1 && self.flag()
            {
                return known.coefficients;
            }
        }
        let (len, seed) = (len + usize::from(self.flag()), self.number(0, 511) as usize);
        (seed..seed + len).map(|i| ((i * i % 511) as f32 - 255.0) / 4e3).collect()
    }

    fn picture(&mut self) -> Picture {
        let most = if self.flag() { (73, 73) } else { (261, 201) };
        let (width, height) = (self.number(1, most.0) as usize, self.number(1, most.1) as usize);
        let channels = if self.flag() { 3 } else { 1 };
        let mut picture = Picture::new(width, height, channels, self.number(0, 1 << 16) as u32);
        // The rest of the bytes are pixels.
        if self.flag() && !self.0.is_empty() {
            picture.data = self.0.iter().copied().cycle().take(picture.data.len()).collect();
        }
        picture
    }
}

/// Refused with an error, or every backend finds the windows that the exact path finds, and the same in a pyramid.
pub fn check(bytes: &[u8]) {
    let mut draw = Draw(bytes);
    let params = draw.params();
    let Ok(spec) = HogSpec::new(&params) else { return };
    if spec.block.area() > 4096 || spec.descriptor_len() > 20_000 {
        return;
    }
    let detector = Detector { coefficients: draw.coefficients(&params, spec.descriptor_len()), params };
    let far = if draw.number(0, 64) == 63 { 1 << 13 } else { 1 };
    let (x, y) = if draw.flag() { draw.pair(1, 20) } else { draw.pair(-8, 128) };
    let search = Search { hit_threshold: 0.0, win_stride: (x * far, y), padding: draw.pair(-4, 40) };
    let (share, scale, group) = (draw.number(0, 256), draw.number(0, 256), draw.number(-128, 128));
    let mean_shift = draw.flag();
    let picture = draw.picture();
    let image = picture.view();
    let Ok(steps) = Steps::new(search.win_stride, search.padding, spec.cell, &spec) else {
        let hog = Hog::new(&detector.params, Some(&detector.coefficients)).unwrap();
        assert!(hog.detect_windows(image, &search, None, &Interrupt::NEVER).is_err());
        return;
    };
    let grid = steps.grid(image.size(), &spec);
    if grid.len() * spec.descriptor_len() > 1_000_000 || grid.padded.area() > 100_000 {
        return;
    }
    let usual = HogParams::default();
    let is_usual = detector.params.win_sigma == usual.win_sigma
        && detector.params.l2_hys_threshold == usual.l2_hys_threshold;
    // The crate's own bound: small detectors come near to it.
    let tolerance = if is_usual { 2.0 * detector.rounding() } else { f64::INFINITY };
    let wanted = compare(&detector, &picture, search, tolerance);
    if wanted.is_empty() {
        return;
    }
    let search = Search { hit_threshold: reached_by(&wanted, share as f64 / 256.0), ..search };
    let hits = wanted.iter().filter(|hit| hit.weight >= search.hit_threshold).count();
    let grouping = if mean_shift && search.hit_threshold > 0.0 && hits < 12 {
        Grouping::MeanShift(group as f64)
    } else {
        Grouping::Similar(group as i32)
    };
    let mut first = None;
    for backend in available() {
        let hog = Hog::with_backend(&detector.params, Some(&detector.coefficients), backend).unwrap();
        let scale = 1.0 + scale as f64 / 128.0;
        let options = SearchOptions { search, scale, grouping, ..SearchOptions::default() };
        let found = hog.detect(image, &options, &Interrupt::NEVER);
        let rects: Vec<_> = found.unwrap().into_iter().map(|(rect, _)| rect).collect();
        assert_eq!(*first.get_or_insert_with(|| rects.clone()), rects, "{}: {search:?}", backend.name());
    }
}
