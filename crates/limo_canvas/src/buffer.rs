//! The nearest of the solids of one object, in every pixel of a window of the image.

use std::collections::TryReserveError;

use multiversion::multiversion;

use super::solids::Solid;

/// First column, first row, last column + 1, last row + 1.
pub type Window = [usize; 4];

/// Steps of a palette from black to the full colour.
const LEVELS: f32 = 128.0;

/// One object of several solids: what of it is nearest in every pixel.
///
/// Solids are cast half a pixel too wide, and `cover` falls from 1 to 0 over the last pixel: the edges come out smooth.
#[derive(Default)]
pub struct Canvas {
    window: Window,
    /// Of the nearest solid [m]; infinite where there is none.
    depth: Vec<f32>,
    /// How much of a pixel is covered: its depth inside the silhouette [px].
    cover: Vec<f32>,
    /// Number of the solid × `TONES` + brightness.
    tone: Vec<f32>,
}

/// How much of an object is seen, and the box of its silhouette.
pub struct Seen {
    /// Pixels of the silhouette.
    pub inside: usize,
    /// Those where nothing is nearer.
    pub visible: usize,
    /// Its box in the image; nothing where there is no such pixel.
    pub bounds: Option<Window>,
}

impl Canvas {
    /// Empties the canvas, over another window.
    ///
    /// # Errors
    ///
    /// Where there is no memory for it.
    pub fn begin(&mut self, window: Window) -> Result<(), TryReserveError> {
        self.window = window;
        let len = self.width() * (window[3] - window[1]);
        for (list, empty) in [(&mut self.depth, f32::INFINITY), (&mut self.cover, 0.0), (&mut self.tone, 0.0)]
        {
            list.clear();
            list.try_reserve_exact(len)?;
            list.resize(len, empty);
        }
        Ok(())
    }

    /// Keeps of `solid` what is nearer than the solids before.
    pub fn cast(&mut self, solid: &impl Solid) {
        cast(self, solid);
    }

    fn width(&self) -> usize {
        self.window[2] - self.window[0]
    }

    /// The canvas's rows, each with the first of its pixels in an image that is `stride` wide.
    fn rows(&self, stride: usize) -> impl Iterator<Item = (std::ops::Range<usize>, usize)> {
        let ([left, top, _, bottom], width) = (self.window, self.width());
        (top..bottom).map(move |row| ((row - top) * width..(row - top + 1) * width, row * stride + left))
    }

    /// Draws the object into an image of `stride` columns wherever it is nearer than `depth`; gives the number of its
    /// pixels, seen or not.
    ///
    /// `owners` says of every pixel whose it is, and is told that these belong to the number beside it.
    pub fn draw(
        &self,
        stride: usize,
        mut image: Option<(&mut [u32], &[u32])>,
        depth: &mut [f32],
        mut owners: Option<(&mut [i16], i16)>,
    ) -> usize {
        let (mut inside, width) = (0, self.width());
        for (row, first) in self.rows(stride) {
            let (new, cover, tone) = (&self.depth[row.clone()], &self.cover[row.clone()], &self.tone[row]);
            let there = &mut depth[first..first + width];
            let mut image =
                image.as_mut().map(|(image, palette)| (&mut image[first..first + width], *palette));
            let mut owners =
                owners.as_mut().map(|(owners, owner)| (&mut owners[first..first + width], *owner));
            inside += cover.iter().filter(|&&cover| cover >= 0.5).count();
            for (x, (((there, &new), &cover), &tone)) in
                there.iter_mut().zip(new).zip(cover).zip(tone).enumerate()
            {
                if new >= *there {
                    continue;
                }
                if let Some((image, palette)) = image.as_mut().filter(|_| cover > 0.0) {
                    let place = ((tone * LEVELS) as i32).clamp(0, palette.len() as i32 - 1);
                    let colour = palette[place as usize];
                    image[x] = if cover >= 1.0 { colour } else { mixed(colour, image[x], cover) };
                }
                if cover >= 0.5 {
                    *there = new;
                    if let Some((owners, owner)) = owners.as_mut() {
                        owners[x] = *owner;
                    }
                }
            }
        }
        inside
    }

    /// Compares the object with the depth of an image of `stride` columns in which it has been drawn.
    pub fn seen(&self, stride: usize, depth: &[f32]) -> Seen {
        let left = self.window[0];
        let mut seen = Seen { inside: 0, visible: 0, bounds: None };
        for (row, first) in self.rows(stride) {
            let y = first / stride;
            for (x, at) in row.enumerate().filter(|&(_, at)| self.cover[at] >= 0.5) {
                seen.inside += 1;
                seen.visible += usize::from(self.depth[at].is_finite() && self.depth[at] <= depth[first + x]);
                let [x0, y0, x1, y1] = seen.bounds.unwrap_or([left + x, y, 0, 0]);
                seen.bounds = Some([x0.min(left + x), y0, x1.max(left + x + 1), y1.max(y + 1)]);
            }
        }
        seen
    }
}

/// A share of one colour over another, byte by byte, as OpenCV's `blendLinear` rounds it.
fn mixed(over: u32, under: u32, share: f32) -> u32 {
    let rest = 1.0 - share;
    let whole = share + rest + 1e-5;
    let (over, under) = (over.to_ne_bytes(), under.to_ne_bytes());
    u32::from_ne_bytes(std::array::from_fn(|channel| {
        let sum = f32::from(over[channel]) * share + f32::from(under[channel]) * rest;
        (sum / whole).round_ties_even() as u8
    }))
}

/// All rays of a canvas at one solid, compiled for the vectors that the CPU has.
#[multiversion(targets("x86_64+avx2+fma"))]
fn cast<S: Solid>(canvas: &mut Canvas, solid: &S) {
    let ([x0, y0, ..], width) = (canvas.window, canvas.width());
    let height = canvas.window[3] - y0;
    let [left, top, right, bottom] = solid.bounds();
    let (columns, rows) = (span(left, right, x0, width), span(top, bottom, y0, height));
    if columns.is_empty() {
        return;
    }
    for row in rows {
        let at = row * width + columns.start..row * width + columns.end;
        let y = (y0 + row) as f32;
        let (depth, cover) = (&mut canvas.depth[at.clone()], &mut canvas.cover[at.clone()]);
        let tone = &mut canvas.tone[at];
        for (n, ((depth, cover), tone)) in depth.iter_mut().zip(cover).zip(tone).enumerate() {
            let hit = solid.cast((x0 + columns.start + n) as i32 as f32, y);
            let wins = hit.is_hit & (hit.depth < *depth);
            *depth = if wins { hit.depth } else { *depth };
            *tone = if wins { hit.tone } else { *tone };
            *cover = if hit.cover > *cover { hit.cover } else { *cover };
        }
    }
}

/// The pixels from `low` to `high` of `len` that begin at `origin`, counted from there.
fn span(low: f64, high: f64, origin: usize, len: usize) -> std::ops::Range<usize> {
    let origin = origin as f64;
    let end = ((high - origin).ceil() as i64).saturating_add(1).clamp(0, len as i64);
    let start = ((low - origin).floor() as i64).clamp(0, end);
    start as usize..end as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solids::Hit;

    /// A wall that fills every ray.
    struct Wall {
        depth: f32,
        cover: f32,
    }

    impl Solid for Wall {
        fn bounds(&self) -> [f64; 4] {
            [-1e300, f64::NEG_INFINITY, 1e300, f64::INFINITY]
        }

        fn cast(&self, _: f32, _: f32) -> Hit {
            Hit { depth: self.depth, is_hit: true, cover: self.cover, tone: 1.0 }
        }
    }

    fn drawn(wall: &Wall, behind: f32) -> (u32, f32, i16) {
        let mut canvas = Canvas::default();
        assert!(canvas.begin([1, 1, 2, 2]).is_ok());
        canvas.cast(wall);
        let palette = vec![0x00FF_0000; 512];
        let (mut image, mut depth, mut owners) = ([0x0000_FF00_u32; 4], [behind; 4], [-1_i16; 4]);
        canvas.draw(2, Some((&mut image, &palette)), &mut depth, Some((&mut owners, 7)));
        assert_eq!(
            (image[0], depth[2], owners[1]),
            (0x0000_FF00, behind, -1),
            "pixels outside the window changed"
        );
        (image[3], depth[3], owners[3])
    }

    #[test]
    fn what_is_nearer_replaces_what_is_there_and_what_is_farther_does_not() {
        assert_eq!(drawn(&Wall { depth: 2.0, cover: 1.0 }, 3.0), (0x00FF_0000, 2.0, 7));
        assert_eq!(drawn(&Wall { depth: 3.0, cover: 1.0 }, 3.0), (0x0000_FF00, 3.0, -1));
        assert_eq!(
            drawn(&Wall { depth: f32::NAN, cover: 1.0 }, f32::INFINITY),
            (0x0000_FF00, f32::INFINITY, -1)
        );
    }

    #[test]
    fn the_edge_is_mixed_and_belongs_to_the_object_from_half_a_pixel_on() {
        assert_eq!(drawn(&Wall { depth: 2.0, cover: 0.75 }, 3.0), (0x00BF_4000, 2.0, 7));
        assert_eq!(drawn(&Wall { depth: 2.0, cover: 0.25 }, 3.0), (0x0040_BF00, 3.0, -1));
        assert_eq!(drawn(&Wall { depth: 2.0, cover: 0.0 }, 3.0), (0x0000_FF00, 3.0, -1));
    }

    #[test]
    fn a_span_ends_at_the_window_whatever_its_bounds() {
        assert_eq!(span(-1e300, 1e300, 5, 10), 0..10);
        assert_eq!(span(7.5, 8.5, 5, 10), 2..5);
        assert_eq!(span(20.0, 30.0, 5, 10), 10..10);
        assert!(span(f64::NAN, f64::NAN, 5, 10).len() < 2);
    }
}
