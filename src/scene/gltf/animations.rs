//! Animations: what a file's clips are called, and the one that is to play.

use glam::{DQuat, DVec3};
use gltf::Document;
use gltf::accessor::Dimensions;
use gltf::animation::{Interpolation as Given, Property};
use gltf::json::animation::VALID_PROPERTIES;
use gltf::json::validation::Checked;

use super::file::GltfFile;
use crate::geometry::rig::sampler::{Interpolation, Keyed, Sampler};
use crate::geometry::rig::{Channel, Clip, Track};
use crate::scene::error::SceneError;
use crate::scene::raw_model::ClipInfo;

/// What clips there are, in the file's order. How long they last is what the file says of its accessors.
pub(super) fn clips(document: &Document) -> Vec<ClipInfo> {
    let animations = document.animations();
    let info = |animation: gltf::Animation<'_>| {
        let ends = animation.channels().filter_map(|channel| {
            let last = channel.sampler().input().max()?;
            last.get(0)?.as_f64()
        });
        ClipInfo {
            name: animation.name().unwrap_or_default().to_owned(),
            duration_s: ends.fold(0.0, f64::max),
        }
    };
    animations.map(info).collect()
}

/// Reads one, by its number.
///
/// # Errors
/// What is wrong with it, with the place.
pub(super) fn clip(
    file: &GltfFile<'_>,
    document: &Document,
    number: usize,
) -> Result<Clip, SceneError> {
    let Some(animation) = document.animations().nth(number) else {
        return Err(file.error(&format!("animations[{number}]"), "it is not there"));
    };
    if animation.channels().next().is_none() {
        let message = "no channel of it moves a node";
        return Err(file.error(&format!("animations[{number}]"), message));
    }
    check_targets(file, document, number)?;
    let mut channels: Vec<Channel> = Vec::new();
    for channel in animation.channels() {
        let place = format!("animations[{number}].channels[{}]", channel.index());
        let (node, track) = (channel.target().node(), track(file, number, &channel)?);
        let is_same = |other: &Channel| {
            let alike = std::mem::discriminant(&other.track) == std::mem::discriminant(&track);
            other.node == node.index() && alike
        };
        if channels.iter().any(is_same) {
            let message = format!("nodes[{}] has two channels for one thing", node.index());
            return Err(file.error(&place, message));
        }
        let node = node.index();
        channels.push(Channel { node, track });
    }
    let ends = channels.iter().map(|channel| channel.track.end_s());
    Ok(Clip {
        duration_s: ends.fold(0.0, f64::max),
        channels,
    })
}

/// The crate does not look at what channels are for, and stops where that is none.
fn check_targets(
    file: &GltfFile<'_>,
    document: &Document,
    number: usize,
) -> Result<(), SceneError> {
    let root = document.as_json();
    let animations = root.animations.get(number).into_iter();
    let channels = animations.flat_map(|animation| animation.channels.iter().enumerate());
    for (channel, json) in channels {
        let place = format!("animations[{number}].channels[{channel}].target");
        let (node, count) = (json.target.node.value(), root.nodes.len());
        if node >= count {
            let message = format!("node {node} of {count}");
            return Err(file.error(&format!("{place}.node"), message));
        }
        if !matches!(json.target.path, Checked::Valid(_)) {
            let message = format!("not read; allowed: {}", VALID_PROPERTIES.join(", "));
            return Err(file.error(&format!("{place}.path"), message));
        }
    }
    Ok(())
}

fn track(
    file: &GltfFile<'_>,
    animation: usize,
    channel: &gltf::animation::Channel<'_>,
) -> Result<Track, SceneError> {
    let given = channel.sampler();
    let keys = Keys {
        file,
        place: format!("animations[{animation}].samplers[{}]", given.index()),
        given: &given,
    };
    let in_double = |vector: [f32; 3]| DVec3::from_array(vector.map(f64::from));
    let vectors = || -> Result<Vec<DVec3>, SceneError> {
        let found = keys.output::<3>(Dimensions::Vec3)?;
        Ok(found.into_iter().map(in_double).collect())
    };
    Ok(match channel.target().property() {
        Property::Translation => Track::Translation(keys.sampler(vectors()?)?),
        Property::Scale => Track::Scale(keys.sampler(vectors()?)?),
        Property::Rotation => Track::Rotation(keys.sampler(keys.rotations()?)?),
        Property::MorphTargetWeights => {
            let node = channel.target().node();
            let targets = node.mesh().and_then(|mesh| {
                let mut primitives = mesh.primitives();
                Some(primitives.next()?.morph_targets().count())
            });
            let targets = targets.filter(|count| *count > 0).ok_or_else(|| {
                let message = format!("nodes[{}] has no morph targets to weigh", node.index());
                file.error(&keys.place, message)
            })?;
            Track::Weights(keys.sampler(keys.weights(targets)?)?)
        }
    })
}

/// A sampler in the file.
struct Keys<'a> {
    file: &'a GltfFile<'a>,
    place: String,
    given: &'a gltf::animation::Sampler<'a>,
}

impl Keys<'_> {
    fn output<const N: usize>(&self, allowed: Dimensions) -> Result<Vec<[f32; N]>, SceneError> {
        let place = format!("{}.output", self.place);
        self.file
            .floats(&place, &self.given.output(), &[allowed], 0.0)
    }

    /// Unit quaternions, but for the tangents of splines.
    fn rotations(&self) -> Result<Vec<DQuat>, SceneError> {
        let found = self.output::<4>(Dimensions::Vec4)?.into_iter();
        let mut rotations: Vec<DQuat> = found
            .map(|quaternion| DQuat::from_array(quaternion.map(f64::from)))
            .collect();
        let (first, step) = match self.given.interpolation() {
            Given::CubicSpline => (1, 3),
            Given::Linear | Given::Step => (0, 1),
        };
        let values = rotations.iter_mut().enumerate().skip(first).step_by(step);
        for (number, rotation) in values {
            let length = rotation.length();
            if length < 1e-6 {
                let message = format!("element {number} is no rotation: all of it is 0");
                return Err(self.file.error(&format!("{}.output", self.place), message));
            }
            *rotation /= length;
        }
        Ok(rotations)
    }

    /// For each key, or tangent, the weights of so many targets.
    fn weights(&self, targets: usize) -> Result<Vec<Vec<f64>>, SceneError> {
        let found = self.output::<1>(Dimensions::Scalar)?;
        if found.len() % targets != 0 {
            let message = format!("{} weights for {targets} morph targets", found.len());
            return Err(self.file.error(&format!("{}.output", self.place), message));
        }
        let weights = |of_key: &[[f32; 1]]| of_key.iter().map(|[it]| f64::from(*it)).collect();
        Ok(found.chunks(targets).map(weights).collect())
    }

    fn sampler<T: Keyed>(&self, values: Vec<T>) -> Result<Sampler<T>, SceneError> {
        let place = format!("{}.input", self.place);
        let input = self.given.input();
        let times: Vec<[f32; 1]> =
            (self.file).floats(&place, &input, &[Dimensions::Scalar], 0.0)?;
        let times = times.into_iter().map(|[time]| f64::from(time)).collect();
        let interpolation = match self.given.interpolation() {
            Given::Step => Interpolation::Step,
            Given::Linear => Interpolation::Linear,
            Given::CubicSpline => Interpolation::CubicSpline,
        };
        Sampler::new(times, values, interpolation).map_err(|fault| self.file.error(&place, fault))
    }
}
