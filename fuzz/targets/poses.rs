//! True poses of sessions.
#![no_main]

use gnomon::app::truth::TruePoses;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let path = gnomon_fuzz::file("truth.json", bytes);
    if let Some(folder) = path.parent() {
        let _ = TruePoses::read(folder);
    }
});
