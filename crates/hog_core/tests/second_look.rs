//! The second look on every backend, against plain loops in double precision.
#![allow(clippy::unwrap_used, reason = "a test may fail")]

mod common;

use std::cell::Cell;

use common::{Picture, available};
use hog_core::error::{NetworkError, ParameterError};
use hog_core::image::reflect_101;
use hog_core::{Answer, Backend, HogError, Interrupt, SecondLook, Window};

/// Channels, which no vector and no block of the kernels divides.
const CHANNELS: [usize; 3] = [5, 9, 7];
const HIDDEN: usize = 6;

/// Input channels, side of the kernel (the whole input: 0) and outputs of each layer.
fn shapes() -> [(usize, usize, usize); 5] {
    let [first, second, third] = CHANNELS;
    [(1, 5, first), (first, 3, second), (second, 3, third), (32 * third, 0, HIDDEN), (HIDDEN, 0, 5)]
}

fn weights() -> Vec<f32> {
    let count =
        shapes().iter().map(|&(inputs, side, outputs)| (inputs * (side * side).max(1) + 1) * outputs).sum();
    let wave = |i: usize| ((i as f32 * 0.7).sin() + (i as f32 * 0.013).cos()) / 8.0;
    (0..count).map(wave).collect()
}

/// The share of pixel `at` that lies in `from..to`.
fn share(at: i64, from: f64, to: f64) -> f64 {
    (to.min(at as f64 + 1.0) - from.max(at as f64)).max(0.0)
}

/// A window as the network is to see it: the mean over each of its 32 × 64 parts, then less the mean, over deviation + 8.
fn crop(picture: &Picture, [x, y, width, height]: Window) -> Vec<f64> {
    let (step_x, step_y) = (width / 32.0, height / 64.0);
    let mut parts = Vec::new();
    for (row, column) in
        (0..64).flat_map(|row| (0..32).map(move |column| (f64::from(row), f64::from(column))))
    {
        let (left, top) = (x + column * step_x, y + row * step_y);
        let mut sum = 0.0;
        for at_y in top.floor() as i64..=(top + step_y).ceil() as i64 {
            for at_x in left.floor() as i64..=(left + step_x).ceil() as i64 {
                let weight = share(at_x, left, left + step_x) * share(at_y, top, top + step_y);
                let (px, py) = (reflect_101(at_x, picture.width), reflect_101(at_y, picture.height));
                let pixel = &picture.data[(py * picture.width + px) * picture.channels..][..picture.channels];
                sum += weight * pixel.iter().map(|&byte| f64::from(byte)).sum::<f64>();
            }
        }
        parts.push(sum / (step_x * step_y * picture.channels as f64));
    }
    let mean = parts.iter().sum::<f64>() / 2048.0;
    let deviation = (parts.iter().map(|part| (part - mean).powi(2)).sum::<f64>() / 2048.0).sqrt();
    parts.iter().map(|part| (part - mean) / (deviation + 8.0)).collect()
}

/// The network's answer to `numbers`, 64 rows of 32.
fn answer(mut numbers: Vec<f64>, weights: &[f32]) -> Vec<f64> {
    let mut rest: Vec<f64> = weights.iter().map(|&weight| f64::from(weight)).collect();
    let (mut width, mut height) = (32, 64);
    for (index, (inputs, side, outputs)) in shapes().into_iter().enumerate() {
        let kernel: Vec<_> = rest.drain(..inputs * (side * side).max(1) * outputs).collect();
        let bias: Vec<_> = rest.drain(..outputs).collect();
        let mut out = Vec::new();
        let (to_width, to_height) = if side == 0 { (1, 1) } else { (width / 2, height / 2) };
        for (y, x, output) in (0..to_height)
            .flat_map(|y| (0..to_width).map(move |x| (y, x)))
            .flat_map(|(y, x)| (0..outputs).map(move |o| (y, x, o)))
        {
            let mut sum = bias[output];
            if side == 0 {
                sum += (0..inputs).map(|i| numbers[i] * kernel[i * outputs + output]).sum::<f64>();
            }
            for (dy, dx) in (0..side).flat_map(|dy| (0..side).map(move |dx| (dy, dx))) {
                let (from_y, from_x) =
                    ((2 * y + dy).wrapping_sub(side / 2), (2 * x + dx).wrapping_sub(side / 2));
                if from_y < height && from_x < width {
                    let pixel = &numbers[(from_y * width + from_x) * inputs..][..inputs];
                    let kernel = &kernel[(dy * side + dx) * inputs * outputs..];
                    sum += (0..inputs).map(|i| pixel[i] * kernel[i * outputs + output]).sum::<f64>();
                }
            }
            out.push(if index == 4 { sum } else { sum.max(0.0) });
        }
        (numbers, width, height) = (out, to_width, to_height);
    }
    numbers
}

/// Windows inside, beyond each edge, larger than the picture, and smaller than the network's input.
fn windows() -> Vec<Window> {
    let mut windows = vec![[0.0, 0.0, 64.0, 128.0], [-9.3, -17.5, 50.1, 100.2], [70.7, 60.1, 60.0, 120.0]];
    windows.extend([[3.0, 5.0, 20.5, 41.0], [-200.0, -300.0, 500.0, 1000.0], [10.0, 2.0, 0.3, 0.6]]);
    windows.extend((0..31).map(|i| [f64::from(i) * 1.7, f64::from(i), 41.0 + f64::from(i), 82.0]));
    windows
}

fn looked(look: &SecondLook, picture: &Picture, windows: &[Window], threads: usize) -> Vec<Answer> {
    let mut out = vec![[f32::NAN; 5]; windows.len()];
    look.answers(picture.view(), windows, threads, &Interrupt::NEVER, &mut out).unwrap();
    out
}

#[test]
fn every_backend_answers_what_plain_loops_answer() {
    for channels in [1, 3] {
        let picture = Picture::new(120, 150, channels, 7);
        let wanted: Vec<_> =
            windows().iter().map(|&window| answer(crop(&picture, window), &weights())).collect();
        assert!((0..5).all(|i| wanted.iter().any(|one| (one[i] - wanted[0][i]).abs() > 0.05)));
        for backend in available() {
            let look = SecondLook::with_backend(CHANNELS, HIDDEN, &weights(), backend).unwrap();
            for (found, wanted) in
                looked(&look, &picture, &windows(), 1).iter().flatten().zip(wanted.iter().flatten())
            {
                let off = (f64::from(*found) - wanted).abs();
                assert!(off < 1e-5 * wanted.abs().max(1.0), "{}: {found} for {wanted}", backend.name());
            }
        }
    }
}

#[test]
fn an_answer_depends_neither_on_threads_nor_on_the_other_windows() {
    let picture = Picture::new(120, 150, 3, 8);
    for backend in available() {
        let look = SecondLook::with_backend(CHANNELS, HIDDEN, &weights(), backend).unwrap();
        let all = looked(&look, &picture, &windows(), 1);
        assert_eq!(looked(&look, &picture, &windows(), 4), all);
        let alone: Vec<_> = windows().iter().flat_map(|&one| looked(&look, &picture, &[one], 1)).collect();
        assert_eq!(alone, all);
    }
    let look = SecondLook::new(CHANNELS, HIDDEN, &weights()).unwrap();
    assert!(looked(&look, &picture, &[], 2).is_empty());
}

#[test]
fn a_window_without_area_or_far_away_is_refused() {
    let picture = Picture::new(20, 20, 1, 1);
    let look = SecondLook::new(CHANNELS, HIDDEN, &weights()).unwrap();
    let nan = f64::NAN;
    for window in [
        [0.0, 0.0, 0.0, 9.0],
        [0.0, 0.0, 9.0, -1.0],
        [nan, 0.0, 9.0, 9.0],
        [0.0, 0.0, 9.0, nan],
        [0.0, 1e12, 9.0, 9.0],
        [0.0, 0.0, 1e9, 9.0],
    ] {
        let refused = look.answers(picture.view(), &[window], 1, &Interrupt::NEVER, &mut [[0.0; 5]]);
        assert!(matches!(refused, Err(HogError::Parameter(ParameterError::Window { .. }))), "{window:?}");
    }
}

#[test]
fn weights_of_no_network_are_refused() {
    let refused = |channels, hidden, weights: &[f32]| match SecondLook::new(channels, hidden, weights) {
        Err(HogError::Network(error)) => error,
        other => unreachable!("{other:?}"),
    };
    let (own, most) = (weights(), 1024);
    let (got, wanted) = (own.len() - 1, own.len());
    assert_eq!(refused(CHANNELS, HIDDEN, &own[1..]), NetworkError::Weights { got, wanted });
    assert_eq!(refused([5, 0, 7], HIDDEN, &own), NetworkError::Channels { got: 0, most });
    assert_eq!(refused(CHANNELS, usize::MAX, &own), NetworkError::Channels { got: usize::MAX, most });
    let infinite: Vec<_> =
        own.iter().map(|&weight| if weight == own[9] { f32::INFINITY } else { weight }).collect();
    assert_eq!(refused(CHANNELS, HIDDEN, &infinite), NetworkError::NotFinite);
    if !Backend::Neon.is_available() {
        assert!(SecondLook::with_backend(CHANNELS, HIDDEN, &own, Backend::Neon).is_err());
    }
}

#[test]
fn a_look_can_be_interrupted_between_any_two_steps() {
    let picture = Picture::new(120, 150, 1, 2);
    let look = SecondLook::new(CHANNELS, HIDDEN, &weights()).unwrap();
    let (asked, limit) = (Cell::new(0), Cell::new(usize::MAX));
    let ask = || {
        asked.set(asked.get() + 1);
        asked.get() > limit.get()
    };
    let interrupt = Interrupt::when(&ask);
    let call = |most| {
        asked.set(0);
        limit.set(most);
        look.answers(picture.view(), &windows(), 1, &interrupt, &mut [[0.0; 5]; 37])
    };
    call(usize::MAX).unwrap();
    let all = asked.get();
    for most in [0, 1, 63, 64, 1000, all - 1] {
        assert_eq!(call(most), Err(HogError::Interrupted), "{most} of {all}");
    }
}
