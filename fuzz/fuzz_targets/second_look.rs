//! Any windows of any image, and any weights: an answer for each window that is finite and the same alone, or a refusal.
#![no_main]

use arbitrary::Arbitrary;
use hog_core::{ImageView, Interrupt, SecondLook};
use libfuzzer_sys::fuzz_target;

#[derive(Arbitrary, Debug)]
struct Case {
    layers: [u8; 4],
    weights: Vec<i8>,
    missing: bool,
    size: (u8, u8),
    colour: bool,
    pixels: Vec<u8>,
    windows: Vec<([i16; 2], [u16; 2])>,
    wild: Option<[f64; 4]>,
}

fuzz_target!(|case: Case| {
    let [first, second, third, hidden] = case.layers.map(|layer| usize::from(layer % 9));
    let convolutions = 26 * first + (9 * first + 1) * second + (9 * second + 1) * third;
    let count = convolutions + (32 * third + 1) * hidden + 5 * (hidden + 1) - usize::from(case.missing);
    let weight = |i: usize| f32::from(case.weights.get(i % case.weights.len().max(1)).copied().unwrap_or(1)) / 64.0;
    let weights: Vec<f32> = (0..count).map(weight).collect();
    let Ok(look) = SecondLook::new([first, second, third], hidden, &weights) else {
        assert!(case.missing || [first, second, third, hidden].contains(&0));
        return;
    };
    let channels = if case.colour { 3 } else { 1 };
    let (width, height) = (usize::from(case.size.0).max(1), usize::from(case.size.1).max(1));
    let pixel = |i: usize| case.pixels.get(i % case.pixels.len().max(1)).copied().unwrap_or(i as u8);
    let data: Vec<u8> = (0..width * height * channels).map(pixel).collect();
    let image = ImageView::new(&data, width, height, channels, width * channels).expect("it is an image");
    let side = |side: u16| f64::from(side % 1024) / 4.0 + 0.25;
    let fair = case.windows.iter().take(40);
    let windows: Vec<_> =
        fair.map(|&([x, y], [w, h])| [f64::from(x) / 8.0, f64::from(y) / 8.0, side(w), side(h)]).collect();
    let mut all = vec![[f32::NAN; 5]; windows.len()];
    look.answers(image, &windows, 2, &Interrupt::NEVER, &mut all).expect("they are windows");
    for (window, &wanted) in windows.iter().zip(&all) {
        let mut alone = [[f32::NAN; 5]];
        look.answers(image, &[*window], 1, &Interrupt::NEVER, &mut alone).expect("it is a window");
        assert!(wanted.iter().all(|number| number.is_finite()) && alone == [wanted], "{window:?}");
    }
    // (Large ones would take too long here; that they end is another test's.)
    if let Some(wild) = case.wild.filter(|wild| !(wild[2] < 2e6 && wild[3] < 2e6)) {
        assert!(look.answers(image, &[wild], 1, &Interrupt::NEVER, &mut [[0.0; 5]]).is_err());
    }
});
