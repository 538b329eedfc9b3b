//! A mesh without normals in, the same mesh with normals by crease angle out.
//!
//! Around each position, the faces that meet at less than the crease angle are smoothed over; where they meet
//! at more, the vertex is split. Faces are weighted by their angle at the position, so that how a flat side
//! is cut into triangles makes no difference.

use glam::DVec3;
use rustc_hash::FxHashMap;

use crate::import::{Colour, SourceMesh};

/// The crease angle of meshes that come without normals, in degrees.
pub const CREASE_DEGREES: f32 = 40.0;

/// With more corners than this around one position they are gathered into clusters instead of compared in
/// pairs.
const MAX_PAIRWISE: usize = 64;

/// Gives the mesh unit normals, unless it has them.
///
/// Two faces at a position (bit-equal positions are one, whatever their indices) are smooth if their normals
/// differ by at most `crease_degrees`. Vertices become the unique tuples of position, normal and colour in
/// use; triangles keep their number, order and corners. Faces without area take the normal of what surrounds
/// them.
///
/// Takes time linear in the number of triangles, whatever their valences.
pub fn by_crease_angle(mesh: &mut SourceMesh, crease_degrees: f32) {
    if !mesh.normals.is_empty() || mesh.triangles.is_empty() {
        return;
    }
    let positions = position_numbers(&mesh.positions);
    let faces = Faces::of(mesh);
    let corners = CornersByPosition::new(&mesh.triangles, &positions);
    let cos_crease = f64::from(crease_degrees).to_radians().cos();
    let mut split = Split::new(mesh);
    let mut normals = Vec::new();
    for around in corners.iter() {
        normals.clear();
        smooth(around, &faces, cos_crease, &mut normals);
        split.add(around, &normals);
    }
    split.finish(mesh);
}

/// Numbers positions so that bit-equal ones (and the two zeros) have one number.
fn position_numbers(positions: &[[f32; 3]]) -> Vec<u32> {
    let mut numbers = FxHashMap::default();
    let number = |position: &[f32; 3]| {
        // Adding zero makes a plain zero of a negative one.
        let key = position.map(|c| (c + 0.0).to_bits());
        let next = numbers.len() as u32;
        *numbers.entry(key).or_insert(next)
    };
    positions.iter().map(number).collect()
}

/// Per face its unit normal, zero if it has no area; per corner the angle there.
struct Faces {
    normals: Vec<DVec3>,
    angles: Vec<f64>,
}

impl Faces {
    fn of(mesh: &SourceMesh) -> Self {
        let mut faces = Self {
            normals: Vec::with_capacity(mesh.triangles.len()),
            angles: Vec::with_capacity(mesh.triangles.len() * 3),
        };
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|v| DVec3::from_array(mesh.positions[v as usize].map(f64::from)));
            faces.normals.push((b - a).cross(c - a).normalize_or_zero());
            faces.angles.extend([angle(a, b, c), angle(b, c, a), angle(c, a, b)]);
        }
        faces
    }

    /// The weighted normal of a corner.
    fn weighted(&self, corner: u32) -> DVec3 {
        self.normals[corner as usize / 3] * self.angles[corner as usize]
    }
}

/// The angle at `at` between the directions to `b` and `c`, in radians; 0 where a direction is missing.
fn angle(at: DVec3, b: DVec3, c: DVec3) -> f64 {
    let (to_b, to_c) = (b - at, c - at);
    to_b.cross(to_c).length().atan2(to_b.dot(to_c))
}

/// The corners (three times the face, plus 0 to 2) at each position, in order.
struct CornersByPosition {
    starts: Vec<u32>,
    corners: Vec<u32>,
}

impl CornersByPosition {
    fn new(triangles: &[[u32; 3]], positions: &[u32]) -> Self {
        let at = |vertex: u32| positions[vertex as usize] as usize;
        let count = positions.iter().max().map_or(0, |&last| last as usize + 1);
        let mut starts = vec![0u32; count + 1];
        triangles.iter().flatten().for_each(|&vertex| starts[at(vertex) + 1] += 1);
        for i in 0..count {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut corners = vec![0; triangles.len() * 3];
        for (corner, &vertex) in triangles.iter().flatten().enumerate() {
            let slot = &mut next[at(vertex)];
            corners[*slot as usize] = corner as u32;
            *slot += 1;
        }
        Self { starts, corners }
    }

    fn iter(&self) -> impl Iterator<Item = &[u32]> {
        self.starts.windows(2).map(|range| &self.corners[range[0] as usize..range[1] as usize])
    }
}

/// Finds the normals of all corners around one position.
fn smooth(around: &[u32], faces: &Faces, cos_crease: f64, normals: &mut Vec<[f32; 3]>) {
    let all: DVec3 = around.iter().map(|&corner| faces.weighted(corner)).sum();
    let normal = |corner: &u32| faces.normals[*corner as usize / 3];
    if around.len() <= MAX_PAIRWISE {
        let mut pairs = around.iter().enumerate().flat_map(|(i, a)| around[i..].iter().map(move |b| (a, b)));
        if let Some(one) = all.try_normalize()
            && pairs.all(|(a, b)| normal(a).dot(normal(b)) >= cos_crease)
        {
            normals.resize(around.len(), one.as_vec3().to_array());
            return;
        }
        for &corner in around {
            let own = faces.normals[corner as usize / 3];
            let is_smooth = |other: &u32| faces.normals[*other as usize / 3].dot(own) >= cos_crease;
            let sum = around.iter().copied().filter(is_smooth).map(|other| faces.weighted(other)).sum();
            normals.push(rounded([sum, own, all]));
        }
    } else {
        smooth_by_clusters(around, all, faces, cos_crease, normals);
    }
}

/// As `smooth`, but every face joins the first cluster that was begun within the crease angle. Clusters are
/// that far apart on the sphere, so there are few.
fn smooth_by_clusters(
    around: &[u32],
    all: DVec3,
    faces: &Faces,
    cos_crease: f64,
    normals: &mut Vec<[f32; 3]>,
) {
    // However small the crease angle, this bounds the time.
    const MAX_CLUSTERS: usize = 64;
    let mut clusters: Vec<(DVec3, DVec3)> = Vec::new();
    let mut cluster_of = Vec::with_capacity(around.len());
    for &corner in around {
        let own = faces.normals[corner as usize / 3];
        let found = clusters.iter().position(|(first, _)| first.dot(own) >= cos_crease);
        let cluster = found.unwrap_or_else(|| {
            if own != DVec3::ZERO && clusters.len() < MAX_CLUSTERS {
                clusters.push((own, DVec3::ZERO));
                return clusters.len() - 1;
            }
            usize::MAX
        });
        if let Some((_, sum)) = clusters.get_mut(cluster) {
            *sum += faces.weighted(corner);
        }
        cluster_of.push(cluster);
    }
    for (&corner, cluster) in around.iter().zip(cluster_of) {
        let own = faces.normals[corner as usize / 3];
        let sum = clusters.get(cluster).map_or(DVec3::ZERO, |(_, sum)| *sum);
        normals.push(rounded([sum, own, all]));
    }
}

/// The first of the candidates that has a direction, at length 1; z if none has.
fn rounded(candidates: [DVec3; 3]) -> [f32; 3] {
    let found = candidates.into_iter().find_map(DVec3::try_normalize);
    found.unwrap_or(DVec3::Z).as_vec3().to_array()
}

/// What tells the vertices of one position apart.
type VertexKey = (Option<Colour>, [u32; 3]);

/// The vertices of a mesh made anew, position by position.
struct Split {
    source: SourceMesh,
    /// The new mesh; its triangles name the old vertices where they have not been reached.
    mesh: SourceMesh,
    /// The new vertices of the position at hand.
    own: Vec<(VertexKey, u32)>,
}

impl Split {
    /// Takes all out of the mesh.
    fn new(mesh: &mut SourceMesh) -> Self {
        let mut source = std::mem::take(mesh);
        let (name, triangles) = (std::mem::take(&mut source.name), std::mem::take(&mut source.triangles));
        let mesh = SourceMesh { name, body: source.body, triangles, ..SourceMesh::default() };
        Self { source, mesh, own: Vec::new() }
    }

    /// Adds the vertices of one position, and points its corners, whose normals are given, at them.
    fn add(&mut self, around: &[u32], normals: &[[f32; 3]]) {
        if around.len() > MAX_PAIRWISE {
            let mut own = FxHashMap::default();
            return self.point(around, normals, |key, next| *own.entry(key).or_insert(next));
        }
        let mut own = std::mem::take(&mut self.own);
        own.clear();
        self.point(around, normals, |key, next| {
            let found = own.iter().find(|entry| entry.0 == key).map(|entry| entry.1);
            found.unwrap_or_else(|| {
                own.push((key, next));
                next
            })
        });
        self.own = own;
    }

    /// As `add`; `number` finds the vertex of a key, or makes it the one given.
    fn point(&mut self, around: &[u32], normals: &[[f32; 3]], mut number: impl FnMut(VertexKey, u32) -> u32) {
        let corners = self.mesh.triangles.as_flattened_mut();
        for (&corner, &normal) in around.iter().zip(normals) {
            let corner = &mut corners[corner as usize];
            let vertex = *corner as usize;
            let colour = self.source.colours.get(vertex).copied();
            let next = self.mesh.positions.len() as u32;
            *corner = number((colour, normal.map(f32::to_bits)), next);
            if *corner == next {
                self.mesh.positions.push(self.source.positions[vertex]);
                self.mesh.normals.push(normal);
                self.mesh.colours.extend(colour);
            }
        }
    }

    fn finish(self, mesh: &mut SourceMesh) {
        *mesh = self.mesh;
    }
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use super::*;

    fn cube() -> SourceMesh {
        let positions = (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2].map(|c| c as f32)).collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]: &[u32; 4]| [[a, b, c], [a, c, d]]).collect();
        SourceMesh { name: "cube".to_owned(), positions, triangles, ..SourceMesh::default() }
    }

    /// A sphere of `n` rings of `2 n` quads, closed, its poles shared.
    fn sphere(n: u32) -> SourceMesh {
        let mut mesh =
            SourceMesh { positions: vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]], ..SourceMesh::default() };
        let turns = 2 * n;
        for ring in 1..n {
            let polar = std::f32::consts::PI * ring as f32 / n as f32;
            for turn in 0..turns {
                let around = std::f32::consts::PI * turn as f32 / n as f32;
                mesh.positions.push([polar.sin() * around.cos(), polar.sin() * around.sin(), polar.cos()]);
            }
        }
        let at = |ring: u32, turn: u32| 2 + (ring - 1) * turns + turn % turns;
        for turn in 0..turns {
            mesh.triangles.push([0, at(1, turn), at(1, turn + 1)]);
            mesh.triangles.push([1, at(n - 1, turn + 1), at(n - 1, turn)]);
            for ring in 1..n - 1 {
                let [a, b, c, d] =
                    [at(ring, turn), at(ring + 1, turn), at(ring + 1, turn + 1), at(ring, turn + 1)];
                mesh.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        mesh
    }

    fn is_unit(normal: &[f32; 3]) -> bool {
        (normal.iter().map(|c| c * c).sum::<f32>() - 1.0).abs() < 1e-5
    }

    #[test]
    fn cube_has_24_vertices_with_the_normals_of_its_sides() {
        let mut mesh = cube();
        by_crease_angle(&mut mesh, CREASE_DEGREES);
        assert_eq!((mesh.positions.len(), mesh.normals.len(), mesh.triangles.len()), (24, 24, 12));
        assert_eq!(mesh.name, "cube");
        for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
            let axis = normal.iter().position(|c| c.abs() == 1.0).unwrap();
            assert_eq!(normal[axis], position[axis] * 2.0 - 1.0, "outward");
        }
    }

    #[test]
    fn cube_corners_are_shared_above_the_crease_angle() {
        let mut mesh = cube();
        by_crease_angle(&mut mesh, 91.0);
        assert_eq!(mesh.positions.len(), 8);
        // Angle weights: however the sides are cut, the normal of a corner is the diagonal.
        assert!(mesh.normals.iter().all(|n| n.iter().all(|c| (c.abs() - 3f32.sqrt().recip()).abs() < 1e-6)));
    }

    #[test]
    fn soup_becomes_shared() {
        let indexed = cube();
        let corners = indexed.triangles.as_flattened();
        let mut soup = SourceMesh {
            positions: corners
                .iter()
                .map(|&v| indexed.positions[v as usize].map(|c| if c == 0.0 { -0.0 } else { c }))
                .collect(),
            triangles: (0..12).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            ..SourceMesh::default()
        };
        by_crease_angle(&mut soup, CREASE_DEGREES);
        assert_eq!(soup.positions.len(), 24);
    }

    #[test]
    fn smooth_sphere_stays_shared() {
        let mut mesh = sphere(24);
        let before = mesh.clone();
        by_crease_angle(&mut mesh, CREASE_DEGREES);
        assert_eq!(mesh.positions.len(), before.positions.len());
        for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
            let dot: f32 = position.iter().zip(normal).map(|(p, n)| p * n).sum();
            assert!(dot > 0.999, "{position:?} {normal:?}");
        }
    }

    #[test]
    fn pole_of_huge_valence_is_fast_and_smooth() {
        let triangles = 300_000;
        let mut mesh = SourceMesh { positions: vec![[0.0, 0.0, 0.1]], ..SourceMesh::default() };
        for turn in 0..triangles {
            let around = std::f64::consts::TAU * f64::from(turn) / f64::from(triangles);
            mesh.positions.push([around.cos() as f32, around.sin() as f32, 0.0]);
            mesh.triangles.push([0, 1 + turn, 1 + (turn + 1) % triangles]);
        }
        let start = Instant::now();
        by_crease_angle(&mut mesh, CREASE_DEGREES);
        assert!(start.elapsed().as_secs() < 10);
        assert_eq!(mesh.positions.iter().filter(|p| p[2] > 0.0).count(), 1, "one pole");
        assert!(mesh.normals.iter().all(is_unit));
    }

    #[test]
    fn faces_without_area_are_harmless() {
        let mut mesh = cube();
        mesh.triangles.extend([[0, 0, 1], [3, 3, 3]]);
        mesh.positions.extend([[9.0; 3], [10.0; 3], [11.0; 3]]);
        mesh.triangles.push([8, 9, 10]);
        mesh.colours = vec![[1, 2, 3, 255]; 11];
        by_crease_angle(&mut mesh, CREASE_DEGREES);
        assert_eq!(mesh.triangles.len(), 15);
        assert_eq!(mesh.colours.len(), mesh.positions.len());
        assert!(mesh.normals.iter().all(is_unit));
        assert!(mesh.triangles.iter().flatten().all(|&v| (v as usize) < mesh.positions.len()));
    }

    #[test]
    fn tiny_and_huge_meshes_have_normals_too() {
        for scale in [1e-30_f32, 1e30] {
            let mut mesh = cube();
            mesh.positions.iter_mut().flatten().for_each(|c| *c *= scale);
            by_crease_angle(&mut mesh, CREASE_DEGREES);
            assert_eq!(mesh.positions.len(), 24);
        }
    }

    #[test]
    fn normals_at_hand_are_kept() {
        let mut mesh = cube();
        mesh.normals = vec![[0.0, 0.0, 1.0]; 8];
        let before = mesh.clone();
        by_crease_angle(&mut mesh, CREASE_DEGREES);
        assert_eq!(mesh, before);
    }
}
