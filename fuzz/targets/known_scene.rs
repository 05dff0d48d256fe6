//! Scenes of the chart of stability.
#![no_main]

use gnomon::app::chart::known_scene::KnownScene;

const MASK: &[u8] = include_bytes!("../seeds/texture/small.png");

gnomon_fuzz::target!(|bytes: &[u8]| {
    gnomon_fuzz::file("a_exact.png", MASK);
    let path = gnomon_fuzz::file("a.json", bytes);
    path.parent().map(|folder| KnownScene::read(folder, "a"))
});
