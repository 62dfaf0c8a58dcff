//! Every backend that this CPU has against the reference.
#![allow(clippy::unwrap_used, reason = "a test may fail")]

use hog_core::{Backend, Grouping, Hit, Hog, HogParams, ImageView, Search, model};
use proptest::prelude::*;

fn available() -> impl Iterator<Item = Backend> {
    Backend::ALL.into_iter().filter(|backend| backend.is_available())
}

/// A repeatable image with edges, texture and flat parts.
fn pixels(width: usize, height: usize, channels: usize, seed: u32) -> Vec<u8> {
    let mut state = seed.wrapping_mul(2_654_435_761) | 1;
    let mut noise = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state >> 24
    };
    let mut out = Vec::with_capacity(width * height * channels);
    for y in 0..height {
        for x in 0..width {
            let shape = if (x / 13 + y / 29) % 3 == 0 { 170 } else { 40 + (x as u32 * 3 + y as u32) % 90 };
            for channel in 0..channels as u32 {
                let texture = if (x / 40 + y / 40) % 2 == 0 { noise() / 5 } else { 0 };
                out.push((shape + texture + 7 * channel) as u8);
            }
        }
    }
    out
}

fn detector(params: &HogParams, coefficients: &[f32], backend: Backend) -> Hog {
    Hog::with_backend(params, Some(coefficients), backend).unwrap()
}

fn daimler() -> HogParams {
    HogParams { win_size: (48, 96), gamma_correction: false, ..HogParams::default() }
}

/// The windows that are hits, and their scores within `tolerance`.
fn assert_same(found: &[Hit], wanted: &[Hit], tolerance: f64, what: &str) {
    let places = |hits: &[Hit]| hits.iter().map(|hit| (hit.x, hit.y)).collect::<Vec<_>>();
    assert_eq!(places(found), places(wanted), "{what}");
    for (found, wanted) in found.iter().zip(wanted) {
        let off = (found.weight - wanted.weight).abs();
        assert!(off <= tolerance, "{what}: {} is off by {off:e}", wanted.weight);
    }
}

/// The reference: a detector whose geometry is the same, but which is asked for each window by its place.
fn one_by_one(hog: &Hog, image: ImageView, search: &Search, everywhere: &[Hit]) -> Vec<Hit> {
    let places: Vec<_> = everywhere.iter().map(|hit| (hit.x, hit.y)).collect();
    hog.detect(image, search, Some(&places)).unwrap()
}

fn compare(
    params: &HogParams,
    model: &[f32],
    size: (usize, usize),
    channels: usize,
    search: Search,
    seed: u32,
) {
    let (width, height) = size;
    let data = pixels(width, height, channels, seed);
    let image = ImageView::new(&data, width, height, channels, width * channels).unwrap();
    for backend in available() {
        let what = format!("{} {width}x{height}x{channels} {search:?}", backend.name());
        let hog = detector(params, model, backend);
        let all = Search { hit_threshold: -1e9, ..search };
        let found = hog.detect(image, &all, None).unwrap();
        let wanted = one_by_one(&hog, image, &all, &found);
        assert_same(&found, &wanted, 4e-6, &what);
        // A threshold that is exactly a window's score: the reference decides, and the window is a hit.
        if let Some(middle) = wanted.get(wanted.len() / 2) {
            let at = Search { hit_threshold: middle.weight, ..search };
            let found = hog.detect(image, &at, None).unwrap();
            let hits: Vec<Hit> = wanted.iter().copied().filter(|hit| hit.weight >= middle.weight).collect();
            assert_same(&found, &hits, 4e-6, &what);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn every_backend_finds_what_the_reference_finds(
        width in 1usize..260,
        height in 1usize..200,
        colour in any::<bool>(),
        people in any::<bool>(),
        stride in (1i64..5, 1i64..5),
        padding in (0i64..40, 0i64..40),
        seed in any::<u32>(),
    ) {
        let search = Search { hit_threshold: 0.0, win_stride: (4 * stride.0, 4 * stride.1), padding };
        let channels = if colour { 3 } else { 1 };
        if people {
            compare(&HogParams::default(), model::default_people(), (width, height), channels, search, seed);
        } else {
            compare(&daimler(), model::daimler_people(), (width, height), channels, search, seed);
        }
    }
}

#[test]
fn every_width_up_to_200_is_served() {
    let search = Search { hit_threshold: 0.0, win_stride: (8, 8), padding: (4, 4) };
    for width in 1..=200 {
        compare(&daimler(), model::daimler_people(), (width, 97), 1, search, width as u32);
    }
}

#[test]
fn every_height_up_to_200_is_served() {
    let search = Search { hit_threshold: 0.0, win_stride: (8, 8), padding: (4, 4) };
    for height in 1..=200 {
        compare(&daimler(), model::daimler_people(), (61, height), 3, search, height as u32);
    }
}

#[test]
fn pyramids_are_equal_on_every_backend_at_every_number_of_threads() {
    let (width, height) = (333, 251);
    let data = pixels(width, height, 3, 5);
    let image = ImageView::new(&data, width, height, 3, width * 3).unwrap();
    let search = Search { hit_threshold: -3.0, win_stride: (8, 8), padding: (4, 4) };
    let mut answers = Vec::new();
    for backend in available() {
        let hog = detector(&HogParams::default(), model::default_people(), backend);
        for threads in [1, 2, 5] {
            let found = hog.detect_multi_scale(image, &search, 1.05, Grouping::Similar(0), threads).unwrap();
            assert!(!found.is_empty());
            answers.push(found.into_iter().map(|(rect, _)| rect).collect::<Vec<_>>());
        }
    }
    assert!(answers.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn many_hits_of_a_loud_detector_weigh_what_each_weighs_alone() {
    // Weights of hundreds: the kernels' sums are too coarse, and every hit is weighed exactly.
    let loud: Vec<f32> = model::default_people().iter().map(|w| 1e4 * w).collect();
    let data = pixels(150, 170, 3, 9);
    let image = ImageView::new(&data, 150, 170, 3, 450).unwrap();
    let hog = Hog::new(&HogParams::default(), Some(&loud)).unwrap();
    for hit_threshold in [-1e9, -1e4] {
        let search = Search { hit_threshold, win_stride: (8, 4), padding: (8, 8) };
        let found = hog.detect(image, &search, None).unwrap();
        assert!(!found.is_empty());
        assert_same(&found, &one_by_one(&hog, image, &search, &found), 0.0, "loud");
    }
}

#[test]
fn a_detector_with_a_weight_that_is_no_number_scores_as_the_reference_does() {
    let mut model = model::default_people().to_vec();
    model[7] = f32::NAN;
    let data = pixels(64, 128, 1, 3);
    let image = ImageView::new(&data, 64, 128, 1, 64).unwrap();
    let search = Search { hit_threshold: -1e9, win_stride: (8, 8), padding: (0, 0) };
    for backend in available() {
        let hog = detector(&HogParams::default(), &model, backend);
        assert!(hog.detect(image, &search, None).unwrap().is_empty());
    }
}

#[test]
fn a_threshold_that_is_no_number_has_no_hits_and_minus_infinity_has_all() {
    let data = pixels(80, 136, 1, 3);
    let image = ImageView::new(&data, 80, 136, 1, 80).unwrap();
    for backend in available() {
        let hog = detector(&HogParams::default(), model::default_people(), backend);
        for (hit_threshold, count) in [(f64::NAN, 0), (f64::NEG_INFINITY, 6), (f64::INFINITY, 0)] {
            let search = Search { hit_threshold, win_stride: (8, 8), padding: (0, 0) };
            assert_eq!(hog.detect(image, &search, None).unwrap().len(), count);
        }
    }
}
