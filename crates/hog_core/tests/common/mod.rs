//! Images and the exact path's answers, for the tests of the fast path.
#![allow(dead_code, reason = "each test binary uses a part")]

pub mod case;

use hog_core::exact::{self, RowVotes, Svm, Tables};
use hog_core::pyramid::{Grid, Steps};
use hog_core::{Backend, Hit, Hog, HogParams, HogSpec, ImageView, Interrupt, Search, Size, model};

pub const ALL_WINDOWS: f64 = -1e9;
/// Windows every 8 px inside of the image.
pub const STEPS: Search = Search { hit_threshold: 0.0, win_stride: (8, 8), padding: (0, 0) };
/// Those of OpenCV's samples, 4 px beyond its edges too.
pub const PADDED: Search = Search { padding: (4, 4), ..STEPS };

/// The backends of this CPU.
pub fn available() -> impl Iterator<Item = Backend> {
    Backend::ALL.into_iter().filter(|backend| backend.is_available())
}

/// A repeatable image with edges, texture and flat parts.
pub struct Picture {
    pub width: usize,
    pub height: usize,
    pub channels: usize,
    pub data: Vec<u8>,
}

impl Picture {
    pub fn new(width: usize, height: usize, channels: usize, seed: u32) -> Self {
        let mut state = seed.wrapping_mul(2_654_435_761) | 1;
        let mut noise = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state >> 24
        };
        let mut data = Vec::with_capacity(width * height * channels);
        for y in 0..height {
            for x in 0..width {
                let shape =
                    if (x / 13 + y / 29) % 3 == 0 { 170 } else { 40 + (x as u32 * 3 + y as u32) % 90 };
                for channel in 0..channels as u32 {
                    let texture = if (x / 40 + y / 40) % 2 == 0 { noise() / 5 } else { 0 };
                    data.push((shape + texture + 7 * channel) as u8);
                }
            }
        }
        Self { width, height, channels, data }
    }

    pub fn view(&self) -> ImageView<'_> {
        ImageView::new(&self.data, self.width, self.height, self.channels, self.width * self.channels)
            .unwrap()
    }
}

/// The gradient of an image: of each pixel, two shares of its magnitude, and the bins that get them.
pub struct Gradient {
    pub size: Size,
    pub shares: Vec<[f32; 2]>,
    pub bins: Vec<[u8; 2]>,
}

impl Gradient {
    /// Of the image with `borders` (left, top, right, bottom) around it.
    pub fn new(hog: &Hog, image: ImageView, borders: [i64; 4]) -> Self {
        let size = Hog::gradient_size(image, borders).unwrap();
        // No share is negative, and no bin 255, unless it is not written.
        let (mut shares, mut bins) = (vec![[-1.0; 2]; size.area()], vec![[255; 2]; size.area()]);
        let out = RowVotes { shares: &mut shares, bins: &mut bins };
        hog.gradient(image, borders, &Interrupt::NEVER, out).unwrap();
        Self { size, shares, bins }
    }
}

/// A geometry with a linear SVM that fits it.
#[derive(Clone)]
pub struct Detector {
    pub params: HogParams,
    pub coefficients: Vec<f32>,
}

impl Detector {
    pub fn people() -> Self {
        Self { params: HogParams::default(), coefficients: model::default_people().to_vec() }
    }

    pub fn daimler() -> Self {
        let params = HogParams { win_size: (48, 96), gamma_correction: false, ..HogParams::default() };
        Self { params, coefficients: model::daimler_people().to_vec() }
    }

    pub fn spec(&self) -> HogSpec {
        HogSpec::new(&self.params).unwrap()
    }

    /// Every window of `image` with its score, by the exact path alone, row by row.
    pub fn every_window(&self, image: ImageView, search: &Search) -> Vec<Hit> {
        let spec = self.spec();
        let svm = Svm::new(&self.coefficients, &spec).unwrap();
        let grid = self.grid(image, search);
        let scores =
            exact::scores(image, &grid, &spec, &Tables::new(&spec).unwrap(), &svm, &Interrupt::NEVER)
                .unwrap();
        assert_eq!(scores.len(), grid.windows.width * grid.windows.height);
        let hit = |(index, weight): (usize, f64)| {
            let (column, row) = (index % grid.windows.width, index / grid.windows.width);
            let (x, y) = grid.to_image(column * grid.stride.width, row * grid.stride.height);
            Hit { x, y, weight }
        };
        scores.into_iter().enumerate().map(hit).collect()
    }

    pub fn grid(&self, image: ImageView, search: &Search) -> Grid {
        let spec = self.spec();
        let steps = Steps::new(search.win_stride, search.padding, spec.cell, &spec).unwrap();
        steps.grid(Size::new(image.width(), image.height()), &spec)
    }

    /// The largest rounding error of a fast score that a test lets pass: half the bound that the crate relies on, which
    /// is a share of Σ‖w‖ over the SVM's blocks, larger for geometries that have no kernels of their own.
    pub fn rounding(&self) -> f64 {
        let spec = self.spec();
        let blocks = self.coefficients[..spec.descriptor_len()].chunks_exact(spec.block_len);
        let norm = |block: &[f32]| block.iter().map(|&w| f64::from(w).powi(2)).sum::<f64>().sqrt();
        let has_kernels = self.params.block_size == (16, 16) && self.params.cell_size == (8, 8);
        blocks.map(norm).sum::<f64>() * if has_kernels { 4e-7 } else { 1e-6 } * 0.5
    }
}

/// The score that `share` (0 to 1) of the windows reach.
pub fn reached_by(windows: &[Hit], share: f64) -> f64 {
    let mut weights: Vec<f64> = windows.iter().map(|hit| hit.weight).collect();
    weights.sort_by(|a, b| b.total_cmp(a));
    weights[((weights.len() - 1) as f64 * share) as usize]
}

/// Asserts that both hold the same windows, with scores at most `tolerance` apart.
pub fn assert_same(found: &[Hit], wanted: &[Hit], tolerance: f64, what: &str) {
    let places = |hits: &[Hit]| hits.iter().map(|hit| (hit.x, hit.y)).collect::<Vec<_>>();
    assert_eq!(places(found), places(wanted), "{what}");
    for (found, wanted) in found.iter().zip(wanted) {
        let off = (found.weight - wanted.weight).abs();
        assert!(found.weight == wanted.weight || off <= tolerance, "{what}: {wanted:?} is off by {off:e}");
    }
}

/// Every backend scores every window as the exact path does, and decides as it does where the threshold is exactly the
/// score of a window. Returns the windows.
pub fn compare(detector: &Detector, picture: &Picture, search: Search, tolerance: f64) -> Vec<Hit> {
    let image = picture.view();
    let mut wanted = detector.every_window(image, &search);
    wanted.retain(|hit| hit.weight >= ALL_WINDOWS);
    for backend in available() {
        let what = format!("{} {:?} {:?} {search:?}", backend.name(), image.size(), detector.params);
        let hog = Hog::with_backend(&detector.params, Some(&detector.coefficients), backend).unwrap();
        let check = |hit_threshold, hits: &[Hit]| {
            let search = Search { hit_threshold, ..search };
            let found = hog.detect_windows(image, &search, None, &Interrupt::NEVER).unwrap();
            assert_same(&found, hits, tolerance, &format!("{what} at {hit_threshold}"));
        };
        check(ALL_WINDOWS, &wanted);
        if wanted.is_empty() {
            continue;
        }
        for share in [0.0, 0.02, 0.5] {
            let hit_threshold = reached_by(&wanted, share);
            let hits: Vec<Hit> = wanted.iter().copied().filter(|hit| hit.weight >= hit_threshold).collect();
            check(hit_threshold, &hits);
        }
    }
    wanted
}
