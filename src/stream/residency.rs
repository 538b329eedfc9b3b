//! What the view wants of each part in, the chunks in memory out, under a cap.
//!
//! What shall be in memory follows what is wanted: of that as much as the cap has room for, the most projected error
//! removed for each byte first (`stream/benefit.rs`, `stream/fit.rs`), so that where the cap bites the error rises evenly
//! over the view. What is in memory and not wanted stays as long as there is room, and goes in the order in which it was
//! last wanted.
//!
//! A plan costs what has changed and what is lacking, not what is wanted: which parts lack something is noted as wishes
//! change and as chunks are evicted. Only where the cap is below all that is wanted, every wanted part takes part in it.
//!
//! Workers own the file (`stream/readers.rs`): they read a chunk, decode it, check it and hand it over, so that the frame
//! thread never waits for a page. The cap counts what chunks take once they are decoded, those that are being read too.
//! What is drawn is what has arrived.

use std::cmp::Reverse;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use crossbeam_channel::{Receiver, unbounded};
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::benefit::{Lack, by_urgency, urgencies};
use super::fit::{chunk_bytes, finest_that_fit, tier_count};
use super::readers::{Arrivals, Read, Readers, Request, When};
use crate::container::ContainerError;
use crate::scene::Scene;
use crate::scene::part::ResidentPart;

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

/// The finest tier of a part that is wanted now.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Change {
    /// The part.
    pub part: u32,
    /// The tier; `None` if nothing of the part is wanted any more.
    pub tier: Option<u32>,
}

/// How much the whole error of a part would be seen: [`Wanted::weight`].
pub type Weigh<'a> = &'a (dyn Fn(u32) -> f32 + Sync);

/// What is known of every part, in memory or not.
#[derive(Debug, Clone, Copy)]
struct Place {
    /// The finest tier that is wanted; [`NONE`] if none is.
    wanted: u32,
    /// The finest tier that can be drawn; [`NONE`] if none has arrived.
    finest: u32,
    /// How many vertices have arrived.
    vertices: u32,
    /// The last plan that wanted it, if none does now.
    wanted_in: u32,
    /// Whether it is on the list of what lacks something.
    is_noted: bool,
    /// Whether something finer than what can be drawn is there: a tier between has not arrived.
    has_gap: bool,
}

/// In the place of a tier. Greater than all tiers, so that what is finer is less.
const NONE: u32 = u32::MAX;

impl Place {
    const EMPTY: Self =
        Self { wanted: NONE, finest: NONE, vertices: 0, wanted_in: 0, is_noted: false, has_gap: false };

    fn is_wanted(&self) -> bool {
        self.wanted != NONE
    }

    fn is_lacking(&self) -> bool {
        self.wanted < self.finest
    }
}

/// The chunks that are in memory, and the workers that bring more.
pub struct Residency {
    scene: Arc<Scene>,
    parts: Vec<Option<Box<ResidentPart>>>,
    places: Vec<Place>,
    nothing: ResidentPart,
    /// The parts of which something is in memory.
    held: Vec<u32>,
    /// The parts that lack something that is wanted, and some that do no more.
    lacking: Vec<u32>,
    /// For each chunk whether it is asked for and has not arrived, and how many are.
    is_coming: Vec<bool>,
    coming: usize,
    /// What these take in memory.
    bytes_coming: u64,
    plan: u32,
    cap_bytes: u64,
    readers: Arc<Readers>,
    arrivals: Receiver<Arrivals>,
    workers: Vec<JoinHandle<()>>,
    bytes_read: u64,
    bytes_held: u64,
    /// Of these, the bytes of parts that are wanted.
    bytes_needed: u64,
    /// What all that is wanted takes.
    bytes_wanted: u64,
    bytes_evicted: u64,
    /// Whether the cap kept the last plan from all that was wanted.
    is_capped: bool,
    /// Whether it would keep less from it once what was being read has arrived.
    is_provisional: bool,
    /// How many times something has arrived or was evicted.
    version: u64,
}

/// Bytes of memory that are taken for each part whatever is in memory of it.
pub(crate) const BYTES_PER_PART: u64 = (size_of::<Place>() + size_of::<Option<Box<ResidentPart>>>()) as u64;

impl Residency {
    /// Starts the workers; nothing is read yet.
    pub fn new(scene: &Arc<Scene>, options: ResidencyOptions) -> Self {
        let (done, arrivals) = unbounded::<Arrivals>();
        let readers = Arc::new(Readers::new(scene, options.read_rate));
        let workers = (0..readers.worker_count())
            .map(|_| {
                let (readers, done) = (Arc::clone(&readers), done.clone());
                std::thread::spawn(move || readers.serve(&done))
            })
            .collect();
        let parts = scene.parts().len();
        Self {
            scene: Arc::clone(scene),
            parts: (0..parts).map(|_| None).collect(),
            places: vec![Place::EMPTY; parts],
            nothing: ResidentPart::new(0),
            held: Vec::new(),
            lacking: Vec::new(),
            is_coming: vec![false; scene.chunk_count()],
            coming: 0,
            bytes_coming: 0,
            plan: 0,
            cap_bytes: options.cap_bytes.unwrap_or(u64::MAX),
            readers,
            arrivals,
            workers,
            bytes_read: 0,
            bytes_held: 0,
            bytes_needed: 0,
            bytes_wanted: 0,
            bytes_evicted: 0,
            is_capped: false,
            is_provisional: false,
            version: 0,
        }
    }

    /// What is in memory of a part.
    pub fn part(&self, part: u32) -> &ResidentPart {
        self.parts[part as usize].as_deref().unwrap_or(&self.nothing)
    }

    /// How many vertices of a part have arrived, without a look at the part.
    pub fn vertices_arrived(&self, part: u32) -> u32 {
        self.places[part as usize].vertices
    }

    /// Whether a tier of a part can be drawn, without a look at the part.
    pub fn can_draw(&self, part: u32, tier: u32) -> bool {
        self.places[part as usize].finest <= tier
    }

    /// Whether a tier of a part can be drawn, and is wanted, so that it is not evicted for another.
    pub fn stays(&self, part: u32, tier: u32) -> bool {
        self.places[part as usize].is_wanted() && self.can_draw(part, tier)
    }

    /// Grows whenever something arrives or is evicted.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Decides anew what shall be in memory for a view: evicts what there is no room for, and gives the workers a new list
    /// of what to read, the most urgent first. Each part is named once. The same as what [`Residency::follow`] comes to.
    pub fn plan(&mut self, wanted: &[Wanted]) {
        self.plan = self.plan.wrapping_add(1);
        for part in 0..self.places.len() as u32 {
            self.want(Change { part, tier: None });
        }
        let weights: FxHashMap<u32, f32> = wanted.iter().map(|want| (want.part, want.weight)).collect();
        let changes: Vec<Change> =
            wanted.iter().map(|want| Change { part: want.part, tier: Some(want.tier) }).collect();
        self.ask_anew(&changes, &|part| weights.get(&part).copied().unwrap_or(0.0));
    }

    /// As [`Residency::plan`], from what has changed since the last plan. Each part is named once. `is_reweighed` says whether weights may be others
    /// than they were; `weigh` is asked for those of parts that lack something, or of all wanted ones under a cap that is
    /// too small for them.
    pub fn follow(&mut self, changes: &[Change], is_reweighed: bool, weigh: Weigh<'_>) {
        self.plan = self.plan.wrapping_add(1);
        if changes.is_empty() && !is_reweighed && !self.is_provisional {
            self.withdraw(When::Ahead);
        } else {
            self.ask_anew(changes, weigh);
        }
    }

    fn ask_anew(&mut self, changes: &[Change], weigh: Weigh<'_>) {
        self.withdraw(When::Ahead);
        self.withdraw(When::Now);
        changes.iter().for_each(|&change| self.want(change));
        // What is being read may be wanted no more, and takes its room until it has arrived.
        self.is_capped = self.bytes_wanted > self.cap_bytes.saturating_sub(self.bytes_coming);
        self.is_provisional = self.is_capped && self.bytes_coming > 0;
        match self.is_capped {
            true => self.ask_for_what_fits(weigh),
            false => self.ask_for_all(weigh),
        }
    }

    /// Notes the finest tier of a part that is wanted.
    fn want(&mut self, change: Change) {
        let number = change.part as usize;
        let before = self.places[number].wanted;
        let now = change.tier.unwrap_or(NONE);
        if before == now {
            return;
        }
        self.bytes_wanted -= self.bytes_from(change.part, before);
        self.bytes_wanted += self.bytes_from(change.part, now);
        let held = self.parts[number].as_ref().map_or(0, |held| held.bytes());
        if before == NONE {
            self.bytes_needed += held;
        }
        if now == NONE {
            self.bytes_needed -= held;
            self.places[number].wanted_in = self.plan.wrapping_sub(1);
        }
        self.places[number].wanted = now;
        self.note(change.part);
    }

    /// Puts a part on the list of what lacks something, if it does.
    fn note(&mut self, part: u32) {
        let place = &mut self.places[part as usize];
        if place.is_lacking() && !place.is_noted {
            place.is_noted = true;
            self.lacking.push(part);
        }
    }

    /// Takes parts from the list that lack nothing any more.
    fn forget_complete(&mut self) {
        let places = &mut self.places;
        self.lacking.retain(|&part| {
            let place = &mut places[part as usize];
            place.is_noted = place.is_lacking();
            place.is_noted
        });
    }

    fn ask_for_all(&mut self, weigh: Weigh<'_>) {
        self.forget_complete();
        // In no order that depends on what was before.
        self.lacking.par_sort_unstable();
        let missing = |&part: &u32| {
            let place = &self.places[part as usize];
            self.missing_of(part, place.wanted, place.wanted, weigh(part))
        };
        let missing: Vec<Lack> = self.lacking.par_iter().flat_map_iter(missing).collect();
        self.ask(When::Now, missing, &[]);
    }

    fn ask_for_what_fits(&mut self, weigh: Weigh<'_>) {
        self.forget_complete();
        let wanted = |(part, place): (usize, &Place)| {
            let part = part as u32;
            place.is_wanted().then(|| Wanted { part, tier: place.wanted, weight: weigh(part) })
        };
        let wanted: Vec<Wanted> = self.places.par_iter().enumerate().filter_map(wanted).collect();
        let room = self.cap_bytes.saturating_sub(self.bytes_coming);
        let accepted = finest_that_fit(&self.scene, &wanted, room);
        let missing = wanted
            .par_iter()
            .zip(&accepted)
            .flat_map_iter(|(want, &tier)| self.missing_of(want.part, want.tier, tier, want.weight));
        let missing: Vec<Lack> = missing.collect();
        let accepted: Vec<(u32, u32)> = wanted.iter().map(|want| want.part).zip(accepted).collect();
        self.ask(When::Now, missing, &accepted);
    }

    /// After a plan, asks for what will be wanted soon: read after everything that is wanted now, into memory that is free
    /// or holds what is neither wanted nor will be. Each part is named once.
    pub fn prefetch(&mut self, ahead: &[Wanted]) {
        self.withdraw(When::Ahead);
        if ahead.is_empty() || self.is_capped {
            return;
        }
        let mut needed = self.bytes_needed;
        for want in ahead {
            let place = &mut self.places[want.part as usize];
            if !place.is_wanted() {
                place.wanted_in = self.plan;
                needed += self.part(want.part).bytes();
            }
        }
        let missing = ahead
            .par_iter()
            .flat_map_iter(|want| self.missing_of(want.part, want.tier, want.tier, want.weight));
        let mut missing: Vec<Lack> = missing.collect();
        missing.par_sort_unstable();
        let mut room = self.cap_bytes.saturating_sub(self.bytes_coming + needed);
        let fits = |lack: &Lack| {
            let (part, tier) = lack.chunk();
            let left = room.checked_sub(chunk_bytes(&self.scene, part, tier));
            room = left.unwrap_or(0);
            left.is_some()
        };
        let accepted: Vec<Lack> = missing.into_iter().take_while(fits).collect();
        self.ask(When::Ahead, accepted, &[]);
    }

    /// Makes room, and gives the workers what is missing, the most urgent first.
    fn ask(&mut self, when: When, missing: Vec<Lack>, accepted: &[(u32, u32)]) {
        let scene = Arc::clone(&self.scene);
        if self.cap_bytes < u64::MAX {
            let bytes_of = |lack: &Lack| chunk_bytes(&scene, lack.chunk().0, lack.chunk().1);
            let bytes = self.bytes_coming + missing.par_iter().map(bytes_of).sum::<u64>();
            self.make_room(bytes, accepted);
        }
        by_urgency(&scene, missing, |lacks| {
            let request = |lack: Lack| {
                let (part, tier) = lack.chunk();
                Request { part, tier, bytes: chunk_bytes(&scene, part, tier) }
            };
            let requests: Vec<Request> = lacks.map(request).collect();
            for request in &requests {
                self.is_coming[scene.chunk_number(request.part, request.tier)] = true;
            }
            self.coming += requests.len();
            self.bytes_coming += requests.iter().map(|request| request.bytes).sum::<u64>();
            self.readers.give(when, requests.into_iter());
        });
    }

    /// Takes back what was asked for and is not being read yet.
    fn withdraw(&mut self, when: When) {
        if self.coming == 0 {
            return;
        }
        for request in self.readers.withdraw(when) {
            self.is_coming[self.scene.chunk_number(request.part, request.tier)] = false;
            self.coming -= 1;
            self.bytes_coming -= request.bytes;
        }
    }

    fn bytes_from(&self, part: u32, finest: u32) -> u64 {
        (finest..tier_count(&self.scene, part)).map(|tier| chunk_bytes(&self.scene, part, tier)).sum()
    }

    /// The chunks of a part, from `accepted` on, that are neither there nor on their way; `finest` is what is wanted.
    fn missing_of(
        &self,
        part: u32,
        finest: u32,
        accepted: u32,
        weight: f32,
    ) -> impl Iterator<Item = Lack> + use<'_> {
        let held = self.part(part);
        let tiers = tier_count(&self.scene, part);
        // Of a part that lacks nothing nothing is looked up.
        let range = accepted..self.places[part as usize].finest.min(tiers);
        let finest = if range.is_empty() { tiers } else { finest };
        let is_missing = move |tier: u32| {
            range.contains(&tier) && !held.has(tier) && !self.is_coming[self.scene.chunk_number(part, tier)]
        };
        let urgencies = urgencies(&self.scene, part, finest, weight);
        let all = urgencies.filter(move |&(tier, _)| is_missing(tier));
        all.map(move |(tier, urgency)| Lack::new(&self.scene, part, tier, urgency))
    }

    /// Evicts until so many bytes more would fit: first what is not wanted, longest ago first; then tiers that were not
    /// accepted, or are finer than what is wanted.
    fn make_room(&mut self, bytes: u64, accepted: &[(u32, u32)]) {
        let most = self.cap_bytes.saturating_sub(bytes);
        if self.bytes_held <= most {
            return;
        }
        let age = |part: u32| match &self.places[part as usize] {
            place if place.is_wanted() => 0,
            place => self.plan.wrapping_sub(place.wanted_in),
        };
        let mut unwanted: Vec<u32> = self.held.iter().copied().filter(|&part| age(part) > 0).collect();
        unwanted.par_sort_unstable_by_key(|&part| (Reverse(age(part)), part));
        for part in unwanted {
            if self.bytes_held <= most {
                break;
            }
            self.evict(part, tier_count(&self.scene, part));
        }
        let is_over = self.bytes_held > most;
        let finer = if is_over && !self.is_capped { self.kept_wanted() } else { Vec::new() };
        for &(part, tier) in accepted.iter().chain(&finer) {
            if self.bytes_held <= most {
                break;
            }
            self.evict(part, tier);
        }
        let parts = &self.parts;
        self.held.retain(|&part| parts[part as usize].is_some());
    }

    /// The finest wanted tiers of all parts of which something is wanted and there, by part.
    fn kept_wanted(&self) -> Vec<(u32, u32)> {
        let wanted = |&part: &u32| (part, self.places[part as usize].wanted);
        let mut kept: Vec<_> = self.held.iter().map(wanted).filter(|&(_, tier)| tier != NONE).collect();
        kept.sort_unstable();
        kept
    }

    /// Evicts all tiers of a part that are finer than this one.
    fn evict(&mut self, part: u32, finest: u32) {
        let place = &self.places[part as usize];
        if place.finest >= finest && !place.has_gap {
            return;
        }
        let Some(held) = &mut self.parts[part as usize] else { return };
        let before = held.bytes();
        held.keep_from(finest);
        let freed = before - held.bytes();
        if held.bytes() == 0 {
            self.parts[part as usize] = None;
        }
        self.bytes_held -= freed;
        self.bytes_evicted += freed;
        if self.places[part as usize].is_wanted() {
            self.bytes_needed -= freed;
        }
        self.see(part);
        self.note(part);
    }

    /// Notes what is there of a part.
    fn see(&mut self, part: u32) {
        let held = self.parts[part as usize].as_deref();
        let place = &mut self.places[part as usize];
        place.finest = held.and_then(ResidentPart::finest).unwrap_or(NONE);
        place.vertices = held.map_or(0, ResidentPart::vertices_arrived);
        place.has_gap = held.is_some_and(ResidentPart::has_gap);
        self.version += 1;
    }

    /// Takes in what has arrived, without waiting; not what arrives meanwhile, which could be all of it.
    ///
    /// # Errors
    /// A damaged chunk.
    pub fn receive(&mut self) -> Result<(), ResidencyError> {
        for _ in 0..self.arrivals.len() {
            let Ok(arrivals) = self.arrivals.try_recv() else { break };
            self.accept(arrivals)?;
        }
        Ok(())
    }

    /// Waits for everything that the last plan asked for.
    ///
    /// # Errors
    /// A damaged chunk, or [`ResidencyError::WorkersGone`].
    pub fn settle(&mut self) -> Result<(), ResidencyError> {
        self.settle_unless(&AtomicBool::new(false))
    }

    /// The same, unless it is stopped before.
    ///
    /// # Errors
    /// As [`Residency::settle`].
    pub fn settle_unless(&mut self, stop: &AtomicBool) -> Result<(), ResidencyError> {
        while self.is_waiting() && !stop.load(Ordering::Relaxed) {
            match self.arrivals.recv_timeout(Duration::from_millis(200)) {
                Ok(arrivals) => self.accept(arrivals)?,
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
        self.coming > 0
    }

    fn accept(&mut self, arrivals: Arrivals) -> Result<(), ResidencyError> {
        let bytes = arrivals.iter().map(|(request, _)| request.bytes).sum();
        self.readers.accepted(bytes);
        self.bytes_coming -= bytes;
        self.coming -= arrivals.len();
        for (request, read) in arrivals {
            let Request { part, tier, .. } = request;
            self.is_coming[self.scene.chunk_number(part, tier)] = false;
            self.bytes_read += u64::from(self.scene.tiers(part)[tier as usize].bytes);
            let bytes = self.put(request, read?);
            self.bytes_held += bytes;
            if self.places[part as usize].is_wanted() {
                self.bytes_needed += bytes;
            }
            self.see(part);
        }
        Ok(())
    }

    /// Puts a chunk to its part; returns the bytes that it takes.
    fn put(&mut self, request: Request, read: Read) -> u64 {
        let tiers = tier_count(&self.scene, request.part);
        let slot = &mut self.parts[request.part as usize];
        let before = slot.as_ref().map_or(0, |held| held.bytes());
        if slot.is_none() {
            self.held.push(request.part);
        }
        let new = || Box::new(ResidentPart::new(tiers));
        match read {
            Read::Part(part) if slot.is_none() => *slot = Some(part),
            Read::Part(part) => slot.get_or_insert_with(new).arrive_all(*part),
            Read::Chunk(chunk) => slot.get_or_insert_with(new).arrive(request.tier, chunk),
        }
        slot.as_ref().map_or(0, |held| held.bytes()) - before
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
        self.bytes_held + self.readers.bytes_in_flight()
    }

    /// Whether the cap kept the last plan from all that was wanted.
    pub fn is_capped(&self) -> bool {
        self.is_capped
    }
}

impl Drop for Residency {
    fn drop(&mut self) {
        self.readers.close();
        for worker in self.workers.drain(..) {
            // A worker that panicked has printed its message already.
            let _ = worker.join();
        }
    }
}
