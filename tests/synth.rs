//! Synthetic models: what is promised of their size, their meshes, their distribution, and their files.

#![expect(clippy::unwrap_used, reason = "a test's helpers panic to fail it")]

use std::collections::BTreeMap;
use std::io::Write;

use collapsar::import::{SourceMesh, read};
use collapsar::synth::glb::{Glb, GlbError};
use collapsar::synth::{
    FAMILIES, Family, LEAST_TRIANGLES, Layout, MOST_TRIANGLES, Plan, SynthError, SynthOptions, obj, stream,
};
use rustc_hash::FxHashMap;

const LAYOUTS: [Layout; 3] = [Layout::Airplane, Layout::Ship, Layout::Plant];

fn options(triangles: u64, parts: u64) -> SynthOptions {
    SynthOptions { triangles, parts: Some(parts), instances: None, seed: 1, layout: Layout::Airplane }
}

fn plan(triangles: u64, parts: u64) -> Plan {
    Plan::new(&options(triangles, parts)).unwrap()
}

/// What every mesh of a plan must be. Pieces of a surface that are too coarse for its bend may have normals that look
/// away from their triangles.
fn assert_valid(plan: &Plan, number: u32, mesh: &SourceMesh) {
    let triangles = plan.triangles(number);
    let bends = matches!(plan.family(number), Family::Skin | Family::StiffPlate | Family::Frame);
    let looks_out = !bends || triangles >= 600;
    let what = format!("{:?} {} of {triangles}", plan.layout(), mesh.name);
    assert_eq!(mesh.triangles.len() as u64, triangles, "{what}");
    assert_eq!(mesh.positions.len(), mesh.normals.len(), "{what}");
    assert!(mesh.positions.iter().flatten().all(|c| c.is_finite()), "{what}: not finite");
    let mut used = vec![false; mesh.positions.len()];
    for triangle in &mesh.triangles {
        for &corner in triangle {
            used[corner as usize] = true;
        }
        let [a, b, c] = triangle.map(|corner| glam::Vec3::from(mesh.positions[corner as usize]).as_dvec3());
        let area = (b - a).cross(c - a);
        let longest = (b - a).length().max((c - b).length()).max((a - c).length());
        // What is thinner than this falls on one line of the grid of the bake.
        assert!(area.length() > 1e-12 * longest * longest, "{what}: {a} {b} {c} has no area");
        let normals = triangle.map(|corner| glam::Vec3::from(mesh.normals[corner as usize]).as_dvec3());
        let out = area.dot(normals[0] + normals[1] + normals[2]);
        assert!(!looks_out || out > 0.0, "{what}: {a} {b} {c} faces backwards");
    }
    assert!(used.iter().all(|&used| used), "{what}: a vertex without a triangle");
    for normal in &mesh.normals {
        let length = glam::Vec3::from(*normal).length();
        assert!((length - 1.0).abs() < 1e-4, "{what}: a normal of length {length}");
    }
}

/// Edges by the bits of their ends: how often each is gone along one way and the other.
fn edges(mesh: &SourceMesh) -> FxHashMap<[[u32; 3]; 2], [u32; 2]> {
    let position = |corner: u32| mesh.positions[corner as usize].map(f32::to_bits);
    let mut edges = FxHashMap::default();
    for [a, b, c] in &mesh.triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let (from, to) = (position(*from), position(*to));
            let way = usize::from(from > to);
            edges.entry([from.min(to), from.max(to)]).or_insert([0; 2])[way] += 1;
        }
    }
    edges
}

fn is_closed(mesh: &SourceMesh) -> bool {
    edges(mesh).values().all(|&ways| ways == [1, 1])
}

/// A mesh of every family and layout at many sizes, by way of models that are about as large.
#[test]
fn every_mesh_is_valid_and_has_its_triangles() {
    let mut seen: BTreeMap<Family, u32> = BTreeMap::new();
    for layout in LAYOUTS {
        for (mean, parts) in [(20, 300), (23, 300), (37, 300), (90, 500), (250, 600), (462, 900), (4000, 200)]
        {
            let options = SynthOptions { layout, ..options(mean * parts + mean % 2, parts) };
            let plan = Plan::new(&options).unwrap();
            for number in 0..plan.mesh_count() {
                let mesh = plan.mesh(number);
                assert_valid(&plan, number, &mesh);
                let family = plan.family(number);
                let (is, triangles) = (is_closed(&mesh), mesh.triangles.len());
                assert_eq!(is, plan.is_closed(number), "{layout:?} {family:?} {} of {triangles}", mesh.name);
                *seen.entry(plan.family(number)).or_default() += 1;
            }
        }
    }
    for family in FAMILIES {
        assert!(
            seen.get(&family).is_some_and(|&count| count >= 20),
            "{family:?} was made too seldom: {seen:?}"
        );
    }
}

#[test]
fn large_parts_are_valid_too() {
    for (triangles, parts) in [(3_000_000, 60), (1_999_999, 1)] {
        let plan = plan(triangles, parts);
        for number in 0..plan.mesh_count() {
            assert_valid(&plan, number, &plan.mesh(number));
        }
    }
}

#[test]
fn the_total_is_exact() {
    for (triangles, parts) in
        [(20, 1), (21, 1), (40, 2), (41, 2), (2000, 100), (12_347, 600), (1_000_001, 2000)]
    {
        for layout in LAYOUTS {
            let plan = Plan::new(&SynthOptions { layout, ..options(triangles, parts) }).unwrap();
            assert_eq!(
                (plan.triangle_count(), u64::from(plan.mesh_count())),
                (triangles, parts),
                "{layout:?}"
            );
            let made: u64 = (0..plan.mesh_count()).map(|mesh| plan.mesh(mesh).triangles.len() as u64).sum();
            assert_eq!(made, triangles, "{layout:?}");
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_model_in_any_order_and_another_seed_another() {
    let [one, same, other] =
        [5, 5, 6].map(|seed| Plan::new(&SynthOptions { seed, ..options(90_000, 200) }).unwrap());
    let backwards: Vec<SourceMesh> = (0..200).rev().map(|mesh| same.mesh(mesh)).collect();
    let mut streamed = Vec::new();
    let stopped = stream::meshes(&one, |number, mesh| {
        assert_eq!(number as usize, streamed.len());
        streamed.push(mesh);
        std::ops::ControlFlow::<()>::Continue(())
    });
    assert_eq!(stopped, None);
    assert!(streamed.iter().eq(backwards.iter().rev()));
    assert_eq!(one.outline(), same.outline());
    let differ = (0..200).filter(|&mesh| one.mesh(mesh).positions != other.mesh(mesh).positions).count();
    assert!(differ > 150, "{differ} of 200 meshes differ");
    assert_ne!(one.outline().instances, other.outline().instances);
}

#[test]
fn a_stream_stops_when_its_taker_has_enough() {
    let plan = plan(40_000_000, 90_000);
    let mut taken = 0;
    let stopped = stream::meshes(&plan, |_, _| {
        taken += 1;
        if taken == 3 { std::ops::ControlFlow::Break("enough") } else { std::ops::ControlFlow::Continue(()) }
    });
    assert_eq!((stopped, taken), (Some("enough"), 3));
}

/// The Boeing: a mean of 462 triangles, few large parts, and the largest of about 100,000.
#[test]
fn sizes_are_skewed_as_those_of_the_boeing() {
    for layout in LAYOUTS {
        let plan = Plan::new(&SynthOptions { layout, ..options(332_000_000, 718_000) }).unwrap();
        let mut sizes: Vec<u64> = (0..plan.mesh_count()).map(|mesh| plan.triangles(mesh)).collect();
        sizes.sort_unstable();
        assert_eq!(sizes.iter().sum::<u64>(), 332_000_000);
        assert!(sizes[0] >= LEAST_TRIANGLES.into() && *sizes.last().unwrap() <= 100_000, "{layout:?}");
        let [median, last] = [sizes[sizes.len() / 2], sizes[sizes.len() * 999 / 1000]];
        assert!((100..300).contains(&median), "{layout:?}: the median is {median}");
        assert!(last > 5_000 && *sizes.last().unwrap() > 20_000, "{layout:?}: 99.9 % are below {last}");
        let largest_tenth: u64 = sizes[sizes.len() * 9 / 10..].iter().sum();
        assert!(
            (0.4..0.8).contains(&(largest_tenth as f64 / 332e6)),
            "{layout:?}: {largest_tenth} in a tenth"
        );
    }
}

/// 223 M vertices for 332 M triangles: wedges after a weld by position and normal, as the bake does it.
#[test]
fn there_are_two_vertices_for_three_triangles() {
    for layout in LAYOUTS {
        let plan = Plan::new(&SynthOptions { layout, ..options(1_386_000, 3000) }).unwrap();
        let mut wedges = 0;
        let mut of_family: BTreeMap<Family, [usize; 2]> = BTreeMap::new();
        for number in 0..plan.mesh_count() {
            let mesh = plan.mesh(number);
            let grid = collapsar::geometry::weld::grid_of(&mesh).unwrap();
            let welded = collapsar::geometry::weld::weld(&mesh, grid);
            assert_eq!((welded.degenerate, welded.duplicate), (0, 0), "{layout:?} {}", mesh.name);
            wedges += welded.wedges.len();
            let sums = of_family.entry(plan.family(number)).or_default();
            *sums = [sums[0] + welded.wedges.len(), sums[1] + mesh.triangles.len()];
        }
        let each = wedges as f64 / 1_386_000.0;
        assert!((0.6..0.72).contains(&each), "{layout:?}: {each} wedges for a triangle: {of_family:?}");
    }
}

#[test]
fn patches_repeat_positions_as_cad_exporters_do() {
    let plan = plan(200_000, 500);
    let [mut vertices, mut positions] = [0, 0];
    for number in 0..plan.mesh_count() {
        let mut all =
            plan.mesh(number).positions.into_iter().map(|p| p.map(f32::to_bits)).collect::<Vec<_>>();
        vertices += all.len();
        all.sort_unstable();
        all.dedup();
        positions += all.len();
    }
    assert!(vertices > positions * 3 / 2, "{vertices} vertices at {positions} positions");
}

#[test]
fn the_tree_is_one_and_every_part_is_placed_where_it_belongs() {
    for layout in LAYOUTS {
        let options = SynthOptions { layout, instances: Some(30_000), ..options(4_000_000, 9_000) };
        let plan = Plan::new(&options).unwrap();
        let outline = plan.outline();
        assert_eq!(outline.instances.len(), 30_000);
        assert_eq!(outline.nodes.len(), plan.node_count() as usize);
        let mut children = vec![0; outline.nodes.len()];
        let mut depth = vec![0; outline.nodes.len()];
        for (number, node) in outline.nodes.iter().enumerate().skip(1) {
            let parent = node.parent.unwrap() as usize;
            assert!(parent < number && !node.name.is_empty() && node.name.len() <= 24, "{node:?}");
            children[parent] += 1;
            depth[number] = depth[parent] + 1;
        }
        assert!(children.iter().all(|&count| count <= 400), "{layout:?}: {:?}", children.iter().max());
        let mut placed = vec![0; plan.mesh_count() as usize];
        let mut leaves = vec![0; outline.nodes.len()];
        for instance in &outline.instances {
            placed[instance.mesh as usize] += 1;
            leaves[instance.node as usize] += 1;
            assert_eq!((depth[instance.node as usize], children[instance.node as usize]), (5, 0));
            assert_eq!(outline.nodes[instance.node as usize].name, plan.name(instance.mesh));
            assert_eq!(instance.material, plan.material(instance.mesh));
            assert!((instance.world_from_part.matrix3.determinant() - 1.0).abs() < 1e-9, "no rotation");
        }
        assert!(
            leaves.iter().zip(&depth).all(|(&count, &depth)| count == u32::from(depth == 5)),
            "{layout:?}"
        );
        assert!(
            placed.iter().all(|&count| count >= 1) && placed.iter().any(|&count| count > 20),
            "{layout:?}"
        );
        let placed_triangles: u64 = outline.instances.iter().map(|i| plan.triangles(i.mesh)).sum();
        assert_eq!(placed_triangles, plan.triangles_placed());
    }
}

/// Real sizes: an airliner of 64 m by 61 m, and nothing far outside of it.
#[test]
fn models_have_real_sizes() {
    for (layout, low, high) in [
        (Layout::Airplane, [-0.5, -6.0, -31.5], [65.0, 14.0, 31.5]),
        (Layout::Ship, [-8.0, -1.0, -15.5], [192.0, 36.0, 15.5]),
        (Layout::Plant, [-5.0, -2.5, -12.0], [140.0, 28.5, 62.0]),
    ] {
        let plan = Plan::new(&SynthOptions { layout, ..options(600_000, 2000) }).unwrap();
        let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        for instance in plan.outline().instances {
            for position in plan.mesh(instance.mesh).positions {
                let point = instance.world_from_part.transform_point3(glam::Vec3::from(position).as_dvec3());
                for axis in 0..3 {
                    bounds[0][axis] = bounds[0][axis].min(point[axis]);
                    bounds[1][axis] = bounds[1][axis].max(point[axis]);
                }
            }
        }
        for axis in 0..3 {
            assert!(bounds[0][axis] >= low[axis] && bounds[1][axis] <= high[axis], "{layout:?}: {bounds:?}");
            let (size, expected) = (bounds[1][axis] - bounds[0][axis], high[axis] - low[axis]);
            assert!(size > 0.8 * expected, "{layout:?}: {bounds:?}");
        }
    }
}

/// The plan of the Boeing, and of a model of two million parts: within seconds, and of a few bytes a part.
#[test]
fn plans_of_many_parts_are_quick_and_small() {
    for (triangles, parts) in [(332_000_000, 718_000), (1_000_000_000, 2_000_000)] {
        let started = std::time::Instant::now();
        let plan = plan(triangles, parts);
        assert!(started.elapsed().as_secs() < 20, "{:?}", started.elapsed());
        assert_eq!((plan.triangle_count(), u64::from(plan.mesh_count())), (triangles, parts));
        assert_eq!(u64::from(plan.instance_count()), parts * 13 / 10);
        assert!(plan.memory_bytes() < 8 * parts + 2_000_000, "{} bytes", plan.memory_bytes());
        let (outline, count) = (plan.outline(), plan.instance_count() as usize);
        let names: usize = outline.nodes.iter().map(|node| node.name.capacity()).sum();
        let bytes =
            std::mem::size_of_val(&outline.instances[..]) + std::mem::size_of_val(&outline.nodes[..]) + names;
        assert!(
            bytes < 180 * count && outline.nodes.len() < count * 11 / 10,
            "{bytes} bytes for {count} placements"
        );
        assert!(
            plan.instances().skip(count / 2).take(9).eq(outline.instances[count / 2..][..9].iter().cloned())
        );
        for mesh in [0, parts as u32 / 2, parts as u32 - 1] {
            assert_valid(&plan, mesh, &plan.mesh(mesh));
        }
    }
}

#[test]
fn sizes_that_no_model_has_are_refused() {
    let refused = |triangles, parts: Option<u64>, instances: Option<u64>| {
        let options = SynthOptions { triangles, parts, instances, seed: 1, layout: Layout::Airplane };
        Plan::new(&options).map(|plan| plan.mesh_count()).unwrap_err()
    };
    assert_eq!(refused(0, None, None), SynthError::TooFewTriangles { triangles: 0 });
    assert_eq!(refused(19, None, None), SynthError::TooFewTriangles { triangles: 19 });
    assert_eq!(refused(100, Some(0), None), SynthError::NoParts);
    assert_eq!(refused(100, Some(6), None), SynthError::TooManyParts { parts: 6, triangles: 100, most: 5 });
    let least = 3;
    let triangles = 2 * u64::from(MOST_TRIANGLES) + 1;
    assert_eq!(refused(triangles, Some(2), None), SynthError::TooFewParts { parts: 2, triangles, least });
    assert_eq!(refused(2000, Some(50), Some(49)), SynthError::TooFewInstances { instances: 49, parts: 50 });
    let instances = (1 << 24) + 1;
    assert_eq!(refused(2000, Some(50), Some(instances)), SynthError::TooManyInstances { instances });
    assert!(matches!(refused(u64::MAX, None, None), SynthError::TooManyTriangles { .. }));
    assert!(matches!(refused(u64::MAX, Some(u64::MAX), Some(u64::MAX)), SynthError::TooManyTriangles { .. }));
    let parts = 20_000_000;
    assert!(matches!(refused(1 << 40, Some(parts), None), SynthError::TooManyParts { most: 16_777_216, .. }));
    assert_eq!(Plan::new(&options(100, 5)).unwrap().mesh_count(), 5);
    assert_eq!(Plan::new(&options(triangles, 3)).unwrap().triangle_count(), triangles);
}

/// Written and read back by the importers.
fn read_back(name: &str, write: impl FnOnce(&mut dyn Write)) -> collapsar::import::Model {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    let mut file = std::io::BufWriter::new(std::fs::File::create(&path).unwrap());
    write(&mut file);
    file.flush().unwrap();
    drop(file);
    let model = read(&[path]).unwrap();
    assert!(model.notes.is_empty(), "{:?}", model.notes);
    model
}

/// That two meshes have the same triangles: importers may number vertices anew, and make normals unit ones again.
fn assert_same(read: &SourceMesh, made: &SourceMesh) {
    let corners =
        |mesh: &SourceMesh| -> Vec<usize> { mesh.triangles.iter().flatten().map(|&c| c as usize).collect() };
    assert_eq!(read.triangles.len(), made.triangles.len(), "{}", made.name);
    for (a, b) in corners(read).into_iter().zip(corners(made)) {
        assert_eq!(read.positions[a], made.positions[b], "{}", made.name);
        let [one, other] = [read.normals[a], made.normals[b]].map(glam::Vec3::from);
        assert!(one.abs_diff_eq(other, 1e-6), "{}: {one} {other}", made.name);
    }
}

#[test]
fn glb_comes_back_as_it_was() {
    for layout in LAYOUTS {
        let plan = Plan::new(&SynthOptions { layout, ..options(150_001, 300) }).unwrap();
        let mut told = 0;
        let model = read_back("model.glb", |out| {
            let glb = Glb::measure(&plan, |_| true).unwrap();
            glb.write(out, |triangles| told += triangles).unwrap();
        });
        assert_eq!(told, 150_001);
        let outline = plan.outline();
        assert_eq!(model.meshes.len(), 300);
        assert_eq!(model.nodes, outline.nodes);
        assert_eq!(model.instances.len(), outline.instances.len());
        for (read, made) in model.instances.iter().zip(&outline.instances) {
            // The file has them in the order in which nodes place them.
            assert_eq!(read.node, made.node);
            assert_same(&model.meshes[read.mesh as usize], &plan.mesh(made.mesh));
            assert!(read.world_from_part.abs_diff_eq(made.world_from_part, 1e-4));
            let colours = [(&model.materials, read.material), (&outline.materials, made.material)];
            let [a, b] = colours.map(|(list, number)| list[number as usize].base_colour);
            assert!(a.iter().zip(b).all(|(&a, b)| a.abs_diff(b) <= 1), "{a:?} {b:?}");
        }
    }
}

#[test]
fn a_mesh_with_long_indices_comes_back_too() {
    let plan = plan(150_000, 1);
    let mesh = plan.mesh(0);
    assert!(mesh.positions.len() > 65_535);
    let model =
        read_back("model.glb", |out| Glb::measure(&plan, |_| true).unwrap().write(out, |_| {}).unwrap());
    assert_same(&model.meshes[0], &mesh);
}

#[test]
fn obj_has_every_placement() {
    for layout in LAYOUTS {
        let plan = Plan::new(&SynthOptions { layout, ..options(60_001, 150) }).unwrap();
        let mut told = 0;
        let model =
            read_back("model.obj", |out| obj::write(&plan, out, |triangles| told += triangles).unwrap());
        let triangles: usize = model.meshes.iter().map(|mesh| mesh.triangles.len()).sum();
        assert_eq!((triangles as u64, told), (plan.triangles_placed(), plan.triangles_placed()));
        assert_eq!(model.meshes.len(), plan.instance_count() as usize);
    }
}

#[test]
fn a_glb_beyond_its_limit_is_refused_before_anything_is_made() {
    let large = plan(400_000_000, 900_000);
    let error = Glb::measure(&large, |_| panic!("it made a mesh")).unwrap_err();
    assert!(matches!(error, GlbError::TooLarge { .. }));
    let message = error.to_string();
    for word in ["less than 4 GiB", "ask for at most about", "OBJ or a container"] {
        assert!(message.contains(word), "{message}");
    }
    let stopped = Glb::measure(&plan(2000, 50), |_| false).unwrap_err();
    assert!(matches!(stopped, GlbError::Interrupted));
}
