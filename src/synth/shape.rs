//! Patches in, one mesh of exactly as many triangles as were asked for out.
//!
//! A patch is what a CAD exporter makes of one face: it has vertices and normals of its own, and repeats the positions
//! of its neighbours bit for bit along the edges. Nothing here is shared between two patches but the arithmetic that
//! makes a position: whoever needs a ring twice computes it in the same way twice. Every kind of patch has an even
//! number of triangles when its rings have an even number of points, so that closed shells come out even, as they must.

use glam::{Affine3A, Vec3};

use crate::import::SourceMesh;

/// A mesh while patches are added to it. Counts are those of triangles; lengths are metres.
#[derive(Debug, Default)]
pub struct Shape {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    /// The first of the two triangles of every quad that has no vertex in its centre yet.
    quads: Vec<u32>,
    /// A triangle whose first edge is on the open boundary.
    free_edge: Option<u32>,
}

impl Shape {
    /// An empty shape with room for so many triangles.
    pub fn with_room(triangles: u32) -> Self {
        let room = triangles as usize;
        Self {
            positions: Vec::with_capacity(room),
            normals: Vec::with_capacity(room),
            triangles: Vec::with_capacity(room),
            ..Self::default()
        }
    }

    /// How many triangles there are.
    pub fn count(&self) -> u32 {
        self.triangles.len() as u32
    }

    fn vertex(&mut self, (position, normal): (Vec3, Vec3)) -> u32 {
        // Adding 0 makes a negative zero positive, so that equal positions have equal bits.
        self.positions.push((position + Vec3::ZERO).to_array());
        self.normals.push(normal.normalize_or(Vec3::Z).to_array());
        self.positions.len() as u32 - 1
    }

    /// A patch of `nu` x `nv` quads: `2 nu nv` triangles. `at` gives position and normal of a corner, and the normals say
    /// which way the patch faces.
    pub fn grid(&mut self, size: [u32; 2], at: impl FnMut(u32, u32) -> (Vec3, Vec3)) {
        let first = self.triangles.len();
        self.patch(size, at);
        self.face_outwards(first);
    }

    /// The same where the normals may be too far apart to tell: it faces along the cross product of its two ways, or the
    /// other way.
    pub fn wound_grid(&mut self, size: [u32; 2], turned: bool, at: impl FnMut(u32, u32) -> (Vec3, Vec3)) {
        let first = self.triangles.len();
        self.patch(size, at);
        if turned {
            self.triangles[first..].iter_mut().for_each(|triangle| triangle.reverse());
        }
    }

    fn patch(&mut self, [nu, nv]: [u32; 2], mut at: impl FnMut(u32, u32) -> (Vec3, Vec3)) {
        let base = self.positions.len() as u32;
        for (j, i) in (0..=nv).flat_map(|j| (0..=nu).map(move |i| (j, i))) {
            let corner = at(i, j);
            self.vertex(corner);
        }
        for (j, i) in (0..nv).flat_map(|j| (0..nu).map(move |i| (j, i))) {
            let a = base + j * (nu + 1) + i;
            self.quad([a, a + 1, a + nu + 2, a + nu + 1]);
        }
    }

    /// Says that the grid whose first triangle has this number lies free: its first edge is on the boundary, where one
    /// triangle more can be had.
    pub fn free_first_edge(&mut self, first: u32) {
        self.quads.retain(|&quad| quad != first);
        // Turned round, the triangle has its first edge second.
        let [a, b, c] = self.triangles[first as usize];
        self.triangles[first as usize] = if a + 1 == b { [a, b, c] } else { [b, c, a] };
        self.free_edge = Some(first);
    }

    fn quad(&mut self, [a, b, c, d]: [u32; 4]) {
        self.quads.push(self.triangles.len() as u32);
        self.triangles.extend([[a, b, c], [a, c, d]]);
    }

    /// A convex polygon of `n` points in a zigzag: `n - 2` triangles.
    pub fn cap(&mut self, ring: &[Vec3], normal: Vec3) {
        self.soft_cap(ring, |_| normal);
    }

    /// The same with a normal for every point.
    pub fn soft_cap(&mut self, ring: &[Vec3], normal: impl Fn(usize) -> Vec3) {
        let (base, first) = (self.positions.len() as u32, self.triangles.len());
        for (number, &point) in ring.iter().enumerate() {
            self.vertex((point, normal(number)));
        }
        let (mut low, mut high) = (0, ring.len() as u32 - 1);
        while high - low >= 2 {
            self.triangles.push([base + low, base + low + 1, base + high]);
            low += 1;
            if high - low >= 2 {
                self.triangles.push([base + low, base + high - 1, base + high]);
                high -= 1;
            }
        }
        self.face_outwards(first);
    }

    /// A polygon of any form, cut into the given triangles.
    pub fn polygon(&mut self, ring: &[Vec3], triangles: &[[u32; 3]], normal: Vec3) {
        let (base, first) = (self.positions.len() as u32, self.triangles.len());
        for &point in ring {
            self.vertex((point, normal));
        }
        self.triangles.extend(triangles.iter().map(|corners| corners.map(|corner| base + corner)));
        self.face_outwards(first);
    }

    /// A plane face between a convex polygon of `p` points and a round hole of `n` points in it, `n` a multiple of `p`:
    /// `n + p` triangles. The hole's first point lies half a side before the polygon's.
    pub fn collar(&mut self, outer: &[Vec3], hole: &[Vec3], normal: Vec3) {
        let (base, first) = (self.positions.len() as u32, self.triangles.len());
        for &point in outer.iter().chain(hole) {
            self.vertex((point, normal));
        }
        let (p, n) = (outer.len() as u32, hole.len() as u32);
        let (corner, round) = (|i: u32| base + i % p, |j: u32| base + p + j % n);
        for i in 0..p {
            let arc = i * (n / p)..(i + 1) * (n / p);
            self.triangles.extend(arc.clone().map(|j| [corner(i), round(j + 1), round(j)]));
            self.triangles.push([corner(i), corner(i + 1), round(arc.end)]);
        }
        self.face_outwards(first);
    }

    /// A body of revolution around the local z axis through points of (radius, height), `n` points around; closed by
    /// flat caps: `2 n (points - 1) + 2 (n - 2)` triangles. The points go upwards with the inside on their left.
    pub fn turned(&mut self, place: &Affine3A, n: u32, points: &[[f32; 2]], finish: Finish) {
        self.turned_side(place, n, points, finish);
        let last = points.len() - 1;
        for (end, direction) in [(0, Vec3::NEG_Z), (last, Vec3::Z)] {
            let ring: Vec<Vec3> = (0..n).map(|i| on_ring(place, points[end], i, n)).collect();
            let normal = place.transform_vector3(direction);
            match finish {
                Finish::Soft => {
                    let own = profile_normal(points, end, finish);
                    self.soft_cap(&ring, |i| place.transform_vector3(around(own, i as u32, n)));
                }
                Finish::Smooth | Finish::Creased | Finish::Dome => self.cap(&ring, normal),
            }
        }
    }

    /// The same without its lower cap: `n - 2` triangles less, and open.
    pub fn dome(&mut self, place: &Affine3A, n: u32, points: &[[f32; 2]]) {
        self.turned_side(place, n, points, Finish::Dome);
        let last = points.len() - 1;
        let ring: Vec<Vec3> = (0..n).map(|i| on_ring(place, points[last], i, n)).collect();
        let own = profile_normal(points, last, Finish::Dome);
        self.soft_cap(&ring, |i| place.transform_vector3(around(own, i as u32, n)));
    }

    /// The side of a body of revolution: `2 n (points - 1)` triangles.
    pub fn turned_side(&mut self, place: &Affine3A, n: u32, points: &[[f32; 2]], finish: Finish) {
        if finish == Finish::Creased {
            for band in points.windows(2) {
                self.turned_side(place, n, band, Finish::Smooth);
            }
            return;
        }
        let normals: Vec<[f32; 2]> = (0..points.len()).map(|k| profile_normal(points, k, finish)).collect();
        self.grid([n, points.len() as u32 - 1], |i, j| {
            let k = j as usize;
            let normal = place.transform_vector3(around(normals[k], i % n, n));
            (on_ring(place, points[k], i % n, n), normal)
        });
    }

    /// The sides of an upright prism on a regular polygon, each a patch: `2 n` triangles.
    pub fn flat_side(&mut self, place: &Affine3A, n: u32, [low, high]: [[f32; 2]; 2]) {
        for side in 0..n {
            let middle = std::f32::consts::TAU * (side as f32 + 0.5) / n as f32;
            let normal = place.transform_vector3(Vec3::new(middle.cos(), middle.sin(), 0.0));
            self.grid([1, 1], |i, j| (on_ring(place, [low, high][j as usize], (side + i) % n, n), normal));
        }
    }

    /// A box between two corners: 12 triangles.
    pub fn cuboid(&mut self, place: &Affine3A, low: Vec3, high: Vec3) {
        let corners = [[low.x, low.y], [high.x, low.y], [high.x, high.y], [low.x, high.y]];
        self.prism(place, &corners, low.z, high.z);
    }

    /// An upright prism on a convex polygon of `p` points: `4 p - 4` triangles.
    pub fn prism(&mut self, place: &Affine3A, polygon: &[[f32; 2]], low: f32, high: f32) {
        let at = |[x, y]: [f32; 2], z: f32| place.transform_point3(Vec3::new(x, y, z));
        for (number, &a) in polygon.iter().enumerate() {
            let b = polygon[(number + 1) % polygon.len()];
            let normal = place.transform_vector3(Vec3::new(b[1] - a[1], a[0] - b[0], 0.0));
            self.grid([1, 1], |i, j| (at([a, b][i as usize], [low, high][j as usize]), normal));
        }
        for (z, direction) in [(low, Vec3::NEG_Z), (high, Vec3::Z)] {
            let ring: Vec<Vec3> = polygon.iter().map(|&point| at(point, z)).collect();
            self.cap(&ring, place.transform_vector3(direction));
        }
    }

    /// A soft block such as a cushion, `n` points around (a multiple of 4) and `bands` upwards:
    /// `2 n bands + 2 (n - 2)` triangles.
    pub fn pillow(&mut self, place: &Affine3A, half: Vec3, n: u32, bands: u32) {
        let at = |i: u32, j: u32| {
            let rise = std::f32::consts::PI * ((j as f32 + 0.35) / (bands as f32 + 0.7) - 0.5);
            let turn = std::f32::consts::TAU * (i % n) as f32 / n as f32;
            let unit = Vec3::new(turn.cos() * rise.cos(), turn.sin() * rise.cos(), rise.sin());
            // A superellipsoid: the squarer, the smaller the exponent.
            let square = unit.abs().powf(0.5) * unit.signum();
            let normal = unit.abs().powf(1.5) * unit.signum() / half;
            (place.transform_point3(square * half), place.transform_vector3(normal))
        };
        self.grid([n, bands], at);
        for j in [0, bands] {
            let ring: Vec<Vec3> = (0..n).map(|i| at(i, j).0).collect();
            self.soft_cap(&ring, |i| at(i as u32, j).1);
        }
    }

    /// Turns the triangles from `first` on such that they face where their normals point.
    fn face_outwards(&mut self, first: usize) {
        let Some(&[a, b, c]) = self.triangles.get(first) else { return };
        let [p, q, r] = [a, b, c].map(|corner| Vec3::from(self.positions[corner as usize]).as_dvec3());
        let normal: Vec3 = [a, b, c].map(|corner| Vec3::from(self.normals[corner as usize])).iter().sum();
        if (q - p).cross(r - p).dot(normal.as_dvec3()) < 0.0 {
            for triangle in &mut self.triangles[first..] {
                triangle.reverse();
            }
        }
    }

    /// Brings the mesh to exactly `target` triangles, two at a time by a vertex in the middle of a quad, and an odd one
    /// at the open boundary.
    ///
    /// There must be no more triangles than that, and an odd number lacks only where the boundary is open.
    pub fn finished(mut self, target: u32) -> SourceMesh {
        assert!(self.count() <= target, "{} triangles where {target} were asked for", self.count());
        if (target - self.count()) % 2 == 1 {
            self.split_free_edge();
        }
        self.centre_quads((target - self.count()) / 2);
        while self.count() < target {
            self.centre_triangles((target - self.count()) / 2);
        }
        let Self { positions, normals, triangles, .. } = self;
        SourceMesh { positions, normals, triangles, ..SourceMesh::default() }
    }

    /// One triangle more.
    fn split_free_edge(&mut self) {
        let number = self.free_edge.unwrap_or_default() as usize;
        let [a, b, c] = self.triangles[number];
        let middle = self.middle(&[a, b]);
        self.triangles[number] = [a, middle, c];
        self.triangles.push([middle, b, c]);
    }

    /// Two triangles more in each of so many quads, spread evenly, or in all.
    fn centre_quads(&mut self, wanted: u32) {
        let quads = std::mem::take(&mut self.quads);
        let count = quads.len().min(wanted as usize);
        for k in 0..count {
            let quad = quads[k * quads.len() / count] as usize;
            // The two triangles share two corners; of the four, those alone are opposite each other.
            let [first, second] = [self.triangles[quad], self.triangles[quad + 1]];
            let Some(at) = (0..3).find(|&at| !second.contains(&first[at])) else { continue };
            let [b, c, a] = [first[at], first[(at + 1) % 3], first[(at + 2) % 3]];
            let Some(&d) = second.iter().find(|corner| !first.contains(corner)) else { continue };
            let m = self.middle(&[a, c]);
            self.triangles[quad] = [a, b, m];
            self.triangles[quad + 1] = [b, c, m];
            self.triangles.extend([[c, d, m], [d, a, m]]);
        }
    }

    /// Two triangles more in each of so many triangles, spread evenly, or in all.
    fn centre_triangles(&mut self, wanted: u32) {
        let all = self.triangles.len();
        let count = all.min(wanted as usize);
        for k in 0..count {
            let number = k * all / count;
            let [a, b, c] = self.triangles[number];
            let m = self.middle(&[a, b, c]);
            self.triangles[number] = [a, b, m];
            self.triangles.extend([[b, c, m], [c, a, m]]);
        }
    }

    fn middle(&mut self, corners: &[u32]) -> u32 {
        let mean = |list: &[[f32; 3]]| {
            let sum: Vec3 = corners.iter().map(|&corner| Vec3::from(list[corner as usize])).sum();
            sum / corners.len() as f32
        };
        let (position, normal) = (mean(&self.positions), mean(&self.normals));
        self.vertex((position, normal))
    }
}

/// How the bands of a body of revolution meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Finish {
    /// Each band is a patch with normals of its own.
    Creased,
    /// The side is one smooth patch, the caps are flat.
    Smooth,
    /// The caps belong to the smooth side.
    Soft,
    /// The upper cap belongs to the smooth side.
    Dome,
}

/// The greatest level from 0 to `most` whose count is at most the target; the count must not fall with the level.
pub fn greatest(most: u32, target: u32, count: impl Fn(u32) -> u32) -> u32 {
    let (mut low, mut high) = (0, most);
    while low < high {
        let middle = (low + high).div_ceil(2);
        if count(middle) <= target { low = middle } else { high = middle - 1 }
    }
    low
}

/// A point of a ring of `n` points around the local z axis.
pub fn on_ring(place: &Affine3A, [radius, height]: [f32; 2], i: u32, n: u32) -> Vec3 {
    let (sin, cos) = (std::f32::consts::TAU * i as f32 / n as f32).sin_cos();
    place.transform_point3(Vec3::new(radius * cos, radius * sin, height))
}

fn around([radial, axial]: [f32; 2], i: u32, n: u32) -> Vec3 {
    let (sin, cos) = (std::f32::consts::TAU * i as f32 / n as f32).sin_cos();
    Vec3::new(radial * cos, radial * sin, axial)
}

/// The (radial, axial) normal at a point of a profile: the mean of the bands that meet there, and of a cap that belongs to
/// them.
fn profile_normal(points: &[[f32; 2]], k: usize, finish: Finish) -> [f32; 2] {
    let band = |a: [f32; 2], b: [f32; 2]| {
        let (dr, dz) = (b[0] - a[0], b[1] - a[1]);
        let length = dr.hypot(dz).max(1e-20);
        [dz / length, -dr / length]
    };
    let below = match k.checked_sub(1) {
        Some(before) => Some(band(points[before], points[k])),
        None => (finish == Finish::Soft).then_some([0.0, -1.0]),
    };
    let above = match points.get(k + 1) {
        Some(&after) => Some(band(points[k], after)),
        None => matches!(finish, Finish::Soft | Finish::Dome).then_some([0.0, 1.0]),
    };
    match (below, above) {
        (Some(b), Some(a)) => [a[0] + b[0], a[1] + b[1]],
        (Some(one), None) | (None, Some(one)) => one,
        (None, None) => [1.0, 0.0],
    }
}
