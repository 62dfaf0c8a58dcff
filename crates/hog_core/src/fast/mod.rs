//! The kernels: the exact path's pipeline on vectors of cells, compiled for each instruction set; nearly all of the crate's
//! `unsafe`.
//!
//! `layout` and `lane` hold the constants and the vector that every kernel uses; `plan` holds a detector's constants; `rows`,
//! `strip` over `bins`, and `score` are the stages, which `tile` composes; `search` shares tiles among threads; `describe`
//! serves crops, `network` the second look, `votes` the exact path's gradients; `dispatch` chooses the instruction set.
//! docs/simd.md explains how they work.
#![allow(unsafe_code, reason = "intrinsics, and pointers into rows that overlap")]

mod backend;
mod bins;
mod describe;
mod dispatch;
#[allow(unused_macros, reason = "an architecture may have no lane but the portable one")]
mod lane;
mod layout;
mod network;
mod plan;
mod rows;
mod score;
mod search;
mod strip;
mod tile;
#[cfg(target_arch = "x86_64")]
mod votes;

pub use backend::Backend;
pub(crate) use describe::{Crops, describe};
pub(crate) use dispatch::{fill_planes, geometry, plan, resize_planes, row_kernel, serves};
pub(crate) use network::{ANSWER, INPUT, Network};
pub(crate) use plan::{Geometry, Plan};
pub(crate) use rows::Planes;
pub(crate) use score::Thresholds;
pub(crate) use search::{Region, Task, search, trim};
pub(crate) use tile::Found;
