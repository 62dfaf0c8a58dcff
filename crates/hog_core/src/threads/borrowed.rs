//! Work on what the caller only borrowed: threads of one call, as those that stay from call to call may not borrow.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread::{self, Builder, Thread};
use std::time::Duration;

use crate::error::Result;
use crate::interrupt::Interrupt;

/// How often the calling thread looks for an interrupt while others finish.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// `work` of every item on up to `threads` threads; the first error ends it on all of them.
///
/// Making a thread takes about 50 µs: items should be worth it. Threads that cannot be had are done without.
pub(crate) fn for_each<T: Send>(
    items: Vec<T>,
    threads: usize,
    interrupt: &Interrupt,
    work: impl Fn(T, &Interrupt) -> Result<()> + Sync,
) -> Result<()> {
    let threads = threads.min(items.len());
    let (queue, first, stopped) = (Mutex::new(items.into_iter()), Mutex::new(Ok(())), AtomicBool::new(false));
    let next = || queue.lock().unwrap_or_else(PoisonError::into_inner).next();
    let end = |result: Result<()>| {
        if result.is_err() {
            let mut first = first.lock().unwrap_or_else(PoisonError::into_inner);
            if first.is_ok() {
                *first = result;
            }
            stopped.store(true, Ordering::Relaxed);
        }
    };
    let take_part = |interrupt: Interrupt| {
        while let Some(item) = next() {
            let result = interrupt.check().and_then(|()| work(item, &interrupt));
            if result.is_err() {
                return end(result);
            }
        }
    };
    let (helpers, caller) = (AtomicUsize::new(0), thread::current());
    thread::scope(|scope| {
        for _ in 1..threads {
            helpers.fetch_add(1, Ordering::Relaxed);
            let helper = || {
                let _leaving = Leaving { helpers: &helpers, caller: &caller };
                take_part(Interrupt::NEVER.or(&stopped));
            };
            if Builder::new().spawn_scoped(scope, helper).is_err() {
                helpers.fetch_sub(1, Ordering::Relaxed);
                break;
            }
        }
        take_part(interrupt.or(&stopped));
        while helpers.load(Ordering::Acquire) > 0 {
            thread::park_timeout(LOOK_EVERY);
            end(interrupt.check());
        }
    });
    first.into_inner().unwrap_or_else(PoisonError::into_inner)
}

/// Tells the calling thread, when dropped, that a helper has ended.
struct Leaving<'a> {
    helpers: &'a AtomicUsize,
    caller: &'a Thread,
}

impl Drop for Leaving<'_> {
    fn drop(&mut self) {
        self.helpers.fetch_sub(1, Ordering::Release);
        self.caller.unpark();
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may fail")]
mod tests {
    use super::*;
    use crate::error::HogError;

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
    fn the_first_error_ends_the_work() {
        for threads in [1, 2, 9] {
            let fail = |_: usize, _: &Interrupt| Err(HogError::Memory { bytes: 5 });
            let found = for_each((0..100).collect(), threads, &Interrupt::NEVER, fail);
            assert_eq!(found.unwrap_err(), HogError::Memory { bytes: 5 });
        }
    }
}
