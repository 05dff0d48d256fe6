//! Joins two threads of which the faster one waits for nobody: the box holds the newest thing alone.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// A place between threads for at most one thing; a newer one takes its place.
#[derive(Debug)]
pub struct Mailbox<T> {
    content: Mutex<MailboxContent<T>>,
    changed: Condvar,
}

#[derive(Debug)]
struct MailboxContent<T> {
    newest: Option<T>,
    dropped: u64,
    is_closed: bool,
}

/// The contents of a mailbox when it was looked into.
#[derive(Debug, PartialEq, Eq)]
pub enum Taken<T> {
    /// The newest thing.
    New(T),
    /// Nothing has come.
    Nothing,
    /// Nothing will come any more.
    Closed,
}

impl<T> Mailbox<T> {
    /// Empty and open.
    pub fn new() -> Self {
        Self {
            content: Mutex::new(MailboxContent {
                newest: None,
                dropped: 0,
                is_closed: false,
            }),
            changed: Condvar::new(),
        }
    }

    /// Puts the newest thing in, in place of one that nobody took. False where nobody will: the box is closed.
    pub fn put(&self, newest: T) -> bool {
        let mut content = self.content();
        if content.is_closed {
            return false;
        }
        let untaken = content.newest.replace(newest);
        content.dropped += u64::from(untaken.is_some());
        drop(content);
        self.changed.notify_one();
        // What nobody wanted is freed without the lock.
        drop(untaken);
        true
    }

    /// Waits for something new; `None` once the box is closed and empty.
    pub fn take(&self) -> Option<T> {
        let waits =
            |content: &mut MailboxContent<T>| content.newest.is_none() && !content.is_closed;
        let content = self.changed.wait_while(self.content(), waits);
        content
            .unwrap_or_else(PoisonError::into_inner)
            .newest
            .take()
    }

    /// Waits for something new, at most this long: no time at all just looks.
    pub fn take_within(&self, patience: Duration) -> Taken<T> {
        let waits =
            |content: &mut MailboxContent<T>| content.newest.is_none() && !content.is_closed;
        let waited = self
            .changed
            .wait_timeout_while(self.content(), patience, waits);
        let (mut content, _) = waited.unwrap_or_else(PoisonError::into_inner);
        match content.newest.take() {
            Some(newest) => Taken::New(newest),
            None if content.is_closed => Taken::Closed,
            None => Taken::Nothing,
        }
    }

    /// Lets nothing more in and wakes all who wait. What is in it can still be taken.
    pub fn close(&self) {
        self.content().is_closed = true;
        self.changed.notify_all();
    }

    /// Things so far that nobody took before a newer one came.
    pub fn dropped(&self) -> u64 {
        self.content().dropped
    }

    /// A panic elsewhere leaves the content as whole as it was.
    fn content(&self) -> MutexGuard<'_, MailboxContent<T>> {
        self.content.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<T> Default for Mailbox<T> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicI64, Ordering};
    use std::thread;

    /// A thing that counts how many of its kind there are.
    struct CountedItem(u64, Arc<AtomicI64>);

    impl CountedItem {
        fn new(number: u64, alive: &Arc<AtomicI64>) -> Self {
            alive.fetch_add(1, Ordering::SeqCst);
            Self(number, Arc::clone(alive))
        }
    }

    impl Drop for CountedItem {
        fn drop(&mut self) {
            self.1.fetch_sub(1, Ordering::SeqCst);
        }
    }

    #[test]
    fn a_slow_reader_gets_the_newest_and_nothing_queues() {
        const PUT: u64 = 400;
        let mailbox = Arc::new(Mailbox::new());
        let alive = Arc::new(AtomicI64::new(0));
        let last_put = Arc::new(AtomicI64::new(-1));
        let writer = thread::spawn({
            let (mailbox, alive, last_put) = (
                Arc::clone(&mailbox),
                Arc::clone(&alive),
                Arc::clone(&last_put),
            );
            move || {
                for number in 0..PUT {
                    assert!(mailbox.put(CountedItem::new(number, &alive)));
                    last_put.store(number as i64, Ordering::SeqCst);
                    thread::sleep(Duration::from_micros(200));
                }
                mailbox.close();
            }
        });
        let (mut read, mut last) = (0, None);
        loop {
            // Nothing put before this moment may come after it but the newest.
            let put_before = last_put.load(Ordering::SeqCst);
            let Some(CountedItem(number, _)) = mailbox
                .take()
                .as_ref()
                .map(|c| CountedItem::new(c.0, &alive))
            else {
                break;
            };
            assert!(number as i64 >= put_before, "{number} after {put_before}");
            assert!(last < Some(number), "in order");
            last = Some(number);
            read += 1;
            // The one in the box, one in the writer's hands, and one that is being replaced.
            assert!(alive.load(Ordering::SeqCst) <= 3);
            thread::sleep(Duration::from_millis(5));
        }
        writer.join().unwrap();
        assert_eq!(last, Some(PUT - 1), "the last one is never lost");
        assert_eq!(
            read + mailbox.dropped(),
            PUT,
            "each was read or counted as dropped"
        );
        assert!(
            mailbox.dropped() > PUT / 2,
            "{} were dropped",
            mailbox.dropped()
        );
        assert_eq!(alive.load(Ordering::SeqCst), 0);
    }

    #[test]
    fn closing_wakes_all_who_wait() {
        let mailbox = Arc::new(Mailbox::<u32>::new());
        let waiters: Vec<_> = (0..4)
            .map(|number| {
                let mailbox = Arc::clone(&mailbox);
                thread::spawn(move || match number {
                    0 | 1 => mailbox.take().is_none(),
                    _ => mailbox.take_within(Duration::from_secs(600)) == Taken::Closed,
                })
            })
            .collect();
        thread::sleep(Duration::from_millis(30));
        mailbox.close();
        for waiter in waiters {
            assert!(waiter.join().unwrap());
        }
        assert!(!mailbox.put(1), "nobody will take it");
        assert_eq!(mailbox.take(), None);
    }

    #[test]
    fn what_was_in_it_can_be_taken_after_it_was_closed() {
        let mailbox = Mailbox::new();
        assert_eq!(mailbox.take_within(Duration::ZERO), Taken::Nothing);
        mailbox.put(1);
        mailbox.put(2);
        mailbox.close();
        assert_eq!(mailbox.take_within(Duration::ZERO), Taken::New(2));
        assert_eq!(mailbox.take_within(Duration::ZERO), Taken::Closed);
        assert_eq!(mailbox.dropped(), 1);
    }
}
