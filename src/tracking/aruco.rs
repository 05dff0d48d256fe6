//! OpenCV's ArUco, in the contrib module `aruco` before OpenCV 4.7 and in `objdetect` since (`build.rs` tells which).

use glam::DVec2;
use opencv::boxed_ref::BoxedRef;
use opencv::core::{Mat, Point2f, Vector};
use opencv::prelude::*;

use super::apriltag;
use super::conventions::{corners_from_aruco, quarter_turns_between};
use super::{Detection, TrackingError};
use crate::capture::Frame;
use crate::scene::{ArucoRefinement, Codes, Dictionary, Family, TrackingSettings};

/// OpenCV's detector for some dictionaries, each with the turn of its pictures against the prints.
pub(super) struct ArucoDetector {
    dictionaries: Vec<(Family, usize, installed::DetectorDictionary)>,
    refinement: ArucoRefinement,
}

impl ArucoDetector {
    pub(super) fn new(
        settings: &TrackingSettings,
        families: &[Family],
    ) -> Result<Self, TrackingError> {
        // OpenCV has one pool of threads for the whole process.
        opencv::core::set_num_threads(settings.threads as i32)?;
        let dictionaries = families
            .iter()
            .map(|&family| {
                let codes = installed_codes(family.codes()).ok_or_else(|| {
                    TrackingError::FamilyNotAvailable {
                        family: family.name(),
                        detector: "OpenCV's ArUco",
                        allowed: Family::all_names().collect::<Vec<_>>().join(", "),
                    }
                })?;
                let bits = settings.corrected_bits.min(family.correctable_bits()) as i32;
                let dictionary = installed::DetectorDictionary::new(
                    codes,
                    family.border_cells() as i32,
                    bits,
                    settings.aruco_refinement,
                )?;
                Ok((family, quarter_turns(family, &dictionary)?, dictionary))
            })
            .collect::<Result<Vec<_>, TrackingError>>()?;
        Ok(Self {
            dictionaries,
            refinement: settings.aruco_refinement,
        })
    }

    pub(super) fn detect(
        &mut self,
        grey: &[u8],
        size_px: [u32; 2],
    ) -> Result<Vec<Detection>, TrackingError> {
        let [width, height] = size_px;
        let image = Mat::new_rows_cols_with_data(height as i32, width as i32, grey)?;
        let mut detections = Vec::new();
        for (family, quarter_turns, dictionary) in &self.dictionaries {
            let mut ids = Vector::<i32>::new();
            let mut corners = Vector::<Vector<Point2f>>::new();
            dictionary.detect(&image, &mut corners, &mut ids, &mut Vector::new())?;
            for (id, corners) in ids.iter().zip(corners.iter()) {
                let corners = corners
                    .iter()
                    .map(|corner| DVec2::new(f64::from(corner.x), f64::from(corner.y)))
                    .collect::<Vec<_>>();
                let (Ok(id), Ok(corners)) = (u32::try_from(id), <[DVec2; 4]>::try_from(corners))
                else {
                    continue;
                };
                detections.push(Detection {
                    family: *family,
                    id,
                    corners_px: corners_from_aruco(corners, *quarter_turns, self.refinement),
                    margin: 0.0,
                    corrected_bits: 0,
                });
            }
        }
        Ok(detections)
    }
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
    let border_cells = family.border_cells() as i32;
    let dictionary =
        installed::DetectorDictionary::new(codes, border_cells, 0, ArucoRefinement::None)?;
    let mut rejected = Vector::<Vector<Point2f>>::new();
    let image =
        Mat::new_rows_cols_with_data(frame.size_px[1] as i32, frame.size_px[0] as i32, &grey)?;
    dictionary.detect(
        &image,
        &mut Vector::new(),
        &mut Vector::new(),
        &mut rejected,
    )?;
    let quad = |corners: Vector<Point2f>| {
        let corners = corners.iter();
        let corners = corners.map(|corner| DVec2::new(f64::from(corner.x), f64::from(corner.y)));
        <Quad>::try_from(corners.collect::<Vec<_>>()).ok()
    };
    Ok(rejected.iter().filter_map(quad).collect())
}

/// The cells of a marker as printed, rows from the top, true for white; black border included, white rim not. AprilTag's
/// families stand as AprilTag prints them, the others as OpenCV does.
///
/// # Errors
/// A marker that the family does not have.
pub fn printed_cells(family: Family, id: u32) -> Result<Vec<bool>, TrackingError> {
    let no_such_marker = || TrackingError::NoSuchMarker {
        family: family.name(),
        id,
        count: family.id_count(),
    };
    if family.is_april_tag() {
        return apriltag::printed_cells(family, id).ok_or_else(no_such_marker);
    }
    let codes = installed_codes(family.codes())
        .filter(|_| id < family.id_count())
        .ok_or_else(no_such_marker)?;
    let border_cells = family.border_cells() as i32;
    let dictionary =
        installed::DetectorDictionary::new(codes, border_cells, 0, ArucoRefinement::None)?;
    Ok(dictionary.cells(id as i32, family.cells_across() as usize)?)
}

/// The turn of the installed dictionary against the prints; its own pictures are the prints of OpenCV's families.
fn quarter_turns(
    family: Family,
    dictionary: &installed::DetectorDictionary,
) -> Result<usize, TrackingError> {
    if !family.is_april_tag() {
        return Ok(0);
    }
    let side = family.cells_across() as usize;
    let opencv = dictionary.cells(0, side)?;
    apriltag::printed_cells(family, 0)
        .and_then(|template| quarter_turns_between(&template, &opencv, side))
        .ok_or_else(|| {
            TrackingError::Library(format!("OpenCV's {} is not AprilTag's", family.name()))
        })
}

/// Where OpenCV's dictionary comes from.
#[derive(Clone, Copy)]
enum InstalledCodes {
    /// One of its own, by a number that is the same in all its releases.
    Predefined(i32),
    /// From somebody's file.
    Own(&'static Dictionary),
}

fn installed_codes(codes: Codes) -> Option<InstalledCodes> {
    Some(InstalledCodes::Predefined(match codes {
        Codes::Own(dictionary) => return Some(InstalledCodes::Own(dictionary)),
        Codes::Tag16h5 => 17,
        Codes::Tag25h9 => 18,
        Codes::Tag36h10 => 19,
        Codes::Tag36h11 => 20,
        Codes::ArucoOriginal => 16,
        Codes::Aruco { cells, count } => {
            let of_size = [50, 100, 250, 1000]
                .iter()
                .position(|&known| known == count)?;
            i32::from(cells.checked_sub(4).filter(|&size| size < 4)?) * 4 + of_size as i32
        }
    }))
}

/// The codes of somebody's own dictionary as OpenCV keeps them, a row for each marker; `row_of` makes one from a picture
/// with a 1 for each white cell.
fn byte_list(
    dictionary: &Dictionary,
    row_of: impl Fn(&BoxedRef<'_, Mat>) -> opencv::Result<Mat>,
) -> opencv::Result<Mat> {
    let side = dictionary.cells() as i32;
    let mut rows = Vector::<Mat>::new();
    for cells in dictionary.markers() {
        let bits: Vec<u8> = cells.into_iter().map(u8::from).collect();
        rows.push(row_of(&Mat::new_rows_cols_with_data(side, side, &bits)?)?);
    }
    let mut list = Mat::default();
    opencv::core::vconcat(&rows, &mut list)?;
    Ok(list)
}

/// `cv::aruco::CornerRefineMethod`, the same numbers in all releases.
fn refinement_number(refinement: ArucoRefinement) -> i32 {
    match refinement {
        ArucoRefinement::None => 0,
        ArucoRefinement::Subpixel => 1,
        ArucoRefinement::Contour => 2,
        ArucoRefinement::AprilTag => 3,
    }
}

/// White cells of a marker's picture of one pixel a cell.
fn white_cells(picture: &Mat) -> opencv::Result<Vec<bool>> {
    Ok(picture
        .data_typed::<u8>()?
        .iter()
        .map(|&cell| cell != 0)
        .collect())
}

/// The contrib module `aruco`, OpenCV before 4.7.
#[cfg(aruco_in_contrib)]
mod installed {
    use opencv::aruco;
    use opencv::core::{Mat, Point2f, Ptr, ToInputArray, Vector};
    use opencv::prelude::*;

    use super::{InstalledCodes, byte_list, refinement_number, white_cells};
    use crate::scene::ArucoRefinement;

    pub(super) struct DetectorDictionary {
        dictionary: Ptr<aruco::Dictionary>,
        parameters: Ptr<aruco::DetectorParameters>,
    }

    impl DetectorDictionary {
        pub(super) fn new(
            codes: InstalledCodes,
            border_cells: i32,
            corrected_bits: i32,
            refinement: ArucoRefinement,
        ) -> opencv::Result<Self> {
            let mut dictionary = match codes {
                InstalledCodes::Predefined(number) => aruco::get_predefined_dictionary_i32(number)?,
                InstalledCodes::Own(own) => {
                    let list =
                        byte_list(own, |bits| aruco::Dictionary::get_byte_list_from_bits(bits))?;
                    Ptr::new(aruco::Dictionary::new(&list, own.cells() as i32, 0)?)
                }
            };
            dictionary.set_max_correction_bits(corrected_bits);
            let mut parameters = aruco::DetectorParameters::create()?;
            parameters.set_marker_border_bits(border_cells);
            parameters.set_error_correction_rate(1.0);
            parameters.set_corner_refinement_method(refinement_number(refinement));
            Ok(Self {
                dictionary,
                parameters,
            })
        }

        pub(super) fn detect(
            &self,
            image: &impl ToInputArray,
            corners: &mut Vector<Vector<Point2f>>,
            ids: &mut Vector<i32>,
            rejected: &mut Vector<Vector<Point2f>>,
        ) -> opencv::Result<()> {
            aruco::detect_markers(
                image,
                &self.dictionary,
                corners,
                ids,
                &self.parameters,
                rejected,
            )
        }

        pub(super) fn cells(&self, id: i32, side: usize) -> opencv::Result<Vec<bool>> {
            let mut picture = Mat::default();
            let border_cells = self.parameters.marker_border_bits();
            aruco::draw_marker(
                &self.dictionary,
                id,
                side as i32,
                &mut picture,
                border_cells,
            )?;
            white_cells(&picture)
        }
    }
}

/// The module `objdetect`, OpenCV from 4.7 on.
#[cfg(not(aruco_in_contrib))]
mod installed {
    use opencv::core::{Mat, Point2f, ToInputArray, Vector};
    use opencv::objdetect;
    use opencv::prelude::*;

    use super::{InstalledCodes, byte_list, refinement_number, white_cells};
    use crate::scene::ArucoRefinement;

    pub(super) struct DetectorDictionary {
        dictionary: objdetect::Dictionary,
        detector: objdetect::ArucoDetector,
    }

    impl DetectorDictionary {
        pub(super) fn new(
            codes: InstalledCodes,
            border_cells: i32,
            corrected_bits: i32,
            refinement: ArucoRefinement,
        ) -> opencv::Result<Self> {
            let mut dictionary = match codes {
                InstalledCodes::Predefined(number) => {
                    objdetect::get_predefined_dictionary_i32(number)?
                }
                InstalledCodes::Own(own) => {
                    let list = byte_list(own, |bits| {
                        objdetect::Dictionary::get_byte_list_from_bits(bits)
                    })?;
                    objdetect::Dictionary::new(&list, own.cells() as i32, 0)?
                }
            };
            dictionary.set_max_correction_bits(corrected_bits);
            let mut parameters = objdetect::DetectorParameters::default()?;
            parameters.set_marker_border_bits(border_cells);
            parameters.set_error_correction_rate(1.0);
            parameters.set_corner_refinement_method(refinement_number(refinement));
            let refine = objdetect::RefineParameters::new_def()?;
            let detector = objdetect::ArucoDetector::new(&dictionary, &parameters, refine)?;
            Ok(Self {
                dictionary,
                detector,
            })
        }

        pub(super) fn detect(
            &self,
            image: &impl ToInputArray,
            corners: &mut Vector<Vector<Point2f>>,
            ids: &mut Vector<i32>,
            rejected: &mut Vector<Vector<Point2f>>,
        ) -> opencv::Result<()> {
            self.detector.detect_markers(image, corners, ids, rejected)
        }

        pub(super) fn cells(&self, id: i32, side: usize) -> opencv::Result<Vec<bool>> {
            let mut picture = Mat::default();
            let border_cells = self
                .detector
                .get_detector_parameters()?
                .marker_border_bits();
            objdetect::generate_image_marker(
                &self.dictionary,
                id,
                side as i32,
                &mut picture,
                border_cells,
            )?;
            white_cells(&picture)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn installed_dictionary(family: Family) -> installed::DetectorDictionary {
        let codes = installed_codes(family.codes()).unwrap();
        let border_cells = family.border_cells() as i32;
        installed::DetectorDictionary::new(codes, border_cells, 0, ArucoRefinement::None).unwrap()
    }

    #[test]
    fn every_april_tag_of_opencv_is_april_tags_own_up_to_one_turn() {
        let usual = [
            Family::TAG16H5,
            Family::TAG25H9,
            Family::TAG36H10,
            Family::TAG36H11,
        ];
        let wide = usual.map(|family| family.with_border(2).unwrap());
        for family in usual.into_iter().chain(wide) {
            let dictionary = installed_dictionary(family);
            let side = family.cells_across() as usize;
            let turn = quarter_turns(family, &dictionary).unwrap();
            for id in 0..family.id_count() {
                let template = apriltag::printed_cells(family, id).unwrap();
                let opencv = dictionary.cells(id as i32, side).unwrap();
                assert_eq!(
                    quarter_turns_between(&template, &opencv, side),
                    Some(turn),
                    "{family} {id}"
                );
            }
            assert!(apriltag::printed_cells(family, family.id_count()).is_none());
        }
    }

    #[test]
    fn the_dictionaries_have_the_ids_that_they_claim() {
        for family in Family::all_names().filter_map(Family::from_name) {
            let dictionary = installed_dictionary(family);
            let side = family.cells_across() as usize;
            assert!(
                dictionary.cells(family.id_count() as i32 - 1, side).is_ok(),
                "{}",
                family.name()
            );
            assert!(
                dictionary.cells(family.id_count() as i32, side).is_err(),
                "{}",
                family.name()
            );
        }
    }
}
