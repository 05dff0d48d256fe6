//! OpenCV's ArUco, and what of its failures one candidate is to blame for.

use glam::DVec2;
use opencv::core::{Mat, Point2f, Vector};

use super::aruco_dictionary::{DetectorDictionary, installed_codes, quarter_turns};
use super::conventions::{corners_as_drawn, corners_from_aruco};
use super::light::Grey;
use super::reading::border_ends;
use super::{Detection, TrackingError};
use crate::capture::Frame;
use crate::scene::{ArucoRefinement, Family, Ink, TrackingSettings};

/// OpenCV's detector for some dictionaries.
pub(super) struct ArucoDetector {
    searches: Vec<DictionarySearch>,
    /// The picture's negative.
    inverted: Vec<u8>,
}

/// A search for the markers of one dictionary.
struct DictionarySearch {
    family: Family,
    /// The turn of the dictionary's pictures against the prints.
    quarter_turns: usize,
    refinement: ArucoRefinement,
    refining: DetectorDictionary,
    /// The same without a refinement of corners, for pictures in which that fails.
    plain: DetectorDictionary,
}

/// A marker as OpenCV found it, and how its corners were refined.
struct Found {
    id: i32,
    corners_px: Quad,
    refinement: ArucoRefinement,
}

/// Around a marker whose corners are refined alone so much of its size is looked at.
const CROP_MARGIN: f64 = 0.5;
/// A picture in which OpenCV fails is taken in parts; one of fewer pixels a side is left out.
const SMALLEST_PART_PX: u32 = 64;

impl ArucoDetector {
    pub(super) fn new(
        settings: &TrackingSettings,
        families: &[Family],
    ) -> Result<Self, TrackingError> {
        // OpenCV has one pool of threads for the whole process.
        opencv::core::set_num_threads(settings.threads as i32)?;
        let searches = families
            .iter()
            .map(|&family| DictionarySearch::new(settings, family));
        Ok(Self {
            searches: searches.collect::<Result<_, _>>()?,
            inverted: Vec::new(),
        })
    }

    pub(super) fn detect(
        &mut self,
        grey: &[u8],
        size_px: [u32; 2],
    ) -> Result<Vec<Detection>, TrackingError> {
        let is_inverted = |search: &DictionarySearch| search.family.ink() == Ink::WhiteOnBlack;
        if self.searches.iter().any(is_inverted) {
            self.inverted.clear();
            self.inverted.extend(grey.iter().map(|level| 255 - level));
        }
        let mut detections = Vec::new();
        let picture = Grey {
            levels: grey,
            size_px,
        };
        for search in &self.searches {
            // Black on white, for what is of the other ink is found as well.
            let levels = match is_inverted(search) {
                true => &self.inverted,
                false => grey,
            };
            let as_black = Grey { levels, size_px };
            for found in search.found_in(picture) {
                if !border_ends(as_black, search.family.cells_across(), found.corners_px) {
                    continue;
                }
                let corners = corners_from_aruco(
                    found.corners_px,
                    search.quarter_turns,
                    found.refinement,
                    search.family.ink(),
                );
                let Ok(id) = u32::try_from(found.id) else {
                    continue;
                };
                detections.push(Detection {
                    family: search.family,
                    id,
                    corners_px: corners_as_drawn(corners, search.family.drawing()),
                    margin: 0.0,
                    corrected_bits: 0,
                });
            }
        }
        Ok(detections)
    }
}

impl DictionarySearch {
    fn new(settings: &TrackingSettings, family: Family) -> Result<Self, TrackingError> {
        let codes =
            installed_codes(family.codes()).ok_or_else(|| TrackingError::FamilyNotAvailable {
                family: family.name(),
                detector: "OpenCV's ArUco",
                allowed: Family::all_names()
                    .filter(|name| Family::from_name(name).is_some_and(|known| !known.has_ring()))
                    .collect::<Vec<_>>()
                    .join(", "),
            })?;
        let bits = settings.corrected_bits.min(family.correctable_bits()) as i32;
        let dictionary = |refinement| DetectorDictionary::new(codes, family, bits, refinement);
        // OpenCV's refinement takes the outer edge of the black ring about a far one for its own.
        let refinement = match family.ink() {
            Ink::BlackOnWhite => settings.aruco_refinement,
            Ink::WhiteOnBlack => ArucoRefinement::None,
        };
        let refining = dictionary(refinement)?;
        Ok(Self {
            family,
            refinement,
            quarter_turns: quarter_turns(family, &refining)?,
            refining,
            plain: dictionary(ArucoRefinement::None)?,
        })
    }

    /// The markers of a picture. OpenCV gives up a whole picture when one candidate in it is not to its taste; that
    /// candidate alone is left out.
    fn found_in(&self, picture: Grey<'_>) -> Vec<Found> {
        let refinement = self.refinement;
        if let Ok(found) = found(&self.refining, picture, refinement) {
            return found;
        }
        let refined = |plain: Found| {
            let (part, corner_px) = around(picture, &plain.corners_px);
            let size_px = part.size_px;
            let picture = Grey {
                levels: &part.levels,
                size_px,
            };
            // One that fails alone is the candidate.
            let again = found(&self.refining, picture, refinement).ok()?;
            let again = again.into_iter().find(|again| again.id == plain.id);
            Some(again.map_or(plain, |again| again.shifted(corner_px)))
        };
        let plain = self.plain_in(picture);
        plain.into_iter().filter_map(refined).collect()
    }

    fn plain_in(&self, picture: Grey<'_>) -> Vec<Found> {
        if let Ok(found) = found(&self.plain, picture, ArucoRefinement::None) {
            return found;
        }
        let [width, height] = picture.size_px;
        if width.max(height) <= SMALLEST_PART_PX {
            return Vec::new();
        }
        // Parts of two thirds overlap, so that most markers are whole in one of them.
        let mut all: Vec<Found> = Vec::new();
        let part_px = [width, height].map(|px| (2 * px).div_ceil(3));
        let starts_px = [width - part_px[0], height - part_px[1]];
        for [x, y] in [[0, 0], [1, 0], [0, 1], [1, 1]] {
            let from_px = [x * starts_px[0], y * starts_px[1]];
            let part = cut(picture, from_px, part_px);
            let part = Grey {
                levels: &part.levels,
                size_px: part_px,
            };
            let corner_px = DVec2::from(from_px.map(f64::from));
            for found in self.plain_in(part) {
                let found = found.shifted(corner_px);
                if !all.iter().any(|known| known.is_same(&found)) {
                    all.push(found);
                }
            }
        }
        all
    }
}

impl Found {
    fn shifted(mut self, by_px: DVec2) -> Self {
        self.corners_px = self.corners_px.map(|corner| corner + by_px);
        self
    }

    fn is_same(&self, other: &Self) -> bool {
        const SAME_PX: f64 = 5.0;
        let mut corners = self.corners_px.iter().zip(&other.corners_px);
        self.id == other.id && corners.all(|(a, b)| a.distance(*b) < SAME_PX)
    }
}

/// A part of a picture.
struct Part {
    levels: Vec<u8>,
    size_px: [u32; 2],
}

/// The part of a picture around a marker, and its upper left corner.
fn around(picture: Grey<'_>, corners_px: &Quad) -> (Part, DVec2) {
    let low = corners_px.iter().copied().fold(DVec2::MAX, DVec2::min);
    let high = corners_px.iter().copied().fold(DVec2::MIN, DVec2::max);
    let margin = CROP_MARGIN * (high - low).max_element() + 4.0;
    let most = DVec2::from(picture.size_px.map(f64::from));
    let from = (low - margin).floor().clamp(DVec2::ZERO, most - 1.0);
    let to = (high + margin).ceil().clamp(from + 1.0, most);
    let size_px = [(to.x - from.x) as u32, (to.y - from.y) as u32];
    (cut(picture, [from.x as u32, from.y as u32], size_px), from)
}

fn cut(picture: Grey<'_>, [left, top]: [u32; 2], size_px: [u32; 2]) -> Part {
    let width = picture.size_px[0] as usize;
    let rows = picture.levels.chunks_exact(width);
    let rows = rows.skip(top as usize).take(size_px[1] as usize);
    let columns = left as usize..(left + size_px[0]) as usize;
    Part {
        levels: rows
            .flat_map(|row| &row[columns.clone()])
            .copied()
            .collect(),
        size_px,
    }
}

fn found(
    dictionary: &DetectorDictionary,
    picture: Grey<'_>,
    refinement: ArucoRefinement,
) -> opencv::Result<Vec<Found>> {
    let [width, height] = picture.size_px.map(|px| px as i32);
    let image = Mat::new_rows_cols_with_data(height, width, picture.levels)?;
    let mut ids = Vector::<i32>::new();
    let mut corners = Vector::<Vector<Point2f>>::new();
    dictionary.detect(&image, &mut corners, &mut ids, &mut Vector::new())?;
    let found = ids.iter().zip(corners.iter()).filter_map(|(id, corners)| {
        Some(Found {
            id,
            corners_px: quad(corners)?,
            refinement,
        })
    });
    Ok(found.collect())
}

fn quad(corners: Vector<Point2f>) -> Option<Quad> {
    let corners = corners.iter();
    let corners = corners.map(|corner| DVec2::new(f64::from(corner.x), f64::from(corner.y)));
    <Quad>::try_from(corners.collect::<Vec<_>>()).ok()
}

/// Corners of a quadrilateral in a picture, pixels.
pub type Quad = [DVec2; 4];

/// Quadrilaterals in a picture that could be markers and are none of `family`: what a detector of OpenCV's throws away.
pub fn rejected_quads(frame: &Frame, family: Family) -> Result<Vec<Quad>, TrackingError> {
    let Some(codes) = installed_codes(family.codes()) else {
        return Ok(Vec::new());
    };
    let mut grey = Vec::new();
    super::grey_from_rgba(frame, &mut grey)?;
    let dictionary = DetectorDictionary::new(codes, family, 0, ArucoRefinement::None)?;
    let mut rejected = Vector::<Vector<Point2f>>::new();
    let image =
        Mat::new_rows_cols_with_data(frame.size_px[1] as i32, frame.size_px[0] as i32, &grey)?;
    let looked = dictionary.detect(
        &image,
        &mut Vector::new(),
        &mut Vector::new(),
        &mut rejected,
    );
    // They are shown to help; a picture that OpenCV gives up shows none.
    Ok(match looked {
        Ok(()) => rejected.iter().filter_map(quad).collect(),
        Err(_) => Vec::new(),
    })
}
