//! Photographs and films of others beside the project, and which markers people see in them. None of them is shipped: where
//! they are not, a chart goes without them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, ensure};
use glam::DVec2;

use crate::capture::{Frame, FrameSource};
use crate::geometry::camera::{Distortion, Intrinsics};
use crate::scene::Family;

/// Where they lie.
const FOLDER: &str = "../shared/real";
const ROOM: &str = "swatbotics/mapping_feb_2014";
const WALL: &str = "../cases/tracking/false_chase.mkv";

/// A picture, and the markers that are in it.
pub struct Still {
    /// The picture, at time 0 where it is no film.
    pub frame: Frame,
    /// Those that people see.
    pub ids: BTreeSet<u32>,
    /// Those that are there besides, cut off or hardly to be seen: neither wanted nor wrong.
    pub besides: BTreeSet<u32>,
}

/// Pictures of one place.
#[derive(Clone, Copy)]
pub struct Photographs {
    /// What the chart calls them.
    pub name: &'static str,
    /// The markers that are looked for.
    family: FamilyOf,
    /// Whether none of the markers is there.
    pub of_none: bool,
    /// A file or folder.
    place: &'static str,
    read: fn(&Path) -> Result<Vec<Still>>,
}

#[derive(Clone, Copy)]
enum FamilyOf {
    Named(&'static str),
    /// With borders of two cells, as Kalibr prints its grids.
    AprilGrid,
    /// The dictionary of a file.
    File(&'static str),
}

/// All that are known.
pub const ALL: [Photographs; 13] = [
    Photographs::stills("a room", "tag36h11", ROOM, room),
    Photographs::stills("a clipboard", "tag36h11", "swatbotics/clipboard", clipboard),
    Photographs::stills("a hallway", "tag36h11", "swatbotics/hallway", hallway),
    Photographs::stills("road signs", "tag36h11", "duckietown", road_signs),
    Photographs {
        family: FamilyOf::AprilGrid,
        ..Photographs::stills("a grid, 2-bit borders", "", "yac_mocap", grid)
    },
    Photographs::stills(
        "tutorial, 6X6_250",
        "DICT_6X6_250",
        "opencv_tutorial",
        tutorial,
    ),
    Photographs {
        family: FamilyOf::File("tutorial_dict.yml"),
        ..Photographs::stills("tutorial, its own", "", "opencv_tutorial", tutorial_own)
    },
    Photographs::stills("room, for tag16h5", "tag16h5", ROOM, room).asked_in_vain(),
    Photographs::stills("room, for 4X4_50", "DICT_4X4_50", ROOM, room).asked_in_vain(),
    Photographs::stills("room, for 5X5_1000", "DICT_5X5_1000", ROOM, room).asked_in_vain(),
    Photographs::stills("a wall, for tag16h5", "tag16h5", WALL, film).asked_in_vain(),
    Photographs::stills("a wall, for 4X4_50", "DICT_4X4_50", WALL, film).asked_in_vain(),
    Photographs::stills("a wall, for 5X5_1000", "DICT_5X5_1000", WALL, film).asked_in_vain(),
];

impl Photographs {
    const fn stills(
        name: &'static str,
        family: &'static str,
        place: &'static str,
        read: fn(&Path) -> Result<Vec<Still>>,
    ) -> Self {
        Self {
            name,
            family: FamilyOf::Named(family),
            of_none: false,
            place,
            read,
        }
    }

    /// The same asked for markers of which none is there.
    const fn asked_in_vain(self) -> Self {
        Self {
            of_none: true,
            ..self
        }
    }

    /// The file or folder.
    pub fn place(&self) -> PathBuf {
        Path::new(FOLDER).join(self.place)
    }

    /// The markers that are looked for.
    ///
    /// # Errors
    /// A dictionary that cannot be read.
    pub fn family(&self) -> Result<Family> {
        match self.family {
            FamilyOf::Named(name) => Family::from_name(name).context("no such family"),
            FamilyOf::AprilGrid => Family::TAG36H11.with_border(2).context("no such border"),
            FamilyOf::File(file) => {
                let file = self.place().join(file);
                Family::from_file(&file).with_context(|| file.display().to_string())
            }
        }
    }

    /// Whether libapriltag knows such markers by itself.
    pub fn is_read_by_libapriltag(&self) -> bool {
        matches!(self.family, FamilyOf::Named(name) if name.starts_with("tag"))
    }

    /// Whether a tracker goes on from picture to picture: what weak codes are worth shows where pictures follow each other,
    /// strong ones are proof in each by itself.
    pub fn plays_on(&self) -> bool {
        self.of_none
    }

    /// The pictures with their markers.
    ///
    /// # Errors
    /// What cannot be read.
    pub fn read(&self) -> Result<Vec<Still>> {
        let mut stills = (self.read)(&self.place())?;
        if self.of_none {
            stills.iter_mut().for_each(|still| still.ids.clear());
        }
        Ok(stills)
    }
}

/// The camera of the turned tag; its pictures are rectified.
pub const TURNED_CAMERA: Intrinsics = Intrinsics {
    size_px: [1056, 792],
    focal_px: DVec2::new(329.873, 332.946),
    center_px: DVec2::new(528.0, 396.0),
    distortion: Distortion::NONE,
};

/// The pictures of a tag of 65 mm that is turned about the vertical, by how many degrees; none where they are not.
pub fn turned_tag() -> impl Iterator<Item = (f64, PathBuf)> {
    let folder = Path::new(FOLDER).join("duckietown");
    let pictures = (-7..=7).map(move |step| {
        let degrees = 10 * step;
        (
            f64::from(degrees),
            folder.join(format!("test_image_rotation_{degrees}.png")),
        )
    });
    pictures.filter(|(_, path)| path.is_file())
}

/// A picture as a frame at time 0.
///
/// # Errors
/// A file that is no picture.
pub fn read_picture(path: &Path) -> Result<Frame> {
    let picture = image::open(path).with_context(|| path.display().to_string())?;
    let picture = picture.to_rgba8();
    Ok(Frame {
        index: 0,
        time_secs: 0.0,
        size_px: [picture.width(), picture.height()],
        rgba: picture.into_raw(),
    })
}

/// A picture of a folder with all that is in it.
fn still(folder: &Path, name: &str, ids: impl IntoIterator<Item = u32>) -> Result<Still> {
    Ok(Still {
        frame: read_picture(&folder.join(name))?,
        ids: ids.into_iter().collect(),
        besides: BTreeSet::new(),
    })
}

/// The names of a folder's PNG and JPEG pictures, in order.
///
/// # Errors
/// A folder that cannot be read.
pub fn pictures_in(folder: &Path) -> Result<Vec<String>> {
    let entries = std::fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    let mut names = Vec::new();
    for entry in entries {
        let name = entry?.file_name().to_string_lossy().into_owned();
        let ending = name.rsplit('.').next().unwrap_or_default();
        if ["png", "jpg"].contains(&ending.to_lowercase().as_str()) {
            names.push(name);
        }
    }
    names.sort();
    Ok(names)
}

/// Tags on walls, near to far, that the photographs' authors counted.
fn room(folder: &Path) -> Result<Vec<Still>> {
    let list = folder.join("groundtruth.txt");
    let text = std::fs::read_to_string(&list).with_context(|| list.display().to_string())?;
    let lines = text.lines().filter(|line| !line.trim().is_empty());
    let stills = lines.map(|line| {
        let mut words = line.split_whitespace();
        let name = words.next().unwrap_or_default();
        still(folder, name, words.filter_map(|word| word.parse().ok()))
    });
    stills.collect()
}

/// A part of a film of a room in which no marker is.
fn film(file: &Path) -> Result<Vec<Still>> {
    let mut source = FrameSource::open(&file.to_string_lossy())?;
    let mut stills = Vec::new();
    while let Some(frame) = source.next_frame()? {
        stills.push(Still {
            frame,
            ids: BTreeSet::new(),
            besides: BTreeSet::new(),
        });
    }
    Ok(stills)
}

/// Thirty small tags in several lights and blurred by motion; three pictures do not show all of them.
fn clipboard(folder: &Path) -> Result<Vec<Still>> {
    let names = pictures_in(folder)?;
    ensure!(
        names.len() == 10,
        "{}: not the ten pictures",
        folder.display()
    );
    let stills = names.iter().enumerate().map(|(number, name)| {
        let all = still(folder, name, 0..30)?;
        Ok(match [0, 3, 7].contains(&number) {
            true => Still {
                besides: all.ids,
                ids: BTreeSet::new(),
                ..all
            },
            false => all,
        })
    });
    stills.collect()
}

fn hallway(folder: &Path) -> Result<Vec<Still>> {
    let names = pictures_in(folder)?;
    let stills = names.iter().zip([3, 3, 2, 2, 10]);
    stills.map(|(name, id)| still(folder, name, [id])).collect()
}

/// Some stand or lie behind others, or are seen from the edge.
fn road_signs(folder: &Path) -> Result<Vec<Still>> {
    const SEEN: [(&str, &[u32]); 11] = [
        ("_multiple_01", &[22, 24, 58, 85, 144, 198]),
        ("_multiple_02", &[22, 24, 85, 144, 198]),
        ("_multiple_03", &[22, 24, 58, 85, 144, 198]),
        ("_multiple_04", &[22, 24, 58, 85, 144, 198]),
        ("_multiple_05", &[22, 24, 85, 198]),
        ("_multiple_06", &[22, 24, 58, 85, 144, 198]),
        ("_multiple_07", &[22, 24, 58, 85, 144, 198]),
        ("_multiple_08", &[85, 144, 198]),
        ("_multiple_09", &[22, 24, 58, 85, 144]),
        ("_multiple_10", &[22, 24, 58, 85, 198]),
        ("", &[60, 82, 318, 328, 387]),
    ];
    let stills = SEEN.map(|(name, ids)| {
        let seen = still(
            folder,
            &format!("test_image{name}.png"),
            ids.iter().copied(),
        )?;
        Ok(match name {
            "" => seen,
            // The same signs in all.
            _ => Still {
                besides: [22, 24, 58, 85, 144, 198].into(),
                ..seen
            },
        })
    });
    stills.into_iter().collect()
}

/// Tags whose corners all lie in the picture, by the authors' own list; others are cut off.
fn grid(folder: &Path) -> Result<Vec<Still>> {
    let pictures = folder.join("cam0/data");
    let stills = pictures_in(&pictures)?.into_iter().map(|name| {
        let stem = name
            .rsplit_once('.')
            .map_or(name.as_str(), |(stem, _)| stem);
        let list = folder.join(format!("grid0/cam0/data/{stem}.csv"));
        let text = std::fs::read_to_string(&list).with_context(|| list.display().to_string())?;
        let mut corners: BTreeMap<u32, u32> = BTreeMap::new();
        for row in text.lines().skip(1) {
            let id = row.split(',').nth(10).unwrap_or_default();
            let id = id
                .trim()
                .parse()
                .with_context(|| format!("{}: a row without an id", list.display()))?;
            *corners.entry(id).or_default() += 1;
        }
        let whole = corners.into_iter().filter(|&(_, count)| count == 4);
        Ok(Still {
            besides: (0..36).collect(),
            ..still(&pictures, &name, whole.map(|(id, _)| id))?
        })
    });
    stills.collect()
}

/// Six markers alone, and boards with corners of a chessboard between their markers.
fn tutorial(folder: &Path) -> Result<Vec<Still>> {
    Ok(vec![
        still(
            folder,
            "singlemarkersoriginal.jpg",
            [23, 40, 62, 98, 124, 203],
        )?,
        still(folder, "choriginal.jpg", 0..17)?,
        still(folder, "chocclusion_original.jpg", (0..11).chain([12, 15]))?,
    ])
}

/// A board of a dictionary of its own, whole, and with a hand on it and lines drawn across.
fn tutorial_own(folder: &Path) -> Result<Vec<Still>> {
    let left = [7..11, 12..15, 16..20, 21..29, 30..34]
        .into_iter()
        .flatten();
    Ok(vec![
        still(folder, "gboriginal.jpg", 0..35)?,
        Still {
            besides: (0..35).collect(),
            ..still(folder, "gbocclusion.jpg", left)?
        },
    ])
}
