//! What can be typed: commands and options.

mod values;

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use clap::{Args, Parser, Subcommand};

use gnomon::app::chart;
use gnomon::app::files::job_files::Replacing;
use gnomon::app::files::layer_files::Layer;
use gnomon::app::jobs::board::Distance;
use gnomon::app::jobs::probe::exposure_of;
use gnomon::calibration::{Target, TargetMarkers};
use gnomon::light::probe_maps::Circle;
use gnomon::scene::format::{ANCHOR_NAME, AnyKey as _, CAMERA, PRINTED, PROBE, TRACKING};
use gnomon::scene::{Family, Ink, PixelFormat, Shortcut, WantedFormat};
use values::{
    ball_distance_of, circle_of, counts_of, degrees_of, distance_of, family_of, index_of, mm_of,
    probe_width_of, reflectance_of, seconds_of,
};

/// Virtual things on a real table, lit and shadowed as if they stood there.
#[derive(Parser)]
#[command(version, arg_required_else_help = true)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Subcommand)]
pub enum Command {
    /// Opens a window on a camera, with the scene's virtual things in its picture.
    #[command(
        after_help = "Example:\n  gnomon live config/lamp.toml\n  gnomon live    # webcam:0, any marker"
    )]
    Live(LiveArgs),
    /// Plays a recording with the scene's virtual things in it.
    #[command(
        after_help = "Example:\n  gnomon replay config/lamp.toml --out out/lamp.mp4 --sheet out/lamp.png"
    )]
    Replay(ReplayArgs),
    /// Finds where the markers are, without drawing: poses as a file. Needs no GPU.
    #[command(
        after_help = "Example:\n  gnomon track config/lamp.toml --poses out/lamp.csv\n  gnomon track walk.mp4 \
                      --calibration camera.toml --size-mm 40 --poses out/walk.csv"
    )]
    Track(TrackArgs),
    /// Learns from a recording where markers lie about a table.
    #[command(
        after_help = "Example:\n  gnomon board --from walk.mp4 --calibration camera.toml --size-mm 40 --out table.toml"
    )]
    Board(BoardArgs),
    /// Calibrates a camera from a video or pictures of a printed target, or live.
    #[command(
        after_help = "Example:\n  gnomon calibrate walk.mp4 --chessboard 9x6 --square-mm 25 --out camera.toml --coverage out/coverage.png\n  \
                      gnomon calibrate stills/ --charuco 10x7 --square-mm 25 --marker-mm 18 --out camera.toml\n  \
                      gnomon calibrate webcam:0 --charuco 10x7 --square-mm 25 --marker-mm 18 --out camera.toml"
    )]
    Calibrate(CalibrateArgs),
    /// Makes sheets to print: markers, boards, calibration targets.
    #[command(
        after_help = "Example:\n  gnomon markers --board 3x2 --size-mm 45 --gap-mm 40 --landscape --out table.pdf\n  \
                      gnomon markers --ids 17,18 --size-mm 36 --out cards.pdf\n  \
                      gnomon markers --chessboard 9x6 --square-mm 25 --landscape --out chessboard.pdf\n  \
                      gnomon markers --charuco 10x7 --square-mm 25 --marker-mm 18 --landscape --out charuco.pdf"
    )]
    Markers(MarkersArgs),
    /// Records a camera as a session that replay and track take up, until Ctrl-C.
    #[command(
        after_help = "Example:\n  gnomon record webcam:0 --calibration camera.toml --out out/session --seconds 20"
    )]
    Record(RecordArgs),
    /// Makes a light probe from exposures of a mirror ball, an angular map or a panorama.
    #[command(
        after_help = "Examples:\n  gnomon probe ball-*.jpg --kind ball --out probe.hdr --preview out/probe.png\n  \
                      gnomon probe a.png b.png c.png --exposures 1/4,1/30,1/250 --kind ball --reflectance 0.65 --out probe.hdr\n  \
                      gnomon probe room_angmap.hdr --kind angular --turn-deg 90 --out probe.hdr"
    )]
    Probe(ProbeArgs),
    /// Lists the cameras and their formats.
    #[command(
        after_help = "Example:\n  gnomon cameras    # and then: gnomon record webcam:0 --out out/session"
    )]
    Cameras,
    /// Reads a scene and the first frames of its recording, says what is wrong or what is in it.
    #[command(after_help = "Example:\n  gnomon check config/lamp.toml")]
    Check {
        /// Scene file (TOML)
        scene: PathBuf,
    },
    /// Prints what makes a shell complete gnomon's commands and options.
    #[command(
        after_help = "Example:\n  gnomon completions bash > ~/.local/share/bash-completion/completions/gnomon\n\n\
                      `make install` does this for bash, fish and zsh."
    )]
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Prints a page of the manual (roff): the program's, or a command's.
    #[command(
        after_help = "Example:\n  gnomon manual replay | man -l -\n\n`make install` installs all pages."
    )]
    Manual {
        /// The command
        command: Option<String>,
    },
    /// Measures speed against accuracy on this machine, and draws it.
    #[command(
        after_help = "Example:\n  gnomon chart --quick --only tracking\n\nIt runs in the project's folder. \
                      What has been measured is not measured again by the same program from the same recordings: after \
                      an interrupt it goes on where it was."
    )]
    Chart(ChartArgs),
}

/// What results may take the place of.
#[derive(Args)]
pub struct ForceArgs {
    /// Replace whatever file has an output's name; without this an older result of gnomon's alone
    #[arg(long)]
    pub force: bool,
}

impl ForceArgs {
    pub fn replacing(&self) -> Replacing {
        match self.force {
            true => Replacing::Anything,
            false => Replacing::OlderResults,
        }
    }
}

#[derive(Args)]
pub struct ChartArgs {
    /// Folder for the charts; charts without this, charts/quick with --quick
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    #[arg(long, value_name = "NAME,…", value_delimiter = ',', help = format!("Make these alone: {}", chart::names().join(", ")))]
    pub only: Vec<String>,
    /// Fewer rounds, frames and settings: a look in a tenth of the time
    #[arg(long)]
    pub quick: bool,
    /// Track the sessions of this folder too
    #[arg(long, value_name = "DIR")]
    pub sessions: Option<PathBuf>,
    /// Graphics adapter, by a part of its name; the fastest kind without this
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
    #[command(flatten)]
    pub force: ForceArgs,
}

#[derive(Args)]
pub struct LiveArgs {
    /// Scene file (.toml), webcam (webcam:0, webcam:NAME, /dev/video0), address (http://…, rtsp://…), or recording
    #[arg(default_value = "webcam:0")]
    pub source: PathBuf,
    #[command(flatten)]
    pub recording: RecordingArgs,
    /// Folder for what the window's keys record: pictures, sessions, videos, each under a name that nothing has yet
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Graphics adapter, by a part of its name; the fastest kind without this
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
}

#[derive(Args)]
pub struct ReplayArgs {
    /// Scene file (TOML)
    pub scene: PathBuf,
    /// Video (.mp4, .mov: H.264; .mkv, .avi: lossless FFV1), or a folder for PNGs named by frame
    #[arg(long, value_name = "FILE|DIR")]
    pub out: Option<PathBuf>,
    /// Layers to write beside the PNGs
    #[arg(long, value_name = "LAYER,…", value_delimiter = ',')]
    pub layers: Vec<Layer>,
    /// Draw these frames alone, by their index in the recording
    #[arg(long, value_name = "N,…", value_delimiter = ',', value_parser = index_of, allow_negative_numbers = true)]
    pub frames: Option<Vec<u32>>,
    /// Show no virtual thing: the undistorted video alone
    #[arg(long)]
    pub bare: bool,
    /// Write the poses of all anchors (CSV; - for stdout, as for every text)
    #[arg(long, value_name = "FILE")]
    pub poses: Option<PathBuf>,
    /// Take the poses from such a file instead of tracking
    #[arg(long, value_name = "FILE")]
    pub poses_from: Option<PathBuf>,
    /// Write times per stage, frames, adapter and memory (JSON, or -)
    #[arg(long, value_name = "FILE")]
    pub stats: Option<PathBuf>,
    /// Draw shadow volumes without these shortcuts, to find what a wrong pixel comes from
    #[arg(long, value_name = "NAME,…", value_delimiter = ',', value_enum)]
    pub without: Vec<Shortcut>,
    /// Write small pictures of the whole replay on one sheet (PNG)
    #[arg(long, value_name = "FILE")]
    pub sheet: Option<PathBuf>,
    /// Graphics adapter, by a part of its name; the fastest kind without this
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
    #[command(flatten)]
    pub force: ForceArgs,
}

// A scene says which markers its anchors have.
#[derive(Args)]
#[command(mut_arg("family", |arg| arg.conflicts_with("anchors")))]
#[command(mut_arg("border_cells", |arg| arg.conflicts_with("anchors")))]
#[command(mut_arg("inverted", |arg| arg.conflicts_with("anchors")))]
pub struct TrackArgs {
    /// Scene file (.toml), session, video, picture or folder of pictures, webcam (webcam:0) or address (http://…)
    pub source: PathBuf,
    #[command(flatten)]
    pub recording: RecordingArgs,
    /// Track the anchors of this scene, with its settings, in another recording
    #[arg(long, value_name = "SCENE")]
    pub anchors: Option<PathBuf>,
    /// Track every marker that is seen, each on its own: the side of their black squares
    #[arg(long, value_name = "MM", value_parser = mm_of, allow_negative_numbers = true, conflicts_with = "anchors")]
    pub size_mm: Option<f64>,
    #[command(flatten)]
    pub family: FamilyArgs,
    /// Write the poses (CSV; - for stdout, as for every text)
    #[arg(long, value_name = "FILE")]
    pub poses: Option<PathBuf>,
    /// Write every marker that the detector reads or that tracking follows, with its corners and who saw it (CSV, or -)
    #[arg(long, value_name = "FILE")]
    pub markers: Option<PathBuf>,
    /// Write times per stage, frames and memory (JSON, or -)
    #[arg(long, value_name = "FILE")]
    pub stats: Option<PathBuf>,
    #[command(flatten)]
    pub force: ForceArgs,
}

#[derive(Args)]
pub struct BoardArgs {
    /// Scene file (.toml), session, video or folder of pictures that show the markers from all around
    #[arg(long, value_name = "SOURCE")]
    pub from: PathBuf,
    #[command(flatten)]
    pub recording: RecordingArgs,
    /// Side of the markers' black squares (of the gauge's with --sizes estimate)
    #[arg(long, value_name = "MM", value_parser = mm_of, allow_negative_numbers = true)]
    pub size_mm: f64,
    /// Whether all markers have that size, or the others' are to be learnt
    #[arg(long, value_enum, default_value = "given")]
    pub sizes: Sizes,
    /// Marker whose centre is the origin, its right the board's x; the lowest id without this
    #[arg(long, value_name = "ID")]
    pub gauge: Option<u32>,
    /// Distance measured between two markers' centres: a better scale than a marker's size
    #[arg(long, value_name = "ID:ID:MM", value_parser = distance_of)]
    pub distance: Option<Distance>,
    /// What the markers lie in
    #[arg(long, value_enum, default_value = "seen")]
    pub shape: Shape,
    /// What a marker may lie off the plane of the others
    #[arg(long, value_name = "MM", value_parser = mm_of, allow_negative_numbers = true, default_value = "2")]
    pub plane_tolerance_mm: f64,
    #[command(flatten)]
    pub family: FamilyArgs,
    /// Name of the board
    #[arg(long, value_name = "NAME", default_value = "table", value_parser = |text: &str| ANCHOR_NAME.name.of_option(text))]
    pub name: String,
    /// Write the [[board]] to a file rather than to stdout
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub force: ForceArgs,
}

#[derive(Args)]
#[command(group = clap::ArgGroup::new("pattern").required(true).args(["chessboard", "charuco"]))]
pub struct CalibrateArgs {
    /// Videos, pictures, folders of pictures or sessions that show the target from all around, by one camera at one size;
    /// or a camera (webcam:N, http://…): a window says where to hold the target
    #[arg(required = true)]
    pub source: Vec<String>,
    #[command(flatten)]
    pub target: TargetArgs,
    /// Write the calibration (TOML, or - for stdout)
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Write a picture of where the corners lie, how far they are off, and where there are none (PNG)
    #[arg(long, value_name = "FILE")]
    pub coverage: Option<PathBuf>,
    #[arg(long, help = CAMERA.mirror.says())]
    pub mirror: bool,
    /// Play a video in the window as if it were a camera
    #[arg(long)]
    pub watch: bool,
    #[command(flatten)]
    pub wanted: WantedArgs,
    /// Graphics adapter of the window, by a part of its name; the fastest kind without this
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// What a camera is calibrated with.
#[derive(Args)]
pub struct TargetArgs {
    /// A chessboard of so many inner corners, where four squares meet
    #[arg(long, value_name = "COLUMNSxROWS", value_parser = counts_of, requires = "square_mm")]
    pub chessboard: Option<[u32; 2]>,
    /// A ChArUco board of so many squares, markers in the white ones; parts of it will do
    #[arg(long, value_name = "COLUMNSxROWS", value_parser = counts_of, requires_all = ["square_mm", "marker_mm"])]
    pub charuco: Option<[u32; 2]>,
    /// Side of the target's squares
    #[arg(long, value_name = "MM", value_parser = mm_of, allow_negative_numbers = true)]
    pub square_mm: Option<f64>,
    /// Side of the black squares of a ChArUco board's markers
    #[arg(long, value_name = "MM", value_parser = mm_of, allow_negative_numbers = true, requires = "charuco", conflicts_with = "chessboard")]
    pub marker_mm: Option<f64>,
    /// Family of a ChArUco board's markers: DICT_4X4_50, DICT_6X6_250, tag36h11, …, or a dictionary's file (.yml)
    #[arg(long, value_name = "NAME", default_value = "DICT_5X5_100", value_parser = family_of, requires = "charuco", conflicts_with = "chessboard")]
    pub dictionary: Family,
}

// What belongs to another kind of sheet is refused, not passed over.
#[derive(Args)]
#[command(mut_arg("family", |arg| arg.conflicts_with_all(["chessboard", "charuco"])))]
#[command(mut_arg("border_cells", |arg| arg.conflicts_with_all(["chessboard", "charuco"])))]
#[command(mut_arg("inverted", |arg| arg.conflicts_with_all(["chessboard", "charuco"])))]
#[command(mut_arg("dictionary", |arg| arg.conflicts_with_all(["board", "cube", "ids"])))]
#[command(mut_arg("marker_mm", |arg| arg.conflicts_with_all(["board", "cube", "ids"])))]
#[command(mut_arg("square_mm", |arg| arg.conflicts_with_all(["board", "cube", "ids"])))]
#[command(group = clap::ArgGroup::new("sheet").required(true).args(["board", "cube", "ids", "chessboard", "charuco"]))]
pub struct MarkersArgs {
    /// The sheet: .pdf (true size), .svg or .png; what a scene file takes is written beside it as .toml
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// A board of so many columns and rows of markers, which are one anchor
    #[arg(long, value_name = "COLUMNSxROWS", value_parser = counts_of, requires_all = ["size_mm", "gap_mm"])]
    pub board: Option<[u32; 2]>,
    /// The faces of a cube with edges of this length, a marker on each, which are one anchor
    #[arg(long, value_name = "MM", value_parser = mm_of, allow_negative_numbers = true, requires = "size_mm")]
    pub cube: Option<f64>,
    /// Markers to be cut out, each on its own
    #[arg(long, value_name = "ID,…", value_delimiter = ',', value_parser = index_of, allow_negative_numbers = true, requires = "size_mm")]
    pub ids: Option<Vec<u32>>,
    #[command(flatten)]
    pub target: TargetArgs,
    /// Side of the markers' black squares
    #[arg(long, value_name = "MM", value_parser = mm_of, allow_negative_numbers = true, conflicts_with_all = ["chessboard", "charuco"])]
    pub size_mm: Option<f64>,
    /// White between the markers of a board
    #[arg(long, value_name = "MM", value_parser = mm_of, allow_negative_numbers = true, conflicts_with_all = ["cube", "ids", "chessboard", "charuco"])]
    pub gap_mm: Option<f64>,
    /// Id of the board's upper left marker, the others follow row by row; or of a cube's front, then right, back, left, top
    /// and bottom
    #[arg(long, value_name = "ID", default_value = "0", conflicts_with_all = ["ids", "chessboard", "charuco"])]
    pub first_id: u32,
    /// Name of the board or of the cube
    #[arg(
        long, value_name = "NAME", default_value = "table", value_parser = |text: &str| ANCHOR_NAME.name.of_option(text),
        conflicts_with_all = ["ids", "chessboard", "charuco"]
    )]
    pub name: String,
    #[command(flatten)]
    pub family: FamilyArgs,
    /// Paper to print on
    #[arg(long, value_enum, default_value = "a4")]
    pub page: PageSize,
    /// The paper lies on its side
    #[arg(long)]
    pub landscape: bool,
    /// Pixels per inch of a PNG
    #[arg(long, value_name = "DPI", default_value = "300")]
    pub dpi: f64,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// Sizes of paper.
#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
pub enum PageSize {
    /// 210 x 297 mm
    A4,
    /// 297 x 420 mm
    A3,
    /// 8.5 x 11 inches
    Letter,
}

/// What a board's markers lie in.
#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
pub enum Shape {
    /// A plane where the pictures bear that out, otherwise space: a cube, a corner of a room
    Seen,
    /// A plane; a marker off it is an error
    Flat,
    /// Space
    Space,
}

/// Where markers' sizes come from.
#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
pub enum Sizes {
    /// All are --size-mm
    Given,
    /// The gauge's is --size-mm, the others are learnt
    Estimate,
}

#[derive(Args)]
pub struct RecordArgs {
    /// Scene file (.toml), webcam (webcam:0, webcam:NAME, /dev/video0), address (http://…, rtsp://…), or recording
    pub source: PathBuf,
    #[command(flatten)]
    pub recording: RecordingArgs,
    /// The session's folder: a new one, or with --force an older session's
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// End after this many seconds of frames
    #[arg(long, value_name = "N", value_parser = seconds_of)]
    pub seconds: Option<f64>,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// A recording or a camera that no scene describes.
#[derive(Args)]
pub struct RecordingArgs {
    #[arg(long, value_name = "FILE", help = CAMERA.calibration.help())]
    pub calibration: Option<PathBuf>,
    #[arg(long, help = CAMERA.mirror.says())]
    pub mirror: bool,
    #[arg(long, value_name = "FACTOR", help = TRACKING.decimation.help(), value_parser = |text: &str| TRACKING.decimation.of_option(text))]
    pub decimation: Option<f64>,
    #[command(flatten)]
    pub wanted: WantedArgs,
}

/// What a webcam is asked for.
#[derive(Args)]
pub struct WantedArgs {
    #[arg(long, value_name = "WxH", help = CAMERA.size_px.help(), value_parser = |text: &str| CAMERA.size_px.of_option(text))]
    pub size: Option<[u32; 2]>,
    #[arg(long, value_name = "N", help = CAMERA.fps.help(), value_parser = |text: &str| CAMERA.fps.of_option(text))]
    pub fps: Option<u32>,
    #[arg(long, value_name = "NAME", help = CAMERA.format.help(), value_parser = |text: &str| CAMERA.format.of_option(text))]
    pub format: Option<PixelFormat>,
}

impl WantedArgs {
    pub fn wanted(&self) -> WantedFormat {
        WantedFormat {
            size_px: self.size,
            fps: self.fps,
            pixels: self.format,
        }
    }
}

impl RecordingArgs {
    pub fn is_given(&self) -> bool {
        self.calibration.is_some()
            || self.decimation.is_some()
            || self.mirror
            || self.wanted.wanted() != WantedFormat::default()
    }
}

#[derive(Args)]
pub struct ProbeArgs {
    /// Exposures of one view; or one picture in linear radiance (.hdr, .exr)
    #[arg(required = true)]
    pub pictures: Vec<PathBuf>,
    /// What they show
    #[arg(long, value_enum)]
    pub kind: ProbeKindArg,
    /// Exposure times in the pictures' order, or a file with a picture's name and its time a line; from EXIF without this
    #[arg(long, value_name = "S,…|FILE")]
    pub exposures: Option<String>,
    /// Outline of the ball or the map, pixels from the upper left corner; a ball is found without this
    #[arg(long, value_name = "X,Y,RADIUS", value_parser = circle_of, allow_hyphen_values = true)]
    pub crop: Option<Circle>,
    /// From the camera to the ball's middle, in radii of the ball; far away without this
    #[arg(long, value_name = "RADII", value_parser = ball_distance_of)]
    pub ball_distance: Option<f64>,
    /// Part of the light that the ball reflects: 0.6 to 0.7 for chrome
    #[arg(long, value_name = "PART", value_parser = reflectance_of, default_value = "1")]
    pub reflectance: f64,
    /// The camera was turned so far to the left from looking along the world's +y
    #[arg(long, value_name = "DEG", value_parser = |text: &str| PROBE.turn_deg.of_option(text), default_value = "0", allow_negative_numbers = true)]
    pub turn_deg: f64,
    /// It was tilted downward by so much
    #[arg(long, value_name = "DEG", value_parser = degrees_of, default_value = "0", allow_negative_numbers = true)]
    pub tilt_deg: f64,
    /// It was rolled clockwise by so much
    #[arg(long, value_name = "DEG", value_parser = degrees_of, default_value = "0", allow_negative_numbers = true)]
    pub roll_deg: f64,
    /// Move the exposures on to each other first: the camera was held by hand
    #[arg(long)]
    pub align: bool,
    /// The camera's response, as --save-response wrote it, instead of estimating it
    #[arg(long, value_name = "FILE")]
    pub response: Option<PathBuf>,
    /// Write the camera's response (CSV, or - for stdout)
    #[arg(long, value_name = "FILE")]
    pub save_response: Option<PathBuf>,
    /// Exposure at which radiance 1 is white; the middle picture's without this
    #[arg(long, value_name = "S", value_parser = exposure_of)]
    pub white_at: Option<f64>,
    /// Columns of the probe, which has half as many rows; as fine as the pictures, up to 1024, without this
    #[arg(long, value_name = "PX", value_parser = probe_width_of)]
    pub width_px: Option<usize>,
    /// The probe: .hdr (Radiance) or .exr (OpenEXR), latitude-longitude
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Write a picture of the probe with rings around its brightest lights (PNG)
    #[arg(long, value_name = "FILE")]
    pub preview: Option<PathBuf>,
    #[command(flatten)]
    pub force: ForceArgs,
}

#[derive(Clone, Copy, clap::ValueEnum)]
pub enum ProbeKindArg {
    /// A mirror ball
    Ball,
    /// Debevec's angular map
    Angular,
    /// All directions, twice as wide as high
    Panorama,
}

/// Markers that no scene describes.
#[derive(Args)]
pub struct FamilyArgs {
    /// Family of the markers: tag36h11, tagStandard41h12, DICT_4X4_50, …, or a dictionary's file (.yml)
    #[arg(long, value_name = "NAME", default_value = "tag36h11", value_parser = family_of, requires = "size_mm")]
    pub family: Family,
    #[arg(
        long, value_name = "N", default_value_t = *PRINTED.border_cells.default(), requires = "size_mm",
        help = PRINTED.border_cells.help(), hide_default_value = true,
        value_parser = |text: &str| PRINTED.border_cells.of_option(text)
    )]
    pub border_cells: u32,
    /// Markers printed white on black
    #[arg(long, requires = "size_mm")]
    pub inverted: bool,
}

impl TargetArgs {
    pub fn target(&self) -> Result<Target> {
        let metres = |length_mm: Option<f64>| length_mm.unwrap_or(f64::NAN) / 1000.0;
        let square_m = metres(self.square_mm);
        let markers = TargetMarkers {
            family: self.dictionary,
            size_m: metres(self.marker_mm),
        };
        match (self.chessboard, self.charuco) {
            (Some(corners), _) => Ok(Target::chessboard(corners, square_m)?),
            (_, Some(squares)) => Ok(Target::charuco(squares, square_m, markers)?),
            (None, None) => bail!("give --chessboard or --charuco"),
        }
    }
}

impl RecordingArgs {
    pub fn decimation(&self) -> f64 {
        self.decimation.unwrap_or(*TRACKING.decimation.default())
    }

    /// A scene says all of this itself.
    pub fn refuse_beside(&self, scene: &Path) -> Result<()> {
        if self.is_given() {
            bail!(
                "{} is a scene, which says itself which camera; --calibration, --mirror, --decimation, --size, --fps \
                 and --format go with a recording or a camera",
                scene.display()
            );
        }
        Ok(())
    }
}

impl FamilyArgs {
    pub fn family(&self) -> Result<Family> {
        let bordered = self
            .family
            .with_border(self.border_cells)
            .with_context(|| {
                format!(
                    "--border-cells {}: {} is not printed so",
                    self.border_cells, self.family
                )
            })?;
        Ok(bordered.with_ink(match self.inverted {
            true => Ink::WhiteOnBlack,
            false => Ink::BlackOnWhite,
        }))
    }
}

#[cfg(test)]
mod tests;
