//! `[shadows]`: how shadows are made.

use super::error::SceneError;
use super::quality::Quality;
use super::ranges::{Numbers, Whole};
use super::reader::Table;
use super::schema::key::Missing::{ByQuality, Is, Means};
use super::schema::section::{Example, Section, Times};
use super::schema::settings::{KeyChange, Settings as _};
use super::shortcuts::Shortcuts;
use super::{ProbeScene, Scene};
use crate::geometry::outline_scale::LARGEST_MOVE_PX;
use crate::shafts::difference::Difference;

choices! {
    /// How shadows are made.
    pub enum Technique, "technique" {
        /// What the scene's light calls for: with a probe shadow volumes of what is compact, and of the rest shafts in a room
        /// and the environment's shadows without one; else volumes.
        Auto = "auto",
        /// Shadow volumes (Haller, Drab & Hartmann 2003).
        Volumes = "volumes",
        /// Soft shadows of a probe's light in a room (Gibson, Cook, Howard & Hubbold 2003).
        Shafts = "shafts",
        /// Soft shadows of a probe's light from afar, of things that move and turn (Tamura, Johan & Nishita 2005), beside
        /// shadow volumes of what is compact in it.
        Environment = "environment",
    }
}

impl Technique {
    /// Whether a scene without a probe cannot have it.
    pub fn needs_probe(self) -> bool {
        self.probe_in_words().is_some()
    }

    /// What a probe is to those that need one, for a message.
    fn probe_in_words(self) -> Option<&'static str> {
        match self {
            Self::Auto | Self::Volumes => None,
            Self::Shafts => Some("which shafts take their light from"),
            Self::Environment => Some("which is the environment"),
        }
    }

    /// Whether it has the light of a probe that turns with a marker.
    fn follows_probe(self) -> bool {
        match self {
            Self::Auto | Self::Environment => true,
            Self::Volumes | Self::Shafts => false,
        }
    }

    /// The names of some, for a message.
    fn names_of(is_one: impl Fn(Self) -> bool) -> String {
        let some = Self::BY_NAME.iter().filter(|(_, it)| is_one(*it));
        let names: Vec<&str> = some.map(|(name, _)| *name).collect();
        names.join(", ")
    }
}

choices! {
    /// How the environment's shadows are made of what its regions see.
    pub enum EnvironmentMethod, "method" {
        /// On real surfaces by rays from points of them (final gathering), on virtual ones as penumbrae.
        Rays = "rays",
        /// As soft at each place as things are far from it.
        Penumbrae = "penumbrae",
        /// As in the paper: as soft over a whole thing as its middle is far, and taken off.
        Maps = "maps",
    }
}

choices! {
    /// How shadow volumes are counted.
    pub enum VolumeCounting, "way of counting" {
        /// Depth-pass where it is known to be right, depth-fail elsewhere: the same picture for less.
        Auto = "auto",
        /// Depth-fail everywhere.
        DepthFail = "depth-fail",
    }
}

choices! {
    /// How what is hidden is taken out of the video in linear light.
    pub enum LinearDifference, "way to take light away" {
        /// Of the pixel's light as large a part as of the modelled light.
        Ratio = "ratio",
        /// The radiance that the model says is missing.
        Subtract = "subtract",
    }
}

choices! {
    /// In which numbers light is taken out of the video.
    pub enum CompositingSpace, "way to composite" {
        /// In linear light, as `difference` says.
        Linear = "float",
        /// In encoded levels, as Gibson et al. 2003 had to; it takes no `difference`.
        Encoded = "ldr",
    }
}

/// The lights whose shadows have outlines: those that cast shadow volumes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OutlinedLights {
    /// None of them.
    None,
    /// The scene's own.
    Lamps,
    /// The scene's own, and what is compact in its probe.
    Compact,
}

/// What makes a scene's shadows: a [`Technique`] that is chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShadowTechnique {
    /// Shadow volumes.
    Volumes,
    /// Soft shadows of a probe's light in a room.
    Shafts,
    /// Shadow volumes of compact lights, soft shadows of the rest of the probe's light.
    Both,
    /// Shadow volumes of compact lights, the rest of the probe's light from afar.
    Environment,
}

impl ShadowTechnique {
    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Volumes => Technique::Volumes.name(),
            Self::Shafts => Technique::Shafts.name(),
            Self::Both => "volumes and shafts",
            Self::Environment => Technique::Environment.name(),
        }
    }

    /// The lights that cast shadow volumes with it.
    pub fn outlined_lights(self) -> OutlinedLights {
        match self {
            Self::Volumes => OutlinedLights::Lamps,
            Self::Shafts => OutlinedLights::None,
            Self::Both | Self::Environment => OutlinedLights::Compact,
        }
    }

    /// Whether a room's light is worked out for it.
    pub fn has_shafts(self) -> bool {
        match self {
            Self::Shafts | Self::Both => true,
            Self::Volumes | Self::Environment => false,
        }
    }

    /// Whether lights of the probe are drawn beside its rest.
    pub fn has_compact_and_broad(self) -> bool {
        match self {
            Self::Both | Self::Environment => true,
            Self::Volumes | Self::Shafts => false,
        }
    }

    /// Whether its light from all around is a probe's, where the scene has one.
    pub fn takes_probe(self) -> bool {
        match self {
            Self::Shafts | Self::Both | Self::Environment => true,
            Self::Volumes => false,
        }
    }
}

settings! {
    /// How shadows are made and how finely.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct ShadowSettings, SHADOWS: ShadowKeys;

    /// What the others are taken from where the file does not say them.
    quality: Option<Quality> => Means(None, "none, which is as balanced");
    /// The technique that is asked for.
    technique: Technique => Is(Technique::Auto);
    /// Samples per pixel.
    samples: u32, Whole::one_of("number of samples", &[1, 4]) => ByQuality { fast: 1, balanced: 4, accurate: 4 };
    /// A light of some size casts its soft shadows from as many places as they are wide in pixels, up to this many.
    light_samples: u32, Whole::between(1, 1024) => ByQuality { fast: 16, balanced: 64, accurate: 256 };
    /// By so many rays from each point real surfaces get the ambient light, an environment's too, and what things reflect on to
    /// them; 0: virtual things hide and reflect none of that. Where things move there are fewer. Takes no part in shafts.
    ambient_samples: u32, Whole::between(0, 1024) => ByQuality { fast: 0, balanced: 256, accurate: 512 };
    /// By so many rays from each pixel glossy virtual things mirror what stands around them, as the camera sees it; smooth ones by one.
    /// 0: they mirror the surroundings' light alone.
    reflection_samples: u32, Whole::between(0, 256) => ByQuality { fast: 0, balanced: 16, accurate: 32 };
    /// How volumes are counted.
    counting: VolumeCounting => Is(VolumeCounting::Auto);
    /// By less than this many pixels a coarser version of a thing may move its silhouette, as the camera and the lights
    /// see it; 0: things are never made coarser.
    max_silhouette_error_px: f64, Numbers::between(0.0, LARGEST_MOVE_PX).unit("px")
        => ByQuality { fast: 2.0, balanced: 0.5, accurate: 0.0 };
    /// Lights in a probe are compact, with outlines in their shadows, where the camera would see these blurred over less than
    /// this; 0: none is. Others are a part of the broad light.
    compact_penumbra_px: f64, Numbers::between(0.0, 1e4).unit("px") => Is(12.0);
    /// What drawing a frame may take: as many sources (volumes: as fine outlines) as fit, up to what the other keys say.
    /// What is drawn then depends on the machine.
    frame_budget_ms: Option<f64>, Numbers::above(0.0, 1e6).unit("ms") => Means(None, "no limit");
    besides {
        /// What technique shafts alone is asked for.
        shafts: ShaftSettings => ShaftSettings::default();
        /// What technique environment is asked for.
        environment: EnvironmentSettings => EnvironmentSettings::default();
        /// Shortcuts that technique volumes is not to take; no key of a scene file.
        without: Shortcuts => Shortcuts::NONE;
    }
}

settings! {
    /// How finely shafts make soft shadows.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct ShaftSettings, SHAFTS: ShaftKeys;

    /// Shafts: sources, each with a shadow of its own (n of Gibson et al. 2003); "all": every one that is hidden.
    sources: Option<u32>, Whole::between(1, 4096).or("all", "number of sources")
        => ByQuality { fast: Some(10), balanced: Some(50), accurate: None };
    /// Shafts: patches that the room is cut into, about.
    patches: u32, Whole::between(100, 20_000) => Is(1500);
    /// Shafts: part of all power that the sources send out, the brightest first.
    source_power: f64, Numbers::above(0.0, 1.0) => Is(1.0);
    /// Shafts: patches in a leaf of the receivers' octree.
    receivers_per_leaf: u32, Whole::between(1, 1000) => Is(8);
    /// Shafts that bring every vertex less than this part of its light are cut no further.
    least_part: f64, Numbers::between(0.0, 1.0) => Is(0.02);
    /// Shafts: side of a source's shadow map, pixels.
    map_px: u32, Whole::one_of("side of maps", &[16, 32, 64, 128, 256, 512, 1024]) => Is(256);
    besides {
        /// How what is hidden is taken out of the video.
        difference: Difference => Difference::Ratio;
    }
}

settings! {
    /// How finely an environment makes soft shadows.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct EnvironmentSettings, ENVIRONMENT: EnvironmentKeys;

    /// How shadows are made of what the regions see.
    method: EnvironmentMethod => Is(EnvironmentMethod::Rays);
    /// Regions that the probe's broad light is cut into, each with a shadow of its own (q of Tamura et al. 2005).
    regions: u32, Whole::between(1, 256) => Is(64);
    /// Side of the map of a thing as a region sees it, pixels.
    map_px: u32, Whole::one_of("side of maps", &[16, 32, 64, 128, 256, 512]) => Is(128);
    besides {
        /// Whether things near each other hide light as one; no key of a scene file.
        grouping: Grouping => Grouping::ByMethod;
    }
}

/// Whether things near each other hide an environment's light as one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Grouping {
    /// With the paper's maps alone: a penumbra by the pixel is nearer to the truth without, where things lie beside each other.
    ByMethod,
    /// Each by itself: several leave the product of what each leaves.
    Apart,
    /// Those near each other share a map.
    Together,
}

impl EnvironmentSettings {
    /// Whether things near each other share a map.
    pub fn is_grouped(&self) -> bool {
        match self.grouping {
            Grouping::ByMethod => self.method == EnvironmentMethod::Maps,
            Grouping::Apart => false,
            Grouping::Together => true,
        }
    }
}

/// `[environment]`.
pub static ENVIRONMENT_SECTION: Section = Section {
    name: "environment",
    says: "How technique environment makes soft shadows. docs/environment.md compares the ways.",
    times: Times::UpToOnce,
    groups: &[EnvironmentKeys::ALL],
    shown: &[],
    is_aside: false,
};

keys! {
    /// The two keys that are one setting, [`ShaftSettings::difference`].
    pub static DIFFERENCE: DifferenceKeys;

    /// Shafts: how what is hidden is taken out of the video.
    difference: LinearDifference => Is(LinearDifference::Ratio);
    /// Shafts: in which numbers that is done.
    compositing: CompositingSpace => Is(CompositingSpace::Linear);
}

/// `[shadows]`.
pub static SHADOWS_SECTION: Section = Section {
    name: "shadows",
    says: "How shadows are made. docs/accuracy.md compares the qualities.",
    times: Times::UpToOnce,
    groups: &[ShadowKeys::ALL, ShaftKeys::ALL, DifferenceKeys::ALL],
    shown: &[
        ("quality", Example::Aside("\"balanced\"")),
        ("frame_budget_ms", Example::Aside("16.0")),
    ],
    is_aside: false,
};

impl Quality {
    /// What it means where nothing else is said.
    pub fn shadows(self) -> ShadowSettings {
        ShadowSettings::default().with_quality(self)
    }
}

impl ShadowSettings {
    /// With another quality and all that it sets; the rest stays.
    pub fn with_quality(self, quality: Quality) -> Self {
        Self {
            quality: Some(quality),
            shafts: self.shafts.at_quality(quality),
            ..self.at_quality(quality)
        }
    }

    /// The names of the keys that a quality sets, and that are otherwise here than it means.
    pub fn keys_beside_quality(&self) -> Vec<&'static str> {
        let Some(quality) = self.quality else {
            return Vec::new();
        };
        let change = ShadowChange {
            from: self.with_quality(quality),
            to: *self,
        };
        let keys = change.keys().into_iter().map(|change| change.key);
        keys.collect()
    }
}

/// Other settings of shadows: what differs between the two changes, and nothing else.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShadowChange {
    /// As they were.
    pub from: ShadowSettings,
    /// As they are to be.
    pub to: ShadowSettings,
}

impl ShadowChange {
    /// Settings with the change.
    pub fn made_in(&self, settings: ShadowSettings) -> ShadowSettings {
        let Self { from, to } = self;
        let shafts = settings.shafts.with_changes(&from.shafts, &to.shafts);
        ShadowSettings {
            shafts,
            ..settings.with_changes(from, to)
        }
    }

    /// What becomes of the keys that it changes.
    pub fn keys(&self) -> Vec<KeyChange> {
        let Self { from, to } = self;
        let of_quality = || {
            to.quality
                .map_or_else(ShadowSettings::default, Quality::shadows)
        };
        let given = (from.quality != to.quality).then(of_quality);
        let shafts = given.map(|given| given.shafts);
        let mut keys = ShadowSettings::changed_keys(from, to, given.as_ref());
        keys.extend(ShaftSettings::changed_keys(
            &from.shafts,
            &to.shafts,
            shafts.as_ref(),
        ));
        if from.shafts.difference != to.shafts.difference {
            keys.extend(difference_keys(to.shafts.difference));
        }
        keys
    }
}

/// Reads it.
pub fn shadows(root: &Table, probe: Option<&ProbeScene>) -> Result<ShadowSettings, SceneError> {
    let environment = match ENVIRONMENT_SECTION.table(root)? {
        Some(table) => EnvironmentSettings::read(&table, &EnvironmentSettings::default())?,
        None => EnvironmentSettings::default(),
    };
    let Some(table) = SHADOWS_SECTION.table(root)? else {
        return Ok(ShadowSettings {
            environment,
            ..ShadowSettings::default()
        });
    };
    let quality = SHADOWS.quality.read(&table)?;
    let default = quality.map_or_else(ShadowSettings::default, Quality::shadows);
    check_technique(&table, probe)?;
    Ok(ShadowSettings {
        shafts: ShaftSettings {
            difference: difference(&table)?,
            ..ShaftSettings::read(&table, &default.shafts)?
        },
        environment,
        ..ShadowSettings::read(&table, &default)?
    })
}

/// Whether this scene has what the technique needs.
fn check_technique(table: &Table, probe: Option<&ProbeScene>) -> Result<(), SceneError> {
    let Some(value) = SHADOWS.technique.value(table) else {
        return Ok(());
    };
    let technique = SHADOWS.technique.read(table)?;
    let Some(in_words) = technique.probe_in_words() else {
        return Ok(());
    };
    match probe {
        None => {
            let allowed = Technique::names_of(|technique| !technique.needs_probe());
            let message = format!("the scene has no [probe], {in_words}; allowed: {allowed}");
            Err(value.error(message))
        }
        Some(probe) if probe.anchor != 0 && !technique.follows_probe() => {
            let name = technique.name();
            let allowed = Technique::names_of(Technique::follows_probe);
            Err(value.error(format!(
                "the probe turns with a marker (probe.on), which {name} cannot follow; allowed: {allowed}"
            )))
        }
        Some(_) => Ok(()),
    }
}

/// `compositing` decides in which numbers, `difference` how within linear light.
fn difference(table: &Table) -> Result<Difference, SceneError> {
    let difference = DIFFERENCE.difference.read(table)?;
    let compositing = DIFFERENCE.compositing.read(table)?;
    match (compositing, DIFFERENCE.difference.value(table)) {
        (CompositingSpace::Encoded, Some(named)) => Err(DIFFERENCE.compositing.value(table).unwrap_or(named).error(
            "difference is of float compositing; ldr always takes encoded levels away: leave one of the two out",
        )),
        (CompositingSpace::Encoded, None) => Ok(Difference::Encoded),
        (CompositingSpace::Linear, _) => Ok(match difference {
            LinearDifference::Ratio => Difference::Ratio,
            LinearDifference::Subtract => Difference::Subtract,
        }),
    }
}

/// What becomes of the two keys.
fn difference_keys(difference: Difference) -> [KeyChange; 2] {
    let (linear, compositing) = match difference {
        Difference::Ratio => (LinearDifference::Ratio, CompositingSpace::Linear),
        Difference::Subtract => (LinearDifference::Subtract, CompositingSpace::Linear),
        Difference::Encoded => (LinearDifference::Ratio, CompositingSpace::Encoded),
    };
    let DifferenceKeys {
        difference: key,
        compositing: numbers,
    } = &DIFFERENCE;
    [
        KeyChange {
            key: key.name,
            text: (linear != *key.default())
                .then(|| key.text(&linear))
                .flatten(),
        },
        KeyChange {
            key: numbers.name,
            text: (compositing != *numbers.default())
                .then(|| numbers.text(&compositing))
                .flatten(),
        },
    ]
}

impl Scene {
    /// The technique that makes this scene's shadows, and why.
    pub fn chosen_technique(&self) -> (ShadowTechnique, &'static str) {
        match self.shadows.technique {
            Technique::Auto => match &self.probe {
                None => (ShadowTechnique::Volumes, "the scene has no probe"),
                Some(_) if self.shadows.shafts.difference != Difference::Ratio => (
                    ShadowTechnique::Shafts,
                    "the scene has a probe; only a ratio is taken of several lights' sum",
                ),
                Some(probe) if probe.is_far => {
                    let reason = "the scene has a probe; without a room its light comes from afar";
                    (ShadowTechnique::Environment, reason)
                }
                Some(_) => (ShadowTechnique::Both, "the scene has a probe and a room"),
            },
            Technique::Shafts => (ShadowTechnique::Shafts, "the scene asks for it"),
            Technique::Volumes => (ShadowTechnique::Volumes, "the scene asks for it"),
            Technique::Environment => (ShadowTechnique::Environment, "the scene asks for it"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quality_sets_its_own_keys_and_leaves_the_rest() {
        let from = ShadowSettings {
            samples: 1,
            counting: VolumeCounting::DepthFail,
            shafts: ShaftSettings {
                sources: Some(7),
                patches: 900,
                ..ShaftSettings::default()
            },
            ..ShadowSettings::default()
        };
        let to = from.with_quality(Quality::Accurate);
        assert_eq!((to.samples, to.shafts.sources), (4, None));
        assert_eq!((to.counting, to.shafts.patches), (from.counting, 900));
        // What the quality says goes, and only that.
        let keys = ShadowChange { from, to }.keys();
        let keys: Vec<(&str, Option<&str>)> = keys
            .iter()
            .map(|change| (change.key, change.text.as_deref()))
            .collect();
        let expected = [
            ("quality", Some("\"accurate\"")),
            ("samples", None),
            ("light_samples", None),
            ("ambient_samples", None),
            ("reflection_samples", None),
            ("max_silhouette_error_px", None),
            ("sources", None),
        ];
        assert_eq!(keys, expected);
        assert!(to.keys_beside_quality().is_empty());
        let other = ShadowSettings { samples: 1, ..to };
        assert_eq!(other.keys_beside_quality(), ["samples"]);
    }
}
