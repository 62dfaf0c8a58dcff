//! The kernels: the exact path's pipeline on vectors of cells, for one instruction set each, and the crate's `unsafe`.
//!
//! `layout` and `lane` hold the constants and the vector that every kernel uses; `plan` holds a detector's constants; `rows`, `strip`
//! and `score` are the stages of a level, which `level` composes; `dispatch` chooses the instruction set.
//! docs/simd.md explains how they work.
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
pub(crate) use dispatch::{detect, fill_planes, plan, resize_planes, serves};
pub(crate) use level::{Scratch, Task};
pub(crate) use plan::Plan;
pub(crate) use rows::Planes;
