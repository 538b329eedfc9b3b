//! A welded mesh in, cells of at most 65,536 vertices out: the paper's own future work (section 7).
//!
//! A kd-tree on triangles: the list is halved at the median of the centroids along the longest side of their box until
//! every piece fits. Positions that several cells share are locked, so that cells meet without cracks at any mix of
//! levels; all cells keep the grid of the whole, so that they meet exactly.

use super::record::{MAX_PART_TRIANGLES, MAX_PART_VERTICES};
use super::weld::WeldedMesh;

/// A piece of a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// The piece as a mesh of its own.
    pub mesh: WeldedMesh,
    /// Per position: whether another cell has it too.
    pub locked: Vec<bool>,
}

/// Cuts a mesh that is too large; a small one is returned whole, as one cell with nothing locked.
pub fn cut(mesh: WeldedMesh) -> Vec<Cell> {
    cut_to(mesh, MAX_PART_VERTICES, MAX_PART_TRIANGLES)
}

/// Cuts a mesh into cells of at most so many vertices and triangles; three vertices are always allowed.
pub fn cut_to(mesh: WeldedMesh, max_vertices: usize, max_triangles: usize) -> Vec<Cell> {
    if mesh.wedges.len() <= max_vertices && mesh.triangles.len() <= max_triangles {
        let locked = vec![false; mesh.positions.len()];
        return vec![Cell { mesh, locked }];
    }
    let mut pieces = Vec::new();
    let mut stack = vec![(0..mesh.triangles.len() as u32).collect::<Vec<u32>>()];
    while let Some(mut piece) = stack.pop() {
        let fits = piece.len() <= max_triangles && wedge_count(&mesh, &piece) <= max_vertices;
        if fits || piece.len() == 1 {
            pieces.push(piece);
            continue;
        }
        let upper = halve(&mesh, &mut piece);
        stack.push(upper);
        stack.push(piece);
    }
    let owners = owner_counts(&mesh, &pieces);
    pieces.into_iter().map(|piece| cell(&mesh, piece, &owners)).collect()
}

fn wedge_count(mesh: &WeldedMesh, piece: &[u32]) -> usize {
    let mut wedges: Vec<u32> = piece.iter().flat_map(|&t| mesh.triangles[t as usize]).collect();
    wedges.sort_unstable();
    wedges.dedup();
    wedges.len()
}

/// Three times the centroid of a triangle, in grid coordinates.
fn centroid(mesh: &WeldedMesh, triangle: u32) -> [u32; 3] {
    let corners = mesh.corner_positions(mesh.triangles[triangle as usize]);
    let corners = corners.map(|position| mesh.positions[position as usize]);
    [0, 1, 2].map(|axis| corners.iter().map(|corner| corner[axis]).sum())
}

/// Keeps the lower half of a piece and returns the upper.
fn halve(mesh: &WeldedMesh, piece: &mut Vec<u32>) -> Vec<u32> {
    let centroids = || piece.iter().map(|&t| centroid(mesh, t));
    let extent = [0, 1, 2].map(|axis| {
        let low = centroids().map(|c| c[axis]).min().unwrap_or(0);
        centroids().map(|c| c[axis]).max().unwrap_or(0) - low
    });
    let axis = (0..3).max_by_key(|&axis| extent[axis]).unwrap_or(0);
    let middle = piece.len() / 2;
    piece.select_nth_unstable_by_key(middle, |&t| (centroid(mesh, t)[axis], t));
    let mut upper = piece.split_off(middle);
    // Back into the order of the mesh, which runs along the surface.
    upper.sort_unstable();
    piece.sort_unstable();
    upper
}

/// For every position, how many pieces use it.
fn owner_counts(mesh: &WeldedMesh, pieces: &[Vec<u32>]) -> Vec<u32> {
    let mut owners = vec![0; mesh.positions.len()];
    let mut last_piece = vec![u32::MAX; mesh.positions.len()];
    for (number, piece) in pieces.iter().enumerate() {
        for position in piece.iter().flat_map(|&t| mesh.corner_positions(mesh.triangles[t as usize])) {
            if last_piece[position as usize] != number as u32 {
                last_piece[position as usize] = number as u32;
                owners[position as usize] += 1;
            }
        }
    }
    owners
}

fn cell(mesh: &WeldedMesh, piece: Vec<u32>, owners: &[u32]) -> Cell {
    let mut wedges: Vec<u32> = piece.iter().flat_map(|&t| mesh.triangles[t as usize]).collect();
    wedges.sort_unstable();
    wedges.dedup();
    let mut cell = WeldedMesh { coloured: mesh.coloured, ..WeldedMesh::default() };
    let mut locked = Vec::new();
    let mut last = None;
    for &wedge in &wedges {
        let position = mesh.wedge_position[wedge as usize];
        if last != Some(position) {
            last = Some(position);
            cell.positions.push(mesh.positions[position as usize]);
            locked.push(owners[position as usize] > 1);
        }
        cell.wedges.push(mesh.wedges[wedge as usize]);
        cell.wedge_position.push(cell.positions.len() as u32 - 1);
    }
    let local = |wedge: u32| wedges.partition_point(|&w| w < wedge) as u32;
    cell.triangles = piece.iter().map(|&t| mesh.triangles[t as usize].map(local)).collect();
    Cell { mesh: cell, locked }
}
