//! A recorded sequence of collapses in, a part in collapse order out: Algorithm 1 of Peng & Cao 2012.
//!
//! The wedge that is removed first gets the last index. `ecol` is the sequence in those indices, `triangles_at` counts
//! what each vertex brings back.

use super::collapse::{CollapseOrder, Group, Target};
use super::record::VertexRecord;
use super::triangles_at::TrianglesAt;
use super::weld::WeldedMesh;

/// A mesh whose vertices and triangles are numbered so that the last is the first to be removed.
#[derive(Debug, Clone, PartialEq)]
pub struct OrderedMesh {
    /// The wedges, now vertices, in collapse order.
    pub vertices: Vec<VertexRecord>,
    /// The number of the wedge in the welded mesh that each vertex was.
    pub source_wedge: Vec<u32>,
    /// A number per vertex that is the same exactly for vertices of one position.
    pub position_of: Vec<u32>,
    /// The vertex that each one collapses onto; itself if it never does.
    pub ecol: Vec<u32>,
    /// Triangles in collapse order with the finest indices.
    pub triangles: Vec<[u32; 3]>,
    /// Triangles left at each vertex count.
    pub triangles_at: TrianglesAt,
    /// Vertices left in the coarsest state.
    pub locked: u32,
    /// The states that collapses end in, finest first, as (vertex count, error in grid steps).
    pub state_errors: Vec<(u32, f32)>,
    /// The same states with the greatest cost of a step so far, an area times a squared distance in grid steps.
    pub state_costs: Vec<(u32, f32)>,
}

/// Re-arranges a mesh by its collapse order.
pub fn arrange(mesh: &WeldedMesh, order: &CollapseOrder) -> OrderedMesh {
    let permute_vertices = permutation(mesh.wedges.len(), order.moves.iter().map(|gone| gone.wedge));
    let permute_triangles = permutation(mesh.triangles.len(), order.removed.iter().copied());
    let locked = mesh.wedges.len() - order.moves.len();

    let mut ecol: Vec<u32> = (0..mesh.wedges.len() as u32).collect();
    for gone in &order.moves {
        ecol[permute_vertices[gone.wedge as usize] as usize] = match gone.target() {
            Target::Wedge(to) => permute_vertices[to as usize],
            // Vertex 0 is there in every state.
            Target::Anywhere => 0,
        };
    }
    let mut source_wedge = vec![0; mesh.wedges.len()];
    for (wedge, &vertex) in permute_vertices.iter().enumerate() {
        source_wedge[vertex as usize] = wedge as u32;
    }
    let mut triangles = vec![[0; 3]; mesh.triangles.len()];
    for (triangle, &place) in mesh.triangles.iter().zip(&permute_triangles) {
        triangles[place as usize] = triangle.map(|wedge| permute_vertices[wedge as usize]);
    }
    let mut ordered = OrderedMesh {
        vertices: source_wedge.iter().map(|&wedge| mesh.wedges[wedge as usize]).collect(),
        position_of: source_wedge.iter().map(|&wedge| mesh.wedge_position[wedge as usize]).collect(),
        source_wedge,
        ecol,
        triangles,
        triangles_at: triangles_at(mesh, order, locked),
        locked: locked as u32,
        state_errors: states(mesh.wedges.len(), order, |group| group.error),
        state_costs: states(mesh.wedges.len(), order, |group| group.cost),
    };
    ordered.settle();
    ordered
}

/// The new number of every element: the first removed is the last, what is never removed keeps its order at the front.
fn permutation(count: usize, removed: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut place = vec![u32::MAX; count];
    let mut last = count as u32;
    for element in removed {
        last -= 1;
        place[element as usize] = last;
    }
    let stay = place.iter_mut().filter(|place| **place == u32::MAX);
    stay.enumerate().for_each(|(number, place)| *place = number as u32);
    place
}

fn triangles_at(mesh: &WeldedMesh, order: &CollapseOrder, locked: usize) -> TrianglesAt {
    let coarsest = (mesh.triangles.len() - order.removed.len()) as u32;
    let mut added = Vec::with_capacity(mesh.wedges.len());
    push_group(&mut added, locked, coarsest);
    for (i, group) in order.groups.iter().enumerate().rev() {
        let (moves_start, removed_start) =
            if i == 0 { (0, 0) } else { (order.groups[i - 1].moves_end, order.groups[i - 1].removed_end) };
        push_group(&mut added, (group.moves_end - moves_start) as usize, group.removed_end - removed_start);
    }
    TrianglesAt::from_added(added)
}

fn push_group(added: &mut Vec<Option<u32>>, vertices: usize, triangles: u32) {
    if vertices > 0 {
        added.resize(added.len() + vertices - 1, None);
        added.push(Some(triangles));
    }
}

/// Something of every state, finest first, with its vertex count.
fn states(vertices: usize, order: &CollapseOrder, of: fn(&Group) -> f32) -> Vec<(u32, f32)> {
    let whole = (vertices as u32, 0.0);
    let after = order.groups.iter().map(|group| (vertices as u32 - group.moves_end, of(group)));
    std::iter::once(whole).chain(after).collect()
}

impl OrderedMesh {
    /// Where the order is free, among the triangles that come with one state and among the corners of each, puts it as
    /// the container expects it: by what they are in that state, new vertices first. It compresses better.
    fn settle(&mut self) {
        let (mut start, mut from) = (0, 0);
        for vn in self.locked.max(1)..=self.vertices.len() as u32 {
            if !self.triangles_at.is_state(vn as usize) {
                continue;
            }
            let end = self.triangles_at.count_at(vn as usize) as usize;
            let settled = |&triangle: &[u32; 3]| self.turned(triangle, from, vn);
            let mut group: Vec<([u32; 3], [u32; 3])> =
                self.triangles[start..end].iter().map(settled).collect();
            group.sort_unstable();
            let places = self.triangles[start..end].iter_mut().zip(group);
            places.for_each(|(place, (_, triangle))| *place = triangle);
            (start, from) = (end, vn);
        }
    }

    /// A triangle turned so that it begins, in the state of `vn` vertices, with its least vertex from `from` on: as it
    /// is in that state, and with its finest vertices.
    fn turned(&self, triangle: [u32; 3], from: u32, vn: u32) -> ([u32; 3], [u32; 3]) {
        let there = triangle.map(|vertex| self.resolve(vertex, vn));
        let least = (0..3).min_by_key(|&corner| (there[corner] < from, there[corner])).unwrap_or(0);
        let turn = |t: [u32; 3]| std::array::from_fn(|corner| t[(corner + least) % 3]);
        (turn(there), turn(triangle))
    }

    /// Ends the order at a state: what is left there is never removed.
    pub fn end_at(&mut self, vn: u32) {
        let coarsest = self.triangles_at.count_at(vn as usize);
        let mut added = Vec::with_capacity(self.vertices.len());
        push_group(&mut added, vn as usize, coarsest);
        for vertex in vn as usize..self.vertices.len() {
            let counts = [vertex, vertex + 1].map(|count| self.triangles_at.count_at(count));
            added.push(self.triangles_at.is_state(vertex + 1).then(|| counts[1] - counts[0]));
        }
        self.triangles_at = TrianglesAt::from_added(added);
        self.locked = vn;
        self.ecol[..vn as usize].iter_mut().zip(0..).for_each(|(target, vertex)| *target = vertex);
        self.state_errors.retain(|&(count, _)| count >= vn);
        self.state_costs.retain(|&(count, _)| count >= vn);
    }

    /// Walks `ecol` until below `vn` (the paper's Algorithm 4, Collapsing).
    pub fn resolve(&self, mut vertex: u32, vn: u32) -> u32 {
        while vertex >= vn {
            vertex = self.ecol[vertex as usize];
        }
        vertex
    }

    /// The triangles that are left at the state of `vn` vertices, reformed.
    pub fn reformed(&self, vn: u32) -> Vec<[u32; 3]> {
        let count = self.triangles_at.count_at(vn as usize) as usize;
        self.triangles[..count].iter().map(|t| t.map(|vertex| self.resolve(vertex, vn))).collect()
    }

    /// The error, in grid steps, of the finest state with at most `vn` vertices.
    pub fn error_at(&self, vn: u32) -> f32 {
        let state = self.state_errors.partition_point(|&(count, _)| count > vn);
        self.state_errors.get(state).or(self.state_errors.last()).map_or(0.0, |&(_, error)| error)
    }
}
