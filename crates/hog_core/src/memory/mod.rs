//! Memory whose size follows from arguments: where it cannot be had, the call fails, not the process.
//!
//! `Vec`'s own methods abort the process when an allocation fails. These give [`HogError::Memory`] instead.
//! `workspace` keeps memory from call to call.

mod workspace;

pub(crate) use workspace::{Pool, Workspace};

use crate::error::{HogError, Result};

/// Makes room for exactly `more` elements behind those of `list`.
pub(crate) fn reserve<T>(list: &mut Vec<T>, more: usize) -> Result<()> {
    let bytes = list.len().saturating_add(more).saturating_mul(size_of::<T>());
    list.try_reserve_exact(more).map_err(|_| HogError::Memory { bytes })
}

/// An empty list with room for `len` elements.
pub(crate) fn with_room<T>(len: usize) -> Result<Vec<T>> {
    let mut list = Vec::new();
    reserve(&mut list, len)?;
    Ok(list)
}

/// A list of `len` times `value`.
pub(crate) fn filled<T: Clone>(len: usize, value: T) -> Result<Vec<T>> {
    let mut list = with_room(len)?;
    list.resize(len, value);
    Ok(list)
}

/// Brings `list` to `len` elements, new ones being `value`.
#[inline(always)]
pub(crate) fn resize<T: Clone>(list: &mut Vec<T>, len: usize, value: T) -> Result<()> {
    reserve(list, len.saturating_sub(list.len()))?;
    list.resize(len, value);
    Ok(())
}

/// Makes room for at least `more` elements in a list that grows by and by.
#[inline]
pub(crate) fn reserve_some<T>(list: &mut Vec<T>, more: usize) -> Result<()> {
    let bytes = list.len().saturating_add(more).saturating_mul(size_of::<T>());
    list.try_reserve(more).map_err(|_| HogError::Memory { bytes })
}

/// Adds `value` to a list that grows by and by.
#[inline]
pub(crate) fn push<T>(list: &mut Vec<T>, value: T) -> Result<()> {
    reserve_some(list, 1)?;
    list.push(value);
    Ok(())
}

/// Adds `items` to `list`.
pub(crate) fn extend<T>(list: &mut Vec<T>, items: impl IntoIterator<Item = T>) -> Result<()> {
    let items = items.into_iter();
    let (least, most) = items.size_hint();
    reserve(list, least)?;
    if most == Some(least) {
        list.extend(items);
        return Ok(());
    }
    for item in items {
        push(list, item)?;
    }
    Ok(())
}

/// A list of `items`.
pub(crate) fn collect<T>(items: impl IntoIterator<Item = T>) -> Result<Vec<T>> {
    let mut list = Vec::new();
    extend(&mut list, items)?;
    Ok(list)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg_attr(miri, ignore = "Miri ends where memory cannot be had")]
    fn what_cannot_be_had_is_an_error_with_its_bytes() {
        let bytes = usize::MAX / 2;
        assert_eq!(filled(bytes, 0u8).unwrap_err(), HogError::Memory { bytes });
        assert_eq!(with_room::<u64>(usize::MAX).unwrap_err(), HogError::Memory { bytes: usize::MAX });
        assert_eq!(collect((0..bytes).map(|i| i as u8)).unwrap_err(), HogError::Memory { bytes });
        let mut list = vec![1u8, 2];
        assert!(resize(&mut list, bytes, 0).is_err());
        assert_eq!(list, [1, 2]);
    }

    #[test]
    fn lists_hold_what_was_put_in() {
        let mut list = filled(2, 7).unwrap();
        resize(&mut list, 3, 8).unwrap();
        push(&mut list, 9).unwrap();
        extend(&mut list, (0..10).filter(|i| i % 5 == 0)).unwrap();
        assert_eq!(list, [7, 7, 8, 9, 0, 5]);
        resize(&mut list, 1, 0).unwrap();
        assert_eq!(collect(list).unwrap(), [7]);
    }
}
