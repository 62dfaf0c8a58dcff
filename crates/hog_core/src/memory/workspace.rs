//! Scratch memory, reused from call to call.

use std::sync::Mutex;

/// Memory that work writes before it reads it.
pub(crate) trait Workspace: Default {
    /// How much it holds [bytes].
    fn bytes(&self) -> usize;
}

/// Spare workspaces kept at most; threads beyond these take new ones.
const SLOTS: usize = 64;

/// A larger workspace is not kept from call to call [bytes]: a 1920 × 1080 colour image takes 6.2 MB, its largest level
/// 7.9 MB, which leaves room for padding.
const KEPT_BYTES_MAX: usize = 10 << 20;

/// Spare workspaces of one kind.
///
/// A child process has the memory of its parent, but of its threads only the one that forked: a lock that another
/// thread held at that moment stays locked for ever in the child. So no lock is ever waited for here: a slot that is
/// locked is passed over, and where none is left a new workspace is made. A lock is held no longer than it takes to
/// move a workspace in or out, so that in the parent this is rare, and needs no handler of forks.
#[derive(Debug)]
pub(crate) struct Pool<T>([Mutex<Option<T>>; SLOTS]);

impl<T: Workspace> Pool<T> {
    /// An empty pool.
    pub(crate) const fn new() -> Self {
        Self([const { Mutex::new(None) }; SLOTS])
    }

    /// Runs `work` with a spare workspace, or with a new one if there is none.
    pub(crate) fn with<R>(&self, work: impl FnOnce(&mut T) -> R) -> R {
        let mut workspace = self.take();
        let result = work(&mut workspace);
        self.give(workspace);
        result
    }

    /// A spare workspace, or a new one if there is none.
    pub(crate) fn take(&self) -> T {
        self.0.iter().find_map(|slot| slot.try_lock().ok()?.take()).unwrap_or_default()
    }

    /// Keeps `workspace` as a spare one.
    pub(crate) fn give(&self, workspace: T) {
        for slot in &self.0 {
            if let Ok(mut slot) = slot.try_lock()
                && slot.is_none()
            {
                *slot = Some(workspace);
                break;
            }
        }
    }

    /// Frees the spare workspaces that are too large to be kept.
    pub(crate) fn trim(&self) {
        for slot in &self.0 {
            if let Ok(mut slot) = slot.try_lock()
                && slot.as_ref().is_some_and(|workspace| workspace.bytes() > KEPT_BYTES_MAX)
            {
                *slot = None;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Workspace for Vec<u8> {
        fn bytes(&self) -> usize {
            self.capacity()
        }
    }

    #[test]
    #[cfg_attr(miri, ignore = "Miri takes minutes to fill ten megabytes")]
    fn a_workspace_is_used_again_unless_it_is_large() {
        let pool: Pool<Vec<u8>> = Pool::new();
        pool.with(|bytes| bytes.extend([1, 2, 3]));
        assert_eq!(pool.with(|bytes| bytes.len()), 3);
        pool.trim();
        assert_eq!(pool.with(|bytes| bytes.len()), 3);
        pool.with(|bytes| bytes.resize(KEPT_BYTES_MAX + 1, 0));
        pool.trim();
        assert_eq!(pool.with(|bytes| bytes.capacity()), 0);
    }

    #[test]
    fn no_lock_is_waited_for() {
        // As in a child of a fork: locks that nothing will ever open.
        let pool: Pool<Vec<u8>> = Pool::new();
        let locked: Vec<_> = pool.0.iter().map(|slot| slot.lock().unwrap()).collect();
        assert_eq!(pool.with(|bytes| bytes.len()), 0);
        pool.trim();
        drop(locked);
    }
}
