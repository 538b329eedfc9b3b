//! Positions and triangles in, a surface to sample and to measure against out.

use glam::DVec3;

use super::closest::{Hit, Tree};

/// The triangles of a mesh that have an area, ready to be sampled and to be measured against.
#[derive(Debug)]
pub struct Surface {
    tree: Tree,
    /// Unit normals, one a triangle.
    normals: Vec<DVec3>,
    /// The area of each triangle and all before it.
    cumulated: Vec<f64>,
    /// The positions that triangles use.
    corners: Vec<DVec3>,
}

impl Surface {
    /// Takes positions and the triangles on them, whose indices must be below `positions.len()`.
    ///
    /// Triangles without an area are left out.
    pub fn new(positions: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let corners_of = |triangle: &[u32; 3]| triangle.map(|vertex| positions[vertex as usize]);
        let with_area = triangles.iter().map(corners_of).filter(|&[a, b, c]| doubled(a, b, c).length() > 0.0);
        let tree = Tree::new(with_area.collect());
        let doubled_areas = || tree.triangles().iter().map(|&[a, b, c]| doubled(a, b, c));
        let normals = doubled_areas().map(|n| n / n.length()).collect();
        let mut area = 0.0;
        let cumulated = doubled_areas().map(|n| {
            area += 0.5 * n.length();
            area
        });
        Self { cumulated: cumulated.collect(), normals, corners: used(positions, triangles), tree }
    }

    /// How many triangles have an area.
    pub fn triangle_count(&self) -> usize {
        self.normals.len()
    }

    /// Sum of all areas, in the square of the positions' unit.
    pub fn area(&self) -> f64 {
        self.cumulated.last().copied().unwrap_or(0.0)
    }

    /// The unit normal of a triangle.
    pub(super) fn normal(&self, triangle: u32) -> DVec3 {
        self.normals[triangle as usize]
    }

    /// Points uniform by area, each with its triangle: one in each of `count` equal stretches of the cumulated area.
    pub(super) fn samples(&self, count: usize, seed: u64) -> Vec<(DVec3, u32)> {
        (0..count).map(|i| self.sample(i, count, seed)).collect()
    }

    fn sample(&self, i: usize, count: usize, seed: u64) -> (DVec3, u32) {
        let [along, first, second] = [0, 1, 2].map(|k| random(seed, 3 * i as u64 + k));
        let area = (i as f64 + along) / count as f64 * self.area();
        let triangle = self.cumulated.partition_point(|&sum| sum <= area).min(self.cumulated.len() - 1);
        let [a, b, c] = self.tree.triangles()[triangle];
        let root = first.sqrt();
        (a * (1.0 - root) + b * (root * (1.0 - second)) + c * (root * second), triangle as u32)
    }

    /// The positions that triangles use: all, or where they are more than `cap`, every so manieth.
    pub(super) fn corners(&self, cap: usize) -> Vec<DVec3> {
        let stride = self.corners.len().div_ceil(cap).max(1);
        self.corners.iter().copied().step_by(stride).collect()
    }

    /// The closest triangle for each point; quick if neighbours in the list are neighbours in space.
    pub(super) fn closest_of(&self, points: &[DVec3]) -> Vec<Hit> {
        let mut last = 0;
        let hits = points.iter().map(|&point| {
            let hit = self.tree.closest(point, last);
            last = hit.triangle;
            hit
        });
        hits.collect()
    }
}

/// The normal whose length is twice the area.
fn doubled(a: DVec3, b: DVec3, c: DVec3) -> DVec3 {
    (b - a).cross(c - a)
}

fn used(positions: &[DVec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let mut used = vec![false; positions.len()];
    for &vertex in triangles.as_flattened() {
        used[vertex as usize] = true;
    }
    positions.iter().zip(used).filter(|&(_, used)| used).map(|(&position, _)| position).collect()
}

/// Number `i` of the sequence that a seed names, in 0..1 (Steele et al. 2014, SplitMix64).
fn random(seed: u64, i: u64) -> f64 {
    let mixed = |z: u64| {
        let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    let start = mixed(seed.wrapping_add(0x9e37_79b9_7f4a_7c15));
    let z = mixed(start.wrapping_add((i + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15)));
    (z >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_follow_the_area_and_lie_on_their_triangles() {
        let positions =
            [[0., 0., 0.], [3., 0., 0.], [0., 2., 0.], [0., 0., 1.], [9., 9., 9.]].map(DVec3::from);
        // Areas 3, 1 and 0.
        let surface = Surface::new(&positions, &[[0, 1, 2], [0, 2, 3], [0, 1, 1]]);
        assert_eq!((surface.triangle_count(), surface.area()), (2, 4.0));
        assert_eq!(surface.corners(10).len(), 4);
        assert_eq!(surface.corners(2).len(), 2);
        let samples = surface.samples(4000, 1);
        let on_the_floor = samples.iter().filter(|(p, _)| p.z == 0.0).count();
        assert!(on_the_floor.abs_diff(3000) <= 1, "{on_the_floor}");
        for (point, triangle) in samples {
            let hit = surface.closest_of(&[point])[0];
            assert!(hit.squared < 1e-28 && hit.triangle == triangle);
        }
    }

    #[test]
    fn random_numbers_fill_the_unit_interval() {
        let mean = (0..10_000).map(|i| random(7, i)).sum::<f64>() / 1e4;
        assert!((mean - 0.5).abs() < 0.01, "{mean}");
        assert_ne!(random(7, 0), random(8, 0));
    }
}
