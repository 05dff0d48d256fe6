//! Poses as CSV: a row per anchor and frame, `camera_from_anchor` as a translation in metres and a Rodrigues vector in
//! radians, empty where there is no pose; the times stand in the first anchor's row.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context as _, Result, bail, ensure};
use glam::{DAffine3, DVec3};

use crate::geometry::pose::{pose_from_rodrigues, rodrigues_from_pose};
use crate::scene::{Anchor, plain_file};
use crate::tracking::{AnchorPose, Status};

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

fn status_name(status: Status) -> &'static str {
    match status {
        Status::Tracked => "tracked",
        Status::Predicted => "predicted",
        Status::Ambiguous => "ambiguous",
        Status::Lost => "lost",
    }
}

/// Poses by frame and anchor, read from a file.
pub struct GivenPoses {
    by_frame: HashMap<u32, Vec<AnchorPose>>,
    anchor_count: usize,
}

impl GivenPoses {
    /// Reads the poses of the scene's anchors. Columns are found by name; `frame`, `anchor` and the six of the pose
    /// must be there.
    ///
    /// # Errors
    /// File and line of the first row that cannot be read.
    pub fn read(path: &Path, anchors: &[Anchor]) -> Result<Self> {
        let text = plain_file::read_text(path)
            .with_context(|| format!("cannot read the poses {}", path.display()))?;
        Self::parse(&text, anchors).with_context(|| format!("in the poses {}", path.display()))
    }

    fn parse(text: &str, anchors: &[Anchor]) -> Result<Self> {
        let mut lines = text.lines().enumerate();
        let Some((_, header)) = lines.next() else {
            bail!("the file is empty")
        };
        let columns: Vec<&str> = header.split(',').map(str::trim).collect();
        let column = |name: &str| {
            columns
                .iter()
                .position(|column| *column == name)
                .with_context(|| {
                    format!(
                        "line 1: the column `{name}` is missing; the header is to be `{HEADER}`"
                    )
                })
        };
        let (frame, anchor) = (column("frame")?, column("anchor")?);
        let pose = ["tx_m", "ty_m", "tz_m", "rx", "ry", "rz"].map(column);
        let [tx, ty, tz, rx, ry, rz] = pose;
        let pose = [tx?, ty?, tz?, rx?, ry?, rz?];
        let (status, markers) = (column("status").ok(), column("markers").ok());

        let mut by_frame: HashMap<u32, Vec<AnchorPose>> = HashMap::new();
        for (line, row) in lines {
            let line = line + 1;
            if row.trim().is_empty() {
                continue;
            }
            let fields: Vec<&str> = row.split(',').map(str::trim).collect();
            ensure!(
                fields.len() == columns.len(),
                "line {line}: {} fields where the header has {}",
                fields.len(),
                columns.len()
            );
            let index: u32 = fields[frame].parse().with_context(|| {
                format!(
                    "line {line}: frame \"{}\" is not a whole number",
                    fields[frame]
                )
            })?;
            let anchor = place_of(fields[anchor], anchors, line)?;
            let poses = by_frame
                .entry(index)
                .or_insert_with(|| vec![lost(); anchors.len()]);
            if pose.iter().all(|&column| fields[column].is_empty()) {
                continue;
            }
            let numbers = finite_numbers(pose.map(|column| fields[column]), line)?;
            let [tx, ty, tz, rx, ry, rz] = numbers;
            let camera_from_anchor: DAffine3 =
                pose_from_rodrigues(DVec3::new(tx, ty, tz), DVec3::new(rx, ry, rz));
            poses[anchor] = AnchorPose {
                status: match status.map(|column| fields[column]) {
                    Some("ambiguous") => Status::Ambiguous,
                    Some("predicted") => Status::Predicted,
                    _ => Status::Tracked,
                },
                markers: markers
                    .and_then(|column| fields[column].parse().ok())
                    .unwrap_or(0),
                camera_from_anchor: Some(camera_from_anchor),
                visibility: 1.0,
                ..lost()
            };
        }
        Ok(Self {
            by_frame,
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
}

/// Which anchor of the scene a line speaks of.
fn place_of(name: &str, anchors: &[Anchor], line: usize) -> Result<usize> {
    let place = anchors.iter().position(|anchor| anchor.name == name);
    place.with_context(|| {
        let known: Vec<_> = anchors.iter().map(|anchor| anchor.name.as_str()).collect();
        format!(
            "line {line}: the scene has no anchor \"{name}\"; it has {}",
            known.join(", ")
        )
    })
}

fn finite_numbers(fields: [&str; 6], line: usize) -> Result<[f64; 6]> {
    let mut numbers = [0.0; 6];
    for (number, field) in numbers.iter_mut().zip(fields) {
        *number = field
            .parse()
            .ok()
            .filter(|number: &f64| number.is_finite())
            .with_context(|| format!("line {line}: \"{field}\" is not a finite number"))?;
    }
    Ok(numbers)
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
    fn mistakes_name_their_line() {
        let mistakes = [
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
