//! Where the camera will be in, requests for what it will see there out: after all that it sees now.
//!
//! What is in view there is found by groups, as what is in view now (`select/cull.rs`).

use rayon::prelude::*;

use super::Renderer;
use super::plan::{add_wanted, diagonal_px};
use crate::select::states::coarsest_tier_with;
use crate::stream::residency::Wanted;

/// What is shorter than this, in pixels, is not worth a look.
const LEAST_PX: f32 = 2.0;

impl Renderer {
    /// Asks for what will be in view soon, in the tier that it will be wished in, about.
    pub(super) fn prefetch(&mut self) {
        // Under a cap that is too small for what is in view there is no room for more.
        let Some(camera) = self.ahead.filter(|_| !self.residency.is_capped()) else { return };
        let focal_px = f64::from(camera.focal_px(self.settings.height));
        let vertices_per_response = self.vertices_per_response();
        let view = self.select_view(&camera);
        let seen = self.wishes.in_view(&self.scene, &view);
        let (scene, residency, alpha) = (&self.scene, &self.residency, self.settings.alpha);
        let want = |&instance: &u32| {
            let part = scene.instances()[instance as usize].part;
            let row = &scene.parts()[part as usize];
            let px = diagonal_px(&scene.boxes()[instance as usize], &camera, focal_px) as f32;
            // Of a part that was cut into cells only what stands in for all of them.
            if !row.is_root() || px < LEAST_PX {
                return None;
            }
            let wish = if row.is_parent() { 0.0 } else { vertices_per_response * response(px, alpha) };
            let tier = coarsest_tier_with(scene.tiers(part).iter().map(|tier| tier.vertices), wish as u32);
            (!residency.stays(part, tier)).then_some(Wanted { part, tier, weight: px.powi(3) })
        };
        let mut ahead: Vec<Wanted> = Vec::new();
        for want in seen.par_iter().filter_map(want).collect::<Vec<_>>() {
            add_wanted(&mut ahead, &mut self.slots, want);
        }
        self.residency.prefetch(&ahead);
    }

    /// The factor between the two, from what is in view and gets neither all nor the least.
    fn vertices_per_response(&self) -> f32 {
        let (scene, wishes, alpha) = (&self.scene, self.wishes.get(), self.settings.alpha);
        let visible = self.wishes.visible().par_iter().zip(&self.seen_px);
        let weighed = visible.filter_map(|(&instance, &px)| {
            let row = &scene.parts()[scene.instances()[instance as usize].part as usize];
            let wish = wishes[instance as usize];
            (row.locked < wish && wish < row.vertices).then(|| (wish as f32, response(px, alpha)))
        });
        let sum = |a: (f32, f32), b: (f32, f32)| (a.0 + b.0, a.1 + b.1);
        let (vertices, responses) = weighed.reduce(|| (0.0, 0.0), sum);
        vertices / responses.max(1.0)
    }
}

/// What a wish is in proportion to, of a box that seems so long.
fn response(px: f32, alpha: f32) -> f32 {
    px.powf(2.0 / alpha)
}
