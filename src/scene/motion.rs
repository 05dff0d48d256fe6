//! How things move by themselves: `turn_deg_per_s` and `path`, with the frames' time.

use glam::{DAffine3, DQuat, DVec3};

use super::error::SceneError;
use super::placement::{ANGLE, POSITION, turn};
use super::ranges::Numbers;
use super::reader::{Table, Value};
use super::schema::key::Missing::{Is, Means};
use super::schema::section::{Section, Times};
use super::schema::values::{InWords, Vectors, Written};
use super::{Object, Scene};

/// How fast things may turn: beyond that no camera's frames show it.
const TURN: Numbers = Numbers::between(-1e5, 1e5).unit("degrees/s");
/// When something is: up to a year, in seconds.
const TIME: Numbers = Numbers::between(0.0, 3.2e7).unit("s");

choices! {
    /// What a thing does at the end of its path.
    pub enum PathEnd, "end of a path" {
        /// It stays at the last place.
        Stay = "stay",
        /// It begins again at the first place, at once.
        Repeat = "repeat",
        /// It goes back the way that it came, and to and fro.
        Return = "return",
    }
}

keys! {
    /// How a thing moves by itself.
    pub static MOTION: MotionKeys;

    /// A turn about its own origin that goes on: a number is about the z of what it stands on, three are an axis of that
    /// frame times the speed. Time is the frame's.
    turn_deg_per_s: Written, InWords::new("a number of degrees/s, or three") => Means(Written, "it does not turn");
    /// Where it is when, beside position_m and rotation_deg: straight from one place to the next, at least one, in the
    /// order of their times.
    path: Written, InWords::parts("a list of tables", &STATION_SECTION) => Means(Written, "it stays");
    /// What comes after the last place of its path.
    path_end: PathEnd => Is(PathEnd::Stay);
}

keys! {
    /// A place of a path.
    pub static STATION: StationKeys;
    required {
        /// Seconds since the recording's first frame.
        time_s: f64, TIME => "the time in seconds is expected";
    }
    /// Added to the thing's position_m.
    position_m: DVec3, Vectors::three(POSITION) => Is(DVec3::ZERO);
    /// Turns about x, then y, then z, after the thing's own, about its origin; from one place to the next the angles are
    /// counted up or down, so 360 is a whole turn.
    rotation_deg: DVec3, Vectors::three(ANGLE) => Is(DVec3::ZERO);
}

/// An entry of a thing's `path`.
pub static STATION_SECTION: Section = Section {
    name: "path",
    says: "A place and its time.",
    times: Times::InBraces,
    groups: &[StationKeys::ALL],
    shown: &[],
    is_aside: false,
};

/// How a thing moves by itself, in the frame of what it stands on.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// What it stands on: index into [`Scene::anchors`].
    pub anchor: usize,
    /// Axis times radians a second.
    pub turn_rad_per_s: DVec3,
    /// In the order of their times, which differ.
    pub path: Vec<Station>,
    /// What comes after the last place.
    pub path_end: PathEnd,
}

/// A place of a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Station {
    /// Seconds since the recording's first frame.
    pub time_s: f64,
    /// Beside the thing's own place, metres.
    pub offset_m: DVec3,
    /// After the thing's own turn: about x, then y, then z, degrees.
    pub rotation_deg: DVec3,
}

impl Motion {
    /// That of what stays where it stands on an anchor: what changes its shape has a node to itself all the same.
    pub fn none(anchor: usize) -> Self {
        Self {
            anchor,
            turn_rad_per_s: DVec3::ZERO,
            path: Vec::new(),
            path_end: PathEnd::Stay,
        }
    }

    /// Whether it stays where it stands.
    pub fn is_none(&self) -> bool {
        self.turn_rad_per_s == DVec3::ZERO && self.path.is_empty()
    }

    /// How far a thing is from its own place at a time, metres, and how it is turned about its origin.
    pub fn at(&self, time_s: f64) -> (DVec3, DQuat) {
        let (offset_m, turn) = self.on_path(time_s);
        let spin = DQuat::from_scaled_axis(self.turn_rad_per_s * time_s);
        (offset_m, turn * spin)
    }

    /// The frame in which a thing with this motion stands still: the anchor's own moved, with the thing's origin at
    /// `origin_m` of the anchor.
    pub fn anchor_from_node(&self, origin_m: DVec3, time_s: f64) -> DAffine3 {
        let (offset_m, turn) = self.at(time_s);
        DAffine3::from_translation(origin_m + offset_m)
            * DAffine3::from_quat(turn)
            * DAffine3::from_translation(-origin_m)
    }

    fn on_path(&self, time_s: f64) -> (DVec3, DQuat) {
        let (Some(first), Some(last)) = (self.path.first(), self.path.last()) else {
            return (DVec3::ZERO, DQuat::IDENTITY);
        };
        let lasts_s = last.time_s - first.time_s;
        let since_s = time_s - first.time_s;
        let since_s = match self.path_end {
            _ if since_s <= 0.0 || lasts_s <= 0.0 => since_s.clamp(0.0, lasts_s),
            PathEnd::Stay => since_s.min(lasts_s),
            PathEnd::Repeat => since_s % lasts_s,
            PathEnd::Return => lasts_s - (since_s % (2.0 * lasts_s) - lasts_s).abs(),
        };
        let time_s = first.time_s + since_s;
        let next = self
            .path
            .partition_point(|station| station.time_s <= time_s);
        let before = self.path[..next].last().unwrap_or(first);
        let Some(after) = self.path.get(next) else {
            return (last.offset_m, turn(last.rotation_deg));
        };
        let part = (time_s - before.time_s) / (after.time_s - before.time_s);
        (
            before.offset_m.lerp(after.offset_m, part),
            turn(before.rotation_deg.lerp(after.rotation_deg, part)),
        )
    }
}

/// Nodes are what things stand still on: the anchors, then for each thing that moves by itself a frame that moves with
/// it, phantoms first. [`Object::anchor`] counts them.
impl Scene {
    /// How many nodes there are.
    pub fn node_count(&self) -> usize {
        self.anchors.len() + self.moving().count()
    }

    /// Whether things can move to each other, or change their shape, without an edit.
    pub fn moves(&self) -> bool {
        let mut things = self.phantoms.iter().chain(&self.virtuals);
        self.anchors.len() > 1
            || things.any(|thing| {
                let motion = thing.motion.as_ref();
                thing.animation.is_some() || motion.is_some_and(|motion| !motion.is_none())
            })
    }

    /// Where the nodes are at a frame's time, from where the anchors are.
    pub fn camera_from_nodes(
        &self,
        camera_from_anchor: &[Option<DAffine3>],
        time_s: f64,
    ) -> Vec<Option<DAffine3>> {
        let mut nodes = camera_from_anchor.to_vec();
        nodes.extend(self.moving().map(|(object, motion)| {
            let camera_from_anchor = camera_from_anchor.get(motion.anchor).copied().flatten()?;
            let origin_m = object.anchor_from_object.translation;
            Some(camera_from_anchor * motion.anchor_from_node(origin_m, time_s))
        }));
        nodes
    }

    /// What holds for each node where it holds for each anchor.
    pub fn of_nodes<T: Copy>(&self, of_anchors: &[T]) -> Vec<T> {
        let mut nodes = of_anchors.to_vec();
        let moving = self.moving();
        nodes.extend(moving.filter_map(|(_, motion)| of_anchors.get(motion.anchor).copied()));
        nodes
    }

    /// The things that move by themselves, in the order of their nodes.
    fn moving(&self) -> impl Iterator<Item = (&Object, &Motion)> {
        let things = self.phantoms.iter().chain(&self.virtuals);
        things.filter_map(|thing| Some((thing, thing.motion.as_ref()?)))
    }
}

/// Reads how a thing on an anchor moves; `None` where it does not.
pub fn motion(table: &Table, anchor: usize) -> Result<Option<Motion>, SceneError> {
    let turn_rad_per_s = match MOTION.turn_deg_per_s.value(table) {
        None => DVec3::ZERO,
        Some(value) if value.is_array() => {
            DVec3::from_array(value.numbers::<3>(&TURN)?.map(f64::to_radians))
        }
        Some(value) => DVec3::Z * value.number(&TURN)?.to_radians(),
    };
    let path_end = MOTION.path_end.read(table)?;
    let path = match (MOTION.path.value(table), MOTION.path_end.value(table)) {
        (Some(value), _) => stations(&value)?,
        (None, Some(end)) => {
            return Err(end.error("it moves along no path; allowed: along with path"));
        }
        (None, None) => Vec::new(),
    };
    let motion = Motion {
        anchor,
        turn_rad_per_s,
        path,
        path_end,
    };
    Ok((!motion.is_none()).then_some(motion))
}

fn stations(list: &Value) -> Result<Vec<Station>, SceneError> {
    let mut stations: Vec<Station> = Vec::new();
    for entry in list.array("tables")? {
        let table = STATION_SECTION.table_of(&entry)?;
        let time_s = STATION.time_s.read(&table)?;
        if let Some(before) = stations.last().filter(|before| before.time_s >= time_s) {
            return Err(table.error(format!(
                "the place before it has time_s = {}; allowed: a later time",
                before.time_s
            )));
        }
        stations.push(Station {
            time_s,
            offset_m: STATION.position_m.read(&table)?,
            rotation_deg: STATION.rotation_deg.read(&table)?,
        });
    }
    match stations.is_empty() {
        true => Err(list.error("a path needs at least one place")),
        false => Ok(stations),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn station(time_s: f64, x_m: f64, turn_z_deg: f64) -> Station {
        Station {
            time_s,
            offset_m: DVec3::X * x_m,
            rotation_deg: DVec3::Z * turn_z_deg,
        }
    }

    fn on_path(path_end: PathEnd, time_s: f64) -> f64 {
        let motion = Motion {
            anchor: 0,
            turn_rad_per_s: DVec3::ZERO,
            path: vec![
                station(1.0, 0.0, 0.0),
                station(2.0, 0.4, 90.0),
                station(5.0, 1.0, 90.0),
            ],
            path_end,
        };
        motion.at(time_s).0.x
    }

    #[test]
    fn a_path_goes_straight_from_place_to_place() {
        for (time_s, x_m) in [
            (0.0, 0.0),
            (1.0, 0.0),
            (1.5, 0.2),
            (2.0, 0.4),
            (3.5, 0.7),
            (5.0, 1.0),
        ] {
            for end in [PathEnd::Stay, PathEnd::Return] {
                assert!((on_path(end, time_s) - x_m).abs() < 1e-12, "{time_s}");
            }
        }
        assert_eq!(on_path(PathEnd::Stay, 99.0), 1.0);
        // Four seconds a round: 6.5 is 1.5 of the second one, half a second after the place at 2.
        assert!((on_path(PathEnd::Repeat, 6.5) - 0.5).abs() < 1e-12);
        assert!((on_path(PathEnd::Repeat, 5.5) - on_path(PathEnd::Stay, 1.5)).abs() < 1e-12);
        assert!((on_path(PathEnd::Return, 6.0) - on_path(PathEnd::Stay, 4.0)).abs() < 1e-12);
        assert!((on_path(PathEnd::Return, 10.0) - on_path(PathEnd::Stay, 2.0)).abs() < 1e-12);
    }

    #[test]
    fn a_path_turns_as_far_as_its_angles_say() {
        let motion = Motion {
            anchor: 0,
            turn_rad_per_s: DVec3::ZERO,
            path: vec![station(0.0, 0.0, 0.0), station(3.0, 0.0, 270.0)],
            path_end: PathEnd::Stay,
        };
        for (time_s, turned) in [(1.0, DVec3::Y), (2.0, DVec3::NEG_X), (4.0, DVec3::NEG_Y)] {
            let (_, turn) = motion.at(time_s);
            assert!((turn * DVec3::X).distance(turned) < 1e-12, "{time_s}");
        }
    }

    #[test]
    fn a_turn_is_about_the_things_own_origin() {
        let motion = Motion {
            anchor: 0,
            turn_rad_per_s: DVec3::Z * std::f64::consts::FRAC_PI_2,
            path: vec![station(0.0, 0.1, 0.0)],
            path_end: PathEnd::Stay,
        };
        let origin_m = DVec3::new(0.3, -0.2, 0.05);
        let moved = motion.anchor_from_node(origin_m, 1.0);
        assert!(
            moved
                .transform_point3(origin_m)
                .distance(origin_m + DVec3::X * 0.1)
                < 1e-12
        );
        // A quarter turn takes +x to +y.
        let arm = moved.transform_point3(origin_m + DVec3::X) - moved.transform_point3(origin_m);
        assert!(arm.distance(DVec3::Y) < 1e-12);
    }
}
