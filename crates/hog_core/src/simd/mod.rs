//! Everything that is compiled for more than one instruction set, and the crate's only `unsafe`.
#![allow(unsafe_code)]

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod backend;
mod exact;
mod lane;
mod level;
#[cfg(target_arch = "aarch64")]
mod neon;
mod plan;
mod polar;
mod portable;
mod rows;
mod score;
mod strip;

pub use backend::Backend;
pub(crate) use exact::{MulAdd, Work, run};
pub(crate) use level::{Scratch, detect, serves, split};
pub(crate) use plan::Plan;
pub(crate) use polar::polar;
pub(crate) use rows::Planes;
