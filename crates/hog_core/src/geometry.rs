//! Sizes, rectangles and parts of an image.

/// Width and height \[px\] (or a stride or padding along x and y).
///
/// ```
/// use hog_core::Size;
/// assert_eq!(Size::new(64, 128).area(), 8192);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Size {
    /// Along x.
    pub width: usize,
    /// Along y.
    pub height: usize,
}

impl Size {
    /// A size of `width` by `height`.
    pub const fn new(width: usize, height: usize) -> Self {
        Self { width, height }
    }

    /// Width times height.
    pub const fn area(self) -> usize {
        self.width * self.height
    }
}

/// A rectangle \[px\]: top left corner and size.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Rect {
    /// Left edge.
    pub x: i32,
    /// Upper edge.
    pub y: i32,
    /// Columns.
    pub width: i32,
    /// Rows.
    pub height: i32,
}

/// A part of the padded image, in padded coordinates: image pixel (x, y) is at (x + left, y + top).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Region {
    /// First column.
    pub x: usize,
    /// First row.
    pub y: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// How far the padded image reaches beyond the image \[px\]; may be negative (a crop).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Padding {
    /// Columns before the first.
    pub left: i64,
    /// Rows before the first.
    pub top: i64,
    /// Columns and rows of the padded image.
    pub size: Size,
}
