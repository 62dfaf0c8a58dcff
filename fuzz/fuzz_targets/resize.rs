//! Images of any size, shrunk or enlarged to any other, against the formula of each pixel written out.
#![no_main]

use arbitrary::Arbitrary;
use hog_core::pyramid::{resize, taps};
use hog_core::{ImageView, Size};
use libfuzzer_sys::fuzz_target;

#[derive(Arbitrary, Debug)]
struct Case {
    from: (u8, u8),
    to: (u8, u8),
    colour: bool,
    pixels: Vec<u8>,
}

fuzz_target!(|case: Case| {
    let channels = if case.colour { 3 } else { 1 };
    let side = |side: u8| usize::from(side % 40);
    let (width, height) = (side(case.from.0).max(1), side(case.from.1).max(1));
    let to = Size::new(side(case.to.0), side(case.to.1));
    let pixel = |i: usize| case.pixels.get(i % case.pixels.len().max(1)).copied().unwrap_or(i as u8);
    let data: Vec<u8> = (0..width * height * channels).map(pixel).collect();
    let image = ImageView::new(&data, width, height, channels, width * channels).expect("it is an image");
    let Ok(found) = resize(image, to) else {
        assert!(to.width == 0 || to.height == 0);
        return;
    };
    assert_eq!(found.len(), to.width * to.height * channels);
    let across: Vec<_> = taps(width, to.width, 0..to.width).collect();
    for (y, down) in taps(height, to.height, 0..to.height).enumerate() {
        assert!(down.first < height && down.second < height && down.weight <= 256);
        for (x, tap) in across.iter().enumerate() {
            assert!(tap.first < width && tap.second < width && tap.weight <= 256);
            for c in 0..channels {
                let at = |x: usize, y: usize| u32::from(data[(y * width + x) * channels + c]);
                let row = |y: usize| at(tap.first, y) * (256 - tap.weight) + at(tap.second, y) * tap.weight;
                let wanted = row(down.first) * (256 - down.weight) + row(down.second) * down.weight;
                assert_eq!(u32::from(found[(y * to.width + x) * channels + c]), (wanted + (1 << 15)) >> 16);
            }
        }
    }
});
