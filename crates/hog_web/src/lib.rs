//! hog_core for a web page: functions of numbers over one memory, which `web/engine.js` calls.
//!
//! There is no wasm-bindgen: nine functions that take numbers and leave numbers need no generated glue, and a build
//! needs no tool beside the compiler. The page writes bytes or coefficients where [`room`] says, calls, and reads f64
//! from where [`results`] says. A page has one thread, and so one state.
#![allow(
    unsafe_code,
    reason = "a name that the page can call is given by `no_mangle`, which counts as unsafe"
)]

use std::cell::RefCell;

use hog_core::exact::RowVotes;
use hog_core::{Grouping, Hog, HogParams, ImageView, Interrupt, Search, SearchOptions, model};

/// What stays between calls: the room for input, the detector, and what the last call found.
#[derive(Default)]
struct Lab {
    bytes: Vec<u8>,
    hog: Option<Hog>,
    results: Vec<f64>,
    error: String,
}

thread_local! {
    static LAB: RefCell<Lab> = RefCell::default();
}

/// Runs `work`; how many results it left, or -1 with its reason in [`error`].
fn count(work: impl FnOnce(&mut Lab) -> Result<(), String>) -> i32 {
    LAB.with_borrow_mut(|lab| {
        lab.results.clear();
        match work(lab) {
            Ok(()) => i32::try_from(lab.results.len()).unwrap_or(i32::MAX),
            Err(error) => {
                lab.error = error;
                -1
            }
        }
    })
}

/// Runs `work` on the detector and the image in the room: interleaved rows without gaps.
fn on_image(
    (width, height, channels): (usize, usize, usize),
    work: impl FnOnce(&Hog, ImageView, &mut Vec<f64>) -> hog_core::Result<()>,
) -> i32 {
    count(|Lab { bytes, hog, results, .. }| {
        let hog = hog.as_ref().ok_or("no model was chosen")?;
        let view = ImageView::new(bytes, width, height, channels, width * channels);
        view.and_then(|view| work(hog, view, results)).map_err(|error| error.to_string())
    })
}

/// Makes room for input; where it begins. The next call of any function may move it.
#[unsafe(no_mangle)]
pub extern "C" fn room(bytes: usize) -> *mut u8 {
    LAB.with_borrow_mut(|lab| {
        lab.bytes.resize(bytes, 0);
        lab.bytes.as_mut_ptr()
    })
}

/// Where the results of the last call begin.
#[unsafe(no_mangle)]
pub extern "C" fn results() -> *const f64 {
    LAB.with_borrow(|lab| lab.results.as_ptr())
}

/// Copies the reason of the last -1 to the results, a number for each byte.
#[unsafe(no_mangle)]
pub extern "C" fn error() -> i32 {
    count(|lab| {
        lab.results.extend(lab.error.bytes().map(f64::from));
        Ok(())
    })
}

/// Copies OpenCV's coefficients to the results: those of 64 × 128, or with 1 Daimler's of 48 × 96.
#[unsafe(no_mangle)]
pub extern "C" fn opencv_model(which: i32) -> i32 {
    let model = if which == 1 { model::daimler_people() } else { model::default_people() };
    count(|lab| {
        lab.results.extend(model.iter().copied().map(f64::from));
        Ok(())
    })
}

/// Makes the detector of windows of `width` × `height` [px] and the coefficients in the room, f32, bias last.
#[unsafe(no_mangle)]
pub extern "C" fn make(width: i32, height: i32, gamma: i32) -> i32 {
    count(|lab| {
        let numbers = lab.bytes.as_chunks::<4>().0.iter().map(|&bytes| f32::from_le_bytes(bytes));
        let coefficients: Vec<f32> = numbers.collect();
        let params = HogParams {
            win_size: (width.into(), height.into()),
            gamma_correction: gamma != 0,
            ..HogParams::default()
        };
        lab.hog = Some(Hog::new(&params, Some(&coefficients)).map_err(|error| error.to_string())?);
        Ok(())
    })
}

/// Finds people in the image: x, y, width, height [px] and weight of each. `group` below 1 returns every hit; with
/// `mean_shift` it is the least weight of a mode.
#[unsafe(no_mangle)]
#[allow(clippy::too_many_arguments, reason = "a page can pass numbers alone")]
pub extern "C" fn search(
    width: usize,
    height: usize,
    channels: usize,
    hit_threshold: f64,
    stride_x: i32,
    stride_y: i32,
    padding_x: i32,
    padding_y: i32,
    scale: f64,
    group: f64,
    mean_shift: i32,
) -> i32 {
    let (win_stride, padding) = ((stride_x.into(), stride_y.into()), (padding_x.into(), padding_y.into()));
    let search = Search { hit_threshold, win_stride, padding };
    let grouping = if mean_shift != 0 { Grouping::MeanShift(group) } else { Grouping::Similar(group as i32) };
    let options = SearchOptions { search, scale, grouping, ..SearchOptions::default() };
    on_image((width, height, channels), |hog, view, results| {
        let found = hog.detect(view, &options, &Interrupt::NEVER)?;
        for (rect, weight) in found {
            results.extend([rect.x, rect.y, rect.width, rect.height].map(f64::from));
            results.push(weight);
        }
        Ok(())
    })
}

/// The two votes of each pixel: their shares of the magnitude, then their bins.
#[unsafe(no_mangle)]
pub extern "C" fn gradient(width: usize, height: usize, channels: usize) -> i32 {
    on_image((width, height, channels), |hog, view, results| {
        let (mut shares, mut bins) = (vec![[0.0; 2]; width * height], vec![[0; 2]; width * height]);
        let out = RowVotes { shares: &mut shares, bins: &mut bins };
        hog.gradient(view, [0; 4], &Interrupt::NEVER, out)?;
        for (shares, bins) in shares.into_iter().zip(bins) {
            results.extend([shares[0].into(), shares[1].into(), f64::from(bins[0]), f64::from(bins[1])]);
        }
        Ok(())
    })
}

/// The descriptor of the image, which is one window: blocks column by column, in them cells column by column, bins.
#[unsafe(no_mangle)]
pub extern "C" fn describe(width: usize, height: usize, channels: usize) -> i32 {
    let search = Search { hit_threshold: 0.0, win_stride: (0, 0), padding: (0, 0) };
    on_image((width, height, channels), |hog, view, results| {
        let mut out = vec![0.0; hog.compute_len(view, &search, None)?];
        hog.compute(view, &search, None, &Interrupt::NEVER, &mut out)?;
        results.extend(out.into_iter().map(f64::from));
        Ok(())
    })
}
