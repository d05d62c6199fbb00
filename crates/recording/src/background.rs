//! Writes a recording on a thread of its own: encoding and compression take longer than a tick may.

use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;

use protocol::{Event, Tick};

use crate::content::RecordedTick;
use crate::write::{CHUNK_INTERVAL, WriteError, Writer};

/// Ticks that may wait to be written. The run waits when there are more.
const QUEUE: usize = 64;

/// Writes a recording on a thread of its own. The thread ends with this value; errors are returned by the first method that is
/// called after they occurred, at the latest by [`BackgroundWriter::finish`].
pub struct BackgroundWriter {
    jobs: Option<SyncSender<Job>>,
    thread: Option<JoinHandle<Result<(), WriteError>>>,
}

enum Job {
    Tick(Box<RecordedTick>),
    /// Answered when everything so far is on the disk.
    Sync(SyncSender<()>),
    /// The event of the end follows the last tick.
    End(Tick, Box<Event>),
}

impl BackgroundWriter {
    /// Starts a thread that writes with `writer`.
    #[must_use]
    pub fn start(writer: Writer) -> Self {
        let (jobs, queue) = sync_channel(QUEUE);
        Self {
            jobs: Some(jobs),
            thread: Some(std::thread::spawn(move || write(writer, &queue))),
        }
    }

    /// Hands a tick over. Waits while too many ticks wait to be written.
    ///
    /// # Errors
    /// [`WriteError`] if what was handed over before cannot be written.
    pub fn tick(&mut self, tick: RecordedTick) -> Result<(), WriteError> {
        self.send(Job::Tick(Box::new(tick)))
    }

    /// Waits until everything so far is on the disk.
    ///
    /// # Errors
    /// [`WriteError`] if it cannot be written.
    pub fn sync(&mut self) -> Result<(), WriteError> {
        let (done, wait) = sync_channel(1);
        self.send(Job::Sync(done))?;
        match wait.recv() {
            Ok(()) => Ok(()),
            Err(_) => self.join(),
        }
    }

    /// Hands over the event of the end of the run, after its last tick.
    ///
    /// # Errors
    /// [`WriteError`] if what was handed over before cannot be written.
    pub fn end(&mut self, last: Tick, event: &Event) -> Result<(), WriteError> {
        self.send(Job::End(last, Box::new(event.clone())))
    }

    /// Waits until everything is written and the file is ended.
    ///
    /// # Errors
    /// [`WriteError`] if it cannot be written.
    pub fn finish(mut self) -> Result<(), WriteError> {
        self.join()
    }

    fn send(&mut self, job: Job) -> Result<(), WriteError> {
        match &self.jobs {
            Some(jobs) if jobs.send(job).is_ok() => Ok(()),
            // The thread has ended with an error.
            _ => self.join(),
        }
    }

    /// Waits until the thread has written everything and ended.
    fn join(&mut self) -> Result<(), WriteError> {
        self.jobs = None;
        match self.thread.take().map(JoinHandle::join) {
            None => Ok(()),
            Some(Ok(written)) => written,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
        }
    }
}

/// A writer that is dropped writes everything that it was given, without reporting errors.
impl Drop for BackgroundWriter {
    fn drop(&mut self) {
        self.jobs = None;
        if let Some(thread) = self.thread.take() {
            drop(thread.join());
        }
    }
}

/// Writes until there is nothing more to come.
fn write(mut writer: Writer, queue: &Receiver<Job>) -> Result<(), WriteError> {
    loop {
        match queue.recv_timeout(CHUNK_INTERVAL) {
            Ok(Job::Tick(tick)) => writer.tick(&tick)?,
            Ok(Job::Sync(done)) => {
                writer.sync()?;
                // A run that has stopped waiting needs no answer.
                let _ = done.send(());
            }
            Ok(Job::End(last, event)) => writer.end(last, &event)?,
            // The run is slow, or held: what there is can be kept already.
            Err(RecvTimeoutError::Timeout) => writer.flush()?,
            Err(RecvTimeoutError::Disconnected) => return writer.finish(),
        }
    }
}
