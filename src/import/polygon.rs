//! A polygon in, the triangles that cover it out.
//!
//! Triangles stay, convex quads are cut along the shorter diagonal, all other polygons by ear clipping in the
//! plane of their Newell normal. Every vertex of the polygon is a corner of some triangle, also one in the
//! middle of a straight edge: the neighbouring polygon has it too, and leaving it out would make a
//! T-junction.

use earcut::Earcut;
use glam::DVec3;
use rustc_hash::FxHashMap;

/// Polygons with more corners are cut as a fan: ear clipping may take quadratic time.
const MAX_EARCUT: usize = 1 << 16;

/// Cuts polygons; kept from one to the next for its memory.
#[derive(Default)]
pub struct Triangulator {
    /// The triangles of the last polygon, as numbers of its corners.
    pub triangles: Vec<[u32; 3]>,
    earcut: Earcut<f64>,
    points: Vec<DVec3>,
    flat: Vec<[f64; 2]>,
    indices: Vec<u32>,
}

impl Triangulator {
    /// Fills `triangles` for a polygon of finite positions, keeping its orientation; nothing for fewer than 3
    /// corners.
    pub fn triangulate(&mut self, polygon: &[[f32; 3]]) {
        self.triangles.clear();
        if polygon.len() == 3 {
            return self.triangles.push([0, 1, 2]);
        }
        // Relative to one corner, so that a small polygon far from the origin keeps its digits.
        let Some(origin) = polygon.first().map(|&first| wide(first)) else { return };
        self.points.clear();
        self.points.extend(polygon.iter().map(|&position| wide(position) - origin));
        let normal = newell_normal(&self.points);
        if let Some(triangles) = convex_quad(&self.points, normal) {
            return self.triangles.extend(triangles);
        }
        if normal != DVec3::ZERO && polygon.len() <= MAX_EARCUT {
            self.clip_ears(normal);
            self.keep_every_corner();
        }
        if self.triangles.is_empty() {
            self.triangles.extend((2..polygon.len() as u32).map(|corner| [0, corner - 1, corner]));
        }
    }

    fn clip_ears(&mut self, normal: DVec3) {
        let (right, up) = normal.any_orthonormal_pair();
        self.flat.clear();
        self.flat.extend(self.points.iter().map(|point| [point.dot(right), point.dot(up)]));
        self.earcut.earcut_slice(&self.flat, &[], &mut self.indices);
        // Seen along its own normal a polygon turns to the left, and so must its triangles.
        let flat = &self.flat;
        self.triangles.extend(self.indices.as_chunks().0.iter().map(|&[a, b, c]| {
            let [a, b, c] = if turn(flat, [a, b, c]) < 0.0 { [a, c, b] } else { [a, b, c] };
            [a, b, c]
        }));
    }

    /// Puts corners back that ear clipping left out because they lie on a straight edge: the triangle at that
    /// edge becomes a fan over all corners on it.
    fn keep_every_corner(&mut self) {
        let corners = self.points.len() as u32;
        if self.triangles.is_empty() || self.triangles.len() + 2 >= self.points.len() {
            return;
        }
        let mut used = vec![false; self.points.len()];
        self.triangles.iter().flatten().for_each(|&corner| used[corner as usize] = true);
        let mut edges = self.triangles_by_edge();
        for from in (0..corners).filter(|&corner| used[corner as usize]) {
            // The search ends: `from` itself is used.
            let steps = (1..).find(|step| used[((from + step) % corners) as usize]).unwrap_or(1);
            if steps > 1 {
                self.split_edge(from, steps, corners, &mut edges);
            }
        }
    }

    /// The triangle of each directed edge.
    fn triangles_by_edge(&self) -> FxHashMap<(u32, u32), usize> {
        let edges =
            |(place, &[a, b, c]): (usize, &[u32; 3])| [((a, b), place), ((b, c), place), ((c, a), place)];
        self.triangles.iter().enumerate().flat_map(edges).collect()
    }

    /// Cuts the triangle that has the edge from corner `from` to the one `steps` further.
    fn split_edge(&mut self, from: u32, steps: u32, corners: u32, edges: &mut FxHashMap<(u32, u32), usize>) {
        let to = (from + steps) % corners;
        let Some(&place) = edges.get(&(from, to)) else { return };
        let Some(apex) = self.triangles[place].into_iter().find(|&corner| corner != from && corner != to)
        else {
            return;
        };
        let mut parts = (0..steps).map(|step| [(from + step) % corners, (from + step + 1) % corners, apex]);
        self.triangles[place] = parts.next().unwrap_or(self.triangles[place]);
        self.triangles.extend(parts);
        edges.insert((to, apex), self.triangles.len() - 1);
    }
}

fn wide(position: [f32; 3]) -> DVec3 {
    DVec3::from_array(position.map(f64::from))
}

/// The sum of the cross products of neighbouring corners, at length 1; zero if the polygon has no area.
fn newell_normal(points: &[DVec3]) -> DVec3 {
    let next = points.iter().cycle().skip(1);
    points.iter().zip(next).map(|(a, b)| a.cross(*b)).sum::<DVec3>().normalize_or_zero()
}

/// The two halves of a strictly convex quad, cut along the shorter diagonal (along 0-2 if they are equal).
fn convex_quad(points: &[DVec3], normal: DVec3) -> Option<[[u32; 3]; 2]> {
    let &[a, b, c, d] = points else { return None };
    let turns_left = |p: DVec3, q: DVec3, r: DVec3| (q - p).cross(r - q).dot(normal) > 0.0;
    let convex = turns_left(a, b, c) && turns_left(b, c, d) && turns_left(c, d, a) && turns_left(d, a, b);
    let cut_02 = a.distance_squared(c) <= b.distance_squared(d);
    convex.then_some(if cut_02 { [[0, 1, 2], [0, 2, 3]] } else { [[0, 1, 3], [1, 2, 3]] })
}

/// Twice the signed area of a triangle in the plane.
fn turn(flat: &[[f64; 2]], triangle: [u32; 3]) -> f64 {
    let [a, b, c] = triangle.map(|corner| flat[corner as usize]);
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(polygon: &[[f32; 3]]) -> Vec<[u32; 3]> {
        let mut triangulator = Triangulator::default();
        triangulator.triangulate(polygon);
        triangulator.triangles
    }

    /// The sum of signed areas and of absolute areas, along the polygon's normal.
    fn areas(polygon: &[[f32; 3]], triangles: &[[u32; 3]]) -> (f64, f64) {
        let points: Vec<DVec3> = polygon.iter().map(|&p| wide(p)).collect();
        let normal = newell_normal(&points);
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|corner| points[corner as usize]);
            (b - a).cross(c - a).dot(normal) / 2.0
        };
        (triangles.iter().map(area).sum(), triangles.iter().map(|t| area(t).abs()).sum())
    }

    #[track_caller]
    fn assert_covers(polygon: &[[f32; 3]], area: f64) {
        let triangles = cut(polygon);
        assert_eq!(triangles.len(), polygon.len() - 2, "{triangles:?}");
        let (signed, absolute) = areas(polygon, &triangles);
        assert!((signed - area).abs() < 1e-6 && (absolute - area).abs() < 1e-6, "{signed} {absolute}");
        for corner in 0..polygon.len() as u32 {
            assert!(
                triangles.iter().flatten().any(|&c| c == corner),
                "corner {corner} is left out: {triangles:?}"
            );
        }
    }

    #[test]
    fn concave_polygon_keeps_its_area() {
        let dart = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.5, 0.2, 0.0], [0.0, 1.0, 0.0]];
        assert_covers(&dart, 0.6);
        let mut turned = dart.map(|[x, y, z]| [z + 7.0, y, x]);
        assert_covers(&turned, 0.6);
        turned.reverse();
        assert_covers(&turned, 0.6);
    }

    #[test]
    fn concave_quad_is_cut_inside() {
        assert_covers(&[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.0, 2.0, 0.0]], 1.0);
        assert_covers(&[[0.5, 0.5, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 0.0], [2.0, 0.0, 0.0]], 1.0);
    }

    #[test]
    fn convex_quad_takes_the_shorter_diagonal() {
        let kite = [[0.0, 0.0, 0.0], [2.0, -0.5, 0.0], [4.0, 0.0, 0.0], [2.0, 0.5, 0.0]];
        assert_eq!(cut(&kite), [[0, 1, 3], [1, 2, 3]]);
        let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(cut(&square), [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn corners_on_straight_edges_are_kept() {
        let mut ring = Vec::new();
        for step in 0..8 {
            ring.push([step as f32 / 4.0, 0.0, 1.0]);
        }
        ring.extend([[2.0, 0.0, 1.0], [2.0, 1.0, 1.0], [1.0, 1.0, 1.0], [0.0, 1.0, 1.0], [0.0, 0.5, 1.0]]);
        for _ in 0..ring.len() {
            ring.rotate_left(1);
            assert_covers(&ring, 2.0);
        }
    }

    #[test]
    fn polygons_without_area_become_fans() {
        let line: Vec<[f32; 3]> = (0..5).map(|step| [step as f32, 0.0, 0.0]).collect();
        assert_eq!(cut(&line).len(), 3);
        assert_eq!(cut(&[[1.0; 3]; 4]).len(), 2);
        assert!(cut(&[]).is_empty() && cut(&[[1.0; 3]; 2]).is_empty());
    }

    #[test]
    fn huge_and_tiny_polygons_keep_their_orientation() {
        for scale in [1e-12_f32, 1e12, 1e30] {
            let dart = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.5, 0.2], [0.0, 1.0]];
            let polygon = dart.map(|[x, y]: [f32; 2]| [x * scale, y * scale, 0.0]);
            let (signed, absolute) = areas(&polygon, &cut(&polygon));
            assert!(signed > 0.0 && (signed / absolute - 1.0).abs() < 1e-6);
        }
    }
}
