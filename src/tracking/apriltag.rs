//! Debian's libapriltag, through the shim `apriltag_shim.c`.

use std::ffi::{CStr, c_char};
use std::ptr::{self, NonNull};
use std::sync::LazyLock;

use glam::DVec2;

use super::conventions::{corners_as_drawn, corners_from_apriltag};
use super::printed_marker::{Cell, PrintedMarker};
use super::{Detection, TrackingError};
use crate::scene::{Codes, Family, Ink, TrackingSettings};

/// More corrected bits cost libapriltag gigabytes of tables.
const MAX_CORRECTED_BITS: u32 = 3;

/// Grey levels that are added before the logarithm of [`between_corner_squares`]: a dark picture's noise stays small.
const LOG_OFFSET: f64 = 64.0;

/// A detector for some families; built once, used by one thread at a time.
pub(super) struct AprilTagDetector {
    /// One for each width of border, ink and drawing.
    searches: Vec<BorderSearch>,
    min_margin: f64,
    /// The picture with other levels.
    levelled: Vec<u8>,
}

/// libapriltag's detector with the families of one border.
struct BorderSearch {
    raw: NonNull<RawDetector>,
    /// In the order in which libapriltag got them.
    families: Vec<Family>,
}

// SAFETY: the shim keeps no thread-local or shared state; `&mut self` on every use keeps it to one thread at a time.
unsafe impl Send for BorderSearch {}

impl AprilTagDetector {
    pub(super) fn new(
        settings: &TrackingSettings,
        families: &[Family],
    ) -> Result<Self, TrackingError> {
        if settings.corrected_bits > MAX_CORRECTED_BITS {
            return Err(TrackingError::Setting {
                name: "corrected_bits",
                value: settings.corrected_bits.to_string(),
                allowed: "0 to 3 with libapriltag".to_owned(),
            });
        }
        let mut searches = Vec::new();
        let mut rest = families.to_vec();
        while let Some(first) = rest.first().copied() {
            let kind = |family: &Family| (family.border_cells(), family.ink(), family.drawing());
            let alike = |family: &Family| kind(family) == kind(&first);
            let (of_kind, others) = rest.into_iter().partition(alike);
            searches.push(BorderSearch::new(settings, of_kind)?);
            rest = others;
        }
        Ok(Self {
            searches,
            min_margin: settings.min_margin,
            levelled: Vec::new(),
        })
    }

    pub(super) fn detect(
        &mut self,
        grey: &[u8],
        size_px: [u32; 2],
    ) -> Result<Vec<Detection>, TrackingError> {
        let mut detections = Vec::new();
        for search in &mut self.searches {
            let picture = match search.levels() {
                Some(levels) => {
                    self.levelled.clear();
                    let levelled = grey.iter().map(|&level| levels[usize::from(level)]);
                    self.levelled.extend(levelled);
                    &self.levelled
                }
                None => grey,
            };
            detections.extend(search.detect(picture, size_px, self.min_margin)?);
        }
        Ok(detections)
    }
}

/// The levels in which tags with black squares at their corners (Kalibr's AprilGrids, the one use of wide borders) come
/// apart. libapriltag takes what is darker than the middle between a neighbourhood's extremes for black; where two
/// black corners meet, blur makes a bridge that is just that dark. In the logarithm of the levels the middle lies
/// lower. Thin white rims around other tags suffer from it.
fn between_corner_squares() -> &'static [u8; 256] {
    static LEVELS: LazyLock<[u8; 256]> = LazyLock::new(|| {
        let log = |level: f64| (1.0 + level / LOG_OFFSET).ln();
        std::array::from_fn(|level| (255.0 * log(level as f64) / log(255.0)).round() as u8)
    });
    &LEVELS
}

impl BorderSearch {
    fn new(settings: &TrackingSettings, families: Vec<Family>) -> Result<Self, TrackingError> {
        let names = families
            .iter()
            .map(|&family| {
                c_name(family.codes()).ok_or_else(|| TrackingError::FamilyNotAvailable {
                    family: family.name(),
                    detector: "libapriltag",
                    allowed: Family::all_names()
                        .filter(|name| Family::from_name(name).is_some_and(Family::is_april_tag))
                        .collect::<Vec<_>>()
                        .join(", "),
                })
            })
            .collect::<Result<Vec<_>, _>>()?;
        // SAFETY: no argument is a pointer; the settings were checked by `Detector::new`.
        let raw = unsafe {
            gnomon_apriltag_create(
                settings.decimation as f32,
                settings.blur_px as f32,
                settings.library_edges,
            )
        };
        let raw = NonNull::new(raw)
            .ok_or_else(|| TrackingError::Library("libapriltag gave no detector".into()))?;
        let search = Self { raw, families };
        for (&family, name) in search.families.iter().zip(names) {
            let bits = settings.corrected_bits.min(family.correctable_bits()) as i32;
            // SAFETY: `raw` lives, `name` ends in 0.
            let taken = unsafe {
                gnomon_apriltag_add_family(
                    search.raw.as_ptr(),
                    name.as_ptr(),
                    family.border_cells() as i32,
                    bits,
                )
            };
            if !taken {
                return Err(TrackingError::Library(format!(
                    "libapriltag did not take {family}"
                )));
            }
        }
        Ok(search)
    }

    /// The levels in which its markers are black on white and come apart; `None` for the picture's own.
    fn levels(&self) -> Option<[u8; 256]> {
        let first = self.families.first()?;
        let wide = (first.border_cells() > 1).then(between_corner_squares);
        let inverts = first.ink() == Ink::WhiteOnBlack;
        if wide.is_none() && !inverts {
            return None;
        }
        Some(std::array::from_fn(|level| {
            let level = if inverts { 255 - level } else { level };
            wide.map_or(level as u8, |wide| wide[level])
        }))
    }

    fn detect(
        &mut self,
        grey: &[u8],
        size_px: [u32; 2],
        min_margin: f64,
    ) -> Result<Vec<Detection>, TrackingError> {
        let [width, height] = size_px;
        let mut found: *const RawDetection = ptr::null();
        // SAFETY: `Detector::detect` made sure that `grey` has width × height bytes and that both fit an i32; the shim
        // does not write to them.
        let count = unsafe {
            gnomon_apriltag_detect(
                self.raw.as_ptr(),
                grey.as_ptr(),
                width as i32,
                height as i32,
                &mut found,
            )
        };
        let count = usize::try_from(count)
            .map_err(|_| TrackingError::Library("libapriltag ran out of memory".into()))?;
        let found = if count == 0 {
            &[]
        } else {
            // SAFETY: the shim keeps `count` detections there until its next call, which needs `&mut self`.
            unsafe { std::slice::from_raw_parts(found, count) }
        };
        Ok(found
            .iter()
            .filter(|raw| f64::from(raw.margin) >= min_margin)
            .filter_map(|raw| {
                let family = *self.families.get(usize::try_from(raw.family).ok()?)?;
                let [x0, y0, x1, y1, x2, y2, x3, y3] = raw.corners;
                let corners = [(x0, y0), (x1, y1), (x2, y2), (x3, y3)].map(DVec2::from);
                Some(Detection {
                    family,
                    id: u32::try_from(raw.id).ok()?,
                    corners_px: corners_as_drawn(corners_from_apriltag(corners), family.drawing()),
                    margin: f64::from(raw.margin),
                    corrected_bits: u32::try_from(raw.hamming).ok()?,
                })
            })
            .collect())
    }
}

impl Drop for BorderSearch {
    fn drop(&mut self) {
        // SAFETY: `raw` came from `gnomon_apriltag_create` and is freed once; the shim frees the detector first, then
        // its families.
        unsafe { gnomon_apriltag_destroy(self.raw.as_ptr()) };
    }
}

/// An AprilTag as libapriltag draws it, black on white; `None` for a marker that the family does not have.
pub(super) fn printed_marker(family: Family, id: u32) -> Option<PrintedMarker> {
    let mut picture = [0_u8; 256];
    // SAFETY: the name ends in 0 and the capacity is the picture's.
    let side = unsafe {
        gnomon_apriltag_picture(
            c_name(family.codes())?.as_ptr(),
            family.border_cells() as i32,
            id,
            picture.as_mut_ptr(),
            picture.len(),
        )
    };
    let side = usize::try_from(side).ok()?;
    let cells = picture[..side * side].iter().map(|cell| match cell {
        0 => Cell::Black,
        1 => Cell::White,
        _ => Cell::Open,
    });
    Some(PrintedMarker::new(family.cells_across(), cells.collect()))
}

fn c_name(codes: Codes) -> Option<&'static CStr> {
    match codes {
        Codes::Tag16h5 => Some(c"tag16h5"),
        Codes::Tag25h9 => Some(c"tag25h9"),
        Codes::Tag36h10 => Some(c"tag36h10"),
        Codes::Tag36h11 => Some(c"tag36h11"),
        Codes::Standard41h12 => Some(c"tagStandard41h12"),
        Codes::Standard52h13 => Some(c"tagStandard52h13"),
        Codes::Circle21h7 => Some(c"tagCircle21h7"),
        Codes::Circle49h12 => Some(c"tagCircle49h12"),
        Codes::Custom48h12 => Some(c"tagCustom48h12"),
        Codes::Aruco { .. } | Codes::ArucoOriginal | Codes::ArucoMip36h12 | Codes::Own(_) => None,
    }
}

#[repr(C)]
struct RawDetector {
    _opaque: [u8; 0],
}

#[repr(C)]
struct RawDetection {
    family: i32,
    id: i32,
    hamming: i32,
    margin: f32,
    corners: [f64; 8],
}

unsafe extern "C" {
    fn gnomon_apriltag_create(
        decimation: f32,
        blur_px: f32,
        refines_edges: bool,
    ) -> *mut RawDetector;
    fn gnomon_apriltag_add_family(
        detector: *mut RawDetector,
        name: *const c_char,
        border_cells: i32,
        corrected_bits: i32,
    ) -> bool;
    fn gnomon_apriltag_detect(
        detector: *mut RawDetector,
        grey: *const u8,
        width: i32,
        height: i32,
        found: *mut *const RawDetection,
    ) -> i32;
    fn gnomon_apriltag_destroy(detector: *mut RawDetector);
    fn gnomon_apriltag_picture(
        name: *const c_char,
        border_cells: i32,
        id: u32,
        cells: *mut u8,
        capacity: usize,
    ) -> i32;
}
