//! Files that are about to be replaced: are they older results?
#![no_main]

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

gnomon_fuzz::target!(|bytes: &[u8]| KINDS.map(|kind| kind.is(bytes)));
