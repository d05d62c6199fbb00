//! Writes a recording: ticks are handed over whole, and encoded, compressed and written by a thread of its own.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

use protocol::{Event, Tick};

use crate::content::{Header, RecordedTick, metadata};
use crate::encode::Encoder;
use crate::mcap::{Chunk, McapFile};
use crate::{METADATA, SCENARIO};

/// A chunk ends with the tick in which it gets this large, bytes before compression. A reader that seeks reads whole chunks.
const CHUNK_BYTES: usize = 256 << 10;
/// What was handed over is in the file at most this long after: what a crash can lose.
const CHUNK_INTERVAL: Duration = Duration::from_secs(1);
/// Ticks that may wait to be encoded. The run waits when there are more.
const QUEUE: usize = 256;
/// Ticks that are encoded together: to wake the other thread for each one would take longer than to encode it.
const BATCH: usize = 64;
/// Coordinates of guests that may wait, so that large crowds take no more memory than this and one tick.
const QUEUE_COORDINATES: usize = 1 << 20;

/// A recording cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {error}", path.display())]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// Why.
    pub error: io::Error,
}

/// Writes the recording of an epoch. An error is returned by the first method that is called after it occurred, at the latest
/// by [`Writer::finish`]. A writer that is dropped finishes its file, without reporting errors.
pub struct Writer {
    path: PathBuf,
    queue: Arc<WriteQueue>,
    thread: Option<JoinHandle<io::Result<()>>>,
}

/// What is to be written.
#[derive(Default)]
struct WriteQueue {
    state: Mutex<WriterState>,
    /// The thread that writes has something to do.
    due: Condvar,
    /// The thread that writes has done something.
    done: Condvar,
}

#[derive(Default)]
struct WriterState {
    pending: Batch,
    /// Ticks that have been encoded, for their memory.
    spare: Vec<RecordedTick>,
    /// Everything so far is to be on the disk.
    wants_sync: bool,
    /// Nothing more is to come.
    is_ended: bool,
    /// The thread that writes has ended.
    is_over: bool,
}

/// What is encoded together.
#[derive(Default)]
struct Batch {
    /// In their order.
    ticks: Vec<RecordedTick>,
    /// Coordinates of guests in these ticks.
    coordinates: usize,
    /// Events of the end of the run, which follow its last tick.
    end: Vec<(Tick, Event)>,
    /// When the first of these was handed over.
    begun: Option<Instant>,
}

/// What the thread that writes does when it has encoded a batch.
#[derive(Clone, Copy, PartialEq)]
enum WriterTask {
    /// Writes chunks that are full.
    Encode,
    /// Writes what there is.
    Write,
    Sync,
    Finish,
}

impl Writer {
    /// Creates a recording. `scenario` is the complete scenario file of the epoch.
    ///
    /// # Errors
    /// [`WriteError`] if the file cannot be written.
    pub fn create(path: &Path, header: &Header, scenario: &str) -> Result<Self, WriteError> {
        let encoder = Encoder::new(header);
        let failed = |error| WriteError {
            path: path.to_owned(),
            error,
        };
        let file = begin(path, header, scenario, &encoder).map_err(failed)?;

        let queue = Arc::new(WriteQueue::default());
        let tasks = queue.clone();
        let thread = Builder::new().spawn(move || write(file, &encoder, &tasks));
        Ok(Self {
            path: path.to_owned(),
            queue,
            thread: Some(thread.map_err(failed)?),
        })
    }

    /// A tick to fill and record. It has the content, and the memory, of one that was recorded.
    #[must_use]
    pub fn spare(&self) -> RecordedTick {
        self.queue.lock().spare.pop().unwrap_or_default()
    }

    /// Records a tick. Ticks come in their order, from tick 0 on. Waits while too many wait to be encoded.
    ///
    /// # Errors
    /// [`WriteError`] if what was recorded before cannot be written.
    pub fn tick(&mut self, tick: RecordedTick) -> Result<(), WriteError> {
        let mut state = self.queue.lock();
        // The only wait of a run for its recording. It ends when a batch has been taken, or the thread
        // that writes has ended.
        while state.pending.is_full() && !state.is_over {
            state = wait(&self.queue.done, state);
        }
        if state.is_over {
            drop(state);
            // An error of the other thread: its result is fetched here, once.
            return self.join();
        }

        let was_due = state.pending.is_due();
        state.pending.add(tick);
        if state.pending.is_due() && !was_due {
            self.queue.due.notify_one();
        }
        Ok(())
    }

    /// Records an event of the end of the run, after its last tick.
    ///
    /// # Errors
    /// [`WriteError`] if what was recorded before cannot be written.
    pub fn end(&mut self, last: Tick, event: Event) -> Result<(), WriteError> {
        let mut state = self.queue.lock();
        if state.is_over {
            drop(state);
            return self.join();
        }
        state.pending.end.push((last, event));
        Ok(())
    }

    /// Waits until everything so far is on the disk.
    ///
    /// # Errors
    /// [`WriteError`] if it cannot be written.
    pub fn sync(&mut self) -> Result<(), WriteError> {
        let mut state = self.queue.lock();
        // The other thread writes all that was handed over first, and then synchronizes.
        state.wants_sync = true;
        self.queue.due.notify_one();
        while state.wants_sync && !state.is_over {
            state = wait(&self.queue.done, state);
        }

        let is_over = state.is_over;
        drop(state);
        if is_over { self.join() } else { Ok(()) }
    }

    /// Writes what is left and the index, which makes seeking fast, and ends the file.
    ///
    /// # Errors
    /// [`WriteError`] if the file cannot be written.
    pub fn finish(mut self) -> Result<(), WriteError> {
        self.join()
    }

    /// Waits until the thread has written everything and ended.
    fn join(&mut self) -> Result<(), WriteError> {
        self.queue.lock().is_ended = true;
        self.queue.due.notify_one();

        // It writes all that was handed over before it ends. For a second call there is no thread any
        // more.
        let ended = match self.thread.take().map(JoinHandle::join) {
            None => Ok(()),
            Some(Ok(written)) => written,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
        };
        ended.map_err(|error| WriteError {
            path: self.path.clone(),
            error,
        })
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        self.queue.lock().is_ended = true;
        self.queue.due.notify_one();
        if let Some(thread) = self.thread.take() {
            drop(thread.join());
        }
    }
}

impl WriteQueue {
    fn lock(&self) -> MutexGuard<'_, WriterState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for something to do, and puts what is to be encoded in the place of `batch`, which is empty. `begun` is when the first
    /// tick of the open chunk was handed over.
    fn next(&self, batch: &mut Batch, begun: Option<Instant>) -> WriterTask {
        let mut state = self.lock();
        loop {
            // Also without a word: what there is of a slow run, or of one that is held, is written after a
            // while.
            let age = begun.or(state.pending.begun).map(|begun| begun.elapsed());
            let age = age.unwrap_or_default();
            // A synchronization comes before the end, and both are about all that was handed over.
            let task = if state.wants_sync {
                WriterTask::Sync
            } else if state.is_ended {
                WriterTask::Finish
            } else if age >= CHUNK_INTERVAL {
                WriterTask::Write
            } else {
                WriterTask::Encode
            };

            if task != WriterTask::Encode || state.pending.is_due() {
                std::mem::swap(&mut state.pending, batch);
                self.done.notify_one();
                return task;
            }
            let rest = CHUNK_INTERVAL.saturating_sub(age);
            let waited = self.due.wait_timeout(state, rest);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

impl Batch {
    fn add(&mut self, tick: RecordedTick) {
        self.begun.get_or_insert_with(Instant::now);
        self.coordinates += tick.frame.guests_mm.len();
        self.ticks.push(tick);
    }

    /// Whether it is worth to wake the thread that writes.
    fn is_due(&self) -> bool {
        self.ticks.len() >= BATCH || self.coordinates >= QUEUE_COORDINATES
    }

    fn is_full(&self) -> bool {
        self.ticks.len() >= QUEUE || self.coordinates >= QUEUE_COORDINATES
    }
}

/// Writes until there is nothing more to come.
fn write(mut file: McapFile<File>, encoder: &Encoder, queue: &WriteQueue) -> io::Result<()> {
    // Dropped last, also after an error or a panic: callers that wait get to know.
    let _over = Over(queue);
    let mut batch = Batch::default();
    let mut chunk = Chunk::default();
    let mut begun = None;

    loop {
        let task = queue.next(&mut batch, begun);
        begun = begun.or(batch.begun.take());

        for tick in &batch.ticks {
            encoder.add_tick(tick, &mut chunk);
            if chunk.len() >= CHUNK_BYTES {
                file.add_chunk(&chunk)?;
                chunk.clear();
                begun = Some(Instant::now());
            }
        }
        for (last, event) in batch.end.drain(..) {
            encoder.add_event(last, &event, &mut chunk);
        }
        // Their memory goes round, and all that they hold is freed by the thread that made it.
        batch.coordinates = 0;
        queue.lock().spare.append(&mut batch.ticks);

        if task != WriterTask::Encode {
            if !chunk.is_empty() {
                file.add_chunk(&chunk)?;
                chunk.clear();
            }
            begun = None;
        }
        match task {
            WriterTask::Encode | WriterTask::Write => {}
            WriterTask::Sync => {
                file.sync()?;
                queue.lock().wants_sync = false;
                queue.done.notify_one();
            }
            WriterTask::Finish => return file.finish(),
        }
    }
}

/// The thread that writes, which no caller waits for after it has ended, however it ended.
struct Over<'a>(&'a WriteQueue);

impl Drop for Over<'_> {
    fn drop(&mut self) {
        self.0.lock().is_over = true;
        self.0.done.notify_one();
    }
}

/// Writes what does not change: metadata, the scenario, and all channels with the header in a chunk of their own.
fn begin(
    path: &Path,
    header: &Header,
    scenario: &str,
    encoder: &Encoder,
) -> io::Result<McapFile<File>> {
    let mut file = McapFile::begin(File::create(path)?, "cars", encoder.channels().clone())?;
    file.add_metadata(METADATA, &metadata(header))?;
    file.attach(SCENARIO, "application/toml", scenario.as_bytes())?;
    file.add_chunk(&encoder.preamble())?;
    Ok(file)
}

fn wait<'a>(done: &Condvar, state: MutexGuard<'a, WriterState>) -> MutexGuard<'a, WriterState> {
    done.wait(state).unwrap_or_else(PoisonError::into_inner)
}
