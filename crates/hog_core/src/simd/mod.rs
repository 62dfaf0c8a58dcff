//! Everything that is compiled for more than one instruction set, and the crate's only `unsafe`.
#![allow(unsafe_code)]

mod polar;

pub(crate) use polar::polar;
