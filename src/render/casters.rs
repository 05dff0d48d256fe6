//! What takes light away: the volumes of each caster and light, and how each is counted in the present frame.

use glam::{DAffine3, DVec3};

use crate::geometry::bounds::HalfSpace;
use crate::geometry::camera::Intrinsics;
use crate::geometry::counting::{self, Counting};
use crate::geometry::reach::PixelRect;
use crate::geometry::shadow_volume::{Casting, LightPlace};
use crate::light::Light;
use crate::scene::{self, ShadowSettings, Shortcut};

use super::anchor_geometry::{LevelCaster, Role, Thing};
use super::gpu::Gpu;
use super::insides::Insides;
use super::touched::{Touched, light_place};
use super::uniforms::{CastingLight, NEAR_M, UniformRow};
use super::volumes::{Counted, IndexBuffer, MadeFor, Volume};

/// The shadows of a scene's things.
pub(super) struct Casters {
    /// For each light those of each thing; what does not cast has an empty one.
    shadows: Vec<Vec<Shadow>>,
    /// For each light, that light as each thing meets it.
    lights: UniformRow,
    light_group: wgpu::BindGroup,
    /// Whether depth-pass may be taken.
    depth_pass: bool,
    /// Whether what has not changed since the last frame is made anew all the same.
    forgets: bool,
}

/// What one caster does to one light.
#[derive(Default)]
struct Shadow {
    volume: Volume,
    /// Of the thing that casts it.
    level: usize,
    counting: Option<Counting>,
    scissor: Option<PixelRect>,
    /// A virtual caster's own surface, and what it is sorted for.
    lit: Lit,
    lit_for: Option<(usize, LightPlace, Option<DVec3>)>,
}

/// A virtual caster's surface by what a light can give it ([`LitTriangles`]), as corners of its batch.
///
/// [`LitTriangles`]: crate::geometry::shadow_volume::LitTriangles
#[derive(Default)]
pub(super) struct Lit {
    pub facing: LitSides,
    pub terminator: LitSides,
    pub averted: LitSides,
}

/// Triangles that may be seen from outside, then those that are seen from inside.
#[derive(Default)]
pub(super) struct LitSides {
    indices: IndexBuffer,
    outer: u32,
}

impl LitSides {
    /// Draws what may be seen from outside.
    pub fn draw_outer(&self, pass: &mut wgpu::RenderPass<'_>) {
        self.indices.draw(pass, 0..self.outer);
    }

    /// Draws what is seen from inside.
    pub fn draw_inner(&self, pass: &mut wgpu::RenderPass<'_>) {
        self.indices.draw(pass, self.outer..self.indices.count());
    }
}

impl Casters {
    /// `light_layout` has one uniform with a dynamic offset.
    pub fn new(
        device: &wgpu::Device,
        thing_count: usize,
        light_count: usize,
        light_layout: &wgpu::BindGroupLayout,
        shadows: &ShadowSettings,
    ) -> Self {
        let lights =
            UniformRow::new::<CastingLight>(device, "casting lights", light_count * thing_count);
        let of_light = |_| (0..thing_count).map(|_| Shadow::default()).collect();
        Self {
            shadows: (0..light_count).map(of_light).collect(),
            light_group: device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("casting light"),
                layout: light_layout,
                entries: &[wgpu::BindGroupEntry {
                    binding: 0,
                    resource: lights.binding(),
                }],
            }),
            lights,
            depth_pass: shadows.counting == scene::VolumeCounting::Auto
                && !shadows.without.has(Shortcut::DepthPass),
            forgets: shadows.without.has(Shortcut::Kept),
        }
    }

    /// Makes the volumes that reach the pixels `within`, where light or caster has moved or another of its `levels` is to
    /// be drawn, and chooses how they are counted.
    pub fn update(
        &mut self,
        gpu: &Gpu,
        (things, levels): (&[Thing], &[usize]),
        lights: &[Light],
        camera_from_anchor: &[Option<DAffine3>],
        intrinsics: &Intrinsics,
        (touched, within): (&Touched, PixelRect),
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
        for (index, (light, shadows)) in lights.iter().zip(&mut self.shadows).enumerate() {
            for (number, (thing, shadow)) in things.iter().zip(shadows).enumerate() {
                let reach = &touched.shadows[index][number];
                shadow.scissor = None;
                let level = levels[number];
                let pixels = reach.pixels.intersection(within);
                let (Some(caster), Some(placed), false) = (
                    &thing.levels[level].caster,
                    &placed[thing.anchor],
                    pixels.is_empty(),
                ) else {
                    continue;
                };
                shadow.scissor = Some(pixels);
                shadow.level = level;
                let light = light_place(light, &placed.anchor_from_world);
                let end = reach
                    .end
                    .map(|end| end.in_space(&placed.anchor_from_world.inverse()));
                let slot = index * things.len() + number;
                self.lights
                    .write(&gpu.queue, slot, &CastingLight::new(light, end));
                // Beyond its end a volume is open: no ray may come from there.
                let sees_past_end = |end: HalfSpace| {
                    placed
                        .near
                        .iter()
                        .any(|corner| end.depth_of(*corner) <= 0.0)
                };
                let counting = match self.depth_pass && !end.is_some_and(sees_past_end) {
                    true => counting::counting(&thing.bounds, light, &placed.near),
                    false => Counting::DepthFail,
                };
                if self.forgets {
                    shadow.volume = Volume::default();
                    shadow.lit_for = None;
                }
                shadow.counting = Some(counting);
                let made_for = MadeFor {
                    level,
                    light,
                    casting: caster.caster.casting(light, placed.eye),
                };
                shadow
                    .volume
                    .update(gpu, &caster.caster, made_for, counting);
                if thing.role == Role::Virtual {
                    // From outside, all that is seen of a solid is seen from its outer side. Of a closed mesh that passes
                    // through itself the inner side of a lobe may be.
                    let holes = thing.levels[level].holes.as_ref();
                    let is_solid = holes.is_some_and(|holes| holes.is_empty());
                    let outside = is_solid && made_for.casting == Casting::Facing;
                    let eye = (!outside).then_some(placed.eye);
                    shadow.sort_lit(gpu, caster, (level, light, eye));
                }
            }
        }
    }

    /// The volumes of a role and light, for [`super::volumes::Volumes::count`].
    pub fn counted<'a>(
        &'a self,
        things: &'a [Thing],
        role: Role,
        light: usize,
        insides: &'a [Insides],
        view_offset: impl Fn(&Thing) -> u32 + 'a,
    ) -> impl Iterator<Item = Counted<'a>> {
        let shadows = things.iter().zip(&self.shadows[light]).enumerate();
        shadows
            .filter(move |(_, (thing, _))| thing.role == role)
            .filter_map(move |(number, (thing, shadow))| {
                let slot = light * things.len() + number;
                Some(Counted {
                    volume: &shadow.volume,
                    counting: shadow.counting?,
                    insides: insides[number],
                    scissor: shadow.scissor?,
                    offsets: [view_offset(thing), self.lights.offset(slot)],
                    vertices: &thing.levels[shadow.level].caster.as_ref()?.vertices,
                })
            })
    }

    /// The surface of a virtual thing; `None` where it casts nothing that is seen.
    pub fn lit(&self, number: usize, light: usize) -> Option<&Lit> {
        let shadow = self.shadows.get(light)?.get(number)?;
        shadow.scissor.map(|_| &shadow.lit)
    }

    /// The light in the anchors of casters.
    pub fn light_group(&self) -> &wgpu::BindGroup {
        &self.light_group
    }
}

impl Shadow {
    /// Sorts the caster's surface anew if what it depends on has changed: level, light and, if it matters, the eye.
    fn sort_lit(
        &mut self,
        gpu: &Gpu,
        caster: &LevelCaster,
        lit_for: (usize, LightPlace, Option<DVec3>),
    ) {
        if self.lit_for == Some(lit_for) {
            return;
        }
        let (_, light, eye) = lit_for;
        let normals = caster.smooth_normals.as_deref();
        let sorted = caster.caster.lit_triangles(light, eye, normals);
        for (sides, seen) in [
            (&mut self.lit.facing, sorted.facing),
            (&mut self.lit.terminator, sorted.terminator),
            (&mut self.lit.averted, sorted.averted),
        ] {
            let triangles = seen.outer.iter().chain(&seen.inner);
            let corners = triangles.flat_map(|&triangle| caster.surface_triangles[triangle]);
            let corners: Vec<u32> = corners.collect();
            sides.indices.write(&gpu.device, &gpu.queue, &corners);
            sides.outer = 3 * seen.outer.len() as u32;
        }
        self.lit_for = Some(lit_for);
    }
}

/// Where an anchor's casters have the light and the camera.
struct Placed {
    anchor_from_world: DAffine3,
    near: [DVec3; 4],
    eye: DVec3,
}
