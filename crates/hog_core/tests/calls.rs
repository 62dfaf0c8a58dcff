//! Crops, chosen places and lengths: each against the exact path or a formula.
#![allow(clippy::unwrap_used, reason = "a test may fail")]

mod common;

use std::cell::Cell;

use common::{Detector, Picture, STEPS, assert_same, available, reached_by};
use hog_core::exact::{RowVotes, Svm, Tables, scores};
use hog_core::group::{Candidate, group_candidates, group_rectangles, mean_shift};
use hog_core::pyramid::{Tap, resize, taps};
use hog_core::{Hog, HogParams, ImageView, Interrupt, Rect, Search, SearchOptions, Size};

/// The descriptor of one crop by the exact path.
fn descriptor(hog: &Hog, crop: &[u8], channels: usize) -> Vec<f32> {
    let Size { width, height } = hog.spec().win;
    let view = ImageView::new(crop, width, height, channels, width * channels).unwrap();
    let mut out = vec![0.0; hog.spec().descriptor_len()];
    hog.compute(view, &STEPS, Some(&[(0, 0)]), &Interrupt::NEVER, &mut out).unwrap();
    out
}

#[test]
fn crops_are_described_as_the_exact_path_describes_each() {
    let sizes = [(64, 128), (16, 16), (24, 40), (48, 96), (136, 24), (40, 16)];
    let plain =
        HogParams { win_size: (24, 36), block_size: (12, 12), block_stride: (6, 6), ..HogParams::default() };
    let other = HogParams { cell_size: (6, 6), ..plain };
    let cell = (8, 8);
    let one =
        HogParams { win_size: cell, block_size: cell, block_stride: cell, nbins: 1, ..HogParams::default() };
    let geometries = sizes.map(|win_size| HogParams { win_size, ..HogParams::default() });
    for params in geometries.iter().chain([&other, &one]) {
        for backend in available() {
            let hog = Hog::with_backend(params, None, backend).unwrap();
            let (win, elements) = (hog.spec().win, hog.spec().descriptor_len());
            // Many crops first: what they leave in the scratch memory must not show in the few that follow.
            for (count, channels, threads) in
                [(37, 3, 2), (1, 1, 1), (5, 3, 1), (2, 1, 1), (16, 1, 2), (1, 3, 1)]
            {
                let picture = Picture::new(win.width, win.height * count, channels, count as u32);
                let mut found = vec![-1.0; count * elements];
                hog.describe(&picture.data, channels, threads, &Interrupt::NEVER, &mut found).unwrap();
                let crops = picture.data.chunks_exact(win.area() * channels);
                let wanted: Vec<f32> = crops.flat_map(|crop| descriptor(&hog, crop, channels)).collect();
                let off = found.iter().zip(&wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                assert!(off <= 1e-6, "{} {win:?} {count}x{channels}: off by {off:e}", backend.name());
            }
        }
    }
}

#[test]
fn a_block_of_many_cells_or_bins_has_nearly_unit_length() {
    for (block, cell, nbins) in [(40, 8, 9), (24, 8, 70), (24, 8, 9), (16, 8, 70), (64, 8, 130), (32, 8, 9)] {
        let side = (block, block);
        let params = HogParams {
            block_size: side,
            block_stride: (cell, cell),
            cell_size: (cell, cell),
            ..HogParams::default()
        };
        let hog = Hog::new(&HogParams { win_size: side, nbins, ..params }, None).unwrap();
        let picture = Picture::new(block as usize, block as usize, 1, 7);
        let found = descriptor(&hog, &picture.data, 1);
        let length = found.iter().map(|element| element * element).sum::<f32>().sqrt();
        assert!((0.9..=1.001).contains(&length), "{block} {nbins}: {length}");
    }
}

#[test]
fn crops_that_do_not_fit_their_answer_are_refused() {
    let params = HogParams { win_size: (16, 16), ..HogParams::default() };
    let hog = Hog::new(&params, None).unwrap();
    let elements = hog.spec().descriptor_len();
    let refused = |bytes: usize, channels: usize, room: usize| {
        hog.describe(&vec![0; bytes], channels, 1, &Interrupt::NEVER, &mut vec![0.0; room]).is_err()
    };
    assert!(!refused(3 * 256, 1, 3 * elements));
    assert!(!refused(3 * 256, 3, elements));
    assert!(refused(3 * 256, 1, 2 * elements));
    assert!(refused(3 * 256, 1, 4 * elements));
    assert!(refused(3 * 256 + 1, 1, 3 * elements));
    for channels in [0, 2, 4] {
        assert!(refused(12 * 256, channels, 3 * elements));
    }
}

#[test]
fn the_length_of_descriptors_is_windows_times_elements() {
    let hog = Hog::new(&HogParams::default(), None).unwrap();
    let picture = Picture::new(80, 152, 1, 1);
    let len = |search: &Search, places| hog.compute_len(picture.view(), search, places).unwrap();
    assert_eq!(len(&STEPS, None), 3 * 4 * 3780);
    assert_eq!(len(&Search { padding: (8, 16), ..STEPS }, None), 5 * 8 * 3780);
    assert_eq!(len(&STEPS, Some(&[(0, 0), (500, 0)])), 2 * 3780);
    assert_eq!(len(&STEPS, Some(&[])), 0);
    // The largest number of elements that OpenCV's lists hold is 2³¹ − 1.
    assert_eq!(len(&STEPS, Some(&vec![(0, 0); 568_117])), 568_117 * 3780);
    assert!(hog.compute_len(picture.view(), &STEPS, Some(&vec![(0, 0); 568_118])).is_err());
}

#[test]
fn all_descriptors_are_those_of_each_place() {
    for params in [HogParams::default(), HogParams { win_size: (32, 48), nbins: 7, ..HogParams::default() }] {
        let hog = Hog::new(&params, None).unwrap();
        let picture = Picture::new(101, 163, 3, 9);
        let search = Search { win_stride: (8, 16), padding: (8, 8), ..STEPS };
        let columns = (101 + 16 - hog.spec().win.width) / 8 + 1;
        let rows = (163 + 16 - hog.spec().win.height) / 16 + 1;
        let places: Vec<(i64, i64)> = (0..rows as i64)
            .flat_map(|y| (0..columns as i64).map(move |x| (8 * x - 8, 16 * y - 8)))
            .collect();
        let compute = |places: Option<&[(i64, i64)]>| {
            let mut out = vec![-1.0; hog.compute_len(picture.view(), &search, places).unwrap()];
            hog.compute(picture.view(), &search, places, &Interrupt::NEVER, &mut out).unwrap();
            out
        };
        assert!(compute(None) == compute(Some(&places)));
        // The same in any order, and nothing where the window leaves the image.
        let (first, last) = (places[0], places[places.len() - 1]);
        let found = compute(Some(&[last, (-9, 0), first, (0, 1_000_000)]));
        let parts: Vec<&[f32]> = found.chunks_exact(hog.spec().descriptor_len()).collect();
        assert!(parts[0] == compute(Some(&[last])));
        assert!(parts[2] == compute(Some(&[first])));
        assert!(parts[1].iter().chain(parts[3]).all(|&element| element == 0.0));
    }
}

#[test]
fn places_of_ones_own_are_decided_as_all_windows_are() {
    let (detector, picture) = (Detector::people(), Picture::new(150, 190, 3, 2));
    let windows = detector.every_window(picture.view(), &STEPS);
    let mut places: Vec<(i64, i64)> = windows.iter().rev().map(|hit| (hit.x, hit.y)).collect();
    places.push((1_000, 0));
    let hog = Hog::new(&detector.params, Some(&detector.coefficients)).unwrap();
    for share in [0.0, 0.3, 1.0] {
        let hit_threshold = reached_by(&windows, share);
        let search = Search { hit_threshold, ..STEPS };
        let found = hog.detect_windows(picture.view(), &search, Some(&places), &Interrupt::NEVER).unwrap();
        let hits: Vec<_> = windows.iter().rev().copied().filter(|hit| hit.weight >= hit_threshold).collect();
        assert_same(&found, &hits, 0.0, "places");
    }
}

#[test]
fn padding_wider_than_the_image_is_mirrored_as_the_exact_path_mirrors_it() {
    let detector = Detector::people();
    for (size, padding) in
        [((64, 70), (192, 32)), ((40, 90), (256, 40)), ((90, 33), (16, 160)), ((3, 5), (104, 136))]
    {
        for channels in [1, 3] {
            let picture = Picture::new(size.0, size.1, channels, 3);
            let search = Search { hit_threshold: -1e9, padding, ..STEPS };
            let wanted = detector.every_window(picture.view(), &search);
            assert!(wanted.len() > 10);
            for backend in available() {
                let hog = Hog::with_backend(&detector.params, Some(&detector.coefficients), backend).unwrap();
                let found = hog.detect_windows(picture.view(), &search, None, &Interrupt::NEVER).unwrap();
                let what = format!("{} {size:?}x{channels} {padding:?}", backend.name());
                assert_same(&found, &wanted, detector.rounding(), &what);
            }
        }
    }
}

#[test]
fn rows_of_very_many_windows_and_every_distance_between_windows_are_served() {
    let mut loud = Detector::people();
    loud.coefficients[11] = 1e7;
    let people = Detector::people();
    // 280 windows abreast; distances that are multiples of 4, of 8 or of neither's double.
    for (detector, size, win_stride) in [
        (&people, (2_296, 129), (8, 8)),
        (&people, (300, 300), (36, 44)),
        (&people, (300, 300), (12, 72)),
        (&people, (300, 300), (20, 28)),
        (&loud, (90, 140), (8, 8)),
    ] {
        let picture = Picture::new(size.0, size.1, 1, 5);
        let search = Search { hit_threshold: -1e9, win_stride, ..STEPS };
        let wanted = detector.every_window(picture.view(), &search);
        assert!(wanted.len() > 7);
        for backend in available() {
            let hog = Hog::with_backend(&detector.params, Some(&detector.coefficients), backend).unwrap();
            let found = hog.detect_windows(picture.view(), &search, None, &Interrupt::NEVER).unwrap();
            let what = format!("{} {size:?} {win_stride:?}", backend.name());
            assert_same(&found, &wanted, detector.rounding(), &what);
        }
    }
}

#[test]
fn a_search_at_a_size_that_no_image_can_have_is_refused() {
    let (detector, picture) = (Detector::people(), Picture::new(64, 128, 1, 1));
    let hog = Hog::new(&detector.params, Some(&detector.coefficients)).unwrap();
    let at = |first: Size| {
        let options =
            SearchOptions { search: STEPS, searched_size: Some(first), scale: 1e9, ..Default::default() };
        hog.detect(picture.view(), &options, &Interrupt::NEVER)
    };
    for (width, height) in [(1 << 29, 128), (64, 1 << 29), (1 << 40, 1 << 40), (0, 128), (64, 0)] {
        let error = at(Size::new(width, height)).unwrap_err().to_string();
        assert!(error.contains(&format!("{width}")) && error.contains(&format!("{height}")), "{error}");
    }
    assert!(at(Size::new(64, 128)).is_ok());
}

#[test]
fn a_caller_who_wants_no_answer_any_more_gets_none() {
    let (detector, picture) = (Detector::people(), Picture::new(150, 190, 3, 2));
    let hog = Hog::new(&detector.params, Some(&detector.coefficients)).unwrap();
    let interrupt = Interrupt::when(&|| true);
    let rects = [Rect { x: 1, y: 1, width: 9, height: 9 }; 5];
    assert!(group_rectangles(&rects, 1, 0.2, &interrupt).is_err());
    let candidates = rects.map(|rect| Candidate { rect, weight: 1.0, scale: 1.0 });
    assert!(group_candidates(&candidates, 2, &interrupt).is_err());
    assert!(mean_shift(&candidates, 0.0, (64, 128), &interrupt).is_err());
    assert!(hog.detect_windows(picture.view(), &STEPS, None, &interrupt).is_err());
    assert!(hog.detect_windows(picture.view(), &STEPS, Some(&[(0, 0)]), &interrupt).is_err());
    let (mut shares, mut bins) = (vec![[0.0; 2]; 150 * 190], vec![[0; 2]; 150 * 190]);
    let votes = RowVotes { shares: &mut shares, bins: &mut bins };
    assert!(hog.gradient(picture.view(), [0; 4], &interrupt, votes).is_err());
    let mut out = vec![0.0; hog.compute_len(picture.view(), &STEPS, None).unwrap()];
    assert!(hog.compute(picture.view(), &STEPS, None, &interrupt, &mut out).is_err());
    assert!(hog.compute(picture.view(), &STEPS, Some(&[(0, 0)]), &interrupt, &mut out).is_err());
    assert!(hog.describe(&[0; 64 * 128], 1, 1, &interrupt, &mut out[..3780]).is_err());
}

/// How often a call asks whether its answer is still wanted.
fn asked(call: &dyn Fn(&Interrupt)) -> usize {
    let times = Cell::new(0);
    let ask = || {
        times.set(times.get() + 1);
        false
    };
    call(&Interrupt::when(&ask));
    times.get()
}

#[test]
fn grouping_asks_its_caller_again_for_every_group() {
    let [one, five] = [1, 5].map(|groups| {
        let rect = |i: i32| Rect { x: 500 * (i % groups), y: 0, width: 64, height: 128 };
        let rects: Vec<Rect> = (0..10).map(rect).collect();
        asked(&|interrupt| {
            assert_eq!(group_rectangles(&rects, 1, 0.2, interrupt).unwrap().len(), groups as usize);
        })
    });
    assert_eq!(five - one, 5 - 1);
}

#[test]
fn crops_that_are_described_at_once_are_asked_for_one_by_one_or_few_abreast() {
    let hog = Hog::new(&HogParams::default(), None).unwrap();
    let [one, sixteen] = [1, 16].map(|crops| {
        asked(&|interrupt| {
            let mut found = vec![0.0; crops * 3780];
            hog.describe(&vec![0; crops * 64 * 128], 1, 1, interrupt, &mut found).unwrap();
        })
    });
    // A vector holds two crops at most.
    assert!(sixteen >= one + 7, "{one} {sixteen}");
}

#[test]
fn the_exact_path_asks_its_caller_again_for_every_row_of_windows() {
    let (detector, picture) = (Detector::people(), Picture::new(64, 128 + 64, 1, 2));
    let spec = detector.spec();
    let tables = Tables::new(&spec).unwrap();
    let svm = Svm::new(&detector.coefficients, &spec).unwrap();
    // The gradient is the same; the windows are nine rows of one, then two.
    let [nine, two] = [8, 64].map(|stride| {
        let grid = detector.grid(picture.view(), &Search { win_stride: (stride, stride), ..STEPS });
        asked(&|interrupt| {
            scores(picture.view(), &grid, &spec, &tables, &svm, interrupt).unwrap();
        })
    });
    assert_eq!(nine - two, 9 - 2);
}

#[test]
fn taps_are_those_of_the_formula() {
    assert!(taps(1, 3, 0..3).eq([Tap { first: 0, second: 0, weight: 0 }; 3]));
    let tap = |first, second, weight| Tap { first, second, weight };
    // Centres of the halves: a quarter from each pixel's.
    let twice = [tap(0, 0, 0), tap(0, 1, 64), tap(0, 1, 192), tap(1, 2, 64), tap(1, 2, 192), tap(2, 2, 0)];
    assert!(taps(3, 6, 0..6).eq(twice));
    assert!(taps(4, 2, 0..2).eq([tap(0, 1, 128), tap(2, 3, 128)]));
    assert!(taps(6, 2, 0..2).eq([tap(1, 2, 0), tap(4, 5, 0)]));
    assert!(taps(6, 2, 1..2).eq([tap(4, 5, 0)]));
    assert!(taps(5, 5, 0..5).eq((0..5).map(|i| if i < 4 { tap(i, i + 1, 0) } else { tap(4, 4, 0) })));
}

#[test]
fn enlarged_and_shrunk_images_are_those_of_the_taps_in_each_channel() {
    for (from, to, channels) in
        [((1, 1), (4, 3), 1), ((7, 5), (3, 9), 3), ((13, 11), (13, 7), 3), ((2, 9), (1, 1), 1)]
    {
        let picture = Picture::new(from.0, from.1, channels, 4);
        let found = resize(picture.view(), Size::new(to.0, to.1)).unwrap();
        let at = |x: usize, y: usize, c: usize| u32::from(picture.data[(y * from.0 + x) * channels + c]);
        for (y, down) in taps(from.1, to.1, 0..to.1).enumerate() {
            for (x, across) in taps(from.0, to.0, 0..to.0).enumerate() {
                for c in 0..channels {
                    let row = |y| {
                        at(across.first, y, c) * (256 - across.weight)
                            + at(across.second, y, c) * across.weight
                    };
                    let wanted = row(down.first) * (256 - down.weight) + row(down.second) * down.weight;
                    assert_eq!(u32::from(found[(y * to.0 + x) * channels + c]), (wanted + (1 << 15)) >> 16);
                }
            }
        }
    }
    assert!(resize(Picture::new(3, 3, 1, 0).view(), Size::new(0, 2)).is_err());
    assert!(resize(Picture::new(3, 3, 1, 0).view(), Size::new(2, 0)).is_err());
}
