//! Threads that stay from call to call, asleep while there is nothing to do, and are safe where a process forks.
//!
//! A child process has the memory of its parent, but of its threads only the one that forked. So a team knows the process
//! that it belongs to, and a child makes a team of its own. A lock that another thread held at the fork stays locked for
//! ever in the child: the lock of [`TEAM`] is only tried, and where it cannot be had the call does without helpers. Every
//! other lock belongs to a team or to a call, so that the threads that may hold it live in this process.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, Builder, Thread};
use std::time::{Duration, Instant};

use crate::error::Result;
use crate::interrupt::Interrupt;

/// How often the calling thread looks for an interrupt while others finish.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// How long a lock is tried before a call does without helpers: it is held for microseconds, longer where the thread that
/// holds it makes others or has to wait for a core.
const PATIENCE: Duration = Duration::from_millis(2);

/// Work that several threads do together.
pub(crate) trait Shared: Send + Sync + 'static {
    /// Every thread calls this once; it takes parts of the work until none is left.
    fn work(&self, interrupt: &Interrupt) -> Result<()>;
}

/// Does `work` on this thread and up to `threads` − 1 helpers. The first error ends it on all of them.
///
/// Helpers that cannot be had are done without. When this returns or unwinds, no helper holds `work` any more.
pub(crate) fn together<W: Shared>(work: &Arc<W>, threads: usize, interrupt: &Interrupt) -> Result<()> {
    if threads <= 1 {
        return work.work(interrupt);
    }
    let call = Arc::new(Call {
        work: Arc::clone(work) as Arc<dyn Shared>,
        stopped: AtomicBool::new(false),
        outcome: Mutex::new(Ok(Ok(()))),
    });
    let presence = Arc::new(Presence { helpers: AtomicUsize::new(0), caller: thread::current() });
    let team = Team::of_this_process();
    let team = team.filter(|team| team.post(&call, &presence, threads - 1));
    call.take_part(interrupt);
    if let Some(team) = team {
        lock(&team.board).postings.retain(|posting| !Arc::ptr_eq(&posting.call, &call));
        while presence.helpers.load(Ordering::Acquire) > 0 {
            thread::park_timeout(LOOK_EVERY);
            call.end(catch_unwind(AssertUnwindSafe(|| interrupt.check())));
        }
    }
    let outcome = std::mem::replace(&mut *lock(&call.outcome), Ok(Ok(())));
    outcome.unwrap_or_else(|panic| resume_unwind(panic))
}

/// What a thread's part of a call came to: a result, or a panic.
type Outcome = thread::Result<Result<()>>;

/// One call of [`together`].
struct Call {
    work: Arc<dyn Shared>,
    stopped: AtomicBool,
    /// The first failure of any thread.
    outcome: Mutex<Outcome>,
}

impl Call {
    fn take_part(&self, interrupt: &Interrupt) {
        let interrupt = interrupt.or(&self.stopped);
        self.end(catch_unwind(AssertUnwindSafe(|| self.work.work(&interrupt))));
    }

    /// Takes note of how one thread's part ended.
    fn end(&self, outcome: Outcome) {
        if matches!(outcome, Ok(Ok(()))) {
            return;
        }
        // The others end with `Interrupted` because of the first failure.
        let mut first = lock(&self.outcome);
        if matches!(*first, Ok(Ok(()))) {
            *first = outcome;
        } else {
            // What a panic carries may panic when it is dropped, and nothing may unwind from here while helpers work.
            std::mem::forget(outcome);
        }
        self.stopped.store(true, Ordering::Relaxed);
    }
}

/// How many helpers are at work on a call; apart from it, as a helper lets go of the call before it leaves.
struct Presence {
    helpers: AtomicUsize,
    caller: Thread,
}

/// The helpers of one process.
struct Team {
    process: u32,
    board: Mutex<Board>,
    news: Condvar,
}

#[derive(Default)]
struct Board {
    postings: Vec<Posting>,
    /// Threads of the team.
    helpers: usize,
}

/// A call that looks for helpers.
struct Posting {
    call: Arc<Call>,
    presence: Arc<Presence>,
    /// Helpers that may still join.
    seats: usize,
}

/// The team of this process, or that of the process which forked it.
static TEAM: Mutex<Option<Arc<Team>>> = Mutex::new(None);

impl Team {
    fn of_this_process() -> Option<Arc<Self>> {
        let process = std::process::id();
        let mut team = try_lock(&TEAM)?;
        match &*team {
            Some(team) if team.process == process => Some(Arc::clone(team)),
            _ => {
                let new =
                    Arc::new(Self { process, board: Mutex::new(Board::default()), news: Condvar::new() });
                // Its parent's is left as it is: a lock in it may be held by a thread that this process does not have.
                std::mem::forget(team.replace(Arc::clone(&new)));
                Some(new)
            }
        }
    }

    /// Asks up to `seats` helpers to join `call`; whether they have heard of it.
    fn post(self: &Arc<Self>, call: &Arc<Call>, presence: &Arc<Presence>, seats: usize) -> bool {
        let Some(mut board) = try_lock(&self.board) else { return false };
        if board.postings.try_reserve(1).is_err() {
            return false;
        }
        while board.helpers < seats {
            let team = Arc::clone(self);
            if Builder::new().name("limo-hog".to_owned()).spawn(move || team.serve()).is_err() {
                break;
            }
            board.helpers += 1;
        }
        if board.helpers == 0 {
            return false;
        }
        board.postings.push(Posting { call: Arc::clone(call), presence: Arc::clone(presence), seats });
        drop(board);
        if seats == 1 {
            self.news.notify_one()
        } else {
            self.news.notify_all()
        }
        true
    }

    /// A helper's life.
    fn serve(&self) {
        loop {
            let (call, presence) = self.join();
            call.take_part(&Interrupt::NEVER);
            drop(call);
            presence.helpers.fetch_sub(1, Ordering::Release);
            presence.caller.unpark();
        }
    }

    /// Sleeps until a call has a seat, and takes it.
    fn join(&self) -> (Arc<Call>, Arc<Presence>) {
        let mut board = lock(&self.board);
        loop {
            if let Some(posting) = board.postings.iter_mut().find(|posting| posting.seats > 0) {
                posting.seats -= 1;
                posting.presence.helpers.fetch_add(1, Ordering::Relaxed);
                return (Arc::clone(&posting.call), Arc::clone(&posting.presence));
            }
            board = self.news.wait(board).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

/// The lock, if it can be had at once or soon.
fn try_lock<T>(mutex: &Mutex<T>) -> Option<MutexGuard<'_, T>> {
    let begin = Instant::now();
    loop {
        if let Ok(guard) = mutex.try_lock() {
            return Some(guard);
        }
        if begin.elapsed() > PATIENCE {
            return None;
        }
        thread::yield_now();
    }
}

/// The lock, which a thread of this process may hold for a moment.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
#[allow(clippy::panic, reason = "a panic is what is tried")]
mod tests {
    use super::*;
    use crate::error::HogError;
    use std::collections::HashSet;

    /// Counts the threads that take part, which wait for each other.
    #[derive(Default)]
    struct Meeting(Mutex<HashSet<thread::ThreadId>>, Condvar);

    impl Shared for Meeting {
        fn work(&self, _: &Interrupt) -> Result<()> {
            let mut seen = lock(&self.0);
            seen.insert(thread::current().id());
            self.1.notify_all();
            let patience = Duration::from_secs(2);
            let met = self.1.wait_timeout_while(seen, patience, |seen| seen.len() < 3);
            drop(met.unwrap_or_else(PoisonError::into_inner));
            Ok(())
        }
    }

    #[test]
    fn helpers_join_and_let_go_of_the_work() {
        // On busy cores a call may do without helpers; not every time.
        let met = (0..20).filter(|_| {
            let mut work = Arc::new(Meeting::default());
            assert_eq!(together(&work, 3, &Interrupt::NEVER), Ok(()));
            assert!(Arc::get_mut(&mut work).is_some());
            lock(&work.0).len() == 3
        });
        assert!(met.count() > 0);
    }

    #[test]
    fn a_lock_that_is_never_opened_is_not_waited_for() {
        let mutex = Mutex::new(());
        let held = mutex.lock();
        assert!(try_lock(&mutex).is_none()); // as in a child of a fork
        drop(held);
    }

    struct Panicking(thread::ThreadId);

    impl Shared for Panicking {
        fn work(&self, interrupt: &Interrupt) -> Result<()> {
            if thread::current().id() != self.0 {
                panic!("as asked");
            }
            loop {
                interrupt.check()?;
            }
        }
    }

    #[test]
    fn a_helpers_panic_is_the_callers() {
        for _ in 0..2 {
            let work = Arc::new(Panicking(thread::current().id()));
            assert!(catch_unwind(AssertUnwindSafe(|| together(&work, 2, &Interrupt::NEVER))).is_err());
        }
    }

    struct Failing;

    impl Shared for Failing {
        fn work(&self, _: &Interrupt) -> Result<()> {
            Err(HogError::Memory { bytes: 5 })
        }
    }

    #[test]
    fn an_error_of_any_thread_is_the_calls() {
        for threads in [1, 2, 8] {
            let found = together(&Arc::new(Failing), threads, &Interrupt::NEVER);
            assert_eq!(found, Err(HogError::Memory { bytes: 5 }));
        }
    }
}
