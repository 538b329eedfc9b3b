//! A camera, with or without perspective, and its eye in f64: matrices, frustum planes and the split of positions for the GPU.
//!
//! World positions stay in f64 on the CPU. What the GPU gets is *camera-relative world space*: the axes of the world
//! with the eye at the origin, where f32 is precise wherever the camera looks closely. View space has +x right, +y
//! up and looks along -z; depth is reversed (1 at the near plane, 0 at infinity), which keeps f32 depth evenly precise.

use glam::{DMat3, DQuat, DVec3, Mat4, Vec3, Vec4};

/// The vertical field of view of the built-in paths: 45 degrees.
pub const DEFAULT_VERTICAL_FOV_RADIANS: f64 = std::f64::consts::FRAC_PI_4;

/// A projection without perspective: the eye is the middle of what is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parallel {
    /// World units between the lower and the upper edge of the picture.
    pub height: f64,
    /// How far in front of the eye and behind it there is something to see, in world units.
    pub reach: f64,
}

/// Where the scene is seen from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// The eye in world space.
    pub eye: DVec3,
    /// Rotates view space into world space; a unit quaternion.
    pub world_from_view: DQuat,
    /// The angle between the upper and the lower edge of the picture.
    pub vertical_fov_radians: f64,
    /// The distance of the near plane, in world units, above zero.
    pub near: f64,
    /// Without perspective; the angle and the near plane are not used then.
    pub parallel: Option<Parallel>,
}

impl Camera {
    /// A camera at `eye` that looks towards `target`.
    pub fn look_at(eye: DVec3, target: DVec3, up: DVec3, vertical_fov_radians: f64, near: f64) -> Self {
        let world_from_view = orientation(target - eye, up);
        Self { eye, world_from_view, vertical_fov_radians, near, parallel: None }
    }

    /// The unit direction of view, in world space.
    pub fn forward(&self) -> DVec3 {
        self.world_from_view * DVec3::NEG_Z
    }

    /// The unit direction towards the upper edge of the picture, in world space.
    pub fn up(&self) -> DVec3 {
        self.world_from_view * DVec3::Y
    }

    /// The unit direction towards the right edge of the picture, in world space.
    pub fn right(&self) -> DVec3 {
        self.world_from_view * DVec3::X
    }

    /// Projection: view space to clip space, reversed depth, no far plane with perspective. `aspect` is width over height.
    pub fn clip_from_view(&self, aspect: f32) -> Mat4 {
        if let Some(Parallel { height, reach }) = self.parallel {
            let scale = DVec3::new(2.0 / (height * f64::from(aspect)), 2.0 / height, 0.5 / reach);
            return Mat4::from_translation(Vec3::Z * 0.5) * Mat4::from_scale(scale.as_vec3());
        }
        let focal = 1.0 / (0.5 * self.vertical_fov_radians).tan();
        Mat4::from_cols(
            Vec4::new((focal / f64::from(aspect)) as f32, 0.0, 0.0, 0.0),
            Vec4::new(0.0, focal as f32, 0.0, 0.0),
            Vec4::new(0.0, 0.0, 0.0, -1.0),
            Vec4::new(0.0, 0.0, self.near as f32, 0.0),
        )
    }

    /// Camera-relative world space to clip space. `aspect` is width over height.
    pub fn clip_from_relative(&self, aspect: f32) -> Mat4 {
        self.clip_from_view(aspect) * Mat4::from_quat(self.world_from_view.conjugate().as_quat())
    }

    /// The planes left, right, bottom, top and near in camera-relative world space, with unit normals `n = xyz`:
    /// a point `p` is inside where `dot(n, p) + w >= 0` for all five. `aspect` is width over height.
    pub fn frustum_planes(&self, aspect: f32) -> [Vec4; 5] {
        let half_height =
            self.parallel.map_or((0.5 * self.vertical_fov_radians).tan(), |parallel| 0.5 * parallel.height);
        let half_width = half_height * f64::from(aspect);
        // What the sides are apart at the eye, and by how much they part for each unit in front of it.
        let (apart, parting, near) = match self.parallel {
            Some(Parallel { reach, .. }) => ([half_width, half_height], [0.0; 2], reach),
            None => ([0.0; 2], [half_width, half_height], -self.near),
        };
        let inward = [
            DVec3::new(1.0, 0.0, -parting[0]),
            DVec3::new(-1.0, 0.0, -parting[0]),
            DVec3::new(0.0, 1.0, -parting[1]),
            DVec3::new(0.0, -1.0, -parting[1]),
            DVec3::NEG_Z,
        ];
        let offsets = [apart[0], apart[0], apart[1], apart[1], near];
        std::array::from_fn(|side| {
            (self.world_from_view * inward[side].normalize()).extend(offsets[side]).as_vec4()
        })
    }

    /// The focal length in pixels: an object of size `s` at distance `d` covers `s / d * focal_px` pixels, where without
    /// perspective everything is at distance 1.
    pub fn focal_px(&self, height: u32) -> f32 {
        if let Some(parallel) = self.parallel {
            return (f64::from(height) / parallel.height) as f32;
        }
        (0.5 * f64::from(height) / (0.5 * self.vertical_fov_radians).tan()) as f32
    }

    /// How far a point is from the eye as far as its size in the picture is concerned: 1 without perspective.
    pub fn distance(&self, point: DVec3) -> f64 {
        if self.parallel.is_some() { 1.0 } else { (point - self.eye).length() }
    }

    /// World units that a pixel of a picture of that height covers at a point.
    pub fn pixel_size(&self, height: u32, point: DVec3) -> f64 {
        self.distance(point) / f64::from(self.focal_px(height))
    }

    /// The eye as a sum of two f32 vectors.
    pub fn split_eye(&self) -> (Vec3, Vec3) {
        split_f64(self.eye)
    }
}

/// The orientation of a camera that looks along `direction`, as upright as `up` allows. Directions of any length are
/// taken; a zero or non-finite one becomes -z, and an `up` along the view is replaced by the axis farthest from it.
pub fn orientation(direction: DVec3, up: DVec3) -> DQuat {
    let forward = unit(direction).unwrap_or(DVec3::NEG_Z);
    let right = unit(up)
        .map(|up| forward.cross(up))
        .filter(|side| side.length_squared() > 1e-12)
        .unwrap_or_else(|| forward.cross(farthest_axis(forward)))
        .normalize();
    DQuat::from_mat3(&DMat3::from_cols(right, right.cross(forward), -forward)).normalize()
}

/// The vector at length 1, without overflow or underflow on the way.
fn unit(v: DVec3) -> Option<DVec3> {
    let largest = v.abs().max_element();
    (v.is_finite() && largest > 0.0).then(|| (v / largest).normalize())
}

fn farthest_axis(direction: DVec3) -> DVec3 {
    let a = direction.abs();
    if a.z <= a.x && a.z <= a.y {
        DVec3::Z
    } else if a.x <= a.y {
        DVec3::X
    } else {
        DVec3::Y
    }
}

/// A position as the sum of its f32 rounding and the f32 of what is left: 48 bits of precision.
pub fn split_f64(position: DVec3) -> (Vec3, Vec3) {
    let high = position.as_vec3();
    (high, (position - high.as_dvec3()).as_vec3())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn camera(eye: DVec3, target: DVec3) -> Camera {
        Camera::look_at(eye, target, DVec3::Y, 1.0, 0.1)
    }

    fn vector() -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-1e3f64..1e3).prop_map(DVec3::from_array)
    }

    #[test]
    fn the_target_is_in_the_middle_and_up_is_up() {
        let camera = camera(DVec3::new(3.0, 4.0, 5.0), DVec3::new(-1.0, 2.0, 0.5));
        let clip = camera.clip_from_relative(1.5) * (camera.forward() * 7.0).as_vec3().extend(1.0);
        assert!(clip.truncate().truncate().length() < 1e-5 && (clip.w - 7.0).abs() < 1e-5);
        assert!(camera.up().y > 0.0 && camera.right().y.abs() < 1e-12);
    }

    #[test]
    fn depth_is_one_at_the_near_plane_and_falls_to_zero() {
        let camera = camera(DVec3::ZERO, DVec3::X);
        let depth = |distance: f64| {
            let clip = camera.clip_from_relative(1.0) * (DVec3::X * distance).as_vec3().extend(1.0);
            clip.z / clip.w
        };
        assert!((depth(0.1) - 1.0).abs() < 1e-6);
        assert!(depth(1e9) > 0.0 && depth(1e9) < 1e-9);
    }

    #[test]
    fn looking_straight_up_or_nowhere_still_makes_a_rotation() {
        for (direction, up) in [
            (DVec3::Y, DVec3::Y),
            (DVec3::NEG_Y, DVec3::Y),
            (DVec3::ZERO, DVec3::Y),
            (DVec3::NAN, DVec3::NAN),
            (DVec3::splat(1e300), DVec3::ZERO),
            (DVec3::splat(1e-300), DVec3::Z),
        ] {
            let q = orientation(direction, up);
            assert!(q.is_finite() && (q.length() - 1.0).abs() < 1e-12, "{direction} {up}");
        }
    }

    #[test]
    fn without_perspective_size_and_depth_are_linear() {
        let camera = Camera {
            parallel: Some(Parallel { height: 4.0, reach: 10.0 }),
            ..camera(DVec3::new(5.0, 0.0, 0.0), DVec3::ZERO)
        };
        let clip = |right: f64, up: f64, ahead: f64| {
            let relative = camera.right() * right + camera.up() * up + camera.forward() * ahead;
            camera.clip_from_relative(2.0) * relative.as_vec3().extend(1.0)
        };
        for ahead in [-10.0, 0.0, 10.0] {
            let corner = clip(4.0, 2.0, ahead);
            assert!((corner.truncate() - Vec3::new(1.0, 1.0, (0.5 - ahead / 20.0) as f32)).length() < 1e-6);
            assert_eq!(corner.w, 1.0);
        }
        assert_eq!(camera.focal_px(1000), 250.0);
        assert_eq!(camera.pixel_size(1000, DVec3::splat(77.0)), 0.004);
    }

    #[test]
    fn focal_length_maps_the_field_of_view_onto_the_height() {
        let camera = Camera::look_at(DVec3::ZERO, DVec3::X, DVec3::Y, std::f64::consts::FRAC_PI_2, 0.1);
        assert!((camera.focal_px(1000) - 500.0).abs() < 1e-3);
    }

    proptest! {
        #[test]
        fn planes_agree_with_the_matrix(
            eye in vector(), target in vector(), p in vector(), aspect in 0.3f32..3.0, flat in any::<bool>(),
        ) {
            prop_assume!((target - eye).length() > 1.0);
            let parallel = flat.then_some(Parallel { height: 700.0, reach: 600.0 });
            let camera = Camera { parallel, ..camera(eye, target) };
            let relative = p.as_vec3();
            let clip = camera.clip_from_relative(aspect) * relative.extend(1.0);
            let sides = [clip.w + clip.x, clip.w - clip.x, clip.w + clip.y, clip.w - clip.y, clip.w - clip.z];
            for (plane, side) in camera.frustum_planes(aspect).iter().zip(sides) {
                let distance = plane.truncate().dot(relative) + plane.w;
                // Near the plane itself the two may round to different sides.
                prop_assert!(distance.abs() < 0.05 || (distance > 0.0) == (side > 0.0), "{distance} {side}");
            }
        }

        #[test]
        fn split_positions_add_up(v in prop::array::uniform3(-1e8f64..1e8)) {
            let v = DVec3::from_array(v);
            let (high, low) = split_f64(v);
            prop_assert!((high.as_dvec3() + low.as_dvec3() - v).abs().max_element() <= 1e-6);
        }
    }
}
