//! The models that are pictured: each as it was imported, and baked.

use std::path::Path;
use std::sync::{Arc, LazyLock};

use collapsar::bake::{BakeOptions, BakeProgress, Loaded, bake_source};
use collapsar::frame::{Renderer, Settings};
use collapsar::geometry::normals::{CREASE_DEGREES, by_crease_angle};
use collapsar::gpu::Gpu;
use collapsar::gpu::target::Target;
use collapsar::import::{self, Instance, Material, Model, Node};
use collapsar::scene::{Camera, CameraPath, Scene};
use collapsar::stats::FrameRecord;
use glam::DAffine3;
use image::{DynamicImage, RgbImage, RgbaImage};

use crate::common::{bracket, bundled, datasets};
use crate::workbench;

/// A model to be pictured.
pub struct Subject {
    /// Its name in reports and golden files.
    pub name: &'static str,
    /// As it was imported, with normals.
    pub model: Model,
    /// What became of it.
    pub scene: Arc<Scene>,
    /// The least scores at a third and at a tenth of its vertices, some way below what was measured when they were
    /// set (the report has today's).
    pub floors: [f64; 2],
}

/// The models that every copy of the project has.
pub static BUNDLED: LazyLock<Vec<Subject>> = LazyLock::new(|| {
    vec![
        Subject::read("engine", &bundled("2CylinderEngine.glb"), [0.85, 0.72]),
        Subject::read("truck", &bundled("peterbilt.obj"), [0.99, 0.96]),
        Subject::new("workbench", workbench::model(), [0.995, 0.985]),
    ]
});

/// A block with sharp edges, of which a quarter must still show all.
pub static BRACKET: LazyLock<Subject> = LazyLock::new(|| {
    let instance = Instance { mesh: 0, node: 0, material: 0, world_from_part: DAffine3::IDENTITY };
    let model = Model {
        nodes: vec![Node { name: "bracket".into(), parent: None }],
        materials: vec![Material::default()],
        meshes: vec![bracket(128)],
        instances: vec![instance],
        ..Model::default()
    };
    Subject::new("bracket", model, [0.99, 0.98])
});

/// Real models, where they are at hand.
pub static REAL: LazyLock<Vec<Subject>> = LazyLock::new(|| {
    let files = [
        ("as1", "gltf/as1-oc-214.glb", [0.99, 0.97]),
        ("duck_bdx", "gltf/duck_bdx.glb", [0.995, 0.99]),
        ("kicad_video", "gltf/kicad_video.glb", [0.95, 0.88]),
        ("koala", "obj/koala.obj", [0.97, 0.92]),
    ];
    let Some(folder) = datasets() else { return Vec::new() };
    files.iter().map(|&(name, file, floors)| Subject::read(name, &folder.join(file), floors)).collect()
});

impl Subject {
    fn read(name: &'static str, path: &Path, floors: [f64; 2]) -> Self {
        let model = import::read(&[path.to_owned()]).unwrap_or_else(|error| panic!("{error}"));
        Self::new(name, model, floors)
    }

    fn new(name: &'static str, mut model: Model, floors: [f64; 2]) -> Self {
        for mesh in &mut model.meshes {
            by_crease_angle(mesh, CREASE_DEGREES);
        }
        let scene = Arc::new(baked(&model));
        Self { name, model, scene, floors }
    }

    /// Vertices of all placed parts, as they are stored.
    pub fn placed_vertices(&self) -> u32 {
        let parts = self.scene.parts();
        self.scene.instances().iter().map(|instance| parts[instance.part as usize].vertices).sum()
    }

    /// A still view and two of an orbit.
    pub fn cameras(&self) -> [Camera; 3] {
        let orbit = |frame| CameraPath::Orbit.camera(frame, 12, self.scene.bounds());
        [self.still(), orbit(3), orbit(8)]
    }

    /// The still view.
    pub fn still(&self) -> Camera {
        CameraPath::Still.camera(0, 1, self.scene.bounds())
    }

    /// What the renderer shows once it has settled at `budget_vertices`, and the record of its last frame.
    pub fn picture(
        &self,
        gpu: &Arc<Gpu>,
        camera: &Camera,
        budget_vertices: u32,
        shot: Shot,
    ) -> (RgbImage, FrameRecord) {
        let settings =
            Settings { budget_vertices, width: shot.width, height: shot.height, ..Settings::default() };
        let mut renderer = Renderer::new(Arc::clone(gpu), Arc::clone(&self.scene), settings).unwrap();
        for _ in 0..20 {
            let record = renderer.frame(camera).unwrap();
            if record.compute_passes == 0 && record.bytes_sent == 0 {
                if self.name == "engine" && shot.width == 640 {
                    let mut v: Vec<_> = renderer
                        .states()
                        .iter()
                        .zip(self.scene.instances())
                        .map(|(s, i)| {
                            let p = &self.scene.parts()[i.part as usize];
                            (p.vertices, s.vertices, s.triangles, p.locked, p.coarsest_triangles, s.tier)
                        })
                        .collect();
                    v.sort();
                    v.reverse();
                }
                return (shot.read(gpu, renderer.target()), record);
            }
        }
        panic!("{}: is still changing after 20 frames at rest", self.name);
    }
}

/// The size of a picture in pixels.
#[derive(Debug, Clone, Copy)]
pub struct Shot {
    /// Its width.
    pub width: u32,
    /// Its height.
    pub height: u32,
}

impl Shot {
    /// Reads the target, which has this size, without its alpha.
    pub fn read(self, gpu: &Gpu, target: &Target) -> RgbImage {
        let rgba = target.read_rgba(&gpu.device, &gpu.queue).unwrap();
        DynamicImage::from(RgbaImage::from_raw(self.width, self.height, rgba).unwrap()).into_rgb8()
    }
}

/// The model, ordered, written and opened.
fn baked(model: &Model) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("subject.clps");
    let source = Loaded::new(model.clone());
    bake_source(&source, &file, &BakeOptions::default(), &BakeProgress::default()).unwrap();
    // The mapping outlives the file's name.
    Scene::open(&file).unwrap()
}
