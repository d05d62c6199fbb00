//! Writes a recording: ticks are encoded where they are handed over, and compressed and written by a thread of its own.

use std::collections::VecDeque;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

use protocol::{Event, Tick};

use crate::content::{Header, TickView, metadata};
use crate::encode::Encoder;
use crate::file::{Chunk, McapFile};
use crate::{METADATA, SCENARIO};

/// A chunk ends with the tick in which it gets this large, bytes before compression. A reader that seeks reads whole chunks.
const CHUNK_BYTES: usize = 256 << 10;
/// A chunk ends with the first tick that is complete this long after the chunk began: what a crash can lose of a slow run.
const CHUNK_INTERVAL: Duration = Duration::from_secs(1);
/// Chunks that may wait to be written. The run waits when there are more.
const QUEUE: usize = 16;

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
    encoder: Encoder,
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
    /// Chunks in their order. The last one gets further ticks if it is open.
    chunks: VecDeque<OpenChunk>,
    /// Chunks that have been written, for their memory.
    spare: Vec<Chunk>,
    /// Everything so far is to be on the disk.
    wants_sync: bool,
    /// Nothing more is to come.
    is_ended: bool,
    /// The thread that writes has ended.
    is_over: bool,
}

/// A chunk that gets ticks until it is full.
struct OpenChunk {
    chunk: Chunk,
    begun: Instant,
    is_full: bool,
}

/// What the thread that writes does next.
enum WriterTask {
    Write(Chunk),
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
        let thread = Builder::new().spawn(move || write(file, &tasks));
        Ok(Self {
            path: path.to_owned(),
            encoder,
            queue,
            thread: Some(thread.map_err(failed)?),
        })
    }

    /// Records a tick. Ticks come in their order, from tick 0 on. Waits while too many chunks wait to be written.
    ///
    /// # Errors
    /// [`WriteError`] if what was recorded before cannot be written.
    pub fn tick(&mut self, tick: &TickView<'_>) -> Result<(), WriteError> {
        let mut state = self.queue.lock();
        // The only wait of a run for its recording. It ends when a chunk has been written, or the
        // thread that writes has ended.
        while state.chunks.len() > QUEUE && !state.is_over {
            state = wait(&self.queue.done, state);
        }
        if state.is_over {
            drop(state);
            // An error of the other thread: its result is fetched here, once.
            return self.join();
        }

        // Encoded under the lock, so that the other thread takes whole ticks only.
        let open = state.open_chunk();
        self.encoder.add_tick(tick, &mut open.chunk);
        if open.is_due() {
            open.is_full = true;
            self.queue.due.notify_one();
        }
        Ok(())
    }

    /// Records an event of the end of the run, after its last tick.
    ///
    /// # Errors
    /// [`WriteError`] if what was recorded before cannot be written.
    pub fn end(&mut self, last: Tick, event: &Event) -> Result<(), WriteError> {
        let mut state = self.queue.lock();
        if state.is_over {
            drop(state);
            return self.join();
        }
        self.encoder
            .add_event(last, event, &mut state.open_chunk().chunk);
        Ok(())
    }

    /// Waits until everything so far is on the disk.
    ///
    /// # Errors
    /// [`WriteError`] if it cannot be written.
    pub fn sync(&mut self) -> Result<(), WriteError> {
        let mut state = self.queue.lock();
        // The other thread writes every chunk first, the open one included, and then synchronizes.
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

        // It writes all chunks before it finds that nothing more is to come. For a second call there is
        // no thread any more.
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

    /// Waits for something to do.
    fn next(&self) -> WriterTask {
        let mut state = self.lock();
        loop {
            // Chunks come before a synchronization, and that before the end: so both are about all that
            // was recorded.
            if let Some(chunk) = state.next_chunk() {
                return WriterTask::Write(chunk);
            }
            if state.wants_sync {
                return WriterTask::Sync;
            }
            if state.is_ended {
                return WriterTask::Finish;
            }

            // Also without a word: a chunk of a slow run, or of one that is held, becomes due with time.
            let first = state.chunks.front();
            let age = first.map_or(Duration::ZERO, |first| first.begun.elapsed());
            let rest = CHUNK_INTERVAL.saturating_sub(age);
            let waited = self.due.wait_timeout(state, rest);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

impl WriterState {
    /// The chunk that gets the next tick.
    fn open_chunk(&mut self) -> &mut OpenChunk {
        // Also after the other thread has taken the open chunk.
        if self.chunks.back().is_none_or(|last| last.is_full) {
            let chunk = self.spare.pop().unwrap_or_default();
            self.chunks.push_back(OpenChunk {
                chunk,
                begun: Instant::now(),
                is_full: false,
            });
        }
        let last = self.chunks.len() - 1;
        &mut self.chunks[last]
    }

    /// The next chunk, if it is to be written. In a run that is slow, or held, what there is is kept.
    fn next_chunk(&mut self) -> Option<Chunk> {
        let is_due = self.wants_sync || self.is_ended;
        let first = self.chunks.front()?;
        if !is_due && !first.is_full && !first.is_due() {
            return None;
        }
        self.chunks.pop_front().map(|first| first.chunk)
    }
}

impl OpenChunk {
    /// Whether it is large enough, or old enough.
    fn is_due(&self) -> bool {
        self.chunk.len() >= CHUNK_BYTES || self.begun.elapsed() >= CHUNK_INTERVAL
    }
}

/// Writes until there is nothing more to come.
fn write(mut file: McapFile, queue: &WriteQueue) -> io::Result<()> {
    // Dropped last, also after an error or a panic: callers that wait get to know.
    let _over = Over(queue);

    loop {
        match queue.next() {
            WriterTask::Write(mut chunk) => {
                file.add_chunk(&chunk)?;
                // Its memory goes round: at full speed nothing is allocated for a tick.
                chunk.clear();
                queue.lock().spare.push(chunk);
            }
            WriterTask::Sync => {
                file.sync()?;
                queue.lock().wants_sync = false;
            }
            WriterTask::Finish => return file.finish(),
        }

        queue.done.notify_one();
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
fn begin(path: &Path, header: &Header, scenario: &str, encoder: &Encoder) -> io::Result<McapFile> {
    let mut file = McapFile::begin(File::create(path)?, "cars", encoder.channels().clone())?;
    file.add_metadata(METADATA, &metadata(header))?;
    file.attach(SCENARIO, "application/toml", scenario.as_bytes())?;
    file.add_chunk(&encoder.preamble())?;
    Ok(file)
}

fn wait<'a>(done: &Condvar, state: MutexGuard<'a, WriterState>) -> MutexGuard<'a, WriterState> {
    done.wait(state).unwrap_or_else(PoisonError::into_inner)
}
