//! How the kernels lay out pixels, blocks and windows in memory: the constants that they share.

/// Pixels of a cell along one axis.
pub(super) const CELL: usize = 8;
/// Orientation bins of a cell.
pub(super) const BINS: usize = 9;
/// Elements of a block: 2 × 2 cells.
pub(super) const BLOCK: usize = 4 * BINS;
/// Sums per lane that one row of cells leaves to the next.
pub(super) const CARRY: usize = CELL * BINS * 2;

/// The blocks along x of a window are padded to a multiple of this: the most lanes that score one window.
pub(super) const ACROSS: usize = 8;
/// Words of a block's bytes.
pub(super) const WORDS: usize = BLOCK / 4;

/// Bytes that a kernel may read, and ignore, behind a plane.
pub(super) const SLACK: usize = 192;
/// Rows of mixed columns and of bytes are written in steps of this many elements.
pub(super) const STEP: usize = 64;
/// Bytes that a strip reads beyond the padded row: the rest of its last vector, and one neighbour.
pub(super) const OVERREAD: usize = 8 * 16 + 16;

/// Bytes of pixels that the strips work on at a time: a part of the second-level cache.
pub(super) const BAND: usize = 384 << 10;

/// How pixel values are turned into their square roots.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Gamma {
    /// Not: gamma correction is off.
    Off,
    /// From the CPU's estimate and a Newton step, checked to be exact for all 256 values.
    Estimated,
    /// By the square root instruction.
    Exact,
}

/// Rows of windows that the prefilter scores at a time.
pub(super) const ROWS: usize = 8;
