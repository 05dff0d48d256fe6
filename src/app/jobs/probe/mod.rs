//! Probe: exposures of a mirror ball, an angular map or a panorama in; a light probe, the camera's response and the
//! brightest lights out.

mod preview;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, anyhow, bail, ensure};

use crate::app::files::job_files::{JobFiles, Replacing};
use crate::app::files::picture_files::{
    radiance_format, write_radiance, write_rgb_png, write_text,
};
use crate::app::files::result_kind::ResultKind;
use crate::capture::ball;
use crate::capture::exposures::{Bracket, exif_exposure};
use crate::light::brightest::{BrightLight, brightest};
use crate::light::probe::Probe;
use crate::light::probe_maps::{Circle, Projection, fitting_width_px, unwrap, world_from_camera};
use crate::light::radiance_picture::RadiancePicture;
use crate::light::response::{Exposure, Response, merge};
use crate::scene::{plain_file, radiance_file};
use preview::preview;

/// Columns of a probe unless another number is asked for: a third of a degree each, finer than a ball shows.
const MOST_COLUMNS: usize = 1024;
const LIGHTS_TOLD: usize = 8;
/// Exposures farther apart leave levels that no picture shows well, stops.
const WIDEST_STEP_STOPS: f64 = 4.5;

/// The projection of the pictures that a probe is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProbePictureKind {
    /// A mirror ball.
    Ball,
    /// Debevec's angular map.
    Angular,
    /// All directions, as a panorama seen from inside, twice as wide as high.
    Panorama,
}

/// A request to make a probe.
#[derive(Debug, Clone)]
pub struct ProbeRequest {
    /// Exposures of one view; or one picture in linear radiance (.hdr, .exr).
    pub pictures: Vec<PathBuf>,
    /// Exposure times, as a list (`1/8,1/30`) or a file; from the pictures' EXIF without.
    pub exposures: Option<String>,
    /// What they show.
    pub kind: ProbePictureKind,
    /// The ball's or the map's outline; found without.
    pub crop: Option<Circle>,
    /// From the camera to the ball's middle, in radii of the ball; infinite where it was far.
    pub ball_distance_radii: f64,
    /// Part of the light that the ball reflects.
    pub ball_reflectance: f64,
    /// Degrees by which the camera was turned to the left from looking along +y, then tilted downward, then rolled
    /// clockwise.
    pub turn_tilt_roll_deg: [f64; 3],
    /// Whether to move the exposures on to each other.
    pub align: bool,
    /// The camera's response, from a file instead of from the pictures.
    pub response: Option<PathBuf>,
    /// Where to write the response (CSV).
    pub save_response: Option<PathBuf>,
    /// Exposure at which radiance 1 is white; the middle picture's without.
    pub white_at: Option<f64>,
    /// Columns of the probe.
    pub width_px: Option<usize>,
    /// Where to write the probe (.hdr, .exr).
    pub out: PathBuf,
    /// Where to write a picture of it (PNG).
    pub preview: Option<PathBuf>,
    /// What the files may take the place of.
    pub replacing: Replacing,
}

/// The lights and remarks that came of it, in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Told {
    /// The lights, a row each under a header.
    pub lights: String,
    /// What was done and what is to be known.
    pub remarks: Vec<String>,
}

/// Merges, unwraps, writes.
///
/// # Errors
/// Pictures that cannot be read or do not fit together, times that do not fit them, no ball; nothing is written then.
pub fn probe(request: &ProbeRequest) -> Result<Told> {
    check(request)?;
    let mut remarks = Vec::new();
    let source = match &request.pictures[..] {
        [path] if radiance_format(path).is_ok() => ProbeSource::read(request, path, &mut remarks)?,
        _ => ProbeSource::merged(request, &mut remarks)?,
    };
    let picture_px = source.picture.size_px();
    let projection = match (request.kind, source.circle) {
        (ProbePictureKind::Ball, Some(circle)) => Projection::Ball {
            circle,
            distance_radii: request.ball_distance_radii,
        },
        (ProbePictureKind::Angular, Some(circle)) => Projection::Angular(circle),
        _ => Projection::Panorama,
    };
    let width_px = (request.width_px)
        .unwrap_or_else(|| fitting_width_px(projection, picture_px).min(MOST_COLUMNS));
    let [turn, tilt, roll] = request.turn_tilt_roll_deg.map(f64::to_radians);
    let camera = world_from_camera(turn, tilt, roll);
    let unwrapped = unwrap(&source.picture, projection, camera, width_px)
        .ok_or_else(|| anyhow!("the picture is too small to show any direction"))?;
    if unwrapped.blind_share > 0.0 {
        remarks.push(format!(
            "{:.1} % of all directions, behind the ball, are not in its picture: filled in from around them",
            100.0 * unwrapped.blind_share
        ));
    }
    let probe = match request.kind {
        ProbePictureKind::Ball => brightened(&unwrapped.probe, 1.0 / request.ball_reflectance)?,
        _ => unwrapped.probe,
    };
    let lights = brightest(&probe, LIGHTS_TOLD);
    write_radiance(&request.out, probe.size_px(), probe.pixels())?;
    if let (Some(path), Some(response)) = (&request.save_response, &source.response) {
        write_text(path, &response.csv())?;
    }
    if let Some(path) = &request.preview {
        write_rgb_png(
            path,
            probe.size_px().map(|side| side as u32),
            &preview(&probe, &lights),
        )?;
    }
    let [width, height] = probe.size_px();
    remarks.push(format!("{}: {width} x {height}", request.out.display()));
    Ok(Told {
        lights: lights_told(&lights),
        remarks,
    })
}

/// What can be known before any picture is read.
fn check(request: &ProbeRequest) -> Result<()> {
    radiance_format(&request.out)?;
    let mut files = JobFiles::new(request.replacing);
    for read in request.pictures.iter().chain(&request.response) {
        files.reads(read);
    }
    if let Some(listed) = &request.exposures {
        // A list of times is a path to nothing.
        files.reads(Path::new(listed));
    }
    files.writes("--out", &request.out, ResultKind::Radiance);
    if let Some(path) = &request.save_response {
        files.writes("--save-response", path, ResultKind::Response);
    }
    if let Some(path) = &request.preview {
        files.writes("--preview", path, ResultKind::Png);
    }
    files.check()?;
    if let Some(preview) = &request.preview {
        ensure!(
            preview
                .extension()
                .is_some_and(|extension| extension.eq_ignore_ascii_case("png")),
            "{}: the preview is a PNG (.png)",
            preview.display()
        );
    }
    if request.kind != ProbePictureKind::Ball {
        ensure!(
            request.ball_distance_radii.is_infinite() && request.ball_reflectance == 1.0,
            "--ball-distance and --reflectance are a ball's (--kind ball)"
        );
    }
    ensure!(
        request.kind != ProbePictureKind::Panorama || request.crop.is_none(),
        "a panorama is taken whole; --crop is a ball's or an angular map's"
    );
    Ok(())
}

/// Radiance as a picture, read or merged from exposures.
struct ProbeSource {
    picture: RadiancePicture,
    circle: Option<Circle>,
    response: Option<Response>,
}

impl ProbeSource {
    /// A picture that is in radiance already.
    fn read(request: &ProbeRequest, path: &Path, remarks: &mut Vec<String>) -> Result<Self> {
        let needless = request.exposures.is_some()
            || request.response.is_some()
            || request.save_response.is_some()
            || request.white_at.is_some()
            || request.align;
        ensure!(
            !needless,
            "{} is in linear radiance already; --exposures, --response, --save-response, --white-at and --align are for \
             exposures",
            path.display()
        );
        let read = radiance_file::read(path, None).map_err(anyhow::Error::msg)?;
        let told = read.notes.into_iter();
        remarks.extend(told.map(|note| format!("{}: {note}", path.display())));
        let picture = read.picture;
        let [width, height] = picture.size_px();
        let circle = match request.kind {
            ProbePictureKind::Panorama => None,
            _ if request.crop.is_some() || width == height => {
                Some(outline(request, picture.size_px())?)
            }
            _ => bail!(
                "{}: {width} x {height} pixels; where is the outline? Give --crop X,Y,RADIUS",
                path.display()
            ),
        };
        check_shape(request, picture.size_px())?;
        Ok(Self {
            picture,
            circle,
            response: None,
        })
    }

    /// Several exposures.
    fn merged(request: &ProbeRequest, remarks: &mut Vec<String>) -> Result<Self> {
        let amounts = exposures(request)?;
        ensure!(
            request.pictures.len() > 1 || request.response.is_some(),
            "there is one exposure only; take several of one view, from one that shows the lamps' own colour to one that \
             shows the darkest corner (or give --response FILE, and what is white stays cut off)"
        );
        let response = request.response.as_deref().map(read_response).transpose()?;
        let mut bracket = Bracket::read(&request.pictures)?;
        check_shape(request, bracket.size_px)?;
        check_steps(&amounts, remarks);
        if request.align {
            let mut order: Vec<usize> = (0..amounts.len()).collect();
            order.sort_by(|&a, &b| amounts[a].total_cmp(&amounts[b]));
            let shifts: Vec<String> = bracket
                .align(order[order.len() / 2])
                .iter()
                .map(|[right, down]| format!("{right},{down}"))
                .collect();
            remarks.push(format!("moved by (right,down px): {}", shifts.join("  ")));
        }
        let circle = match request.kind {
            ProbePictureKind::Panorama => None,
            ProbePictureKind::Ball if request.crop.is_none() => {
                let found = ball::find(&bracket)?.ok_or_else(|| {
                    anyhow!("no ball was found in the pictures; give its outline, --crop X,Y,RADIUS in pixels")
                })?;
                remarks.push(format!(
                    "the ball: --crop {:.1},{:.1},{:.1}",
                    found.center_px.x, found.center_px.y, found.radius_px
                ));
                Some(found)
            }
            _ => Some(outline(request, bracket.size_px)?),
        };
        let rectangle_px = rectangle(circle, bracket.size_px);
        let response = match response {
            Some(response) => response,
            None => bracket.response(&amounts, rectangle_px)?,
        };
        let mut sorted = amounts.clone();
        sorted.sort_by(f64::total_cmp);
        let white_at = request.white_at.unwrap_or(sorted[sorted.len() / 2]);
        let exposures: Vec<Exposure> = bracket
            .pictures
            .iter()
            .zip(&amounts)
            .map(|(rgba, amount)| Exposure {
                rgba,
                amount: amount / white_at,
            })
            .collect();
        let merged = merge(&exposures, bracket.size_px, &response)
            .ok_or_else(|| anyhow!("the pictures do not fit together"))?;
        remarks.push(format!(
            "{} exposures, radiance 1 is white at an exposure of {white_at:.6}",
            amounts.len()
        ));
        let share = |flags: &[bool]| share_inside(flags, circle, bracket.size_px);
        let (saturated, black) = (share(&merged.saturated), share(&merged.black));
        if saturated > 0.0 {
            remarks.push(format!(
                "warning: {:.3} % of the picture are white even in the shortest exposure: those lights are brighter than \
                 the probe says; take a shorter one",
                100.0 * saturated
            ));
        }
        if black > 0.0 {
            remarks.push(format!(
                "{:.3} % of the picture are black even in the longest exposure",
                100.0 * black
            ));
        }
        Ok(Self {
            picture: merged.picture,
            circle,
            response: Some(response),
        })
    }
}

/// The outline that is given, or that fills the picture.
fn outline(request: &ProbeRequest, size_px: [usize; 2]) -> Result<Circle> {
    let Some(circle) = request.crop else {
        return Ok(Circle::inscribed(size_px));
    };
    let size = glam::DVec2::from(size_px.map(|side| side as f64));
    let inside = circle.center_px.cmpge(glam::DVec2::ZERO).all()
        && circle.center_px.cmple(size).all()
        && circle.radius_px <= size.max_element();
    ensure!(
        inside,
        "--crop {},{},{}: the pictures have {} x {} pixels",
        circle.center_px.x,
        circle.center_px.y,
        circle.radius_px,
        size_px[0],
        size_px[1]
    );
    Ok(circle)
}

fn check_shape(request: &ProbeRequest, [width, height]: [usize; 2]) -> Result<()> {
    let what = request.pictures[0].display();
    match request.kind {
        ProbePictureKind::Panorama => ensure!(
            width == 2 * height,
            "{what}: {width} x {height} pixels; a panorama of all directions is twice as wide as high"
        ),
        ProbePictureKind::Angular => ensure!(
            request.crop.is_some() || width == height,
            "{what}: {width} x {height} pixels; an angular map is square, or give its outline, --crop X,Y,RADIUS"
        ),
        ProbePictureKind::Ball => {}
    }
    Ok(())
}

/// Left, top, width and height of a circle's square, inside the picture.
fn rectangle(circle: Option<Circle>, [width, height]: [usize; 2]) -> [usize; 4] {
    let Some(circle) = circle else {
        return [0, 0, width, height];
    };
    // The square in the circle: the corners of the one around it show the surroundings.
    let half = circle.radius_px * std::f64::consts::FRAC_1_SQRT_2;
    let low = |center: f64| (center - half).max(0.0) as usize;
    let high = |center: f64, side: usize| ((center + half).max(0.0) as usize).min(side);
    let (left, top) = (low(circle.center_px.x), low(circle.center_px.y));
    let right = high(circle.center_px.x, width);
    let bottom = high(circle.center_px.y, height);
    [
        left,
        top,
        right.saturating_sub(left),
        bottom.saturating_sub(top),
    ]
}

fn share_inside(flags: &[bool], circle: Option<Circle>, [width, _]: [usize; 2]) -> f64 {
    let (mut inside, mut flagged) = (0, 0);
    for (index, flag) in flags.iter().enumerate() {
        let center_px =
            glam::DVec2::new((index % width) as f64 + 0.5, (index / width) as f64 + 0.5);
        if circle.is_none_or(|circle| center_px.distance(circle.center_px) <= circle.radius_px) {
            inside += 1;
            flagged += usize::from(*flag);
        }
    }
    f64::from(flagged as u32) / f64::from(inside.max(1) as u32)
}

fn brightened(probe: &Probe, factor: f64) -> Result<Probe> {
    let pixels = probe
        .pixels()
        .iter()
        .map(|pixel| *pixel * factor as f32)
        .collect();
    Probe::new(probe.size_px(), pixels).context("the probe has no pixels")
}

fn read_response(path: &Path) -> Result<Response> {
    let text = plain_file::read_text(path)
        .with_context(|| format!("cannot read the response {}", path.display()))?;
    Response::from_csv(&text)
        .map_err(|(line, message)| anyhow!("{}:{line}: {message}", path.display()))
}

/// One for each picture, in seconds (or what EXIF makes of time, sensitivity and aperture).
fn exposures(request: &ProbeRequest) -> Result<Vec<f64>> {
    let pictures = &request.pictures;
    let Some(given) = &request.exposures else {
        return pictures
            .iter()
            .map(|path| {
                exif_exposure(path).ok_or_else(|| {
                    if path.exists() {
                        anyhow!(
                            "{}: no exposure time in its EXIF; give --exposures, as 1/8,1/30,1/125",
                            path.display()
                        )
                    } else {
                        anyhow!("{}: no such file", path.display())
                    }
                })
            })
            .collect();
    };
    let times: Result<Vec<f64>, String> = given.split(',').map(exposure_of).collect();
    let times = match times {
        Ok(times) => times,
        Err(_) if Path::new(given).is_file() => {
            return exposures_of_file(Path::new(given), pictures);
        }
        Err(message) => {
            bail!("--exposures {given}: {message}; or the name of a file that lists them")
        }
    };
    ensure!(
        times.len() == pictures.len(),
        "--exposures has {} times, but there are {} pictures: one for each, in their order",
        times.len(),
        pictures.len()
    );
    Ok(times)
}

/// Lines of a picture's name and its time.
fn exposures_of_file(path: &Path, pictures: &[PathBuf]) -> Result<Vec<f64>> {
    let text =
        plain_file::read_text(path).with_context(|| format!("cannot read {}", path.display()))?;
    let mut times = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        let time = line.rsplit_once(|sign: char| sign.is_whitespace() || sign == ',');
        let (name, time) = time.ok_or_else(|| {
            anyhow!(
                "{}:{}: a picture's name and its exposure time are expected",
                path.display(),
                index + 1
            )
        })?;
        let time = exposure_of(time)
            .map_err(|message| anyhow!("{}:{}: {time}: {message}", path.display(), index + 1))?;
        times.push((name.trim().trim_end_matches(',').trim().to_owned(), time));
    }
    pictures
        .iter()
        .map(|picture| {
            let name = picture.file_name().unwrap_or_default().to_string_lossy();
            let found = times.iter().find(|(known, _)| *known == name);
            found
                .map(|(_, time)| *time)
                .ok_or_else(|| anyhow!("{}: no exposure time for {name}", path.display()))
        })
        .collect()
}

/// Reads an exposure time: `1/30`, `0.5`, `2s`.
///
/// # Errors
/// What is expected.
pub fn exposure_of(written: &str) -> Result<f64, String> {
    let trimmed = written.trim();
    let trimmed = trimmed.strip_suffix(['s', '"']).unwrap_or(trimmed);
    let number = |text: &str| text.trim().parse::<f64>().ok();
    let seconds = match trimmed.split_once('/') {
        Some((above, below)) => number(above)
            .zip(number(below))
            .map(|(above, below)| above / below),
        None => number(trimmed),
    };
    seconds
        .filter(|seconds| seconds.is_finite() && *seconds > 0.0)
        .ok_or_else(|| format!("{written:?} is no exposure time; write seconds, as 1/30 or 0.5"))
}

fn check_steps(amounts: &[f64], remarks: &mut Vec<String>) {
    let mut sorted = amounts.to_vec();
    sorted.sort_by(f64::total_cmp);
    let widest = sorted
        .windows(2)
        .map(|pair| (pair[1] / pair[0]).log2())
        .fold(0.0, f64::max);
    if widest > WIDEST_STEP_STOPS {
        remarks.push(format!(
            "warning: two exposures are {widest:.1} stops apart; what lies between is coarse (two to three are good)"
        ));
    }
}

/// Azimuth counts from +x toward +y, elevation from the horizon.
fn lights_told(lights: &[BrightLight]) -> String {
    if lights.is_empty() {
        return "no light stands out: light comes evenly from all around\n".to_owned();
    }
    let mut text =
        "azimuth_deg  elevation_deg  width_deg  colour (linear RGB)  of_all_light  of_upward_irradiance\n".to_owned();
    for light in lights {
        let azimuth = light.direction.y.atan2(light.direction.x).to_degrees();
        let elevation = light.direction.z.clamp(-1.0, 1.0).asin().to_degrees();
        let width = 2.0
            * (1.0 - light.solid_angle_sr / std::f64::consts::TAU)
                .clamp(-1.0, 1.0)
                .acos()
                .to_degrees();
        let color = light.irradiance / light.irradiance.max_element().max(1e-30);
        let _ = writeln!(
            text,
            "{azimuth:11.1}  {elevation:13.1}  {width:9.1}  {:5.2} {:5.2} {:5.2}    {:10.1} %  {:18.1} %",
            color.x,
            color.y,
            color.z,
            100.0 * light.share,
            100.0 * light.horizontal_share
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn exposure_times_as_cameras_write_them() {
        assert_eq!(exposure_of("1/8"), Ok(0.125));
        assert_eq!(exposure_of(" 2\""), Ok(2.0));
        assert_eq!(exposure_of("0.5s"), Ok(0.5));
        for wrong in ["", "1/0", "-1", "0", "one", "1/2/3", "inf"] {
            assert!(exposure_of(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn times_of_a_file_are_found_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let list = folder.path().join("times.txt");
        fs::write(&list, "# made by hand\nb.png 1/30\na b.png, 0.5\n\n").unwrap();
        let pictures = ["x/a b.png", "b.png"].map(PathBuf::from);
        assert_eq!(
            exposures_of_file(&list, &pictures).unwrap(),
            [0.5, 1.0 / 30.0]
        );
        let missing = exposures_of_file(&list, &[PathBuf::from("c.png")]).unwrap_err();
        assert!(missing.to_string().contains("no exposure time for c.png"));
        fs::write(&list, "b.png 1/30\nc.png soon\n").unwrap();
        let broken = exposures_of_file(&list, &pictures).unwrap_err();
        assert!(broken.to_string().contains("times.txt:2: soon"), "{broken}");
    }
}
