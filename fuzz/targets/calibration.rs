//! Calibrations of all makers, told by their endings and by what is in them.

use gnomon::capture::load_calibration;

const NAMES: [&str; 7] = [
    "a.toml",
    "a.yaml",
    "a.json",
    "a.xml",
    "cameras.txt",
    "a.npz",
    "a.npy",
];

// The choice says which name the bytes get.
pub fn run(input: &[u8]) {
    if let Some((name, bytes)) = super::choice(input, NAMES.len()) {
        let _ = load_calibration(&super::file(NAMES[name], bytes));
    }
}
