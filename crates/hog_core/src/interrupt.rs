//! Whether the caller still wants the answer: asked between the steps of long work.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{HogError, Result};

/// What ends a call before it is done.
///
/// ```
/// use std::time::{Duration, Instant};
/// use hog_core::{Hog, HogError, HogParams, ImageView, Interrupt, SearchOptions, model};
/// let people = Hog::new(&HogParams::default(), Some(model::default_people()))?;
/// let grey = vec![128; 640 * 480];
/// let image = ImageView::new(&grey, 640, 480, 1, 640)?;
/// let began = Instant::now();
/// let is_late = || began.elapsed() >= Duration::ZERO;
/// let found = people.detect(image, &SearchOptions::default(), &Interrupt::when(&is_late));
/// assert_eq!(found, Err(HogError::Interrupted));
/// # Ok::<(), hog_core::HogError>(())
/// ```
#[derive(Clone, Copy)]
pub struct Interrupt<'a> {
    /// Asks the caller; the threads that help the calling one have none.
    ask: Option<&'a dyn Fn() -> bool>,
    /// Set when one of the threads of a call has failed.
    stopped: Option<&'a AtomicBool>,
}

impl<'a> Interrupt<'a> {
    /// Never ends a call.
    pub const NEVER: Interrupt<'static> = Interrupt { ask: None, stopped: None };

    /// Ends a call once `ask` gives true. It is called often, so it must be cheap, and only by the calling thread.
    pub fn when(ask: &'a dyn Fn() -> bool) -> Self {
        Self { ask: Some(ask), stopped: None }
    }

    /// As this one, and when `stopped` is set.
    pub(crate) fn or(self, stopped: &'a AtomicBool) -> Self {
        Self { stopped: Some(stopped), ..self }
    }

    /// [`HogError::Interrupted`] if the call is to end.
    pub(crate) fn check(&self) -> Result<()> {
        let stopped = self.stopped.is_some_and(|stopped| stopped.load(Ordering::Relaxed));
        if stopped || self.ask.is_some_and(|ask| ask()) { Err(HogError::Interrupted) } else { Ok(()) }
    }
}
