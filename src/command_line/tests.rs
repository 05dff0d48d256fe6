//! Values that are refused, and options that share their words with the scene file.

use super::*;
use std::collections::BTreeSet;

use clap::CommandFactory as _;
use gnomon::scene::format::SECTIONS;

/// What is refused in a scene's file is refused here.
#[test]
fn options_take_what_the_keys_of_their_names_take() {
    let track = "track a.mp4 --size-mm 40 --poses p.csv";
    let record = "record webcam:0 --out s";
    for (command, refused, allowed) in [
        (track, "--decimation 12", "1 to 8"),
        (track, "--decimation 0.5", "1 to 8"),
        (track, "--decimation nan", "1 to 8"),
        (track, "--border-cells 3", "1 to 2"),
        (record, "--fps 0", "1 to 1000"),
        (record, "--fps 1001", "1 to 1000"),
        (record, "--size 40000x480", "1 to 32767"),
        (record, "--size 640", "WIDTHxHEIGHT"),
        (record, "--format YUV", "MJPEG, YUYV"),
        (
            "board --from a --size-mm 40",
            "--name a,b",
            "without commas",
        ),
        (
            "probe a.hdr --kind panorama --out b.hdr",
            "--turn-deg 2000000",
            "-1000000 to 1000000",
        ),
        (
            "markers --ids 1 --size-mm 40 --out a.pdf",
            "--name a;b",
            "without commas",
        ),
    ] {
        let parsed = |more: &str| {
            let words = format!("gnomon {command} {more}");
            Cli::try_parse_from(words.split_whitespace()).map(|_| ())
        };
        assert!(parsed("").is_ok(), "{command}");
        let message = parsed(refused).unwrap_err().to_string();
        assert!(message.contains(allowed), "{refused}: {message}");
    }
    let words =
        "gnomon record webcam:0 --out s --decimation 8 --fps 30 --size 640x480 --format yuyv";
    assert!(Cli::try_parse_from(words.split_whitespace()).is_ok());
}

/// An option that gets the name of a key belongs above.
#[test]
fn these_options_have_the_names_of_keys() {
    let keys: BTreeSet<String> = SECTIONS
        .iter()
        .flat_map(|section| section.names())
        .map(|name| name.replace('_', "-"))
        .collect();
    let command = Cli::command();
    let options = command
        .get_subcommands()
        .flat_map(clap::Command::get_arguments);
    let shared: BTreeSet<&str> = options
        .filter_map(|option| option.get_long())
        .filter(|name| keys.contains(*name))
        .collect();
    let expected = [
        "border-cells",
        "calibration",
        "decimation",
        "family",
        "format",
        "fps",
        "inverted",
        // Of the pictures that a probe is made from, not of the probe.
        "kind",
        // A file to write.
        "markers",
        "mirror",
        "name",
        "turn-deg",
    ];
    assert_eq!(shared, BTreeSet::from(expected));
}
