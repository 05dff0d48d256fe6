//! OpenCV's dictionaries of markers as the installed release has them, in the contrib module `aruco` before OpenCV 4.7 and
//! in `objdetect` since (`build.rs` tells which).

use opencv::boxed_ref::BoxedRef;
use opencv::core::{Mat, Vector};
use opencv::prelude::*;

use super::TrackingError;
use super::apriltag;
use super::conventions::quarter_turns_between;
use super::printed_marker::{Cell, PrintedMarker};
use crate::scene::{ArucoRefinement, Codes, Dictionary, Family, Ink};

pub(super) use installed::DetectorDictionary;

/// A marker as OpenCV draws it, black on white; `None` for one that the family does not have.
pub(super) fn installed_marker(
    family: Family,
    id: u32,
) -> Result<Option<PrintedMarker>, TrackingError> {
    let Some(codes) = installed_codes(family.codes()).filter(|_| id < family.id_count()) else {
        return Ok(None);
    };
    let dictionary = DetectorDictionary::new(codes, family, 0, ArucoRefinement::None)?;
    let side = family.cells_across();
    let white = dictionary.cells(id as i32, side as usize)?;
    let cells = white.into_iter().map(|white| match white {
        true => Cell::White,
        false => Cell::Black,
    });
    Ok(Some(PrintedMarker::new(side, cells.collect())))
}

/// The turn of the installed dictionary against the prints; its own pictures are the prints of OpenCV's families.
pub(super) fn quarter_turns(
    family: Family,
    dictionary: &DetectorDictionary,
) -> Result<usize, TrackingError> {
    if !family.is_april_tag() {
        return Ok(0);
    }
    let side = family.cells_across() as usize;
    let opencv = dictionary.cells(0, side)?;
    apriltag::printed_marker(family, 0)
        .and_then(|template| quarter_turns_between(&template.square(), &opencv, side))
        .ok_or_else(|| {
            TrackingError::Library(format!("OpenCV's {} is not AprilTag's", family.name()))
        })
}

/// Where OpenCV's dictionary comes from.
#[derive(Clone, Copy)]
pub(super) enum InstalledCodes {
    /// One of its own, by a number that is the same in all its releases.
    Predefined(i32),
    /// From somebody's file.
    Own(&'static Dictionary),
}

pub(super) fn installed_codes(codes: Codes) -> Option<InstalledCodes> {
    Some(InstalledCodes::Predefined(match codes {
        Codes::Own(dictionary) => return Some(InstalledCodes::Own(dictionary)),
        Codes::Tag16h5 => 17,
        Codes::Tag25h9 => 18,
        Codes::Tag36h10 => 19,
        Codes::Tag36h11 => 20,
        Codes::ArucoOriginal => 16,
        Codes::ArucoMip36h12 => return Some(InstalledCodes::Own(Dictionary::mip_36h12())),
        Codes::Standard41h12
        | Codes::Standard52h13
        | Codes::Circle21h7
        | Codes::Circle49h12
        | Codes::Custom48h12 => return None,
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

/// Whether OpenCV looks for markers of both inks. Around a printed one in white on black lies a black ring, and of two outlines
/// that near it drops the inner one, but in a search for both inks. Which ink one has is then told by its border's end.
fn is_inverted(family: Family) -> bool {
    family.ink() == Ink::WhiteOnBlack
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

    use super::{InstalledCodes, byte_list, is_inverted, refinement_number, white_cells};
    use crate::scene::{ArucoRefinement, Family};

    pub(in crate::tracking) struct DetectorDictionary {
        dictionary: Ptr<aruco::Dictionary>,
        parameters: Ptr<aruco::DetectorParameters>,
    }

    impl DetectorDictionary {
        pub(in crate::tracking) fn new(
            codes: InstalledCodes,
            family: Family,
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
            parameters.set_marker_border_bits(family.border_cells() as i32);
            parameters.set_detect_inverted_marker(is_inverted(family));
            parameters.set_error_correction_rate(1.0);
            parameters.set_corner_refinement_method(refinement_number(refinement));
            Ok(Self {
                dictionary,
                parameters,
            })
        }

        pub(in crate::tracking) fn detect(
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

        pub(in crate::tracking) fn cells(&self, id: i32, side: usize) -> opencv::Result<Vec<bool>> {
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

    use super::{InstalledCodes, byte_list, is_inverted, refinement_number, white_cells};
    use crate::scene::{ArucoRefinement, Family};

    pub(in crate::tracking) struct DetectorDictionary {
        dictionary: objdetect::Dictionary,
        detector: objdetect::ArucoDetector,
    }

    impl DetectorDictionary {
        pub(in crate::tracking) fn new(
            codes: InstalledCodes,
            family: Family,
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
            parameters.set_marker_border_bits(family.border_cells() as i32);
            parameters.set_detect_inverted_marker(is_inverted(family));
            parameters.set_error_correction_rate(1.0);
            parameters.set_corner_refinement_method(refinement_number(refinement));
            let refine = objdetect::RefineParameters::new_def()?;
            let detector = objdetect::ArucoDetector::new(&dictionary, &parameters, refine)?;
            Ok(Self {
                dictionary,
                detector,
            })
        }

        pub(in crate::tracking) fn detect(
            &self,
            image: &impl ToInputArray,
            corners: &mut Vector<Vector<Point2f>>,
            ids: &mut Vector<i32>,
            rejected: &mut Vector<Vector<Point2f>>,
        ) -> opencv::Result<()> {
            self.detector.detect_markers(image, corners, ids, rejected)
        }

        pub(in crate::tracking) fn cells(&self, id: i32, side: usize) -> opencv::Result<Vec<bool>> {
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

    fn installed_dictionary(family: Family) -> DetectorDictionary {
        let codes = installed_codes(family.codes()).unwrap();
        DetectorDictionary::new(codes, family, 0, ArucoRefinement::None).unwrap()
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
                let template = apriltag::printed_marker(family, id).unwrap().square();
                let opencv = dictionary.cells(id as i32, side).unwrap();
                assert_eq!(
                    quarter_turns_between(&template, &opencv, side),
                    Some(turn),
                    "{family} {id}"
                );
            }
            assert!(apriltag::printed_marker(family, family.id_count()).is_none());
        }
    }

    #[test]
    fn the_dictionaries_have_the_ids_that_they_claim() {
        let families = Family::all_names().filter_map(Family::from_name);
        for family in families.filter(|family| !family.has_ring()) {
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
