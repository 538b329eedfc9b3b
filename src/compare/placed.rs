//! The placements of a part in, what turns its figures into those of the placed model out.

use glam::DAffine3;

use crate::container::Container;

/// How often and how large a part is placed.
///
/// A transform that is not a similarity counts as the one that leaves the same volume.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Placed {
    /// How often.
    pub copies: u64,
    /// The largest scale.
    pub largest: f64,
    /// The sums of the second, third and fourth powers of the scales.
    pub powers: [f64; 3],
}

impl Placed {
    fn add(&mut self, world_from_part: &DAffine3) {
        let scale = world_from_part.matrix3.determinant().abs().cbrt();
        self.copies += 1;
        self.largest = self.largest.max(scale);
        for (sum, power) in self.powers.iter_mut().zip(2..) {
            *sum += scale.powi(power);
        }
    }

    /// The mean of the fourth powers of its scales: what a cost in part space becomes.
    pub fn cost_scale(&self) -> f64 {
        self.powers[2] / self.copies.max(1) as f64
    }

    /// What an error in part space becomes.
    pub fn error_scale(&self) -> f64 {
        self.cost_scale().sqrt().sqrt()
    }
}

/// How each row of the table of parts is placed.
pub(super) fn placements(container: &Container<'_>) -> Vec<Placed> {
    let mut placed = vec![Placed::default(); container.parts().len()];
    for instance in container.instances() {
        placed[instance.part as usize].add(&instance.transform());
    }
    placed
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn copies_count_by_their_size() {
        let mut placed = Placed::default();
        for scale in [DVec3::splat(2.0), DVec3::new(-1.0, 1.0, 1.0)] {
            placed.add(&DAffine3::from_scale(scale));
        }
        assert_eq!(placed, Placed { copies: 2, largest: 2.0, powers: [5.0, 9.0, 17.0] });
        assert_eq!((placed.cost_scale(), placed.error_scale()), (8.5, 8.5f64.powf(0.25)));
    }
}
