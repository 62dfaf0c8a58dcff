//! The kernels: the exact path's pipeline on vectors of cells, for one instruction set each, and the crate's `unsafe`.
//!
//! `layout` and `lane` hold the constants and the vector that every kernel uses; `plan` holds a detector's constants; `rows`, `strip`
//! and `score` are the stages, which `tile` composes; `search` shares tiles among threads; `dispatch` chooses the instruction
//! set.
//! docs/simd.md explains how they work.
#![allow(unsafe_code, reason = "intrinsics, and pointers into rows that overlap")]

mod backend;
mod dispatch;
mod lane;
mod layout;
mod plan;
mod rows;
mod score;
mod search;
mod strip;
mod tile;

pub use backend::Backend;
pub(crate) use dispatch::{fill_planes, plan, resize_planes, serves};
pub(crate) use plan::Plan;
pub(crate) use rows::Planes;
pub(crate) use search::{Task, search, trim};
pub(crate) use tile::Found;
