//! Pictures of solids for the arena's camera: a z-buffer over a window of the image, and how it goes into the image.
//!
//! Compiled, because numpy takes some
//! thirty passes over the pixels of each solid, and a person has 23 of them. Every sum is in the order, and rounded to
//! the single precision, of the numpy code that drew the arena's first pictures: they stay the same to the last bit.
//!
//! `solids` casts rays, `buffer` keeps what is nearest and draws it, `floor` draws the shadows.

mod buffer;
mod floor;
mod solids;

pub use buffer::{Canvas, Window};
pub use floor::{Room, Shadow};
pub use solids::{Ellipse, Frustum, Pinhole, Slab, Solid, Strip, Sun};
