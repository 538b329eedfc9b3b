//! A welded mesh in; whether its triangles close off a volume, and on which side of them it lies, out.
//!
//! What a section cuts of a closed surface has a face (`shaders/cut_face.wgsl`): its fronts and backs are counted, which needs
//! to know just that of a part.

use super::weld::WeldedMesh;

/// Whether a surface closes off a volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum Closure {
    /// It has borders, or triangles side by side that turn opposite ways.
    #[default]
    Open,
    /// Closed, and counter-clockwise from outside.
    Closed,
    /// Closed, and clockwise from outside.
    InsideOut,
}

/// Finds out: the surface is closed if on every edge as many triangles run one way as the other, also where more than
/// two meet. Time is linear, and nothing is allocated: what the ways of all edges add up to, each edge a random 64-bit
/// number, is zero if they cancel, and otherwise with a chance of 2^-64.
pub fn closure_of(mesh: &WeldedMesh) -> Closure {
    let mut balance = 0u64;
    let mut volume = 0.0;
    let middle = mesh.positions.first().map_or([0.0; 3], |p| p.map(f64::from));
    for triangle in &mesh.triangles {
        let positions = triangle.map(|wedge| mesh.wedge_position[wedge as usize]);
        for (from, to) in [(0, 1), (1, 2), (2, 0)].map(|(i, j)| (positions[i], positions[j])) {
            let weight = mix(u64::from(from.min(to)) << 32 | u64::from(from.max(to)));
            balance = if from < to { balance.wrapping_add(weight) } else { balance.wrapping_sub(weight) };
        }
        let corner = |k: usize| {
            let p = mesh.positions[positions[k] as usize];
            std::array::from_fn(|axis| f64::from(p[axis]) - middle[axis])
        };
        volume += determinant(corner(0), corner(1), corner(2));
    }
    match balance {
        0 if volume > 0.0 => Closure::Closed,
        0 if volume < 0.0 => Closure::InsideOut,
        _ => Closure::Open,
    }
}

fn determinant(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> f64 {
    a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
}

/// The finaliser of SplitMix64 (Steele et al. 2014).
fn mix(key: u64) -> u64 {
    let z = key.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(change: impl FnOnce(&mut Vec<[u32; 3]>)) -> WeldedMesh {
        let mut triangles = vec![
            [0, 2, 1],
            [1, 2, 3],
            [4, 5, 6],
            [5, 7, 6],
            [0, 1, 4],
            [1, 5, 4],
            [2, 6, 3],
            [3, 6, 7],
            [0, 4, 2],
            [2, 4, 6],
            [1, 3, 5],
            [3, 7, 5],
        ];
        change(&mut triangles);
        WeldedMesh {
            positions: (0..8u32).map(|i| [i & 1, i >> 1 & 1, i >> 2].map(|c| 100 + 50 * c)).collect(),
            wedge_position: (0..8).collect(),
            triangles,
            ..WeldedMesh::default()
        }
    }

    #[test]
    fn a_cube_is_closed_until_something_is_wrong_with_it() {
        assert_eq!(closure_of(&cube(|_| ())), Closure::Closed);
        let flipped = cube(|all| all.iter_mut().for_each(|t| t.swap(0, 1)));
        assert_eq!(closure_of(&flipped), Closure::InsideOut);
        assert_eq!(closure_of(&cube(|all| _ = all.pop())), Closure::Open);
        assert_eq!(closure_of(&cube(|all| all[3].swap(0, 1))), Closure::Open);
        assert_eq!(closure_of(&cube(|all| all.push(all[0]))), Closure::Open);
        assert_eq!(closure_of(&cube(Vec::clear)), Closure::Open);
    }

    #[test]
    fn two_cubes_that_share_an_edge_are_closed() {
        let one = cube(|_| ());
        let mut both = one.clone();
        // The other one lies at the diagonal edge of corners 6 and 7.
        let turned = |i: u32| {
            if i == 0 {
                6
            } else if i == 1 {
                7
            } else {
                8 + i
            }
        };
        both.positions.resize(16, [0; 3]);
        for i in 2..8u32 {
            both.positions[turned(i) as usize] = one.positions[i as usize].map(|c| c + 50);
        }
        both.wedge_position = (0..16).collect();
        both.triangles.extend(one.triangles.iter().map(|t| t.map(turned)));
        assert_eq!(closure_of(&both), Closure::Closed);
    }
}
