//! A source mesh in, a [`WeldedMesh`] out: topology on positions, attributes on wedges.
//!
//! CAD tessellation arrives as one patch per face, so the same position appears several times with different normals.
//! Positions that fall on one grid point are one position; each distinct (position, normal, colour) is one wedge,
//! which later is one vertex. Degenerate and repeated triangles are dropped and counted; a triangle on the back of
//! another counts as repeated, because both sides of a surface are drawn, and because such sheets of two layers would
//! be non-manifold at every edge, so that nothing of them could collapse. Positions and wedges leave
//! in Morton order and triangles in the order of their least position, because everything after this walks the mesh
//! along its surface.

use super::quantize::{encode_coloured, encode_normal, encode_slotted};
use super::record::{Attributes, Grid, VertexRecord};
use crate::import::SourceMesh;

/// Wedges of one position whose normals differ by less than half a degree are one wedge: exporters compute the
/// normals of neighbouring patches one by one, and the difference is their rounding, not a crease.
const SAME_NORMAL_COS: f32 = 0.999_962;

/// A mesh whose positions are unique and whose attributes are on wedges.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct WeldedMesh {
    /// Grid coordinates of every position, in Morton order.
    pub positions: Vec<[u32; 3]>,
    /// One record per wedge, grouped by position.
    pub wedges: Vec<VertexRecord>,
    /// The position of every wedge; non-decreasing.
    pub wedge_position: Vec<u32>,
    /// Three wedges a triangle; no two corners share a position.
    pub triangles: Vec<[u32; 3]>,
    /// What wedges carry beside their position.
    pub attributes: Attributes,
    /// Triangles dropped because two corners share a position.
    pub degenerate: usize,
    /// Triangles dropped because an earlier one has the same corners, whichever way it faces.
    pub duplicate: usize,
}

impl WeldedMesh {
    /// The wedges of each position as ranges: position `p` has wedges `starts[p]..starts[p + 1]`.
    pub fn wedge_starts(&self) -> Vec<u32> {
        starts(&self.wedge_position, self.positions.len())
    }

    /// The positions of a triangle's corners.
    pub fn corner_positions(&self, triangle: [u32; 3]) -> [u32; 3] {
        triangle.map(|wedge| self.wedge_position[wedge as usize])
    }
}

/// Where each of `count` groups starts in a sorted list of group numbers; one entry more than groups.
pub(super) fn starts(sorted: &[u32], count: usize) -> Vec<u32> {
    let mut starts = vec![0u32; count + 1];
    for &group in sorted {
        starts[group as usize + 1] += 1;
    }
    for i in 0..count {
        starts[i + 1] += starts[i];
    }
    starts
}

/// The grid on which a mesh's used positions fit, or `None` if it has no triangles.
pub fn grid_of(mesh: &SourceMesh) -> Option<Grid> {
    grid_around([mesh])
}

/// The grid on which the used positions of several meshes fit, or `None` if these have no triangles.
pub fn grid_around<'a>(meshes: impl IntoIterator<Item = &'a SourceMesh>) -> Option<Grid> {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for mesh in meshes {
        for &vertex in mesh.triangles.iter().flatten() {
            let position = mesh.positions[vertex as usize].map(f64::from);
            for axis in 0..3 {
                low[axis] = low[axis].min(position[axis]);
                high[axis] = high[axis].max(position[axis]);
            }
        }
    }
    low[0].is_finite().then(|| Grid::around(low, high))
}

/// Interleaves the bits of three grid coordinates.
pub(super) fn morton(grid: [u32; 3]) -> u64 {
    let spread = |c: u32| {
        let mut x = u64::from(c) & 0x1f_ffff;
        x = (x | x << 32) & 0x001f_0000_0000_ffff;
        x = (x | x << 16) & 0x001f_0000_ff00_00ff;
        x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
        x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
        (x | x << 2) & 0x1249_2492_4924_9249
    };
    spread(grid[0]) | spread(grid[1]) << 1 | spread(grid[2]) << 2
}

/// Welds a mesh that has normals (see [`super::normals`]) on the given grid.
pub fn weld(mesh: &SourceMesh, grid: Grid) -> WeldedMesh {
    let attributes = attributes_of(mesh);
    weld_records(&records_of(mesh, grid, attributes), &mesh.triangles, attributes)
}

/// As [`weld`], but what of the mesh is not needed any more is given back before that.
pub(super) fn weld_whole(mut mesh: SourceMesh, grid: Grid) -> WeldedMesh {
    let attributes = attributes_of(&mesh);
    let records = records_of(&mesh, grid, attributes);
    let triangles = std::mem::take(&mut mesh.triangles);
    drop(mesh);
    weld_records(&records, &triangles, attributes)
}

fn attributes_of(mesh: &SourceMesh) -> Attributes {
    match (mesh.slots.is_empty(), mesh.colours.is_empty()) {
        (false, _) => Attributes::Slot,
        (true, false) => Attributes::Colour,
        (true, true) => Attributes::Normal,
    }
}

fn weld_records(records: &[VertexRecord], triangles: &[[u32; 3]], attributes: Attributes) -> WeldedMesh {
    let mut order: Vec<(u64, u32, u32)> = used_vertices(records.len(), triangles)
        .map(|vertex| {
            let record = records[vertex as usize];
            (morton(record.grid()), record.attributes(), vertex)
        })
        .collect();
    order.sort_unstable();

    let mut welded = WeldedMesh {
        attributes,
        positions: Vec::with_capacity(order.len()),
        wedges: Vec::with_capacity(order.len()),
        wedge_position: Vec::with_capacity(order.len()),
        ..WeldedMesh::default()
    };
    let mut wedge_of = vec![u32::MAX; records.len()];
    let mut last = None;
    for (code, _, vertex) in order {
        let record = records[vertex as usize];
        if last != Some(code) {
            last = Some(code);
            welded.positions.push(record.grid());
        }
        wedge_of[vertex as usize] = welded.wedge_for(record);
    }
    welded.add_triangles(triangles, &wedge_of);
    welded.drop_unused();
    welded
}

fn used_vertices(count: usize, triangles: &[[u32; 3]]) -> impl Iterator<Item = u32> + use<> {
    let mut used = vec![false; count];
    for &vertex in triangles.iter().flatten() {
        used[vertex as usize] = true;
    }
    used.into_iter().enumerate().filter(|&(_, used)| used).map(|(vertex, _)| vertex as u32)
}

fn records_of(mesh: &SourceMesh, grid: Grid, attributes: Attributes) -> Vec<VertexRecord> {
    let word = |vertex: usize| {
        let normal = mesh.normals.get(vertex).copied().unwrap_or([0.0, 0.0, 1.0]);
        match attributes {
            Attributes::Normal => encode_normal(normal),
            Attributes::Colour => encode_coloured(normal, mesh.colours[vertex]),
            Attributes::Slot => encode_slotted(normal, mesh.slots[vertex]),
        }
    };
    mesh.positions
        .iter()
        .enumerate()
        .map(|(vertex, p)| VertexRecord::new(grid.quantize(p.map(f64::from)), word(vertex)))
        .collect()
}

impl WeldedMesh {
    /// The wedge of the newest position that carries this record's attributes, made if there is none.
    fn wedge_for(&mut self, record: VertexRecord) -> u32 {
        let position = (self.positions.len() - 1) as u32;
        // A look at the nearest few is enough: attributes arrive sorted, and a hub may have thousands of wedges.
        let siblings = (0..self.wedges.len()).rev().take(16);
        let found = siblings
            .take_while(|&wedge| self.wedge_position[wedge] == position)
            .find(|&wedge| self.same_attributes(self.wedges[wedge], record));
        found.unwrap_or_else(|| {
            self.wedges.push(record);
            self.wedge_position.push(position);
            self.wedges.len() - 1
        }) as u32
    }

    fn same_attributes(&self, a: VertexRecord, b: VertexRecord) -> bool {
        if a.attributes() == b.attributes() {
            return true;
        }
        if self.attributes.tag(a.attributes()) != self.attributes.tag(b.attributes()) {
            return false;
        }
        let (n, k) = (a.normal(self.attributes), b.normal(self.attributes));
        n[0] * k[0] + n[1] * k[1] + n[2] * k[2] > SAME_NORMAL_COS
    }

    /// Welds again with positions moved onto others; `onto` has one entry a position.
    pub(super) fn move_positions(&mut self, onto: &[u32]) {
        let moved = |(record, &position): (&VertexRecord, &u32)| {
            VertexRecord::new(self.positions[onto[position as usize] as usize], record.attributes())
        };
        let records: Vec<VertexRecord> = self.wedges.iter().zip(&self.wedge_position).map(moved).collect();
        let again = weld_records(&records, &self.triangles, self.attributes);
        let (degenerate, duplicate) = (self.degenerate, self.duplicate);
        *self = Self {
            degenerate: again.degenerate + degenerate,
            duplicate: again.duplicate + duplicate,
            ..again
        };
    }

    fn add_triangles(&mut self, triangles: &[[u32; 3]], wedge_of: &[u32]) {
        let wedges = |triangle: [u32; 3]| triangle.map(|vertex| wedge_of[vertex as usize]);
        // The positions of the corners in order, and the number of the triangle, so that the first of equals is kept.
        let mut keyed = Vec::with_capacity(triangles.len());
        for (number, &triangle) in triangles.iter().enumerate() {
            let [a, b, c] = self.corner_positions(wedges(triangle));
            if a == b || b == c || c == a {
                self.degenerate += 1;
                continue;
            }
            let mut corners = [a, b, c];
            corners.sort_unstable();
            let [a, b, c] = corners.map(u128::from);
            keyed.push(a << 96 | b << 64 | c << 32 | number as u128);
        }
        keyed.sort_unstable();
        let all = keyed.len();
        keyed.dedup_by_key(|key| *key >> 32);
        self.duplicate += all - keyed.len();
        self.triangles = keyed.into_iter().map(|key| wedges(triangles[key as u32 as usize])).collect();
    }

    /// Drops wedges and positions that only dropped triangles used.
    fn drop_unused(&mut self) {
        let mut used = vec![false; self.wedges.len()];
        for &wedge in self.triangles.iter().flatten() {
            used[wedge as usize] = true;
        }
        let mut new_wedge = vec![u32::MAX; self.wedges.len()];
        // What is kept moves forward in place.
        let (mut wedges, mut positions, mut last) = (0, 0, None);
        for wedge in (0..self.wedges.len()).filter(|&wedge| used[wedge]) {
            let position = self.wedge_position[wedge];
            if last != Some(position) {
                last = Some(position);
                self.positions[positions] = self.positions[position as usize];
                positions += 1;
            }
            new_wedge[wedge] = wedges as u32;
            self.wedges[wedges] = self.wedges[wedge];
            self.wedge_position[wedges] = positions as u32 - 1;
            wedges += 1;
        }
        for triangle in &mut self.triangles {
            *triangle = triangle.map(|wedge| new_wedge[wedge as usize]);
        }
        self.positions.truncate(positions);
        self.wedges.truncate(wedges);
        self.wedge_position.truncate(wedges);
        self.positions.shrink_to_fit();
        self.wedges.shrink_to_fit();
        self.wedge_position.shrink_to_fit();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two_patches() -> SourceMesh {
        SourceMesh {
            positions: vec![
                [0., 0., 0.],
                [1., 0., 0.],
                [0., 1., 0.],
                [1., 0., 0.],
                [0., 1., 0.],
                [1., 1., 1.],
            ],
            normals: [[[0.0, 0.0, 1.0]; 3], [[1.0, 0.0, 0.0]; 3]].concat(),
            triangles: vec![[0, 1, 2], [3, 5, 4], [1, 2, 0], [0, 1, 1]],
            ..SourceMesh::default()
        }
    }

    #[test]
    fn patches_share_positions_but_keep_their_normals() {
        let mesh = two_patches();
        let welded = weld(&mesh, grid_of(&mesh).unwrap());
        assert_eq!((welded.positions.len(), welded.wedges.len(), welded.triangles.len()), (4, 6, 2));
        assert_eq!((welded.duplicate, welded.degenerate), (1, 1));
        assert!(welded.wedge_position.is_sorted());
    }

    #[test]
    fn normals_that_differ_by_rounding_are_one_wedge() {
        let mut mesh = two_patches();
        mesh.normals = [[[0.0, 0.0, 1.0]; 3], [[1e-3, 0.0, 1.0]; 3]].concat();
        let welded = weld(&mesh, grid_of(&mesh).unwrap());
        assert_eq!(welded.wedges.len(), 4);
    }

    #[test]
    fn a_mesh_of_degenerates_becomes_empty() {
        let mesh = SourceMesh { triangles: vec![[0, 0, 1]], ..two_patches() };
        let welded = weld(&mesh, grid_of(&mesh).unwrap());
        assert!(welded.triangles.is_empty() && welded.wedges.is_empty() && welded.positions.is_empty());
    }
}
