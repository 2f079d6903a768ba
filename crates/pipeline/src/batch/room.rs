//! How many pictures may be in memory at once.

use crate::capture::Loaded;
use std::fs;
use std::sync::{Condvar, Mutex, PoisonError};

/// Memory that all captures in work may take together, bytes, unless one alone takes more.
const LIMIT: u64 = 2 << 30;
/// Memory of a capture for each byte of its longest file. At the peak of a merge there are two
/// files and, for each sample of two bytes, a sum and a variance of four.
const PER_BYTE: u64 = 8;
/// Memory of the smallest capture, bytes.
const LEAST: u64 = 16 << 20;

/// What captures in work take of [`LIMIT`].
#[derive(Debug, Default)]
pub(super) struct Room {
    taken: Mutex<u64>,
    freed: Condvar,
}

/// What one capture takes, until it is dropped.
pub(super) struct Taken<'a> {
    room: &'a Room,
    bytes: u64,
}

impl Room {
    /// Waits until there is room for a capture.
    pub(super) fn take(&self, loaded: &Loaded) -> Taken<'_> {
        let lengths = loaded.paths();
        let lengths = lengths.iter().filter_map(|path| fs::metadata(path).ok());
        let longest = lengths.map(|data| data.len()).max().unwrap_or(0);
        self.take_bytes(LEAST.saturating_add(longest.saturating_mul(PER_BYTE)))
    }

    fn take_bytes(&self, bytes: u64) -> Taken<'_> {
        // A number is never half changed, whoever panics.
        let taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        let full = |taken: &mut u64| *taken > 0 && taken.saturating_add(bytes) > LIMIT;
        let mut taken =
            (self.freed.wait_while(taken, full)).unwrap_or_else(PoisonError::into_inner);
        *taken = taken.saturating_add(bytes);
        Taken { room: self, bytes }
    }
}

impl Drop for Taken<'_> {
    fn drop(&mut self) {
        let mut taken = self
            .room
            .taken
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        *taken = taken.saturating_sub(self.bytes);
        self.room.freed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU64, Ordering};

    #[test]
    fn no_more_is_taken_than_there_is_unless_one_alone_needs_more() {
        let room = Room::default();
        let most = AtomicU64::new(0);
        let count = AtomicU64::new(0);
        std::thread::scope(|scope| {
            for turn in 0..16 {
                let (room, most, count) = (&room, &most, &count);
                scope.spawn(move || {
                    let bytes = if turn == 7 { 3 * LIMIT } else { LIMIT / 3 };
                    let _taken = room.take_bytes(bytes);
                    let now = *room.taken.lock().unwrap();
                    assert!(now <= LIMIT || now == bytes, "{now}");
                    most.fetch_max(now, Ordering::Relaxed);
                    count.fetch_add(1, Ordering::Relaxed);
                });
            }
        });
        assert_eq!(count.into_inner(), 16);
        assert_eq!(most.into_inner(), 3 * LIMIT);
        assert_eq!(*room.taken.lock().unwrap(), 0);
    }
}
