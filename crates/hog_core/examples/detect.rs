#![allow(clippy::print_stdout, reason = "it prints what it finds")]
//! Prints the people in a picture: `cargo run --release --example detect -- street.jpg`.

use std::error::Error;

use hog_core::{Hog, HogParams, ImageView, Interrupt, Search, SearchOptions, model};

fn main() -> Result<(), Box<dyn Error>> {
    let name = std::env::args().nth(1).ok_or("usage: detect PICTURE")?;
    let picture = image::open(name)?.to_rgb8();
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let view = ImageView::new(picture.as_raw(), width, height, 3, 3 * width)?;
    let people = Hog::new(&HogParams::default(), Some(model::default_people()))?;
    let search = Search { win_stride: (8, 8), padding: (4, 4), ..Search::default() };
    let options = SearchOptions { search, threads: 2, ..SearchOptions::default() };
    for (rect, score) in people.detect(view, &options, &Interrupt::NEVER)? {
        println!("{} {} {} {} {score:.3}", rect.x, rect.y, rect.width, rect.height);
    }
    Ok(())
}
