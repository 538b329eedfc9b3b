//! The triangles of an instance in, what is under the cursor out: a vertex, an edge or a face of it, snapped in pixels.
//!
//! The GPU says which instance is under the cursor; here are the triangles of that one, reformed at the state that is
//! drawn or read at full detail, with positions in f64. Vertices that share a position are one point, so that edges can
//! be followed across creases.

use std::ops::Range;

use glam::{DAffine3, DVec2, DVec3};
use rustc_hash::FxHashMap;

use crate::container::ContainerError;
use crate::geometry::record::Grid;
use crate::geometry::{TriangleRecord, VertexRecord};
use crate::scene::Camera;
use crate::scene::opened::Scene;
use crate::scene::part::ResidentPart;
use crate::viewer::navigation::motions::{Picture, Ray, pixel_of, ray_through, view_from_world};

/// A part's surface in world space.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Surface {
    points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    /// Creases and open boundaries, the smaller point first; sorted, none twice.
    edges: Vec<[u32; 2]>,
}

/// On what the cursor snapped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SnapKind {
    /// A vertex, the end of an edge.
    Vertex,
    /// An edge, as two points of the surface.
    Edge([u32; 2]),
    /// The inside of a face.
    Face,
}

/// What is under the cursor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Snap {
    /// Which feature it is.
    pub kind: SnapKind,
    /// The point of it, in world space.
    pub point: DVec3,
    /// The unit normal of the triangle under the cursor, towards the eye; `None` where the cursor is beside the surface.
    pub normal: Option<DVec3>,
    /// How far from the cursor the point is seen.
    pub pixels: f64,
}

/// An edge followed over its corners as far as it goes on.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    /// Its length, in the model's unit.
    pub length: f64,
    /// Whether it comes back to where it starts.
    pub is_closed: bool,
    /// Its points, in world space, in order.
    pub points: Vec<DVec3>,
}

/// A triangle is met as far as this share of its size beside it.
const SLACK: f64 = 1e-6;
/// How many candidates are tried for being hidden by the surface itself.
const MOST_CANDIDATES: usize = 8;
/// An edge ends where the next piece turns by more than this: the corner of a plate, not a step of a round edge.
const CORNER_DEGREES: f64 = 40.0;

impl Surface {
    /// The triangles of a state: of the first `vertices.len()` vertices of a part, from a tier's triangles, the first that
    /// the state has. Corners that do not resolve, as in damaged data, leave their triangle out.
    pub fn reformed<'a>(
        grid: Grid,
        world_from_part: &DAffine3,
        vertices: &[VertexRecord],
        ecol: &[u16],
        triangles: impl IntoIterator<Item = &'a TriangleRecord>,
    ) -> Self {
        let mut surface = Self::default();
        let mut known = FxHashMap::default();
        let point_of: Vec<u32> = vertices
            .iter()
            .map(|vertex| {
                *known.entry(vertex.packed_position()).or_insert_with(|| {
                    let position = DVec3::from_array(grid.position(vertex.grid()));
                    surface.points.push(world_from_part.transform_point3(position));
                    surface.points.len() as u32 - 1
                })
            })
            .collect();
        for triangle in triangles {
            let resolved = triangle.vertices.map(|corner| resolve(corner, vertices.len(), ecol));
            let [Some(a), Some(b), Some(c)] = resolved else { continue };
            surface.add([a, b, c].map(|vertex| point_of[vertex]), triangle.flags);
        }
        surface.edges.sort_unstable();
        surface.edges.dedup();
        surface
    }

    /// The state of `vn` vertices of an instance, as far as it has arrived; `None` where it has not.
    pub fn of_resident(scene: &Scene, instance: u32, part: &ResidentPart, vn: u32) -> Option<Self> {
        let row = scene.instances().get(instance as usize)?;
        let tiers = scene.tiers(row.part);
        let tier = (0..tiers.len()).rev().find(|&tier| tiers[tier].vertices >= vn && vn > 0)?;
        if part.finest()? > tier as u32 {
            return None;
        }
        let all = |range: Range<u32>| part.vertices(range).flatten().copied().collect::<Vec<_>>();
        let ecol: Vec<u16> = part.ecol(0..tiers[tier].vertices).flatten().copied().collect();
        let count = part.triangles_at().count_at(vn as usize) as usize;
        let triangles = part.triangles(tier as u32);
        let grid = scene.parts()[row.part as usize].grid();
        let drawn = &triangles[..count.min(triangles.len())];
        Some(Self::reformed(grid, &row.transform(), &all(0..vn), &ecol, drawn))
    }

    /// An instance at full detail, read from the file: waits for the disk, so not for the window's thread.
    ///
    /// # Errors
    /// A chunk of it is damaged, or cannot be read.
    pub fn full_detail(scene: &Scene, instance: u32) -> Result<Self, ContainerError> {
        let Some(row) = scene.instances().get(instance as usize) else { return Ok(Self::default()) };
        let part = scene.read_part(row.part)?;
        let vertices = scene.parts()[row.part as usize].vertices;
        Ok(Self::of_resident(scene, instance, &part, vertices).unwrap_or_default())
    }

    fn add(&mut self, corners: [u32; 3], flags: u16) {
        let [a, b, c] = corners;
        if a == b || b == c || c == a {
            return;
        }
        self.triangles.push(corners);
        let feature = TriangleRecord::CREASE | TriangleRecord::BOUNDARY;
        for edge in 0..3 {
            if flags & feature << edge != 0 {
                let (from, to) = (corners[edge], corners[(edge + 1) % 3]);
                self.edges.push([from.min(to), from.max(to)]);
            }
        }
    }

    /// The points, in world space.
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// Three points each.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Creases and open boundaries.
    pub fn edges(&self) -> &[[u32; 2]] {
        &self.edges
    }

    /// The nearest triangle that a line of sight meets, and how far along it.
    pub fn cast(&self, ray: &Ray) -> Option<(usize, f64)> {
        let hits = self.triangles.iter().enumerate();
        hits.filter_map(|(index, triangle)| {
            let corners = triangle.map(|point| self.points[point as usize] - ray.start);
            Some((index, meets(corners, ray.direction)?))
        })
        .min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// What is under the cursor, or within so many pixels of it: a vertex before an edge before a face, of what is not
    /// hidden behind the surface itself.
    pub fn snap(&self, camera: &Camera, picture: Picture, pixel: DVec2, radius_px: f64) -> Option<Snap> {
        let ray = ray_through(camera, picture, pixel);
        let hit = self.cast(&ray);
        let normal = hit.and_then(|(triangle, _)| self.normal(triangle, ray.direction));
        let view = View { surface: self, camera, picture };
        let found = |(kind, point, pixels): (SnapKind, DVec3, f64)| Snap { kind, point, normal, pixels };
        view.vertex(pixel, radius_px)
            .or_else(|| view.edge(pixel, radius_px))
            .or_else(|| hit.map(|(_, along)| (SnapKind::Face, ray.start + ray.direction * along, 0.0)))
            .map(found)
    }

    fn normal(&self, triangle: usize, seen_along: DVec3) -> Option<DVec3> {
        let [a, b, c] = self.triangles[triangle].map(|point| self.points[point as usize]);
        let normal = (b - a).cross(c - a).try_normalize()?;
        Some(if normal.dot(seen_along) > 0.0 { -normal } else { normal })
    }

    /// Follows an edge to both sides, over corners where exactly two edges meet without a sharp turn.
    pub fn chain(&self, edge: [u32; 2]) -> Chain {
        let mut next: FxHashMap<u32, Vec<u32>> = FxHashMap::default();
        for &[a, b] in &self.edges {
            next.entry(a).or_default().push(b);
            next.entry(b).or_default().push(a);
        }
        let ahead = self.follow(&next, edge);
        let is_closed = ahead.len() > 2 && ahead.first() == ahead.last();
        let mut whole: Vec<u32> = match is_closed {
            true => Vec::new(),
            false => self.follow(&next, [edge[1], edge[0]]).into_iter().skip(2).rev().collect(),
        };
        whole.extend(ahead);
        let points: Vec<DVec3> = whole.iter().map(|&point| self.points[point as usize]).collect();
        let length = points.windows(2).map(|pair| (pair[1] - pair[0]).length()).sum();
        Chain { length, is_closed, points }
    }

    /// The points from the first of an edge over the second, to where it ends or comes back.
    fn follow(&self, next: &FxHashMap<u32, Vec<u32>>, [from, to]: [u32; 2]) -> Vec<u32> {
        let mut points = vec![from, to];
        // No chain is longer than all edges together.
        while points.len() <= self.edges.len() {
            let (before, at) = (points[points.len() - 2], points[points.len() - 1]);
            let Some(&on) =
                next.get(&at).filter(|on| on.len() == 2).and_then(|on| on.iter().find(|&&p| p != before))
            else {
                break;
            };
            let [a, b, c] = [before, at, on].map(|point| self.points[point as usize]);
            if (b - a).angle_between(c - b).to_degrees() > CORNER_DEGREES {
                break;
            }
            points.push(on);
            if on == from {
                break;
            }
        }
        points
    }
}

/// The vertex below `count` onto which a corner has collapsed.
fn resolve(corner: u16, count: usize, ecol: &[u16]) -> Option<usize> {
    let mut vertex = usize::from(corner);
    while vertex >= count {
        let onto = usize::from(*ecol.get(vertex)?);
        if onto >= vertex {
            return None;
        }
        vertex = onto;
    }
    Some(vertex)
}

/// How far along a line from the origin a triangle is met, from either side (Möller & Trumbore 1997).
fn meets([a, b, c]: [DVec3; 3], direction: DVec3) -> Option<f64> {
    let (u_edge, v_edge) = (b - a, c - a);
    let p = direction.cross(v_edge);
    let determinant = u_edge.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let u = -a.dot(p) / determinant;
    let q = (-a).cross(u_edge);
    let v = direction.dot(q) / determinant;
    let along = v_edge.dot(q) / determinant;
    // Some slack, so that no line slips through between two triangles, even of a millimetre 10,000 km from the origin.
    let inside = u >= -SLACK && v >= -SLACK && u + v <= 1.0 + SLACK;
    (inside && along > 0.0 && along.is_finite()).then_some(along)
}

/// A surface as it is seen.
struct View<'a> {
    surface: &'a Surface,
    camera: &'a Camera,
    picture: Picture,
}

type Candidate = (SnapKind, DVec3, f64);

impl View<'_> {
    fn vertex(&self, pixel: DVec2, radius_px: f64) -> Option<Candidate> {
        let points = &self.surface.points;
        let mut ends: Vec<u32> = self.surface.edges.iter().flatten().copied().collect();
        ends.sort_unstable();
        ends.dedup();
        if ends.is_empty() {
            // A surface without features is smooth all over: then every vertex is as good as any.
            ends = (0..points.len() as u32).collect();
        }
        let near = ends.into_iter().filter_map(|end| {
            let point = points[end as usize];
            let pixels = (pixel_of(self.camera, self.picture, point)? - pixel).length();
            (pixels <= radius_px).then_some((SnapKind::Vertex, point, pixels))
        });
        self.nearest_visible(near.collect())
    }

    fn edge(&self, pixel: DVec2, radius_px: f64) -> Option<Candidate> {
        let near = self.surface.edges.iter().filter_map(|&edge| {
            let (point, pixels) = self.nearest_on(edge, pixel)?;
            (pixels <= radius_px).then_some((SnapKind::Edge(edge), point, pixels))
        });
        self.nearest_visible(near.collect())
    }

    /// The point of an edge that is seen nearest to a pixel, and how near.
    fn nearest_on(&self, edge: [u32; 2], pixel: DVec2) -> Option<(DVec3, f64)> {
        let [a, b] = edge.map(|point| self.surface.points[point as usize]);
        let (from, to) = (pixel_of(self.camera, self.picture, a)?, pixel_of(self.camera, self.picture, b)?);
        let along = to - from;
        let length_squared = along.length_squared();
        let t = if length_squared > 0.0 { (pixel - from).dot(along) / length_squared } else { 0.0 };
        let t = t.clamp(0.0, 1.0);
        let depth = |point: DVec3| match self.camera.parallel {
            Some(_) => 1.0,
            None => -view_from_world(self.camera, point).z,
        };
        // What is halfway in the picture is nearer to the end that is nearer to the eye.
        let (near, far) = (t * depth(a), (1.0 - t) * depth(b));
        let point = a + (b - a) * (near / (near + far));
        Some((point, (from + along * t - pixel).length()))
    }

    fn nearest_visible(&self, mut candidates: Vec<Candidate>) -> Option<Candidate> {
        candidates.sort_by(|a, b| a.2.total_cmp(&b.2));
        candidates.into_iter().take(MOST_CANDIDATES).find(|candidate| self.is_visible(candidate.1))
    }

    /// Whether the surface does not hide its own point, but for what lies about two pixels before it.
    fn is_visible(&self, point: DVec3) -> bool {
        let Some(pixel) = pixel_of(self.camera, self.picture, point) else { return false };
        let ray = ray_through(self.camera, self.picture, pixel);
        let distance = (point - ray.start).dot(ray.direction);
        let slack = 2.0 * self.camera.pixel_size(self.picture.height as u32, point);
        distance > 0.0 && self.surface.cast(&ray).is_none_or(|(_, along)| along >= distance - slack)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::bounds::Bounds;
    use crate::scene::camera::Parallel;
    use crate::scene::views::{self, Projection, StandardView, UpAxis};

    const PICTURE: Picture = Picture { width: 800.0, height: 600.0 };
    const FAR: DVec3 = DVec3::new(1e7, 1e7, -1e7);
    const GRID: Grid = Grid { origin: [0.0; 3], step_exponent: -3 };

    /// A cube of 8 grid steps with all its edges as creases, at `FAR`, one unit large; every face has its own vertices.
    fn cube() -> Surface {
        let mut vertices = Vec::new();
        let mut triangles = Vec::new();
        for axis in 0..3 {
            for side in [0, 8] {
                let first = vertices.len() as u16;
                for (u, v) in [(0, 0), (8, 0), (8, 8), (0, 8)] {
                    let mut grid = [side; 3];
                    (grid[(axis + 1) % 3], grid[(axis + 2) % 3]) = (u, v);
                    vertices.push(VertexRecord::new(grid, 0));
                }
                // Edge 2 of the first triangle and edge 0 of the second are the diagonal.
                let crease = TriangleRecord::CREASE;
                let [a, b, c, d] = [0, 1, 2, 3].map(|corner| first + corner);
                triangles.push(TriangleRecord { vertices: [a, b, c], flags: crease | crease << 1 });
                triangles.push(TriangleRecord { vertices: [a, c, d], flags: crease << 1 | crease << 2 });
            }
        }
        Surface::reformed(GRID, &DAffine3::from_translation(FAR), &vertices, &[], &triangles)
    }

    fn camera(is_parallel: bool) -> Camera {
        let bounds = Bounds::new(FAR, FAR + DVec3::ONE);
        let projection = if is_parallel { Projection::Parallel } else { Projection::default() };
        views::fit(&bounds, &bounds, StandardView::Iso.orientation(UpAxis::Y), projection, PICTURE.aspect())
    }

    fn at(camera: &Camera, corner: [f64; 3]) -> DVec2 {
        pixel_of(camera, PICTURE, FAR + DVec3::from_array(corner)).unwrap()
    }

    #[test]
    fn the_wedges_of_a_corner_are_one_point() {
        let cube = cube();
        assert_eq!((cube.points().len(), cube.triangles().len(), cube.edges().len()), (8, 12, 12));
    }

    #[test]
    fn corners_edges_and_faces_are_snapped_in_that_order() {
        for is_parallel in [false, true] {
            let (cube, camera) = (cube(), camera(is_parallel));
            let snap = |pixel| cube.snap(&camera, PICTURE, pixel, 8.0);
            let near = snap(at(&camera, [1.0, 1.0, 1.0]) + DVec2::new(3.0, 4.0)).unwrap();
            assert_eq!(near.kind, SnapKind::Vertex);
            assert!((near.point - FAR - DVec3::ONE).length() < 1e-8 && (near.pixels - 5.0).abs() < 1e-3);
            let edge = snap(at(&camera, [1.0, 0.3, 1.0]) + DVec2::new(5.0, 0.0)).unwrap();
            assert!(matches!(edge.kind, SnapKind::Edge(_)), "{edge:?}");
            assert!((edge.point - FAR - DVec3::new(1.0, 0.3, 1.0)).length() < 1e-3, "{}", edge.point - FAR);
            assert!((edge.pixels - 5.0).abs() < 0.1);
            let face = snap(at(&camera, [0.5, 1.0, 0.4])).unwrap();
            assert_eq!((face.kind, face.normal), (SnapKind::Face, Some(DVec3::Y)));
            assert!((face.point - FAR - DVec3::new(0.5, 1.0, 0.4)).length() < 1e-7);
            assert_eq!(snap(DVec2::new(1.0, 1.0)), None, "beside it");
        }
    }

    #[test]
    fn what_the_part_hides_itself_is_not_snapped() {
        let cube = cube();
        let camera = Camera {
            parallel: Some(Parallel { height: 3.0, reach: 10.0 }),
            ..Camera::look_at(FAR + DVec3::new(4.0, 2.9, 5.3), FAR + DVec3::splat(0.5), DVec3::Y, 1.0, 0.1)
        };
        // The corner at the back is behind the front faces.
        let seen = cube.snap(&camera, PICTURE, at(&camera, [0.0, 0.0, 0.0]), 8.0).unwrap();
        assert_eq!(seen.kind, SnapKind::Face);
        assert!((seen.point - FAR).length() > 0.3);
    }

    #[test]
    fn the_edge_of_a_cube_ends_at_its_corners() {
        let cube = cube();
        let chain = cube.chain(cube.edges()[0]);
        assert_eq!((chain.is_closed, chain.points.len()), (false, 2));
        assert!((chain.length - 1.0).abs() < 1e-8);
    }

    /// A flat disc of 32 corners, its rim open.
    fn disc() -> Surface {
        let corner = |i: u32| {
            let angle = f64::from(i) * std::f64::consts::TAU / 32.0;
            [angle.cos(), angle.sin()].map(|c| (500.0 + 400.0 * c).round() as u32)
        };
        let mut vertices = vec![VertexRecord::new([500, 500, 0], 0)];
        vertices.extend((0..32).map(|i| VertexRecord::new([corner(i)[0], corner(i)[1], 0], 0)));
        let rim = TriangleRecord::BOUNDARY << 1;
        let triangles: Vec<TriangleRecord> =
            (0..32).map(|i| TriangleRecord { vertices: [0, 1 + i, 1 + (i + 1) % 32], flags: rim }).collect();
        let grid = Grid { origin: [0.0; 3], step_exponent: 0 };
        Surface::reformed(grid, &DAffine3::IDENTITY, &vertices, &[], &triangles)
    }

    #[test]
    fn a_round_edge_is_followed_all_round() {
        let disc = disc();
        for &edge in disc.edges() {
            let chain = disc.chain(edge);
            assert!(chain.is_closed && chain.points.len() == 33);
            assert!((chain.length / (std::f64::consts::TAU * 400.0) - 1.0).abs() < 0.003, "{}", chain.length);
        }
    }

    #[test]
    fn half_an_arc_is_followed_to_both_ends() {
        let mut disc = disc();
        disc.edges.retain(|edge| edge[1] <= 17);
        for &edge in &disc.edges.clone() {
            let chain = disc.chain(edge);
            assert_eq!((chain.is_closed, chain.points.len()), (false, disc.edges.len() + 1), "{edge:?}");
        }
    }

    #[test]
    fn a_coarser_state_and_damaged_data_make_a_surface_too() {
        let vertices = [[0, 0, 0], [8, 0, 0], [0, 8, 0]].map(|grid| VertexRecord::new(grid, 0));
        let triangle = |vertices| TriangleRecord { vertices, flags: TriangleRecord::CREASE };
        // 3 collapses onto 1, 4 onto 3; 5 onto itself, 6 is not there.
        let ecol = [0, 1, 2, 1, 3, 5];
        let all = [[0, 4, 2], [0, 1, 3], [0, 5, 2], [0, 6, 2]].map(triangle);
        let surface = Surface::reformed(GRID, &DAffine3::IDENTITY, &vertices, &ecol, &all);
        assert_eq!(surface.triangles(), [[0, 1, 2]]);
        assert_eq!(surface.edges(), [[0, 1]]);
        let nothing = Surface::default();
        assert_eq!(nothing.snap(&camera(false), PICTURE, DVec2::ZERO, 8.0), None);
    }
}
