//! What takes light away: the volumes of each caster and light, and how each is counted in the present frame.

use glam::{DAffine3, DVec3};

use crate::geometry::bounds::HalfSpace;
use crate::geometry::camera::Intrinsics;
use crate::geometry::counting::{self, Counting};
use crate::geometry::reach::PixelRect;
use crate::geometry::shadow_volume::{Casting, LightPlace};
use crate::scene::{self, ShadowSettings, Shortcut};

use super::anchor_geometry::{AnchoredModel, LevelCaster, Role};
use super::gpu::Gpu;
use super::insides::Insides;
use super::light_piece::{Piece, light_place};
use super::screen_bounds::ScreenBounds;
use super::uniforms::{CastingLight, LIGHT_GROUP, NEAR_M, UniformRow};
use super::volumes::{CountedVolume, IndexBuffer, MadeFor, Volume};

/// The shadows of a scene's things.
pub(super) struct Casters {
    /// For each slot of a light's piece those of each thing; what does not cast has an empty one.
    shadows: Vec<Vec<Shadow>>,
    /// For each slot, that piece as each thing meets it.
    lights: UniformRow,
    /// Slots that `lights` has room for.
    capacity: usize,
    light_group: wgpu::BindGroup,
    /// Whether depth-pass may be taken.
    depth_pass: bool,
    /// Whether what has not changed since the last frame is made anew all the same.
    forgets: bool,
    /// What stands on this node is not drawn.
    unseen: Option<usize>,
}

/// The shadow of one caster in one light.
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
    pub back_facing: LitSides,
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
    pub fn new(gpu: &Gpu, thing_count: usize, shadows: &ShadowSettings) -> Self {
        let (lights, light_group) = casting_lights(gpu, thing_count);
        Self {
            shadows: Vec::new(),
            capacity: 1,
            light_group,
            lights,
            depth_pass: shadows.counting == scene::VolumeCounting::Auto
                && !shadows.without.has(Shortcut::DepthPass),
            forgets: shadows.without.has(Shortcut::Kept),
            unseen: None,
        }
    }

    /// What stands on a node is not drawn from now on: depth-pass would need its surface in the place of the near cap.
    pub fn set_unseen(&mut self, node: Option<usize>) {
        self.unseen = node;
    }

    /// What a thing casts is to be made anew, by its number: it has another shape.
    pub fn forget(&mut self, number: usize) {
        let of_thing = self
            .shadows
            .iter_mut()
            .filter_map(|of_slot| of_slot.get_mut(number));
        for shadow in of_thing {
            shadow.volume.forget();
            shadow.lit_for = None;
        }
    }

    /// Makes room for the pieces of lights.
    pub fn reserve(&mut self, gpu: &Gpu, thing_count: usize, slot_count: usize) {
        while self.shadows.len() < slot_count {
            let of_things = (0..thing_count).map(|_| Shadow::default());
            self.shadows.push(of_things.collect());
        }
        if slot_count > self.capacity {
            self.capacity = slot_count.next_power_of_two();
            (self.lights, self.light_group) = casting_lights(gpu, self.capacity * thing_count);
        }
    }

    /// Makes the volumes that reach the pixels `within`, where light or caster has moved or another of its `levels` is to
    /// be drawn, and chooses how they are counted.
    pub fn update(
        &mut self,
        gpu: &Gpu,
        (things, levels): (&[AnchoredModel], &[usize]),
        pieces: &[Piece],
        camera_from_anchor: &[Option<DAffine3>],
        intrinsics: &Intrinsics,
        (bounds, within): (&ScreenBounds, PixelRect),
    ) {
        let Some(camera_from_world) = camera_from_anchor.first().copied().flatten() else {
            return;
        };
        let placed: Vec<Option<CasterView>> = camera_from_anchor
            .iter()
            .enumerate()
            .map(|(anchor, pose)| {
                let pose = (*pose)?;
                Some(CasterView::new(
                    anchor,
                    &pose,
                    &camera_from_world,
                    intrinsics,
                ))
            })
            .collect();
        for (index, Piece { light, slot, .. }) in pieces.iter().enumerate() {
            let Some(shadows) = self.shadows.get_mut(*slot) else {
                continue;
            };
            for (number, (thing, shadow)) in things.iter().zip(shadows).enumerate() {
                let reach = &bounds.shadows[index][number];
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
                let place = slot * things.len() + number;
                self.lights
                    .write(&gpu.queue, place, &CastingLight::new(light, end));
                let is_seen = self.unseen != Some(thing.anchor);
                let counting = match self.depth_pass && is_seen && !placed.sees_past(end) {
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

    /// The volumes of a role and the piece of a slot, for [`super::volumes::Volumes::count`]; `views` are the dynamic offsets of
    /// the views of a thing's sides and caps.
    pub fn counted<'a>(
        &'a self,
        things: &'a [AnchoredModel],
        role: Role,
        slot: usize,
        insides: &'a [Insides],
        views: impl Fn(&AnchoredModel) -> [u32; 2] + 'a,
    ) -> impl Iterator<Item = CountedVolume<'a>> {
        let shadows = self.shadows.get(slot).map_or(&[][..], Vec::as_slice);
        let shadows = things.iter().zip(shadows).enumerate();
        shadows
            .filter(move |(_, (thing, _))| thing.role == role)
            .filter_map(move |(number, (thing, shadow))| {
                let place = slot * things.len() + number;
                Some(CountedVolume {
                    volume: &shadow.volume,
                    counting: shadow.counting?,
                    insides: insides[number],
                    scissor: shadow.scissor?,
                    views: views(thing),
                    light: self.lights.offset(place),
                    vertices: &thing.levels[shadow.level].caster.as_ref()?.vertices,
                })
            })
    }

    /// The surface of a virtual thing; `None` where it casts nothing that is seen.
    pub fn lit(&self, number: usize, slot: usize) -> Option<&Lit> {
        let shadow = self.shadows.get(slot)?.get(number)?;
        shadow.scissor.map(|_| &shadow.lit)
    }

    /// The light in the anchors of casters.
    pub fn light_group(&self) -> &wgpu::BindGroup {
        &self.light_group
    }
}

fn casting_lights(gpu: &Gpu, count: usize) -> (UniformRow, wgpu::BindGroup) {
    let lights = UniformRow::new::<CastingLight>(&gpu.device, "casting lights", count);
    let group = gpu.bind_group(&LIGHT_GROUP, [lights.binding()]);
    (lights, group)
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
            (&mut self.lit.back_facing, sorted.back_facing),
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

/// The light and the camera as an anchor's casters have them.
struct CasterView {
    anchor_from_world: DAffine3,
    near: [DVec3; 4],
    eye: DVec3,
}

impl CasterView {
    fn new(
        anchor: usize,
        camera_from_anchor: &DAffine3,
        camera_from_world: &DAffine3,
        intrinsics: &Intrinsics,
    ) -> Self {
        let anchor_from_camera = camera_from_anchor.inverse();
        Self {
            // The world stands still to its lights: no camera may come between, or rounding would move them.
            anchor_from_world: match anchor {
                0 => DAffine3::IDENTITY,
                _ => anchor_from_camera * camera_from_world,
            },
            near: counting::near_corners(intrinsics, f64::from(NEAR_M), &anchor_from_camera),
            eye: anchor_from_camera.translation,
        }
    }

    /// Whether the near plane reaches beyond the end of a volume, where it is open: no ray may come from there.
    fn sees_past(&self, end: Option<HalfSpace>) -> bool {
        let is_past = |end: HalfSpace| {
            let mut near = self.near.iter();
            near.any(|corner| end.depth_of(*corner) <= 0.0)
        };
        end.is_some_and(is_past)
    }
}
