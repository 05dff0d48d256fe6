//! `[probe]` and `[[room]]`: the light that a probe saw, and the room that sent it.

use std::collections::HashMap;
use std::path::PathBuf;

use glam::{DVec3, Vec3};

use super::anchors::unique_name;
use super::error::SceneError;
use super::mesh_file::{self, MeshReading, Normals};
use super::named_files::FileKind;
use super::objects::{ALBEDO, STANDING, StandingKeys, anchor_index};
use super::placement::{ANGLE, POSITION, PlacementKeys, placement};
use super::probe_file::{ProbeFile, ProbeKind, ProbeReading, read};
use super::ranges::Numbers;
use super::reader::{Table, Value};
use super::schema::key::Missing::{Is, Means};
use super::schema::section::{Example, Section, Times};
use super::schema::values::{InWords, Vectors, Written};
use super::{Anchor, ProbeScene, RoomPiece};
use crate::geometry::cuboid::cuboid;
use crate::geometry::winding::winding_number;

/// Without a room the light comes from a box that reaches so far to each side of the probe: on a table it comes from the same
/// direction everywhere, to a tenth of a degree.
const FAR_M: f32 = 300.0;
/// What stands nearer to such a probe was not there when it was taken, or is nothing of what it saw.
pub const BEYOND_M: f32 = FAR_M / 2.0;

keys! {
    /// Keys of `[probe]`.
    pub static PROBE: ProbeKeys;
    required {
        /// What it saw, in linear radiance.
        image: PathBuf, FileKind::Probe => "a picture in linear radiance (.hdr or .exr) is expected";
    }
    /// What the picture is.
    kind: ProbeKind => Is(ProbeKind::LatitudeLongitude);
    /// Which layer of an OpenEXR file, by its name or the part of its channels' names before the last dot.
    layer: Option<String> => Means(None, "the only one, or the one that is called combined");
    /// By how much all of it is turned to the left, seen from above.
    turn_deg: f64, ANGLE => Is(0.0);
    /// Where it was taken, in the world.
    position_m: DVec3, Vectors::three(POSITION) => Is(DVec3::ZERO);
    /// Display white over the probe's unit of radiance.
    exposure: f64, Numbers::above(0.0, 1e9) => Is(1.0);
    /// The room around it, in the world; its MTL's Kd is reflectance, else that is estimated from the probe.
    room: Written, InWords::file("an OBJ file or a list of them", FileKind::RoomMesh) => Means(Written, "what [[room]] says");
}

keys! {
    /// A part of the room.
    pub static ROOM: RoomKeys;

    /// Its name, if it has one.
    name: Option<String> => Means(None, "none");
    /// Its shape: one of mesh, box_m and corners_m.
    mesh: Option<PathBuf>, FileKind::RoomMesh => Means(None, "none: it has one of the others");
    /// x0, y0, z0, x1, y1, z1; lit from within where the probe was taken within, else from outside.
    box_m: Option<[f64; 6]>, POSITION => Means(None, "none: it has one of the others");
    /// Three or four corners of a flat polygon, lit from where the probe was taken.
    corners_m: Written, InWords::new("[[x, y, z], …] in metres") => Means(Written, "none: it has one of the others");
}

keys! {
    /// What a part of the room is made of.
    pub static ROOM_SURFACE: RoomSurfaceKeys;

    /// Diffuse reflectance, linear RGB.
    albedo: Option<DVec3>, ALBEDO => Means(None, "what an MTL file says, else estimated from the probe");
}

/// `[probe]`.
pub static PROBE_SECTION: Section = Section {
    name: "probe",
    says: "The light of a room, seen by a light probe (gnomon probe makes one); then technique \"shafts\" is there. Without \
           a [[room]] all light comes from far away.",
    times: Times::UpToOnce,
    groups: &[ProbeKeys::ALL, StandingKeys::ALL],
    shown: &[
        ("image", Example::Live("\"probe.hdr\"")),
        ("layer", Example::Aside("\"ViewLayer.Combined\"")),
        ("position_m", Example::Live("[0, 0, 0.06]")),
        ("on", Example::Aside("\"dial\"")),
        ("room", Example::Live("\"room.obj\"")),
    ],
    is_aside: true,
};

/// `[[room]]`.
pub static ROOM_SECTION: Section = Section {
    name: "room",
    says: "Parts of the room beside or instead of the probe's files.",
    times: Times::Any,
    groups: &[RoomKeys::ALL, PlacementKeys::ALL, RoomSurfaceKeys::ALL],
    shown: &[
        ("name", Example::Live("\"walls\"")),
        ("mesh", Example::Live("\"shelf.obj\"")),
        ("box_m", Example::Live("[-2, -1.7, -0.75, 2, 1.7, 1.75]")),
        (
            "corners_m",
            Example::Live("[[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]"),
        ),
        ("albedo", Example::Live("0.7")),
    ],
    is_aside: true,
};

/// The probe and its room; `None` without `[probe]`.
pub fn probe(root: &Table, anchors: &[Anchor]) -> Result<Option<ProbeScene>, SceneError> {
    let rooms = ROOM_SECTION.tables(root)?;
    let Some(table) = PROBE_SECTION.table(root)? else {
        return match rooms.first() {
            Some(room) => Err(room.error(
                "room: it is lit by a [probe], and there is none; allowed: no [[room]], or one with a [probe]",
            )),
            None => Ok(None),
        };
    };
    let path = PROBE.image.read(&table)?;
    let image = PROBE.image.require(&table)?;
    let layer = PROBE.layer.read(&table)?;
    let reading = ProbeReading {
        kind: PROBE.kind.read(&table)?,
        turn: PROBE.turn_deg.read(&table)?.to_radians(),
        layer: layer.as_deref(),
    };
    let ProbeFile { probe, notes } =
        read(&path, reading).map_err(|message| image.error(message))?;
    let position_m = PROBE.position_m.read(&table)?;
    let exposure = PROBE.exposure.read(&table)?;
    let mut room = Vec::new();
    if let Some(files) = PROBE.room.value(&table) {
        let files = match files.text() {
            Ok(_) => vec![files],
            Err(_) => files.array("an OBJ file or a list of them is expected")?,
        };
        for file in &files {
            let piece = mesh_piece(file, None)?;
            room.push(piece);
        }
    }
    let mut name_lines = HashMap::new();
    for table in &rooms {
        room.push(piece(table, &mut name_lines)?);
    }
    let is_far = room.is_empty();
    let anchor = match STANDING.on.value(&table) {
        Some(on) => {
            let anchor = anchor_index(&on, anchors)?;
            if anchor != 0 && !is_far {
                let message = "light of a room stays where the room is; allowed: a probe without a room, or in the world";
                return Err(on.error(message));
            }
            anchor
        }
        None => 0,
    };
    if is_far {
        let around = [-FAR_M, FAR_M].map(|way| position_m.as_vec3() + way);
        room.push(box_between(around, None));
    }
    for piece in &mut room {
        turn_to(piece, position_m.as_vec3());
    }
    Ok(Some(ProbeScene {
        image: path,
        probe,
        notes,
        anchor,
        position_m,
        exposure,
        room,
        is_far,
    }))
}

fn piece(table: &Table, name_lines: &mut HashMap<String, usize>) -> Result<RoomPiece, SceneError> {
    if let Some(name) = ROOM.name.value(table) {
        unique_name(&name, name_lines)?;
    }
    let albedo = ROOM_SURFACE.albedo.read(table)?;
    let shapes = [
        ROOM.mesh.value(table),
        ROOM.box_m.value(table),
        ROOM.corners_m.value(table),
    ];
    let mut given = shapes.iter().flatten();
    let (Some(_), None) = (given.next(), given.next()) else {
        return Err(table.error("room: one shape is expected; allowed: mesh, box_m or corners_m"));
    };
    let mut piece = match &shapes {
        [Some(mesh), ..] => mesh_piece(mesh, albedo)?,
        [_, Some(bounds), _] => box_piece(bounds, albedo)?,
        [.., corners] => corners_piece(corners.as_ref(), table, albedo)?,
    };
    let world_from_piece = placement(table)?.anchor_from_object();
    for (triangle, _) in &mut piece.triangles {
        let place = |corner: Vec3| {
            world_from_piece
                .transform_point3(corner.as_dvec3())
                .as_vec3()
        };
        *triangle = triangle.map(place);
        if world_from_piece.matrix3.determinant() < 0.0 {
            triangle.swap(1, 2);
        }
    }
    Ok(piece)
}

fn mesh_piece(value: &Value, albedo: Option<DVec3>) -> Result<RoomPiece, SceneError> {
    let loaded = mesh_file::load(
        value,
        FileKind::RoomMesh,
        MeshReading::plain(Normals::Flat),
        None,
    )?;
    let mesh = loaded.mesh;
    let triangles = mesh.triangles.iter().zip(&mesh.triangle_materials);
    let triangles = triangles.map(|(triangle, &material)| {
        let given =
            loaded.is_given[material as usize].then(|| loaded.materials[material as usize].albedo);
        let corners = triangle.map(|corner| mesh.positions[corner as usize]);
        (corners, albedo.or(given).map(|albedo| albedo.as_vec3()))
    });
    Ok(RoomPiece {
        triangles: triangles.collect(),
        is_closed: loaded.report.closed,
    })
}

/// A box: a room around the probe, or something in it.
fn box_piece(value: &Value, albedo: Option<DVec3>) -> Result<RoomPiece, SceneError> {
    let [x0, y0, z0, x1, y1, z1] = value.numbers::<6>(&POSITION)?.map(|part| part as f32);
    if x0 >= x1 || y0 >= y1 || z0 >= z1 {
        return Err(value.error(
            "no volume; allowed: [x0, y0, z0, x1, y1, z1] with x0 < x1, y0 < y1 and z0 < z1",
        ));
    }
    let corners = [Vec3::new(x0, y0, z0), Vec3::new(x1, y1, z1)];
    Ok(box_between(corners, albedo.map(|albedo| albedo.as_vec3())))
}

/// A box between its lowest and its highest corner.
fn box_between([low, high]: [Vec3; 2], albedo: Option<Vec3>) -> RoomPiece {
    let (corners, triangles) = cuboid(low, high);
    let places = |triangle: [u32; 3]| triangle.map(|corner| corners[corner as usize]);
    let triangles = triangles
        .into_iter()
        .map(|corners| (places(corners), albedo));
    RoomPiece {
        triangles: triangles.collect(),
        is_closed: true,
    }
}

/// A flat polygon of three or four corners.
fn corners_piece(
    value: Option<&Value>,
    table: &Table,
    albedo: Option<DVec3>,
) -> Result<RoomPiece, SceneError> {
    const WHAT: &str = "three or four corners are expected: [[x, y, z], …] in metres";
    let value = value.ok_or_else(|| table.error(WHAT))?;
    let corners: Vec<Vec3> = value
        .array(WHAT)?
        .iter()
        .map(|corner| Ok(DVec3::from_array(corner.numbers(&POSITION)?).as_vec3()))
        .collect::<Result<_, SceneError>>()?;
    let triangles: &[[usize; 3]] = match corners.len() {
        3 => &[[0, 1, 2]],
        4 => &[[0, 1, 2], [0, 2, 3]],
        _ => return Err(value.error(WHAT)),
    };
    let albedo = albedo.map(|albedo| albedo.as_vec3());
    let triangles = triangles
        .iter()
        .map(|triangle| (triangle.map(|corner| corners[corner]), albedo));
    Ok(RoomPiece {
        triangles: triangles.collect(),
        is_closed: false,
    })
}

/// Turns the lit side of a piece's triangles to the front: what is closed is lit from outside, or from inside where the
/// probe was taken there; a sheet from where the probe was taken.
fn turn_to(piece: &mut RoomPiece, probe_m: Vec3) {
    if piece.is_closed {
        let corners: Vec<Vec3> = piece
            .triangles
            .iter()
            .flat_map(|(corners, _)| *corners)
            .collect();
        let indices = (0..piece.triangles.len() as u32)
            .map(|triangle| [3 * triangle, 3 * triangle + 1, 3 * triangle + 2]);
        if winding_number(&corners, indices, probe_m.as_dvec3()).abs() > 0.5 {
            for (corners, _) in &mut piece.triangles {
                corners.swap(1, 2);
            }
        }
        return;
    }
    for (corners, _) in &mut piece.triangles {
        let [a, b, c] = *corners;
        if (b - a).cross(c - a).dot(probe_m - a) < 0.0 {
            corners.swap(1, 2);
        }
    }
}
