//! Poses as CSV: a row per anchor and frame, `camera_from_anchor` as a translation in metres and a Rodrigues vector in
//! radians, empty where there is no pose; the times stand in the first anchor's row.

use std::collections::{BTreeMap, HashMap};
use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context as _, Result, bail, ensure};
use glam::DVec3;

use crate::geometry::pose::{pose_from_rodrigues, rodrigues_from_pose};
use crate::scene::{Anchor, plain_file, suggestion};
use crate::tracking::{AnchorPose, Status, predicted_visibility};

/// The header, and so the meaning, of every row.
pub const HEADER: &str =
    "frame,time_s,anchor,status,markers,tx_m,ty_m,tz_m,rx,ry,rz,track_ms,render_ms";

/// A poses file's text, which grows row by row; kept in memory, because the file appears whole or not at all.
pub struct PosesText {
    text: String,
}

impl PosesText {
    /// The header alone.
    pub fn new() -> Self {
        Self {
            text: format!("{HEADER}\n"),
        }
    }

    /// Adds the rows of one frame; `render_ms` is `None` where nothing was drawn.
    pub fn add_frame(
        &mut self,
        frame: (u32, f64),
        anchors: &[Anchor],
        poses: &[AnchorPose],
        (track_ms, render_ms): (Option<f64>, Option<f64>),
    ) {
        let (index, time_secs) = frame;
        for (row, (anchor, pose)) in anchors.iter().zip(poses).enumerate() {
            let status = status_name(pose.status);
            let _ = write!(
                self.text,
                "{index},{time_secs:.6},{},{status},{},",
                anchor.name, pose.markers
            );
            match &pose.camera_from_anchor {
                Some(camera_from_anchor) => {
                    // Finer than single precision, so that poses read again draw the same picture.
                    let t = camera_from_anchor.translation;
                    let r = rodrigues_from_pose(camera_from_anchor);
                    let _ = write!(
                        self.text,
                        "{:.12},{:.12},{:.12},{:.12},{:.12},{:.12},",
                        t.x, t.y, t.z, r.x, r.y, r.z
                    );
                }
                None => self.text.push_str(",,,,,,"),
            }
            let ms = |ms: Option<f64>| match ms {
                Some(ms) if row == 0 => format!("{ms:.3}"),
                _ => String::new(),
            };
            let _ = writeln!(self.text, "{},{}", ms(track_ms), ms(render_ms));
        }
    }

    /// The whole file's text.
    pub fn as_str(&self) -> &str {
        &self.text
    }

    /// What was added since this was asked last; for a file that grows on the disk.
    pub fn take(&mut self) -> String {
        std::mem::take(&mut self.text)
    }
}

impl Default for PosesText {
    fn default() -> Self {
        Self::new()
    }
}

const STATUSES: [Status; 4] = [
    Status::Tracked,
    Status::Predicted,
    Status::Ambiguous,
    Status::Lost,
];

fn status_name(status: Status) -> &'static str {
    match status {
        Status::Tracked => "tracked",
        Status::Predicted => "predicted",
        Status::Ambiguous => "ambiguous",
        Status::Lost => "lost",
    }
}

fn status_of(name: &str) -> Result<Status> {
    let found = STATUSES.into_iter().find(|it| status_name(*it) == name);
    let names = STATUSES.map(status_name);
    found.with_context(|| format!("status \"{name}\"{}", suggestion(name, &names)))
}

/// Poses by frame and anchor, read from a file.
pub struct GivenPoses {
    by_frame: BTreeMap<u32, Vec<AnchorPose>>,
    anchor_count: usize,
}

impl GivenPoses {
    /// Reads the poses of the scene's anchors. Columns are found by name; `frame`, `anchor` and the six of the pose
    /// must be there.
    ///
    /// # Errors
    /// File and line of the first row that cannot be read, or contradicts another or itself.
    pub fn read(path: &Path, anchors: &[Anchor]) -> Result<Self> {
        let text = plain_file::read_text(path)
            .with_context(|| format!("cannot read the poses {}", path.display()))?;
        Self::parse(&text, anchors).with_context(|| format!("in the poses {}", path.display()))
    }

    fn parse(text: &str, anchors: &[Anchor]) -> Result<Self> {
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .flexible(true)
            .from_reader(text.as_bytes());
        let header = reader.headers()?.clone();
        ensure!(!header.is_empty(), "the file is empty");
        let columns = Columns::of(&header)?;
        // Frame and anchor of each row, with its line.
        let mut lines: HashMap<(u32, usize), u64> = HashMap::new();
        let mut by_frame: BTreeMap<u32, Vec<GivenPose>> = BTreeMap::new();
        for row in reader.records() {
            let row = row?;
            let line = line_of(text, &row);
            if row.iter().all(str::is_empty) {
                continue;
            }
            ensure!(
                row.len() == header.len(),
                "line {line}: {} fields where the header has {}",
                row.len(),
                header.len()
            );
            let (index, anchor, pose) = columns
                .read(&row, anchors)
                .with_context(|| format!("line {line}"))?;
            if let Some(before) = lines.insert((index, anchor), line) {
                bail!(
                    "line {line}: frame {index} of \"{}\" is already on line {before}",
                    anchors[anchor].name
                );
            }
            let lost = || vec![GivenPose::lost(); anchors.len()];
            by_frame.entry(index).or_insert_with(lost)[anchor] = pose;
        }
        for anchor in 0..anchors.len() {
            fade(by_frame.values_mut().map(|poses| &mut poses[anchor]));
        }
        let poses = by_frame.into_iter();
        Ok(Self {
            by_frame: poses
                .map(|(index, poses)| (index, poses.into_iter().map(|it| it.pose).collect()))
                .collect(),
            anchor_count: anchors.len(),
        })
    }

    /// The poses of a frame; all lost where the file says nothing of it.
    pub fn of_frame(&self, index: u32) -> Vec<AnchorPose> {
        self.by_frame
            .get(&index)
            .cloned()
            .unwrap_or_else(|| vec![lost(); self.anchor_count])
    }

    /// The frames that it says something of, in words.
    pub fn frames_in_words(&self) -> String {
        let mut frames = self.by_frame.keys();
        match (frames.next(), frames.next_back()) {
            (None, _) => "it has no row".to_owned(),
            (Some(only), None) => format!("it has frame {only}"),
            (Some(first), Some(last)) => format!("it has frames {first} to {last}"),
        }
    }
}

/// The number of a row's line. (The reader's position is before the blank lines that it passed over.)
fn line_of(text: &str, row: &csv::StringRecord) -> u64 {
    let Some(position) = row.position() else {
        return 0;
    };
    let rest = &text.as_bytes()[position.byte() as usize..];
    let blank = rest.iter().take_while(|byte| matches!(byte, b'\r' | b'\n'));
    position.line() + blank.filter(|byte| **byte == b'\n').count() as u64
}

/// A row's pose, and its time.
#[derive(Clone)]
struct GivenPose {
    pose: AnchorPose,
    /// `None` where the file does not tell.
    time_secs: Option<f64>,
}

impl GivenPose {
    fn lost() -> Self {
        Self {
            pose: lost(),
            time_secs: None,
        }
    }
}

/// Shows an anchor's predicted poses, frame by frame, as much as their age lets the tracker show them.
fn fade<'a>(poses: impl Iterator<Item = &'a mut GivenPose>) {
    let mut seen_secs = None;
    for GivenPose { pose, time_secs } in poses {
        match (pose.status, seen_secs, *time_secs) {
            (Status::Predicted, Some(seen_secs), Some(now_secs)) => {
                pose.visibility = predicted_visibility(now_secs - seen_secs);
            }
            (Status::Tracked | Status::Ambiguous, _, now_secs) => seen_secs = now_secs,
            _ => {}
        }
    }
}

/// Where the columns stand that are read.
struct Columns {
    frame: usize,
    anchor: usize,
    pose: [usize; 6],
    time: Option<usize>,
    status: Option<usize>,
    markers: Option<usize>,
}

impl Columns {
    fn of(header: &csv::StringRecord) -> Result<Self> {
        let optional = |name: &str| {
            let mut found = (0..header.len()).filter(|&column| &header[column] == name);
            let first = found.next();
            ensure!(
                found.next().is_none(),
                "line 1: the column `{name}` is there twice"
            );
            Ok(first)
        };
        let column = |name: &str| {
            optional(name)?.with_context(|| {
                let separated = match &header[0] {
                    alone if header.len() == 1 && alone.contains(';') => "; commas are to separate fields, not semicolons",
                    alone if header.len() == 1 && alone.contains('\t') => "; commas are to separate fields, not tabs",
                    _ => "",
                };
                format!("line 1: the column `{name}` is missing; the header is to be `{HEADER}`{separated}")
            })
        };
        let [tx, ty, tz, rx, ry, rz] = ["tx_m", "ty_m", "tz_m", "rx", "ry", "rz"].map(column);
        Ok(Self {
            frame: column("frame")?,
            anchor: column("anchor")?,
            pose: [tx?, ty?, tz?, rx?, ry?, rz?],
            time: optional("time_s")?,
            status: optional("status")?,
            markers: optional("markers")?,
        })
    }

    /// The frame, the anchor and the pose of a row.
    fn read(&self, row: &csv::StringRecord, anchors: &[Anchor]) -> Result<(u32, usize, GivenPose)> {
        let frame = &row[self.frame];
        let index = (frame.parse().ok())
            .with_context(|| format!("frame \"{frame}\" is not a whole number"))?;
        let anchor = place_of(&row[self.anchor], anchors)?;
        let time_secs = self
            .time
            .map(|column| &row[column])
            .filter(|it| !it.is_empty());
        let time_secs = time_secs.map(finite_number).transpose()?;
        let has_pose = self.pose.iter().any(|&column| !row[column].is_empty());
        let status = self.status.map_or("", |column| &row[column]);
        let status = match (status, has_pose) {
            ("", true) => Status::Tracked,
            ("", false) => Status::Lost,
            _ => status_of(status)?,
        };
        ensure!(
            has_pose == (status != Status::Lost),
            "{} and {} pose",
            status_name(status),
            if has_pose { "a" } else { "no" }
        );
        let mut pose = AnchorPose { status, ..lost() };
        if has_pose {
            let mut numbers = [0.0; 6];
            for (number, &column) in numbers.iter_mut().zip(&self.pose) {
                *number = finite_number(&row[column])?;
            }
            let [tx, ty, tz, rx, ry, rz] = numbers;
            let (shift_m, rotation) = (DVec3::new(tx, ty, tz), DVec3::new(rx, ry, rz));
            let markers = self.markers.map_or("", |column| &row[column]);
            pose.camera_from_anchor = Some(pose_from_rodrigues(shift_m, rotation));
            pose.markers = markers.parse().unwrap_or(0);
            pose.visibility = 1.0;
        }
        Ok((index, anchor, GivenPose { pose, time_secs }))
    }
}

/// Which anchor of the scene is meant.
fn place_of(name: &str, anchors: &[Anchor]) -> Result<usize> {
    let place = anchors.iter().position(|anchor| anchor.name == name);
    place.with_context(|| {
        let known: Vec<_> = anchors.iter().map(|anchor| anchor.name.as_str()).collect();
        format!(
            "the scene has no anchor \"{name}\"; it has {}",
            known.join(", ")
        )
    })
}

fn finite_number(field: &str) -> Result<f64> {
    let number = field.parse().ok().filter(|number: &f64| number.is_finite());
    number.with_context(|| format!("\"{field}\" is not a finite number"))
}

fn lost() -> AnchorPose {
    AnchorPose::LOST
}

#[cfg(test)]
mod tests {
    use super::*;

    fn anchors() -> Vec<Anchor> {
        ["table", "card"]
            .map(|name| Anchor {
                name: name.to_owned(),
                markers: Vec::new(),
            })
            .to_vec()
    }

    #[test]
    fn what_is_written_is_read() {
        let pose = pose_from_rodrigues(DVec3::new(0.1, -0.2, 0.7), DVec3::new(2.0, 0.3, -0.4));
        let tracked = AnchorPose {
            status: Status::Tracked,
            markers: 5,
            camera_from_anchor: Some(pose),
            ..lost()
        };
        let mut text = PosesText::new();
        text.add_frame((7, 0.25), &anchors(), &[tracked, lost()], (Some(1.5), None));
        assert!(text.as_str().starts_with(HEADER));
        assert_eq!(
            text.as_str().lines().nth(2),
            Some("7,0.250000,card,lost,0,,,,,,,,")
        );

        let read = GivenPoses::parse(text.as_str(), &anchors()).expect("poses");
        let [table, card] = &read.of_frame(7)[..] else {
            panic!("two anchors")
        };
        let again = table.camera_from_anchor.expect("a pose");
        assert!(again.abs_diff_eq(pose, 1e-8) && table.markers == 5);
        assert_eq!(card.camera_from_anchor, None);
        assert_eq!(read.of_frame(8), vec![lost(), lost()]);
    }

    #[test]
    fn what_fades_fades_again_when_it_is_read() {
        let pose = pose_from_rodrigues(DVec3::Z, DVec3::X);
        let shown = |status, visibility| AnchorPose {
            status,
            camera_from_anchor: Some(pose),
            visibility,
            ..lost()
        };
        let times_secs: [f64; 5] = [0.1, 0.15, 0.25, 0.4, 0.45];
        let written = times_secs.map(|time_secs| match time_secs == 0.1 {
            true => shown(Status::Tracked, 1.0),
            false => shown(Status::Predicted, predicted_visibility(time_secs - 0.1)),
        });
        assert!(written[1].visibility == 1.0 && written[4].visibility < 0.2);
        let mut text = PosesText::new();
        for (index, pose) in written.iter().enumerate() {
            let frame = (index as u32, times_secs[index]);
            text.add_frame(frame, &anchors(), &[pose.clone(), lost()], (None, None));
        }
        let read = GivenPoses::parse(text.as_str(), &anchors()).expect("poses");
        for (index, pose) in written.iter().enumerate() {
            let found = &read.of_frame(index as u32)[0];
            assert_eq!(found.status, pose.status);
            assert!((found.visibility - pose.visibility).abs() < 1e-5, "{index}");
        }
    }

    #[test]
    fn what_spreadsheets_write_is_read() {
        let text = "\"frame\",\"anchor\",\"tx_m\",\"ty_m\",\"tz_m\",\"rx\",\"ry\",\"rz\"\r\n\"3\",\"card\",0,0,\"1.5\",0,0,0\r\n";
        let read = GivenPoses::parse(text, &anchors()).expect("poses");
        let card = read.of_frame(3)[1].camera_from_anchor.expect("a pose");
        assert_eq!(card.translation, DVec3::new(0.0, 0.0, 1.5));
        assert_eq!(read.frames_in_words(), "it has frame 3");
    }

    #[test]
    fn mistakes_name_their_line() {
        let mistakes = [
            ("frame;anchor;tx_m\n0;table;1\n", "not semicolons"),
            (
                "frame,anchor,tx_m,ty_m,tz_m,rx,ry,rz,tx_m\n",
                "line 1: the column `tx_m` is there twice",
            ),
            (
                "frame,anchor,tx_m,ty_m,tz_m,rx,ry,rz\n0,card,0,0,1,0,0,0\n0,table,0,0,1,0,0,0\n0,card,,,,,,\n",
                "line 4: frame 0 of \"card\" is already on line 2",
            ),
            (
                "frame,anchor,status,tx_m,ty_m,tz_m,rx,ry,rz\n0,table,trakced,0,0,1,0,0,0\n",
                "line 2: status \"trakced\"; did you mean \"tracked\"?",
            ),
            (
                "frame,anchor,status,tx_m,ty_m,tz_m,rx,ry,rz\n0,table,lost,0,0,1,0,0,0\n",
                "line 2: lost and a pose",
            ),
            (
                "frame,anchor,status,tx_m,ty_m,tz_m,rx,ry,rz\n0,table,tracked,,,,,,\n",
                "line 2: tracked and no pose",
            ),
            ("", "empty"),
            ("frame,anchor\n", "`tx_m` is missing"),
            (
                "frame,anchor,tx_m,ty_m,tz_m,rx,ry,rz\n0,tabel,0,0,1,0,0,0\n",
                "line 2: the scene has no",
            ),
            (
                "frame,anchor,tx_m,ty_m,tz_m,rx,ry,rz\n0,table,0,0,NaN,0,0,0\n",
                "line 2: \"NaN\"",
            ),
            (
                "frame,anchor,tx_m,ty_m,tz_m,rx,ry,rz\n\n0,table,0,0\n",
                "line 3: 4 fields",
            ),
            (
                "frame,anchor,tx_m,ty_m,tz_m,rx,ry,rz\n-1,table,0,0,0,0,0,0\n",
                "line 2: frame",
            ),
        ];
        for (text, part) in mistakes {
            let message = format!(
                "{:#}",
                GivenPoses::parse(text, &anchors()).err().expect(part)
            );
            assert!(message.contains(part), "{message}");
        }
    }
}
