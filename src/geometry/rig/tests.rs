use super::sampler::{Interpolation, Sampler};
use super::surface::{AlwaysTogether, Holding, Joints, MorphTarget, RigSurface};
use super::*;

fn node(parent: Option<usize>, translation: DVec3) -> RigNode {
    RigNode {
        parent,
        parent_from_node: DMat4::from_translation(translation),
        parts: NodeParts {
            translation,
            rotation: DQuat::IDENTITY,
            scale: DVec3::ONE,
        },
        weights: Vec::new(),
    }
}

fn quarter_turn(node: usize) -> Channel {
    let turns = vec![
        DQuat::IDENTITY,
        DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2),
    ];
    let sampler = Sampler::new(vec![0.0, 1.0], turns, Interpolation::Linear).expect("keys");
    Channel {
        node,
        track: Track::Rotation(sampler),
    }
}

fn playing(channels: Vec<Channel>) -> Clip {
    Clip {
        channels,
        duration_s: 1.0,
    }
}

fn surface(positions: Vec<DVec3>, holding: Holding) -> RigSurface {
    RigSurface {
        normals: vec![Some(DVec3::Y); positions.len()],
        positions,
        targets: Vec::new(),
        node: 0,
        holding,
    }
}

/// A bar along x: the first joint at its end holds what is before x = 1, the second what is beyond.
fn bar() -> Rig {
    let nodes = vec![node(None, DVec3::ZERO), node(Some(0), DVec3::X)];
    let joints = vec![
        (0, DMat4::IDENTITY),
        (1, DMat4::from_translation(DVec3::NEG_X)),
    ];
    let holds = vec![
        vec![(0, 1.0)],
        vec![(0, 0.5), (1, 0.5)],
        vec![(1, 0.25), (1, 0.75)],
        vec![],
    ];
    let positions = vec![
        DVec3::ZERO,
        DVec3::new(1.5, 0.0, 0.0),
        DVec3::X * 2.0,
        DVec3::Z,
    ];
    let held = Joints {
        skin: 0,
        joints,
        holds,
    };
    Rig {
        tree: NodeTree::new(nodes).expect("a tree"),
        surfaces: vec![surface(positions, Holding::Joints(held))],
    }
}

#[test]
fn a_bar_of_two_joints_bends_as_the_blended_matrices_say() {
    let rig = bar();
    let clip = playing(vec![quarter_turn(1)]);
    for step in 0..=4 {
        let part = f64::from(step) / 4.0;
        let (sine, cosine) = (part * std::f64::consts::FRAC_PI_2).sin_cos();
        let found = rig.vertices(Some((&clip, part)));
        // Beyond the joint it turns about it; half way it is in the middle of what both joints say.
        let beyond = |x: f64| DVec3::new(1.0 + cosine * (x - 1.0), sine * (x - 1.0), 0.0);
        let expected = [
            DVec3::ZERO,
            (DVec3::X * 1.5 + beyond(1.5)) / 2.0,
            beyond(2.0),
            DVec3::Z,
        ];
        for (found, expected) in found.positions.iter().zip(expected) {
            assert!(found.distance(expected) < 1e-12, "{found} {expected}");
        }
        // Normals stand on the blended matrix: turned where it only turns, and by half the turn where two share alike.
        let turned = |angle: f64| DVec3::new(-angle.sin(), angle.cos(), 0.0);
        let angle = part * std::f64::consts::FRAC_PI_2;
        let normals = found.normals.iter().flatten();
        for (found, angle) in normals.zip([0.0, angle / 2.0, angle, 0.0]) {
            assert!(found.distance(turned(angle)) < 1e-12, "{found} {angle}");
        }
    }
    let at_rest = rig.vertices(None);
    assert_eq!(at_rest.positions, rig.surfaces[0].positions);
}

#[test]
fn children_go_with_their_parents_in_any_order() {
    // A child before its parent: two quarter turns make one half turn.
    let nodes = vec![node(Some(1), DVec3::X), node(None, DVec3::Y)];
    let tree = NodeTree::new(nodes).expect("a tree");
    let clip = playing(vec![quarter_turn(0), quarter_turn(1)]);
    let pose = tree.pose(Some((&clip, 1.0)));
    let found = pose.scene_from_node[0].transform_point3(DVec3::X);
    assert!(
        found.distance(DVec3::new(-1.0, 2.0, 0.0)) < 1e-12,
        "{found}"
    );
}

#[test]
fn who_is_its_own_ancestor_is_told() {
    let circle = vec![
        node(None, DVec3::X),
        node(Some(2), DVec3::X),
        node(Some(1), DVec3::X),
    ];
    assert_eq!(NodeTree::new(circle).err(), Some(1));
    assert_eq!(NodeTree::new(vec![node(Some(7), DVec3::X)]).err(), Some(0));
}

#[test]
fn morph_targets_add_up_by_their_weights() {
    let mut rig = Rig {
        tree: NodeTree::new(vec![node(None, DVec3::Z)]).expect("a tree"),
        surfaces: vec![surface(vec![DVec3::X, DVec3::Y], Holding::Node)],
    };
    rig.surfaces[0].targets = vec![
        MorphTarget {
            positions: vec![DVec3::X, DVec3::ZERO],
            normals: vec![DVec3::X * 2.0, DVec3::ZERO],
        },
        MorphTarget {
            positions: vec![DVec3::ZERO, DVec3::Y * 4.0],
            normals: Vec::new(),
        },
    ];
    let keys = vec![vec![0.0, 0.0], vec![1.0, -0.5]];
    let sampler = Sampler::new(vec![0.0, 1.0], keys, Interpolation::Linear).expect("keys");
    let clip = playing(vec![Channel {
        node: 0,
        track: Track::Weights(sampler),
    }]);
    let found = rig.vertices(Some((&clip, 0.5)));
    let expected = [DVec3::new(1.5, 0.0, 1.0), DVec3::new(0.0, 0.0, 1.0)];
    assert_eq!(found.positions, expected);
    let normal = found.normals[0].expect("a normal");
    assert!(normal.distance(DVec3::new(1.0, 1.0, 0.0).normalize()) < 1e-12);
    assert_eq!(found.normals[1], Some(DVec3::Y));
    // Without weights at rest it is as it is.
    assert_eq!(rig.vertices(None).positions[0], DVec3::new(1.0, 0.0, 1.0));
}

#[test]
fn vertices_are_one_if_nothing_can_part_them() {
    let joints = |holds: Vec<Vec<(u32, f64)>>| {
        Holding::Joints(Joints {
            skin: 3,
            joints: vec![(0, DMat4::IDENTITY), (1, DMat4::IDENTITY)],
            holds,
        })
    };
    let places = vec![DVec3::X, DVec3::X, DVec3::X, DVec3::Y];
    let both = vec![(1, 0.5), (0, 0.5)];
    let holds = vec![
        vec![(0, 0.5), (1, 0.5)],
        both.clone(),
        vec![(0, 0.25), (1, 0.75)],
        both.clone(),
    ];
    let mut known = AlwaysTogether::default();
    // The order of joints is nothing, their weights and the place are.
    assert_eq!(known.numbers(&surface(places, joints(holds))), [0, 0, 1, 2]);
    // Of another primitive of that skin; of a node; and morphed.
    let one = || vec![DVec3::X];
    assert_eq!(known.numbers(&surface(one(), joints(vec![both]))), [0]);
    assert_eq!(known.numbers(&surface(one(), Holding::Node)), [3]);
    let mut morphed = surface(one(), Holding::Node);
    morphed.targets.push(MorphTarget {
        positions: vec![DVec3::Z],
        normals: Vec::new(),
    });
    assert_eq!(known.numbers(&morphed), [4]);
}
