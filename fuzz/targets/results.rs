//! Files that are about to be replaced: are they older results?

use gnomon::app::files::result_kind::ResultKind;

const KINDS: [ResultKind; 15] = [
    ResultKind::Poses,
    ResultKind::Detections,
    ResultKind::Stats,
    ResultKind::Response,
    ResultKind::Table,
    ResultKind::Measurements,
    ResultKind::ChartsPage,
    ResultKind::Video,
    ResultKind::Png,
    ResultKind::Radiance,
    ResultKind::Pdf,
    ResultKind::Svg,
    ResultKind::LearntBoard,
    ResultKind::PrintedMarkers,
    ResultKind::Calibration,
];

pub fn run(bytes: &[u8]) {
    let _ = KINDS.map(|kind| kind.is(bytes));
}
