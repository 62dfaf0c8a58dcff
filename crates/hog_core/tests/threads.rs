//! One detector that many threads search and describe with, each with helpers of its own: for ThreadSanitizer, see `.ci/hardening`.
#![allow(clippy::unwrap_used, reason = "a test may fail")]

mod common;

use common::{Detector, Picture};
use hog_core::{Grouping, Hog, Interrupt, Search, SearchOptions};

const SEARCH: Search = Search { hit_threshold: -3.0, win_stride: (8, 8), padding: (8, 8) };

#[test]
fn threads_that_share_a_detector_find_what_one_alone_finds() {
    let detector = Detector::people();
    let hog = Hog::new(&detector.params, Some(&detector.coefficients)).unwrap();
    let pictures: Vec<Picture> = (0..4).map(|i| Picture::new(120 + 9 * i, 170, 1 + 2 * (i % 2), 7)).collect();
    let find = |picture: &Picture, threads: usize| {
        hog.detect(
            picture.view(),
            &SearchOptions {
                search: SEARCH,
                scale: 1.1,
                grouping: Grouping::None,
                threads,
                ..SearchOptions::default()
            },
            &Interrupt::NEVER,
        )
        .unwrap()
    };
    let wanted: Vec<_> = pictures.iter().map(|picture| find(picture, 1)).collect();
    assert!(wanted.iter().all(|found| !found.is_empty()));
    std::thread::scope(|scope| {
        for start in 0..4 {
            let (find, pictures, wanted) = (&find, &pictures, &wanted);
            scope.spawn(move || {
                for round in 0..6 {
                    let i = (start + round) % pictures.len();
                    assert_eq!(find(&pictures[i], 1 + round % 3), wanted[i]);
                }
            });
        }
    });
}

#[test]
fn threads_that_lend_their_crops_to_the_same_helpers_get_the_descriptors_of_each() {
    let hog = Hog::new(&Detector::people().params, None).unwrap();
    let describe = |crops: &[u8], threads: usize| {
        let mut found = vec![0.0; 20 * hog.spec().descriptor_len()];
        hog.describe(crops, 1, threads, &Interrupt::NEVER, &mut found).unwrap();
        found
    };
    std::thread::scope(|scope| {
        for seed in 0..4u32 {
            let describe = &describe;
            scope.spawn(move || {
                let crops: Vec<u8> = (0..20 * 64 * 128).map(|i| ((i * (i / 71 + seed)) >> 5) as u8).collect();
                let wanted = describe(&crops, 1);
                for threads in [2, 3, 2, 4] {
                    assert_eq!(describe(&crops, threads), wanted);
                }
            });
        }
    });
}
