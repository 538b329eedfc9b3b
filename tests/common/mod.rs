//! What several tests share: generated meshes and the folder of real models.
#![allow(dead_code, reason = "each test uses some of it")]
#![allow(clippy::unwrap_used, reason = "a test that cannot set up its scene should fail loudly")]

pub mod metric;

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};

use collapsar::bake::{BakeOptions, BakeProgress, Loaded, MeshSource, bake, bake_source, merged};
use collapsar::geometry::normals::{CREASE_DEGREES, by_crease_angle};
use collapsar::gpu::{Gpu, GpuError, GpuOptions, testing};
use collapsar::import::{Instance, Material, Model, Node, SourceMesh};
use collapsar::scene::Scene;
use glam::{DAffine3, DVec3};

/// The one device of all tests of a binary, or `None` where the environment says that this machine has none.
pub fn gpu(test: &str) -> Option<Arc<Gpu>> {
    static GPU: LazyLock<Result<Arc<Gpu>, GpuError>> =
        LazyLock::new(|| Gpu::new(&GpuOptions::default()).map(Arc::new));
    match &*GPU {
        Ok(gpu) => {
            let info = &gpu.adapter_info;
            let adapter = format!("{} ({} {})", info.name, info.backend, info.driver_info);
            testing::log_run(test, Some(&adapter));
            Some(Arc::clone(gpu))
        }
        Err(_) if std::env::var(testing::NO_GPU_VARIABLE).is_ok_and(|value| value == "1") => {
            eprintln!("skipped: {test}: {}=1", testing::NO_GPU_VARIABLE);
            testing::log_run(test, None);
            None
        }
        Err(error) => {
            panic!("{test} needs a GPU adapter; set {}=1 if there is none: {error}", testing::NO_GPU_VARIABLE)
        }
    }
}

/// The folder of real models, where there is one.
pub fn datasets() -> Option<PathBuf> {
    let folder = std::env::var_os("COLLAPSAR_DATASETS")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/datasets"), PathBuf::from);
    if folder.join("gltf").is_dir() {
        return Some(folder);
    }
    eprintln!("skipped: no real models at hand (set COLLAPSAR_DATASETS to their folder)");
    None
}

/// The project's own models.
pub fn bundled(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("datasets").join(name)
}

/// The bundled models, and every real one at hand, packed ones included; sorted by name.
pub fn models() -> Vec<PathBuf> {
    let mut files = vec![bundled("2CylinderEngine.glb"), bundled("peterbilt.obj")];
    for folder in
        datasets().iter().flat_map(|at| ["gltf", "obj", "ply", "stl", "restricted"].map(|sub| at.join(sub)))
    {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        files.extend(entries.map(|entry| entry.path()).filter(|path| is_model(path)));
    }
    files.sort_by(|a, b| a.file_name().cmp(&b.file_name()));
    files.dedup_by(|a, b| a.file_name() == b.file_name());
    files
}

fn is_model(path: &Path) -> bool {
    let name = path.to_string_lossy();
    let name = name.trim_end_matches(".zst").trim_end_matches(".gz");
    ["glb", "gltf", "obj", "ply", "stl"].iter().any(|kind| name.ends_with(&format!(".{kind}")))
}

/// The bodies of a file as the bake orders them: with normals, the meshes of each merged where the bake does so.
pub fn bodies_of(file: &Path) -> Vec<Vec<SourceMesh>> {
    let source = Loaded::new(collapsar::import::read(&[file.to_owned()]).unwrap());
    let bodies = collapsar::bake::bodies(source.outline());
    let merge: Vec<bool> = bodies.iter().map(|body| body.is_merged).collect();
    let take = |(body, merge): (collapsar::bake::Body, bool)| {
        let mut meshes = body.load(&source).unwrap();
        meshes.iter_mut().for_each(|mesh| by_crease_angle(mesh, CREASE_DEGREES));
        if merge { vec![merged(meshes)] } else { meshes }
    };
    bodies.into_iter().zip(merge).map(take).collect()
}

/// A sphere of `rings` x `segments` with smooth normals, closed but for the shared poles.
pub fn sphere(rings: u32, segments: u32) -> SourceMesh {
    let mut mesh = SourceMesh { name: "sphere".into(), ..SourceMesh::default() };
    for r in 0..=rings {
        for s in 0..segments {
            let (theta, phi) = (
                std::f32::consts::PI * r as f32 / rings as f32,
                std::f32::consts::TAU * s as f32 / segments as f32,
            );
            let n = [theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()];
            mesh.positions.push(n);
            mesh.normals.push(n);
        }
    }
    for r in 0..rings {
        for s in 0..segments {
            let at = |r: u32, s: u32| r * segments + s % segments;
            if r > 0 {
                mesh.triangles.push([at(r, s), at(r + 1, s), at(r, s + 1)]);
            }
            if r + 1 < rings {
                mesh.triangles.push([at(r, s + 1), at(r + 1, s), at(r + 1, s + 1)]);
            }
        }
    }
    mesh
}

/// A box of six patches, each a grid of `n` x `n` quads with its own vertices and normals, as CAD exporters write it.
pub fn patched_box(n: u32) -> SourceMesh {
    let mut mesh = SourceMesh { name: "box".into(), ..SourceMesh::default() };
    for axis in 0..3 {
        for side in [0.0f32, 1.0] {
            let base = mesh.positions.len() as u32;
            for i in 0..=n {
                for j in 0..=n {
                    let mut p = [0.0; 3];
                    p[axis] = side;
                    p[(axis + 1) % 3] = i as f32 / n as f32;
                    p[(axis + 2) % 3] = j as f32 / n as f32;
                    let mut normal = [0.0; 3];
                    normal[axis] = if side > 0.0 { 1.0 } else { -1.0 };
                    mesh.positions.push(p);
                    mesh.normals.push(normal);
                }
            }
            for i in 0..n {
                for j in 0..n {
                    let at = |i: u32, j: u32| base + i * (n + 1) + j;
                    let (mut a, mut b) = (
                        [at(i, j), at(i + 1, j), at(i + 1, j + 1)],
                        [at(i, j), at(i + 1, j + 1), at(i, j + 1)],
                    );
                    if side == 0.0 {
                        a.swap(1, 2);
                        b.swap(1, 2);
                    }
                    mesh.triangles.extend([a, b]);
                }
            }
        }
    }
    mesh
}

/// A square block with a round hole through it and bevelled edges, closed, in faces of right and half right angles, of
/// `around` x 40 quads without normals; `around` is a multiple of 8.
pub fn bracket(around: u32) -> SourceMesh {
    // Along the profile: how square, half the width, the height; between them so many steps.
    let profile: [([f32; 3], u32); 6] = [
        ([0.0, 0.5, 0.0], 8),
        ([0.0, 0.5, 0.5], 8),
        ([1.0, 0.9, 0.5], 4),
        ([1.0, 1.0, 0.4], 8),
        ([1.0, 1.0, 0.1], 4),
        ([1.0, 0.9, 0.0], 8),
    ];
    let rings: Vec<[f32; 3]> = (0..6)
        .flat_map(|i| {
            let ((from, steps), (to, _)) = (profile[i], profile[(i + 1) % 6]);
            (0..steps)
                .map(move |j| std::array::from_fn(|k| from[k] + (to[k] - from[k]) * j as f32 / steps as f32))
        })
        .collect();
    let mut mesh = SourceMesh { name: "bracket".into(), ..SourceMesh::default() };
    for [square, half, z] in &rings {
        for k in 0..around {
            let (sin, cos) = (std::f32::consts::TAU * k as f32 / around as f32).sin_cos();
            let to_square = 1.0 / cos.abs().max(sin.abs());
            let radius = half * (1.0 + (to_square - 1.0) * square);
            mesh.positions.push([radius * cos, radius * sin, *z]);
        }
    }
    let count = rings.len() as u32;
    for (i, k) in (0..count).flat_map(|i| (0..around).map(move |k| (i, k))) {
        let at = |i: u32, k: u32| i % count * around + k % around;
        let [a, b, c, d] = [at(i, k), at(i, k + 1), at(i + 1, k + 1), at(i + 1, k)];
        mesh.triangles.extend([[a, b, c], [a, c, d]]);
    }
    mesh
}

/// An open height field of `n` x `n` quads with bumps.
pub fn height_field(n: u32) -> SourceMesh {
    let mut mesh = SourceMesh { name: "field".into(), ..SourceMesh::default() };
    for i in 0..=n {
        for j in 0..=n {
            let (x, y) = (i as f32 / n as f32, j as f32 / n as f32);
            mesh.positions.push([x, y, 0.1 * (9.0 * x).sin() * (7.0 * y).cos()]);
            mesh.normals.push([0.0, 0.0, 1.0]);
        }
    }
    for i in 0..n {
        for j in 0..n {
            let at = |i: u32, j: u32| i * (n + 1) + j;
            mesh.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            mesh.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    mesh
}

/// Bakes a file and opens the container.
pub fn baked(source: &Path) -> Arc<Scene> {
    baked_with(source, &BakeOptions::default())
}

/// Bakes a file in a certain way and opens the container.
pub fn baked_with(source: &Path, options: &BakeOptions) -> Arc<Scene> {
    let folder = tempfile::tempdir().unwrap();
    let container = folder.path().join("model.clps");
    bake(&[source.to_owned()], &container, options, &BakeProgress::default()).unwrap();
    Arc::new(Scene::open(&container).unwrap())
}

/// Bakes a model that places each mesh so often in a row along x, `apart` from each other, from `start` on; each placement
/// has a node of its own.
pub fn placed_in_a_row(mesh: &SourceMesh, count: u32, apart: f64, start: DVec3) -> Arc<Scene> {
    let node = |i: u32| Node { name: format!("place {i}"), parent: None };
    let place = |i: u32| Instance {
        mesh: 0,
        node: i,
        material: 0,
        world_from_part: DAffine3::from_translation(start + DVec3::X * apart * f64::from(i)),
    };
    let model = Model {
        meshes: vec![mesh.clone()],
        instances: (0..count).map(place).collect(),
        nodes: (0..count).map(node).collect(),
        materials: vec![Material::default()],
        notes: Vec::new(),
    };
    baked_model(model)
}

/// Bakes a model and opens the container.
pub fn baked_model(model: Model) -> Arc<Scene> {
    let folder = tempfile::tempdir().unwrap();
    let container = folder.path().join("model.clps");
    let (options, progress) = (BakeOptions::default(), BakeProgress::default());
    bake_source(&Loaded::new(model), &container, &options, &progress).unwrap();
    Arc::new(Scene::open(&container).unwrap())
}

/// Bakes meshes, their positions and triangles only, beside each other along x.
pub fn baked_meshes(meshes: &[SourceMesh]) -> Arc<Scene> {
    baked_meshes_with(meshes, &BakeOptions::default())
}

/// As [`baked_meshes`], in a certain way.
pub fn baked_meshes_with(meshes: &[SourceMesh], options: &BakeOptions) -> Arc<Scene> {
    let mut text = String::new();
    let mut base = 1;
    for (number, mesh) in meshes.iter().enumerate() {
        writeln!(text, "o mesh{number}").unwrap();
        for [x, y, z] in &mesh.positions {
            writeln!(text, "v {} {y} {z}", x + 1.5 * number as f32).unwrap();
        }
        for [a, b, c] in mesh.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + base)) {
            writeln!(text, "f {a} {b} {c}").unwrap();
        }
        base += mesh.positions.len() as u32;
    }
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("meshes.obj");
    std::fs::write(&source, text).unwrap();
    baked_with(&source, options)
}
