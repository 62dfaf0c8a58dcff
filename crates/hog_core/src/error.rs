//! How calls fail: closed enums with the numbers that came, one enum per exception of Python.

use thiserror::Error;

use crate::geometry::Size;

/// Every way in which a call can fail: its input is refused, its memory cannot be had, or its caller ends it.
///
/// ```
/// use hog_core::error::ImageError;
/// use hog_core::{HogError, ImageView};
/// let refused = ImageView::new(&[0; 8], 2, 2, 2, 4).unwrap_err();
/// assert_eq!(refused, HogError::Image(ImageError::Channels { got: 2 }));
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum HogError {
    /// Window, block, stride and cell sizes do not fit together.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
    /// The number of the linear SVM's coefficients is neither that of the descriptor's elements nor one more (the bias).
    #[error("the detector has {got} coefficients; this geometry needs {wanted} or {} (with bias last)", wanted + 1)]
    DetectorSize {
        /// How many coefficients came.
        got: usize,
        /// How many elements a window's descriptor has.
        wanted: usize,
    },
    /// The image is not one this detector can read.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A search parameter lies outside its range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The forced instruction set is unknown, or this CPU does not have it.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// The weights are those of no network.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// The memory that the arguments ask for cannot be had.
    #[error(
        "{bytes} bytes of memory are wanted, and cannot be had; use a smaller image, padding or geometry"
    )]
    Memory {
        /// Bytes of the list that did not fit.
        bytes: usize,
    },
    /// The caller ended the call.
    #[error("the call was interrupted")]
    Interrupted,
}

/// A geometry that [`HogSpec`](crate::HogSpec) refuses.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum GeometryError {
    /// A size is not positive, or too large.
    #[error("{name} is ({x}, {y}); both sides must be 1 to {most} pixels")]
    Side {
        /// The argument, in OpenCV's words.
        name: &'static str,
        /// Side along x \[px\].
        x: i64,
        /// Side along y \[px\].
        y: i64,
        /// The largest side allowed \[px\].
        most: i64,
    },
    /// The number of orientation bins is out of range.
    #[error("nbins is {got}; it must be 1 to 256")]
    Bins {
        /// How many bins were asked for.
        got: i64,
    },
    /// The block does not hold a whole number of cells.
    #[error("blockSize ({}, {}) must be a multiple of cellSize ({}, {})", block.width, block.height, cell.width, cell.height)]
    Cells {
        /// Block \[px\].
        block: Size,
        /// Cell \[px\].
        cell: Size,
    },
    /// The number of levels is not positive.
    #[error("nlevels is {got}; it must be at least 1")]
    Levels {
        /// How many levels were asked for.
        got: i64,
    },
    /// The window does not hold a whole number of block strides beyond its first block.
    #[error("window {axis} {window} minus block {axis} {block} must be a multiple of block stride {stride}")]
    Stride {
        /// "width" or "height".
        axis: &'static str,
        /// Window along the axis \[px\].
        window: usize,
        /// Block along the axis \[px\].
        block: usize,
        /// Block stride along the axis \[px\].
        stride: usize,
    },
    /// A descriptor has more elements than an array of OpenCV can hold.
    #[error("a window's descriptor would have {elements} elements")]
    DescriptorLength {
        /// Elements of one window.
        elements: usize,
    },
}

/// An image that [`ImageView`](crate::ImageView) refuses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum ImageError {
    /// An array is neither rows and columns, nor rows, columns and channels.
    #[error("an image has 2 or 3 dimensions, this array has {got}")]
    Dimensions {
        /// Dimensions of the array.
        got: usize,
    },
    /// Neither gray nor colour.
    #[error("the image has {got} channels; 1 or 3 are wanted")]
    Channels {
        /// Channels of the image.
        got: usize,
    },
    /// No pixels.
    #[error("the image is empty: {width} x {height} pixels")]
    Empty {
        /// Width \[px\].
        width: usize,
        /// Height \[px\].
        height: usize,
    },
    /// Coordinates would overflow.
    #[error("the image is too large: {width} x {height} pixels")]
    TooLarge {
        /// Width \[px\].
        width: usize,
        /// Height \[px\].
        height: usize,
    },
    /// The pixels leave the data.
    #[error(
        "{len} bytes with a row stride of {row_stride} do not hold {width} x {height} x {channels} pixels"
    )]
    Data {
        /// Bytes of data.
        len: usize,
        /// Bytes from row to row.
        row_stride: usize,
        /// Width \[px\].
        width: usize,
        /// Height \[px\].
        height: usize,
        /// Channels of the image.
        channels: usize,
    },
    /// A level without pixels.
    #[error("cannot resize to {width} x {height} pixels")]
    Resize {
        /// Wanted width \[px\].
        width: usize,
        /// Wanted height \[px\].
        height: usize,
    },
}

/// A search that cannot be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum ParameterError {
    /// The window stride does not move forward.
    #[error("winStride is ({x}, {y}); both must be 1 pixel or more")]
    WinStride {
        /// Stride along x \[px\].
        x: i64,
        /// Stride along y \[px\].
        y: i64,
    },
    /// More padding than allowed.
    #[error("padding is {got}; at most {most} pixels are allowed")]
    Padding {
        /// Padding along one axis \[px\].
        got: i64,
        /// The most allowed \[px\].
        most: i64,
    },
    /// A crop leaves no pixels, or a side overflows.
    #[error("the padded {axis} would be {got} pixels; at least 1 is wanted")]
    PaddedSide {
        /// "width" or "height".
        axis: &'static str,
        /// Side of the padded image \[px\].
        got: i64,
    },
    /// The padded image has more pixels than an array of OpenCV can hold.
    #[error("the padded image would have {width} x {height} pixels; at most 2^31 - 1 are allowed")]
    PaddedArea {
        /// Width of the padded image \[px\].
        width: usize,
        /// Height of the padded image \[px\].
        height: usize,
    },
    /// All descriptors together have more elements than an array of OpenCV can hold.
    #[error("{windows} windows of {elements} elements are too many for one array; use a larger winStride")]
    Descriptors {
        /// How many windows.
        windows: usize,
        /// Elements of the descriptor of each.
        elements: usize,
    },
    /// A window without area, far away, or far too large.
    #[error("a window is {x}, {y}, {width} x {height} px; sides above 0 and up to {most} px are wanted")]
    Window {
        /// Left edge \[px\].
        x: i64,
        /// Upper edge \[px\].
        y: i64,
        /// Width \[px\].
        width: i64,
        /// Height \[px\].
        height: i64,
        /// The longest side allowed \[px\].
        most: usize,
    },
    /// The number of threads does not fit its type.
    #[error("the number of threads is negative or far too large; 0 (one per core) to {most} are wanted")]
    Threads {
        /// The most that are ever used.
        most: usize,
    },
}

/// Numbers that make no network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum NetworkError {
    /// A layer has no channels, or too many.
    #[error("a layer of the network has {got} channels; 1 to {most} are wanted")]
    Channels {
        /// Channels of the layer.
        got: usize,
        /// The most allowed.
        most: usize,
    },
    /// There are other than the layers' weights and biases.
    #[error("the network has {got} weights; these layers need {wanted}")]
    Weights {
        /// How many numbers came.
        got: usize,
        /// How many the layers have.
        wanted: usize,
    },
    /// A weight is infinite or NaN.
    #[error("a weight of the network is infinite or NaN; finite numbers are wanted")]
    NotFinite,
}

/// A backend that cannot serve.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum BackendError {
    /// The environment variable names none of this machine's backends.
    #[error("{variable} is {name:?}; this machine has auto, {}", available.join(", "))]
    Unknown {
        /// The environment variable.
        variable: &'static str,
        /// What it says.
        name: String,
        /// The backends of this machine.
        available: Vec<&'static str>,
    },
    /// This CPU does not have it.
    #[error("this machine has no {name}")]
    Missing {
        /// The backend's name.
        name: &'static str,
    },
}

/// Shorthand for this crate's results.
pub type Result<T> = std::result::Result<T, HogError>;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_error_says_what_came_and_what_is_wanted() {
        let (axis, most, size) = ("width", 99, Size::new);
        let (width, height) = (7, 9);
        let available = vec!["sse41", "scalar"];
        let texts: [(HogError, &str); 19] = [
            (
                HogError::DetectorSize { got: 5, wanted: 8 },
                "the detector has 5 coefficients; this geometry needs 8 or 9 (with bias last)",
            ),
            (
                HogError::Memory { bytes: 12 },
                "12 bytes of memory are wanted, and cannot be had; use a smaller image, padding or geometry",
            ),
            (HogError::Interrupted, "the call was interrupted"),
            (
                NetworkError::Weights { got: 3, wanted: 5 }.into(),
                "the network has 3 weights; these layers need 5",
            ),
            (
                NetworkError::Channels { got: 0, most: 99 }.into(),
                "a layer of the network has 0 channels; 1 to 99 are wanted",
            ),
            (
                GeometryError::Side { name: "cellSize", x: 0, y: 8, most }.into(),
                "cellSize is (0, 8); both sides must be 1 to 99 pixels",
            ),
            (GeometryError::Bins { got: 0 }.into(), "nbins is 0; it must be 1 to 256"),
            (
                GeometryError::Cells { block: size(16, 9), cell: size(8, 8) }.into(),
                "blockSize (16, 9) must be a multiple of cellSize (8, 8)",
            ),
            (GeometryError::Levels { got: 0 }.into(), "nlevels is 0; it must be at least 1"),
            (
                GeometryError::Stride { axis, window: 65, block: 16, stride: 8 }.into(),
                "window width 65 minus block width 16 must be a multiple of block stride 8",
            ),
            (ImageError::Channels { got: 2 }.into(), "the image has 2 channels; 1 or 3 are wanted"),
            (ImageError::Empty { width: 0, height }.into(), "the image is empty: 0 x 9 pixels"),
            (
                ImageError::Data { len: 3, row_stride: 7, width, height, channels: 1 }.into(),
                "3 bytes with a row stride of 7 do not hold 7 x 9 x 1 pixels",
            ),
            (
                ParameterError::WinStride { x: 0, y: 8 }.into(),
                "winStride is (0, 8); both must be 1 pixel or more",
            ),
            (
                ParameterError::Padding { got: 100, most }.into(),
                "padding is 100; at most 99 pixels are allowed",
            ),
            (
                ParameterError::PaddedSide { axis, got: -1 }.into(),
                "the padded width would be -1 pixels; at least 1 is wanted",
            ),
            (
                ParameterError::Descriptors { windows: 7, elements: 9 }.into(),
                "7 windows of 9 elements are too many for one array; use a larger winStride",
            ),
            (
                BackendError::Unknown { variable: "V", name: "sse9".into(), available }.into(),
                "V is \"sse9\"; this machine has auto, sse41, scalar",
            ),
            (BackendError::Missing { name: "neon" }.into(), "this machine has no neon"),
        ];
        for (error, text) in texts {
            assert_eq!(error.to_string(), text);
        }
    }
}
