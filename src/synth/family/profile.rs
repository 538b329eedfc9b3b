//! The sections of rolled and pressed profiles: angle, Z, channel, T and double T.

/// A section: an outline counter-clockwise in units of its height, and the triangles that fill it.
#[derive(Debug, Clone, Copy)]
pub struct Profile {
    /// (across, outwards); 0 outwards is the foot.
    pub outline: &'static [[f32; 2]],
    /// Two less than points.
    pub triangles: &'static [[u32; 3]],
}

/// How thick sheets are.
const E: f32 = 0.07;

/// All sections, the one of fewest points first.
pub const PROFILES: [Profile; 5] = [
    // An angle.
    Profile {
        outline: &[[0.0, 0.0], [0.7, 0.0], [0.7, E], [E, E], [E, 1.0], [0.0, 1.0]],
        triangles: &[[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]],
    },
    // A Z.
    Profile {
        outline: &[
            [-0.5, 0.0],
            [E, 0.0],
            [E, 1.0 - E],
            [0.5, 1.0 - E],
            [0.5, 1.0],
            [0.0, 1.0],
            [0.0, E],
            [-0.5, E],
        ],
        triangles: &[[0, 1, 6], [0, 6, 7], [1, 2, 5], [1, 5, 6], [2, 3, 4], [2, 4, 5]],
    },
    // A channel.
    Profile {
        outline: &[
            [0.0, 0.0],
            [0.5, 0.0],
            [0.5, E],
            [E, E],
            [E, 1.0 - E],
            [0.5, 1.0 - E],
            [0.5, 1.0],
            [0.0, 1.0],
        ],
        triangles: &[[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 7], [4, 5, 6], [4, 6, 7]],
    },
    // A T.
    Profile {
        outline: &[
            [-0.04, 0.0],
            [0.04, 0.0],
            [0.04, 0.92],
            [0.4, 0.92],
            [0.4, 1.0],
            [-0.4, 1.0],
            [-0.4, 0.92],
            [-0.04, 0.92],
        ],
        triangles: &[[0, 1, 2], [0, 2, 7], [7, 2, 4], [7, 4, 5], [2, 3, 4], [5, 6, 7]],
    },
    // A double T.
    Profile {
        outline: &[
            [-0.35, 0.0],
            [0.35, 0.0],
            [0.35, E],
            [0.04, E],
            [0.04, 0.93],
            [0.35, 0.93],
            [0.35, 1.0],
            [-0.35, 1.0],
            [-0.35, 0.93],
            [-0.04, 0.93],
            [-0.04, E],
            [-0.35, E],
        ],
        triangles: &[
            [0, 1, 3],
            [0, 3, 10],
            [1, 2, 3],
            [10, 11, 0],
            [10, 3, 4],
            [10, 4, 9],
            [9, 4, 6],
            [9, 6, 7],
            [4, 5, 6],
            [7, 8, 9],
        ],
    },
];

impl Profile {
    /// Points of the outline.
    pub fn points(&self) -> u32 {
        self.outline.len() as u32
    }

    /// The unit normal of the side that starts at a point.
    pub fn normal(&self, side: usize) -> [f32; 2] {
        let (a, b) = (self.outline[side], self.outline[(side + 1) % self.outline.len()]);
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let length = dx.hypot(dy);
        [dy / length, -dx / length]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_fill_their_outlines_once() {
        for profile in PROFILES {
            let area = |corners: &[[f32; 2]]| {
                let pairs = corners.iter().zip(corners.iter().cycle().skip(1));
                pairs.map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum::<f32>() / 2.0
            };
            let parts: Vec<f32> = profile
                .triangles
                .iter()
                .map(|triangle| area(&triangle.map(|corner| profile.outline[corner as usize])))
                .collect();
            assert_eq!(parts.len() + 2, profile.outline.len());
            assert!(parts.iter().all(|&part| part > 1e-4), "{parts:?}");
            assert!((parts.iter().sum::<f32>() - area(profile.outline)).abs() < 1e-5, "{profile:?}");
        }
    }
}
