//! Calibrations of all makers, told by their endings and by what is in them.
#![no_main]

use gnomon::capture::load_calibration;

const NAMES: [&str; 5] = ["a.toml", "a.yaml", "a.json", "a.xml", "cameras.txt"];

// The choice says which name the bytes get.
gnomon_fuzz::target!(|input: &[u8]| {
    gnomon_fuzz::choice(input, NAMES.len())
        .map(|(name, bytes)| load_calibration(&gnomon_fuzz::file(NAMES[name], bytes)))
});
