//! What each batch is sent: requests to the disk, deltas under the cap of the frame, and the deal of instances to batches.

use std::ops::Range;
use std::time::Instant;

use rayon::prelude::*;

use super::{DRAW_BYTES, FrameError, PassesOn, Renderer, milliseconds_since};
use crate::gpu::batch::{Batch, STREAMS, fits};
use crate::gpu::layout::Grant;
use crate::scene::{Camera, InstanceBox};
use crate::select::WishChange;
use crate::stats::FrameRecord;
use crate::stream::gather::{BatchUpload, StreamedLayout};
use crate::stream::residency::Wanted;
use crate::stream::{Delta, State, Strategy};

/// A thread looks at no fewer instances, as waiting for threads would take longer.
const LEAST_SHARE: usize = 4096;
/// Streamed and active bytes that a budgeted vertex takes in the largest buffer, about: 12 for itself, 8 for its share
/// of `ecol`, 16 for two triangles.
const BYTES_PER_VERTEX: u64 = 40;

impl Renderer {
    fn batch_limit_bytes(&self) -> u64 {
        let adapter = self.gpu.storage_limit_bytes();
        self.settings.batch_limit_bytes.map_or(adapter, |limit| limit.min(adapter))
    }

    /// How many batches the budget will need.
    pub(super) fn batches_expected(&self) -> usize {
        let bytes = u64::from(self.settings.budget_vertices) * BYTES_PER_VERTEX;
        let placed: u64 = self
            .scene
            .instances()
            .iter()
            .map(|instance| u64::from(self.scene.parts()[instance.part as usize].vertices) * BYTES_PER_VERTEX)
            .sum();
        bytes.min(placed).div_ceil(self.batch_limit_bytes().max(1)).max(1) as usize
    }

    /// Deals all instances to so many batches, in turn, so that what is near in the file (and mostly in space) is spread
    /// evenly. The GPU then holds nothing.
    pub(super) fn deal(&mut self, batches: usize) -> Result<(), FrameError> {
        let count = self.scene.instances().len();
        let batches = batches.clamp(1, count.max(1));
        self.batches.clear();
        self.mirrors.clear();
        self.states.fill(State::default());
        self.held.clear();
        self.looks.forget();
        self.taken.forget();
        for first in 0..batches {
            let instances: Vec<u32> = (first as u32..count as u32).step_by(batches).collect();
            let rows = self.instance_rows(&instances);
            if self.settings.passes == PassesOn::Reference {
                self.mirrors.push(super::Mirror::new(instances.len()));
            }
            self.batches.push(Batch::new(&self.gpu, &self.draw, instances, &rows)?);
        }
        self.gpu.check()?;
        Ok(())
    }

    /// How long the boxes of all visible instances seem.
    pub(super) fn see(&mut self, camera: &Camera) {
        let focal_px = f64::from(camera.focal_px(self.settings.height));
        let boxes = self.scene.boxes();
        let visible = self.wishes.visible().par_iter().with_min_len(LEAST_SHARE);
        let px = |&instance: &u32| diagonal_px(&boxes[instance as usize], camera, focal_px) as f32;
        visible.map(px).collect_into_vec(&mut self.seen_px);
    }

    /// Asks for what the view wants, as far as that is not what it wanted before.
    pub(super) fn ask(&mut self, camera: &Camera, has_moved: bool, changes: &[WishChange]) {
        let (scene, wishes) = (&self.scene, self.wishes.get());
        let changes = self.wants.follow(scene, changes);
        let wants = &self.wants;
        let focal_px = f64::from(camera.focal_px(self.settings.height));
        let px = |instance: u32| diagonal_px(&scene.boxes()[instance as usize], camera, focal_px);
        let weigh = |part: u32| wants.weight(part, wishes, px);
        self.residency.follow(&changes, has_moved, &weigh);
    }

    /// Stage 3: the deltas of every batch, in the order of its instances. Instances whose delta no longer fits the
    /// cap keep what they have until the next frame.
    pub(super) fn delta(&mut self, record: &mut FrameRecord) -> Result<Vec<Vec<Delta>>, FrameError> {
        // What the last frame took away is counted as sent until the next.
        let is_idle = !self.chosen && !self.changed;
        self.changed = false;
        if self.settled || is_idle {
            return Ok(vec![Vec::new(); self.batches.len()]);
        }
        let started = Instant::now();
        self.deal_again_if_a_batch_overflows()?;
        self.hold_back_what_exceeds_the_cap();
        self.bytes_of_whole = self.bytes_of_everything();
        let deltas = self.deltas_by_batch(|delta| delta.old != delta.new);
        self.changed = deltas.iter().any(|deltas| !deltas.is_empty());
        record.delta_ms = milliseconds_since(started);
        Ok(deltas)
    }

    /// The changes of what the GPU holds or shall hold, as far as they are asked for, by batch, in the order of the
    /// instances.
    fn deltas_by_batch(&self, is_asked: impl Fn(&Delta) -> bool) -> Vec<Vec<Delta>> {
        let mut deltas = vec![Vec::new(); self.batches.len()];
        for &instance in &self.touched {
            let (old, new) = (self.states[instance as usize], self.wanted[instance as usize]);
            let delta = Delta { instance, old, new };
            if is_asked(&delta) {
                // Dealt in turn.
                deltas[instance as usize % self.batches.len()].push(delta);
            }
        }
        deltas
    }

    /// What is or was drawn, whether it changes or not.
    fn everything(&self) -> Vec<Vec<Delta>> {
        self.deltas_by_batch(|delta| !(delta.old.is_empty() && delta.new.is_empty()))
    }

    /// What `whole` sends: all records of what is drawn, a grant for what is or was, and for every batch of which there is
    /// any the arguments of the draw.
    fn bytes_of_everything(&self) -> u64 {
        let mut bytes = vec![0; self.batches.len()];
        for &instance in &self.touched {
            let (old, new) = (self.states[instance as usize], self.wanted[instance as usize]);
            if !(old.is_empty() && new.is_empty()) {
                let records = Delta { instance, old, new }.lack(Strategy::Whole).bytes();
                bytes[instance as usize % self.batches.len()] += records + size_of::<Grant>() as u64;
            }
        }
        bytes.into_iter().filter(|&bytes| bytes > 0).map(|bytes| bytes + DRAW_BYTES).sum()
    }

    /// The cap is on deltas whatever the strategy, so that all strategies draw the same.
    fn hold_back_what_exceeds_the_cap(&mut self) {
        self.is_held_back = false;
        let Some(cap) = self.upload_limit_bytes() else { return };
        let mut growing = self.growing_placements();
        // What is not drawn at all comes first, then what is cheap; but in every other frame what is dearest, so that
        // a part above the cap is not passed over for ever.
        growing.sort_by_key(|(bytes, placement)| (self.is_drawn(placement), *bytes, placement.start));
        if self.frame % 2 == 1 {
            growing.reverse();
        }
        let mut spent = 0;
        for (i, (bytes, placement)) in growing.into_iter().enumerate() {
            spent += bytes;
            // The first goes whatever it takes: a cap below one part must not starve it.
            if spent > cap && i > 0 && self.can_stay(&placement) {
                self.wanted[placement.clone()].copy_from_slice(&self.states[placement]);
                (self.is_held_back, self.pending) = (true, true);
            }
        }
    }

    /// Whether all that the GPU holds of a placement is still in memory, so that it could be sent again.
    fn can_stay(&self, placement: &Range<usize>) -> bool {
        placement.clone().filter(|&number| !self.states[number].is_empty()).all(|number| {
            let held = self.residency.part(self.scene.instances()[number].part);
            held.finest().is_some_and(|finest| finest <= self.states[number].tier)
        })
    }

    fn is_drawn(&self, placement: &Range<usize>) -> bool {
        self.states[placement.clone()].iter().any(|state| !state.is_empty())
    }

    /// The placements that lack something, with how many bytes. The cells of a part that has parent cells are one
    /// placement: what a parent leaves, its children must take over in the same frame.
    fn growing_placements(&self) -> Vec<(u64, Range<usize>)> {
        let delta = |number: usize| {
            let (old, new) = (self.states[number], self.wanted[number]);
            Delta { instance: number as u32, old, new }
        };
        let mut growing: Vec<(u64, Range<usize>)> = Vec::new();
        let mut end = 0;
        for &instance in &self.touched {
            if (instance as usize) < end {
                continue;
            }
            let placement = self.scene.placement(instance);
            let placement = placement.start as usize..placement.end as usize;
            end = placement.end;
            let changed = placement.clone().filter(|&number| self.states[number] != self.wanted[number]);
            let bytes = changed.map(|number| delta(number).lack(Strategy::Coherent).bytes()).sum();
            if bytes > 0 {
                growing.push((bytes, placement));
            }
        }
        growing
    }

    /// Doubles the number of batches until each fits its buffers; the check is the same for all strategies.
    fn deal_again_if_a_batch_overflows(&mut self) -> Result<(), FrameError> {
        let limit = self.batch_limit_bytes();
        while !self.totals().iter().all(|&totals| fits_batch(limit, totals)) {
            let batches = self.batches.len() * 2;
            if self.batches.len() >= self.scene.instances().len() {
                return Err(FrameError::BatchTooSmall { limit_bytes: limit });
            }
            tracing::info!(batches, "a batch overflows: dealing its instances again");
            self.deal(batches)?;
        }
        Ok(())
    }

    /// Active elements of each stream that every batch will have.
    pub(super) fn totals(&self) -> Vec<[u64; STREAMS]> {
        let mut totals = vec![[0; STREAMS]; self.batches.len()];
        for &instance in &self.touched {
            let state = self.wanted[instance as usize];
            let of_batch = &mut totals[instance as usize % self.batches.len()];
            of_batch[0] += u64::from(state.vertices);
            of_batch[1] += u64::from(state.ecol);
            of_batch[2] += u64::from(state.triangles);
        }
        totals
    }

    /// What every batch is sent under the strategy: its deltas, or all of it in every frame, as in the paper.
    pub(super) fn plan_uploads(&mut self, deltas: &[Vec<Delta>]) -> Vec<BatchUpload> {
        if self.settings.strategy == Strategy::Coherent && deltas.iter().all(Vec::is_empty) {
            return vec![BatchUpload::default(); self.batches.len()];
        }
        let totals = self.totals();
        let uploads = match self.settings.strategy {
            Strategy::Coherent => self.uploads_of(deltas, &totals),
            Strategy::Whole | Strategy::PerPart => self.uploads_of(&self.everything(), &totals),
        };
        for delta in deltas.iter().flatten() {
            self.states[delta.instance as usize] = delta.new;
        }
        self.taken.forget();
        self.held.clear();
        let states = &self.states;
        self.held.extend(self.touched.iter().filter(|&&instance| !states[instance as usize].is_empty()));
        uploads
    }

    fn uploads_of(&self, deltas: &[Vec<Delta>], totals: &[[u64; STREAMS]]) -> Vec<BatchUpload> {
        let stride = self.batches.len() as u32;
        let of_batch = |(deltas, totals): (&Vec<Delta>, &[u64; STREAMS])| {
            let mut upload = BatchUpload::default();
            if !deltas.is_empty() {
                upload.totals = *totals;
            }
            for delta in deltas {
                let part = self.scene.instances()[delta.instance as usize].part;
                // Dealt in turn: the batch-local number of an instance is its number divided by that of batches.
                upload.push(delta.instance / stride, part, delta, self.settings.strategy);
            }
            upload
        };
        deltas.iter().zip(totals).map(of_batch).collect()
    }
}

fn fits_batch(limit: u64, totals: [u64; STREAMS]) -> bool {
    fits(limit, totals, StreamedLayout::of_totals(totals).words())
}

/// Adds what one instance wants of its part to what others do; `slots` has for every part where in the list it may be.
pub(super) fn add_wanted(list: &mut Vec<Wanted>, slots: &mut [u32], want: Wanted) {
    let slot = &mut slots[want.part as usize];
    match list.get_mut(*slot as usize).filter(|known| known.part == want.part) {
        Some(known) => {
            known.tier = known.tier.min(want.tier);
            known.weight += want.weight;
        }
        None => {
            *slot = list.len() as u32;
            list.push(want);
        }
    }
}

/// How long a box seems, in pixels, as seen from no nearer than its own surface.
pub(super) fn diagonal_px(bounds: &InstanceBox, camera: &Camera, focal_px: f64) -> f64 {
    if camera.parallel.is_some() {
        return focal_px * bounds.diagonal;
    }
    let distance = camera.distance(bounds.centre) - 0.5 * bounds.diagonal;
    focal_px * bounds.diagonal / distance.max(0.05 * bounds.diagonal).max(f64::MIN_POSITIVE)
}

/// Two ascending lists in one.
pub(super) fn merged(a: &[u32], b: &[u32]) -> Vec<u32> {
    let (mut a, mut b) = (a.iter().copied().peekable(), b.iter().copied().peekable());
    std::iter::from_fn(|| match (a.peek(), b.peek()) {
        (Some(x), Some(y)) if x == y => {
            b.next();
            a.next()
        }
        (Some(x), Some(y)) if x > y => b.next(),
        (Some(_), _) => a.next(),
        (None, _) => b.next(),
    })
    .collect()
}
