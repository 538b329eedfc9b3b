//! Requests in, chunks read from the file and checked out, by threads that own the file.
//!
//! Requests stand in two lists: what is wanted now, and what will be, which is read when the first list is empty. A
//! thread takes a few at a time, and reads those together that lie together in the file. Lists may be emptied
//! at any time: what is no longer wanted is never read.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

use crossbeam_channel::Sender;
use parking_lot::{Condvar, Mutex};

use crate::container::ContainerError;
use crate::scene::Scene;
use crate::scene::part::{Chunk, ResidentPart};

/// A chunk of a part, and the bytes of memory that it takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Request {
    pub part: u32,
    pub tier: u32,
    pub bytes: u64,
}

/// What was read.
pub(super) enum Read {
    /// The coarsest tier of a part, as a part of its own.
    Part(Box<ResidentPart>),
    /// Another tier.
    Chunk(Chunk),
}

/// Some requests, each with what was read.
pub(super) type Arrivals = Vec<(Request, Result<Read, ContainerError>)>;

/// Whether something is wanted now, or will be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum When {
    Now,
    Ahead,
}

/// What the threads share with the one that asks.
pub(super) struct Readers {
    scene: Arc<Scene>,
    todo: Mutex<Todo>,
    changed: Condvar,
    read_rate: Option<u64>,
    /// When the disk that is as slow as asked for is free again.
    free_at: Mutex<Instant>,
}

#[derive(Default)]
struct Todo {
    now: VecDeque<Request>,
    ahead: VecDeque<Request>,
    /// Bytes of what was taken from the lists and has not been accepted.
    bytes_in_flight: u64,
    closed: bool,
}

impl Todo {
    fn list(&mut self, when: When) -> &mut VecDeque<Request> {
        match when {
            When::Now => &mut self.now,
            When::Ahead => &mut self.ahead,
        }
    }
}

/// A thread takes no more requests than these at a time, ...
const MOST_TAKEN: usize = 64;
/// ... and no more bytes, if it is more than one request.
const MOST_BYTES_TAKEN: u64 = 1 << 18;
/// What lies no farther apart in the file is read together, with what lies between.
const MOST_GAP: u64 = 1 << 12;
/// A disk that is as slow as asked for gives so many times a second.
const GIFTS_A_SECOND: u64 = 64;

impl Readers {
    pub fn new(scene: &Arc<Scene>, read_rate: Option<u64>) -> Self {
        Self {
            scene: Arc::clone(scene),
            todo: Mutex::default(),
            changed: Condvar::new(),
            read_rate,
            free_at: Mutex::new(Instant::now()),
        }
    }

    /// Empties a list; returns what nobody had taken.
    pub fn withdraw(&self, when: When) -> VecDeque<Request> {
        std::mem::take(self.todo.lock().list(when))
    }

    /// Appends to a list.
    pub fn give(&self, when: When, requests: impl Iterator<Item = Request>) {
        self.todo.lock().list(when).extend(requests);
        self.changed.notify_all();
    }

    /// Bytes of what was taken from the lists and has not been [accepted](Self::accepted).
    pub fn bytes_in_flight(&self) -> u64 {
        self.todo.lock().bytes_in_flight
    }

    /// Says that so many bytes have arrived where they were asked for.
    pub fn accepted(&self, bytes: u64) {
        self.todo.lock().bytes_in_flight -= bytes;
    }

    /// Empties the lists, and ends the threads.
    pub fn close(&self) {
        {
            let mut todo = self.todo.lock();
            todo.closed = true;
            todo.now.clear();
            todo.ahead.clear();
        }
        self.changed.notify_all();
    }

    /// Reads what is on the lists until they are closed.
    pub fn serve(&self, done: &Sender<Arrivals>) {
        let (mut taken, mut buffer) = (Vec::new(), Vec::new());
        while self.take(&mut taken) {
            let mut arrivals = Vec::with_capacity(taken.len());
            self.read(&mut taken, &mut buffer, &mut arrivals);
            self.pace(taken.iter().map(|request| request.bytes).sum());
            if done.send(arrivals).is_err() {
                return;
            }
        }
    }

    /// The next requests, once there are some; `false` at the end.
    fn take(&self, taken: &mut Vec<Request>) -> bool {
        taken.clear();
        let most_bytes =
            self.read_rate.map_or(MOST_BYTES_TAKEN, |rate| MOST_BYTES_TAKEN.min(rate / GIFTS_A_SECOND));
        let mut todo = self.todo.lock();
        loop {
            if todo.closed {
                return false;
            }
            let when = if todo.now.is_empty() { When::Ahead } else { When::Now };
            let mut bytes = 0;
            while let Some(&next) = todo.list(when).front() {
                bytes += next.bytes;
                if !taken.is_empty() && (taken.len() == MOST_TAKEN || bytes > most_bytes) {
                    break;
                }
                todo.bytes_in_flight += next.bytes;
                taken.push(next);
                todo.list(when).pop_front();
            }
            if !taken.is_empty() {
                return true;
            }
            self.changed.wait(&mut todo);
        }
    }

    /// Reads all requests, those that lie together together.
    fn read(&self, requests: &mut [Request], buffer: &mut Vec<u8>, arrivals: &mut Arrivals) {
        let range = |request: &Request| self.scene.chunk_range(request.part, request.tier);
        requests.sort_unstable_by_key(|request| range(request).start);
        let are_near = |a: &Request, b: &Request| range(b).start.saturating_sub(range(a).end) <= MOST_GAP;
        for run in requests.chunk_by(are_near) {
            let bytes = range(&run[0]).start..range(&run[run.len() - 1]).end;
            buffer.resize((bytes.end - bytes.start) as usize, 0);
            let whole = run.len() > 1 && self.scene.read_bytes(buffer, bytes.start).is_ok();
            for request in run {
                let Request { part, tier, .. } = *request;
                let own = (range(request).start - bytes.start) as usize;
                // Where they cannot be read together, each tells by itself what is wrong with it.
                let chunk = match whole {
                    true => self.scene.chunk_of(part, tier, &buffer[own..]),
                    false => self.scene.read_chunk(part, tier),
                };
                arrivals.push((*request, chunk.map(|chunk| self.arrived(*request, chunk))));
            }
        }
    }

    fn arrived(&self, request: Request, chunk: Chunk) -> Read {
        let tiers = self.scene.tiers(request.part).len() as u32;
        if request.tier + 1 < tiers {
            return Read::Chunk(chunk);
        }
        let mut part = ResidentPart::new(tiers);
        part.arrive(request.tier, chunk);
        Read::Part(Box::new(part))
    }

    /// Waits as long as a slow disk would take.
    fn pace(&self, bytes: u64) {
        let Some(rate) = self.read_rate else { return };
        let until = {
            let mut free_at = self.free_at.lock();
            *free_at = (*free_at).max(Instant::now()) + Duration::from_secs_f64(bytes as f64 / rate as f64);
            *free_at
        };
        std::thread::sleep(until.saturating_duration_since(Instant::now()));
    }
}
