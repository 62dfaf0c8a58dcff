//! Which kernels serve a call: every entry to the fast path.

use crate::error::Result;
use crate::exact::Svm;
use crate::geometry::Size;
use crate::image::ImageView;
use crate::params::HogSpec;
use crate::pyramid::Grid;

use super::backend::Backend;
#[cfg(target_arch = "aarch64")]
use super::lane::neon::Neon;
use super::lane::portable::Portable;
#[cfg(target_arch = "x86_64")]
use super::lane::{Kernel, Lane, avx2::Avx2, avx512::Avx512};
use super::level::{Scratch, Task, level};
use super::plan::Plan;
use super::rows::Planes;

/// The plan of the fast path for this geometry and SVM, if the kernels can serve them.
pub(crate) fn plan(backend: Backend, spec: &HogSpec, svm: &Svm) -> Option<Plan> {
    Plan::new(spec, svm, sqrt_of_byte_is_exact(backend), backend != Backend::Avx2)
}

/// Whether the backend's estimated square root is right for every pixel value; CPUs differ in their estimates.
fn sqrt_of_byte_is_exact(backend: Backend) -> bool {
    match backend {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a backend is only chosen where it is available; AVX-512 implies AVX2, which a level's last strip is.
        Backend::Avx512 => unsafe {
            Avx512::new().compiled(SqrtIsExact) && Avx2::new().compiled(SqrtIsExact)
        },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        Backend::Avx2 => unsafe { Avx2::new() }.compiled(SqrtIsExact),
        _ => false,
    }
}

/// Whether `sqrt_of_byte` is right for every pixel value.
#[cfg(target_arch = "x86_64")]
struct SqrtIsExact;

#[cfg(target_arch = "x86_64")]
impl Kernel for SqrtIsExact {
    type Output = bool;
    #[inline(always)]
    fn run<L: Lane>(self, l: L) -> bool {
        (0..=255u8).all(|value| {
            let value = f32::from(value);
            l.first(l.sqrt_of_byte(l.splat(value))) == value.sqrt()
        })
    }
}

/// Whether the kernels can serve windows of this stride.
pub(crate) fn serves(grid: &Grid) -> bool {
    grid.stride.width.is_multiple_of(4) && grid.stride.height.is_multiple_of(4)
}

/// Puts into `scratch.found` every window whose exact score may be at least the task's threshold, row by row: x, y in
/// padded pixels.
pub(crate) fn detect(backend: Backend, task: Task, scratch: &mut Scratch) -> Result<()> {
    scratch.found.clear();
    if task.grid.is_empty() {
        return Ok(());
    }
    match backend {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a backend is only chosen where it is available.
        Backend::Avx512 => level(unsafe { Avx512::new() }, task, scratch)?,
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        Backend::Avx2 => level(unsafe { Avx2::new() }, task, scratch)?,
        #[cfg(target_arch = "aarch64")]
        // SAFETY: every aarch64 CPU that Rust's standard targets run on has NEON.
        Backend::Neon => level(unsafe { Neon::new() }, task, scratch)?,
        _ => level(Portable, task, scratch)?,
    }
    scratch.found.sort_unstable_by_key(|&(x, y, _)| (y, x));
    Ok(())
}

/// Fills `planes` with the pixels of `image`.
pub(crate) fn fill_planes(backend: Backend, planes: &mut Planes, image: ImageView) -> Result<()> {
    match backend {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a backend is only chosen where it is available; AVX-512 implies AVX2.
        Backend::Avx512 | Backend::Avx2 => planes.fill(unsafe { Avx2::new() }, image),
        #[cfg(target_arch = "aarch64")]
        // SAFETY: as in `detect`.
        Backend::Neon => planes.fill(unsafe { Neon::new() }, image),
        _ => planes.fill(Portable, image),
    }
}

/// Fills `resized` with the pixels of `source`, resized to `size`.
pub(crate) fn resize_planes(
    backend: Backend,
    source: &Planes,
    resized: &mut Planes,
    size: Size,
    scratch: &mut Scratch,
) -> Result<()> {
    let band = &mut scratch.band;
    match backend {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a backend is only chosen where it is available.
        Backend::Avx512 => resized.resize(unsafe { Avx512::new() }, source, size, band),
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        Backend::Avx2 => resized.resize(unsafe { Avx2::new() }, source, size, band),
        #[cfg(target_arch = "aarch64")]
        // SAFETY: as in `detect`.
        Backend::Neon => resized.resize(unsafe { Neon::new() }, source, size, band),
        _ => resized.resize(Portable, source, size, band),
    }
}
