//! A cache of results that take long and are needed repeatedly for few inputs: the latest ones are kept for the process.

use std::sync::Mutex;

/// The latest results of a pure function. The cache changes the time, never the value.
pub(crate) struct Recent<K, V> {
    kept: Mutex<Vec<(K, V)>>,
    most: usize,
}

impl<K: PartialEq, V: Clone> Recent<K, V> {
    /// With this maximum number of results.
    pub const fn new(most: usize) -> Recent<K, V> {
        Recent { kept: Mutex::new(Vec::new()), most }
    }

    /// The result for an input, computed if not cached. Threads that need it simultaneously may each compute it.
    pub fn get(&self, input: K, make: impl FnOnce(&K) -> V) -> V {
        let kept = || self.kept.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        if let Some((_, found)) = kept().iter().find(|(known, _)| *known == input) {
            return found.clone();
        }
        let made = make(&input);
        let mut kept = kept();
        if kept.len() == self.most {
            kept.remove(0);
        }
        kept.push((input, made.clone()));
        made
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_results_are_kept_and_no_more() {
        let recent: Recent<u32, u32> = Recent::new(2);
        let made = std::cell::Cell::new(0);
        let ask = |input: u32| {
            recent.get(input, |input| {
                made.set(made.get() + 1);
                input * input
            })
        };
        assert_eq!((ask(3), ask(3), ask(4)), (9, 9, 16));
        assert_eq!(made.get(), 2);
        assert_eq!((ask(5), ask(4), ask(3)), (25, 16, 9));
        assert_eq!(made.get(), 4);
    }
}
