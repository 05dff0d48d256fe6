//! Edits in a scene's text.

use glam::DVec3;
use toml_edit::{Document, Item, Value};

use super::edit::{Edit, NewVirtual};
use super::numbers::{ANGLE, DIRECTION, POSITION, PRINT, RATIO, number_of};
use super::spliced::{Body, Spliced, bodies, parsed};
use crate::light::Light;
use crate::scene::{
    Counting, Difference, Placement, Quality, Scene, ShadowSettings, ShaftSettings, Technique,
    unit_direction,
};

/// Why an edit does not fit a text.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Unfit {
    /// What is to change is not there.
    #[error("the scene has no {0}")]
    Missing(String),
    /// The scene's `[table]`.
    #[error("the table's top moves up and down alone; it lies flat, with its rect_m in the world")]
    TableTop,
    /// A text that no scene is.
    #[error("the scene's file is not TOML any more")]
    NotToml,
}

/// The text with an edit made in it; `scene` is what the text says.
pub fn with_edit(text: &str, scene: &Scene, edit: &Edit) -> Result<String, Unfit> {
    let document = parsed(text).ok_or(Unfit::NotToml)?;
    let mut spliced = Spliced::new(text);
    let tables = |key: &str| bodies(document.as_table().get(key));
    match edit {
        Edit::Light { index, light } => {
            let written = (
                tables("light").get(*index).copied(),
                scene.lights.get(*index),
            );
            let (Some(body), Some(old)) = written else {
                return Err(no_light(*index));
            };
            set_light(&mut spliced, body, old, light);
        }
        Edit::AddLight(light) => {
            spliced.add_table(
                "[[light]]",
                document.as_table().get("light"),
                &light_keys(light),
            );
        }
        Edit::RemoveLight(index) => {
            let lights = tables("light");
            if *index >= lights.len() {
                return Err(no_light(*index));
            }
            spliced.remove_table(&lights, *index);
        }
        Edit::Ambient(radiance) => match tables("ambient").first() {
            Some(&body) => {
                spliced.set_numbers(body, "radiance", &radiance.to_array(), RATIO, Some(0.0));
            }
            None => {
                let text = super::numbers::new_array(&radiance.to_array(), RATIO);
                spliced.add_table("[ambient]", None, &[("radiance", text)]);
            }
        },
        Edit::Place { thing, placement } => match thing_of(&document, thing)? {
            Thing::Object(body) => set_placement(&mut spliced, body, placement),
            Thing::TableTop(body) => {
                let lifted = Placement {
                    position_m: DVec3::Z * placement.position_m.z,
                    ..Placement::default()
                };
                if *placement != lifted {
                    return Err(Unfit::TableTop);
                }
                let height_m = [placement.position_m.z];
                spliced.set_numbers(body, "height_m", &height_m, POSITION, Some(0.0));
            }
        },
        Edit::Show { thing, visible } => {
            let (Thing::Object(body) | Thing::TableTop(body)) = thing_of(&document, thing)?;
            let written = body.value("visible").and_then(Value::as_bool);
            if written.unwrap_or(true) != *visible {
                spliced.set(body, "visible", visible.to_string());
            }
        }
        Edit::Shadows(settings) => {
            let keys = shadow_keys(&scene.shadows, settings);
            match tables("shadows").first() {
                Some(&body) => {
                    for (key, text) in keys {
                        match text {
                            Some(text) => spliced.set(body, key, text),
                            None => spliced.remove_key(body, key),
                        }
                    }
                }
                None => {
                    let keys: Vec<(&str, String)> = keys
                        .into_iter()
                        .filter_map(|(key, text)| Some((key, text?)))
                        .collect();
                    if !keys.is_empty() {
                        spliced.add_table("[shadows]", None, &keys);
                    }
                }
            }
        }
        Edit::AnchorSize { anchor, size_m } => {
            resize(&mut spliced, &document, scene, anchor, *size_m)?;
        }
        Edit::AddVirtual(new) => {
            let keys = virtual_keys(new, scene);
            spliced.add_table("[[virtual]]", document.as_table().get("virtual"), &keys);
        }
        Edit::RemoveVirtual(name) => {
            let virtuals = tables("virtual");
            let index = virtuals.iter().position(|body| body.has_name(name));
            spliced.remove_table(&virtuals, index.ok_or_else(|| no_thing(name))?);
        }
    }
    Ok(spliced.text())
}

/// What a text says of that which an edit changes: where two texts agree in it, the edit means the same in both.
pub fn touched_by(text: &str, edit: &Edit) -> Option<String> {
    let document = parsed(text)?;
    let root = document.as_table();
    let said = |bodies: &[Body], keys: &[&str]| -> String {
        let values = bodies
            .iter()
            .flat_map(|body| keys.iter().map(|key| body.value(key)));
        let spans = values.map(|value| value.and_then(Value::span));
        let texts = spans.map(|span| span.and_then(|span| text.get(span)).unwrap_or_default());
        texts.collect::<Vec<_>>().join("\n")
    };
    let thing = |name: &str, keys: &[&str]| {
        let (Thing::Object(body) | Thing::TableTop(body)) = thing_of(&document, name).ok()?;
        Some(said(&[body], keys))
    };
    match edit {
        Edit::Light { .. } | Edit::RemoveLight(_) => Some(said(
            &bodies(root.get("light")),
            &["kind", "position_m", "intensity", "direction", "irradiance"],
        )),
        Edit::Ambient(_) => Some(said(&bodies(root.get("ambient")), &["radiance"])),
        Edit::Place { thing: name, .. } => thing(
            name,
            &[
                "position_m",
                "rotation_deg",
                "scale",
                "height_m",
                "on",
                "mesh",
            ],
        ),
        Edit::Show { thing: name, .. } => thing(name, &["visible"]),
        Edit::RemoveVirtual(name) => thing(
            name,
            &[
                "mesh",
                "on",
                "position_m",
                "rotation_deg",
                "scale",
                "material",
                "casts",
                "visible",
                "smooth_deg",
            ],
        ),
        Edit::Shadows(_) => Some(said(
            &bodies(root.get("shadows")),
            &[
                "technique",
                "samples",
                "counting",
                "max_silhouette_error_px",
                "frame_budget_ms",
            ],
        )),
        Edit::AnchorSize { anchor, .. } => {
            let anchors = [bodies(root.get("board")), bodies(root.get("marker"))].concat();
            let named: Vec<Body> = anchors
                .into_iter()
                .filter(|body| body.has_name(anchor))
                .collect();
            Some(said(&named, &["markers", "size_m"]))
        }
        Edit::AddLight(_) | Edit::AddVirtual(_) => Some(String::new()),
    }
}

/// Where a thing stands, as a text says it; `None` where the text has no such thing.
pub fn placement_of(text: &str, name: &str) -> Option<Placement> {
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
        Thing::Object(body) => Placement {
            position_m: vector(body, "position_m", default.position_m),
            rotation_deg: vector(body, "rotation_deg", default.rotation_deg),
            scale: vector(body, "scale", default.scale),
        },
        Thing::TableTop(body) => {
            let height_m = body.value("height_m").and_then(number_of);
            Placement {
                position_m: DVec3::Z * height_m.unwrap_or(0.0),
                ..default
            }
        }
    })
}

enum Thing<'a> {
    Object(Body<'a>),
    TableTop(Body<'a>),
}

fn thing_of<'a>(document: &'a Document<&str>, name: &str) -> Result<Thing<'a>, Unfit> {
    let root = document.as_table();
    let things = [bodies(root.get("phantom")), bodies(root.get("virtual"))].concat();
    let named = things.into_iter().find(|body| body.has_name(name));
    let top = || {
        let table = root.get("table").filter(|_| name == "table");
        bodies(table).first().copied().map(Thing::TableTop)
    };
    named
        .map(Thing::Object)
        .or_else(top)
        .ok_or_else(|| no_thing(name))
}

fn no_thing(name: &str) -> Unfit {
    Unfit::Missing(format!("thing with the name \"{name}\""))
}

fn no_light(index: usize) -> Unfit {
    Unfit::Missing(format!("light {index}"))
}

fn set_light(spliced: &mut Spliced, body: Body, old: &Light, new: &Light) {
    let keys = light_keys(new);
    match (old, new) {
        (
            Light::Point { .. },
            Light::Point {
                position_m,
                intensity,
            },
        ) => {
            spliced.set_numbers(body, "position_m", &position_m.to_array(), POSITION, None);
            spliced.set_numbers(body, "intensity", &intensity.to_array(), RATIO, None);
        }
        (
            Light::Directional {
                direction: old_direction,
                ..
            },
            Light::Directional {
                direction,
                irradiance,
            },
        ) => {
            // Written with any length, so it is as it was unless it points elsewhere.
            if unit_direction(*direction) != *old_direction {
                spliced.set_numbers(body, "direction", &direction.to_array(), DIRECTION, None);
            }
            spliced.set_numbers(body, "irradiance", &irradiance.to_array(), RATIO, None);
        }
        (Light::Point { .. }, Light::Directional { .. }) => {
            rename_light(spliced, body, ["kind", "position_m", "intensity"], keys);
        }
        (Light::Directional { .. }, Light::Point { .. }) => {
            rename_light(spliced, body, ["kind", "direction", "irradiance"], keys);
        }
    }
}

fn rename_light(
    spliced: &mut Spliced,
    body: Body,
    old_keys: [&str; 3],
    new_keys: [(&'static str, String); 3],
) {
    for (old_key, (new_key, text)) in old_keys.into_iter().zip(new_keys) {
        spliced.rename(body, old_key, new_key, text);
    }
}

fn light_keys(light: &Light) -> [(&'static str, String); 3] {
    let vector = |vector: &DVec3, digits| super::numbers::new_array(&vector.to_array(), digits);
    match light {
        Light::Point {
            position_m,
            intensity,
        } => [
            ("kind", quoted("point")),
            ("position_m", vector(position_m, POSITION)),
            ("intensity", vector(intensity, RATIO)),
        ],
        Light::Directional {
            direction,
            irradiance,
        } => [
            ("kind", quoted("directional")),
            ("direction", vector(direction, DIRECTION)),
            ("irradiance", vector(irradiance, RATIO)),
        ],
    }
}

fn set_placement(spliced: &mut Spliced, body: Body, placement: &Placement) {
    let Placement {
        position_m,
        rotation_deg,
        scale,
    } = placement;
    spliced.set_numbers(
        body,
        "position_m",
        &position_m.to_array(),
        POSITION,
        Some(0.0),
    );
    spliced.set_numbers(
        body,
        "rotation_deg",
        &rotation_deg.to_array(),
        ANGLE,
        Some(0.0),
    );
    spliced.set_numbers(body, "scale", &scale.to_array(), RATIO, Some(1.0));
}

/// The keys that differ, with their texts; no text where a key is to go.
fn shadow_keys(old: &ShadowSettings, new: &ShadowSettings) -> Vec<(&'static str, Option<String>)> {
    let ShadowSettings {
        technique,
        samples,
        counting,
        max_silhouette_error_px,
        frame_budget_ms,
        shafts,
        quality,
        without: _,
    } = *new;
    let ratio = |number: f64| super::numbers::new_number(number, RATIO);
    // Another quality gives other defaults: what it says itself goes, what it does not stands.
    let regraded = quality != old.quality;
    let given = quality.map_or_else(ShadowSettings::default, Quality::shadows);
    let mut all = shaft_keys(&old.shafts, &shafts);
    let all_sources = || quoted("all");
    all.push((
        regraded || shafts.sources != old.shafts.sources,
        "sources",
        (!regraded || shafts.sources != given.shafts.sources).then(|| {
            let count = |count: u32| count.to_string();
            shafts.sources.map_or_else(all_sources, count)
        }),
    ));
    all.extend([
        (
            quality != old.quality,
            "quality",
            quality.map(|quality| quoted(quality.name())),
        ),
        (
            technique != old.technique,
            "technique",
            Some(quoted(word(&Technique::BY_NAME, technique))),
        ),
        (
            regraded || samples != old.samples,
            "samples",
            (!regraded || samples != given.samples).then(|| samples.to_string()),
        ),
        (
            counting != old.counting,
            "counting",
            Some(quoted(word(&Counting::BY_NAME, counting))),
        ),
        (
            regraded || max_silhouette_error_px != old.max_silhouette_error_px,
            "max_silhouette_error_px",
            (!regraded || max_silhouette_error_px != given.max_silhouette_error_px)
                .then(|| ratio(max_silhouette_error_px)),
        ),
        (
            frame_budget_ms != old.frame_budget_ms,
            "frame_budget_ms",
            frame_budget_ms.map(ratio),
        ),
    ]);
    all.into_iter()
        .filter(|(differs, ..)| *differs)
        .map(|(_, key, text)| (key, text))
        .collect()
}

/// For each key of shafts whether it differs, and its text.
fn shaft_keys(
    old: &ShaftSettings,
    new: &ShaftSettings,
) -> Vec<(bool, &'static str, Option<String>)> {
    let ShaftSettings {
        // A quality has its say in it.
        sources: _,
        patches,
        source_power,
        receivers_per_leaf,
        least_part,
        map_px,
        difference,
    } = *new;
    let differs = difference != old.difference;
    let (named, compositing) = match difference {
        Difference::Ratio => (None, None),
        Difference::Subtract => (Some(quoted("subtract")), None),
        Difference::Encoded => (None, Some(quoted("ldr"))),
    };
    let ratio = |number: f64| Some(super::numbers::new_number(number, RATIO));
    let count = |number: u32| Some(number.to_string());
    vec![
        (patches != old.patches, "patches", count(patches)),
        (
            source_power != old.source_power,
            "source_power",
            ratio(source_power),
        ),
        (
            receivers_per_leaf != old.receivers_per_leaf,
            "receivers_per_leaf",
            count(receivers_per_leaf),
        ),
        (
            least_part != old.least_part,
            "least_part",
            ratio(least_part),
        ),
        (map_px != old.map_px, "map_px", count(map_px)),
        (differs, "difference", named),
        (differs, "compositing", compositing),
    ]
}

/// The word for a setting.
fn word<T: PartialEq>(words: &[(&'static str, T)], meant: T) -> &'static str {
    let found = words.iter().find(|(_, meaning)| *meaning == meant);
    found.map_or("", |(word, _)| word)
}

fn resize(
    spliced: &mut Spliced,
    document: &Document<&str>,
    scene: &Scene,
    anchor: &str,
    size_m: f64,
) -> Result<(), Unfit> {
    let missing = || Unfit::Missing(format!("anchor with the name \"{anchor}\""));
    let root = document.as_table();
    let named = |key: &str| {
        let tables = bodies(root.get(key));
        tables.into_iter().find(|body| body.has_name(anchor))
    };
    if let Some(marker) = named("marker") {
        spliced.set_numbers(marker, "size_m", &[size_m], PRINT, None);
        return Ok(());
    }
    let board = named("board").ok_or_else(missing)?;
    let known = scene.anchors.iter().find(|known| known.name == anchor);
    let markers = &known.ok_or_else(missing)?.markers;
    let stretch = size_m / markers.first().ok_or_else(missing)?.size_m;
    let written: Option<&Item> = board.item("markers");
    for (body, marker) in bodies(written).into_iter().zip(markers) {
        let center_m = (marker.center_m * stretch).to_array();
        spliced.set_numbers(body, "size_m", &[marker.size_m * stretch], PRINT, None);
        spliced.set_numbers(body, "center_m", &center_m, PRINT, None);
    }
    Ok(())
}

fn virtual_keys(new: &NewVirtual, scene: &Scene) -> Vec<(&'static str, String)> {
    let mut keys = vec![("name", quoted(&new.name)), ("mesh", quoted(&new.mesh))];
    if scene
        .anchors
        .first()
        .is_none_or(|world| world.name != new.on)
    {
        keys.push(("on", quoted(&new.on)));
    }
    let default = Placement::default();
    let Placement {
        position_m,
        rotation_deg,
        scale,
    } = new.placement;
    let mut vector = |key, vector: DVec3, digits| {
        keys.push((key, super::numbers::new_array(&vector.to_array(), digits)));
    };
    vector("position_m", position_m, POSITION);
    if rotation_deg != default.rotation_deg {
        vector("rotation_deg", rotation_deg, ANGLE);
    }
    if scale != default.scale {
        vector("scale", scale, RATIO);
    }
    keys
}

fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}
