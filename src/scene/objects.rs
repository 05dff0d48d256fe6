//! `[[phantom]]`, `[[virtual]]` and `[table]`: the things.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec3};

use super::anchors::unique_name;
use super::animation::AnimationKeys;
use super::error::{SceneError, suggestion};
use super::laid_picture::Laid;
use super::mesh_file::{self, LoadedMesh};
use super::motion::{Motion, MotionKeys, motion};
use super::named_files::FileKind;
use super::placement::{POSITION, PlacementKeys, placement};
use super::ranges::Numbers;
use super::raw_model::DEFAULT_ALBEDO;
use super::reader::{Table, Value};
use super::schema::key::Missing::{Is, Means};
use super::schema::section::{Example, Section, Times};
use super::schema::values::{InWords, Vectors, Written};
use super::shapes::{ShapeKeys, ShapeKind, of_basic_shape, rectangle, shape};
use super::{Anchor, Object};
use crate::light::Material;

/// Diffuse reflectance.
pub const ALBEDO: Vectors = Vectors::one_or_three(Numbers::between(0.0, 1.0));

keys! {
    /// The name of a thing.
    pub static THING_NAME: ThingNameKeys;
    required {
        /// No other phantom or virtual thing may have it.
        name: String => "a name in quotes is expected";
    }
}

keys! {
    /// What a thing or a light stands on.
    pub static STANDING: StandingKeys;

    /// The board or marker that it stands on.
    on: Written, InWords::new("a board's or a marker's name") => Means(Written, "the world");
}

keys! {
    /// How a thing looks and whether it is there.
    pub static THING: ThingKeys;

    /// Each key of it that is given replaces that of every material of the mesh.
    material: Written, InWords::parts("a table", &MATERIAL_SECTION) => Means(Written, "what the MTL file says");
    /// It takes light away from others.
    casts: bool => Is(true);
    /// It is there; what is not neither shows, nor casts, nor catches shadows.
    visible: bool => Is(true);
}

keys! {
    /// What only virtual things have.
    pub static VIRTUAL: VirtualKeys;

    /// Where the file has no normals, faces that meet at up to this angle look like one smooth surface, and so do sides of an
    /// outline or of a profile; 0 is flat.
    smooth_deg: f64, Numbers::between(0.0, 180.0).unit("degrees") => Is(30.0);
}

keys! {
    /// What a surface is made of.
    pub static MATERIAL: MaterialKeys;

    /// Diffuse reflectance, linear RGB.
    albedo: Option<DVec3>, ALBEDO => Means(None, "what the MTL file says, else 0.5");
    /// A picture of the diffuse reflectance, in sRGB, that lies as the mesh's texture coordinates say, or is spread over a
    /// rect_m, its upper edge towards +y. It is multiplied by albedo, which is then 1 where it is not given.
    albedo_texture: Option<PathBuf>, FileKind::Picture => Means(None, "what the mesh's file says");
    /// Of a GGX layer over it.
    roughness: Option<f64>, Numbers::above(0.0, 1.0) => Means(None, "what the MTL file says, else none: the surface is matt");
    /// Part that is metal, which has albedo as the colour of what it mirrors; without a roughness it has 0.25.
    metallic: Option<f64>, Numbers::between(0.0, 1.0) => Means(None, "what the mesh's file says, else 0");
}

keys! {
    /// Keys of `[table]`.
    pub static TABLE: TableKeys;
    required {
        /// x0, y0, x1, y1 in the world.
        rect_m: Written, InWords::new("[x0, y0, x1, y1] in metres") => "[x0, y0, x1, y1] in metres is expected";
    }
    /// Its z in the world.
    height_m: f64, POSITION => Is(0.0);
    /// Diffuse reflectance, linear RGB.
    albedo: DVec3, ALBEDO => Is(DVec3::splat(DEFAULT_ALBEDO));
    /// A picture of the diffuse reflectance, in sRGB, spread over the table, its upper edge towards +y. It is multiplied by
    /// albedo, which is then 1 where it is not given.
    albedo_texture: Option<PathBuf>, FileKind::Picture => Means(None, "none: it has one colour");
    /// It is there; what is not neither shows, nor catches shadows.
    visible: bool => Is(true);
}

/// A thing's `material`.
pub static MATERIAL_SECTION: Section = Section {
    name: "material",
    says: "What a surface is made of.",
    times: Times::InBraces,
    groups: &[MaterialKeys::ALL],
    shown: &[],
    is_aside: false,
};

/// `[table]`.
pub static TABLE_SECTION: Section = Section {
    name: "table",
    says: "The table's top, a phantom by the name of \"table\" that casts no shadow.",
    times: Times::UpToOnce,
    groups: &[TableKeys::ALL],
    shown: &[
        ("rect_m", Example::Live("[-0.6, -0.5, 0.6, 0.5]")),
        ("albedo", Example::Live("0.5")),
        ("albedo_texture", Example::Aside("\"cloth.png\"")),
    ],
    is_aside: false,
};

/// What the reference shows for a thing's keys: its name, its file, its place, rotation and scale, and its material.
const fn shown_of_thing(
    name: &'static str,
    mesh: &'static str,
    [position_m, rotation_deg, scale]: [&'static str; 3],
    material: &'static str,
) -> [(&'static str, Example); 22] {
    [
        ("name", Example::Live(name)),
        ("mesh", Example::Live(mesh)),
        ("up", Example::Aside("\"y\"")),
        ("fit_m", Example::Aside("0.1")),
        ("box_m", Example::Aside("[0.15, 0.21, 0.03]")),
        ("cylinder_m", Example::Aside("[0.04, 0.1]")),
        ("cone_m", Example::Aside("[0.03, 0.08]")),
        ("sphere_m", Example::Aside("0.025")),
        ("rect_m", Example::Aside("[0.297, 0.21]")),
        (
            "prism",
            Example::Aside("{ outline_m = [[0, 0], [0.08, 0], [0, 0.05]], height_m = 0.02 }"),
        ),
        (
            "revolved",
            Example::Aside("{ profile_m = [[0, 0], [0.03, 0], [0.035, 0.1], [0.015, 0.14]] }"),
        ),
        ("on", Example::Live("\"table\"")),
        ("position_m", Example::Live(position_m)),
        ("rotation_deg", Example::Live(rotation_deg)),
        ("scale", Example::Live(scale)),
        ("turn_deg_per_s", Example::Aside("30")),
        (
            "path",
            Example::Aside("[{ time_s = 0 }, { time_s = 2, position_m = [0.1, 0, 0] }]"),
        ),
        ("path_end", Example::Aside("\"return\"")),
        ("animation", Example::Aside("\"Walk\"")),
        ("animation_speed", Example::Aside("0.5")),
        ("animation_loop", Example::Aside("false")),
        ("material", Example::Live(material)),
    ]
}

/// `[[phantom]]`.
pub static PHANTOM_SECTION: Section = Section {
    name: "phantom",
    says: "Coarse models of real things. Never drawn; they hide virtual things, catch their shadows and cast their own on \
           them.",
    times: Times::Any,
    groups: &[
        ThingNameKeys::ALL,
        ShapeKeys::ALL,
        StandingKeys::ALL,
        PlacementKeys::ALL,
        MotionKeys::ALL,
        AnimationKeys::ALL,
        ThingKeys::ALL,
    ],
    shown: &shown_of_thing(
        "\"house\"",
        "\"models/house.obj\"",
        ["[-0.055, 0.035, 0.0]", "[0, 0, 20]", "1"],
        "{ albedo = [0.62, 0.55, 0.42] }",
    ),
    is_aside: false,
};

/// `[[virtual]]`.
pub static VIRTUAL_SECTION: Section = Section {
    name: "virtual",
    says: "What only the picture shows.",
    times: Times::Any,
    groups: &[
        ThingNameKeys::ALL,
        ShapeKeys::ALL,
        StandingKeys::ALL,
        PlacementKeys::ALL,
        MotionKeys::ALL,
        AnimationKeys::ALL,
        ThingKeys::ALL,
        VirtualKeys::ALL,
    ],
    shown: &shown_of_thing(
        "\"torus\"",
        "\"models/torus.obj\"",
        ["[0.022, 0.0, 0.036]", "[70, 0, 35]", "[1, 1, 1]"],
        "{ albedo = [0.75, 0.16, 0.12], roughness = 0.4 }",
    ),
    is_aside: false,
};

#[derive(Clone, Copy, PartialEq)]
enum ThingKind {
    Phantom,
    Virtual,
}

/// The phantoms, the table top first, and the virtual things.
pub fn objects(root: &Table, anchors: &[Anchor]) -> Result<(Vec<Object>, Vec<Object>), SceneError> {
    let mut name_lines = HashMap::new();
    let mut phantoms = Vec::new();
    if let Some(table) = root.optional(TABLE_SECTION.name) {
        name_lines.insert(TABLE_SECTION.name.to_owned(), table.line());
        phantoms.push(table_top(&TABLE_SECTION.table_of(&table)?)?);
    }
    for table in PHANTOM_SECTION.tables(root)? {
        phantoms.push(object(
            &table,
            ThingKind::Phantom,
            anchors,
            &mut name_lines,
        )?);
    }
    let mut virtuals = Vec::new();
    for table in VIRTUAL_SECTION.tables(root)? {
        virtuals.push(object(
            &table,
            ThingKind::Virtual,
            anchors,
            &mut name_lines,
        )?);
    }
    // Each thing that moves, or changes its shape, has a node of its own, after the anchors.
    let moving = phantoms.iter_mut().chain(&mut virtuals);
    for (index, thing) in moving.filter(|thing| thing.motion.is_some()).enumerate() {
        thing.anchor = anchors.len() + index;
    }
    Ok((phantoms, virtuals))
}

fn table_top(table: &Table) -> Result<Object, SceneError> {
    let rect = TABLE.rect_m.require(table)?;
    let albedo = TABLE.albedo.read(table)?;
    let height_m = TABLE.height_m.read(table)?;
    let mut loaded = of_basic_shape(&rectangle(&rect)?, mesh_file::Normals::Flat, &rect)?;
    loaded.materials = vec![Material::matt(albedo)];
    if let Some(picture) = TABLE.albedo_texture.value(table) {
        let laid = Laid::on(ShapeKind::Rectangle, &mut loaded);
        laid.lay(&picture, TABLE.albedo.value(table).is_none())?;
    }
    Ok(Object {
        name: TABLE_SECTION.name.to_owned(),
        shape: ShapeKind::Rectangle,
        mesh: loaded.mesh,
        mesh_report: loaded.report,
        materials: loaded.materials,
        material_names: loaded.material_names,
        textures: loaded.textures,
        notes: Vec::new(),
        clips: Vec::new(),
        animation: None,
        anchor: 0,
        motion: None,
        anchor_from_object: DAffine3::from_translation(DVec3::Z * height_m),
        casts: false,
        visible: TABLE.visible.read(table)?,
    })
}

fn object(
    table: &Table,
    kind: ThingKind,
    anchors: &[Anchor],
    name_lines: &mut HashMap<String, usize>,
) -> Result<Object, SceneError> {
    let name = unique_name(&THING_NAME.name.require(table)?, name_lines)?;
    let anchor = STANDING
        .on
        .value(table)
        .map_or(Ok(0), |on| anchor_index(&on, anchors))?;
    let anchor_from_object = placement(table)?.anchor_from_object();
    let casts = THING.casts.read(table)?;
    let visible = THING.visible.read(table)?;
    let normals = match kind {
        // What a phantom's triangles catch and cast has to agree with how they face, so they are flat.
        ThingKind::Phantom => mesh_file::Normals::Flat,
        ThingKind::Virtual => mesh_file::Normals::GivenOrMade {
            crease_rad: VIRTUAL.smooth_deg.read(table)?.to_radians(),
        },
    };
    let material = MATERIAL_SECTION.table(table)?;
    let picture = material
        .as_ref()
        .and_then(|material| MATERIAL.albedo_texture.value(material));
    let (shape, mut loaded) = shape(table, &name, normals, picture.is_some())?;
    let changes_shape = loaded.animation.is_some();
    if let Some(material) = &material {
        override_materials(&mut loaded, material)?;
        if let Some(picture) = picture {
            let is_white = MATERIAL.albedo.value(material).is_none();
            Laid::on(shape, &mut loaded).lay(&picture, is_white)?;
        }
    }
    let mesh = loaded.mesh;
    // A mirror turns each triangle's winding; turning it back keeps the outside outside.
    let mirrored = anchor_from_object.matrix3.determinant() < 0.0;
    let mesh = if mirrored {
        Arc::new(Arc::unwrap_or_clone(mesh).with_winding_reversed())
    } else {
        mesh
    };
    Ok(Object {
        name,
        shape,
        mesh,
        mesh_report: loaded.report,
        materials: loaded.materials,
        material_names: loaded.material_names,
        textures: loaded.textures,
        notes: loaded.notes,
        clips: loaded.clips,
        anchor,
        motion: motion(table, anchor)?.or(changes_shape.then(|| Motion::none(anchor))),
        animation: loaded.animation,
        anchor_from_object,
        casts,
        visible,
    })
}

/// The anchor of a name.
pub fn anchor_index(on: &Value, anchors: &[Anchor]) -> Result<usize, SceneError> {
    let written = on.text()?;
    anchors
        .iter()
        .position(|anchor| anchor.name == written)
        .ok_or_else(|| {
            let names: Vec<&str> = anchors.iter().map(|anchor| anchor.name.as_str()).collect();
            on.error(format!(
                "no board or marker has this name{}",
                suggestion(written, &names)
            ))
        })
}

/// Each key that the scene gives replaces that of every material of the mesh, with the picture that says it and, of the
/// colour, the corners' colours.
fn override_materials(loaded: &mut LoadedMesh, table: &Table) -> Result<(), SceneError> {
    let albedo = MATERIAL.albedo.read(table)?;
    let roughness = MATERIAL.roughness.read(table)?;
    let metallic = MATERIAL.metallic.read(table)?;
    for material in &mut loaded.materials {
        if let Some(albedo) = albedo {
            material.albedo = albedo;
            material.maps.color = None;
        }
        if let Some(roughness) = roughness {
            material.roughness = Some(roughness);
            material.maps.roughness = None;
        }
        if let Some(metallic) = metallic {
            material.metallic = metallic;
            material.maps.metallic = None;
        }
    }
    if albedo.is_some() && !loaded.mesh.looks.is_empty() {
        for look in &mut Arc::make_mut(&mut loaded.mesh).looks {
            look.color = Vec3::ONE.extend(look.color.w);
        }
    }
    Ok(())
}
