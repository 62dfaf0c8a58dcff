//! The solids: capsules as rounded strips, ellipsoids as ellipses, upright frusta, upright boxes.
//!
//! A strip and an ellipse are cast in parallel projections of their own, frusta and boxes in exact perspective.

/// Brightness stays below this, so that a solid's number and its brightness fit in one value.
pub const TONES: f64 = 4.0;
/// Nothing nearer than this is drawn [m].
const NEAR: f32 = 0.08;
/// A capsule whose axis leans less than this [sine] is cast as if it lay in the image plane.
const UPRIGHT: f64 = 0.2;

/// What one ray meets of a solid.
pub struct Hit {
    /// Along the optical axis [m].
    pub depth: f32,
    /// Whether there is a depth.
    pub is_hit: bool,
    pub cover: f32,
    pub tone: f32,
}

/// A solid as the camera sees it, ready to be cast.
pub trait Solid {
    /// Left, top, right, bottom [px].
    fn bounds(&self) -> [f64; 4];
    /// `x`, `y`: the pixel. Must be `#[inline(always)]`.
    fn cast(&self, x: f32, y: f32) -> Hit;
}

/// The lesser of two numbers; where one of them is none, so is the result.
#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b || a.is_nan() { a } else { b }
}

/// Towards the sun (x right, y down, z forward, unit length), and the brightness of a surface: base + gain × cosine.
#[derive(Clone, Copy)]
pub struct Sun {
    /// Unit vector.
    pub towards: [f64; 3],
    /// Brightness where the light comes from the side.
    pub base: f64,
    /// What full light adds.
    pub gain: f64,
}

impl From<[f64; 5]> for Sun {
    fn from([x, y, z, base, gain]: [f64; 5]) -> Self {
        Self { towards: [x, y, z], base, gain }
    }
}

impl Sun {
    /// The part of a tone that is the same all over a solid.
    fn base_of(&self, part: f64) -> f32 {
        (TONES * part + self.base) as f32
    }
}

/// A parallel projection, in which a strip and an ellipse are balls: the pixel of its origin, the light in its axes.
struct Parallel {
    bounds: [f64; 4],
    u: f32,
    v: f32,
    sun: [f32; 3],
    base: f32,
}

impl Parallel {
    /// `towards`: to the sun along the projection's x and y, and away from the camera.
    fn new(bounds: [f64; 4], [part, u, v]: [f64; 3], sun: &Sun, towards: [f64; 3]) -> Self {
        let sun_along = towards.map(|along| (sun.gain * along) as f32);
        Self { bounds, u: u as f32, v: v as f32, sun: sun_along, base: sun.base_of(part) }
    }

    /// From the origin to a pixel [px].
    #[inline(always)]
    fn offset(&self, x: f32, y: f32) -> (f32, f32) {
        (x - self.u, y - self.v)
    }

    /// How much of the light falls on a ball's surface at x and y, `root` in front of its centre; per unit of its radius.
    #[inline(always)]
    fn facing(&self, x: f32, y: f32, root: f32) -> f32 {
        self.sun[0] * x + self.sun[1] * y - self.sun[2] * root
    }
}

/// A tapered capsule.
pub struct Strip {
    projection: Parallel,
    axis_u: f32,
    axis_v: f32,
    length: f32,
    radius: f32,
    taper: f32,
    near: f32,
    slope: f32,
    metre: f32,
    lean: f32,
    leans: bool,
    per_width: f32,
}

impl Strip {
    /// `row`: part, u, v, axis u, axis v, length, radius [px], taper, depth [m], depth per px, m per px, sine of the
    /// angle between axis and image.
    pub fn new(row: [f64; 12], sun: &Sun) -> Self {
        let [part, u, v, axis_u, axis_v, length, radius, taper, near, slope, metre, lean] = row;
        let (end_u, end_v, end_radius) = (u + axis_u * length, v + axis_v * length, radius + taper * length);
        let [x, y, z] = sun.towards;
        let bounds = [
            (u - radius).min(end_u - end_radius),
            (v - radius).min(end_v - end_radius),
            (u + radius).max(end_u + end_radius),
            (v + radius).max(end_v + end_radius),
        ];
        let towards = [x * axis_u + y * axis_v, y * axis_u - x * axis_v, z];
        Self {
            projection: Parallel::new(bounds, [part, u, v], sun, towards),
            axis_u: axis_u as f32,
            axis_v: axis_v as f32,
            length: length as f32,
            radius: radius as f32,
            taper: taper as f32,
            near: near as f32,
            slope: slope as f32,
            metre: metre as f32,
            lean: lean as f32,
            leans: lean.abs() > UPRIGHT,
            per_width: (1.0 / (radius + end_radius)) as f32,
        }
    }
}

impl Solid for Strip {
    fn bounds(&self) -> [f64; 4] {
        self.projection.bounds
    }

    #[inline(always)]
    fn cast(&self, x: f32, y: f32) -> Hit {
        let (dx, dy) = self.projection.offset(x, y);
        let along = self.axis_u * dx + self.axis_v * dy;
        let across = self.axis_u * dy - self.axis_v * dx;
        let mut on_axis = along.max(0.0).min(self.length);
        let radii = self.taper * on_axis + self.radius;
        let mut beyond = along - on_axis;
        let room = radii * radii - across * across;
        let inner = room - beyond * beyond;
        let mut root = inner.sqrt();
        if self.leans {
            // the ray meets a leaning capsule first in a ball that is not the one beneath the pixel
            on_axis = (along - self.lean * root).max(0.0).min(self.length);
            beyond = along - on_axis;
            root = (room - beyond * beyond).max(0.0).sqrt();
        }
        let depth = self.slope * on_axis + self.near - self.metre * root;
        let facing = self.projection.facing(beyond, across, root);
        Hit {
            depth,
            is_hit: inner >= 0.0,
            cover: inner * self.per_width,
            tone: facing / radii + self.projection.base,
        }
    }
}

/// An ellipsoid.
pub struct Ellipse {
    projection: Parallel,
    whitening: [f32; 3],
    per_size: f32,
    centre: f32,
    slope_x: f32,
    slope_y: f32,
    bulge: f32,
}

impl Ellipse {
    /// `row`: part, u, v, the three entries of the lower-triangular whitening matrix, half height and half width [px],
    /// depth [m], depth per canonical x and y, bulge [m].
    pub fn new(row: [f64; 12], sun: &Sun) -> Self {
        let [part, u, v, w00, w10, w11, half_h, half_w, centre, slope_x, slope_y, bulge] = row;
        let bounds = [u - half_w, v - half_h, u + half_w, v + half_h];
        Self {
            projection: Parallel::new(bounds, [part, u, v], sun, sun.towards),
            whitening: [w00 as f32, w10 as f32, w11 as f32],
            per_size: (0.25 * (half_w + half_h)) as f32,
            centre: centre as f32,
            slope_x: slope_x as f32,
            slope_y: slope_y as f32,
            bulge: bulge as f32,
        }
    }
}

impl Solid for Ellipse {
    fn bounds(&self) -> [f64; 4] {
        self.projection.bounds
    }

    #[inline(always)]
    fn cast(&self, x: f32, y: f32) -> Hit {
        let (dx, dy) = self.projection.offset(x, y);
        let [w00, w10, w11] = self.whitening;
        let x = w00 * dx;
        let y = w10 * dx + w11 * dy;
        let inner = 1.0 - x * x - y * y;
        let root = inner.sqrt();
        let depth = self.slope_x * x + self.centre + self.slope_y * y - self.bulge * root;
        let tone = self.projection.facing(x, y, root) + self.projection.base;
        Hit { depth, is_hit: inner >= 0.0, cover: inner * self.per_size, tone }
    }
}

/// Pixels to directions: the camera's focal length and principal point [px].
#[derive(Clone, Copy)]
pub struct Pinhole {
    /// Focal length [px].
    pub focal: f32,
    /// Principal point [px].
    pub centre: [f32; 2],
}

impl Pinhole {
    /// The ray through a pixel: to the right and down, per unit ahead.
    #[inline(always)]
    fn ray(&self, x: f32, y: f32) -> (f32, f32) {
        ((x - self.centre[0]) / self.focal, (y - self.centre[1]) / self.focal)
    }
}

/// An upright cone or cylinder.
pub struct Frustum {
    bounds: [f64; 4],
    pinhole: Pinhole,
    x: f32,
    z: f32,
    taper: f32,
    level: f32,
    half_pixel: f32,
    offset: f32,
    above: f32,
    below: f32,
    sun: [f32; 3],
    base: f32,
}

impl Frustum {
    /// `row`: part, left, top, right, bottom [px], how far to the right and ahead the axis is, radius per metre of
    /// height, radius at the camera's height, half a pixel at the axis, x² + z² - radius² there [m²], top and foot
    /// above and below the camera [m].
    pub fn new(row: [f64; 13], sun: &Sun, pinhole: Pinhole) -> Self {
        let [part, left, top, right, bottom, x, z, taper, level, half_pixel, offset, above, below] = row;
        Self {
            bounds: [left, top, right, bottom],
            pinhole,
            x: x as f32,
            z: z as f32,
            taper: taper as f32,
            level: level as f32,
            half_pixel: half_pixel as f32,
            offset: offset as f32,
            above: above as f32,
            below: below as f32,
            sun: [sun.gain as f32, sun.towards[0] as f32, sun.towards[2] as f32],
            base: sun.base_of(part),
        }
    }
}

impl Solid for Frustum {
    fn bounds(&self) -> [f64; 4] {
        self.bounds
    }

    #[inline(always)]
    fn cast(&self, x: f32, y: f32) -> Hit {
        let (focal, (right, down)) = (self.pinhole.focal, self.pinhole.ray(x, y));
        let lift = self.taper * down;
        let a = right * right + (1.0 - lift * lift);
        let b = right * self.x + (self.z - self.level * lift);
        let discriminant = b * b - a * self.offset;
        let ball = (b - discriminant.sqrt()) / a;
        let radii = self.level - lift * ball;
        let depth = ball + self.half_pixel;
        let pixels = focal / depth;
        let side = 0.5 * pixels * discriminant / (a * radii);
        let cover = least(side, self.above * pixels + (focal * down + 0.5));
        let cover = least(cover, self.below * pixels + (0.5 - focal * down));
        let [gain, sun_x, sun_z] = self.sun;
        let facing = sun_x * (right * depth - self.x) + sun_z * (depth - self.z);
        Hit { depth, is_hit: (cover > 0.0) & (depth > NEAR), cover, tone: gain / radii * facing + self.base }
    }
}

/// An upright box.
pub struct Slab {
    bounds: [f64; 4],
    pinhole: Pinhole,
    /// Per axis of the box: where the near and the far side are, and the direction of the ray: a constant, and per
    /// unit to the right.
    sides: [[f32; 2]; 3],
    directions: [[f32; 2]; 2],
    tones: [f32; 3],
}

impl Slab {
    /// `row`: left, top, right, bottom [px]; per axis of the box where its two sides are, seen from the camera [m];
    /// for the two level axes the part of the optical axis along them, and that of the image's rows; the tone of the
    /// face across each axis.
    pub fn new(row: [f64; 17], pinhole: Pinhole) -> Self {
        let row32 = row.map(|value| value as f32);
        let [.., a, b, c, d, e, f, g, h, i, j, k, l, m] = row32;
        Self {
            bounds: [row[0], row[1], row[2], row[3]],
            pinhole,
            sides: [[a, b], [c, d], [e, f]],
            directions: [[g, h], [i, j]],
            tones: [k, l, m],
        }
    }

    /// Where a ray enters and leaves the layer between two sides.
    #[inline(always)]
    fn layer([one, other]: [f32; 2], direction: f32) -> [f32; 2] {
        let inverse = 1.0 / if direction.abs() < 1e-9 { 1e-9 } else { direction };
        let (one, other) = (one * inverse, other * inverse);
        [one.min(other), one.max(other)]
    }
}

impl Solid for Slab {
    fn bounds(&self) -> [f64; 4] {
        self.bounds
    }

    #[inline(always)]
    fn cast(&self, x: f32, y: f32) -> Hit {
        let (right, down) = self.pinhole.ray(x, y);
        let [[to_x, turn_x], [to_y, turn_y]] = self.directions;
        let [in_x, out_x] = Self::layer(self.sides[0], to_x + turn_x * right);
        let [in_y, out_y] = Self::layer(self.sides[1], to_y + turn_y * right);
        let [in_z, out_z] = Self::layer(self.sides[2], -down);
        let in_side = in_x.max(in_y);
        let depth = in_side.max(in_z);
        let is_hit = (depth < out_x.min(out_y).min(out_z)) & (depth > NEAR);
        let side = if in_x > in_y { self.tones[0] } else { self.tones[1] };
        let tone = if in_z > in_side { self.tones[2] } else { side };
        Hit { depth, is_hit, cover: f32::from(u8::from(is_hit)), tone }
    }
}
