//! A small convolutional network on vectors of inputs: lane i of every number belongs to input i.
//!
//! Lanes never meet, so that an answer does not depend on what else is asked; where the CPU has fused multiplication and
//! addition, every width gives the same bits. `kernel` makes the output of a layer.

mod kernel;

use crate::error::{NetworkError, Result};
use crate::interrupt::Interrupt;
use crate::memory::{self, Pool, Workspace};

use super::backend::Backend;
use super::dispatch::{OnLane, on_lane};
use super::lane::Lane;
use super::tile::Lines;
use kernel::{Make, OUTPUTS};

/// Columns and rows of an input.
pub(crate) const INPUT: (usize, usize) = (32, 64);
/// Sides of the kernels of the convolutions, all of stride 2.
const KERNELS: [usize; 3] = [5, 3, 3];
/// Numbers of an answer.
pub(crate) const ANSWER: usize = 5;
/// More channels or units than any layer may have.
const CHANNELS_MAX: usize = 1024;

/// Scratch memory, one per thread at work.
static SCRATCH: Pool<Scratch> = Pool::new();

/// Three convolutions, then two dense layers, the last of [`ANSWER`] units.
#[derive(Debug)]
pub(crate) struct Network {
    layers: Vec<Layer>,
}

/// A layer that makes numbers of `run` neighbouring ones in each of `rows` rows.
#[derive(Debug)]
struct Layer {
    rows: usize,
    run: usize,
    /// A multiple of [`OUTPUTS`]: further channels have no weights.
    outputs: usize,
    /// Columns and rows of the output.
    size: (usize, usize),
    /// Zeros before the first column and row of the output, for the next layer.
    border: usize,
    /// \[block of outputs\]\[row\]\[column and channel\]\[output\].
    weights: Vec<f32>,
    bias: Vec<f32>,
    is_last: bool,
}

#[derive(Debug, Default)]
struct Scratch {
    numbers: [Lines; 2],
}

impl Workspace for Scratch {
    fn bytes(&self) -> usize {
        self.numbers.iter().map(Lines::bytes).sum()
    }
}

impl Network {
    /// A network with these channels and units; of each layer the weights \[row\]\[column\]\[channel\]\[output\], then the
    /// bias, one layer after the other.
    pub(crate) fn new(channels: [usize; 3], hidden: usize, mut numbers: &[f32]) -> Result<Self> {
        let is_fair = |got: &usize| (1..=CHANNELS_MAX).contains(got);
        if let Some(&got) = channels.iter().chain([&hidden]).find(|&got| !is_fair(got)) {
            return Err(NetworkError::Channels { got, most: CHANNELS_MAX }.into());
        }
        let shapes = Self::shapes(channels, hidden);
        let wanted = shapes.iter().map(|&(rows, run, outputs)| (rows * run + 1) * outputs).sum();
        if numbers.len() != wanted {
            return Err(NetworkError::Weights { got: numbers.len(), wanted }.into());
        }
        if !numbers.iter().all(|number| number.is_finite()) {
            return Err(NetworkError::NotFinite.into());
        }
        let mut layers = memory::with_room(shapes.len())?;
        // (The output of what comes before is padded to whole blocks of channels.)
        let (mut inputs, mut padded) = (1, 1);
        for (index, &(rows, run, outputs)) in shapes.iter().enumerate() {
            let (weights, rest) = numbers.split_at(rows * run * outputs);
            let (bias, rest) = rest.split_at(outputs);
            numbers = rest;
            layers.push(Layer::new(index, (rows, run / inputs), (inputs, padded), weights, bias)?);
            (inputs, padded) = (outputs, outputs.next_multiple_of(OUTPUTS));
        }
        Ok(Self { layers })
    }

    /// Rows, numbers of a row, and outputs of each layer.
    fn shapes([first, second, third]: [usize; 3], hidden: usize) -> [(usize, usize, usize); 5] {
        let cells = INPUT.0 / 8 * (INPUT.1 / 8);
        [
            (KERNELS[0], KERNELS[0], first),
            (KERNELS[1], KERNELS[1] * first, second),
            (KERNELS[2], KERNELS[2] * second, third),
            (1, cells * third, hidden),
            (1, hidden, ANSWER),
        ]
    }

    /// The network's answers to `inputs`, rows of [`INPUT`] one after the other, into `out`.
    pub(crate) fn answers(
        &self,
        backend: Backend,
        inputs: &[f32],
        interrupt: &Interrupt,
        out: &mut [[f32; ANSWER]],
    ) -> Result<()> {
        on_lane(backend, Answers { network: self, inputs, interrupt, out })
    }
}

impl Layer {
    /// Layer `index`, whose kernel has `rows` rows of `columns` times `inputs` channels, laid out as `padded` ones.
    fn new(
        index: usize,
        (rows, columns): (usize, usize),
        (inputs, padded): (usize, usize),
        weights: &[f32],
        bias: &[f32],
    ) -> Result<Self> {
        let outputs = bias.len().next_multiple_of(OUTPUTS);
        let run = columns * padded;
        let mut packed = memory::filled(rows * run * outputs, 0.0)?;
        for (at, &weight) in weights.iter().enumerate() {
            let (place, output) = (at / bias.len(), at % bias.len());
            let (row, column, input) = (place / inputs / columns, place / inputs % columns, place % inputs);
            let block = output / OUTPUTS;
            let at = ((block * rows + row) * run + column * padded + input) * OUTPUTS + output % OUTPUTS;
            packed[at] = weight;
        }
        let mut own_bias = memory::filled(outputs, 0.0)?;
        own_bias[..bias.len()].copy_from_slice(bias);
        let size = if index < 3 { (INPUT.0 >> (index + 1), INPUT.1 >> (index + 1)) } else { (1, 1) };
        let border = if index < 2 { KERNELS[index + 1] / 2 } else { 0 };
        Ok(Self { rows, run, outputs, size, border, weights: packed, bias: own_bias, is_last: index == 4 })
    }

    /// Columns and rows of the output and the zeros before it.
    fn padded(&self) -> (usize, usize) {
        (self.size.0 + self.border, self.size.1 + self.border)
    }
}

struct Answers<'a> {
    network: &'a Network,
    inputs: &'a [f32],
    interrupt: &'a Interrupt<'a>,
    out: &'a mut [[f32; ANSWER]],
}

impl OnLane for Answers<'_> {
    type Output = Result<()>;

    fn run<L: Lane>(self, l: L) -> Result<()> {
        let Self { network, inputs, interrupt, out } = self;
        let size = INPUT.0 * INPUT.1;
        let found = SCRATCH.with(|scratch| {
            for (inputs, out) in inputs.chunks(size * L::LANES).zip(out.chunks_mut(L::LANES)) {
                scratch.fill(l, inputs)?;
                for (index, layer) in network.layers.iter().enumerate() {
                    interrupt.check()?;
                    scratch.make(l, layer, index)?;
                }
                let made = scratch.numbers[network.layers.len() % 2].numbers();
                for (lane, answer) in out.iter_mut().enumerate() {
                    *answer = std::array::from_fn(|number| made[number * L::LANES + lane]);
                }
            }
            Ok(())
        });
        SCRATCH.trim();
        found
    }
}

/// Columns and rows of the input with the zeros around it that the first kernel reaches.
const PADDED: (usize, usize) = (INPUT.0 + KERNELS[0] - 2, INPUT.1 + KERNELS[0] - 2);

impl Scratch {
    /// Zeros, and in them the inputs, each in a lane of its own.
    fn fill<L: Lane>(&mut self, _: L, inputs: &[f32]) -> Result<()> {
        let to = self.numbers[0].zeros(PADDED.0 * PADDED.1 * L::LANES)?;
        for (lane, input) in inputs.chunks_exact(INPUT.0 * INPUT.1).enumerate() {
            let rows = to.chunks_exact_mut(PADDED.0 * L::LANES).skip(KERNELS[0] / 2);
            for (from, to) in input.chunks_exact(INPUT.0).zip(rows) {
                let to = to[KERNELS[0] / 2 * L::LANES + lane..].iter_mut().step_by(L::LANES);
                to.zip(from).for_each(|(to, &from)| *to = from);
            }
        }
        Ok(())
    }

    /// Makes the output of a layer of that of the one before it.
    fn make<L: Lane>(&mut self, l: L, layer: &Layer, index: usize) -> Result<()> {
        let [even, odd] = &mut self.numbers;
        let (from, to) = if index.is_multiple_of(2) { (even, odd) } else { (odd, even) };
        let (width, height) = layer.padded();
        to.zeros(width * height * layer.outputs * L::LANES)?;
        let (from, to) = (from.numbers(), to.reserve(0)?.cast());
        // SAFETY: the output has room for all that the layer makes, and is no part of its input.
        unsafe { Make::new(layer, from, to) }.on(l);
        Ok(())
    }
}
