//! Chunks of the file in memory: requests in, arrived parts out.
//!
//! Workers own the file: they touch its pages, check the chunk against its checksum, and hand over a copy, so that the
//! frame thread never waits for a page. What is drawn is what has arrived.

use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use crossbeam_channel::{Receiver, Sender, unbounded};

use crate::container::ContainerError;
use crate::scene::Scene;
use crate::scene::part::{Chunk, ResidentPart};

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

/// A part and one of its tiers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Request {
    part: u32,
    tier: u32,
}

type Arrival = (Request, Result<Chunk, ContainerError>);

/// The chunks that are in memory, and the workers that bring more.
pub struct Residency {
    parts: Vec<ResidentPart>,
    requests: Option<Sender<Request>>,
    /// The workers' end of the requests, to empty it when nobody waits for them any more.
    queued: Receiver<Request>,
    arrivals: Receiver<Arrival>,
    workers: Vec<JoinHandle<()>>,
    outstanding: usize,
    /// Per part, the coarsest tier that has been asked for and everything coarser: tiers `asked..` are on their way.
    asked: Vec<u32>,
    bytes_read: u64,
    bytes_held: u64,
}

/// More readers than this do not make a disk faster.
const WORKERS: usize = 2;

impl Residency {
    /// Starts the workers; nothing is read yet.
    pub fn new(scene: &Arc<Scene>) -> Self {
        let (requests, todo) = unbounded::<Request>();
        let (done, arrivals) = unbounded::<Arrival>();
        let workers = (0..WORKERS)
            .map(|_| {
                let (scene, todo, done) = (Arc::clone(scene), todo.clone(), done.clone());
                std::thread::spawn(move || serve(&scene, &todo, &done))
            })
            .collect();
        Self {
            parts: scene.parts().iter().map(|part| ResidentPart::new(part.tier_count)).collect(),
            asked: scene.parts().iter().map(|part| part.tier_count).collect(),
            requests: Some(requests),
            queued: todo,
            arrivals,
            workers,
            outstanding: 0,
            bytes_read: 0,
            bytes_held: 0,
        }
    }

    /// What is in memory of a part.
    pub fn part(&self, part: u32) -> &ResidentPart {
        &self.parts[part as usize]
    }

    /// Asks for a tier of a part and for all coarser ones, coarsest first; nothing is asked for twice.
    ///
    /// # Errors
    /// [`ResidencyError::WorkersGone`].
    pub fn request(&mut self, part: u32, tier: u32) -> Result<(), ResidencyError> {
        let asked = &mut self.asked[part as usize];
        while *asked > tier {
            *asked -= 1;
            let sender = self.requests.as_ref().ok_or(ResidencyError::WorkersGone)?;
            sender.send(Request { part, tier: *asked }).map_err(|_| ResidencyError::WorkersGone)?;
            self.outstanding += 1;
        }
        Ok(())
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

    /// Waits for everything that was asked for.
    ///
    /// # Errors
    /// A damaged chunk, or [`ResidencyError::WorkersGone`].
    pub fn settle(&mut self) -> Result<(), ResidencyError> {
        while self.outstanding > 0 {
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

    fn accept(&mut self, (request, chunk): Arrival) -> Result<(), ResidencyError> {
        self.outstanding -= 1;
        let chunk = chunk?;
        self.bytes_read += chunk.bytes() as u64;
        self.bytes_held += chunk.bytes() as u64;
        self.parts[request.part as usize].arrive(request.tier, chunk);
        Ok(())
    }

    /// Bytes read from the file since the last call.
    pub fn take_bytes_read(&mut self) -> u64 {
        std::mem::take(&mut self.bytes_read)
    }

    /// Bytes of all chunks in memory.
    pub fn bytes_held(&self) -> u64 {
        self.bytes_held
    }
}

impl Drop for Residency {
    fn drop(&mut self) {
        // Closing the channel ends the workers once the queue is empty.
        self.requests = None;
        while self.queued.try_recv().is_ok() {}
        for worker in self.workers.drain(..) {
            // A worker that panicked has printed its message already.
            let _ = worker.join();
        }
    }
}

fn serve(scene: &Scene, todo: &Receiver<Request>, done: &Sender<Arrival>) {
    while let Ok(request) = todo.recv() {
        let chunk = scene.read_chunk(request.part, request.tier);
        if done.send((request, chunk)).is_err() {
            return;
        }
    }
}
