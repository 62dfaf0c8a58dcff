//! Which kernels serve a call: every entry to the fast path.

use crate::error::Result;
use crate::exact::{Loops, RowKernel, Svm};
use crate::geometry::Size;
use crate::image::ImageView;
use crate::params::HogSpec;
use crate::pyramid::Grid;

use super::backend::Backend;
use super::lane::Lane;
#[cfg(target_arch = "aarch64")]
use super::lane::neon::Neon;
use super::lane::portable::Portable;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
use super::lane::simd128::Simd128;
#[cfg(target_arch = "x86_64")]
use super::lane::{Kernel, avx2::Avx2, avx512::Avx512, sse41::Sse41};
use super::plan::{Geometry, Plan};
use super::rows::Planes;
#[cfg(target_arch = "x86_64")]
use super::votes::Votes;

/// The kernels' constants of this geometry, if they can serve it.
pub(crate) fn geometry(backend: Backend, spec: &HogSpec) -> Option<Geometry> {
    Geometry::new(spec, sqrt_of_byte_is_exact(backend))
}

/// The plan of the fast path for this geometry and SVM, if the kernels can serve them.
pub(crate) fn plan(backend: Backend, geometry: &Geometry, svm: &Svm) -> Option<Plan> {
    Plan::new(geometry.clone(), svm, !matches!(backend, Backend::Avx2 | Backend::Sse41))
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

/// Work that is the same on every instruction set but for the lane that it hands to the kernels.
pub(super) trait OnLane {
    type Output;
    fn run<L: Lane>(self, l: L) -> Self::Output;
}

/// Runs `work` with the lane of `backend`.
pub(super) fn on_lane<W: OnLane>(backend: Backend, work: W) -> W::Output {
    match backend {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a backend is only chosen where it is available.
        Backend::Avx512 => work.run(unsafe { Avx512::new() }),
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        Backend::Avx2 => work.run(unsafe { Avx2::new() }),
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        Backend::Sse41 => work.run(unsafe { Sse41::new() }),
        #[cfg(target_arch = "aarch64")]
        // SAFETY: every aarch64 CPU that Rust's standard targets run on has NEON.
        Backend::Neon => work.run(unsafe { Neon::new() }),
        #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
        // SAFETY: the module has simd128.
        Backend::Simd128 => work.run(unsafe { Simd128::new() }),
        _ => work.run(Portable),
    }
}

/// Fills `planes` with the pixels of `image`.
pub(crate) fn fill_planes(backend: Backend, planes: &mut Planes, image: ImageView) -> Result<()> {
    match backend {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a backend is only chosen where it is available; AVX-512 implies AVX2.
        Backend::Avx512 | Backend::Avx2 => planes.fill(unsafe { Avx2::new() }, image),
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        Backend::Sse41 => planes.fill(unsafe { Sse41::new() }, image),
        #[cfg(target_arch = "aarch64")]
        // SAFETY: as in `on_lane`.
        Backend::Neon => planes.fill(unsafe { Neon::new() }, image),
        #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
        // SAFETY: as in `on_lane`.
        Backend::Simd128 => planes.fill(unsafe { Simd128::new() }, image),
        _ => planes.fill(Portable, image),
    }
}

/// Fills `resized` with the pixels of `source`, resized to `size`.
pub(crate) fn resize_planes(
    backend: Backend,
    source: &Planes,
    resized: &mut Planes,
    size: Size,
) -> Result<()> {
    struct Resize<'a>(&'a Planes, &'a mut Planes, Size);
    impl OnLane for Resize<'_> {
        type Output = Result<()>;
        fn run<L: Lane>(self, l: L) -> Result<()> {
            self.1.resize(l, self.0, self.2)
        }
    }
    on_lane(backend, Resize(source, resized, size))
}

/// The kernel for the gradient's loops.
pub(crate) fn row_kernel(backend: Backend) -> &'static dyn RowKernel {
    match backend {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a backend is only chosen where it is available.
        Backend::Avx512 => const { &Votes(unsafe { Avx512::new() }) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        Backend::Avx2 => const { &Votes(unsafe { Avx2::new() }) },
        _ => &Loops,
    }
}
