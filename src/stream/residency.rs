//! What the view wants of each part in, the chunks in memory out, under a cap.
//!
//! Every plan says anew what shall be in memory: of what is wanted, as much as the cap has room for, the most projected
//! error removed for each byte first, so that where the cap bites the error rises evenly over the view. What is in memory
//! and not wanted stays as long as there is room, and goes in the order in which it was last wanted.
//!
//! Workers own the file: they read a chunk, check it against its checksum, decode it and hand it over, so that the frame
//! thread never waits for a page. The cap counts what chunks take once they are decoded. The list of what they read next is replaced by every plan: what is no longer wanted is never
//! read. What is being read counts within the cap. What is drawn is what has arrived.

use std::cmp::{Ordering, Reverse};
use std::collections::{HashMap, VecDeque};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crossbeam_channel::{Receiver, Sender, unbounded};
use parking_lot::{Condvar, Mutex};
use rayon::prelude::*;

use super::known::{Known, is_compressed};
use crate::container::{Chunk, ContainerError};
use crate::geometry::part::sampled_count;
use crate::geometry::record::decode_error;
use crate::scene::Scene;
use crate::scene::part::{ResidentPart, bytes_of};

/// Why data did not arrive.
#[derive(Debug, thiserror::Error)]
pub enum ResidencyError {
    /// A chunk is damaged.
    #[error(transparent)]
    Container(#[from] ContainerError),
    /// The workers are gone, which happens only when they panicked.
    #[error("the threads that read the model have ended; this is a bug in collapsar, please report it")]
    WorkersGone,
}

/// How to hold and read chunks.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ResidencyOptions {
    /// Bytes that may be held, with those that are being read; `None` for no cap.
    pub cap_bytes: Option<u64>,
    /// Bytes a second that are read at most, as from a slow disk; `None` for as fast as it goes.
    pub read_rate: Option<u64>,
}

/// What a view wants of a part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wanted {
    /// The part.
    pub part: u32,
    /// The finest tier that is wanted; all coarser ones are wanted too.
    pub tier: u32,
    /// How much its whole error would be seen: the sum over its instances of the cube of its diagonal in pixels, an area
    /// times a distance.
    pub weight: f32,
}

/// A part and one of its tiers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Request {
    part: u32,
    tier: u32,
    bytes: u64,
}

type Arrival = (Request, Result<Arc<Chunk>, ContainerError>);

/// What the workers share with the frame thread.
#[derive(Default)]
struct Todo {
    queue: VecDeque<Request>,
    /// What a worker has taken and the frame thread has not got yet.
    in_flight: Vec<Request>,
    /// The parts of which a worker is reading a chunk: only one at a time, because a finer one may be stored as
    /// differences from a coarser one.
    busy: Vec<u32>,
    closed: bool,
}

struct Shared {
    scene: Arc<Scene>,
    todo: Mutex<Todo>,
    changed: Condvar,
    read_rate: Option<u64>,
    /// When the disk that is as slow as asked for is free again.
    free_at: Mutex<Instant>,
    known: Known<Chunk>,
}

/// The chunks that are in memory, and the workers that bring more.
pub struct Residency {
    parts: Vec<Option<Box<ResidentPart>>>,
    nothing: ResidentPart,
    /// The parts of which something is in memory.
    held: Vec<u32>,
    /// Per part, the last plan that wanted it.
    wanted_in: Vec<u32>,
    plan: u32,
    cap_bytes: u64,
    shared: Arc<Shared>,
    arrivals: Receiver<Arrival>,
    workers: Vec<JoinHandle<()>>,
    bytes_read: u64,
    bytes_held: u64,
    bytes_evicted: u64,
    /// Whether the cap kept the last plan from all that was wanted.
    is_capped: bool,
}

/// More readers than this do not make a disk faster.
const READERS: usize = 2;
/// Where what is read is compressed, half of the cores decode it, but no more than this.
const DECODERS: usize = 8;

fn worker_count(scene: &Scene) -> usize {
    let compressed =
        (0..scene.parts().len() as u32).take(100).any(|part| scene.tiers(part).iter().any(is_compressed));
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    if compressed { (cores / 2).clamp(READERS, DECODERS) } else { READERS }
}

impl Residency {
    /// Starts the workers; nothing is read yet.
    pub fn new(scene: &Arc<Scene>, options: ResidencyOptions) -> Self {
        let (done, arrivals) = unbounded::<Arrival>();
        let shared = Arc::new(Shared {
            scene: Arc::clone(scene),
            todo: Mutex::default(),
            changed: Condvar::new(),
            read_rate: options.read_rate,
            free_at: Mutex::new(Instant::now()),
            known: Known::default(),
        });
        let workers = (0..worker_count(scene))
            .map(|_| {
                let (shared, done) = (Arc::clone(&shared), done.clone());
                std::thread::spawn(move || serve(&shared, &done))
            })
            .collect();
        let parts = scene.parts().len();
        Self {
            parts: (0..parts).map(|_| None).collect(),
            nothing: ResidentPart::new(0),
            held: Vec::new(),
            wanted_in: vec![0; parts],
            plan: 0,
            cap_bytes: options.cap_bytes.unwrap_or(u64::MAX),
            shared,
            arrivals,
            workers,
            bytes_read: 0,
            bytes_held: 0,
            bytes_evicted: 0,
            is_capped: false,
        }
    }

    /// What is in memory of a part.
    pub fn part(&self, part: u32) -> &ResidentPart {
        self.parts[part as usize].as_deref().unwrap_or(&self.nothing)
    }

    /// Decides what shall be in memory for a view: evicts what there is no room for, and gives the workers a new list of
    /// what to read, the most urgent first. Each part is named once.
    pub fn plan(&mut self, wanted: &[Wanted]) {
        self.plan = self.plan.wrapping_add(1);
        let in_flight = self.shared.stop_taking();
        let accepted = self.accept_within_cap(wanted);
        let mut missing: Vec<(f32, Request)> = Vec::new();
        for (want, &tier) in wanted.iter().zip(&accepted) {
            self.wanted_in[want.part as usize] = self.plan;
            self.missing_of(want, tier, &in_flight, &mut missing);
        }
        let incoming = |requests: &mut dyn Iterator<Item = &Request>| requests.map(|r| r.bytes).sum::<u64>();
        let bytes = incoming(&mut in_flight.iter()) + incoming(&mut missing.iter().map(|entry| &entry.1));
        self.make_room(bytes, wanted, &accepted);
        missing.par_sort_by(urgent_first);
        self.shared.give(missing.into_iter().map(|(_, request)| request));
    }

    /// After a plan, asks for what will be wanted soon: read after everything that is wanted now, into memory that is free
    /// or holds what is neither wanted nor will be. Each part is named once.
    pub fn prefetch(&mut self, ahead: &[Wanted]) {
        if ahead.is_empty() || self.is_capped {
            return;
        }
        let coming = self.shared.coming();
        let mut missing: Vec<(f32, Request)> = Vec::new();
        for want in ahead {
            self.wanted_in[want.part as usize] = self.plan;
            self.missing_of(want, want.tier, &[], &mut missing);
        }
        missing.retain(|(_, request)| !coming.contains_key(&(request.part, request.tier)));
        missing.par_sort_by(urgent_first);
        let coming: u64 = coming.values().sum();
        let is_needed = |part: &&u32| self.wanted_in[**part as usize] == self.plan;
        let needed: u64 = self.held.iter().filter(is_needed).map(|&part| self.part(part).bytes()).sum();
        let room = self.cap_bytes.saturating_sub(coming + needed);
        let mut bytes = 0;
        let fits = |(_, request): &(f32, Request)| {
            bytes += request.bytes;
            bytes <= room
        };
        let accepted: Vec<Request> =
            missing.into_iter().take_while(fits).map(|(_, request)| request).collect();
        self.make_room(coming + accepted.iter().map(|request| request.bytes).sum::<u64>(), &[], &[]);
        self.shared.give(accepted.into_iter());
    }

    /// For each wanted part the finest tier that there is room for; the number of tiers for none.
    fn accept_within_cap(&mut self, wanted: &[Wanted]) -> Vec<u32> {
        let all: u64 = wanted.par_iter().map(|want| self.bytes_from(want.part, want.tier)).sum();
        self.is_capped = all > self.cap_bytes;
        if !self.is_capped {
            return wanted.iter().map(|want| want.tier).collect();
        }
        let mut offers: Vec<(f32, u32, u32)> = Vec::new();
        for (number, want) in (0..).zip(wanted) {
            let tiers = (want.tier..self.tier_count(want.part)).rev();
            offers.extend(tiers.zip(self.urgencies(want)).map(|(tier, urgency)| (urgency, tier, number)));
        }
        offers.par_sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(b.1.cmp(&a.1)).then(a.2.cmp(&b.2)));
        let mut accepted: Vec<u32> = wanted.iter().map(|want| self.tier_count(want.part)).collect();
        let mut left = self.cap_bytes;
        for (_, tier, number) in offers {
            let Some(rest) = left.checked_sub(self.bytes_of(wanted[number as usize].part, tier)) else {
                break;
            };
            left = rest;
            accepted[number as usize] = tier;
        }
        accepted
    }

    fn tier_count(&self, part: u32) -> u32 {
        self.shared.scene.parts()[part as usize].tier_count
    }

    /// Bytes of memory that a chunk takes.
    fn bytes_of(&self, part: u32, tier: u32) -> u64 {
        let tiers = self.shared.scene.tiers(part);
        let below = tiers.get(tier as usize + 1).map_or(0, |row| row.vertices);
        bytes_of(&tiers[tier as usize], below)
    }

    fn bytes_from(&self, part: u32, finest: u32) -> u64 {
        (finest..self.tier_count(part)).map(|tier| self.bytes_of(part, tier)).sum()
    }

    /// How urgent each tier of a part is, from the coarsest to the finest that is wanted: the projected error that it
    /// removes for each byte, never more than that of a coarser one.
    fn urgencies(&self, want: &Wanted) -> impl Iterator<Item = f32> {
        let row = &self.shared.scene.parts()[want.part as usize];
        let tiers = self.shared.scene.tiers(want.part);
        let error_at = |vertices: u32| {
            let holds = (0..row.errors.len()).find(|&j| sampled_count(row.vertices, j) <= vertices);
            holds.map_or(1.0, |j| decode_error(row.errors[j], 1.0) as f32)
        };
        // With nothing there, it is off by its own size.
        let mut before = 1.0;
        let mut least = f32::INFINITY;
        (want.tier as usize..tiers.len()).rev().map(move |tier| {
            let after = error_at(tiers[tier].vertices);
            let removed = (before - after).max(0.0);
            before = after;
            let below = tiers.get(tier + 1).map_or(0, |row| row.vertices);
            let bytes = tiers[tier].plain_bytes(tiers[tier].vertices.saturating_sub(below));
            least = least.min(want.weight * removed / bytes.max(1) as f32);
            least
        })
    }

    /// The chunks of a part that are neither there nor on their way.
    fn missing_of(
        &self,
        want: &Wanted,
        finest: u32,
        in_flight: &[Request],
        missing: &mut Vec<(f32, Request)>,
    ) {
        let held = self.part(want.part);
        let tiers = self.tier_count(want.part);
        let arrived = held.finest().unwrap_or(tiers);
        if finest >= arrived {
            return;
        }
        for (tier, urgency) in (want.tier..tiers).rev().zip(self.urgencies(want)) {
            let is_coming = || in_flight.iter().any(|r| (r.part, r.tier) == (want.part, tier));
            if (finest..arrived).contains(&tier) && !held.has(tier) && !is_coming() {
                let bytes = self.bytes_of(want.part, tier);
                missing.push((urgency, Request { part: want.part, tier, bytes }));
            }
        }
    }

    /// Evicts until so many bytes more would fit: first what is not wanted, longest ago first; then tiers that were not
    /// accepted.
    fn make_room(&mut self, bytes: u64, wanted: &[Wanted], accepted: &[u32]) {
        let most = self.cap_bytes.saturating_sub(bytes);
        if self.bytes_held <= most {
            return;
        }
        let age = |part: u32| self.plan.wrapping_sub(self.wanted_in[part as usize]);
        let mut unwanted: Vec<u32> = self.held.iter().copied().filter(|&part| age(part) > 0).collect();
        unwanted.sort_unstable_by_key(|&part| (Reverse(age(part)), part));
        for part in unwanted {
            if self.bytes_held <= most {
                break;
            }
            self.evict(part, self.tier_count(part));
        }
        for (want, &tier) in wanted.iter().zip(accepted) {
            if self.bytes_held <= most {
                break;
            }
            self.evict(want.part, tier);
        }
        let parts = &self.parts;
        self.held.retain(|&part| parts[part as usize].is_some());
    }

    /// Evicts all tiers of a part that are finer than this one.
    fn evict(&mut self, part: u32, finest: u32) {
        let Some(held) = &mut self.parts[part as usize] else { return };
        let before = held.bytes();
        held.keep_from(finest);
        let freed = before - held.bytes();
        self.bytes_held -= freed;
        self.bytes_evicted += freed;
        if held.bytes() == 0 {
            self.parts[part as usize] = None;
        }
    }

    /// Takes in what has arrived, without waiting.
    ///
    /// # Errors
    /// A damaged chunk.
    pub fn receive(&mut self) -> Result<(), ResidencyError> {
        while let Ok(arrival) = self.arrivals.try_recv() {
            self.accept(arrival)?;
        }
        Ok(())
    }

    /// Waits for everything that the last plan asked for.
    ///
    /// # Errors
    /// A damaged chunk, or [`ResidencyError::WorkersGone`].
    pub fn settle(&mut self) -> Result<(), ResidencyError> {
        while self.is_waiting() {
            match self.arrivals.recv_timeout(Duration::from_millis(200)) {
                Ok(arrival) => self.accept(arrival)?,
                // A worker ends only when this is dropped, or by a panic, and then its request never arrives.
                Err(_) if self.workers.iter().any(JoinHandle::is_finished) => {
                    return Err(ResidencyError::WorkersGone);
                }
                Err(_) => {}
            }
        }
        Ok(())
    }

    /// Whether something that was asked for has not arrived.
    pub fn is_waiting(&self) -> bool {
        let todo = self.shared.todo.lock();
        !todo.queue.is_empty() || !todo.in_flight.is_empty()
    }

    fn accept(&mut self, (request, chunk): Arrival) -> Result<(), ResidencyError> {
        let Request { part, tier, .. } = request;
        self.shared.todo.lock().in_flight.retain(|other| *other != request);
        let chunk = chunk?;
        self.bytes_read += chunk.spec().row.bytes as u64;
        let tiers = self.tier_count(part);
        let held = self.parts[part as usize].get_or_insert_with(|| {
            self.held.push(part);
            Box::new(ResidentPart::new(tiers))
        });
        let before = held.bytes();
        held.arrive(tier, chunk);
        self.bytes_held += held.bytes() - before;
        Ok(())
    }

    /// Bytes read from the file since the last call.
    pub fn take_bytes_read(&mut self) -> u64 {
        std::mem::take(&mut self.bytes_read)
    }

    /// Bytes evicted since the last call.
    pub fn take_bytes_evicted(&mut self) -> u64 {
        std::mem::take(&mut self.bytes_evicted)
    }

    /// Bytes of all chunks in memory, and of those that are being read.
    pub fn bytes_held(&self) -> u64 {
        self.bytes_held + self.shared.todo.lock().in_flight.iter().map(|request| request.bytes).sum::<u64>()
    }

    /// Whether the cap kept the last plan from all that was wanted.
    pub fn is_capped(&self) -> bool {
        self.is_capped
    }
}

impl Drop for Residency {
    fn drop(&mut self) {
        {
            let mut todo = self.shared.todo.lock();
            todo.closed = true;
            todo.queue.clear();
        }
        self.shared.changed.notify_all();
        for worker in self.workers.drain(..) {
            // A worker that panicked has printed its message already.
            let _ = worker.join();
        }
    }
}

impl Shared {
    /// Empties the list, and tells what was taken from it already.
    fn stop_taking(&self) -> Vec<Request> {
        let mut todo = self.todo.lock();
        todo.queue.clear();
        todo.in_flight.clone()
    }

    /// What is on the list or was taken from it, with its bytes.
    fn coming(&self) -> HashMap<(u32, u32), u64> {
        let todo = self.todo.lock();
        let requests = todo.queue.iter().chain(&todo.in_flight);
        requests.map(|request| ((request.part, request.tier), request.bytes)).collect()
    }

    fn give(&self, requests: impl Iterator<Item = Request>) {
        self.todo.lock().queue.extend(requests);
        self.changed.notify_all();
    }

    /// The next request, once there is one; `None` at the end.
    fn take(&self) -> Option<Request> {
        let mut todo = self.todo.lock();
        loop {
            if todo.closed {
                return None;
            }
            let free = todo.queue.iter().position(|request| !todo.busy.contains(&request.part));
            if let Some(request) = free.and_then(|place| todo.queue.remove(place)) {
                todo.in_flight.push(request);
                todo.busy.push(request.part);
                return Some(request);
            }
            self.changed.wait(&mut todo);
        }
    }

    /// Lets others read chunks of this part again.
    fn give_back(&self, part: u32) {
        self.todo.lock().busy.retain(|&other| other != part);
        self.changed.notify_one();
    }

    /// Reads a chunk, and what it is stored as differences from, if that is not in memory.
    fn read(&self, part: u32, tier: u32) -> Result<Arc<Chunk>, ContainerError> {
        let tiers = self.scene.tiers(part);
        let mut coarser: VecDeque<Arc<Chunk>> = VecDeque::new();
        if is_compressed(&tiers[tier as usize]) {
            for other in (tier + 1..tiers.len() as u32).rev() {
                let known = self.known.get((part, other));
                coarser.push_front(known.map_or_else(|| self.read_one(part, other, &coarser), Ok)?);
            }
        }
        self.read_one(part, tier, &coarser)
    }

    fn read_one(
        &self,
        part: u32,
        tier: u32,
        coarser: &VecDeque<Arc<Chunk>>,
    ) -> Result<Arc<Chunk>, ContainerError> {
        let coarser: Vec<&Chunk> = coarser.iter().map(Arc::as_ref).collect();
        let chunk = Arc::new(self.scene.read_chunk(part, tier, &coarser)?);
        self.pace(chunk.spec().row.bytes.into());
        if self.scene.tiers(part)[..tier as usize].iter().any(is_compressed) {
            self.known.add((part, tier), &chunk);
        }
        Ok(chunk)
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

/// The most urgent first, coarse tiers before fine ones.
fn urgent_first((a, r): &(f32, Request), (b, s): &(f32, Request)) -> Ordering {
    b.total_cmp(a).then(s.tier.cmp(&r.tier)).then(r.part.cmp(&s.part))
}

fn serve(shared: &Shared, done: &Sender<Arrival>) {
    while let Some(request) = shared.take() {
        let chunk = shared.read(request.part, request.tier);
        shared.give_back(request.part);
        if done.send((request, chunk)).is_err() {
            return;
        }
    }
}
