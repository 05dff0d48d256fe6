//! The lights of a frame: where they are, and in how many pieces each casts its shadows.
//!
//! A light of some size is cut into as many pieces as its widest penumbra has pixels (`light::pieces`): each piece casts a shadow
//! with a sharp edge, no more than a pixel from that of the next. The pieces follow from where everything is, and from nothing
//! else: what stands still is drawn the same in each frame.

use std::ops::Range;

use glam::DAffine3;

use crate::geometry::penumbra::SizedPlace;
use crate::light::Light;
use crate::scene::SceneLight;

use super::gpu::Gpu;
use super::light_kind::LightKind;
use super::light_piece::{Piece, light_place};
use super::uniforms::{CameraLight, LIGHT_GROUP, UniformRow};

/// The lights that cast shadow volumes, in the present frame.
pub(super) struct Lights {
    scene: Vec<SceneLight>,
    placed: Vec<PlacedLight>,
    /// All pieces of the lights.
    pieces: Vec<Piece>,
    /// For each light the slots of its pieces, as many as it ever had.
    slots: Vec<Vec<usize>>,
    slot_count: usize,
    uniforms: UniformRow,
    capacity: usize,
    group: wgpu::BindGroup,
}

/// A light in the world.
struct PlacedLight {
    /// `None` where nobody knows where it is.
    light: Option<Light>,
    pieces: Range<usize>,
}

impl Lights {
    /// Of a scene's lights.
    pub fn new(gpu: &Gpu, scene: Vec<SceneLight>) -> Self {
        let capacity = 2 * scene.len();
        let (uniforms, group) = uniforms(gpu, capacity);
        Self {
            slots: vec![Vec::new(); scene.len()],
            placed: Vec::new(),
            pieces: Vec::new(),
            slot_count: 0,
            scene,
            uniforms,
            capacity,
            group,
        }
    }

    /// Takes as many lights that shine otherwise.
    pub fn follow(&mut self, scene: Vec<SceneLight>) {
        self.scene = scene;
    }

    /// Places the lights; those on anchors without a pose do not shine.
    pub fn place(&mut self, camera_from_anchor: &[Option<DAffine3>]) {
        let world_from_camera = camera_from_anchor
            .first()
            .copied()
            .flatten()
            .map(|pose| pose.inverse());
        let placed = self.scene.iter().map(|&SceneLight { anchor, light }| {
            let light = match anchor {
                // The world stands still to its lights: no camera may come between, or rounding would move them.
                0 => world_from_camera.map(|_| light),
                _ => world_from_camera
                    .zip(camera_from_anchor[anchor])
                    .map(|(world, anchor)| light.moved(&(world * anchor))),
            };
            PlacedLight {
                light,
                pieces: 0..0,
            }
        });
        self.placed = placed.collect();
        self.pieces.clear();
    }

    /// Cuts each light into its `pieces`, and takes all to the GPU.
    pub fn cut(
        &mut self,
        gpu: &Gpu,
        camera_from_world: &DAffine3,
        pieces: impl Fn(&Light) -> Vec<Light>,
    ) {
        self.pieces.clear();
        for (placed, slots) in self.placed.iter_mut().zip(&mut self.slots) {
            let first = self.pieces.len();
            let pieces = placed.light.map(|light| pieces(&light));
            for (index, light) in pieces.into_iter().flatten().enumerate() {
                if index == slots.len() {
                    slots.push(self.slot_count);
                    self.slot_count += 1;
                }
                let slot = slots[index];
                self.pieces.push(Piece {
                    light,
                    kind: LightKind::of(&light),
                    slot,
                });
            }
            placed.pieces = first..self.pieces.len();
        }
        let needed = self.scene.len() + self.slot_count;
        if needed > self.capacity {
            self.capacity = needed.next_power_of_two();
            (self.uniforms, self.group) = uniforms(gpu, self.capacity);
        }
        let write = |index: usize, light: &Light| {
            let light = CameraLight::new(light, camera_from_world);
            self.uniforms.write(&gpu.queue, index, &light);
        };
        for (index, placed) in self.placed.iter().enumerate() {
            if let Some(light) = &placed.light {
                write(index, light);
            }
        }
        for piece in &self.pieces {
            write(self.scene.len() + piece.slot, &piece.light);
        }
    }

    /// Number of lights, also of those that do not shine at present.
    pub fn count(&self) -> usize {
        self.scene.len()
    }

    /// How many slots pieces have.
    pub fn slot_count(&self) -> usize {
        self.slot_count
    }

    /// The lights that shine, in world space.
    pub fn shining(&self) -> Vec<Light> {
        self.placed
            .iter()
            .filter_map(|placed| placed.light)
            .collect()
    }

    /// All pieces.
    pub fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    /// Which of them are a light's.
    pub fn pieces_of(&self, light: usize) -> Range<usize> {
        self.placed
            .get(light)
            .map_or(0..0, |placed| placed.pieces.clone())
    }

    /// What a whole light is.
    pub fn kind_of_whole(&self, light: usize) -> LightKind {
        let light = self.scene.get(light);
        light.map_or(LightKind::Plain, |light| LightKind::of(&light.light))
    }

    /// What a piece is.
    pub fn kind_of_piece(&self, piece: usize) -> LightKind {
        let piece = self.pieces.get(piece);
        piece.map_or(LightKind::Plain, |piece| piece.kind)
    }

    /// Puts a whole light into group 1.
    pub fn set_whole(&self, pass: &mut wgpu::RenderPass<'_>, light: usize) {
        pass.set_bind_group(1, &self.group, &[self.uniforms.offset(light)]);
    }

    /// Puts a piece into group 1.
    pub fn set_piece(&self, pass: &mut wgpu::RenderPass<'_>, piece: usize) {
        let slot = self.pieces.get(piece).map_or(0, |piece| piece.slot);
        let offset = self.uniforms.offset(self.scene.len() + slot);
        pass.set_bind_group(1, &self.group, &[offset]);
    }
}

fn uniforms(gpu: &Gpu, count: usize) -> (UniformRow, wgpu::BindGroup) {
    let row = UniformRow::new::<CameraLight>(&gpu.device, "lights", count.max(2));
    let group = gpu.bind_group(&LIGHT_GROUP, [row.binding()]);
    (row, group)
}

/// A light's middle and its half extents, in world space; none for a light without a size.
pub(super) fn sized_place(light: &Light) -> SizedPlace {
    SizedPlace {
        place: light_place(light, &DAffine3::IDENTITY),
        half_extents: light.half_extents(),
    }
}
