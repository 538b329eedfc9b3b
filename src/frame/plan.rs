//! What each batch is sent: requests to the disk, deltas under the cap of the frame, and the deal of instances to batches.

use std::ops::Range;
use std::time::Instant;

use super::{DRAW_BYTES, FrameError, PassesOn, Renderer, milliseconds_since};
use crate::gpu::batch::{Batch, STREAMS, fits};
use crate::gpu::layout::Grant;
use crate::select::states::coarsest_tier_with;
use crate::stats::FrameRecord;
use crate::stream::gather::{BatchUpload, StreamedLayout};
use crate::stream::{Delta, State, Strategy};

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

    /// Asks for every tier that a wish needs: the coarsest of everything first, so that all of the picture is there
    /// early, then the finer ones, those of the largest wishes first.
    pub(super) fn request_wished(&mut self) -> Result<(), FrameError> {
        let instances = self.scene.instances();
        let wished = self.wishes.get().iter().zip(instances).filter(|&(&wish, _)| wish > 0);
        let mut wished: Vec<(u32, u32)> = wished.map(|(&wish, instance)| (wish, instance.part)).collect();
        for part in self.wished_parents() {
            self.residency.request(part, self.scene.tiers(part).len().saturating_sub(1) as u32)?;
        }
        for &(_, part) in &wished {
            self.residency.request(part, self.scene.tiers(part).len().saturating_sub(1) as u32)?;
        }
        wished.sort_unstable_by_key(|&(wish, part)| (std::cmp::Reverse(wish), part));
        for (wish, part) in wished {
            let sizes = self.scene.tiers(part).iter().map(|tier| tier.row.vertices);
            self.residency.request(part, coarsest_tier_with(sizes, wish))?;
        }
        Ok(())
    }

    /// The parts of the parent cells of what is wished for, which stand in until that has arrived.
    fn wished_parents(&self) -> Vec<u32> {
        if !self.scene.has_parents() {
            return Vec::new();
        }
        let wished = self.wishes.get().iter().enumerate().filter(|&(_, &wish)| wish > 0);
        let parents = wished.filter_map(|(instance, _)| self.scene.parent_instance(instance as u32));
        parents.map(|parent| self.scene.instances()[parent as usize].part).collect()
    }

    /// Stage 3: the deltas of every batch, in the order of its instances. Instances whose delta no longer fits the
    /// cap keep what they have until the next frame.
    pub(super) fn delta(&mut self, record: &mut FrameRecord) -> Result<Vec<Vec<Delta>>, FrameError> {
        if self.settled {
            return Ok(vec![Vec::new(); self.batches.len()]);
        }
        let started = Instant::now();
        self.deal_again_if_a_batch_overflows()?;
        self.hold_back_what_exceeds_the_cap();
        self.bytes_of_whole = self.batches.iter().map(|batch| self.bytes_of_all(batch)).sum();
        let deltas: Vec<Vec<Delta>> = self.batches.iter().map(|batch| self.deltas_of(batch)).collect();
        self.changed = deltas.iter().any(|deltas| !deltas.is_empty());
        record.delta_ms = milliseconds_since(started);
        Ok(deltas)
    }

    /// What `whole` sends of a batch: all records of what is drawn, a grant for what is or was, and the arguments of
    /// the draw if there is any.
    fn bytes_of_all(&self, batch: &Batch) -> u64 {
        let all = self.everything_of(batch);
        let records: u64 = all.iter().map(|delta| delta.lack(Strategy::Whole).bytes()).sum();
        let draw = if all.is_empty() { 0 } else { DRAW_BYTES };
        records + draw + (all.len() * size_of::<Grant>()) as u64
    }

    fn deltas_of(&self, batch: &Batch) -> Vec<Delta> {
        batch
            .instances
            .iter()
            .map(|&instance| {
                let (old, new) = (self.states[instance as usize], self.wanted[instance as usize]);
                Delta { instance, old, new }
            })
            .filter(|delta| delta.old != delta.new)
            .collect()
    }

    /// The cap is on deltas whatever the strategy, so that all strategies draw the same.
    fn hold_back_what_exceeds_the_cap(&mut self) {
        let Some(cap) = self.settings.upload_limit_bytes else { return };
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
            if spent > cap && i > 0 {
                self.wanted[placement.clone()].copy_from_slice(&self.states[placement]);
                self.pending = true;
            }
        }
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
        let mut first = 0;
        while first < self.states.len() {
            let placement = first..self.scene.placement_end(first as u32) as usize;
            first = placement.end;
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
        while !self.batches.iter().all(|batch| self.batch_fits(batch, limit)) {
            let batches = self.batches.len() * 2;
            if self.batches.len() >= self.scene.instances().len() {
                return Err(FrameError::BatchTooSmall { limit_bytes: limit });
            }
            tracing::info!(batches, "a batch overflows: dealing its instances again");
            self.deal(batches)?;
        }
        Ok(())
    }

    fn batch_fits(&self, batch: &Batch, limit: u64) -> bool {
        let totals = totals_of(batch, &self.wanted);
        let [vertices, ecol, triangles] = totals;
        fits(limit, totals, StreamedLayout { vertices, ecol, triangles }.words())
    }

    /// What every batch is sent under the strategy: its deltas, or all of it in every frame, as in the paper.
    pub(super) fn plan_uploads(&mut self, deltas: &[Vec<Delta>]) -> Vec<BatchUpload> {
        let strategy = self.settings.strategy;
        let uploads = self
            .batches
            .iter()
            .zip(deltas)
            .map(|(batch, deltas)| match strategy {
                Strategy::Coherent => self.upload_of(batch, deltas),
                Strategy::Whole | Strategy::PerPart => self.upload_of(batch, &self.everything_of(batch)),
            })
            .collect();
        for delta in deltas.iter().flatten() {
            self.states[delta.instance as usize] = delta.new;
        }
        uploads
    }

    fn everything_of(&self, batch: &Batch) -> Vec<Delta> {
        let all = batch.instances.iter().map(|&instance| Delta {
            instance,
            old: self.states[instance as usize],
            new: self.wanted[instance as usize],
        });
        all.filter(|delta| !(delta.old.is_empty() && delta.new.is_empty())).collect()
    }

    fn upload_of(&self, batch: &Batch, deltas: &[Delta]) -> BatchUpload {
        let mut upload = BatchUpload::default();
        if !deltas.is_empty() {
            upload.totals = totals_of(batch, &self.wanted);
        }
        let stride = self.batches.len() as u32;
        for delta in deltas {
            let part = self.scene.instances()[delta.instance as usize].part;
            // Dealt in turn: the batch-local number of an instance is its number divided by that of batches.
            let local = delta.instance / stride;
            debug_assert_eq!(batch.instances[local as usize], delta.instance);
            upload.push(local, part, delta, self.settings.strategy);
        }
        upload
    }
}

/// Active elements of each stream that a batch will have.
fn totals_of(batch: &Batch, wanted: &[State]) -> [u64; STREAMS] {
    let mut totals = [0; STREAMS];
    for &instance in &batch.instances {
        let state = wanted[instance as usize];
        totals[0] += u64::from(state.vertices);
        totals[1] += u64::from(state.ecol);
        totals[2] += u64::from(state.triangles);
    }
    totals
}
