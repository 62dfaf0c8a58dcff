//! Work shared among threads.

mod borrowed;
mod team;

pub(crate) use borrowed::{for_each, together};

use crate::error::Result;
use crate::interrupt::Interrupt;
use crate::memory;

/// `work` of every item, on up to `threads` threads; results in the items' order, or the first error.
pub(crate) fn in_order<T: Sync, R: Send>(
    items: &[T],
    threads: usize,
    interrupt: &Interrupt,
    work: impl Fn(&T, &Interrupt) -> Result<R> + Sync,
) -> Result<Vec<R>> {
    let mut results = memory::with_room(items.len())?;
    results.resize_with(items.len(), || None);
    let parts = memory::collect(items.iter().zip(&mut results))?;
    for_each(parts, threads, interrupt, |(item, result), interrupt| {
        *result = Some(work(item, interrupt)?);
        Ok(())
    })?;
    memory::collect(results.into_iter().flatten())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may fail")]
mod tests {
    use super::*;
    use crate::error::HogError;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::thread;

    #[test]
    fn results_keep_the_items_order() {
        for threads in [1, 2, 7, 300] {
            let items: Vec<usize> = (0..200).collect();
            let found = in_order(&items, threads, &Interrupt::NEVER, |&i, _| Ok(i * i)).unwrap();
            assert_eq!(found, (0..200).map(|i| i * i).collect::<Vec<_>>());
        }
        assert!(in_order(&[0_u8; 0], 4, &Interrupt::NEVER, |_, _| Ok(0)).unwrap().is_empty());
    }

    #[test]
    fn one_error_ends_the_work_of_all_threads() {
        for threads in [1, 2, 8] {
            let begun = AtomicUsize::new(0);
            let work = |&i: &usize, interrupt: &Interrupt| -> Result<()> {
                begun.fetch_add(1, Ordering::Relaxed);
                if i == 0 {
                    return Err(HogError::Memory { bytes: 5 });
                }
                loop {
                    interrupt.check()?; // until the first item has failed
                }
            };
            let found = in_order(&Vec::from_iter(0..1000), threads, &Interrupt::NEVER, work);
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
        let found = in_order(&[0, 1], 2, &Interrupt::when(&ask), work);
        // (Where the calling thread takes both items, nothing is interrupted.)
        assert!(matches!(found, Err(HogError::Interrupted)) || found.is_ok_and(|all| all.len() == 2));
    }
}
