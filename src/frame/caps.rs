//! The caps on memory of the host and of the GPU: what they leave for chunks and for what is drawn, and how they are kept.

use super::{FrameError, Renderer, wants};
use crate::container::PartRow;
use crate::gpu::batch::{Batch, Sizing, drawn_bytes};
use crate::scene::part::bytes_of;
use crate::scene::{Camera, Scene};
use crate::select::Wishes;
use crate::stats::FrameRecord;
use crate::stream::State;
use crate::stream::delta::{ECOL_BYTES, TRIANGLE_BYTES, VERTEX_BYTES};
use crate::stream::gather::StreamedLayout;
use crate::stream::residency;
use crate::stream::residency::ResidencyOptions;
use crate::stream::staging::{LEAST_SLOT_BYTES, SLOTS};

/// Bytes of memory for each instance beside the tables: two states, its wish and what was granted, and what is tested of
/// it in the order of the groups (`select/cull.rs`).
const BYTES_PER_INSTANCE: u64 = 2 * size_of::<State>() as u64 + 28 + 36 + wants::BYTES_PER_INSTANCE;
/// Bytes of memory for each part beside the tables: what is wanted and held of it, and its places in lists.
const BYTES_PER_PART: u64 = residency::BYTES_PER_PART + wants::BYTES_PER_PART + 8;
/// Bytes of memory for each chunk beside the tables: who needs it, and whether it is asked for.
const BYTES_PER_CHUNK: u64 = wants::BYTES_PER_CHUNK + 1;
/// Under a cap on GPU memory a frame sends so much of it at most.
const UPLOAD_SHARE: u64 = 32;
/// The budget may be missed by so much, by rounding to states.
const BUDGET_SLACK: f64 = 1.02;

/// What the cap on memory leaves for chunks, once the tables are paid.
///
/// # Errors
/// It leaves no room for the largest of the coarsest chunks.
pub(super) fn residency_options(
    scene: &Scene,
    wishes: &Wishes,
    settings: &super::Settings,
) -> Result<ResidencyOptions, FrameError> {
    let read_rate = settings.read_rate;
    let Some(cap_bytes) = settings.memory_limit_bytes else {
        return Ok(ResidencyOptions { cap_bytes: None, read_rate });
    };
    let fixed = fixed_bytes(scene, wishes);
    let coarsest = (0..scene.parts().len() as u32).filter_map(|part| scene.tiers(part).last());
    let least = coarsest.map(|row| bytes_of(row, 0)).max().unwrap_or(0);
    if cap_bytes < fixed + least {
        return Err(FrameError::CapTooSmall { what: "memory", cap_bytes, need_bytes: fixed + least });
    }
    Ok(ResidencyOptions { cap_bytes: Some(cap_bytes - fixed), read_rate })
}

/// What a scene takes in memory before anything of it is read.
fn fixed_bytes(scene: &Scene, wishes: &Wishes) -> u64 {
    scene.bytes_held()
        + wishes.row_bytes()
        + scene.instances().len() as u64 * BYTES_PER_INSTANCE
        + scene.parts().len() as u64 * BYTES_PER_PART
        + scene.chunk_count() as u64 * BYTES_PER_CHUNK
}

/// Bytes of the staging ring, once so much was sent in a frame.
fn ring_bytes(most_sent: u64) -> u64 {
    SLOTS as u64 * most_sent.next_power_of_two()
}

/// Bytes of the largest part, all of it sent.
pub(super) fn largest_part_bytes(scene: &Scene) -> u64 {
    let bytes = |part: &PartRow| {
        u64::from(part.vertices) * (VERTEX_BYTES + ECOL_BYTES) + u64::from(part.triangles) * TRIANGLE_BYTES
    };
    scene.parts().iter().map(bytes).max().unwrap_or(0)
}

impl Renderer {
    /// All that the cap on memory counts.
    pub(super) fn memory_bytes(&self) -> u64 {
        fixed_bytes(&self.scene, &self.wishes) + self.residency.bytes_held()
    }

    /// How buffers are made.
    pub(super) fn sizing(&self) -> Sizing {
        if self.settings.gpu_limit_bytes.is_some() { Sizing::Tight } else { Sizing::Roomy }
    }

    /// The most that the deltas of a frame may take: the user's cap, or a share of the GPU's memory if that is capped.
    pub(super) fn upload_limit_bytes(&self) -> Option<u64> {
        let share = self.settings.gpu_limit_bytes.map(|cap| cap / UPLOAD_SHARE);
        match (self.settings.upload_limit_bytes, share) {
            (Some(own), Some(share)) => Some(own.min(share)),
            (own, share) => own.or(share),
        }
    }

    /// What the last choice takes of the tightest cap: above 1 is too much.
    pub(super) fn share_of_caps(&self) -> f64 {
        let budget = f64::from(self.settings.budget_vertices) * BUDGET_SLACK;
        let of_budget = self.granted as f64 / budget.max(1.0);
        let Some(cap) = self.settings.gpu_limit_bytes else { return of_budget };
        let left = cap.saturating_sub(self.fixed_gpu_bytes());
        of_budget.max(self.drawn_bytes() as f64 / left.max(1) as f64)
    }

    /// GPU memory that does not depend on what is drawn, with the room that transfers may come to need.
    fn fixed_gpu_bytes(&self) -> u64 {
        self.unchanging_gpu_bytes() + ring_bytes(self.most_sent())
    }

    /// The most bytes that a frame sends under the caps: one part goes in any case.
    fn most_sent(&self) -> u64 {
        self.upload_limit_bytes().unwrap_or(0).max(self.least_sent())
    }

    /// What a frame must be able to send whatever the caps.
    fn least_sent(&self) -> u64 {
        LEAST_SLOT_BYTES.max(self.largest_part_bytes)
    }

    fn unchanging_gpu_bytes(&self) -> u64 {
        self.batches.iter().map(Batch::fixed_bytes).sum::<u64>()
            + self.wishes.gpu_bytes()
            + self.rebuild.size_bytes()
            + self.target.gpu_bytes()
            + self.boxes.size_bytes()
    }

    /// GPU memory that what is drawn will take.
    fn drawn_bytes(&self) -> u64 {
        let sizing = self.sizing();
        let most_words = self.upload_limit_bytes().map_or(u64::MAX, |_| self.most_sent() / 4);
        let of_batch = |totals: [u64; 3]| {
            let words = StreamedLayout::of_totals(totals).words().min(most_words);
            drawn_bytes(sizing, totals, words, self.touched.len() as u64 / self.batches.len() as u64 + 1)
        };
        self.totals().into_iter().map(of_batch).sum()
    }

    /// Chooses again, with less, while what was chosen is above a cap.
    pub(super) fn keep_caps(&mut self, camera: &Camera, record: &mut FrameRecord) -> Result<(), FrameError> {
        if self.settled {
            return Ok(());
        }
        if let Some(cap_bytes) = self.settings.gpu_limit_bytes {
            // Enough for a part or two, so that a picture is possible; the ring takes up to 3 of 16 parts of the cap.
            let unchanging = self.unchanging_gpu_bytes() + (1 << 16);
            let least_ring = ring_bytes(self.least_sent());
            let need_bytes = (unchanging * 16 / 13).max(unchanging + least_ring + self.largest_part_bytes);
            if cap_bytes < need_bytes {
                return Err(FrameError::CapTooSmall { what: "GPU memory", cap_bytes, need_bytes });
            }
        }
        loop {
            let used = self.share_of_caps();
            let floors = self.floors as f64 / self.granted.max(1) as f64;
            let is_again = self.squeeze.again(used, floors, self.wishes.visible().is_empty());
            if !is_again {
                return Ok(());
            }
            self.is_exact = false;
            let view = self.select_view(camera);
            if self.wishes.update(&self.gpu, &self.scene, &view, true)? {
                record.compute_passes += 1;
            }
            self.residency(camera, record)?;
        }
    }

    /// How much of the projected area of what is visible has something drawn, in thousandths.
    pub(super) fn drawn_area_permille(&self) -> u64 {
        let (mut all, mut drawn) = (0.0f64, 0.0f64);
        for (&instance, &px) in self.wishes.visible().iter().zip(&self.seen_px) {
            let area = f64::from(px).powi(2);
            all += area;
            let is_drawn = !self.states[instance as usize].is_empty() || self.parent_is_drawn(instance);
            drawn += if is_drawn { area } else { 0.0 };
        }
        if all > 0.0 { (1000.0 * drawn / all) as u64 } else { 1000 }
    }
}
