//! Work on what the caller only borrowed, by the threads that stay from call to call.
//!
//! These live longer than what is borrowed, so its lifetime has to be hidden from the compiler: the one `unsafe` of this
//! module.
#![allow(unsafe_code, reason = "threads that stay are lent what does not")]

use std::mem;
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::Result;
use crate::interrupt::Interrupt;

use super::team::{self, Shared};

/// `work` of every item on up to `threads` threads; the first error ends it on all of them.
///
/// Waking a thread takes about 10 µs: items should be worth it. Threads that cannot be had are done without.
pub(crate) fn for_each<T: Send>(
    items: Vec<T>,
    threads: usize,
    interrupt: &Interrupt,
    work: impl Fn(T, &Interrupt) -> Result<()> + Sync,
) -> Result<()> {
    let threads = threads.min(items.len());
    let queue = Mutex::new(items.into_iter());
    let next = || queue.lock().unwrap_or_else(PoisonError::into_inner).next();
    let part = |interrupt: &Interrupt| {
        while let Some(item) = next() {
            interrupt.check()?;
            work(item, interrupt)?;
        }
        Ok(())
    };
    together(&part, threads, interrupt)
}

/// Does `part`, which takes parts of the work until none is left, on this thread and up to `threads` − 1 others.
pub(crate) fn together(part: &Part, threads: usize, interrupt: &Interrupt) -> Result<()> {
    if threads <= 1 {
        return part(interrupt);
    }
    // SAFETY: what `part` borrows lives until the call has returned or unwound, and by then no helper holds it any more.
    let part: &'static Part<'static> = unsafe { mem::transmute::<&Part, &'static Part<'static>>(part) };
    team::together(&Arc::new(Borrowed(part)), threads, interrupt)
}

/// A thread's part of the work.
pub(crate) type Part<'a> = dyn Fn(&Interrupt) -> Result<()> + Sync + 'a;

struct Borrowed(&'static Part<'static>);

impl Shared for Borrowed {
    fn work(&self, interrupt: &Interrupt) -> Result<()> {
        (self.0)(interrupt)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::panic, reason = "a test may fail")]
mod tests {
    use super::*;
    use crate::error::HogError;
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
    use std::thread;
    use std::time::Duration;

    #[test]
    fn every_item_is_worked_on_once() {
        for threads in [1, 2, 9] {
            let mut numbers = vec![1u32; 100];
            let work = |number: &mut u32, _: &Interrupt| {
                *number += 1;
                Ok(())
            };
            for_each(numbers.iter_mut().collect(), threads, &Interrupt::NEVER, work).unwrap();
            assert_eq!(numbers, [2; 100]);
        }
    }

    #[test]
    fn no_helper_is_at_work_on_what_it_was_lent_when_the_caller_unwinds() {
        let (caller, is_over) = (thread::current().id(), AtomicBool::new(false));
        let (at_work, begun) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let ask =
            || if begun.load(Ordering::SeqCst) > 0 { panic!("while a helper is at work") } else { false };
        let work = |_: u8, interrupt: &Interrupt| {
            if thread::current().id() == caller {
                thread::sleep(Duration::from_millis(5));
                return Ok(());
            }
            at_work.fetch_add(1, Ordering::SeqCst);
            begun.fetch_add(1, Ordering::SeqCst);
            while interrupt.check().is_ok() && !is_over.load(Ordering::SeqCst) {
                thread::yield_now();
            }
            at_work.fetch_sub(1, Ordering::SeqCst);
            Ok(())
        };
        // (Again, where the calling thread takes both items before a helper comes.)
        let left = (0..100).find_map(|_| {
            let all = || for_each(vec![0, 1], 2, &Interrupt::when(&ask), work);
            catch_unwind(AssertUnwindSafe(all)).is_err().then(|| at_work.load(Ordering::SeqCst))
        });
        is_over.store(true, Ordering::SeqCst);
        assert_eq!(left, Some(0));
    }

    #[test]
    fn the_first_error_ends_the_work() {
        for threads in [1, 2, 9] {
            let fail = |_: usize, _: &Interrupt| Err(HogError::Memory { bytes: 5 });
            let found = for_each((0..100).collect(), threads, &Interrupt::NEVER, fail);
            assert_eq!(found.unwrap_err(), HogError::Memory { bytes: 5 });
        }
    }
}
