//! Rectangles of any kind: groups must hold together what similar pairs connect, and nothing may overflow or hang.
#![no_main]

use arbitrary::Arbitrary;
use hog_core::group::{Candidate, clip, group_candidates, group_rectangles, mean_shift};
use hog_core::{Interrupt, Rect};
use libfuzzer_sys::fuzz_target;

#[derive(Arbitrary, Debug)]
struct Case {
    rects: Vec<(i32, i32, i32, i32)>,
    /// How many bits of each coordinate are kept: small coordinates meet.
    bits: u8,
    weights: Vec<f64>,
    threshold: i32,
    eps: f64,
    modes: f64,
}

const MOST: usize = 24;

fuzz_target!(|case: Case| {
    let small = |value: i32| if case.bits % 4 == 0 { value } else { value % (1 << (3 * (case.bits % 4))) };
    let rect = |&(x, y, width, height): &(i32, i32, i32, i32)| Rect {
        x: small(x),
        y: small(y),
        width: small(width),
        height: small(height),
    };
    let rects: Vec<Rect> = case.rects.iter().take(MOST).map(rect).collect();
    let threshold = if case.threshold > 100 { case.threshold } else { case.threshold % 5 };
    let groups = group_rectangles(&rects, threshold, case.eps, &Interrupt::NEVER).expect("it fits the memory");
    let members: i64 = groups.iter().map(|&(_, count)| i64::from(count)).sum();
    assert!(members <= rects.len() as i64);
    if threshold <= 0 {
        assert_eq!(groups.len(), rects.len());
    } else {
        assert!(groups.iter().all(|&(_, count)| count > threshold));
    }
    let weight = |i: usize| case.weights.get(i % case.weights.len().max(1)).copied().unwrap_or(1.0);
    let candidates: Vec<Candidate> = rects
        .iter()
        .enumerate()
        .map(|(i, &rect)| Candidate { rect, weight: weight(i), scale: 1.0 + (i % 7) as f64 * 0.3 })
        .collect();
    let found = group_candidates(&candidates, threshold, &Interrupt::NEVER).expect("it fits the memory");
    for (_, weight) in &found {
        let same = |c: &Candidate| c.weight.to_bits() == weight.to_bits();
        assert!(weight.is_nan() || *weight == f64::NEG_INFINITY || candidates.iter().any(same));
    }
    for (rect, _) in clip(found, 640, 480) {
        let inside = |at: i32, length: i32, side: i32| length > 0 && at >= 0 && at <= side - length;
        assert!(rect.width <= 0 || rect.height <= 0 || inside(rect.x, rect.width, 640));
        assert!(rect.width <= 0 || rect.height <= 0 || inside(rect.y, rect.height, 480));
    }
    let few = &candidates[..candidates.len().min(6)];
    if few.iter().all(|c| c.weight.abs() < 1e3 && c.rect.x.unsigned_abs() < 10_000 && c.rect.y.unsigned_abs() < 10_000) {
        let modes = mean_shift(few, case.modes, (64, 128), &Interrupt::NEVER).expect("it fits the memory");
        assert!(modes.len() <= few.len());
        assert!(modes.iter().all(|&(_, weight)| weight > case.modes));
    }
});
