//! How passes draw the scene: surfaces of a role, of one light, and shadow volumes.

use super::super::anchor_geometry::{AnchoredModel, Role, SurfaceBatch};
use super::super::casters::LitSides;
use super::super::insides::Insides;
use super::super::stencil::REAL_HIDES;
use super::super::surfaces::Sided;
use super::super::volumes::{Among, Volumes, set_scissor};
use super::{DrawnLight, GpuScene};
use crate::geometry::reach::PixelRect;

impl GpuScene {
    /// What passes draw from here on stands on an anchor.
    pub fn set_anchor(&self, pass: &mut wgpu::RenderPass<'_>, anchor: usize) {
        pass.set_bind_group(0, &self.view_group, &[self.views.offset(anchor)]);
    }

    /// What passes draw from here on stands in the world.
    pub fn set_world(&self, pass: &mut wgpu::RenderPass<'_>) {
        self.set_anchor(pass, 0);
        self.lights.set_whole(pass, 0);
    }

    /// Draws the real surfaces of all anchors but the world.
    pub fn draw_moving_real(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        pipelines: &Sided,
        within: PixelRect,
    ) {
        pass.set_stencil_reference(0);
        self.lights.set_whole(pass, 0);
        let real = self.placed_things(Role::Real);
        for (batch, number, thing) in real.filter(|(batch, ..)| batch.anchor != 0) {
            self.set_thing(pass, batch, thing);
            self.draw_whole(pass, pipelines, number, thing, within);
        }
    }

    /// Draws all surfaces of a role, with a light in group 1 if the pipeline wants one.
    pub fn draw_surfaces(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        pipelines: &Sided,
        role: Role,
        light: DrawnLight,
        within: PixelRect,
    ) {
        pass.set_stencil_reference(0);
        match light {
            DrawnLight::Whole(light) => self.lights.set_whole(pass, light),
            DrawnLight::Piece(piece) => self.lights.set_piece(pass, piece),
            DrawnLight::HiddenPiece(piece) => {
                self.lights.set_piece(pass, piece);
                pass.set_stencil_reference(REAL_HIDES);
            }
        }
        for (batch, number, thing) in self.placed_things(role) {
            self.set_thing(pass, batch, thing);
            self.draw_whole(pass, pipelines, number, thing, within);
        }
    }

    /// Draws virtual surfaces by what a light can give them: in the open, at the terminator, and turned away.
    pub fn draw_virtuals(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        [open, terminator, back_facing]: [&Sided; 3],
        piece: usize,
        within: PixelRect,
    ) {
        self.set_piece(pass, piece);
        for (batch, number, thing) in self.placed_things(Role::Virtual) {
            self.set_thing(pass, batch, thing);
            let Some(surface) = self.casters.lit(number, self.slot(piece)) else {
                self.draw_whole(pass, open, number, thing, within);
                continue;
            };
            for (pipelines, sides) in [
                (open, &surface.facing),
                (terminator, &surface.terminator),
                (back_facing, &surface.back_facing),
            ] {
                self.draw_sides(pass, pipelines, number, sides, within);
            }
        }
    }

    /// Draws the virtual surfaces that a light may reach: with the stencil's reference 0, and with 1 those that lie in one
    /// volume, which is then their own, and that smooth shading lights all the same. Otherwise the facets would draw a
    /// jagged line where the light ends.
    pub fn draw_virtuals_facing(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        pipelines: &Sided,
        piece: usize,
        within: PixelRect,
    ) {
        self.set_piece(pass, piece);
        for (batch, number, thing) in self.placed_things(Role::Virtual) {
            self.set_thing(pass, batch, thing);
            match self.casters.lit(number, self.slot(piece)) {
                Some(surface) => {
                    self.draw_sides(pass, pipelines, number, &surface.facing, within);
                    pass.set_stencil_reference(1);
                    self.draw_sides(pass, pipelines, number, &surface.terminator, within);
                    pass.set_stencil_reference(0);
                }
                None if thing.casts => {}
                None => self.draw_whole(pass, pipelines, number, thing, within),
            }
        }
    }

    /// Draws a thing's triangles from the sides that can be seen.
    fn draw_whole(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        pipelines: &Sided,
        number: usize,
        thing: &AnchoredModel,
        within: PixelRect,
    ) {
        let range = || thing.levels[self.levels[number]].range.clone();
        let insides = self.insides[number];
        pass.set_pipeline(match insides {
            Insides::Anywhere => &pipelines.both,
            Insides::Unseen | Insides::Within(_) => &pipelines.outside,
        });
        pass.draw_indexed(range(), 0, 0..1);
        scissored(pass, insides, within, |pass| {
            pass.set_pipeline(&pipelines.inside);
            pass.draw_indexed(range(), 0, 0..1);
        });
    }

    /// Draws some of a thing's triangles, sorted by the sides that can be seen.
    fn draw_sides(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        pipelines: &Sided,
        number: usize,
        sides: &LitSides,
        within: PixelRect,
    ) {
        let insides = self.insides[number];
        pass.set_pipeline(match insides {
            Insides::Unseen => &pipelines.outside,
            Insides::Anywhere | Insides::Within(_) => &pipelines.both,
        });
        sides.draw_outer(pass);
        if insides == Insides::Anywhere {
            sides.draw_inner(pass);
        }
        scissored(pass, insides, within, |pass| sides.draw_inner(pass));
    }

    /// Counts a role's shadow volumes. Returns whether there are any.
    pub fn count_volumes(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        volumes: &Volumes,
        among: Among,
        role: Role,
        piece: usize,
        within: PixelRect,
    ) -> PixelRect {
        let groups = [&self.view_group, self.casters.light_group()];
        let (things, insides) = (&self.things, &self.insides);
        let slot = self.slot(piece);
        let counted = self.casters.counted(things, role, slot, insides, |thing| {
            [thing.anchor, self.view_of(thing)].map(|view| self.views.offset(view))
        });
        volumes.count(pass, among, role, groups, within, counted)
    }

    fn set_piece(&self, pass: &mut wgpu::RenderPass<'_>, piece: usize) {
        pass.set_stencil_reference(0);
        self.lights.set_piece(pass, piece);
    }

    fn set_thing(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        batch: &SurfaceBatch,
        thing: &AnchoredModel,
    ) {
        let view = self.views.offset(self.view_of(thing));
        pass.set_bind_group(0, &self.view_group, &[view]);
        pass.set_vertex_buffer(0, batch.corners.slice(..));
        pass.set_vertex_buffer(1, batch.indirect.slice(..));
        if let Some(looks) = &batch.looks {
            pass.set_vertex_buffer(2, looks.slice(..));
        }
        if let Some(occlusion) = &batch.occlusion {
            let slot = 2 + u32::from(batch.looks.is_some());
            pass.set_vertex_buffer(slot, occlusion.own.slice(..));
            pass.set_vertex_buffer(slot + 1, occlusion.reflected.slice(..));
        }
        if let Some(materials) = self
            .materials
            .as_ref()
            .filter(|_| batch.role == Role::Virtual)
        {
            pass.set_bind_group(3, materials, &[]);
        }
        pass.set_index_buffer(batch.indices.slice(..), wgpu::IndexFormat::Uint32);
    }
}

/// Draws only where an inside can be seen through holes.
fn scissored(
    pass: &mut wgpu::RenderPass<'_>,
    insides: Insides,
    within: PixelRect,
    draw: impl FnOnce(&mut wgpu::RenderPass<'_>),
) {
    if let Insides::Within(pixels) = insides {
        let pixels = pixels.intersection(within);
        if !pixels.is_empty() {
            set_scissor(pass, pixels);
            draw(pass);
            set_scissor(pass, within);
        }
    }
}
