//! The thread that opens a source once and reads it until it ends. A driver may hold it for ever, so nobody waits for it.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

use super::error::LiveError;
use super::feed::{Link, LivePicture, Opened, Opener};

/// Pictures that may wait: the one at hand, while the next is decoded.
const QUEUE: usize = 1;

/// What the thread has to say.
pub(super) enum Message {
    Opened(Opened),
    Picture(LivePicture),
    Ended,
    Failed(LiveError),
}

/// The other end of the thread.
pub(super) struct Reader {
    messages: Receiver<Message>,
}

impl Reader {
    pub(super) fn start(opener: Arc<dyn Opener>, again: Option<String>, link: Link) -> Self {
        let (to_source, messages) = sync_channel(QUEUE);
        thread::spawn(move || {
            let last = match read(&*opener, again.as_deref(), &link, &to_source) {
                Ok(()) => Message::Ended,
                Err(error) => Message::Failed(error),
            };
            // Nobody may be listening any more.
            _ = to_source.send(last);
        });
        Self { messages }
    }

    /// What the thread says within `patience`; `None` where it is silent, the error where it is gone without a word.
    pub(super) fn listen(&self, patience: Duration) -> Result<Option<Message>, ReaderGone> {
        match self.messages.recv_timeout(patience) {
            Ok(message) => Ok(Some(message)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(ReaderGone),
        }
    }
}

/// The thread has ended in a panic of a library.
pub(super) struct ReaderGone;

/// Until the source ends, or nobody listens.
fn read(
    opener: &dyn Opener,
    again: Option<&str>,
    link: &Link,
    to_source: &SyncSender<Message>,
) -> Result<(), LiveError> {
    let mut feed = opener.open(again, link)?;
    if to_source.send(Message::Opened(feed.opened())).is_err() {
        return Ok(());
    }
    while !link.is_stopped() {
        let Some(picture) = feed.next_picture()? else {
            break;
        };
        if to_source.send(Message::Picture(picture)).is_err() {
            break;
        }
    }
    Ok(())
}
