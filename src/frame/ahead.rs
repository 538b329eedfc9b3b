//! Where the camera will be in, requests for what it will see there out: after all that it sees now.

use super::Renderer;
use super::plan::{add_wanted, diagonal_px};
use crate::select::states::coarsest_tier_with;
use crate::stream::prefetch::in_view;
use crate::stream::residency::Wanted;

impl Renderer {
    /// Asks for what will be in view soon, in the tier that it will be wished in, about.
    pub(super) fn prefetch(&mut self) {
        let Some(camera) = self.ahead else { return };
        let focal_px = f64::from(camera.focal_px(self.settings.height));
        let seen = in_view(self.scene.boxes(), &camera, self.target.aspect(), |bounds| {
            diagonal_px(bounds, &camera, focal_px)
        });
        let vertices_per_response = self.vertices_per_response();
        let mut ahead: Vec<Wanted> = Vec::new();
        for (instance, px) in seen {
            let part = self.scene.instances()[instance as usize].part;
            let row = &self.scene.parts()[part as usize];
            let tiers = self.scene.tiers(part);
            // Of a part that was cut into cells only what stands in for all of them.
            let wish = match (row.is_parent(), row.is_root()) {
                (_, false) => continue,
                (true, true) => 0,
                (false, true) => (vertices_per_response * self.response(px as f32)) as u32,
            };
            let tier = coarsest_tier_with(tiers.iter().map(|tier| tier.vertices), wish);
            add_wanted(&mut ahead, &mut self.slots, Wanted { part, tier, weight: (px as f32).powi(3) });
        }
        self.residency.prefetch(&ahead);
    }

    /// What a wish is in proportion to, of a box that seems so long.
    fn response(&self, px: f32) -> f32 {
        px.powf(2.0 / self.settings.alpha)
    }

    /// The factor between the two, from what is in view and gets neither all nor the least.
    fn vertices_per_response(&self) -> f32 {
        let (mut vertices, mut responses) = (0.0, 0.0);
        for (&instance, &px) in self.wishes.visible().iter().zip(&self.seen_px) {
            let row = &self.scene.parts()[self.scene.instances()[instance as usize].part as usize];
            let wish = self.wishes.get()[instance as usize];
            if row.locked < wish && wish < row.vertices {
                vertices += wish as f32;
                responses += self.response(px);
            }
        }
        vertices / responses.max(1.0)
    }
}
