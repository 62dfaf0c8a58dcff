//! Work shared among threads.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread::{self, Builder, Thread};
use std::time::Duration;

use crate::error::Result;
use crate::interrupt::Interrupt;
use crate::memory;

/// How often the calling thread looks for an interrupt while others finish their items.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// `work` of every item, on up to `threads` threads fed from one queue; results in the items' order, or the first error.
///
/// A thread that cannot be had is done without. The lock and the threads are this call's own: a child process that
/// another thread forks meanwhile knows neither.
pub(crate) fn in_order<T: Sync, R: Send>(
    items: &[T],
    threads: usize,
    interrupt: &Interrupt,
    work: impl Fn(&T, &Interrupt) -> Result<R> + Sync,
) -> Result<Vec<R>> {
    let mut results = memory::with_room(items.len())?;
    let threads = threads.clamp(1, items.len().max(1));
    if threads == 1 {
        for item in items {
            interrupt.check()?;
            results.push(work(item, interrupt)?);
        }
        return Ok(results);
    }
    let next = AtomicUsize::new(0);
    let stopped = AtomicBool::new(false);
    let done = Mutex::new(Ok(memory::with_room(items.len())?));
    let put = |index: usize, result: Result<R>| {
        let mut done = done.lock().unwrap_or_else(PoisonError::into_inner);
        match (result, &mut *done) {
            (Ok(result), Ok(list)) => list.push((index, result)),
            (Err(error), Ok(_)) => {
                *done = Err(error);
                stopped.store(true, Ordering::Relaxed);
            }
            (_, Err(_)) => {} // the first error counts
        }
    };
    let worker = |interrupt: &Interrupt| {
        while !stopped.load(Ordering::Relaxed) {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(index) else { break };
            put(index, interrupt.check().and_then(|()| work(item, interrupt)));
        }
    };
    let helpers = AtomicUsize::new(0);
    let caller = thread::current();
    let helper = || {
        let _leaving = Leaving { helpers: &helpers, caller: &caller };
        worker(&Interrupt::NEVER.or(&stopped));
    };
    thread::scope(|scope| {
        for _ in 1..threads {
            helpers.fetch_add(1, Ordering::Relaxed);
            if Builder::new().spawn_scoped(scope, helper).is_err() {
                helpers.fetch_sub(1, Ordering::Relaxed);
                break;
            }
        }
        worker(&interrupt.or(&stopped));
        while helpers.load(Ordering::Acquire) > 0 && !stopped.load(Ordering::Relaxed) {
            thread::park_timeout(LOOK_EVERY);
            if let Err(error) = interrupt.check() {
                put(items.len(), Err(error));
            }
        }
    });
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner)?;
    done.sort_unstable_by_key(|&(index, _)| index);
    results.extend(done.into_iter().map(|(_, result)| result));
    Ok(results)
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
mod tests {
    use super::*;
    use crate::error::HogError;

    #[test]
    fn results_come_in_order_whatever_the_number_of_threads() {
        let items: Vec<usize> = (0..100).collect();
        for threads in [1, 2, 8, 200] {
            assert_eq!(
                in_order(&items, threads, &Interrupt::NEVER, |&i, _| Ok(i * i)).unwrap(),
                items.iter().map(|i| i * i).collect::<Vec<_>>()
            );
        }
        assert!(in_order(&[] as &[u8], 4, &Interrupt::NEVER, |_, _| Ok(0)).unwrap().is_empty());
    }

    #[test]
    fn one_error_ends_the_work_of_all_threads() {
        let items: Vec<usize> = (0..1000).collect();
        for threads in [1, 2, 8] {
            let begun = AtomicUsize::new(0);
            let found = in_order(&items, threads, &Interrupt::NEVER, |&i, interrupt| -> Result<()> {
                begun.fetch_add(1, Ordering::Relaxed);
                if i == 0 {
                    return Err(HogError::Memory { bytes: 5 });
                }
                loop {
                    interrupt.check()?; // until the first item has failed
                }
            });
            assert_eq!(found.unwrap_err(), HogError::Memory { bytes: 5 });
            assert!(begun.into_inner() <= threads);
        }
    }

    #[test]
    fn the_calling_thread_is_asked_also_when_only_others_are_at_work() {
        let asked = AtomicUsize::new(0);
        let ask = || asked.fetch_add(1, Ordering::Relaxed) > 4;
        let caller = thread::current().id();
        let found = in_order(&[0, 1], 2, &Interrupt::when(&ask), |_, interrupt| {
            while thread::current().id() != caller {
                interrupt.check()?;
            }
            Ok(())
        });
        // (Where the calling thread takes both items, nothing is interrupted.)
        assert!(matches!(found, Err(HogError::Interrupted)) || found.is_ok_and(|all| all.len() == 2));
    }
}
