//! Edits in a scene's text.

use glam::DVec3;
use toml_edit::{Document, Item, Value};

use super::edit::{AnimationName, Edit, NewForm, NewThing};
use super::numbers::{self, number_of};
use super::spliced::{Body, Spliced, bodies, parsed};
use crate::light::Light;
use crate::scene::format::{
    AMBIENT, AMBIENT_SECTION, ANIMATION, AnimationKeys, BOARD, BOARD_SECTION, CENTER,
    DIRECTIONAL_LIGHT, LIGHT_SECTION, LightKind, MARKER, MARKER_SECTION, MATERIAL, ON_BOARD,
    PHANTOM_SECTION, PLACEMENT, POINT_LIGHT, PlacementKeys, SHADOWS_SECTION, SHAPE, STANDING,
    ShapeKeys, TABLE, TABLE_SECTION, THING, THING_NAME, VIRTUAL_SECTION, light_keys,
};
use crate::scene::schema::key::{Absent, Key, NewKey, new_key};
use crate::scene::schema::section::Section;
use crate::scene::schema::values::quoted;
use crate::scene::{Placement, Scene, ShadowChange, unit_direction};

/// Why an edit does not fit a text.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Unfit {
    /// What is to change is not there.
    #[error("the scene has no {0}")]
    Missing(String),
    /// The scene's `[table]`.
    #[error(
        "of the table's top its height, its albedo and whether it is shown are edited here; all else is in the file's [table]"
    )]
    TableTop,
    /// Sizes of a board whose markers another file has.
    #[error("the board's markers are in the file of its bundle; change their sizes there")]
    InBundle,
    /// A text that no scene is.
    #[error("the scene's file is not TOML any more")]
    NotToml,
}

/// The text with an edit made in it; `scene` is what the text says.
pub fn with_edit(text: &str, scene: &Scene, edit: &Edit) -> Result<String, Unfit> {
    let document = parsed(text).ok_or(Unfit::NotToml)?;
    let mut spliced = Spliced::new(text);
    match edit {
        Edit::Light { index, light } => {
            let bodies = tables(&document, &LIGHT_SECTION);
            let written = bodies.get(*index).zip(scene.lights.get(*index));
            let (&body, old) = written.ok_or_else(|| no_light(*index))?;
            set_light(&mut spliced, body, &old.light, light);
        }
        Edit::AddLight(light) => {
            add_table(&mut spliced, &document, &LIGHT_SECTION, &light_keys(light));
        }
        Edit::RemoveLight(index) => {
            let lights = tables(&document, &LIGHT_SECTION);
            if *index >= lights.len() {
                return Err(no_light(*index));
            }
            spliced.remove_table(&lights, *index);
        }
        Edit::Ambient(radiance) => set_ambient(&mut spliced, &document, *radiance),
        Edit::Place { thing, placement } => {
            set_placement(&mut spliced, thing_of(&document, thing)?, placement)?;
        }
        Edit::Show { thing, visible } => {
            set_visible(&mut spliced, thing_of(&document, thing)?, *visible);
        }
        Edit::Shadows(change) => set_shadows(&mut spliced, &document, scene, change),
        Edit::AnchorSize { anchor, size_m } => {
            resize(&mut spliced, &document, scene, anchor, *size_m)?;
        }
        Edit::AddThing(new) => {
            let section = match new.is_real {
                true => &PHANTOM_SECTION,
                false => &VIRTUAL_SECTION,
            };
            add_table(&mut spliced, &document, section, &thing_keys(new, scene));
        }
        Edit::Duplicate {
            thing,
            name,
            position_m,
        } => {
            let (siblings, index) = listed(&document, thing)?;
            let keys = [
                new_key(&THING_NAME.name, name),
                new_key(&PLACEMENT.position_m, position_m),
            ];
            spliced.repeat_table(&siblings, index, &keys);
        }
        Edit::Rename { thing, name } => {
            let (siblings, index) = listed(&document, thing)?;
            let (key, text) = new_key(&THING_NAME.name, name);
            spliced.set(siblings[index], key, text);
        }
        Edit::Material {
            thing,
            albedo,
            roughness,
            metallic,
        } => {
            let parts = [
                roughness.map(|it| new_key(&MATERIAL.roughness, &Some(it))),
                metallic.map(|it| new_key(&MATERIAL.metallic, &Some(it))),
            ];
            let parts = parts.into_iter().flatten().collect();
            paint(&mut spliced, thing_of(&document, thing)?, *albedo, parts)?;
        }
        Edit::Animate { thing, animation } => {
            let (siblings, index) = listed(&document, thing)?;
            set_animation(&mut spliced, siblings[index], animation.as_ref());
        }
        Edit::RemoveThing(name) => {
            let (siblings, index) = listed(&document, name)?;
            spliced.remove_table(&siblings, index);
        }
    }
    Ok(spliced.text())
}

/// What a text says of that which an edit changes: where two texts agree in it, the edit means the same in both.
pub fn touched_by(text: &str, edit: &Edit) -> Option<String> {
    let document = parsed(text)?;
    let said = |bodies: &[Body], keys: &[&str]| -> String {
        let values = bodies
            .iter()
            .flat_map(|body| keys.iter().map(|key| body.value(key)));
        let spans = values.map(|value| value.and_then(Value::span));
        let texts = spans.map(|span| span.and_then(|span| text.get(span)).unwrap_or_default());
        texts.collect::<Vec<_>>().join("\n")
    };
    let thing = |name: &str, keys: &[&str]| {
        let (WrittenThing::Object(body) | WrittenThing::TableTop(body)) =
            thing_of(&document, name).ok()?;
        Some(said(&[body], keys))
    };
    let all_of = |section: &Section| said(&tables(&document, section), &section.names());
    match edit {
        Edit::Light { .. } | Edit::RemoveLight(_) => Some(all_of(&LIGHT_SECTION)),
        Edit::Ambient(_) => Some(all_of(&AMBIENT_SECTION)),
        Edit::Place { thing: name, .. } => {
            let mut keys = vec![TABLE.height_m.name, STANDING.on.name];
            let of_thing = ShapeKeys::ALL.iter().chain(PlacementKeys::ALL);
            keys.extend(of_thing.map(|key| key.name()));
            thing(name, &keys)
        }
        Edit::Show { thing: name, .. } => thing(name, &[THING.visible.name]),
        Edit::RemoveThing(name) => thing(name, &VIRTUAL_SECTION.names()),
        Edit::Rename { thing: name, .. } => thing(name, &[THING_NAME.name.name]),
        Edit::Material { thing: name, .. } => {
            thing(name, &[THING.material.name, TABLE.albedo.name])
        }
        Edit::Animate { thing: name, .. } => thing(name, &[ANIMATION.animation.name]),
        Edit::Shadows(change) => {
            let keys: Vec<&str> = change.keys().iter().map(|change| change.key).collect();
            Some(said(&tables(&document, &SHADOWS_SECTION), &keys))
        }
        Edit::AnchorSize { anchor, .. } => {
            let anchors = [
                tables(&document, &BOARD_SECTION),
                tables(&document, &MARKER_SECTION),
            ];
            let named: Vec<Body> = (anchors.concat().into_iter())
                .filter(|body| body.has_name(anchor))
                .collect();
            Some(said(&named, &[BOARD.markers.name, MARKER.size_m.name]))
        }
        Edit::Duplicate { thing: name, .. } => thing(name, &VIRTUAL_SECTION.names()),
        Edit::AddLight(_) | Edit::AddThing(_) => Some(String::new()),
    }
}

/// The tables of a section that a text has.
fn tables<'a>(document: &'a Document<&str>, section: &Section) -> Vec<Body<'a>> {
    bodies(document.as_table().get(section.name))
}

fn add_table(spliced: &mut Spliced, document: &Document<&str>, section: &Section, keys: &[NewKey]) {
    let siblings = document.as_table().get(section.name);
    spliced.add_table(&section.head(), siblings, keys);
}

/// Writes three numbers, or one that stands for them where one is written.
fn set_vector<M: Absent<DVec3>>(
    spliced: &mut Spliced,
    body: Body,
    key: &Key<DVec3, M>,
    wanted: DVec3,
) {
    let default = M::value(key).map(|default| default.x);
    let digits = key.takes.numbers.digits;
    spliced.set_numbers(body, key.name, &wanted.to_array(), digits, default);
}

/// The place of a thing, in the numbers of the scene's file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ThingPlace {
    /// Of a phantom or a virtual thing, which stands and turns as it likes.
    Free(Placement),
    /// Of the table's top, which moves up and down alone.
    TableTop {
        /// Its z in the world, metres.
        height_m: f64,
    },
}

impl ThingPlace {
    /// The same as any thing would have it.
    pub fn placement(self) -> Placement {
        match self {
            Self::Free(placement) => placement,
            Self::TableTop { height_m } => Placement {
                position_m: DVec3::new(0.0, 0.0, height_m),
                ..Placement::default()
            },
        }
    }
}

/// Where a thing stands, as a text says it; `None` where the text has no such thing.
pub fn place_of(text: &str, name: &str) -> Option<ThingPlace> {
    let document = parsed(text)?;
    let vector = |body: Body, key: &str, default: DVec3| match body.value(key) {
        Some(Value::Array(array)) => {
            let numbers: Vec<f64> = array.iter().filter_map(number_of).collect();
            <[f64; 3]>::try_from(numbers).map_or(default, DVec3::from_array)
        }
        Some(value) => number_of(value).map_or(default, DVec3::splat),
        None => default,
    };
    let default = Placement::default();
    Some(match thing_of(&document, name).ok()? {
        WrittenThing::Object(body) => ThingPlace::Free(Placement {
            position_m: vector(body, PLACEMENT.position_m.name, default.position_m),
            rotation_deg: vector(body, PLACEMENT.rotation_deg.name, default.rotation_deg),
            scale: vector(body, PLACEMENT.scale.name, default.scale),
        }),
        WrittenThing::TableTop(body) => {
            let key = &TABLE.height_m;
            let written = body.value(key.name).and_then(number_of);
            let height_m = written.unwrap_or(*key.default());
            ThingPlace::TableTop { height_m }
        }
    })
}

enum WrittenThing<'a> {
    Object(Body<'a>),
    TableTop(Body<'a>),
}

fn thing_of<'a>(document: &'a Document<&str>, name: &str) -> Result<WrittenThing<'a>, Unfit> {
    let things = [
        tables(document, &PHANTOM_SECTION),
        tables(document, &VIRTUAL_SECTION),
    ];
    let mut things = things.concat().into_iter();
    let named = things.find(|body| body.has_name(name));
    let top = || {
        let tables = tables(document, &TABLE_SECTION);
        let table = tables.first().filter(|_| name == TABLE_SECTION.name);
        table.copied().map(WrittenThing::TableTop)
    };
    named
        .map(WrittenThing::Object)
        .or_else(top)
        .ok_or_else(|| no_thing(name))
}

/// The tables among which a thing's is, and its number there.
fn listed<'a>(document: &'a Document<&str>, name: &str) -> Result<(Vec<Body<'a>>, usize), Unfit> {
    let among = [&PHANTOM_SECTION, &VIRTUAL_SECTION]
        .into_iter()
        .find_map(|section| {
            let siblings = tables(document, section);
            let index = siblings.iter().position(|body| body.has_name(name))?;
            Some((siblings, index))
        });
    match (among, thing_of(document, name)?) {
        (Some(among), WrittenThing::Object(_)) => Ok(among),
        _ => Err(Unfit::TableTop),
    }
}

fn set_animation(spliced: &mut Spliced, thing: Body, animation: Option<&AnimationName>) {
    let keys = &ANIMATION;
    match animation {
        Some(AnimationName::Named(name)) => {
            spliced.set(thing, keys.animation.name, quoted(name));
        }
        Some(AnimationName::Numbered(number)) => {
            spliced.set(thing, keys.animation.name, number.to_string());
        }
        None => {
            // (How nothing plays is a mistake.)
            for key in AnimationKeys::ALL {
                spliced.remove_key(thing, key.name());
            }
        }
    }
}

fn set_ambient(spliced: &mut Spliced, document: &Document<&str>, radiance: DVec3) {
    match tables(document, &AMBIENT_SECTION).first() {
        Some(&body) => set_vector(spliced, body, &AMBIENT.radiance, radiance),
        None => {
            let keys = [new_key(&AMBIENT.radiance, &radiance)];
            add_table(spliced, document, &AMBIENT_SECTION, &keys);
        }
    }
}

fn set_visible(spliced: &mut Spliced, thing: WrittenThing, visible: bool) {
    let (WrittenThing::Object(body) | WrittenThing::TableTop(body)) = thing;
    let key = &THING.visible;
    let written = body.value(key.name).and_then(Value::as_bool);
    if written.unwrap_or(*key.default()) != visible {
        spliced.set(body, key.name, visible.to_string());
    }
}

/// Of the table's top the albedo alone is edited.
fn paint(
    spliced: &mut Spliced,
    thing: WrittenThing,
    albedo: Option<DVec3>,
    parts: Vec<NewKey>,
) -> Result<(), Unfit> {
    match thing {
        WrittenThing::Object(body) => set_material(spliced, body, albedo, parts),
        WrittenThing::TableTop(_) if !parts.is_empty() => return Err(Unfit::TableTop),
        WrittenThing::TableTop(body) => {
            if let Some(albedo) = albedo {
                let (key, digits) = (&TABLE.albedo, TABLE.albedo.takes.numbers.digits);
                // (What it is without one hangs on whether it has a picture.)
                spliced.set_numbers(body, key.name, &albedo.to_array(), digits, None);
            }
        }
    }
    Ok(())
}

fn set_material(spliced: &mut Spliced, thing: Body, albedo: Option<DVec3>, parts: Vec<NewKey>) {
    let key = THING.material.name;
    match bodies(thing.item(key)).first() {
        Some(&body) => {
            if let Some(albedo) = albedo {
                let (key, digits) = (&MATERIAL.albedo, MATERIAL.albedo.takes.numbers.digits);
                spliced.set_numbers(body, key.name, &albedo.to_array(), digits, None);
            }
            for (key, text) in parts {
                spliced.set(body, key, text);
            }
        }
        None if albedo.is_none() && parts.is_empty() => {}
        None => {
            let albedo = albedo.map(|albedo| new_key(&MATERIAL.albedo, &Some(albedo)));
            let mut keys: Vec<NewKey> = albedo.into_iter().collect();
            keys.extend(parts);
            let pairs: Vec<String> = keys
                .iter()
                .map(|(key, text)| format!("{key} = {text}"))
                .collect();
            spliced.insert_key(thing, key, &format!("{{ {} }}", pairs.join(", ")));
        }
    }
}

fn no_thing(name: &str) -> Unfit {
    Unfit::Missing(format!("thing with the name \"{name}\""))
}

fn no_light(index: usize) -> Unfit {
    Unfit::Missing(format!("light {index}"))
}

/// Of a light of another kind the first three keys become those that are alike (kind, where it is, how strong it is), and the
/// rest goes or comes.
fn set_light(spliced: &mut Spliced, body: Body, old: &Light, new: &Light) {
    let (old_keys, new_keys) = (light_keys(old), light_keys(new));
    if LightKind::of(old) == LightKind::of(new) {
        set_same_kind(spliced, body, (old, new), &old_keys[3..]);
        return;
    }
    for (old_key, _) in &old_keys[3..] {
        spliced.remove_key(body, old_key);
    }
    for ((old_key, _), (new_key, text)) in old_keys.iter().zip(&new_keys).take(3) {
        spliced.rename(body, old_key, new_key, text.clone());
    }
    for (key, text) in new_keys.into_iter().skip(3) {
        spliced.insert_key(body, key, &text);
    }
}

/// Writes what has changed; `old_rest` are the keys of the old light's size.
fn set_same_kind(
    spliced: &mut Spliced,
    body: Body,
    (old, new): (&Light, &Light),
    old_rest: &[NewKey],
) {
    match (old, new) {
        (
            _,
            Light::Point {
                position_m,
                intensity,
                ..
            },
        ) => {
            set_vector(spliced, body, &POINT_LIGHT.position_m, *position_m);
            set_vector(spliced, body, &POINT_LIGHT.intensity, *intensity);
        }
        (
            Light::Directional {
                direction: old_direction,
                ..
            },
            Light::Directional {
                direction,
                irradiance,
                ..
            },
        ) => {
            // Written with any length, so it is as it was unless it points elsewhere.
            if unit_direction(*direction) != *old_direction {
                set_vector(spliced, body, &DIRECTIONAL_LIGHT.direction, *direction);
            }
            set_vector(spliced, body, &DIRECTIONAL_LIGHT.irradiance, *irradiance);
        }
        (Light::Point { .. }, Light::Directional { .. }) => {}
    }
    let rest = light_keys(new).into_iter().skip(3);
    for (key, text) in rest {
        if !old_rest.contains(&(key, text.clone())) {
            spliced.set(body, key, text);
        }
    }
}

fn set_placement(
    spliced: &mut Spliced,
    thing: WrittenThing,
    placement: &Placement,
) -> Result<(), Unfit> {
    let Placement {
        position_m,
        rotation_deg,
        scale,
    } = *placement;
    match thing {
        WrittenThing::Object(body) => {
            set_vector(spliced, body, &PLACEMENT.position_m, position_m);
            set_vector(spliced, body, &PLACEMENT.rotation_deg, rotation_deg);
            set_vector(spliced, body, &PLACEMENT.scale, scale);
        }
        WrittenThing::TableTop(body) => {
            let lifted = Placement {
                position_m: DVec3::Z * position_m.z,
                ..Placement::default()
            };
            if *placement != lifted {
                return Err(Unfit::TableTop);
            }
            let key = &TABLE.height_m;
            let (digits, default) = (key.takes.digits, Some(*key.default()));
            spliced.set_numbers(body, key.name, &[position_m.z], digits, default);
        }
    }
    Ok(())
}

/// Writes the keys that a change makes otherwise than they are; what else the file says stays.
fn set_shadows(
    spliced: &mut Spliced,
    document: &Document<&str>,
    scene: &Scene,
    change: &ShadowChange,
) {
    let here = ShadowChange {
        from: scene.shadows,
        to: change.made_in(scene.shadows),
    };
    let keys = here.keys().into_iter();
    match tables(document, &SHADOWS_SECTION).first() {
        Some(&body) => keys.for_each(|change| match change.text {
            Some(text) => spliced.set(body, change.key, text),
            None => spliced.remove_key(body, change.key),
        }),
        None => {
            let new: Vec<NewKey> = keys
                .filter_map(|change| Some((change.key, change.text?)))
                .collect();
            if !new.is_empty() {
                add_table(spliced, document, &SHADOWS_SECTION, &new);
            }
        }
    }
}

fn resize(
    spliced: &mut Spliced,
    document: &Document<&str>,
    scene: &Scene,
    anchor: &str,
    size_m: f64,
) -> Result<(), Unfit> {
    let missing = || Unfit::Missing(format!("anchor with the name \"{anchor}\""));
    let named = |section: &Section| {
        let mut tables = tables(document, section).into_iter();
        tables.find(|body| body.has_name(anchor))
    };
    let (size, center) = (&MARKER.size_m, &ON_BOARD.center_m);
    if let Some(marker) = named(&MARKER_SECTION) {
        spliced.set_numbers(marker, size.name, &[size_m], size.takes.digits, None);
        return Ok(());
    }
    let board = named(&BOARD_SECTION).ok_or_else(missing)?;
    let known = scene.anchors.iter().find(|known| known.name == anchor);
    let markers = &known.ok_or_else(missing)?.markers;
    let stretch = size_m / markers.first().ok_or_else(missing)?.size_m;
    let written: Option<&Item> = board.item(BOARD.markers.name);
    if written.is_none() {
        return Err(Unfit::InBundle);
    }
    for (body, marker) in bodies(written).into_iter().zip(markers) {
        let size_m = [marker.size_m * stretch];
        let center_m = (marker.center_m() * stretch).to_array();
        spliced.set_numbers(body, size.name, &size_m, size.takes.digits, None);
        let in_plane = body.item(center.name).and_then(Item::as_array);
        let in_plane = in_plane.is_none_or(|written| written.len() == 2);
        let numbers = if in_plane { &center_m[..2] } else { &center_m };
        spliced.set_numbers(body, center.name, numbers, CENTER.digits, None);
    }
    Ok(())
}

fn thing_keys(new: &NewThing, scene: &Scene) -> Vec<NewKey> {
    let mut keys = vec![new_key(&THING_NAME.name, &new.name)];
    let lengths = |lengths_m: &[f64]| {
        numbers::new_array(lengths_m, PLACEMENT.position_m.takes.numbers.digits)
    };
    match &new.form {
        NewForm::Mesh { file, fit_m } => {
            keys.push((SHAPE.mesh.name, quoted(file)));
            keys.extend(fit_m.map(|fit_m| new_key(&SHAPE.fit_m, &Some(fit_m))));
        }
        NewForm::Box(sides) => keys.push((SHAPE.box_m.name, lengths(&sides.to_array()))),
        NewForm::Cylinder(radius, height) => {
            keys.push((SHAPE.cylinder_m.name, lengths(&[*radius, *height])));
        }
        NewForm::Cone(radius, height) => {
            keys.push((SHAPE.cone_m.name, lengths(&[*radius, *height])));
        }
        NewForm::Sphere(radius) => keys.push(new_key(&SHAPE.sphere_m, &Some(*radius))),
    }
    let world = scene.anchors.first();
    if world.is_none_or(|world| world.name != new.on) {
        keys.push((STANDING.on.name, quoted(&new.on)));
    }
    let Placement {
        position_m,
        rotation_deg,
        scale,
    } = new.placement;
    keys.push(new_key(&PLACEMENT.position_m, &position_m));
    for (key, value) in [
        (&PLACEMENT.rotation_deg, rotation_deg),
        (&PLACEMENT.scale, scale),
    ] {
        if value != *key.default() {
            keys.push(new_key(key, &value));
        }
    }
    keys
}
