//! Damaged files end in one message or are read; nothing panics.

use std::fs;
use std::path::Path;

use gnomon::scene::Scene;

use super::{CUBE, HEAD, load_in, project};

/// Marsaglia's xorshift: the same damage in each run.
struct Damage(u64);

impl Damage {
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % end as u64) as usize
    }

    /// Puts odd words in the place of up to three pieces of a text.
    fn done_to(&mut self, text: &str, words: &[&str]) -> String {
        let mut damaged: Vec<char> = text.chars().collect();
        for _ in 0..=self.below(3) {
            let start = self.below(damaged.len());
            let end = (start + self.below(4)).min(damaged.len());
            let word = words[self.below(words.len())];
            damaged.splice(start..end, word.chars());
        }
        damaged.into_iter().collect()
    }
}

#[test]
fn damaged_scenes() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/reference.toml");
    let whole = fs::read_to_string(&path).unwrap();
    let text: String = whole
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| format!("{line}\n"))
        .collect();
    let words = [
        "", "=", "[", "]", "{", "}", "\"", "\n", "nan", "-", "9e999", ",", "é", "\u{0}", "'", ".",
        "0", "[[x]]\n",
    ];
    let mut damage = Damage(1);
    let mut refused = 0;
    for _ in 0..1500 {
        if let Err(error) = Scene::parse(&path, &damage.done_to(&text, &words)) {
            assert!(error.to_string().contains("reference.toml"), "{error}");
            refused += 1;
        }
    }
    assert!(refused > 1000, "{refused}");
}

#[test]
fn damaged_shapes() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds/scene/shapes.toml");
    let text = fs::read_to_string(&path).unwrap();
    let words = [
        "", "[", "]", "{", "}", "-", "e9", "e-9", ",", "0", "0.04", "[0, 0], ", "1e5", "nan", "\n",
    ];
    let whole = Scene::parse(&path, &text).unwrap();
    assert_eq!((whole.phantoms.len(), whole.virtuals.len()), (2, 5));
    let mut damage = Damage(3);
    let mut refused = 0;
    for _ in 0..150 {
        match Scene::parse(&path, &damage.done_to(&text, &words)) {
            Err(error) => {
                assert!(error.to_string().contains("shapes.toml"), "{error}");
                refused += 1;
            }
            Ok(scene) => {
                for thing in scene.phantoms.iter().chain(&scene.virtuals) {
                    let places = || thing.mesh.positions.iter();
                    assert!(places().all(|place| place.is_finite()), "{}", thing.name);
                    let normals = thing.mesh.corner_normals.iter().flatten();
                    assert!(normals.clone().all(|normal| normal.is_normalized()));
                    assert!(!thing.mesh.triangles.is_empty());
                }
            }
        }
    }
    assert!((50..150).contains(&refused), "{refused}");
}

#[test]
fn damaged_meshes() {
    let project = project();
    let scene = format!("{HEAD}[[virtual]]\nname = \"v\"\nmesh = \"models/cube.obj\"\n");
    let text = format!(
        "mtllib a.mtl\nusemtl a\nvn 0 0 1\nvt 0 0\n{CUBE}f 1//1 2//1 3\nusemtl b\nf 1/1 5/1 3/1\n"
    );
    let mtl = "newmtl a\nKd .1 .2 .3\nNs 30\nnewmtl b\nKd 1 1 1\nKs 0 0 0\nmap_Kd x.png\nillum 2\nPr .5\n";
    let words = [
        "", " ", "\n", "-", "/", "//", "nan", "inf", "0", "1e39", "é", "f ", "v ", "l ", "o ",
        "99", "\u{0}", "\t",
    ];
    let mut damage = Damage(2);
    for _ in 0..1500 {
        fs::write(
            project.path().join("models/cube.obj"),
            damage.done_to(&text, &words),
        )
        .unwrap();
        fs::write(
            project.path().join("models/a.mtl"),
            damage.done_to(mtl, &words),
        )
        .unwrap();
        match load_in(&project, &scene) {
            Ok(scene) => {
                let mesh = &scene.virtuals[0].mesh;
                let normals = mesh.corner_normals.iter().flatten();
                assert!(
                    normals
                        .into_iter()
                        .all(|normal| (normal.length() - 1.0).abs() < 1e-5)
                );
                assert!(mesh.positions.iter().all(|position| position.is_finite()));
                assert!(
                    scene.virtuals[0]
                        .materials
                        .iter()
                        .all(|material| material.albedo.is_finite())
                );
            }
            Err(error) => assert!(error.to_string().contains("models/"), "{error}"),
        }
    }
}
