//! Calls without the GIL, on the threads that the user allows, ended by signals.

use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use hog_core::Interrupt;
use pyo3::prelude::*;

use crate::errors::raised;

/// Threads of a pyramid search; 0 stands for all cores.
pub(crate) static THREADS: AtomicUsize = AtomicUsize::new(0);

/// The cores that this process may use; 0 until they are asked for.
static CORES: AtomicUsize = AtomicUsize::new(0);

/// More threads are never used: levels are shared among them, and a pyramid has 64 levels unless asked for more.
pub(crate) const THREADS_MAX: usize = 256;

/// How many threads were chosen.
pub(crate) fn threads() -> usize {
    let threads = match THREADS.load(Ordering::Relaxed) {
        0 => cores(),
        chosen => chosen,
    };
    threads.min(THREADS_MAX)
}

/// The cores that this process may use, asked for once: the answer takes longer (28 µs) than the descriptor of a crop.
pub(crate) fn cores() -> usize {
    if CORES.load(Ordering::Relaxed) == 0 {
        CORES.store(std::thread::available_parallelism().map_or(1, usize::from), Ordering::Relaxed);
    }
    CORES.load(Ordering::Relaxed)
}

/// Limits the threads of a call to the number of cores: more would cut the work into smaller parts, and each needs scratch
/// memory.
pub(crate) fn at_work(asked: usize) -> usize {
    asked.clamp(1, cores())
}

/// How often a long call looks for signals: a tenth of the second within which Ctrl-C is to end it, and so rarely that
/// taking the GIL from a busy thread costs little.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// Runs `work` without the GIL; what a signal's handler raises (Ctrl-C: `KeyboardInterrupt`) ends it.
pub(crate) fn detached<R: Send>(
    py: Python<'_>,
    work: impl FnOnce(&Interrupt) -> hog_core::Result<R> + Send,
) -> PyResult<R> {
    let (found, signal) = py.detach(|| {
        let (looked, signal) = (Cell::new(Instant::now()), Cell::new(None));
        // Python handles signals in its main thread alone: any other would take the GIL for nothing, time and again.
        let is_main = Cell::new(None);
        let ask = || {
            if is_main.get() == Some(false) || looked.get().elapsed() < LOOK_EVERY {
                return false;
            }
            // (An interpreter that is ending cannot be had; nor does it wait for this thread.)
            let seen = Python::try_attach(|py| {
                if is_main.get().is_none() {
                    is_main.set(Some(is_main_thread(py)?));
                }
                py.check_signals()
            });
            looked.set(Instant::now());
            seen.is_some_and(|seen| seen.map_err(|error| signal.set(Some(error))).is_err())
        };
        let found = work(&Interrupt::when(&ask));
        (found, signal.take())
    });
    match signal {
        Some(error) => Err(error),
        None => found.map_err(|error| raised(py, &error)),
    }
}

fn is_main_thread(py: Python<'_>) -> PyResult<bool> {
    let threading = py.import("threading")?;
    let main = threading.call_method0("main_thread")?.getattr("ident")?;
    threading.call_method0("get_ident")?.eq(main)
}
