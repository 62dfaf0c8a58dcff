//! The guided search finds nothing that all windows do not hold, and misses nothing where it looks everywhere.
#![allow(clippy::unwrap_used, reason = "a test may fail")]

mod common;

use common::{Detector, Picture, STEPS};
use hog_core::{Grouping, Guide, Hog, Interrupt, Rect, Search, SearchOptions};

fn guide(halvings: u32, margin: f64, reach: f64) -> Option<Guide> {
    Some(Guide { halvings, margin, reach: (reach, reach) })
}

fn guided(detector: &Detector, picture: &Picture, guide: Option<Guide>, threshold: f64) -> Vec<(Rect, f64)> {
    guided_by(detector, picture, guide, &Search { hit_threshold: threshold, ..STEPS })
}

fn guided_by(
    detector: &Detector,
    picture: &Picture,
    guide: Option<Guide>,
    search: &Search,
) -> Vec<(Rect, f64)> {
    let hog = Hog::new(&detector.params, Some(&detector.coefficients)).unwrap();
    let options =
        SearchOptions { search: *search, scale: 1.1, grouping: Grouping::None, guide, ..Default::default() };
    hog.detect(picture.view(), &options, &Interrupt::NEVER).unwrap()
}

#[test]
fn a_guided_search_finds_nothing_new_and_misses_nothing_where_it_looks_everywhere() {
    let (detector, picture) = (Detector::people(), Picture::new(400, 420, 3, 6));
    let all = guided(&detector, &picture, None, -1.2);
    assert!(all.len() > 20);
    let everywhere = [(0, 0.0, 0.0), (1, 1e9, 0.0), (1, 1e9, 50.0), (2, 1e9, 50.0), (99, 1e9, f64::INFINITY)];
    for (halvings, margin, reach) in everywhere {
        let found = guided(&detector, &picture, guide(halvings, margin, reach), -1.2);
        assert_eq!(found, all, "{halvings} {margin} {reach}");
    }
    for (halvings, margin, reach) in [(1, 0.0, 0.0), (1, 0.3, 1.0), (2, 0.0, 2.0), (3, 0.5, 3.0)] {
        let found = guided(&detector, &picture, guide(halvings, margin, reach), -1.2);
        assert!(found.iter().all(|hit| all.contains(hit)), "{halvings} {margin} {reach}");
        assert!(2 * found.len() > all.len(), "{} of {}", found.len(), all.len());
    }
    // The levels between are searched around what was found on the others alone: where that is nothing, nowhere.
    let nowhere = guided(&detector, &picture, guide(1, -1e9, 50.0), -1.2);
    let whole: Vec<_> = (0..20).step_by(2).map(|level| (64.0 * 1.1f64.powi(level)).round() as i32).collect();
    let wanted: Vec<_> = all.into_iter().filter(|(rect, _)| whole.contains(&rect.width)).collect();
    assert!(wanted.len() > 5);
    assert_eq!(nowhere, wanted);
}

#[test]
fn a_guided_search_in_wide_padding_finds_nothing_new() {
    let (detector, picture) = (Detector::people(), Picture::new(330, 200, 3, 8));
    for padding in [(256, 40), (320, 16), (32, 160)] {
        let search = Search { hit_threshold: -1.4, padding, ..STEPS };
        let all = guided_by(&detector, &picture, None, &search);
        // (Rectangles are cut to the image, so that a weight tells which window is meant.)
        assert!(all.len() > 20);
        for (halvings, margin, reach) in [(1, 0.0, 0.0), (1, 0.1, 1.0), (2, 0.3, 0.0)] {
            let found = guided_by(&detector, &picture, guide(halvings, margin, reach), &search);
            assert!(found.iter().all(|hit| all.contains(hit)), "{padding:?} {halvings} {margin} {reach}");
            assert!(4 * found.len() > all.len(), "{} of {}", found.len(), all.len());
        }
    }
}

#[test]
fn a_guided_search_at_either_edge_of_a_wide_image_finds_nothing_new() {
    let detector = Detector::people();
    for left in [true, false] {
        // Flat but for the columns at one edge: nothing is found elsewhere.
        let mut picture = Picture::new(1200, 200, 1, 8);
        for (at, pixel) in picture.data.iter_mut().enumerate() {
            let x = at % 1200;
            if (if left { x } else { 1199 - x }) >= 40 {
                *pixel = 128;
            }
        }
        for padding in [(48, 16), (96, 0)] {
            let search = Search { hit_threshold: -3.0, padding, ..STEPS };
            let all = guided_by(&detector, &picture, None, &search);
            assert!(all.len() > 5, "{}", all.len());
            let found = guided_by(&detector, &picture, guide(1, 0.1, 1.0), &search);
            // (Sums are in another order where a vector is not full.)
            let is_one = |hit: &(Rect, f64)| {
                all.iter().any(|other| other.0 == hit.0 && (other.1 - hit.1).abs() <= detector.rounding())
            };
            assert!(found.iter().all(is_one), "{left} {padding:?}");
            assert!(2 * found.len() > all.len(), "{} of {}", found.len(), all.len());
        }
    }
}
