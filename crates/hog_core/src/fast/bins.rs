//! From gradients to bins: a pixel's two votes, and their sums down a cell's 8 rows of pixels. Lanes are neighbouring cells.
//!
//! ```text
//! vote:        dx, dy → magnitude, position along the bins → the share of the even bin and of the odd one, their slots
//! spread_all:  for each bin: Σ over the rows of weight down[y] × its vote → carry, sums
//! ```
//!
//! A block is 2 × 2 cells. A row of cells is the lower one of the blocks that end in it and the upper one of those that
//! begin in it; a pixel's vote reaches both cells of a block, the nearer one more:
//!
//! ```text
//!              blocks that end here     blocks that begin here
//! cell above   upper    ← rows 0..4     (not in them)
//! this cell    lower    ← all rows      upper    ← all rows
//! cell below   (not in them)            lower    ← rows 4..8
//! ```
//!
//! So a row of pixels reaches three of these four sums; `down[y]` has its weights in the order this cell as upper, the cell
//! above or below, this cell as lower:
//!
//! ```text
//!              in                            rows 0..4    rows 4..8    out
//! down[y][0]   0                             +            +            carry[bin][0]: upper of the blocks that begin here
//! down[y][1]   carry[bin][0] of row above    +                         sums[bin]:     upper of the blocks that end here
//!              0                                          +            carry[bin][1]: lower of the blocks that begin here
//! down[y][2]   carry[bin][1] of row above    +            +            sums[9 + bin]: lower of the blocks that end here
//! ```
//!
//! Tricks (figures: docs/simd.md): 1. Of two neighbouring bins one is even and one odd. With votes kept by parity a bin looks
//! at one vote, not two ([`LaneVotes`]); bins 8 and 0, of equal parity, look at both. 2. As many bins are summed at a time as
//! there are registers for, in a loop that the compiler cannot unroll: unrolled, its sums spill.

#![allow(clippy::needless_range_loop, reason = "indices that are known when compiling name registers")]

use std::hint::black_box;

use super::lane::{Lane, ODD};
use super::layout::{BINS, CELL};

/// A gradient's two votes, one for an even bin and one for an odd bin: a bin reads the vote of its own parity alone.
/// Bins 8 and 0 are neighbours too, and both even: of a gradient between them one bin reads the even vote, the other the odd.
///
/// Even bin b has slot b / 2, odd bin b has slot `ODD` + (b + 1) / 2; `ODD` stands for bin 8, `ODD` + 5 for bin 0.
#[derive(Clone, Copy)]
pub(super) struct LaneVotes<L: Lane> {
    pub even: L::F,
    pub odd: L::F,
    pub slots: L::Slots,
}

/// The votes of one pixel of every cell.
#[inline(always)]
pub(super) fn vote<L: Lane>(l: L, [dx, dy]: [L::F; 2]) -> LaneVotes<L> {
    let (xx, yy) = (l.mul(dx, dx), l.mul(dy, dy));
    let squared = l.add(xx, yy);
    let magnitude = l.sqrt_approx(squared);
    // OpenCV's polynomial for the arctangent of 0..=1, in units of two bins.
    let c = l.div_approx(l.min_abs(dx, dy), l.max_abs(dx, dy));
    let cc = l.mul(c, c);
    let p = l.mul_add(cc, l.splat(ARC[3]), l.splat(ARC[2]));
    let p = l.mul_add(p, cc, l.splat(ARC[1]));
    let p = l.mul_add(p, cc, l.splat(ARC[0]));
    // The position along the bins is 2.5 ± (arc − 2.25) up to 45°, 2.5 ∓ arc beyond, where the signs of dx and dy
    // are (not) equal; half a bin is added so that bin b lies around (b + 1) / 2.
    let steep = l.less(xx, yy);
    let arc = l.mul_add(p, l.negate_where(steep, c), l.zero_where(steep, l.splat(-2.25)));
    let position = l.add(l.splat(2.5), l.flip_by_signs(arc, dx, dy));
    // A triangle wave: how near the even bin is. Votes are halved here, the weights doubled.
    let (share, slots) = l.slots(position);
    let even = l.mul(magnitude, share);
    LaneVotes { even, odd: l.mul_sub(magnitude, l.splat(0.5), even), slots }
}

/// The polynomial's coefficients: radians to units of two bins of π/9.
const ARC: [f32; 4] = {
    const UNIT: f64 = 4.5 / std::f64::consts::PI;
    [
        (0.9997878412794807 * UNIT) as f32,
        (-0.3258083974640975 * UNIT) as f32,
        (0.1555786518463281 * UNIT) as f32,
        (-0.04432655554792128 * UNIT) as f32,
    ]
};

/// Sums the votes of all bins, as many at a time as there are registers for.
#[inline(always)]
pub(super) fn spread_all<L: Lane>(
    l: L,
    weights: &[[f32; 3]; CELL],
    votes: &[LaneVotes<L>; CELL],
    carry: &mut [[L::F; 2]; BINS],
    sums: &mut [[L::F; CELL]; 2 * BINS],
    phase: usize,
) {
    if L::WIDE {
        spread::<L, 1, 2, 4>(l, weights, votes, carry, sums, phase);
        spread::<L, 0, 2, 5>(l, weights, votes, carry, sums, phase);
    } else {
        spread::<L, 1, 2, 2>(l, weights, votes, carry, sums, phase);
        spread::<L, 5, 2, 2>(l, weights, votes, carry, sums, phase);
        spread::<L, 0, 8, 2>(l, weights, votes, carry, sums, phase);
        spread::<L, 2, 2, 3>(l, weights, votes, carry, sums, phase);
    }
}

/// Sums the votes of `COUNT` bins, `STEP` apart, of one pixel column down a cell's rows, weighted.
///
/// This row of cells completes what `carry` holds of the one above; the tables at the head of this file show how.
#[inline(always)]
fn spread<L: Lane, const FROM: usize, const STEP: usize, const COUNT: usize>(
    l: L,
    weights: &[[f32; 3]; CELL],
    votes: &[LaneVotes<L>; CELL],
    carry: &mut [[L::F; 2]; BINS],
    sums: &mut [[L::F; CELL]; 2 * BINS],
    phase: usize,
) {
    let zero = l.splat(0.0);
    // Per bin, in the order of `down`: the second table at the head of this file.
    let mut acc = [[zero; 3]; COUNT];
    for i in 0..COUNT {
        acc[i] = [zero, carry[FROM + STEP * i][0], carry[FROM + STEP * i][1]];
    }
    for half in 0..2 {
        // A length that the compiler cannot see keeps the loop rolled; unrolled, its sums spill.
        let rows: (&[LaneVotes<L>], &[[f32; 3]]) =
            black_box((&votes[CELL / 2 * half..][..CELL / 2], &weights[CELL / 2 * half..][..CELL / 2]));
        for (votes, weights) in rows.0.iter().zip(rows.1) {
            let w = [l.splat(weights[0]), l.splat(weights[1]), l.splat(weights[2])];
            let vote = if FROM.is_multiple_of(2) { votes.even } else { votes.odd };
            let products = [l.mul(vote, w[0]), l.mul(vote, w[1]), l.mul(vote, w[2])];
            for i in 0..COUNT {
                let bin = FROM + STEP * i;
                let kept = of_bin(l, votes, bin);
                for k in 0..3 {
                    acc[i][k] = if bin.is_multiple_of(8) || (bin == 1 && k == 2) {
                        l.mul_add_masked(kept, w[k], acc[i][k])
                    } else {
                        l.add_product(kept, products[k], w[k], acc[i][k])
                    };
                }
            }
        }
        if half == 0 {
            for i in 0..COUNT {
                sums[FROM + STEP * i][phase] = acc[i][1];
                acc[i][1] = zero;
            }
        }
    }
    for i in 0..COUNT {
        carry[FROM + STEP * i] = [acc[i][0], acc[i][1]];
        sums[BINS + FROM + STEP * i][phase] = acc[i][2];
    }
}

/// The votes for `bin`.
#[inline(always)]
fn of_bin<L: Lane>(l: L, votes: &LaneVotes<L>, bin: usize) -> L::Masked {
    match bin {
        0 => l.keep_either(votes.slots, (votes.even, 0), (votes.odd, ODD + 5)),
        8 => l.keep_either(votes.slots, (votes.even, 4), (votes.odd, ODD)),
        _ if bin.is_multiple_of(2) => l.keep(votes.even, votes.slots, bin / 2),
        _ => l.keep(votes.odd, votes.slots, ODD + bin.div_ceil(2)),
    }
}
