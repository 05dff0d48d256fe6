//! Scenes of the chart of stability.

use gnomon::app::chart::known_scene::KnownScene;

const MASK: &[u8] = include_bytes!("../seeds/texture/small.png");

pub fn run(bytes: &[u8]) {
    super::file("a_exact.png", MASK);
    let path = super::file("a.json", bytes);
    let _ = path.parent().map(|folder| KnownScene::read(folder, "a"));
}
