//! The kernels: the exact path's pipeline on vectors of cells, for one instruction set each, and the crate's `unsafe`.
//!
//! `layout` and `lane` are what every kernel is written in; `plan` is what a detector means to them; `rows`, `strip`
//! and `score` are the stages of a level, which `level` composes; `dispatch` chooses the instruction set.
//! How it works is told in docs/simd.md.
#![allow(unsafe_code, reason = "intrinsics, and pointers into rows that overlap")]

mod backend;
mod dispatch;
mod lane;
mod layout;
mod level;
mod plan;
mod rows;
mod score;
mod strip;

pub use backend::Backend;
pub(crate) use dispatch::{detect, plan, serves, split};
pub(crate) use level::Scratch;
pub(crate) use plan::Plan;
pub(crate) use rows::Planes;
