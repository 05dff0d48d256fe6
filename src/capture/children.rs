//! Programs that run for this one: none outlives it, whatever it hangs at.

use std::collections::BTreeSet;
use std::io;
use std::process::{Child, Command, ExitStatus};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Their process ids.
static RUNNING: Mutex<BTreeSet<u32>> = Mutex::new(BTreeSet::new());

/// A program that runs. Dropped, it is ended.
pub struct RunningChild {
    /// Its pipes may be taken; who waits for it here would leave it listed.
    pub child: Child,
}

impl RunningChild {
    /// Starts a program, out of reach of the terminal's Ctrl-C: who started it says when it ends.
    ///
    /// # Errors
    /// It cannot be started.
    pub fn start(command: &mut Command) -> io::Result<Self> {
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(command, 0);
        let mut running = running();
        let child = command.spawn()?;
        running.insert(child.id());
        Ok(Self { child })
    }

    /// Its status, once it has ended.
    ///
    /// # Errors
    /// The system does not tell.
    pub fn try_wait(&mut self) -> io::Result<Option<ExitStatus>> {
        // Its id is another's as soon as it was waited for.
        let mut running = running();
        let status = self.child.try_wait()?;
        if status.is_some() {
            running.remove(&self.child.id());
        }
        Ok(status)
    }

    /// Ends it.
    pub fn end(&mut self) {
        // Both fail only where it has ended already.
        _ = self.child.kill();
        let mut running = running();
        _ = self.child.wait();
        running.remove(&self.child.id());
    }
}

impl Drop for RunningChild {
    fn drop(&mut self) {
        self.end();
    }
}

/// Ends all programs that run for this one, which is about to end itself and starts no more.
pub fn end_all() {
    #[cfg(unix)]
    for &id in running().iter() {
        let id = i32::try_from(id)
            .ok()
            .and_then(rustix::process::Pid::from_raw);
        // It may have ended just now.
        _ = id.map(|id| rustix::process::kill_process(id, rustix::process::Signal::KILL));
    }
}

fn running() -> MutexGuard<'static, BTreeSet<u32>> {
    RUNNING.lock().unwrap_or_else(PoisonError::into_inner)
}
