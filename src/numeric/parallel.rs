//! Parallel loops whose results have the order of the items.
//!
//! Rayon generates code for each of its loops. Here there is one for all: a hundred loops took a sixth of the program's compile
//! time.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use crate::readout::interrupt;

/// The result of each item, in the order of the items.
///
/// # Panics
/// As `one` does; with [`interrupt::Interrupted`] if the thread's work is interrupted.
pub fn map<I, R>(items: I, one: impl Fn(I::Item) -> R + Sync) -> Vec<R>
where
    I: IntoIterator<Item: Send>,
    R: Send,
{
    type Place<T, R> = Mutex<(Option<T>, Option<R>)>;
    let places: Vec<Place<I::Item, R>> = items.into_iter().map(|item| Mutex::new((Some(item), None))).collect();
    for_each(places.len(), &|index| {
        interrupt::check();
        let locked = || places[index].lock().unwrap_or_else(PoisonError::into_inner);
        let item = locked().0.take();
        // Not while the mutex is locked: `one` may take long.
        let result = item.map(&one);
        locked().1 = result;
    });
    let result = |place: Place<I::Item, R>| place.into_inner().unwrap_or_else(PoisonError::into_inner).1;
    places.into_iter().map(|place| result(place).expect("each item was computed")).collect()
}

/// The same if an item may fail. Items after a failed one may be skipped.
///
/// # Errors
/// That of the first failed item, in the order of the items, for any number of threads.
pub fn try_map<I, R, E>(items: I, one: impl Fn(I::Item) -> Result<R, E> + Sync) -> Result<Vec<R>, E>
where
    I: IntoIterator<Item: Send>,
    R: Send,
    E: Send,
{
    let failed = AtomicUsize::new(usize::MAX);
    let results = map(items.into_iter().enumerate(), |(index, item)| {
        if index > failed.load(Ordering::Relaxed) {
            return None;
        }
        let result = one(item);
        if result.is_err() {
            failed.fetch_min(index, Ordering::Relaxed);
        }
        Some(result)
    });
    results.into_iter().flatten().collect()
}

fn for_each(count: usize, one: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().with_min_len(interrupt::piece(count)).for_each(one);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_the_order_of_the_items_with_any_number_of_threads() {
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert_eq!(pool.install(|| map(0..1000, |x| 2 * x)), (0..1000).map(|x| 2 * x).collect::<Vec<_>>());
            let odd = |x: i32| if x % 2 == 0 { Ok(x) } else { Err(x) };
            assert_eq!(pool.install(|| try_map([4, 3, 2, 1], odd)), Err(3));
            assert_eq!(pool.install(|| try_map([4, 2], odd)), Ok(vec![4, 2]));
            let failing = |x: i32| if x < 50 { Ok(x) } else { Err(x) };
            assert_eq!(pool.install(|| try_map(0..1000, failing)), Err(50));
        }
    }

    #[test]
    fn a_panic_reaches_the_caller() {
        let caught = std::panic::catch_unwind(|| map([1], |_| std::panic::resume_unwind(Box::new("stop"))));
        assert_eq!(*caught.unwrap_err().downcast::<&str>().unwrap(), "stop");
    }
}
