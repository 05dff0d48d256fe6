//! What `make fuzz` runs, over its seeds and what is left of them when they are cut off: so that no change to a reader leaves the
//! fuzzer behind.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use crate::common::project_file;

#[path = "../../fuzz/targets/mod.rs"]
mod targets;

fn names_in(folder: &Path) -> BTreeSet<String> {
    let entries = fs::read_dir(folder).unwrap();
    entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect()
}

#[test]
fn every_target_takes_its_seeds_whole_and_cut_off() {
    let seeds = project_file("fuzz/seeds");
    let names = targets::TARGETS.map(|(name, _)| name.to_owned());
    assert_eq!(names_in(&seeds), BTreeSet::from(names), "a folder for each");
    for (name, run) in targets::TARGETS {
        run(&[]);
        let folder = seeds.join(name);
        let files = names_in(&folder);
        assert!(!files.is_empty(), "{name} has no seed");
        for file in files {
            let bytes = fs::read(folder.join(file)).unwrap();
            for length in [bytes.len(), bytes.len() / 2, bytes.len().saturating_sub(1)] {
                run(&bytes[..length]);
            }
        }
    }
}

/// A program that nobody compiles but `make fuzz` names the same targets.
#[test]
fn the_fuzzer_runs_all_targets() {
    let folder = project_file("fuzz/targets");
    let helpers = ["mod.rs", "beside_a_scene.rs"];
    let found: BTreeSet<String> = names_in(&folder)
        .into_iter()
        .filter(|name| !helpers.contains(&name.as_str()))
        .collect();
    let named = targets::TARGETS.map(|(name, _)| format!("{name}.rs"));
    assert_eq!(found, BTreeSet::from(named));
}
