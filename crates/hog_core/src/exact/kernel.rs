//! What kernels may do for the gradient's loops.

use std::fmt::Debug;
use std::panic::RefUnwindSafe;

/// The votes of a row of pixels, or of more.
pub struct RowVotes<'a> {
    /// What the two bins get: shares of the gradient's magnitude.
    pub shares: &'a mut [[f32; 2]],
    /// Which two neighbouring orientation bins these are.
    pub bins: &'a mut [[u8; 2]],
}

/// The orientation bins of a full or half turn.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Turn {
    /// How many there are.
    pub bins: f32,
    /// How many there are in a radian.
    pub bins_per_radian: f32,
}

/// Kernels that make parts of a row as the loops here would, to the last bit; what they leave is made by the loops.
pub(crate) trait RowKernel: Debug + Sync + RefUnwindSafe {
    /// Makes votes of the first `columns` columns, where the lowest channel wins among equals and angles are rounded as
    /// OpenCV's vector code rounds them; gives how many it has made.
    ///
    /// `neighbours` are three rows of the padded image, one column wider on either side; `lines` hold as many numbers as
    /// there are columns, in which nothing is kept.
    fn votes(
        &self,
        neighbours: [&[f32]; 3],
        columns: usize,
        turn: Turn,
        lines: [&mut [f32]; 2],
        votes: &mut RowVotes,
    ) -> usize;

    /// Writes the square root of each of `pixels`, and gives whether it has.
    fn roots(&self, pixels: &[u8], roots: &mut [f32]) -> bool;
}

/// No kernels: the loops make everything.
#[derive(Debug)]
pub(crate) struct Loops;

impl RowKernel for Loops {
    fn votes(&self, _: [&[f32]; 3], _: usize, _: Turn, _: [&mut [f32]; 2], _: &mut RowVotes) -> usize {
        0
    }

    fn roots(&self, _: &[u8], _: &mut [f32]) -> bool {
        false
    }
}
