//! Descriptors of crops, each of which is one window: as many side by side as a vector has room for.
//!
//! ```text
//! Fill:         rows of the crops side by side in each channel's plane, a mirrored row above and below
//! strips:       as of a level, `ends` naming the first and last cell of each crop, where columns are mirrored
//! descriptors:  [block row][element][lane] → [crop][block column][block row][element]
//! ```
//!
//! A row of a plane, of which there are two more than a crop has; lane x of a row of blocks begins at cell x of it:
//!
//! ```text
//! | LEFT | crop 0 | crop 1 | … | up to 16 cells | OVERREAD | up to a multiple of 64 |
//! ```
//!
//! A crop of 64 × 128 fills half a vector of 16: two side by side cost what one does.

use crate::error::Result;
use crate::geometry::Size;
use crate::interrupt::Interrupt;
use crate::memory::{self, Pool, Workspace};

use super::backend::Backend;
use super::dispatch::{OnLane, on_lane};
use super::lane::{Kernel, Lane};
use super::layout::{BLOCK, CARRY, CELL, OVERREAD, WORDS};
use super::plan::Geometry;
use super::strip::{Job, ROOM, strip};
use super::tile::Lines;

/// Scratch memory, one per thread at work.
static SCRATCH: Pool<Scratch> = Pool::new();

/// Bytes before the first pixel of a row: the strips read one, a vector of pixels is aligned.
const LEFT: usize = 64;

/// Crops of one size.
#[derive(Clone, Copy)]
pub(crate) struct Crops<'a> {
    /// Rows of interleaved pixels, without gaps, crop after crop.
    pub pixels: &'a [u8],
    pub size: Size,
    pub channels: usize,
}

#[derive(Debug, Default)]
struct Scratch {
    pixels: Vec<u8>,
    carry: Lines,
    room: Lines,
    blocks: Lines,
    bytes: Lines,
    edge: Vec<[f32; BLOCK]>,
    ends: [Vec<f32>; 2],
}

impl Workspace for Scratch {
    fn bytes(&self) -> usize {
        let lines = [&self.carry, &self.room, &self.blocks, &self.bytes];
        self.pixels.capacity() + lines.iter().map(|lines| lines.bytes()).sum::<usize>()
    }
}

/// Writes the descriptors of `crops`, one after the other, into `out`, which has room for them.
pub(crate) fn describe(
    backend: Backend,
    geometry: &Geometry,
    crops: Crops,
    interrupt: &Interrupt,
    out: &mut [f32],
) -> Result<()> {
    on_lane(backend, Describe { geometry, crops, interrupt, out })
}

struct Describe<'a> {
    geometry: &'a Geometry,
    crops: Crops<'a>,
    interrupt: &'a Interrupt<'a>,
    out: &'a mut [f32],
}

impl OnLane for Describe<'_> {
    type Output = Result<()>;

    fn run<L: Lane>(self, l: L) -> Result<()> {
        let Self { geometry, crops, interrupt, out } = self;
        let Size { width, height } = crops.size;
        let cells = width / CELL;
        let abreast = (L::LANES / cells).max(1);
        let crop_bytes = width * height * crops.channels;
        let descriptor = geometry.blocks.width * geometry.blocks.height * BLOCK;
        let groups = crops.pixels.chunks(abreast * crop_bytes).zip(out.chunks_mut(abreast * descriptor));
        let found = SCRATCH.with(|scratch| {
            scratch.prepare(l, geometry, crops, abreast)?;
            for (pixels, out) in groups {
                interrupt.check()?;
                // The last group may be smaller: a lone crop fits a narrow vector.
                let abreast = pixels.len() / crop_bytes;
                scratch.blocks_of(l, geometry, Crops { pixels, ..crops }, abreast)?;
                scratch.descriptors(geometry, cells, abreast, out);
            }
            Ok(())
        });
        SCRATCH.trim();
        found
    }
}

impl Scratch {
    /// Lanes of a row of blocks.
    fn lanes(cells: usize, abreast: usize) -> usize {
        (cells * abreast).next_multiple_of(16)
    }

    fn plane(cells: usize, abreast: usize) -> usize {
        (LEFT + CELL * Self::lanes(cells, abreast) + OVERREAD).next_multiple_of(64)
    }

    /// Makes room for groups of `abreast` crops.
    fn prepare<L: Lane>(&mut self, _: L, geometry: &Geometry, crops: Crops, abreast: usize) -> Result<()> {
        let cells = crops.size.width / CELL;
        let lanes = Self::lanes(cells, abreast);
        let rows = geometry.blocks.height;
        let bytes = (crops.size.height + 2) * crops.channels * Self::plane(cells, abreast);
        let missing = bytes.max(self.pixels.len());
        memory::resize(&mut self.pixels, missing, 0)?;
        self.blocks.reserve(rows * BLOCK * lanes + 64)?;
        self.bytes.reserve(rows * WORDS * lanes + 64)?;
        self.carry.reserve((cells * abreast).div_ceil(L::LANES) * CARRY * L::LANES)?;
        self.room.reserve(ROOM * L::LANES)?;
        for (last, ends) in self.ends.iter_mut().enumerate() {
            ends.clear();
            let is_end = |cell: usize| (cell + last).is_multiple_of(cells);
            memory::extend(ends, (0..lanes + 16).map(|cell| f32::from(u8::from(is_end(cell)))))?;
        }
        Ok(())
    }

    /// Makes the blocks of crops side by side.
    fn blocks_of<L: Lane>(&mut self, l: L, geometry: &Geometry, crops: Crops, abreast: usize) -> Result<()> {
        let Size { width, height } = crops.size;
        let cells = width / CELL;
        let (lanes, plane) = (Self::lanes(cells, abreast), Self::plane(cells, abreast));
        let stride = plane * crops.channels;
        // (Bytes are split into planes by shuffles of 16.)
        l.narrow().compiled(Fill { crops, stride, plane, to: &mut self.pixels });
        self.edge.clear();
        memory::resize(&mut self.edge, geometry.blocks.height, [0.0; BLOCK])?;
        let origin = std::array::from_fn(|channel| {
            self.pixels[channel.min(crops.channels - 1) * plane + LEFT..].as_ptr()
        });
        let mut job = Job {
            geometry,
            origin,
            stride,
            cells: 0..height / CELL,
            top: 0,
            carried: false,
            carry: self.carry.reserve(0)?.cast(),
            room: self.room.reserve(0)?.cast(),
            blocks: self.blocks.reserve(0)?.cast(),
            bytes: self.bytes.reserve(0)?,
            lanes,
            ends: Some([&self.ends[0], &self.ends[1]]),
            edge: &mut self.edge,
        };
        let all = cells * abreast;
        let rest = all % L::LANES;
        let mut end = all - rest;
        // SAFETY: `prepare` has made room for all of this.
        unsafe {
            if rest > L::Narrow::LANES {
                strip(l, &mut job, end, crops.channels);
            } else if rest > 0 {
                strip(l.narrow(), &mut job, end, crops.channels);
            }
            while end > 0 {
                end -= L::LANES;
                strip(l, &mut job, end, crops.channels);
            }
        }
        Ok(())
    }

    /// Writes the descriptors of the crops whose blocks were made: blocks column by column.
    fn descriptors(&self, geometry: &Geometry, cells: usize, abreast: usize, out: &mut [f32]) {
        let Size { width, height } = geometry.blocks;
        let lanes = Self::lanes(cells, abreast);
        let blocks = self.blocks.numbers();
        for (crop, out) in out.chunks_exact_mut(width * height * BLOCK).enumerate() {
            let out = out.as_chunks_mut::<BLOCK>().0;
            for (y, row) in blocks.chunks_exact(BLOCK * lanes).take(height).enumerate() {
                for x in 0..width {
                    let from = row[crop * cells + x..].iter().step_by(lanes);
                    for (to, from) in out[x * height + y].iter_mut().zip(from) {
                        *to = *from;
                    }
                }
            }
        }
    }
}

/// Lays the rows of crops side by side, one row more above and below, mirrored.
struct Fill<'a> {
    crops: Crops<'a>,
    stride: usize,
    plane: usize,
    to: &'a mut [u8],
}

impl Kernel for Fill<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lane>(self, l: L) {
        let Self { crops, stride, plane, to } = self;
        let Size { width, height } = crops.size;
        let row = width * crops.channels;
        for (index, crop) in crops.pixels.chunks_exact(row * height).enumerate() {
            let at = LEFT + index * width;
            for (y, to) in to.chunks_exact_mut(stride).take(height + 2).enumerate() {
                // Height is at least 16.
                let y = if y == 0 {
                    1
                } else if y > height {
                    height - 2
                } else {
                    y - 1
                };
                let from = &crop[y * row..][..row];
                if crops.channels == 1 {
                    to[at..][..width].copy_from_slice(from);
                } else {
                    let planes = [0, 1, 2].map(|channel| to[channel * plane + at..][..width].as_mut_ptr());
                    // SAFETY: a row of the crop and of each plane has `width` pixels.
                    unsafe { l.deinterleave::<0>(from.as_ptr(), planes, width) };
                }
            }
        }
    }
}
