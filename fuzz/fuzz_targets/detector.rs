//! Geometry × image × search: refused with an error, or every backend finds the windows that the exact path finds.
#![no_main]

// The random searches are those of the crate's own tests.
#[path = "../../crates/hog_core/tests/common/mod.rs"]
mod common;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| common::case::check(bytes));
