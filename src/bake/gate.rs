//! A cap of memory and what each piece of work needs in; who may start now, out.

use std::time::Duration;

use parking_lot::Mutex;

/// Lets work in as long as all of it together fits.
#[derive(Debug)]
pub(super) struct Gate {
    free: Mutex<u64>,
}

/// Work that was let in; makes room again when it ends.
#[derive(Debug)]
pub(super) struct Admitted<'a> {
    gate: &'a Gate,
    bytes: u64,
}

impl Gate {
    /// A gate for so many bytes.
    pub fn new(bytes: u64) -> Self {
        Self { free: Mutex::new(bytes) }
    }

    /// Waits until so many bytes are free, which must not be more than there are in all. A worker of rayon helps others
    /// meanwhile; it must not be let in already, since what it helps with would wait for itself.
    pub fn admit(&self, bytes: u64) -> Admitted<'_> {
        while !self.take(bytes) {
            if rayon::yield_now() != Some(rayon::Yield::Executed) {
                std::thread::sleep(Duration::from_millis(1));
            }
        }
        Admitted { gate: self, bytes }
    }

    fn take(&self, bytes: u64) -> bool {
        let mut free = self.free.lock();
        let left = free.checked_sub(bytes);
        *free = left.unwrap_or(*free);
        left.is_some()
    }
}

impl Drop for Admitted<'_> {
    fn drop(&mut self) {
        *self.gate.free.lock() += self.bytes;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU64, Ordering};

    #[test]
    fn what_is_let_in_together_never_exceeds_the_cap() {
        let (gate, inside, most) = (Gate::new(10), AtomicU64::new(0), AtomicU64::new(0));
        std::thread::scope(|scope| {
            for worker in 0..4u64 {
                let (gate, inside, most) = (&gate, &inside, &most);
                scope.spawn(move || {
                    for bytes in (0..200).map(|i| 1 + (7 * i + worker) % 10) {
                        let _admitted = gate.admit(bytes);
                        let now = inside.fetch_add(bytes, Ordering::SeqCst) + bytes;
                        most.fetch_max(now, Ordering::SeqCst);
                        inside.fetch_sub(bytes, Ordering::SeqCst);
                    }
                });
            }
        });
        assert!((1..=10).contains(&most.into_inner()));
        assert_eq!(*gate.free.lock(), 10);
    }
}
