//! Runs one target, the one that `GNOMON_FUZZ_TARGET` names, over what the fuzzer makes up. All are in one program, for each
//! that links everything takes its time.
#![no_main]

mod targets;

use std::alloc::System;
use std::sync::OnceLock;

use cap::Cap;
use targets::{TARGETS, Target};

/// What may be taken beyond what there was before, bytes, for an input of less than a megabyte.
const MOST_MEMORY: usize = 256 << 20;

#[global_allocator]
static MEMORY: Cap<System> = Cap::new(System, usize::MAX);

static TARGET: OnceLock<Target> = OnceLock::new();

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let run = TARGET.get_or_init(chosen);
    limit_memory();
    run(bytes);
});

fn chosen() -> Target {
    let name = std::env::var("GNOMON_FUZZ_TARGET").unwrap_or_default();
    let target = TARGETS.iter().find(|(known, _)| *known == name);
    target.map(|(_, run)| *run).unwrap_or_else(|| {
        let names: Vec<&str> = TARGETS.iter().map(|(name, _)| *name).collect();
        eprintln!("GNOMON_FUZZ_TARGET is \"{name}\"; there are {}", names.join(", "));
        std::process::exit(2)
    })
}

/// From now on [`MOST_MEMORY`] more may be taken; who asks for more ends the process. What OpenCV takes is not counted.
fn limit_memory() {
    // Raised first: the limit must never lie below what is taken.
    let _ = MEMORY.set_limit(usize::MAX);
    let _ = MEMORY.set_limit(MEMORY.allocated() + MOST_MEMORY);
}
