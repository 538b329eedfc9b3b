//! What the user does to a picture: picks, looks, sections, projections, each on the real renderer.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that cannot set up its scene should fail loudly"
)]

mod common;

use std::f64::consts::FRAC_PI_4;
use std::sync::Arc;
use std::time::Instant;

use collapsar::frame::{Renderer, Settings};
use collapsar::geometry::Closure;
use collapsar::gpu::{Gpu, GpuOptions};
use collapsar::import::{Instance, Material, Model, Node};
use collapsar::passes::draw::{Edges, Look, Section, Style};
use collapsar::scene::camera::Parallel;
use collapsar::scene::views::{self, Projection, StandardView, UpAxis};
use collapsar::scene::{Bounds, Camera, Scene};
use collapsar::stats::FrameRecord;
use common::gpu;
use common::metric::{Difference, SAME};
use glam::{DAffine3, DQuat, DVec3};

const SIZE: u32 = 200;

fn settings() -> Settings {
    Settings { budget_vertices: 200_000, width: SIZE, height: SIZE, samples: 4, ..Settings::default() }
}

/// Spheres of radius 1 in a row along x, 3 apart.
fn spheres(count: u32) -> Arc<Scene> {
    spheres_at(count, DVec3::ZERO)
}

fn spheres_at(count: u32, start: DVec3) -> Arc<Scene> {
    common::placed_in_a_row(&common::sphere(24, 48), count, 3.0, start)
}

fn front(scene: &Scene) -> Camera {
    views::fit(
        scene.bounds(),
        scene.bounds(),
        StandardView::Front.orientation(UpAxis::Y),
        Projection::Parallel,
        1.0,
    )
}

/// Draws until nothing changes any more.
fn settle(renderer: &mut Renderer, camera: &Camera) -> FrameRecord {
    (0..6).map(|_| renderer.frame(camera).unwrap()).last().unwrap()
}

fn pixels(renderer: &Renderer) -> Vec<[u8; 4]> {
    let gpu = renderer.gpu();
    let rgba = renderer.target().read_rgba(&gpu.device, &gpu.queue).unwrap();
    rgba.as_chunks().0.to_vec()
}

/// Where a point is in the picture.
fn pixel_of(camera: &Camera, point: DVec3) -> [u32; 2] {
    let clip = camera.clip_from_relative(1.0) * (point - camera.eye).as_vec3().extend(1.0);
    let at = |ndc: f32| ((0.5 + 0.5 * ndc) * SIZE as f32) as u32;
    [at(clip.x / clip.w), at(-clip.y / clip.w)]
}

/// Where the ray through the middle of a pixel starts, and its direction.
fn ray(camera: &Camera, [x, y]: [u32; 2]) -> (DVec3, DVec3) {
    let ndc = |pixel: u32| 2.0 * (f64::from(pixel) + 0.5) / f64::from(SIZE) - 1.0;
    let half = match camera.parallel {
        Some(parallel) => 0.5 * parallel.height,
        None => (0.5 * camera.vertical_fov_radians).tan(),
    };
    let (right, up) = (camera.right() * ndc(x) * half, camera.up() * -ndc(y) * half);
    match camera.parallel {
        Some(parallel) => (camera.eye + right + up - camera.forward() * parallel.reach, camera.forward()),
        None => (camera.eye, (camera.forward() + right + up).normalize()),
    }
}

/// How far a ray from the eye through the middle of a pixel goes until it meets a sphere of radius 1.
fn on_sphere(camera: &Camera, at: [u32; 2], centre: DVec3) -> Option<DVec3> {
    let (start, direction) = ray(camera, at);
    let towards = centre - start;
    let along = towards.dot(direction);
    let beside2 = towards.length_squared() - along * along;
    (beside2 < 1.0).then(|| start + direction * (along - (1.0 - beside2).sqrt()))
}

#[test]
fn a_pick_finds_the_instance_and_the_point_that_a_ray_meets() {
    let Some(gpu) = gpu("a_pick_finds_the_instance_and_the_point_that_a_ray_meets") else { return };
    let scene = spheres(4);
    let perspective =
        Camera::look_at(DVec3::new(-4.0, 3.0, 9.0), DVec3::new(5.0, 0.0, 0.0), DVec3::Y, FRAC_PI_4, 0.01);
    for camera in [perspective, front(&scene)] {
        let mut renderer = Renderer::new(Arc::clone(&gpu), Arc::clone(&scene), settings()).unwrap();
        settle(&mut renderer, &camera);
        let (mut hits, mut misses, mut normals) = (0, 0, 0);
        for at in (0..SIZE * SIZE).step_by(97).map(|i| [i % SIZE, i / SIZE]) {
            let centre = |i: u32| DVec3::X * 3.0 * f64::from(i);
            let met = (0..4).filter_map(|i| Some((i, on_sphere(&camera, at, centre(i))?)));
            let nearest = met.min_by(|a, b| {
                let depth = |point: DVec3| (point - camera.eye).dot(camera.forward());
                depth(a.1).total_cmp(&depth(b.1))
            });
            let found = renderer.pick(at).unwrap();
            // Within a few per cent of the silhouette facets and spheres differ.
            let Some((instance, point)) = nearest else {
                misses += usize::from(found.is_none());
                continue;
            };
            let facing =
                (point - centre(instance)).dot(camera.eye - point).abs() / (camera.eye - point).length();
            if facing < 0.3 && camera.parallel.is_none() {
                continue;
            }
            if let Some(found) = found {
                hits += 1;
                assert_eq!(found.instance, instance, "{at:?}");
                assert!((found.point - point).length() < 0.06, "{at:?}: {} {point}", found.point);
                if facing > 0.6 {
                    let normal = renderer.normal_at(at, &found).unwrap().unwrap();
                    // The facets of the spheres are a few degrees wide.
                    let off = normal.angle_between(point - centre(instance)).to_degrees();
                    assert!(off < 12.0, "{at:?}: {normal} is off by {off} degrees");
                    normals += 1;
                }
            }
        }
        assert!(hits > 10 && misses > 10 && normals > 5, "{hits} {misses} {normals}");
        assert_eq!(renderer.pick([SIZE, 0]).unwrap(), None);
    }
}

#[test]
fn hiding_and_colouring_send_no_geometry_and_take_one_frame() {
    let Some(gpu) = gpu("hiding_and_colouring_send_no_geometry_and_take_one_frame") else { return };
    let scene = spheres(5);
    let camera = front(&scene);
    let mut renderer = Renderer::new(gpu, Arc::clone(&scene), settings()).unwrap();
    settle(&mut renderer, &camera);
    let all = pixels(&renderer);
    let at = |i: u32| pixel_of(&camera, DVec3::X * 3.0 * f64::from(i));
    let mut looks = vec![Look::default(); 5];
    for (change, hidden) in [
        (Look::HIDDEN, [false, true, false, false, false]),
        (Look::coloured([255, 0, 255, 255]), [false; 5]),
        (Look::GHOST, [false; 5]),
        (Look::default(), [false; 5]),
    ] {
        looks[1] = change;
        renderer.set_looks(&looks);
        let record = renderer.frame(&camera).unwrap();
        let geometry = record.streamed_vertices + record.streamed_triangles + record.streamed_ecol;
        assert_eq!((geometry, record.compute_passes, record.disk_bytes), (0, 0, 0), "{change:?}");
        let picture = pixels(&renderer);
        for i in 0..5 {
            let picked = renderer.pick(at(i)).unwrap().map(|pick| pick.instance);
            assert_eq!(picked, (!hidden[i as usize]).then_some(i), "{change:?}");
            let [x, y] = at(i);
            let place = (y * SIZE + x) as usize;
            let is_same = picture[place] == all[place];
            assert_eq!(is_same, i != 1 || change == Look::default(), "{change:?} at {i}");
        }
    }
    assert_eq!(pixels(&renderer), all);
}

#[test]
fn sections_cut_and_close_what_they_cut_at_any_level_of_detail() {
    let Some(gpu) = gpu("sections_cut_and_close_what_they_cut_at_any_level_of_detail") else { return };
    for gpu in [gpu, without(wgpu::Features::CLIP_DISTANCES)] {
        sections_are_closed(&gpu);
    }
}

/// A device that lacks something.
fn without(features: wgpu::Features) -> Arc<Gpu> {
    let gpu = Gpu::new(&GpuOptions { without: features, ..GpuOptions::default() }).unwrap();
    assert!(!gpu.device.features().intersects(features));
    Arc::new(gpu)
}

#[test]
fn without_a_stencil_sections_cut_and_leave_open_what_they_cut() {
    let Some(gpu) = gpu("without_a_stencil_sections_cut_and_leave_open_what_they_cut") else { return };
    let scene = spheres(1);
    let camera = front(&scene);
    let [x, y] = pixel_of(&camera, DVec3::ZERO);
    let section = Section { point: DVec3::new(0.0, 0.0, 0.01), normal: DVec3::NEG_Z };
    let picked = [gpu, without(wgpu::Features::DEPTH32FLOAT_STENCIL8)].map(|gpu| {
        let mut renderer = Renderer::new(gpu, Arc::clone(&scene), settings()).unwrap();
        renderer.set_style(Style { sections: vec![section], depth_cue: 1.0, ..Style::default() });
        settle(&mut renderer, &camera);
        renderer.pick([x, y]).unwrap().unwrap().point.z
    });
    // The face of the cut, and the inner side of the back.
    assert!((picked[0] - 0.01).abs() < 1e-3 && (picked[1] + 1.0).abs() < 1e-2, "{picked:?}");
}

#[test]
fn cut_faces_follow_the_camera_beside_ghosts_and_with_any_number_of_sections() {
    let Some(gpu) = gpu("cut_faces_follow_the_camera_beside_ghosts_and_with_any_number_of_sections") else {
        return;
    };
    let scene = spheres(2);
    let behind = StandardView::Back.orientation(UpAxis::Y);
    let behind = views::fit(scene.bounds(), scene.bounds(), behind, Projection::Parallel, 1.0);
    let cameras = [(front(&scene), 0.01), (behind, -1.0), (front(&scene), 0.01)];
    let mut renderer = Renderer::new(gpu, Arc::clone(&scene), settings()).unwrap();
    for (sections, other) in [(1, Look::default()), (9, Look::default()), (1, Look::GHOST), (9, Look::GHOST)]
    {
        renderer.set_looks(&[Look::default(), other]);
        let section = |i: u32| Section { point: DVec3::Z * 0.01 * f64::from(i + 1), normal: DVec3::NEG_Z };
        renderer.set_style(Style { sections: (0..sections).map(section).collect(), ..Style::default() });
        for (camera, expected) in &cameras {
            settle(&mut renderer, camera);
            let pick = renderer.pick(pixel_of(camera, DVec3::ZERO)).unwrap().unwrap();
            let z = pick.point.z;
            assert!((z - expected).abs() < 1e-2, "{sections} sections, {other:?}: {z} for {expected}");
        }
    }
}

fn sections_are_closed(gpu: &Arc<Gpu>) {
    let scene = spheres(1);
    assert_eq!(scene.parts()[0].closure(), Closure::Closed);
    let camera = front(&scene);
    let [x, y] = pixel_of(&camera, DVec3::ZERO);
    let radius = f64::from(pixel_of(&camera, DVec3::X)[0] - x);
    for budget_vertices in [200_000, 200, 60] {
        for samples in [1, 4] {
            let settings = Settings { budget_vertices, samples, ..settings() };
            let mut renderer = Renderer::new(Arc::clone(gpu), Arc::clone(&scene), settings).unwrap();
            let whole = settle(&mut renderer, &camera);
            assert!(whole.active_triangles > 0);
            let looks = [Look::coloured([255, 0, 0, 255])];
            renderer.set_looks(&looks);
            // The front half goes: what is seen is the face of the cut.
            let section = Section { point: DVec3::new(0.0, 0.0, 0.01), normal: DVec3::NEG_Z };
            renderer.set_style(Style { sections: vec![section], ..Style::default() });
            let record = renderer.frame(&camera).unwrap();
            assert_eq!(record.streamed_triangles, 0);
            let picture = pixels(&renderer);
            for place in 0..SIZE * SIZE {
                let (dx, dy) =
                    (f64::from(place % SIZE) - f64::from(x), f64::from(place / SIZE) - f64::from(y));
                let distance = dx.hypot(dy);
                let is_red = picture[place as usize][0] > picture[place as usize][1];
                // A coarse sphere fills its circle only in part, but without holes.
                let inside = if budget_vertices < 1000 { 0.5 } else { 0.93 };
                if distance < inside * radius {
                    assert!(is_red, "{budget_vertices} {samples}: a hole at {dx} {dy}");
                } else if distance > radius + 2.0 {
                    assert!(!is_red, "{budget_vertices} {samples}: something at {dx} {dy}");
                }
            }
            // The face is flat: everything that is picked on it lies on the plane.
            for at in [[x, y], [x + (0.4 * radius) as u32, y], [x, y - (0.3 * radius) as u32]] {
                let pick = renderer.pick(at).unwrap().unwrap();
                assert!((pick.point.z - 0.01).abs() < 1e-4, "{}", pick.point);
            }
        }
    }
}

#[test]
fn a_slab_out_of_a_part_is_closed_though_no_surface_is_left_in_it() {
    let Some(gpu) = gpu("a_slab_out_of_a_part_is_closed_though_no_surface_is_left_in_it") else { return };
    let in_cells = common::placed_in_a_row(&common::sphere(200, 400), 1, 3.0, DVec3::ZERO);
    assert!(in_cells.instances().len() > 2 && in_cells.parts()[0].closure() == Closure::Closed);
    for scene in [spheres(1), in_cells] {
        let camera = front(&scene);
        let [x, y] = pixel_of(&camera, DVec3::ZERO);
        let radius = f64::from(pixel_of(&camera, DVec3::X)[0] - x);
        let mut renderer = Renderer::new(Arc::clone(&gpu), Arc::clone(&scene), settings()).unwrap();
        renderer.set_looks(&vec![Look::coloured([255, 0, 0, 255]); scene.instances().len()]);
        let face =
            |z: f64, towards: f64| Section { point: DVec3::new(0.0, 0.0, z), normal: DVec3::Z * towards };
        let sections = vec![face(0.02, -1.0), face(-0.02, 1.0)];
        renderer.set_style(Style { sections: sections.clone(), ..Style::default() });
        settle(&mut renderer, &camera);
        let picture = pixels(&renderer);
        for place in 0..SIZE * SIZE {
            let (dx, dy) = (f64::from(place % SIZE) - f64::from(x), f64::from(place / SIZE) - f64::from(y));
            let is_red = picture[place as usize][0] > picture[place as usize][1];
            let distance = dx.hypot(dy);
            assert!(is_red || distance > 0.93 * radius, "a hole at {dx} {dy}");
            assert!(!is_red || distance < radius + 2.0, "something at {dx} {dy}");
        }
        let pick = renderer.pick([x, y]).unwrap().unwrap();
        assert!((pick.point.z - 0.02).abs() < 1e-4, "{}", pick.point);
        // What comes after sees a plane, not the backs behind it.
        renderer.set_style(Style { sections, depth_cue: 1.0, ..Style::default() });
        renderer.frame(&camera).unwrap();
        let cued = pixels(&renderer);
        assert!(cued != picture, "an edge has a cue");
        for (dx, dy) in (-40i32..40).flat_map(|dx| (-40i32..40).map(move |dy| (dx, dy))) {
            let at = (y.wrapping_add_signed(dy) * SIZE + x.wrapping_add_signed(dx)) as usize;
            assert_eq!(cued[at], picture[at], "{dx} {dy}");
        }
    }
}

#[test]
fn a_section_box_shows_its_faces_where_it_lies_within_a_part() {
    let Some(gpu) = gpu("a_section_box_shows_its_faces_where_it_lies_within_a_part") else { return };
    let plain = without(wgpu::Features::CLIP_DISTANCES);
    for (gpu, samples) in [(&gpu, 1), (&gpu, 4), (&plain, 4)] {
        for projection in [Projection::Perspective(FRAC_PI_4), Projection::Parallel] {
            let settings = Settings { samples, ..settings() };
            a_section_box_is_shut(gpu, projection, settings);
        }
    }
}

fn a_section_box_is_shut(gpu: &Arc<Gpu>, projection: Projection, settings: Settings) {
    let scene = spheres(1);
    let orientation = StandardView::Iso.orientation(UpAxis::Y);
    let camera = views::fit(scene.bounds(), scene.bounds(), orientation, projection, 1.0);
    let mut renderer = Renderer::new(Arc::clone(gpu), Arc::clone(&scene), settings).unwrap();
    renderer.set_looks(&[Look::coloured([255, 0, 0, 255])]);
    let inner = Bounds { low: DVec3::splat(-0.4), high: DVec3::splat(0.4) };
    renderer.set_style(Style { sections: Section::inside(&inner).to_vec(), ..Style::default() });
    settle(&mut renderer, &camera);
    let picture = pixels(&renderer);
    let corners = (0..8).map(|i| {
        let side = |bit: u32| if i >> bit & 1 == 0 { -0.4 } else { 0.4 };
        pixel_of(&camera, DVec3::new(side(0), side(1), side(2)))
    });
    let all: Vec<_> = corners.collect();
    let extent = |axis: usize| {
        let along = all.iter().map(|corner| corner[axis]);
        along.clone().min().unwrap() - 1..=along.max().unwrap() + 1
    };
    // Every ray through the box meets it where it lies within the sphere; nothing else is left.
    for place in 0..SIZE * SIZE {
        let at = [place % SIZE, place / SIZE];
        let is_red = picture[place as usize][0] > picture[place as usize][1];
        let is_beside = (0..2).any(|axis| !extent(axis).contains(&at[axis]));
        assert!(!(is_red && is_beside), "something at {at:?}");
        let (start, direction) = ray(&camera, at);
        // But for a pixel at its edges.
        let [from, to] = [-0.39, 0.39].map(|side| (DVec3::splat(side) - start) / direction);
        let met = from.min(to).max_element() < from.max(to).min_element();
        assert!(is_red || !met, "a hole at {at:?}");
        if met && at[0].is_multiple_of(16) && at[1].is_multiple_of(16) {
            let pick = renderer.pick(at).unwrap().unwrap();
            let off = (pick.point.abs().max_element() - 0.4).abs();
            assert!(off < 1e-4, "{} is not on a face", pick.point);
        }
    }
}

/// Two boxes, turned alike, of which the second's face is where the first's is.
fn touching(turn: DQuat, mirrored: bool) -> Arc<Scene> {
    let side = if mirrored { -1.0 } else { 1.0 };
    let place = |i: u32| Instance {
        mesh: i,
        node: i,
        material: 0,
        world_from_part: DAffine3::from_scale_rotation_translation(
            DVec3::new(side, 1.0, 1.0),
            turn,
            turn * DVec3::new(0.0, 0.0, -2.0 * f64::from(i)),
        ),
    };
    // Of another size across, so that the two are on grids of their own.
    let shape = |i: u32| {
        let mut mesh = common::patched_box(1);
        let wide = 1.0 + 0.37 * i as f32;
        for [x, y, z] in &mut mesh.positions {
            [*x, *y, *z] = [wide * (2.0 * *x - 1.0), wide * (2.0 * *y - 1.0), 2.0 * *z - 1.0];
        }
        mesh
    };
    common::baked_model(Model {
        meshes: (0..2).map(shape).collect(),
        instances: (0..2).map(place).collect(),
        nodes: (0..2).map(|i| Node { name: format!("box {i}"), parent: None }).collect(),
        materials: vec![Material::default()],
        notes: Vec::new(),
    })
}

#[test]
fn a_cut_face_hides_what_touches_its_part_from_behind() {
    let Some(gpu) = gpu("a_cut_face_hides_what_touches_its_part_from_behind") else { return };
    let plain = without(wgpu::Features::CLIP_DISTANCES);
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.31, 0.47, 0.11);
    for (gpu, samples) in [(&gpu, 1), (&gpu, 4), (&plain, 1)] {
        let perspective = Projection::Perspective(FRAC_PI_4);
        for (projection, mirrored) in
            [(perspective, false), (Projection::Parallel, false), (perspective, true)]
        {
            let scene = touching(turn, mirrored);
            assert_eq!(scene.parts()[0].closure(), Closure::Closed);
            let orientation = StandardView::Front.orientation(UpAxis::Y);
            let camera = views::fit(scene.bounds(), scene.bounds(), orientation, projection, 1.0);
            let settings = Settings { samples, ..settings() };
            let mut renderer = Renderer::new(Arc::clone(gpu), Arc::clone(&scene), settings).unwrap();
            renderer.set_looks(&[Look::coloured([255, 0, 0, 255]), Look::coloured([0, 0, 255, 255])]);
            let section = Section { point: turn * DVec3::Z * 0.4, normal: turn * DVec3::NEG_Z };
            renderer.set_style(Style { sections: vec![section], ..Style::default() });
            settle(&mut renderer, &camera);
            let picture = pixels(&renderer);
            renderer.set_style(Style { sections: vec![section], depth_cue: 1.0, ..Style::default() });
            renderer.frame(&camera).unwrap();
            let cued = pixels(&renderer);
            // Well within the face of the cut.
            for (u, v) in (0..80).flat_map(|i| (0..80).map(move |j| (i, j))) {
                let across = |i: i32| f64::from(i) / 79.0 * 1.6 - 0.8;
                let point = turn * DVec3::new(across(u), across(v), 0.4);
                let at = pixel_of(&camera, point);
                let place = (at[1] * SIZE + at[0]) as usize;
                let [red, _, blue, _] = picture[place];
                let darker = (0..3).map(|i| picture[place][i].abs_diff(cued[place][i])).max();
                assert!(darker < Some(8), "a cue at {at:?}");
                assert!(red > blue, "{samples} {projection:?} {mirrored}: a hole at {at:?}");
                if (u + v) % 20 == 0 {
                    let pick = renderer.pick(at).unwrap().unwrap();
                    assert_eq!(pick.instance, 0, "{samples} {projection:?} {mirrored}: picked at {at:?}");
                }
            }
        }
    }
}

#[test]
fn what_a_section_cuts_away_is_neither_seen_nor_picked() {
    let Some(gpu) = gpu("what_a_section_cuts_away_is_neither_seen_nor_picked") else { return };
    let scene = spheres(3);
    let camera = front(&scene);
    let mut renderer = Renderer::new(gpu, Arc::clone(&scene), settings()).unwrap();
    let sections = vec![
        Section { point: DVec3::X * 1.5, normal: DVec3::X },
        Section { point: DVec3::X * 4.5, normal: DVec3::NEG_X },
    ];
    renderer.set_style(Style { sections, ..Style::default() });
    settle(&mut renderer, &camera);
    let picked = |renderer: &mut Renderer, i: u32| {
        let at = pixel_of(&camera, DVec3::X * 3.0 * f64::from(i));
        renderer.pick(at).unwrap().map(|pick| pick.instance)
    };
    assert_eq!([0, 1, 2].map(|i| picked(&mut renderer, i)), [None, Some(1), None]);
}

#[test]
fn sections_beside_the_model_change_nothing_and_those_at_its_faces_neither() {
    let Some(gpu) = gpu("sections_beside_the_model_change_nothing_and_those_at_its_faces_neither") else {
        return;
    };
    let scene = spheres(3);
    let camera = front(&scene);
    let mut renderer = Renderer::new(gpu, Arc::clone(&scene), settings()).unwrap();
    settle(&mut renderer, &camera);
    let whole = pixels(&renderer);
    let beside = Section { point: DVec3::X * -1.5, normal: DVec3::X };
    let box_of_model = Section::inside(scene.bounds());
    assert!(!beside.cuts(scene.bounds()) && box_of_model.iter().all(|face| !face.cuts(scene.bounds())));
    let grazing = Section { point: DVec3::X * -0.999, normal: DVec3::X };
    assert!(grazing.cuts(scene.bounds()) && Section { normal: DVec3::NEG_X, ..beside }.cuts(scene.bounds()));
    let sections = box_of_model.into_iter().chain([beside]).collect();
    renderer.set_style(Style { sections, ..Style::default() });
    renderer.frame(&camera).unwrap();
    assert!(pixels(&renderer) == whole);
    // More planes than are possible, of which all but one cut nothing: that one does.
    let cut = Section { point: DVec3::X * 1.5, normal: DVec3::X };
    let sections = (0..20).map(|_| beside).chain([cut]).collect();
    renderer.set_style(Style { sections, ..Style::default() });
    renderer.frame(&camera).unwrap();
    assert_eq!(renderer.pick(pixel_of(&camera, DVec3::ZERO)).unwrap(), None);
}

#[test]
fn a_model_far_from_the_origin_looks_the_same() {
    let Some(gpu) = gpu("a_model_far_from_the_origin_looks_the_same") else { return };
    let scene = spheres(3);
    let shift = DVec3::new(1e7, -3e6, 2e6);
    let picture = |scene: &Arc<Scene>, shift: DVec3| {
        let camera = front(scene);
        let mut renderer = Renderer::new(Arc::clone(&gpu), Arc::clone(scene), settings()).unwrap();
        let section = Section { point: shift + DVec3::new(0.0, 0.3, 0.0), normal: DVec3::NEG_Y };
        let style =
            Style { sections: vec![section], edges: Edges::Features, depth_cue: 0.6, ..Style::default() };
        renderer.set_style(style);
        settle(&mut renderer, &camera);
        let pick = renderer.pick(pixel_of(&camera, shift + DVec3::X * 3.0)).unwrap().unwrap();
        (pixels(&renderer), pick.point - shift)
    };
    let (near, near_point) = picture(&scene, DVec3::ZERO);
    let far_scene = spheres_at(3, shift);
    let (far, far_point) = picture(&far_scene, shift);
    assert!((near_point - far_point).length() < 1e-3, "{near_point} {far_point}");
    assert_same("spheres", &near, &far);
}

/// How much two pictures differ, by the measure by which pictures are compared with their input.
fn difference(a: &[[u8; 4]], b: &[[u8; 4]]) -> Difference {
    let [a, b] = [a, b].map(|pixels| {
        let rgb = pixels.iter().flat_map(|[red, green, blue, _]| [*red, *green, *blue]).collect();
        image::RgbImage::from_raw(SIZE, SIZE, rgb).unwrap()
    });
    Difference::between(&a, &b)
}

#[track_caller]
fn assert_same(what: &str, a: &[[u8; 4]], b: &[[u8; 4]]) {
    let difference = difference(a, b);
    println!("{what}: {difference:?}");
    assert!(difference.is_within(&SAME), "{what}: {difference:?}");
}

#[test]
fn an_engine_ten_thousand_kilometres_away_looks_the_same() {
    let Some(gpu) = gpu("an_engine_ten_thousand_kilometres_away_looks_the_same") else { return };
    let model = collapsar::import::read(&[common::bundled("2CylinderEngine.glb")]).unwrap();
    let placed = |shift: DVec3| {
        let mut model = model.clone();
        model.instances.iter_mut().for_each(|instance| instance.world_from_part.translation += shift);
        common::baked_model(model)
    };
    let picture = |shift: DVec3, nudge: f64| {
        let scene = placed(shift);
        let orientation = StandardView::Iso.orientation(UpAxis::Y);
        let bounds = scene.bounds();
        let mut camera = views::fit(bounds, bounds, orientation, Projection::default(), 1.0);
        camera.eye += camera.right() * (nudge * bounds.scale());
        let mut renderer = Renderer::new(Arc::clone(&gpu), scene, settings()).unwrap();
        renderer.set_style(Style { edges: Edges::Features, depth_cue: 0.6, ..Style::default() });
        settle(&mut renderer, &camera);
        pixels(&renderer)
    };
    let near = picture(DVec3::ZERO, 0.0);
    for shift in [DVec3::X * 1e7, DVec3::new(-6e6, 5e6, 6e6)] {
        assert_same("engine", &near, &picture(shift, 0.0));
    }
    // Three pixels beside where it should be are seen.
    let beside = difference(&near, &picture(DVec3::ZERO, 0.015));
    assert!(!beside.is_within(&SAME), "the measure sees nothing: {beside:?}");
}

/// Small spheres of several shapes in a square, each with a node of its own.
fn crowd(shapes: u32, of_each: u32) -> Arc<Scene> {
    let count = shapes * of_each;
    let side = f64::from(count).sqrt().ceil() as u32;
    let place = |i: u32| Instance {
        mesh: i % shapes,
        node: i,
        material: 0,
        world_from_part: DAffine3::from_translation(
            DVec3::new(f64::from(i % side), f64::from(i / side), 0.0) * 2.5,
        ),
    };
    let shape = |i: u32| {
        let mut mesh = common::sphere(3, 5);
        let wide = 0.7 + 0.3 * i as f32 / shapes as f32;
        mesh.positions.iter_mut().for_each(|position| position[0] *= wide);
        mesh
    };
    common::baked_model(Model {
        meshes: (0..shapes).map(shape).collect(),
        instances: (0..count).map(place).collect(),
        nodes: (0..count).map(|i| Node { name: format!("part {i}"), parent: None }).collect(),
        materials: vec![Material::default()],
        notes: Vec::new(),
    })
}

#[test]
fn a_hundred_thousand_parts_are_hidden_isolated_and_coloured_in_the_next_frame() {
    let Some(gpu) = gpu("a_hundred_thousand_parts_are_hidden_isolated_and_coloured_in_the_next_frame") else {
        return;
    };
    let started = Instant::now();
    let scene = crowd(10_000, 10);
    println!("baked in {:.1} s", started.elapsed().as_secs_f64());
    let count = scene.instances().len();
    assert_eq!(count, 100_000);
    let camera = front(&scene);
    // So large that each part has more than a pixel.
    let settings = Settings { budget_vertices: 3_000_000, width: 900, height: 900, samples: 1, ..settings() };
    let mut renderer = Renderer::new(gpu, Arc::clone(&scene), settings).unwrap();
    let record = settle(&mut renderer, &camera);
    assert_eq!(record.instances_visible, count as u64);
    let all = pixels(&renderer);
    let mut show = |what: &str, looks: &[Look]| {
        let started = Instant::now();
        renderer.set_looks(looks);
        let set = started.elapsed();
        let record = renderer.frame(&camera).unwrap();
        let ms = |time: std::time::Duration| 1e3 * time.as_secs_f64();
        println!(
            "{what}: {:.2} ms to set the looks, {:.1} ms with the frame",
            ms(set),
            ms(started.elapsed())
        );
        let geometry = record.streamed_vertices + record.streamed_triangles + record.streamed_ecol;
        assert_eq!((geometry, record.compute_passes, record.disk_bytes), (0, 0, 0), "{what}");
        pixels(&renderer)
    };
    let differing = |a: &[[u8; 4]], b: &[[u8; 4]]| a.iter().zip(b).filter(|(a, b)| a != b).count();
    let none = show("hide all", &vec![Look::HIDDEN; count]);
    let of_model = differing(&all, &none);
    assert!(of_model > all.len() / 6, "{of_model} pixels show the model");
    let mut looks = vec![Look::HIDDEN; count];
    looks[..count / 2].fill(Look::default());
    let half = show("isolate half", &looks);
    let share = differing(&half, &none) as f64 / of_model as f64;
    assert!((0.45..0.55).contains(&share), "{share} of the model is shown");
    let red = show("colour all", &vec![Look::coloured([255, 0, 0, 255]); count]);
    let coloured = red.iter().filter(|pixel| pixel[0] > pixel[1].saturating_add(20)).count();
    assert!(coloured * 10 > of_model * 9, "{coloured} of {of_model} pixels are red");
    let ghosts = show("ghost all", &vec![Look::GHOST; count]);
    assert!(differing(&ghosts, &all) > of_model / 2);
    let again = show("show all", &vec![Look::default(); count]);
    assert!(again == all, "{} pixels are not as they were", differing(&again, &all));
}

#[test]
fn edges_depth_cues_and_projections_draw_what_they_say() {
    let Some(gpu) = gpu("edges_depth_cues_and_projections_draw_what_they_say") else { return };
    let mesh = common::patched_box(4);
    let scene = common::baked_meshes(&[mesh]);
    let camera = views::fit(
        scene.bounds(),
        scene.bounds(),
        StandardView::Iso.orientation(UpAxis::Y),
        Projection::default(),
        1.0,
    );
    let picture = |edges: Edges, camera: &Camera| {
        let mut renderer = Renderer::new(Arc::clone(&gpu), Arc::clone(&scene), settings()).unwrap();
        renderer.set_style(Style { edges, ..Style::default() });
        settle(&mut renderer, camera);
        pixels(&renderer)
    };
    let parallel = Camera {
        parallel: Some(Parallel { height: 1.8, reach: 20.0 }),
        eye: scene.bounds().centre(),
        ..camera
    };
    for camera in [camera, parallel] {
        let plain = picture(Edges::None, &camera);
        let [features, all] = [Edges::Features, Edges::All].map(|edges| {
            let lined = picture(edges, &camera);
            lined.iter().zip(&plain).filter(|(a, b)| u32::from(a[1]) + 25 < u32::from(b[1])).count()
        });
        assert!(100 < features && features < all, "{features} {all}");
    }
    let lit = |depth_cue| {
        let mut renderer = Renderer::new(Arc::clone(&gpu), spheres(3), settings()).unwrap();
        renderer.set_style(Style { depth_cue, ..Style::default() });
        let camera = Camera::look_at(DVec3::new(-6.0, 1.0, 1.0), DVec3::X * 3.0, DVec3::Y, FRAC_PI_4, 0.01);
        settle(&mut renderer, &camera);
        pixels(&renderer).iter().map(|pixel| u64::from(pixel[1])).sum::<u64>()
    };
    assert!(lit(1.0) < lit(0.0));
}

#[test]
fn what_is_hidden_leaves_its_budget_to_the_rest_once_the_camera_moves() {
    let Some(gpu) = gpu("what_is_hidden_leaves_its_budget_to_the_rest_once_the_camera_moves") else { return };
    let scene = spheres(5);
    let camera = front(&scene);
    let settings = Settings { budget_vertices: 1500, ..settings() };
    let mut renderer = Renderer::new(gpu, Arc::clone(&scene), settings).unwrap();
    settle(&mut renderer, &camera);
    let of_middle = |renderer: &Renderer| renderer.states()[2].vertices;
    let before = of_middle(&renderer);
    let mut looks = vec![Look::HIDDEN; 5];
    looks[2] = Look::default();
    renderer.set_looks(&looks);
    settle(&mut renderer, &camera);
    assert_eq!(of_middle(&renderer), before);
    let moved = Camera { eye: camera.eye + DVec3::Y * 0.1, ..camera };
    settle(&mut renderer, &moved);
    assert!(of_middle(&renderer) > 2 * before, "{before} {}", of_middle(&renderer));
    assert_eq!(renderer.states()[0].vertices, 0);
    renderer.set_looks(&[Look::default(); 5]);
    let record = settle(&mut renderer, &moved);
    assert_eq!(record.instances_visible, 5);
    assert!(renderer.states().iter().all(|state| state.vertices > 0));
}

#[test]
fn what_sections_take_wholly_is_as_if_it_were_hidden() {
    let Some(gpu) = gpu("what_sections_take_wholly_is_as_if_it_were_hidden") else { return };
    let scene = spheres(5);
    let camera = front(&scene);
    // Batches of two or three instances, so that ranges are of the right ones.
    for (batch_limit_bytes, edges) in [(None, Edges::None), (Some(150_000), Edges::None), (None, Edges::All)]
    {
        let settings = Settings { batch_limit_bytes, ..settings() };
        let mut renderer = Renderer::new(Arc::clone(&gpu), Arc::clone(&scene), settings).unwrap();
        let style = Style { edges, ..Style::default() };
        renderer.set_style(style.clone());
        settle(&mut renderer, &camera);
        let whole = pixels(&renderer);
        assert_eq!(renderer.batch_count() > 1, batch_limit_bytes.is_some());
        let mut looks = vec![Look::default(); 5];
        (looks[0], looks[3], looks[4]) = (Look::HIDDEN, Look::HIDDEN, Look::HIDDEN);
        renderer.set_looks(&looks);
        renderer.frame(&camera).unwrap();
        let hidden = pixels(&renderer);
        renderer.set_looks(&[Look::default(); 5]);
        let between = |x: f64, towards: f64| Section { point: DVec3::X * x, normal: DVec3::X * towards };
        renderer.set_style(Style { sections: vec![between(1.5, 1.0), between(7.5, -1.0)], ..style.clone() });
        let record = renderer.frame(&camera).unwrap();
        assert!(pixels(&renderer) == hidden, "{edges:?} {batch_limit_bytes:?}");
        assert_eq!((record.bytes_vertices, record.bytes_triangles, record.compute_passes), (0, 0, 0));
        // One that is cut beside one that is not.
        renderer.set_style(Style { sections: vec![between(3.0, 1.0)], ..style });
        renderer.frame(&camera).unwrap();
        let picked = [-0.5, 2.5, 3.5, 6.0, 12.0]
            .map(|x| renderer.pick(pixel_of(&camera, DVec3::X * x)).unwrap().map(|pick| pick.instance));
        assert_eq!(picked, [None, None, Some(1), Some(2), Some(4)]);
        let cut = pixels(&renderer);
        let from = pixel_of(&camera, DVec3::X * 4.5)[0];
        let is_right = |i: &usize| *i as u32 % SIZE >= from;
        assert!((0..cut.len()).filter(is_right).all(|i| cut[i] == whole[i]), "what is kept looks as ever");
    }
}

#[test]
fn what_sections_take_wholly_leaves_its_budget_to_the_rest_once_the_camera_moves() {
    let Some(gpu) = gpu("what_sections_take_wholly_leaves_its_budget_to_the_rest_once_the_camera_moves")
    else {
        return;
    };
    let scene = spheres(5);
    let camera = front(&scene);
    let settings = Settings { budget_vertices: 1500, ..settings() };
    let mut renderer = Renderer::new(Arc::clone(&gpu), Arc::clone(&scene), settings).unwrap();
    settle(&mut renderer, &camera);
    let of = |renderer: &Renderer, i: usize| renderer.states()[i].vertices;
    let before = of(&renderer, 4);
    let section = Section { point: DVec3::X * 10.5, normal: DVec3::X };
    renderer.set_style(Style { sections: vec![section], ..Style::default() });
    settle(&mut renderer, &camera);
    assert_eq!(of(&renderer, 4), before);
    let moved = Camera { eye: camera.eye + DVec3::Y * 0.1, ..camera };
    settle(&mut renderer, &moved);
    assert!(of(&renderer, 4) > 2 * before, "{before} {}", of(&renderer, 4));
    assert_eq!(of(&renderer, 0), 0);
    // What is drawn follows what is streamed.
    let mut fresh = Renderer::new(gpu, Arc::clone(&scene), settings).unwrap();
    fresh.set_style(Style { sections: vec![section], ..Style::default() });
    settle(&mut fresh, &moved);
    assert_eq!(of(&fresh, 4), of(&renderer, 4));
    assert!(pixels(&fresh) == pixels(&renderer));
    // Both reasons count, and each goes by itself.
    let mut looks = vec![Look::default(); 5];
    looks[1] = Look::HIDDEN;
    renderer.set_looks(&looks);
    renderer.set_style(Style::default());
    settle(&mut renderer, &moved);
    assert_eq!([0, 1, 2].map(|i| of(&renderer, i) > 0), [true, false, true]);
}
