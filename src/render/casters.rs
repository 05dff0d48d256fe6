//! What takes light away: the volumes of each caster and light, and how each is counted in the present frame.

use std::ops::Range;

use glam::{DAffine3, DVec3};

use crate::geometry::bounds::HalfSpace;
use crate::geometry::camera::Intrinsics;
use crate::geometry::counting::{self, Counting};
use crate::geometry::reach::PixelRect;
use crate::geometry::shadow_volume::{Caster, Casting, LightPlace};
use crate::light::Light;
use crate::scene;

use super::anchor_geometry::{AnchoredCaster, Role, SurfacePart};
use super::gpu::Gpu;
use super::touched::{Touched, light_place};
use super::uniforms::{CastingLight, NEAR_M, UniformRow};
use super::volumes::{Counted, IndexBuffer, Volume};

/// The casters of a scene and their shadows.
pub(super) struct Casters {
    casters: Vec<AnchoredCaster>,
    /// For each light those of each caster.
    shadows: Vec<Vec<Shadow>>,
    /// For each light, that light as each caster meets it.
    lights: UniformRow,
    light_group: wgpu::BindGroup,
    counting: scene::Counting,
}

/// What one caster does to one light.
struct Shadow {
    volume: Volume,
    counting: Counting,
    scissor: PixelRect,
    /// Corners of its batch: a virtual caster's triangles that face the light, and those that lie in its own shadow and
    /// that smooth shading lights all the same.
    facing: IndexBuffer,
    terminator: IndexBuffer,
}

/// The part of a virtual caster's surface that a light may reach.
pub(super) struct Lit<'a> {
    pub anchor: usize,
    pub facing: Facing<'a>,
    pub terminator: &'a IndexBuffer,
}

/// Triangles that a light may reach if nothing hides it.
pub(super) enum Facing<'a> {
    /// A part of the batch's own indices.
    Whole(Range<u32>),
    Listed(&'a IndexBuffer),
}

impl Casters {
    /// `light_layout` has one uniform with a dynamic offset.
    pub fn new(
        device: &wgpu::Device,
        casters: Vec<AnchoredCaster>,
        light_count: usize,
        light_layout: &wgpu::BindGroupLayout,
        counting: scene::Counting,
    ) -> Self {
        let lights =
            UniformRow::new::<CastingLight>(device, "casting lights", light_count * casters.len());
        let shadow = |_: &AnchoredCaster| Shadow {
            volume: Volume::default(),
            counting: Counting::DepthFail,
            scissor: PixelRect::whole([0; 2]),
            facing: IndexBuffer::default(),
            terminator: IndexBuffer::default(),
        };
        Self {
            shadows: (0..light_count)
                .map(|_| casters.iter().map(shadow).collect())
                .collect(),
            light_group: device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("casting light"),
                layout: light_layout,
                entries: &[wgpu::BindGroupEntry {
                    binding: 0,
                    resource: lights.binding(),
                }],
            }),
            casters,
            lights,
            counting,
        }
    }

    /// Makes the volumes that `touched` asks for, where light or caster has moved, and chooses how they are counted.
    pub fn update(
        &mut self,
        gpu: &Gpu,
        lights: &[Light],
        camera_from_anchor: &[Option<DAffine3>],
        intrinsics: &Intrinsics,
        touched: &Touched,
    ) {
        let Some(camera_from_world) = camera_from_anchor.first().copied().flatten() else {
            return;
        };
        let placed: Vec<Option<Placed>> = camera_from_anchor
            .iter()
            .enumerate()
            .map(|(anchor, camera_from_anchor)| {
                let anchor_from_camera = (*camera_from_anchor)?.inverse();
                Some(Placed {
                    // The world stands still to its lights: no camera may come between, or rounding would move them.
                    anchor_from_world: match anchor {
                        0 => DAffine3::IDENTITY,
                        _ => anchor_from_camera * camera_from_world,
                    },
                    near: counting::near_corners(
                        intrinsics,
                        f64::from(NEAR_M),
                        &anchor_from_camera,
                    ),
                    eye: anchor_from_camera.translation,
                })
            })
            .collect();
        let count = self.casters.len();
        for (index, (light, shadows)) in lights.iter().zip(&mut self.shadows).enumerate() {
            for (number, (caster, shadow)) in self.casters.iter().zip(shadows).enumerate() {
                let reach = &touched.shadows[index][number];
                shadow.scissor = reach.pixels;
                let (Some(bounds), Some(placed), false) = (
                    caster.caster.bounds(),
                    &placed[caster.anchor],
                    reach.pixels.is_empty(),
                ) else {
                    continue;
                };
                let light = light_place(light, &placed.anchor_from_world);
                let end = reach
                    .end
                    .map(|end| end.in_space(&placed.anchor_from_world.inverse()));
                self.lights.write(
                    &gpu.queue,
                    index * count + number,
                    &CastingLight::new(light, end),
                );
                // Beyond its end a volume is open: no ray may come from there.
                let sees_past_end = |end: HalfSpace| {
                    placed
                        .near
                        .iter()
                        .any(|corner| end.depth_of(*corner) <= 0.0)
                };
                shadow.counting = match self.counting {
                    scene::Counting::Auto if !end.is_some_and(sees_past_end) => {
                        counting::counting(bounds, light, &placed.near)
                    }
                    _ => Counting::DepthFail,
                };
                let made_for = (light, caster.caster.casting(light, placed.eye));
                let changed = shadow
                    .volume
                    .update(gpu, &caster.caster, made_for, shadow.counting);
                if let (true, Some(surface)) = (changed, &caster.surface) {
                    shadow.list_lit(gpu, &caster.caster, light, surface);
                }
            }
        }
    }

    /// The volumes of a role and light, for [`super::volumes::Volumes::count`].
    pub fn counted<'a>(
        &'a self,
        role: Role,
        light: usize,
        views: &'a UniformRow,
    ) -> impl Iterator<Item = Counted<'a>> {
        let count = self.casters.len();
        self.present(role, light)
            .map(move |(number, caster, shadow)| Counted {
                volume: &shadow.volume,
                counting: shadow.counting,
                scissor: shadow.scissor,
                offsets: [
                    views.offset(caster.anchor),
                    self.lights.offset(light * count + number),
                ],
                vertices: &caster.vertices,
            })
    }

    /// The surfaces of virtual casters that the light may reach.
    pub fn lit(&self, light: usize) -> impl Iterator<Item = Lit<'_>> {
        self.present(Role::Virtual, light)
            .filter_map(|(_, caster, shadow)| {
                Some(Lit {
                    anchor: caster.anchor,
                    facing: match shadow.volume.casting() {
                        Casting::Facing => Facing::Listed(&shadow.facing),
                        Casting::All => Facing::Whole(caster.surface.as_ref()?.range.clone()),
                    },
                    terminator: &shadow.terminator,
                })
            })
    }

    /// The light in the anchors of casters.
    pub fn light_group(&self) -> &wgpu::BindGroup {
        &self.light_group
    }

    fn present(
        &self,
        role: Role,
        light: usize,
    ) -> impl Iterator<Item = (usize, &AnchoredCaster, &Shadow)> {
        let casters = self.casters.iter().zip(&self.shadows[light]).enumerate();
        casters
            .filter(move |(_, (caster, shadow))| caster.role == role && !shadow.scissor.is_empty())
            .map(|(number, (caster, shadow))| (number, caster, shadow))
    }
}

impl Shadow {
    /// Lists what the light may reach of the caster's own surface. Where all triangles cast, all may be lit, for the
    /// camera may see either side of them.
    fn list_lit(&mut self, gpu: &Gpu, caster: &Caster, light: LightPlace, surface: &SurfacePart) {
        if self.volume.casting() == Casting::Facing {
            let facing = caster.facing(light);
            let facing: Vec<u32> = facing
                .flat_map(|triangle| surface.triangles[triangle])
                .collect();
            self.facing.write(&gpu.device, &gpu.queue, &facing);
        }
        if let Some(normals) = &surface.smooth_normals {
            let terminator = caster.terminator(light, normals);
            let terminator: Vec<u32> = terminator
                .flat_map(|triangle| surface.triangles[triangle])
                .collect();
            self.terminator.write(&gpu.device, &gpu.queue, &terminator);
        }
    }
}

/// Where an anchor's casters have the light and the camera.
struct Placed {
    anchor_from_world: DAffine3,
    near: [DVec3; 4],
    eye: DVec3,
}
