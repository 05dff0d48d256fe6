//! The shape of a thing: a mesh's file, or a few numbers.

use std::path::PathBuf;

use glam::{DVec2, DVec3};

use super::animation::WantedAnimation;
use super::error::SceneError;
use super::mesh_file::{self, LoadedMesh, MeshReading, Normals, Up};
use super::named_files::FileKind;
use super::placement::POSITION;
use super::ranges::Numbers;
use super::raw_model::{GivenMaterial, RawModel};
use super::reader::{Table, Value};
use super::schema::key::Missing::Means;
use super::schema::section::{AnyKey, Section, Times};
use super::schema::values::{InWords, Written};
use crate::geometry::shapes::{BasicShape, Outline, OutlineFault, Profile, ShapeTriangles};

/// How large a thing may be.
const LENGTH: Numbers = Numbers::above(0.0, 1e5).unit("m");
/// A profile's distance from the axis.
const RADIUS: Numbers = Numbers::between(0.0, 1e5).unit("m");
/// An outline or a profile has no more places.
const MOST_PLACES: usize = 2048;

keys! {
    /// The shape of a thing.
    pub static SHAPE: ShapeKeys;

    /// Its shape from a file; a thing has one, or one of the shapes from box_m to revolved.
    /// Counter-clockwise seen from outside; materials from its file or MTL file (Kd is taken as linear reflectance, Ns or Pr as
    /// roughness; see docs/models.md). A phantom is always flat: normals in the file are passed over.
    mesh: Option<PathBuf>, FileKind::Mesh => Means(None, "none: it has another shape");
    /// Which axis of the mesh's file points up, along z of what it stands on.
    up: Option<Up> => Means(None, "\"z\"; glTF: \"y\"");
    /// What the longest side of the mesh is scaled to; the file's origin stays.
    fit_m: Option<f64>, Numbers::above(0.0, 1e5).unit("m") => Means(None, "the numbers in the file are metres");
    /// Instead of a mesh: a box of these sides that stands on its origin, the middle of its bottom; or one between two
    /// corners.
    box_m: Written, InWords::new("[x, y, z] or [x0, y0, z0, x1, y1, z1] in metres") => Means(Written, "none");
    /// Instead of a mesh: a cylinder about z that stands on its origin.
    cylinder_m: Written, InWords::new("[radius, height] in metres") => Means(Written, "none");
    /// Instead of a mesh: a cone about z that stands on its origin.
    cone_m: Written, InWords::new("[radius, height] in metres") => Means(Written, "none");
    /// Instead of a mesh: the radius of a ball that lies on its origin.
    sphere_m: Option<f64>, LENGTH => Means(None, "none");
    /// Instead of a mesh: a flat rectangle that faces +z, of these sides with its origin in its middle; or one between two
    /// corners.
    rect_m: Written, InWords::new("[x, y] or [x0, y0, x1, y1] in metres") => Means(Written, "none");
    /// Instead of a mesh: an outline pulled up from its plane.
    prism: Written, InWords::parts("a table", &PRISM_SECTION) => Means(Written, "none");
    /// Instead of a mesh: a profile turned about z.
    revolved: Written, InWords::parts("a table", &REVOLVED_SECTION) => Means(Written, "none");
}

keys! {
    /// An outline pulled up.
    pub static PRISM: PrismKeys;
    required {
        /// Its places at z = 0 in their order, either way round; it may be concave.
        outline_m: Written, InWords::new("[[x, y], …] in metres, three or more") => "[[x, y], …] in metres is expected";
        /// How far up it goes.
        height_m: f64, LENGTH => "a length in metres is expected";
    }
}

keys! {
    /// A profile turned about z.
    pub static REVOLVED: RevolvedKeys;
    required {
        /// Its places in their order, up or down. Ends beside the axis are closed by flat discs; a ring ends where it begins.
        profile_m: Written, InWords::new("[[radius, height], …] in metres, two or more") => "[[radius, height], …] in metres is expected";
    }
}

/// A thing's `prism`.
pub static PRISM_SECTION: Section = in_braces("prism", "An outline pulled up.", &[PrismKeys::ALL]);
/// A thing's `revolved`.
pub static REVOLVED_SECTION: Section = in_braces(
    "revolved",
    "A profile turned about z.",
    &[RevolvedKeys::ALL],
);

const fn in_braces(
    name: &'static str,
    says: &'static str,
    groups: &'static [&'static [&'static dyn AnyKey]],
) -> Section {
    Section {
        name,
        says,
        times: Times::InBraces,
        groups,
        shown: &[],
        is_aside: false,
    }
}

/// What a thing's shape is given by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ShapeKind {
    /// A file.
    #[default]
    Mesh,
    /// `box_m`.
    Box,
    /// `cylinder_m`.
    Cylinder,
    /// `cone_m`.
    Cone,
    /// `sphere_m`.
    Sphere,
    /// `rect_m`.
    Rectangle,
    /// `prism`.
    Prism,
    /// `revolved`.
    Revolved,
}

impl ShapeKind {
    const ALL: [Self; 8] = [
        Self::Mesh,
        Self::Box,
        Self::Cylinder,
        Self::Cone,
        Self::Sphere,
        Self::Rectangle,
        Self::Prism,
        Self::Revolved,
    ];

    /// What it is called.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mesh => "mesh",
            Self::Box => "box",
            Self::Cylinder => "cylinder",
            Self::Cone => "cone",
            Self::Sphere => "sphere",
            Self::Rectangle => "rectangle",
            Self::Prism => "prism",
            Self::Revolved => "revolved profile",
        }
    }

    /// The key that gives it.
    fn key(self) -> &'static str {
        match self {
            Self::Mesh => SHAPE.mesh.name,
            Self::Box => SHAPE.box_m.name,
            Self::Cylinder => SHAPE.cylinder_m.name,
            Self::Cone => SHAPE.cone_m.name,
            Self::Sphere => SHAPE.sphere_m.name,
            Self::Rectangle => SHAPE.rect_m.name,
            Self::Prism => SHAPE.prism.name,
            Self::Revolved => SHAPE.revolved.name,
        }
    }
}

/// Reads the one shape that a thing has; a mesh's texture coordinates are kept if that is asked for.
pub fn shape(
    table: &Table,
    name: &str,
    normals: Normals,
    keeps_coordinates: bool,
) -> Result<(ShapeKind, LoadedMesh), SceneError> {
    let allowed = ShapeKind::ALL.map(ShapeKind::key).join(", ");
    let mut given = ShapeKind::ALL
        .into_iter()
        .filter_map(|kind| Some((kind, table.optional(kind.key())?)));
    let Some((kind, value)) = given.next() else {
        let message = format!("\"{name}\": no shape; one of {allowed} is expected");
        return Err(table.error(message));
    };
    if let Some((_, other)) = given.next() {
        return Err(other.error(format!(
            "the thing has a shape, {}; allowed: one of {allowed}",
            kind.key()
        )));
    }
    let wanted = WantedAnimation::read(table)?;
    if kind == ShapeKind::Mesh {
        let reading = MeshReading {
            normals,
            up: SHAPE.up.read(table)?,
            fit_m: SHAPE.fit_m.read(table)?,
            keeps_coordinates,
        };
        let loaded = mesh_file::load(&value, SHAPE.mesh.takes, reading, wanted.as_ref())?;
        return Ok((kind, loaded));
    }
    if let Some(wanted) = wanted {
        let message = format!(
            "it is of a glTF file, and the thing has {}; allowed: turn_deg_per_s and path",
            kind.key()
        );
        return Err(wanted.error(&message));
    }
    if let Some(of_mesh) = SHAPE.up.value(table).or_else(|| SHAPE.fit_m.value(table)) {
        return Err(of_mesh.error(format!(
            "it is of a mesh's file, and the thing has {}; allowed: rotation_deg and scale",
            kind.key()
        )));
    }
    let shape = match kind {
        ShapeKind::Mesh | ShapeKind::Box => cuboid(&value)?,
        ShapeKind::Cylinder => {
            let [radius_m, height_m] = value.numbers(&LENGTH)?;
            between_discs(&value, [radius_m, radius_m], height_m)?
        }
        ShapeKind::Cone => {
            let [radius_m, height_m] = value.numbers(&LENGTH)?;
            between_discs(&value, [radius_m, 0.0], height_m)?
        }
        ShapeKind::Sphere => BasicShape::Ball {
            radius_m: value.number(&LENGTH)?,
        },
        ShapeKind::Rectangle => match value.array("numbers")?.len() {
            2 => {
                let half = DVec2::from_array(value.numbers(&LENGTH)?) / 2.0;
                BasicShape::Rectangle {
                    low: -half,
                    high: half,
                }
            }
            4 => rectangle(&value)?,
            _ => return Err(value.error(format!("{} are expected", SHAPE.rect_m.told()))),
        },
        ShapeKind::Prism => prism(&PRISM_SECTION.table_of(&value)?)?,
        ShapeKind::Revolved => revolved(&REVOLVED_SECTION.table_of(&value)?)?,
    };
    Ok((kind, of_basic_shape(&shape, normals, &value)?))
}

/// A flat rectangle in the plane z = 0 that faces +z, by its corners.
pub fn rectangle(value: &Value) -> Result<BasicShape, SceneError> {
    let [x0, y0, x1, y1] = value.numbers(&POSITION)?;
    if x0 >= x1 || y0 >= y1 {
        return Err(value.error("no area; allowed: [x0, y0, x1, y1] with x0 < x1 and y0 < y1"));
    }
    Ok(BasicShape::Rectangle {
        low: DVec2::new(x0, y0),
        high: DVec2::new(x1, y1),
    })
}

/// The mesh of a shape that a value gives.
pub fn of_basic_shape(
    shape: &BasicShape,
    normals: Normals,
    value: &Value,
) -> Result<LoadedMesh, SceneError> {
    let crease_rad = match normals {
        Normals::Flat => 0.0,
        Normals::GivenOrMade { crease_rad } => crease_rad,
    };
    let ShapeTriangles {
        positions,
        triangles,
    } = shape.triangles(crease_rad);
    let count = triangles.len();
    let model = RawModel {
        positions,
        triangles,
        materials: vec![GivenMaterial::unknown(false)],
        ..RawModel::default()
    };
    mesh_file::welded(model, normals)
        .filter(|loaded| count > 2 || loaded.mesh.triangles.len() == count)
        .ok_or_else(|| value.error("too thin to have an area; allowed: sides of about one size"))
}

fn cuboid(value: &Value) -> Result<BasicShape, SceneError> {
    match value.array("numbers")?.len() {
        3 => {
            let sides = DVec3::from_array(value.numbers(&LENGTH)?);
            let half = sides / 2.0;
            Ok(BasicShape::Cuboid {
                low: (-half).with_z(0.0),
                high: half.with_z(sides.z),
            })
        }
        6 => {
            let [x0, y0, z0, x1, y1, z1] = value.numbers(&POSITION)?;
            let (low, high) = (DVec3::new(x0, y0, z0), DVec3::new(x1, y1, z1));
            match low.cmplt(high).all() {
                true => Ok(BasicShape::Cuboid { low, high }),
                false => Err(value.error(
                    "no volume; allowed: [x0, y0, z0, x1, y1, z1] with x0 < x1, y0 < y1 and z0 < z1",
                )),
            }
        }
        _ => Err(value.error(format!("{} are expected", SHAPE.box_m.told()))),
    }
}

fn between_discs(
    value: &Value,
    [bottom_m, top_m]: [f64; 2],
    height_m: f64,
) -> Result<BasicShape, SceneError> {
    let profile = Profile::between_discs(bottom_m, top_m, height_m);
    let profile = profile.map_err(|_| value.error("no volume"))?;
    Ok(BasicShape::Revolved(profile))
}

fn prism(table: &Table) -> Result<BasicShape, SceneError> {
    let height_m = PRISM.height_m.read(table)?;
    let written = PRISM.outline_m.require(table)?;
    let places = places(&written, [&POSITION, &POSITION])?;
    let outline = Outline::new(&coordinates(&places));
    Ok(BasicShape::Prism {
        outline: outline.map_err(|fault| told(fault, &written, &places, 3))?,
        height_m,
    })
}

fn revolved(table: &Table) -> Result<BasicShape, SceneError> {
    let written = REVOLVED.profile_m.require(table)?;
    let places = places(&written, [&RADIUS, &POSITION])?;
    let profile = Profile::new(&coordinates(&places));
    let profile = profile.map_err(|fault| told(fault, &written, &places, 2))?;
    Ok(BasicShape::Revolved(profile))
}

/// Pairs of numbers, each with where it is written.
fn places<'a>(
    list: &Value<'a>,
    allowed: [&Numbers; 2],
) -> Result<Vec<(Value<'a>, DVec2)>, SceneError> {
    let entries = list.array("places, each two numbers in brackets")?;
    if entries.len() > MOST_PLACES {
        let message = format!("{} places; allowed: {MOST_PLACES}", entries.len());
        return Err(list.error(message));
    }
    let place = |entry: Value<'a>| {
        let numbers = entry.array("numbers")?;
        let [x, y] = numbers.as_slice() else {
            return Err(entry.error("two numbers in brackets are expected"));
        };
        let place = DVec2::new(x.number(allowed[0])?, y.number(allowed[1])?);
        Ok((entry, place))
    };
    entries.into_iter().map(place).collect()
}

fn coordinates(places: &[(Value, DVec2)]) -> Vec<DVec2> {
    places.iter().map(|(_, place)| *place).collect()
}

/// Where a list of places is wrong, and how; `fewest` of them are enough.
fn told(fault: OutlineFault, list: &Value, places: &[(Value, DVec2)], fewest: usize) -> SceneError {
    let entry = |index: usize| places.get(index).map_or(list, |(entry, _)| entry);
    match fault {
        OutlineFault::TooFew => list.error(format!(
            "too few different places; allowed: {fewest} or more, with an area between them"
        )),
        OutlineFault::Twice(index) => {
            entry(index).error("the place before it is the same; allowed: another place")
        }
        OutlineFault::Meeting([one, other]) => {
            let place = places.get(one).map_or(DVec2::ZERO, |(_, place)| *place);
            entry(other).error(format!(
                "the side that begins here meets the one that begins at [{}, {}]; allowed: sides that neither touch nor cross",
                place.x, place.y
            ))
        }
    }
}
