//! Work shared among threads.

mod team;

pub(crate) use team::{Shared, together};

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::Result;
use crate::interrupt::Interrupt;
use crate::memory;

/// `work` of every item, on up to `threads` threads fed from one queue; results in the items' order, or the first error.
pub(crate) fn in_order<T, R, W>(
    items: Vec<T>,
    threads: usize,
    interrupt: &Interrupt,
    work: W,
) -> Result<Vec<R>>
where
    T: Send + Sync + 'static,
    R: Send + 'static,
    W: Fn(&T, &Interrupt) -> Result<R> + Send + Sync + 'static,
{
    let threads = threads.clamp(1, items.len().max(1));
    let mut results = memory::with_room(items.len())?;
    let done = Mutex::new(memory::with_room(items.len())?);
    let queue = Arc::new(Queue { items, next: AtomicUsize::new(0), done, work });
    together(&queue, threads, interrupt)?;
    let mut done = queue.done.lock().unwrap_or_else(PoisonError::into_inner);
    done.sort_unstable_by_key(|&(index, _)| index);
    results.extend(done.drain(..).map(|(_, result)| result));
    Ok(results)
}

struct Queue<T, R, W> {
    items: Vec<T>,
    next: AtomicUsize,
    /// Results and their items' numbers, with room for all.
    done: Mutex<Vec<(usize, R)>>,
    work: W,
}

impl<T, R, W> Shared for Queue<T, R, W>
where
    T: Send + Sync + 'static,
    R: Send + 'static,
    W: Fn(&T, &Interrupt) -> Result<R> + Send + Sync + 'static,
{
    fn work(&self, interrupt: &Interrupt) -> Result<()> {
        loop {
            interrupt.check()?;
            let index = self.next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = self.items.get(index) else { return Ok(()) };
            let result = (self.work)(item, interrupt)?;
            self.done.lock().unwrap_or_else(PoisonError::into_inner).push((index, result));
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may fail")]
mod tests {
    use super::*;
    use crate::error::HogError;
    use std::thread;

    #[test]
    fn results_keep_the_items_order() {
        for threads in [1, 2, 7, 300] {
            let items: Vec<usize> = (0..200).collect();
            let found = in_order(items, threads, &Interrupt::NEVER, |&i, _| Ok(i * i)).unwrap();
            assert_eq!(found, (0..200).map(|i| i * i).collect::<Vec<_>>());
        }
        assert!(in_order(Vec::<u8>::new(), 4, &Interrupt::NEVER, |_, _| Ok(0)).unwrap().is_empty());
    }

    #[test]
    fn one_error_ends_the_work_of_all_threads() {
        for threads in [1, 2, 8] {
            let begun = Arc::new(AtomicUsize::new(0));
            let counted = Arc::clone(&begun);
            let work = move |&i: &usize, interrupt: &Interrupt| -> Result<()> {
                counted.fetch_add(1, Ordering::Relaxed);
                if i == 0 {
                    return Err(HogError::Memory { bytes: 5 });
                }
                loop {
                    interrupt.check()?; // until the first item has failed
                }
            };
            let found = in_order((0..1000).collect(), threads, &Interrupt::NEVER, work);
            assert_eq!(found.unwrap_err(), HogError::Memory { bytes: 5 });
            assert!(begun.load(Ordering::Relaxed) <= threads);
        }
    }

    #[test]
    fn the_calling_thread_is_asked_also_when_only_others_are_at_work() {
        let asked = AtomicUsize::new(0);
        let ask = || asked.fetch_add(1, Ordering::Relaxed) > 4;
        let caller = thread::current().id();
        let work = move |_: &u8, interrupt: &Interrupt| {
            while thread::current().id() != caller {
                interrupt.check()?;
            }
            Ok(())
        };
        let found = in_order(vec![0, 1], 2, &Interrupt::when(&ask), work);
        // (Where the calling thread takes both items, nothing is interrupted.)
        assert!(matches!(found, Err(HogError::Interrupted)) || found.is_ok_and(|all| all.len() == 2));
    }
}
