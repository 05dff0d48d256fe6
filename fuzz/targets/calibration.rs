//! Calibrations of all makers, told by their endings and by what is in them.
#![no_main]

use gnomon::capture::load_calibration;

const NAMES: [&str; 5] = ["a.toml", "a.yaml", "a.json", "a.xml", "cameras.txt"];

// The first byte, a digit in the seeds, says which name the rest gets.
libfuzzer_sys::fuzz_target!(|input: &[u8]| {
    let Some((kind, bytes)) = input.split_first() else {
        return;
    };
    let name = NAMES[usize::from(kind.wrapping_sub(b'0')) % NAMES.len()];
    let _ = load_calibration(&gnomon_fuzz::file(name, bytes));
});
