//! Small valid parts, made by the most naive sequential simplification, and contents made of them.

use collapsar::container::{Contents, StoredInstance, StoredPart};
use collapsar::geometry::record::{Attributes, ERROR_SAMPLES, Stall};
use collapsar::geometry::{Grid, OrderedPart, OrderedTier, TriangleRecord, TrianglesAt, VertexRecord};
use collapsar::import::{Material, Node};
use glam::{DAffine3, DMat3, DVec3};

/// A mesh on positions, each with one or two wedges; a corner is a position and the side of the crease that it is on.
pub struct Mesh {
    pub positions: Vec<[u32; 3]>,
    pub wedges: Vec<u32>,
    pub triangles: Vec<[(usize, u32); 3]>,
    /// How many positions are locked; at least 1.
    pub locked: usize,
    /// A tier has about this many times fewer vertices than the next finer one.
    pub tier_ratio: usize,
}

/// A sheet of `nx` x `ny` positions, numbered in a scrambled order, with a crease of two wedges in the middle column.
pub fn sheet(nx: usize, ny: usize, locked: usize, seed: usize) -> Mesh {
    let count = nx * ny;
    // A step that has no factor in common with the count reaches every position once.
    let step = (0..).map(|i| seed + i).find(|&s| gcd(s, count) == 1).unwrap();
    let number = |x: usize, y: usize| (y * nx + x) * step % count;
    let mut positions = vec![[0; 3]; count];
    let mut wedges = vec![1; count];
    let mut triangles = Vec::new();
    for (x, y) in (0..ny).flat_map(|y| (0..nx).map(move |x| (x, y))) {
        positions[number(x, y)] = [x as u32 * 1000, y as u32 * 1000, (x * y) as u32];
        wedges[number(x, y)] = if x == nx / 2 { 2 } else { 1 };
        if x + 1 < nx && y + 1 < ny {
            let side = u32::from(x >= nx / 2);
            let [a, b, c, d] =
                [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].map(|(x, y)| (number(x, y), side));
            triangles.extend([[a, b, c], [b, d, c]]);
        }
    }
    Mesh { positions, wedges, triangles, locked, tier_ratio: 2 }
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// 260 pages on one edge, over and over the same nine positions, so that one vertex adds more than a byte can say.
pub fn book() -> Mesh {
    let positions = (0..9u32).map(|i| [i * i, 7 * i, 100 - i]).collect();
    let page = |i: usize| [(0, 0), (8, 0), (1 + i % 7, 0)];
    let fan = (1..7).map(|i| [(0, 0), (i, 0), (i + 1, 0)]);
    let triangles = (0..260).map(page).chain(fan).collect();
    Mesh { positions, wedges: vec![1; 9], triangles, locked: 2, tier_ratio: 2 }
}

/// One triangle that cannot collapse.
pub fn triangle() -> Mesh {
    let positions = vec![[0, 0, 0], [2_097_151, 0, 0], [0, 2_097_151, 5]];
    Mesh {
        positions,
        wedges: vec![1; 3],
        triangles: vec![[(0, 0), (1, 0), (2, 0)]],
        locked: 3,
        tier_ratio: 4,
    }
}

/// Removes position after position, the last first, each onto one of its neighbours.
struct Simplified {
    /// For each position beyond the locked ones: where it went, and which triangles that removed.
    onto: Vec<usize>,
    removed: Vec<Vec<usize>>,
    left: Vec<usize>,
}

fn simplify(mesh: &Mesh) -> Simplified {
    let mut now: Vec<[usize; 3]> = mesh.triangles.iter().map(|t| t.map(|corner| corner.0)).collect();
    let mut left: Vec<usize> = (0..now.len()).collect();
    let mut onto = Vec::new();
    let mut removed = Vec::new();
    for position in (mesh.locked..mesh.positions.len()).rev() {
        let around = || left.iter().map(|&t| now[t]).filter(|t| t.contains(&position)).flatten();
        let neighbours = || around().filter(|&other| other != position);
        let smallest = position % 3 == 0 || position + 1 == mesh.positions.len();
        let target = if smallest { neighbours().min() } else { neighbours().max() }.unwrap_or(0);
        let gone = |t: &&usize| now[**t].contains(&position) && now[**t].contains(&target);
        removed.push(left.iter().filter(gone).copied().collect::<Vec<_>>());
        left.retain(|t| !(now[*t].contains(&position) && now[*t].contains(&target)));
        now.iter_mut().flatten().filter(|corner| **corner == position).for_each(|corner| *corner = target);
        onto.push(target);
    }
    onto.reverse();
    removed.reverse();
    Simplified { onto, removed, left }
}

/// The part of a mesh.
pub fn ordered(mesh: &Mesh) -> OrderedPart {
    let Simplified { onto, removed, left } = simplify(mesh);
    let first: Vec<u32> =
        mesh.wedges.iter().scan(0, |sum, &wedges| Some(std::mem::replace(sum, *sum + wedges))).collect();
    let wedge = |position: usize, side: u32| first[position] + side.min(mesh.wedges[position] - 1);
    let mut vertices = Vec::new();
    let mut ecol = Vec::new();
    let mut added = Vec::new();
    for (position, &grid) in mesh.positions.iter().enumerate() {
        let beyond = position.checked_sub(mesh.locked);
        for side in 0..mesh.wedges[position] {
            let is_last = side + 1 == mesh.wedges[position];
            let number = vertices.len() as u32;
            vertices.push(VertexRecord::new(grid, 0x0102_0300 + number));
            ecol.push(beyond.map_or(number, |i| wedge(onto[i], side)) as u16);
            let count = match beyond {
                Some(i) => removed[i].len(),
                None => left.len(),
            };
            let ends = is_last && (beyond.is_some() || position + 1 == mesh.locked);
            added.push(ends.then_some(count as u32));
        }
    }
    let locked = first.get(mesh.locked).copied().unwrap_or(vertices.len() as u32);
    let order = left.iter().chain(removed.iter().flatten());
    let finest: Vec<TriangleRecord> = order
        .map(|&t| mesh.triangles[t].map(|(position, side)| wedge(position, side) as u16))
        .map(|vertices| TriangleRecord { vertices, flags: vertices[0] % 8 })
        .collect();
    let triangles_at = TrianglesAt::from_added(added);
    let tiers = tiers(&finest, &ecol, &triangles_at, locked as usize, mesh.tier_ratio);
    OrderedPart {
        grid: Grid { origin: [-1.5, 0.25, 1024.0], step_exponent: -10 },
        attributes: Default::default(),
        vertices,
        ecol,
        triangles_at,
        tiers,
        locked,
        errors: std::array::from_fn(|i| (i * 255 / ERROR_SAMPLES) as u8),
        place: Default::default(),
        closure: Default::default(),
        stall: Stall::Boundary,
    }
}

fn tiers(
    finest: &[TriangleRecord],
    ecol: &[u16],
    at: &TrianglesAt,
    locked: usize,
    ratio: usize,
) -> Vec<OrderedTier> {
    let mut counts = vec![ecol.len()];
    while let Some(next) =
        counts.last().map(|last| at.state_at_most(last / ratio)).filter(|&next| next >= locked)
    {
        counts.push(next);
    }
    counts
        .into_iter()
        .map(|vn| OrderedTier { vertices: vn as u32, triangles: reformed(finest, ecol, at, vn) })
        .collect()
}

/// The first `triangles_at[vn]` triangles, each corner walked down until it is below `vn`.
pub fn reformed(finest: &[TriangleRecord], ecol: &[u16], at: &TrianglesAt, vn: usize) -> Vec<TriangleRecord> {
    let walk = |mut vertex: u16| {
        while usize::from(vertex) >= vn {
            vertex = ecol[usize::from(vertex)];
        }
        vertex
    };
    let kept = &finest[..at.count_at(vn) as usize];
    kept.iter().map(|t| TriangleRecord { vertices: t.vertices.map(walk), flags: t.flags }).collect()
}

pub fn stored(mesh: &Mesh, name: &str) -> StoredPart {
    StoredPart { part: ordered(mesh), name: name.to_owned(), source: 7, cell: false }
}

/// Parts placed once each under a tree of three nodes, one of them twice.
pub fn contents_of(parts: Vec<StoredPart>) -> Contents {
    let place = |part: usize, node: u32| StoredInstance {
        part: part as u32,
        node,
        material: node % 2,
        world_from_part: DAffine3 {
            matrix3: DMat3::from_diagonal(DVec3::new(1.0, -2.0, 0.5)),
            translation: DVec3::new(part as f64, f64::from(node), -1e6),
        },
    };
    let node = |name: &str, parent| Node { name: name.to_owned(), parent };
    Contents {
        instances: (0..parts.len())
            .map(|part| place(part, 1))
            .chain((!parts.is_empty()).then(|| place(0, 2)))
            .collect(),
        parts,
        nodes: vec![node("engine", None), node("cylinder ø 20", Some(0)), node("cylinder ø 20", Some(0))],
        materials: vec![
            Material::default(),
            Material { name: "steel".to_owned(), base_colour: [90, 91, 92, 255] },
        ],
    }
}

/// What the committed file of version 1 holds.
pub fn golden_contents() -> Contents {
    let mut cell = stored(&triangle(), "ø triangle");
    (cell.cell, cell.part.attributes, cell.part.stall) = (true, Attributes::Colour, Stall::None);
    contents_of(vec![stored(&sheet(6, 5, 6, 7), "sheet"), stored(&book(), "book"), cell])
}
