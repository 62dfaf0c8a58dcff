//! The fast path on every backend of this CPU against the exact path, which scores the whole grid on its own.
#![allow(clippy::unwrap_used, reason = "a test may fail")]

mod common;

use common::{ALL_WINDOWS, Detector, PADDED, Picture, assert_same, available, case, reached_by};
use hog_core::group::{Candidate, clip, group_candidates, mean_shift};
use hog_core::pyramid::{levels, resize, to_image};
use hog_core::{
    Backend, Grouping, Hit, Hog, HogParams, ImageView, Interrupt, Rect, Search, SearchOptions, Size,
};
use proptest::prelude::*;

fn hog(detector: &Detector, backend: Backend) -> Hog {
    Hog::with_backend(&detector.params, Some(&detector.coefficients), backend).unwrap()
}

fn compare(detector: &Detector, size: (usize, usize), channels: usize, search: Search, seed: u32) {
    common::compare(detector, &Picture::new(size.0, size.1, channels, seed), search, detector.rounding());
}

/// 96 cases, unless PROPTEST_CASES says otherwise.
fn cases() -> ProptestConfig {
    let config = ProptestConfig::default();
    if std::env::var_os("PROPTEST_CASES").is_some() { config } else { ProptestConfig { cases: 96, ..config } }
}

proptest! {
    #![proptest_config(cases())]

    #[test]
    fn every_backend_finds_what_the_exact_path_finds(bytes in prop::collection::vec(any::<u8>(), 64..256)) {
        case::check(&bytes);
    }
}

#[test]
fn every_width_up_to_200_is_served() {
    for width in 1..=200 {
        compare(&Detector::daimler(), (width, 97), 1, PADDED, width as u32);
    }
}

#[test]
fn every_height_up_to_200_is_served() {
    for height in 1..=200 {
        compare(&Detector::daimler(), (61, height), 3, PADDED, height as u32);
    }
}

#[test]
fn images_that_are_made_in_several_bands_are_scored_alike() {
    // A band is 384 KB of pixels: 272 rows of the gray image, 128 and 160 of those in colour.
    compare(&Detector::people(), (1100, 620), 1, PADDED, 1);
    compare(&Detector::people(), (650, 410), 3, PADDED, 2);
    compare(&Detector::daimler(), (501, 330), 3, Search { win_stride: (4, 12), ..PADDED }, 3);
}

#[test]
fn a_window_as_large_as_the_kernels_serve_is_scored_alike() {
    // 20 × 20 blocks, with clipping off and on.
    for l2_hys_threshold in [1.0, 0.2, 0.05] {
        let params = HogParams { win_size: (168, 168), l2_hys_threshold, ..HogParams::default() };
        let coefficients = (0..36 * 400).map(|i| ((i * i % 511) as f32 - 255.0) / 4e3).collect();
        compare(&Detector { params, coefficients }, (200, 190), 3, PADDED, 4);
    }
}

#[test]
fn a_detector_that_is_a_windows_own_descriptor_is_scored_alike() {
    // The largest sums that the prefilter can meet: weights in the direction of the features.
    for (seed, scale) in [(1, 0.1), (2, 1.0)] {
        let picture = Picture::new(150, 200, 3, seed);
        let params = HogParams::default();
        let hog = Hog::new(&params, None).unwrap();
        let mut own = vec![0.0; 3780];
        hog.compute(picture.view(), &PADDED, Some(&[(16, 24)]), &Interrupt::NEVER, &mut own).unwrap();
        let coefficients = own.iter().map(|x| scale * x).collect();
        compare(&Detector { params, coefficients }, (150, 200), 3, PADDED, seed);
    }
}

/// All hits of a pyramid, by the exact path alone.
fn candidates(detector: &Detector, image: ImageView, search: &Search, scale: f64) -> Vec<Candidate> {
    let (spec, mut found) = (detector.spec(), Vec::new());
    let steps = Search { win_stride: (8, 8), ..*search };
    for level in levels(Size::new(image.width(), image.height()), scale, &spec, &Interrupt::NEVER).unwrap() {
        let shrunk = resize(image, level.size).unwrap();
        let (width, channels) = (level.size.width, image.channels());
        let shrunk = ImageView::new(&shrunk, width, level.size.height, channels, width * channels).unwrap();
        let hits = detector.every_window(shrunk, &steps);
        found.extend(hits.iter().filter(|hit| hit.weight >= search.hit_threshold).map(|hit| Candidate {
            rect: to_image(hit.x, hit.y, level.scale, &spec),
            weight: hit.weight,
            scale: level.scale,
        }));
    }
    found
}

/// A pyramid of which every hit is returned.
const PYRAMID: SearchOptions = SearchOptions {
    search: PADDED,
    scale: 1.1,
    searched_size: None,
    grouping: Grouping::None,
    guide: None,
    threads: 1,
};

fn rects(found: &[(Rect, f64)]) -> Vec<Rect> {
    found.iter().map(|&(rect, _)| rect).collect()
}

#[test]
fn pyramids_are_those_of_the_exact_path_on_every_backend_at_every_number_of_threads() {
    for (size, channels) in [((333, 251), 3), ((700, 520), 3), ((1001, 500), 1)] {
        let picture = Picture::new(size.0, size.1, channels, 5);
        let (image, mut detector) = (picture.view(), Detector::people());
        // A bias that lets a few windows in a hundred score more than 0.
        detector.coefficients[3780] -= reached_by(&detector.every_window(image, &PADDED), 0.03) as f32;
        let candidates = candidates(&detector, image, &PADDED, 1.1);
        let inside = |found| clip(found, size.0 as i32, size.1 as i32);
        let every = inside(group_candidates(&candidates, 0, &Interrupt::NEVER).unwrap());
        let grouped = inside(group_candidates(&candidates, 2, &Interrupt::NEVER).unwrap());
        let modes = inside(mean_shift(&candidates, 0.1, (64, 128), &Interrupt::NEVER).unwrap());
        let counts = [every.len(), grouped.len(), modes.len()];
        assert!(counts.iter().zip([50, 3, 3]).all(|(count, least)| *count >= least), "too few: {counts:?}");
        for backend in available() {
            let hog = hog(&detector, backend);
            for threads in [1, 2, 5, 64] {
                let detect = |grouping| {
                    hog.detect(image, &SearchOptions { grouping, threads, ..PYRAMID }, &Interrupt::NEVER)
                        .unwrap()
                };
                let found = detect(Grouping::None);
                assert_eq!(rects(&found), rects(&every), "{}", backend.name());
                let off = found.iter().zip(&every).map(|(found, wanted)| (found.1 - wanted.1).abs());
                assert!(off.fold(0.0, f64::max) <= detector.rounding(), "{}", backend.name());
                assert_eq!(rects(&detect(Grouping::Similar(2))), rects(&grouped), "{}", backend.name());
            }
            // Mean-shift is given exact weights: not a bit differs.
            let options = SearchOptions { grouping: Grouping::MeanShift(0.1), threads: 2, ..PYRAMID };
            let found = hog.detect(image, &options, &Interrupt::NEVER).unwrap();
            assert_eq!(found, modes, "{}", backend.name());
        }
    }
}

#[test]
fn a_search_at_another_size_is_that_of_the_resized_image_on_every_backend() {
    for (channels, size) in [(1, Size::new(313, 351)), (3, Size::new(400, 290)), (3, Size::new(150, 170))] {
        let picture = Picture::new(257, 200, channels, 6);
        let mut detector = Detector::people();
        let resized = resize(picture.view(), size).unwrap();
        let resized =
            ImageView::new(&resized, size.width, size.height, channels, size.width * channels).unwrap();
        detector.coefficients[3780] -= reached_by(&detector.every_window(resized, &PADDED), 0.03) as f32;
        let wanted = candidates(&detector, resized, &PADDED, PYRAMID.scale);
        let wanted = group_candidates(&wanted, 0, &Interrupt::NEVER).unwrap();
        let wanted = clip(wanted, size.width as i32, size.height as i32);
        assert!(wanted.len() > 5);
        // The grouping by mean-shift takes exact weights, which the exact path computes.
        for backend in available() {
            let hog = hog(&detector, backend);
            let search = |image, searched_size, grouping| {
                let options = SearchOptions { searched_size, grouping, ..PYRAMID };
                hog.detect(image, &options, &Interrupt::NEVER).unwrap()
            };
            let found = search(picture.view(), Some(size), Grouping::None);
            assert_eq!(rects(&found), rects(&wanted), "{}", backend.name());
            let modes = Grouping::MeanShift(0.1);
            assert_eq!(search(picture.view(), Some(size), modes), search(resized, None, modes));
        }
    }
}

#[test]
fn a_window_at_the_threshold_is_decided_on_the_resized_image() {
    let (picture, size, detector) = (Picture::new(257, 200, 3, 6), Size::new(150, 170), Detector::people());
    let resized = resize(picture.view(), size).unwrap();
    let resized = ImageView::new(&resized, size.width, size.height, 3, size.width * 3).unwrap();
    // Two levels, the second of which is resized twice; on either most windows are far from the threshold.
    let all = Search { hit_threshold: ALL_WINDOWS, ..PADDED };
    let every = candidates(&detector, resized, &all, 1.2);
    for backend in available() {
        let hog = hog(&detector, backend);
        for &Candidate { weight: hit_threshold, .. } in every.iter().filter(|one| one.scale > 1.0) {
            let wanted = every.iter().filter(|one| one.weight >= hit_threshold).count();
            let search = Search { hit_threshold, ..PADDED };
            let options = SearchOptions { search, searched_size: Some(size), scale: 1.2, ..PYRAMID };
            let found = hog.detect(picture.view(), &options, &Interrupt::NEVER).unwrap();
            assert_eq!(found.len(), wanted, "{} {hit_threshold}", backend.name());
        }
    }
}

#[test]
fn many_hits_of_a_loud_detector_weigh_what_each_weighs_exactly() {
    // Weights of hundreds: the kernels' sums are too coarse, and every hit is weighed exactly.
    let mut detector = Detector::people();
    detector.coefficients.iter_mut().for_each(|weight| *weight *= 1e4);
    let picture = Picture::new(150, 170, 3, 9);
    let search = Search { hit_threshold: ALL_WINDOWS, win_stride: (8, 4), padding: (8, 8) };
    let wanted = detector.every_window(picture.view(), &search);
    for backend in available() {
        for share in [0.1, 1.0] {
            let hit_threshold = reached_by(&wanted, share);
            let found = hog(&detector, backend).detect_windows(
                picture.view(),
                &Search { hit_threshold, ..search },
                None,
                &Interrupt::NEVER,
            );
            let hits: Vec<Hit> = wanted.iter().copied().filter(|hit| hit.weight >= hit_threshold).collect();
            assert_same(&found.unwrap(), &hits, 0.0, backend.name());
        }
    }
}

/// A detector of this geometry with weights of either sign, as loud as a trained one.
fn of_geometry(params: HogParams) -> Detector {
    let len = hog_core::HogSpec::new(&params).unwrap().descriptor_len();
    let coefficients = (0..=len).map(|i| ((i * i % 511) as f32 - 255.0) / 4e3).collect();
    Detector { params, coefficients }
}

/// Window, block, block stride and cell, all square [px].
fn square(win: i64, block: i64, stride: i64, cell: i64) -> HogParams {
    let [win_size, block_size, block_stride, cell_size] = [win, block, stride, cell].map(|side| (side, side));
    HogParams { win_size, block_size, block_stride, cell_size, ..HogParams::default() }
}

#[test]
fn a_window_asked_for_by_its_place_weighs_what_the_exact_path_says() {
    let picture = Picture::new(131, 170, 3, 6);
    for (params, win_stride) in [(HogParams::default(), (5, 3)), (square(36, 12, 6, 6), (6, 6))] {
        let detector = of_geometry(params);
        let search = Search { hit_threshold: ALL_WINDOWS, win_stride, padding: (4, 4) };
        let wanted = detector.every_window(picture.view(), &search);
        let places: Vec<_> = wanted.iter().map(|hit| (hit.x, hit.y)).collect();
        for backend in available() {
            let hog = hog(&detector, backend);
            let found =
                hog.detect_windows(picture.view(), &search, Some(&places), &Interrupt::NEVER).unwrap();
            assert_same(&found, &wanted, 0.0, backend.name());
        }
    }
}

#[test]
fn common_geometries_without_kernels_find_what_the_exact_path_finds() {
    let people = Detector::people();
    compare(&people, (131, 170), 3, Search { win_stride: (5, 3), ..PADDED }, 6);
    compare(&people, (131, 170), 1, Search { win_stride: (6, 8), ..PADDED }, 6);
    let bins = |nbins, signed_gradient| HogParams { nbins, signed_gradient, ..HogParams::default() };
    for params in [
        square(48, 8, 4, 4),
        square(64, 32, 16, 16),
        square(64, 32, 8, 8),
        square(40, 8, 8, 8),
        square(48, 18, 5, 6),  // a block ends within a stride
        square(60, 12, 16, 4), // blocks with gaps between them
        square(60, 30, 6, 6),  // too many sums for lanes: the exact path
        bins(12, false),
        bins(18, true),
        bins(1, false),
    ] {
        for channels in [1, 3] {
            let search = Search { win_stride: (8, 4), ..PADDED };
            compare(&of_geometry(params.clone()), (150, 140), channels, search, 7);
        }
    }
}

#[test]
fn a_weight_that_is_no_number_gives_no_hits_and_an_infinite_one_the_exact_paths() {
    let picture = Picture::new(90, 140, 1, 3);
    let search = Search { hit_threshold: ALL_WINDOWS, win_stride: (8, 8), padding: (0, 0) };
    for weight in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut detector = Detector::people();
        detector.coefficients[7] = weight;
        let places = |hits: Vec<Hit>| hits.iter().map(|hit| (hit.x, hit.y)).collect::<Vec<_>>();
        let mut wanted = detector.every_window(picture.view(), &search);
        wanted.retain(|hit| hit.weight >= ALL_WINDOWS);
        assert_eq!(wanted.is_empty(), weight != f32::INFINITY);
        let wanted = places(wanted);
        for backend in available() {
            let found =
                hog(&detector, backend).detect_windows(picture.view(), &search, None, &Interrupt::NEVER);
            assert_eq!(places(found.unwrap()), wanted, "{} {weight}", backend.name());
        }
    }
}

#[test]
fn a_gaussian_too_narrow_or_too_wide_for_single_precision_is_scored_alike() {
    for sigma in [1e-38, 1e-22, 2e-20, 1e-10, 1e-3, 1e18, 1e30] {
        let mut detector = Detector::people();
        detector.params.win_sigma = sigma;
        let search = Search { hit_threshold: 0.0, win_stride: (8, 8), padding: (0, 0) };
        compare(&detector, (80, 144), 1, search, 5);
    }
}

#[test]
fn a_threshold_that_is_no_number_has_no_hits_and_minus_infinity_has_all() {
    let picture = Picture::new(80, 136, 1, 3);
    for backend in available() {
        let hog = hog(&Detector::people(), backend);
        for (hit_threshold, count) in [(f64::NAN, 0), (f64::NEG_INFINITY, 6), (f64::INFINITY, 0)] {
            let search = Search { hit_threshold, win_stride: (8, 8), padding: (0, 0) };
            assert_eq!(
                hog.detect_windows(picture.view(), &search, None, &Interrupt::NEVER).unwrap().len(),
                count
            );
        }
    }
}
