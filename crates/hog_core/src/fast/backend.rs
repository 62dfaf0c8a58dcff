//! Which instruction set the kernels use: chosen once, or forced by `LIMO_HOG_BACKEND`.

use std::sync::OnceLock;

use crate::error::{BackendError, Result};

/// An instruction set that the kernels are compiled for.
///
/// ```
/// use hog_core::{Backend, Hog, HogParams};
/// assert!(Backend::current()?.is_available());
/// let plain = Hog::with_backend(&HogParams::default(), None, Backend::Scalar)?;
/// # Ok::<(), hog_core::HogError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Backend {
    /// The architecture's baseline.
    Scalar,
    /// SSSE3 and SSE4.1.
    Sse41,
    /// AVX2 and FMA.
    Avx2,
    /// AVX-512 F, BW, VL, DQ, VBMI and VNNI.
    Avx512,
    /// NEON.
    Neon,
    /// WebAssembly's vectors of 128 bits.
    Simd128,
}

/// The variable that forces a backend.
const VARIABLE: &str = "LIMO_HOG_BACKEND";

impl Backend {
    /// All of them, the fastest first.
    pub const ALL: [Self; 6] =
        [Self::Avx512, Self::Avx2, Self::Sse41, Self::Neon, Self::Simd128, Self::Scalar];

    /// The name that `LIMO_HOG_BACKEND` knows it by.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Sse41 => "sse41",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
            Self::Neon => "neon",
            Self::Simd128 => "simd128",
        }
    }

    /// Whether this CPU has it.
    pub fn is_available(self) -> bool {
        match self {
            Self::Scalar => true,
            #[cfg(target_arch = "x86_64")]
            Self::Sse41 => is_x86_feature_detected!("ssse3") && is_x86_feature_detected!("sse4.1"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                Self::Avx2.is_available()
                    && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512bw")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512vbmi")
                    && is_x86_feature_detected!("avx512vnni")
            }
            #[cfg(target_arch = "aarch64")]
            Self::Neon => true,
            // Nothing can be asked at run time: a module that has such instructions does not load without them.
            Self::Simd128 => cfg!(all(target_arch = "wasm32", target_feature = "simd128")),
            #[allow(unreachable_patterns, reason = "which are left depends on the architecture")]
            _ => false,
        }
    }

    /// An error unless this CPU has it.
    pub(crate) fn checked(self) -> Result<Self> {
        if self.is_available() { Ok(self) } else { Err(BackendError::Missing { name: self.name() }.into()) }
    }

    /// The backend in force: the one `LIMO_HOG_BACKEND` names, else the fastest this CPU has. Read once.
    ///
    /// An unknown name, or one that this CPU does not have, is an error.
    pub fn current() -> Result<Self> {
        static CHOSEN: OnceLock<Result<Backend>> = OnceLock::new();
        let choose = || {
            let name = std::env::var_os(VARIABLE).unwrap_or_default();
            Self::named(&name.to_string_lossy())
        };
        CHOSEN.get_or_init(choose).clone()
    }

    fn named(name: &str) -> Result<Self> {
        let available = || Self::ALL.into_iter().filter(|backend| backend.is_available());
        if name.is_empty() || name == "auto" {
            return Ok(available().next().unwrap_or(Self::Scalar));
        }
        available().find(|backend| backend.name() == name).ok_or_else(|| {
            let available = available().map(Self::name).collect();
            BackendError::Unknown { variable: VARIABLE, name: name.to_owned(), available }.into()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn auto_takes_the_fastest_and_scalar_is_everywhere() {
        assert!(Backend::named("auto").unwrap().is_available());
        assert_eq!(Backend::named("").unwrap(), Backend::named("auto").unwrap());
        assert_eq!(Backend::named("scalar").unwrap(), Backend::Scalar);
    }

    #[test]
    fn an_unknown_or_missing_backend_is_refused_by_name() {
        let text = Backend::named("sse9").unwrap_err().to_string();
        assert!(text.contains("sse9") && text.contains("scalar"), "{text}");
        let missing = if cfg!(target_arch = "aarch64") { "avx2" } else { "neon" };
        assert!(Backend::named(missing).is_err());
    }
}
