//! Reads a model with the crate that the viewers of three-d use, from the file to triangles and decoded pictures.
//!   loading_peer ROUNDS FILE     prints what each round took, milliseconds

use std::error::Error;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let (Some(rounds), Some(file)) = (words.next(), words.next()) else {
        return Err("loading_peer ROUNDS FILE".into());
    };
    for _ in 0..rounds.parse()? {
        let begun = Instant::now();
        let mut assets = three_d_asset::io::load(&[&file])?;
        let model: three_d_asset::Model = assets.deserialize(&file)?;
        let ms = begun.elapsed().as_secs_f64() * 1000.0;
        let triangles: usize = model
            .geometries
            .iter()
            .map(|part| match &part.geometry {
                three_d_asset::Geometry::Triangles(mesh) => mesh.triangle_count(),
                three_d_asset::Geometry::Points(_) => 0,
            })
            .sum();
        println!("{ms:.3} {triangles}");
    }
    Ok(())
}
