//! Answers of OpenCV 4.14 to small cases, and formulas, for the stages around the sums.
#![allow(clippy::unwrap_used, reason = "a test may fail")]

mod common;

use common::{Detector, Gradient, PADDED, Picture, available};
use hog_core::exact::Svm;
use hog_core::group::{Candidate, group_rectangles, mean_shift};
use hog_core::{
    Backend, Grouping, Hog, HogParams, HogSpec, ImageView, Interrupt, Rect, SearchOptions, model,
};

fn rect([x, y, width, height]: [i32; 4]) -> Rect {
    Rect { x, y, width, height }
}

/// Asserts that both hold the same rectangles, with weights as near as single precision sums in any order are.
fn assert_found(found: &[(Rect, f64)], wanted: &[([i32; 4], f64)]) {
    let places: Vec<Rect> = found.iter().map(|&(rect, _)| rect).collect();
    assert_eq!(places, wanted.iter().map(|&(sides, _)| rect(sides)).collect::<Vec<_>>());
    for ((_, found), (_, wanted)) in found.iter().zip(wanted) {
        assert!((found - wanted).abs() < 5e-6, "{found} {wanted}");
    }
}

#[test]
fn a_search_finds_what_opencv_finds_grouped_by_similarity_and_by_mean_shift() {
    let picture = Picture::new(333, 251, 3, 5);
    let mut detector = Detector::people();
    detector.coefficients[3780] += 1.5;
    for backend in available() {
        let hog = Hog::with_backend(&detector.params, Some(&detector.coefficients), backend).unwrap();
        let search = |grouping| {
            hog.detect(
                picture.view(),
                &SearchOptions { search: PADDED, scale: 1.1, grouping, ..SearchOptions::default() },
                &Interrupt::NEVER,
            )
            .unwrap()
        };
        assert_eq!(search(Grouping::None).len(), 51);
        assert_found(
            &search(Grouping::Similar(1)),
            &[
                ([63, 5, 66, 133], 0.629536347463727),
                ([106, 20, 70, 141], 0.41176088782958686),
                ([41, 41, 69, 139], 0.3155983341857791),
                ([197, 46, 77, 154], 0.42446360643953085),
                ([70, 86, 66, 131], 0.584501288481988),
                ([237, 78, 70, 141], 0.24654260417446494),
                ([0, 0, 64, 135], 0.4416151044424623),
                ([0, 75, 66, 146], 0.6542718834243715),
                ([254, 102, 74, 148], 0.1377559748943895),
            ],
        );
        assert_eq!(search(Grouping::Similar(2)).len(), 8);
        assert_found(
            &search(Grouping::MeanShift(0.1)),
            &[
                ([56, 4, 67, 135], 0.2507573262503192),
                ([105, 17, 73, 147], 0.17439924091671313),
                ([197, 46, 65, 131], 0.1781707167876794),
                ([38, 37, 67, 134], 0.10957405133986917),
                ([65, 85, 65, 130], 0.16693811032844563),
                ([237, 78, 70, 140], 0.12933969614752025),
                ([39, 127, 64, 124], 0.10231489095748376),
                ([0, 0, 63, 134], 0.11902027983922878),
                ([0, 78, 68, 143], 0.21190517322626307),
                ([150, 79, 70, 140], 0.1031602056565866),
            ],
        );
    }
}

#[test]
fn rectangles_are_grouped_as_opencv_groups_them() {
    let mut state = 12345u32;
    let mut next = |below: u32| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        ((state >> 16) % below) as i32
    };
    let kinds =
        [[10, 20, 40, 80], [100, 30, 64, 128], [108, 60, 30, 60], [200, 10, 20, 40], [60, 90, 51, 103]];
    let mut rects = Vec::new();
    for _ in 0..60 {
        rects.push(rect(kinds[next(5) as usize].map(|side| side + next(9) - 4)));
    }
    let four =
        [([11, 18, 41, 82], 10), ([101, 32, 65, 127], 13), ([199, 9, 21, 40], 11), ([60, 91, 50, 102], 14)];
    let strict = [([101, 32, 65, 127], 13), ([58, 92, 50, 102], 10), ([13, 18, 44, 80], 4)];
    let five = [
        ([13, 19, 43, 81], 7),
        ([101, 32, 65, 127], 13),
        ([7, 18, 38, 83], 3),
        ([199, 7, 23, 39], 5),
        ([60, 91, 50, 102], 14),
    ];
    let expected: [(_, _, &[_]); 4] = [(1, 0.2, &four), (2, 0.2, &four), (3, 0.05, &strict), (2, 0.1, &five)];
    for (threshold, eps, wanted) in expected {
        let wanted: Vec<_> = wanted.iter().map(|&(sides, count)| (rect(sides), count)).collect();
        assert_eq!(
            group_rectangles(&rects, threshold, eps, &Interrupt::NEVER).unwrap(),
            wanted,
            "{threshold} {eps}"
        );
    }
}

#[test]
fn a_weak_group_inside_a_strong_one_is_dropped_as_opencv_drops_it() {
    let groups = [
        (5, rect([0, 0, 100, 100])),
        (2, rect([10, 10, 40, 40])),
        (3, rect([30, 30, 20, 20])),
        (3, rect([300, 0, 50, 50])),
    ];
    let rects: Vec<Rect> = groups.iter().flat_map(|&(count, rect)| vec![rect; count]).collect();
    let (outer, apart) = ((groups[0].1, 5), (groups[3].1, 3));
    for threshold in [1, 2] {
        assert_eq!(group_rectangles(&rects, threshold, 0.2, &Interrupt::NEVER).unwrap(), [outer, apart]);
    }
    for threshold in [3, 4] {
        assert_eq!(group_rectangles(&rects, threshold, 0.2, &Interrupt::NEVER).unwrap(), [outer]);
    }
}

#[test]
fn a_group_of_three_or_more_inside_another_is_dropped_where_that_one_is_stronger() {
    let (small, large) = (rect([30, 30, 20, 20]), rect([0, 0, 100, 100]));
    for (inner, outer, dropped) in
        [(2, 2, true), (2, 3, true), (3, 3, false), (3, 4, true), (4, 4, false), (4, 5, true), (5, 4, false)]
    {
        let rects = [vec![small; inner], vec![large; outer]].concat();
        let found = group_rectangles(&rects, 1, 0.2, &Interrupt::NEVER).unwrap();
        assert_eq!(found.iter().all(|&(rect, _)| rect == large), dropped, "{inner} in {outer}");
        assert_eq!(found.len(), if dropped { 1 } else { 2 });
    }
}

#[test]
fn a_hit_alone_is_a_mode_of_the_weight_that_its_bandwidths_give_it() {
    for scale in [1.0, 1.7, 2.9] {
        let candidate = Candidate { rect: rect([40, 30, 64, 128]), weight: 2.0, scale };
        // Bandwidths of 8 · scale and 16 · scale pixels and of ln 1.3 along the logarithm of the scale.
        let weight = 2.0 / (8.0 * scale + 16.0 * scale + 1.3_f64.ln()).sqrt();
        let found = mean_shift(&[candidate], weight - 1e-9, (64, 128), &Interrupt::NEVER).unwrap();
        let (width, height) = ((64.0 * scale) as i32, (128.0 * scale) as i32);
        let wanted = Rect { x: 72 - width / 2, y: 94 - height / 2, width, height };
        assert_eq!(found[0].0, wanted);
        assert!((found[0].1 - weight).abs() < 1e-12);
        assert!(
            mean_shift(&[candidate], found[0].1, (64, 128), &Interrupt::NEVER).unwrap().is_empty(),
            "more than the threshold is wanted"
        );
    }
}

#[test]
fn mean_shift_climbs_to_the_highest_place_of_the_density() {
    let hits = [(0, 0, 1.0), (5, 3, 2.0), (9, -4, 0.5), (60, 0, 1.0)];
    let candidate =
        |&(x, y, weight): &(i32, i32, f64)| Candidate { rect: rect([x, y, 64, 128]), weight, scale: 1.0 };
    let candidates: Vec<Candidate> = hits.iter().map(candidate).collect();
    let found = mean_shift(&candidates, 0.0, (64, 128), &Interrupt::NEVER).unwrap();
    let density = |x: f64, y: f64| {
        let of = |&(hx, hy, weight): &(i32, i32, f64)| {
            let squared = ((x - f64::from(hx)) / 8.0).powi(2) + ((y - f64::from(hy)) / 16.0).powi(2);
            weight * (-0.5 * squared).exp() / (24.0 + 1.3_f64.ln()).sqrt()
        };
        hits.iter().map(of).sum::<f64>()
    };
    let steps = || (-200..700).map(|i| f64::from(i) / 10.0);
    let best = |from: f64, to: f64| {
        let xs = steps().filter(move |x| (from..to).contains(x));
        let places = xs.flat_map(|x| steps().take(400).map(move |y| (x, y)));
        places.map(|(x, y)| (density(x, y), x, y)).max_by(|a, b| a.0.total_cmp(&b.0)).unwrap()
    };
    assert_eq!(found.len(), 2);
    for ((mode, weight), (most, x, y)) in found.iter().zip([best(-20.0, 30.0), best(30.0, 70.0)]) {
        assert!((weight - most).abs() < 1e-4, "{weight} {most}");
        assert!((f64::from(mode.x) - x).abs() <= 1.0 && (f64::from(mode.y) - y).abs() <= 1.0);
    }
}

#[test]
fn modes_less_than_a_bandwidth_apart_are_one() {
    // Two hits far enough apart to be modes of their own at scale 1; at scale 3 they are one.
    let at = |x, scale| Candidate { rect: rect([x, 0, 64, 128]), weight: 1.0, scale };
    for (scale, apart, modes) in [(1.0, 20, 2), (1.0, 12, 1), (3.0, 20, 1), (3.0, 60, 2)] {
        let found = mean_shift(&[at(0, scale), at(apart, scale)], 0.0, (64, 128), &Interrupt::NEVER).unwrap();
        assert_eq!(found.len(), modes, "{apart} pixels at scale {scale}");
    }
}

#[test]
fn equal_channels_tie_for_the_lowest_but_in_the_last_columns_for_the_highest() {
    // The first channel grows along x, the last along y, both by 5 a pixel: 7 columns are one vector and three more.
    let pixel = |i: usize| [5 * (i % 7) as u8, 0, 5 * (i / 7) as u8];
    let data: Vec<u8> = (0..7 * 6).flat_map(pixel).collect();
    let image = ImageView::new(&data, 7, 6, 3, 21).unwrap();
    let params = HogParams { gamma_correction: false, ..HogParams::default() };
    let found = Gradient::new(&Hog::new(&params, None).unwrap(), image, [0; 4]);
    assert_eq!(found.bins[14..21], [[4, 5], [8, 0], [8, 0], [8, 0], [4, 5], [4, 5], [4, 5]]);
    assert_eq!(found.shares[14], [10.0, 0.0]);
    assert_eq!(found.shares[15..18], [[5.0, 5.0]; 3]);
}

#[test]
fn the_gradient_is_that_of_central_differences_in_the_mirrored_image() {
    let (width, height) = (23, 11);
    let picture = Picture::new(width, height, 1, 5);
    let mirrored = |at: i64, len: i64| {
        (if at < 0 {
            -at
        } else if at >= len {
            2 * len - 2 - at
        } else {
            at
        }) as usize
    };
    let pixel = |x: i64, y: i64| {
        let (x, y) = (mirrored(x, width as i64), mirrored(y, height as i64));
        f32::from(picture.data[y * width + x])
    };
    for ([left, top, right, bottom], signed_gradient) in
        [([0; 4], false), ([3, 2, 5, 4], false), ([0; 4], true)]
    {
        let params = HogParams { gamma_correction: false, signed_gradient, ..HogParams::default() };
        let hog = Hog::new(&params, None).unwrap();
        let found = Gradient::new(&hog, picture.view(), [left, top, right, bottom]);
        let size = found.size;
        assert_eq!((size.width as i64, size.height as i64), (23 + left + right, 11 + top + bottom));
        for (at, (shares, bins)) in found.shares.iter().zip(&found.bins).enumerate() {
            let (x, y) = ((at % size.width) as i64 - left, (at / size.width) as i64 - top);
            // The image's own border is that of the padding: one mirrored pixel more.
            let (dx, dy) = (pixel(x + 1, y) - pixel(x - 1, y), pixel(x, y + 1) - pixel(x, y - 1));
            let magnitude = dx.hypot(dy);
            assert!((shares[0] + shares[1] - magnitude).abs() < 1e-3 * magnitude + 1e-3, "{x} {y}");
            // Nine bins, 20° wide or 40° where signs count; the share is the distance from the other bin's centre.
            let wide = if signed_gradient { 40.0 } else { 20.0 };
            let place = (dy.atan2(dx).to_degrees().rem_euclid(9.0 * wide) / wide - 0.5).rem_euclid(9.0);
            let from_first = (place - f32::from(bins[0])).rem_euclid(9.0);
            assert_eq!(bins[1], (bins[0] + 1) % 9);
            assert!(magnitude == 0.0 || (shares[1] / magnitude - from_first).abs() < 2e-3, "{x} {y}");
        }
    }
}

#[test]
fn the_gradient_is_the_same_on_every_backend() {
    let same = |params: &HogParams, (width, height): (usize, usize), channels: usize, borders: [i64; 4]| {
        let picture = Picture::new(width, height, channels, (width + height) as u32);
        let on = |backend| {
            let hog = Hog::with_backend(params, None, backend).unwrap();
            let found = Gradient::new(&hog, picture.view(), borders);
            let bits: Vec<_> = found.shares.iter().map(|shares| shares.map(f32::to_bits)).collect();
            (found.size, bits, found.bins)
        };
        let wanted = on(Backend::Scalar);
        for backend in available() {
            let what = format!("{} {params:?} {width} × {height} × {channels} {borders:?}", backend.name());
            assert!(on(backend) == wanted, "{what}");
        }
    };
    for channels in [1, 3] {
        let people = HogParams::default();
        for width in (1..70).chain([1023, 1024, 1025, 1034, 1039, 1040, 1049]) {
            same(&people, (width, 5), channels, [0; 4]);
        }
        for borders in [[3, 2, 5, 4], [-3, -2, -5, -4], [40, 9, 0, 0], [-30, 0, 60, 0]] {
            same(&people, (53, 21), channels, borders);
        }
        for (nbins, signed_gradient) in
            [(1, false), (2, true), (9, true), (18, true), (256, false), (256, true)]
        {
            let params = HogParams { nbins, signed_gradient, gamma_correction: false, ..people };
            same(&params, (77, 40), channels, [0; 4]);
        }
    }
}

/// The votes of columns `from` to `to` of an image whose columns are those of one pattern, `first` and on.
fn votes_of_columns(width: usize, first: usize, [from, to]: [usize; 2]) -> Vec<[f32; 2]> {
    let pixel = |i: usize| {
        let (x, y) = ((i % width).saturating_sub(first), i / width);
        (7 * x * x + 13 * y * y + 5 * x * y + (x * y * y) / 11) as u8
    };
    let data: Vec<u8> = (0..width * 900).map(pixel).collect();
    let image = ImageView::new(&data, width, 900, 1, width).unwrap();
    let hog = Hog::new(&HogParams::default(), None).unwrap();
    let found = Gradient::new(&hog, image, [0; 4]);
    found.shares.chunks_exact(width).flat_map(|row| row[from..to].to_vec()).collect()
}

#[test]
fn angles_of_sixteen_columns_are_rounded_as_those_of_more() {
    // OpenCV's vector code takes runs of 16 pixels and more; with fused multiply-add its scalar code rounds otherwise.
    assert_eq!(votes_of_columns(16, 0, [1, 15]), votes_of_columns(40, 0, [1, 15]));
}

#[test]
fn the_last_columns_of_a_row_longer_than_1024_are_rounded_as_a_row_of_their_own() {
    // A row is taken in runs of 1024.
    assert_eq!(votes_of_columns(1024 + 8, 1024, [1025, 1031]), votes_of_columns(8, 0, [1, 7]));
    assert_eq!(votes_of_columns(1024 + 16, 1024, [1025, 1039]), votes_of_columns(16, 0, [1, 15]));
}

#[test]
fn the_gaussian_is_an_eighth_of_the_block_sides_unless_one_is_given() {
    let sigma = |win_sigma, block_size| {
        HogParams { win_sigma, block_size, ..HogParams::default() }.effective_win_sigma()
    };
    assert_eq!([sigma(-1.0, (16, 16)), sigma(0.0, (24, 16)), sigma(-0.5, (8, 32))], [4.0, 5.0, 5.0]);
    assert_eq!([sigma(2.5, (16, 16)), sigma(1e-3, (16, 16))], [2.5, 1e-3]);
    let spec = HogSpec::new(&HogParams { block_size: (24, 16), win_size: (64, 128), ..HogParams::default() });
    assert_eq!(spec.unwrap().sigma, 5.0);
}

#[test]
fn one_level_is_enough_and_none_is_refused() {
    let of = |nlevels| HogSpec::new(&HogParams { nlevels, ..HogParams::default() });
    assert_eq!(of(1).unwrap().nlevels, 1);
    assert!(of(0).is_err() && of(-1).is_err());
}

#[test]
fn cells_of_one_pixel_are_served_and_sides_of_none_refused() {
    let of = |side: (i64, i64)| {
        let sizes =
            HogParams { win_size: (8, 8), block_size: side, block_stride: side, ..HogParams::default() };
        HogSpec::new(&HogParams { cell_size: side, ..sizes })
    };
    assert_eq!(of((1, 1)).unwrap().descriptor_len(), 8 * 8 * 9);
    assert!(of((0, 1)).is_err() && of((1, 0)).is_err());
}

#[test]
fn the_score_counts_every_element_of_blocks_whose_length_is_no_multiple_of_four() {
    for nbins in [1, 2, 3, 5, 7, 9] {
        let params = HogParams { win_size: (16, 8), block_size: (8, 8), nbins, ..HogParams::default() };
        let spec = HogSpec::new(&params).unwrap();
        let len = spec.descriptor_len();
        assert_eq!(len, 2 * nbins as usize);
        let weights: Vec<f32> = (0..=len).map(|i| 1.0 + i as f32).collect();
        let values: Vec<f32> = (0..len).map(|i| 0.5 + 3.0 * i as f32).collect();
        let wanted: f32 = weights.iter().zip(&values).map(|(w, v)| w * v).sum::<f32>() + weights[len];
        let score = Svm::new(&weights, &spec).unwrap().score(values.chunks_exact(spec.block_len));
        assert_eq!(score, f64::from(wanted));
    }
}

#[test]
fn the_models_fit_their_geometries() {
    assert_eq!(Detector::people().spec().descriptor_len() + 1, model::default_people().len());
    assert_eq!(Detector::daimler().spec().descriptor_len() + 1, model::daimler_people().len());
}
