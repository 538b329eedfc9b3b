//! Requests in, chunks read from the file, decoded and checked out, by threads that own the file.
//!
//! Requests stand in two lists: what is wanted now, and what will be, which is read when the first list is empty. A
//! thread takes a few at a time, and reads those together that lie together in the file. Lists may be emptied
//! at any time: what is no longer wanted is never read.
//!
//! A compressed chunk is stored as differences from all coarser ones of its part. Those that are held, or were decoded
//! just before, are taken from memory; others are read again. Chunks of one such part are with one thread at a time, so
//! that no thread reads again what another is decoding.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

use crossbeam_channel::Sender;
use parking_lot::{Condvar, Mutex};
use rustc_hash::FxHashSet;

use super::known::{Known, is_compressed};
use crate::container::{Chunk, ContainerError};
use crate::scene::Scene;
use crate::scene::part::ResidentPart;

/// A chunk of a part, and the bytes of memory that it takes once it is decoded.
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
    Chunk(Arc<Chunk>),
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
    known: Known<Chunk>,
}

#[derive(Default)]
struct Todo {
    now: VecDeque<Request>,
    ahead: VecDeque<Request>,
    /// Bytes of what was taken from the lists and has not been accepted.
    bytes_in_flight: u64,
    /// The parts with compressed chunks of which a thread reads some.
    busy: FxHashSet<u32>,
    closed: bool,
}

impl Todo {
    fn list(&mut self, when: When) -> &mut VecDeque<Request> {
        match when {
            When::Now => &mut self.now,
            When::Ahead => &mut self.ahead,
        }
    }

    /// Takes the first request of a list that is of no busy part, and those after it as long as `fits` says so.
    fn take(&mut self, when: When, taken: &mut Vec<Request>, mut fits: impl FnMut(&Request) -> bool) {
        let mut passed = Vec::new();
        while passed.len() < MOST_PASSED
            && let Some(next) = self.list(when).pop_front()
        {
            if self.busy.contains(&next.part) {
                passed.push(next);
            } else if fits(&next) && taken.len() < MOST_TAKEN || taken.is_empty() {
                self.bytes_in_flight += next.bytes;
                taken.push(next);
            } else {
                passed.push(next);
                break;
            }
        }
        passed.into_iter().rev().for_each(|request| self.list(when).push_front(request));
    }
}

/// A thread takes no more requests than these at a time, ...
const MOST_TAKEN: usize = 64;
/// ... passes by no more that others are busy with, ...
const MOST_PASSED: usize = 256;
/// ... and takes no more bytes once they are decoded, if it is more than one request.
const MOST_BYTES_TAKEN: u64 = 1 << 18;
/// What lies no farther apart in the file is read together, with what lies between.
const MOST_GAP: u64 = 1 << 12;
/// A disk that is as slow as asked for gives so many times a second.
const GIFTS_A_SECOND: u64 = 64;
/// More threads than this do not make a disk faster.
const READERS: usize = 2;
/// Where what is read is compressed, half of the cores decode it, but no more than this.
const DECODERS: usize = 8;

impl Readers {
    pub fn new(scene: &Arc<Scene>, read_rate: Option<u64>) -> Self {
        Self {
            scene: Arc::clone(scene),
            todo: Mutex::default(),
            changed: Condvar::new(),
            read_rate,
            free_at: Mutex::new(Instant::now()),
            known: Known::default(),
        }
    }

    /// How many threads shall [serve](Self::serve).
    pub fn worker_count(&self) -> usize {
        let parts = self.scene.parts().len() as u32;
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        match (0..parts).take(100).any(|part| self.has_compressed(part)) {
            true => (cores / 2).clamp(READERS, DECODERS),
            false => READERS,
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
            let bytes_stored = self.read(&mut taken, &mut buffer, &mut arrivals);
            self.pace(bytes_stored);
            self.give_back(&taken);
            if done.send(arrivals).is_err() {
                return;
            }
        }
    }

    /// The next requests, once there are some; `false` at the end.
    fn take(&self, taken: &mut Vec<Request>) -> bool {
        taken.clear();
        let most_stored = self.read_rate.map_or(u64::MAX, |rate| rate / GIFTS_A_SECOND);
        let mut todo = self.todo.lock();
        while !todo.closed {
            for when in [When::Now, When::Ahead] {
                let (mut bytes, mut stored) = (0, 0);
                if taken.is_empty() {
                    todo.take(when, taken, |next| {
                        bytes += next.bytes;
                        stored += self.bytes_stored(next.part, next.tier);
                        bytes <= MOST_BYTES_TAKEN && stored <= most_stored
                    });
                }
            }
            if !taken.is_empty() {
                let dependent = taken.iter().map(|request| request.part);
                todo.busy.extend(dependent.filter(|&part| self.has_compressed(part)));
                return true;
            }
            self.changed.wait(&mut todo);
        }
        false
    }

    /// Lets other threads read chunks of the same parts.
    fn give_back(&self, taken: &[Request]) {
        let mut todo = self.todo.lock();
        if !todo.busy.is_empty() {
            taken.iter().for_each(|request| {
                todo.busy.remove(&request.part);
            });
            self.changed.notify_all();
        }
    }

    fn has_compressed(&self, part: u32) -> bool {
        self.scene.tiers(part).iter().any(is_compressed)
    }

    fn bytes_stored(&self, part: u32, tier: u32) -> u64 {
        self.scene.tiers(part)[tier as usize].bytes.into()
    }

    /// Reads all requests, those that lie together together; tells how many stored bytes were read for them.
    fn read(&self, requests: &mut [Request], buffer: &mut Vec<u8>, arrivals: &mut Arrivals) -> u64 {
        let range = |request: &Request| self.scene.chunk_range(request.part, request.tier);
        requests.sort_unstable_by_key(|request| range(request).start);
        let are_near = |a: &Request, b: &Request| range(b).start.saturating_sub(range(a).end) <= MOST_GAP;
        let mut bytes_stored = 0;
        for run in requests.chunk_by(are_near) {
            let bytes = range(&run[0]).start..range(&run[run.len() - 1]).end;
            buffer.resize((bytes.end - bytes.start) as usize, 0);
            let whole = run.len() > 1 && self.scene.read_bytes(buffer, bytes.start).is_ok();
            for request in run {
                let own = (range(request).start - bytes.start) as usize;
                // Where they cannot be read together, each tells by itself what is wrong with it.
                let stored = whole.then(|| &buffer[own..]);
                let chunk = self.read_with_coarser(request, stored, &mut bytes_stored);
                arrivals.push((*request, chunk.map(|chunk| self.arrived(*request, chunk))));
            }
        }
        bytes_stored
    }

    /// Decodes a chunk, from its bytes if they have been read, and before it what it is stored as differences from, if
    /// that is not in memory. A chunk that has arrived in the same run is known.
    fn read_with_coarser(
        &self,
        request: &Request,
        stored: Option<&[u8]>,
        bytes_stored: &mut u64,
    ) -> Result<Arc<Chunk>, ContainerError> {
        let Request { part, tier, .. } = *request;
        let tiers = self.scene.tiers(part);
        let mut coarser: Vec<Arc<Chunk>> = Vec::new();
        if is_compressed(&tiers[tier as usize]) {
            for other in (tier + 1..tiers.len() as u32).rev() {
                let known = self.known.get((part, other));
                coarser.push(
                    known.map_or_else(|| self.read_one((part, other), None, &coarser, bytes_stored), Ok)?,
                );
            }
        }
        self.read_one((part, tier), stored, &coarser, bytes_stored)
    }

    /// Decodes a chunk; `coarser` are those that it is stored as differences from, the coarsest first.
    fn read_one(
        &self,
        (part, tier): (u32, u32),
        stored: Option<&[u8]>,
        coarser: &[Arc<Chunk>],
        bytes_stored: &mut u64,
    ) -> Result<Arc<Chunk>, ContainerError> {
        let coarser: Vec<&Chunk> = coarser.iter().rev().map(Arc::as_ref).collect();
        let chunk = match stored {
            Some(stored) => self.scene.chunk_of(part, tier, &coarser, stored),
            None => self.scene.read_chunk(part, tier, &coarser),
        };
        let chunk = Arc::new(chunk?);
        *bytes_stored += self.bytes_stored(part, tier);
        if self.scene.tiers(part)[..tier as usize].iter().any(is_compressed) {
            self.known.add((part, tier), &chunk);
        }
        Ok(chunk)
    }

    fn arrived(&self, request: Request, chunk: Arc<Chunk>) -> Read {
        let tiers = self.scene.tiers(request.part).len() as u32;
        if request.tier + 1 < tiers {
            return Read::Chunk(chunk);
        }
        let mut part = ResidentPart::new(tiers);
        part.arrive(request.tier, chunk);
        Read::Part(Box::new(part))
    }

    /// Waits as long as a slow disk would take, unless the lists are closed.
    fn pace(&self, bytes: u64) {
        let Some(rate) = self.read_rate else { return };
        let until = {
            let mut free_at = self.free_at.lock();
            *free_at = (*free_at).max(Instant::now()) + Duration::from_secs_f64(bytes as f64 / rate as f64);
            *free_at
        };
        let mut todo = self.todo.lock();
        while !todo.closed && Instant::now() < until {
            self.changed.wait_until(&mut todo, until);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use super::*;
    use crate::bake::{BakeOptions, BakeProgress, bake};

    /// Two wavy sheets, compressed.
    fn readers() -> Readers {
        let mut text = String::new();
        for sheet in 0..2 {
            writeln!(text, "o sheet{sheet}").unwrap();
            for (i, j) in (0..40).flat_map(|i| (0..40).map(move |j| (i, j))) {
                let height = 3.0 * f64::from(i * (sheet + 3)).sin() * (0.1 * f64::from(j)).cos();
                writeln!(text, "v {i} {j} {height}").unwrap();
            }
            for (i, j) in (0..39).flat_map(|i| (0..39).map(move |j| (i, j))) {
                let [a, b] = [0, 1].map(|step| 1600 * sheet + 40 * (i + step) + j + 1);
                writeln!(text, "f {a} {b} {}\nf {a} {} {}", b + 1, b + 1, a + 1).unwrap();
            }
        }
        let folder = tempfile::tempdir().unwrap();
        let [source, path] = ["sheets.obj", "sheets.clps"].map(|name| folder.path().join(name));
        std::fs::write(&source, text).unwrap();
        let options = BakeOptions { compress: true, ..BakeOptions::default() };
        bake(&[source], &path, &options, &BakeProgress::default()).unwrap();
        let readers = Readers::new(&Arc::new(Scene::open(&path).unwrap()), None);
        assert!(readers.scene.tiers(0).len() > 2 && readers.scene.tiers(0).iter().all(is_compressed));
        readers
    }

    fn request(part: u32, tier: u32) -> Request {
        Request { part, tier, bytes: 100 }
    }

    fn tiers(readers: &Readers) -> u32 {
        readers.scene.tiers(0).len() as u32
    }

    #[test]
    fn what_a_chunk_is_decoded_from_is_read_again_only_where_it_is_not_held() {
        let readers = readers();
        let all: u64 = (0..tiers(&readers)).map(|tier| readers.bytes_stored(0, tier)).sum();
        let whole = readers.scene.read_part(0).unwrap();
        let (mut buffer, mut alone, mut together) = (Vec::new(), Vec::new(), Vec::new());
        assert_eq!(readers.read(&mut [request(0, 0)], &mut buffer, &mut alone), all);
        assert!(
            matches!(&alone[0].1, Ok(Read::Chunk(chunk)) if chunk.view().triangles == whole.triangles(0))
        );
        let mut each: Vec<Request> = (0..tiers(&readers)).map(|tier| request(0, tier)).collect();
        assert_eq!(readers.read(&mut each, &mut buffer, &mut together), all);
        let mut part = ResidentPart::new(tiers(&readers));
        for (request, read) in together {
            match read.unwrap() {
                Read::Part(coarsest) => part.arrive_all(*coarsest),
                Read::Chunk(chunk) => part.arrive(request.tier, chunk),
            }
        }
        let vertices = 0..readers.scene.parts()[0].vertices;
        let flat =
            |part: &ResidentPart| part.vertices(vertices.clone()).flatten().copied().collect::<Vec<_>>();
        assert_eq!(flat(&part), flat(&whole));
        assert_eq!(part.triangles(0), whole.triangles(0));
        // What has arrived is held, so that only the chunk itself is read.
        let own = readers.bytes_stored(0, 0);
        assert_eq!(readers.read(&mut [request(0, 0)], &mut buffer, &mut Vec::new()), own);
    }

    #[test]
    fn of_a_part_with_compressed_chunks_one_thread_takes_any() {
        let readers = readers();
        let taken = |given: &[Request]| {
            let mut taken = Vec::new();
            readers.give(When::Now, given.iter().copied());
            assert!(readers.take(&mut taken));
            taken
        };
        let first = taken(&[request(0, 2), request(0, 1)]);
        assert_eq!(first, [request(0, 2), request(0, 1)]);
        let second = taken(&[request(0, 0), request(1, 1)]);
        assert_eq!(second, [request(1, 1)]);
        assert_eq!(readers.bytes_in_flight(), 300);
        readers.give_back(&first);
        assert_eq!(taken(&[request(1, 0)]), [request(0, 0)]);
        assert_eq!(readers.withdraw(When::Now), [request(1, 0)]);
    }
}
