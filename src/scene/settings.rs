//! Reads `[camera]`, `[tracking]` and `[shadows]`.

use super::error::SceneError;
use super::named_files::FileKind;
use super::reader::{Numbers, Table, Value};
use super::{
    ArucoRefinement, CameraSettings, Counting, DetectorKind, Difference, PixelFormat, ProbeScene,
    Quality, Search, ShadowSettings, ShaftSettings, Technique, TrackingSettings, WantedFormat,
};
use crate::geometry::outline_scale::LARGEST_MOVE_PX;

pub fn camera(root: &Table) -> Result<CameraSettings, SceneError> {
    let what = "a scene needs [camera] with a source";
    let camera = root.required("camera", what)?.table(&[
        "source",
        "calibration",
        "mirror",
        "size_px",
        "fps",
        "format",
    ])?;
    let what = "a session, a video, a folder of images, \"webcam:0\" or an address is expected";
    Ok(CameraSettings {
        source: source(&camera.required("source", what)?)?,
        calibration: camera
            .optional("calibration")
            .map(|path| path.existing_path(FileKind::Calibration))
            .transpose()?,
        mirror: camera.flag_or("mirror", false)?,
        wanted: wanted_format(&camera)?,
    })
}

fn wanted_format(camera: &Table) -> Result<WantedFormat, SceneError> {
    let side = Numbers::between(1.0, 32768.0, "px");
    let size_px = |value: Value| {
        let sides: [f64; 2] = value.numbers(&side)?;
        if sides.iter().any(|side| side.fract() != 0.0) {
            return Err(value.error("two whole numbers are expected: [width, height]"));
        }
        Ok(sides.map(|side| side as u32))
    };
    Ok(WantedFormat {
        size_px: camera.optional("size_px").map(size_px).transpose()?,
        fps: camera
            .optional("fps")
            .map(|value| value.integer(1..=1000))
            .transpose()?,
        pixels: camera
            .optional("format")
            .map(|value| value.one_of("format", &PixelFormat::BY_NAME))
            .transpose()?,
    })
}

fn source(value: &Value) -> Result<String, SceneError> {
    let written = value.text()?;
    if let Some(camera) = written.strip_prefix("webcam:") {
        if camera.trim().is_empty() {
            return Err(value.error(
                "which webcam? allowed: webcam:0, webcam:1, …, or webcam: and a part of its name (gnomon cameras lists \
                 them)",
            ));
        }
        return Ok(written.to_owned());
    }
    if ["http://", "https://", "rtsp://", "/dev/video"]
        .iter()
        .any(|scheme| written.starts_with(scheme))
    {
        return Ok(written.to_owned());
    }
    let path = value.existing_path(FileKind::Recording)?;
    path.into_os_string()
        .into_string()
        .map_err(|_| value.error("the path to it is not UTF-8 text"))
}

pub fn tracking(root: &Table) -> Result<TrackingSettings, SceneError> {
    const KEYS: [&str; 12] = [
        "detector",
        "decimation",
        "blur_px",
        "refine_edges",
        "library_edges",
        "aruco_refinement",
        "corrected_bits",
        "min_margin",
        "threads",
        "search",
        "pose_from_pixels",
        "filter",
    ];
    const SEARCHES: [(&str, Search); 2] = [("near", Search::Near), ("full", Search::Full)];
    const DETECTORS: [(&str, DetectorKind); 2] = [
        ("apriltag", DetectorKind::AprilTag),
        ("aruco", DetectorKind::Aruco),
    ];
    const REFINEMENTS: [(&str, ArucoRefinement); 4] = [
        ("none", ArucoRefinement::None),
        ("subpixel", ArucoRefinement::Subpixel),
        ("contour", ArucoRefinement::Contour),
        ("apriltag", ArucoRefinement::AprilTag),
    ];
    let default = TrackingSettings::default();
    let Some(tracking) = root.table("tracking", &KEYS)? else {
        return Ok(default);
    };
    let detector = tracking
        .optional("detector")
        .map(|value| value.one_of("detector", &DETECTORS));
    let refinement = tracking
        .optional("aruco_refinement")
        .map(|value| value.one_of("refinement", &REFINEMENTS));
    let search = tracking
        .optional("search")
        .map(|value| value.one_of("search", &SEARCHES));
    Ok(TrackingSettings {
        detector: detector.transpose()?.unwrap_or(default.detector),
        decimation: tracking.number_or(
            "decimation",
            default.decimation,
            &Numbers::between(1.0, 8.0, ""),
        )?,
        blur_px: tracking.number_or(
            "blur_px",
            default.blur_px,
            &Numbers::between(0.0, 10.0, "px"),
        )?,
        refine_edges: tracking.flag_or("refine_edges", default.refine_edges)?,
        library_edges: tracking.flag_or("library_edges", default.library_edges)?,
        aruco_refinement: refinement.transpose()?.unwrap_or(default.aruco_refinement),
        corrected_bits: tracking.integer_or("corrected_bits", default.corrected_bits, 0..=3)?,
        min_margin: tracking.number_or(
            "min_margin",
            default.min_margin,
            &Numbers::between(0.0, 255.0, ""),
        )?,
        threads: tracking.integer_or("threads", default.threads, 1..=64)?,
        search: search.transpose()?.unwrap_or(default.search),
        pose_from_pixels: tracking.flag_or("pose_from_pixels", default.pose_from_pixels)?,
        filter: tracking.flag_or("filter", default.filter)?,
    })
}

pub fn shadows(root: &Table, probe: Option<&ProbeScene>) -> Result<ShadowSettings, SceneError> {
    const KEYS: [&str; 14] = [
        "quality",
        "technique",
        "sources",
        "patches",
        "source_power",
        "receivers_per_leaf",
        "least_part",
        "map_px",
        "difference",
        "compositing",
        "samples",
        "counting",
        "max_silhouette_error_px",
        "frame_budget_ms",
    ];
    let Some(shadows) = root.table("shadows", &KEYS)? else {
        return Ok(ShadowSettings::default());
    };
    let quality = |value: Value| value.one_of("quality", &Quality::BY_NAME);
    let default = shadows
        .optional("quality")
        .map(quality)
        .transpose()?
        .map_or_else(ShadowSettings::default, Quality::shadows);
    let technique = |value: Value| match (value.text()?, probe) {
        ("environment", _) => {
            Err(value.error("this version does not render it; allowed: auto, volumes, shafts"))
        }
        ("shafts", None) => Err(value.error(
            "the scene has no [probe], which shafts take their light from; allowed: auto, volumes",
        )),
        _ => value.one_of("technique", &Technique::BY_NAME),
    };
    let samples = |value: Value| match value.integer(1..=4)? {
        samples @ (1 | 4) => Ok(samples),
        _ => Err(value.error("not a number of samples; allowed: 1, 4")),
    };
    let counting = |value: Value| value.one_of("way of counting", &Counting::BY_NAME);
    let budget = |value: Value| value.number(&Numbers::above(0.0, 1e6, "ms"));
    Ok(ShadowSettings {
        quality: default.quality,
        technique: shadows
            .optional("technique")
            .map(technique)
            .transpose()?
            .unwrap_or(default.technique),
        samples: shadows
            .optional("samples")
            .map(samples)
            .transpose()?
            .unwrap_or(default.samples),
        counting: shadows
            .optional("counting")
            .map(counting)
            .transpose()?
            .unwrap_or(default.counting),
        max_silhouette_error_px: shadows.number_or(
            "max_silhouette_error_px",
            default.max_silhouette_error_px,
            &Numbers::between(0.0, LARGEST_MOVE_PX, "px"),
        )?,
        frame_budget_ms: shadows
            .optional("frame_budget_ms")
            .map(budget)
            .transpose()?,
        shafts: shaft_settings(&shadows, default.shafts)?,
        without: default.without,
    })
}

fn shaft_settings(shadows: &Table, default: ShaftSettings) -> Result<ShaftSettings, SceneError> {
    let sources = |value: Value| match value.text() {
        Ok("all") => Ok(None),
        Ok(_) => Err(value.error("not a number of sources; allowed: 1 to 4096, or \"all\"")),
        Err(_) => value.integer(1..=4096).map(Some),
    };
    let map_px = |value: Value| match value.integer(16..=1024)? {
        side if side.is_power_of_two() => Ok(side),
        _ => Err(value.error("not a side of maps; allowed: 16, 32, 64, 128, 256, 512, 1024")),
    };
    Ok(ShaftSettings {
        sources: shadows
            .optional("sources")
            .map(sources)
            .transpose()?
            .unwrap_or(default.sources),
        patches: shadows.integer_or("patches", default.patches, 100..=20_000)?,
        source_power: shadows.number_or(
            "source_power",
            default.source_power,
            &Numbers::above(0.0, 1.0, ""),
        )?,
        receivers_per_leaf: shadows.integer_or(
            "receivers_per_leaf",
            default.receivers_per_leaf,
            1..=1000,
        )?,
        least_part: shadows.number_or(
            "least_part",
            default.least_part,
            &Numbers::between(0.0, 1.0, ""),
        )?,
        map_px: shadows
            .optional("map_px")
            .map(map_px)
            .transpose()?
            .unwrap_or(default.map_px),
        difference: difference(shadows)?.unwrap_or(default.difference),
    })
}

/// `compositing` decides in which light, `difference` how within the linear one.
fn difference(shadows: &Table) -> Result<Option<Difference>, SceneError> {
    const COMPOSITING: [(&str, bool); 2] = [("float", false), ("ldr", true)];
    let named = shadows
        .optional("difference")
        .map(|value| value.one_of("way to take light away", &Difference::BY_NAME))
        .transpose()?;
    let Some(compositing) = shadows.optional("compositing") else {
        return Ok(named);
    };
    let in_levels = compositing.one_of("way to composite", &COMPOSITING)?;
    match (in_levels, named) {
        (true, Some(_)) => Err(compositing.error(
            "difference is of float compositing; ldr always takes encoded levels away: leave one of the two out",
        )),
        (true, None) => Ok(Some(Difference::Encoded)),
        (false, named) => Ok(named.or(Some(Difference::Ratio))),
    }
}
