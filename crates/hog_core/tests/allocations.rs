//! A call that has been made before asks for no memory but its results'.
#![allow(unsafe_code, reason = "an allocator that counts")]
#![allow(clippy::unwrap_used, reason = "a test may fail")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use hog_core::{Grouping, Hog, HogParams, ImageView, Interrupt, Search, SearchOptions, model};

struct Counting;

static BYTES: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is handed on to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        BYTES.fetch_add(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(pointer, layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        BYTES.fetch_add(size, Ordering::Relaxed);
        // SAFETY: the caller's promise.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn scratch_memory_is_used_again() {
    let (width, height) = (320, 240);
    let data: Vec<u8> = (0..width * height * 3).map(|i| (i * i / 97) as u8).collect();
    let image = ImageView::new(&data, width, height, 3, 3 * width).unwrap();
    let hog = Hog::new(&HogParams::default(), Some(model::default_people())).unwrap();
    let search = Search { hit_threshold: 1e3, win_stride: (8, 8), padding: (4, 4) };
    let call = || {
        hog.detect(
            image,
            &SearchOptions {
                search,
                scale: 1.05,
                grouping: Grouping::Similar(2),
                ..SearchOptions::default()
            },
            &Interrupt::NEVER,
        )
        .unwrap()
    };
    assert!(call().is_empty());
    let before = BYTES.load(Ordering::Relaxed);
    assert!(call().is_empty());
    let bytes = BYTES.load(Ordering::Relaxed) - before;
    // Lists of the 14 levels, their tiles and their (no) hits; the planes of the image alone are 230 kB.
    assert!(bytes < 10_000, "{bytes} bytes");
}
