//! What takes long to work out before a scene's first frame, worked out once for all tests of a program: by what it was made
//! from, as the program keeps it on disk.

use std::collections::HashMap;
use std::sync::{LazyLock, Mutex};

use gnomon::environment::finer::Cuts;
use gnomon::environment::self_occlusion::{OwnSpace, OwnSurface, SelfOcclusion};
use gnomon::geometry::mesh::Mesh;
use gnomon::render::{Afresh, Precomputation};

/// What was worked out, by its key.
struct Known<T>(LazyLock<Mutex<HashMap<u64, T>>>);

impl<T: Clone> Known<T> {
    const fn new() -> Self {
        Self(LazyLock::new(Mutex::default))
    }

    fn get_or(&self, key: u64, work_out: impl FnOnce() -> T) -> T {
        // (Not locked meanwhile: another test may want another thing.)
        let known = self.0.lock().expect("no panic").get(&key).cloned();
        known.unwrap_or_else(|| {
            let value = work_out();
            self.0.lock().expect("no panic").insert(key, value.clone());
            value
        })
    }
}

static CUTS: Known<Cuts> = Known::new();
static SELF_OCCLUSIONS: Known<Vec<SelfOcclusion>> = Known::new();

/// Works out what no test of the program has asked for yet.
pub struct Remembered;

impl Precomputation for Remembered {
    fn cuts(&self, mesh: &Mesh, space: &OwnSpace) -> Cuts {
        CUTS.get_or(space.key(mesh), || Afresh.cuts(mesh, space))
    }

    fn self_occlusions(&self, surface: &OwnSurface) -> Vec<SelfOcclusion> {
        SELF_OCCLUSIONS.get_or(surface.kept_as(), || Afresh.self_occlusions(surface))
    }
}
