//! Stage 2: weighted block histograms, and their L2-Hys normalisation, summed in OpenCV's own order.

use crate::params::HogSpec;

use super::gradient::{Vote, Votes};
use super::isa::{MulAdd, Work, run};
use super::tables::{Abreast, Pixel, Tables};

/// The normalised histograms of the blocks that begin at the pixels `firsts` (indices into `votes`), one block after
/// the other into `out` (`spec.block_len` elements each: cells column by column, bins within).
pub(super) fn block_histograms(
    votes: &Votes,
    firsts: &[usize],
    spec: &HogSpec,
    tables: &Tables,
    out: &mut [f32],
) {
    let weights = &tables.weights;
    if spec.nbins <= BINS && !weights.abreast_4.is_empty() {
        run(CellsAbreast { votes, firsts, spec, pixels: &weights.abreast_4, out });
    } else if spec.nbins <= BINS && !weights.abreast_16.is_empty() {
        run(CellsAbreast { votes, firsts, spec, pixels: &weights.abreast_16, out });
    } else {
        for (&first, block) in firsts.iter().zip(out.chunks_exact_mut(spec.block_len)) {
            block_histogram(votes, first, spec, tables, block);
        }
    }
}

/// The plain form, for one block of any number of cells; the faster form equals it to the last bit.
fn block_histogram(votes: &Votes, first: usize, spec: &HogSpec, tables: &Tables, block: &mut [f32]) {
    block.fill(0.0);
    add_votes(votes, first, spec.nbins, &tables.weights.one, block);
    add_votes(votes, first, spec.nbins, &tables.weights.two, block);
    add_votes(votes, first, spec.nbins, &tables.weights.four, block);
    normalise(block, spec.l2_hys_threshold);
}

fn add_votes<const CELLS: usize>(
    votes: &Votes,
    first: usize,
    nbins: usize,
    pixels: &[Pixel<CELLS>],
    block: &mut [f32],
) {
    for pixel in pixels {
        let Vote { shares: [g0, g1], bins } = votes.pixels[first + pixel.row * votes.width + pixel.column];
        let [b0, b1] = bins.map(usize::from);
        for (cell, weight) in pixel.cells {
            let cell = cell * nbins;
            // Both sums start from the old values: with a single bin the second share replaces the first.
            let sums = (block[cell + b0] + g0 * weight, block[cell + b1] + g1 * weight);
            block[cell + b0] = sums.0;
            block[cell + b1] = sums.1;
        }
    }
}

/// Blocks that are summed in turns, so that no sum waits for the store before it.
const TOGETHER: usize = 6;
/// Bins that blocks summed in turns may have.
const BINS: usize = 32;

/// Blocks of up to `LANES` cells, each cell in its lane: a pixel votes in all of them at once, with weight zero in
/// those it does not reach, which leaves their sums as they are.
struct CellsAbreast<'a, const LANES: usize> {
    votes: &'a Votes,
    firsts: &'a [usize],
    spec: &'a HogSpec,
    pixels: &'a [Abreast<LANES>],
    out: &'a mut [f32],
}

impl<const LANES: usize> Work for CellsAbreast<'_, LANES> {
    type Output = ();

    #[inline(always)]
    fn run<M: MulAdd>(self) {
        let Self { votes, firsts, spec, pixels, out } = self;
        let reach = (spec.block.height - 1) * votes.width + spec.block.width;
        let mut sums = [[[0.0f32; LANES]; BINS]; TOGETHER];
        for (firsts, out) in firsts.chunks(TOGETHER).zip(out.chunks_mut(TOGETHER * spec.block_len)) {
            // Places without a block repeat the last.
            let firsts: [usize; TOGETHER] = std::array::from_fn(|block| firsts[block.min(firsts.len() - 1)]);
            sums.iter_mut().for_each(|sums| sums[..spec.nbins].fill([0.0; LANES]));
            let blocks = firsts.map(|first| &votes.pixels[first..][..reach]);
            for &Abreast { column, row, weights } in pixels {
                let at = row * votes.width + column;
                for (sums, block) in sums.iter_mut().zip(blocks) {
                    let Vote { shares: [g0, g1], bins } = block[at];
                    let [b0, b1] = bins.map(|bin| usize::from(bin) % BINS);
                    // As above: both sums start from the old values.
                    let (mut sum0, mut sum1) = (sums[b0], sums[b1]);
                    for lane in 0..LANES {
                        sum0[lane] += g0 * weights[lane];
                        sum1[lane] += g1 * weights[lane];
                    }
                    sums[b0] = sum0;
                    sums[b1] = sum1;
                }
            }
            for (block, sums) in out.chunks_exact_mut(spec.block_len).zip(&sums) {
                for (cell, histogram) in block.chunks_exact_mut(spec.nbins).enumerate() {
                    for (value, sums) in histogram.iter_mut().zip(sums) {
                        *value = sums[cell];
                    }
                }
                normalise(block, spec.l2_hys_threshold);
            }
        }
    }
}

/// L2-Hys: scale to unit length, clip at `threshold`, scale again. A block without gradient stays zero.
#[inline(always)]
pub(crate) fn normalise(block: &mut [f32], threshold: f32) {
    let scale = 1.0 / (sum_of_squares(block).sqrt() + block.len() as f32 * 0.1);
    for value in block.iter_mut() {
        *value = (*value * scale).min(threshold);
    }
    let scale = 1.0 / (sum_of_squares(block).sqrt() + 1e-3);
    for value in block.iter_mut() {
        *value *= scale;
    }
}

/// The sum of squares in four lanes, then the rest one by one.
#[inline(always)]
fn sum_of_squares(block: &[f32]) -> f32 {
    let (vectors, tail) = block.as_chunks::<4>();
    let mut lanes = [0.0f32; 4];
    for vector in vectors {
        for (lane, value) in lanes.iter_mut().zip(vector) {
            *lane += value * value;
        }
    }
    let sum = (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]);
    tail.iter().fold(sum, |sum, value| sum + value * value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::HogParams;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn cells_abreast_give_the_sums_of_the_plain_form(
            nbins in 1..=20usize,
            cells in (1..=4usize, 1..=4usize),
            cell in (2..=6usize, 2..=6usize),
            votes in prop::collection::vec((0.0..100f32, 0.0..100f32, 0..255u8), 40 * 25),
            firsts in prop::collection::vec(0..20usize, 1..20),
        ) {
            let block = ((cells.0 * cell.0) as i64, (cells.1 * cell.1) as i64);
            let spec = HogSpec::new(&HogParams {
                win_size: block,
                block_size: block,
                cell_size: (cell.0 as i64, cell.1 as i64),
                nbins: nbins as i64,
                ..HogParams::default()
            }).unwrap();
            let bins = |bin: u8| [bin % nbins as u8, (bin + 1) % nbins as u8];
            let vote = |&(a, b, bin): &(f32, f32, u8)| Vote { shares: [a, b], bins: bins(bin) };
            let votes = Votes { width: 40, pixels: votes.iter().map(vote).collect() };
            let mut together = vec![f32::NAN; firsts.len() * spec.block_len];
            let tables = Tables::new(&spec).unwrap();
            block_histograms(&votes, &firsts, &spec, &tables, &mut together);
            for (&first, found) in firsts.iter().zip(together.chunks_exact(spec.block_len)) {
                let mut alone = vec![f32::NAN; spec.block_len];
                block_histogram(&votes, first, &spec, &tables, &mut alone);
                prop_assert_eq!(&alone, found);
            }
        }
    }

    #[test]
    fn normalising_clips_and_gives_nearly_unit_length() {
        let mut block = [0.0f32; 36];
        block[..8].fill(100.0);
        block[8] = 1000.0;
        normalise(&mut block, 0.2);
        let length = block.iter().map(|v| v * v).sum::<f32>().sqrt();
        assert!((length - 1.0).abs() < 5e-3, "{length}");
        let mut flat = [0.0f32; 3];
        normalise(&mut flat, 0.2);
        assert_eq!(flat, [0.0; 3]);
    }
}
