//! All that is done with triangles of any kind: mending, volumes, levels, holes, cuts.

use glam::{DVec3, Vec2, Vec3};
use gnomon::geometry::coincidence::{IN_ONE_PLACE_M, coincidence};
use gnomon::geometry::levels::levels;
use gnomon::geometry::mesh::{CornerLook, Mesh, RawLooks, RawTriangle};
use gnomon::geometry::region_cut::{Extent, Region, cut};
use gnomon::geometry::shadow_volume::{Caster, LightPlace};
use gnomon::geometry::solid::holes;
use gnomon::geometry::subdivide::subdivided;
use gnomon::geometry::surface_distance::SampledSurface;

const MOST_VERTICES: usize = 250;
const MOST_TRIANGLES: usize = 1200;
const MOST_PIECES: usize = 5000;

/// Places on a coarse grid, where much falls together, or any floats.
struct Soup {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl Soup {
    fn of_bytes(input: &[u8]) -> Option<Self> {
        let (&[kind, count], bytes) = input.split_first_chunk()?;
        let count = usize::from(count).clamp(3, MOST_VERTICES);
        let (positions, bytes): (Vec<Vec3>, &[u8]) = match kind % 2 {
            0 => {
                let (places, rest) = bytes.split_at_checked(3 * count)?;
                let grid = |byte: &u8| f32::from(byte.cast_signed()) / 16.0;
                let place = |at: &[u8]| Vec3::new(grid(&at[0]), grid(&at[1]), grid(&at[2]));
                (places.chunks_exact(3).map(place).collect(), rest)
            }
            _ => {
                let (places, rest) = bytes.split_at_checked(12 * count)?;
                let number = |at: &[u8]| {
                    let number = f32::from_le_bytes([at[0], at[1], at[2], at[3]]);
                    if number.abs() <= 1e5 { number } else { 0.0 }
                };
                let place = |at: &[u8]| Vec3::new(number(at), number(&at[4..]), number(&at[8..]));
                (places.chunks_exact(12).map(place).collect(), rest)
            }
        };
        let index = |byte: &u8| u32::from(*byte) % count as u32;
        let corners = bytes.chunks_exact(3).take(MOST_TRIANGLES);
        Some(Self {
            positions,
            triangles: corners
                .map(|at| [index(&at[0]), index(&at[1]), index(&at[2])])
                .collect(),
        })
    }

    fn raw(&self) -> Vec<RawTriangle> {
        let raw = |&vertices: &[u32; 3]| RawTriangle {
            vertices,
            normals: [None; 3],
            material: 0,
        };
        self.triangles.iter().map(raw).collect()
    }

    /// A corner's place in a picture is its own, seen along z.
    fn looks(&self) -> RawLooks {
        let look = |place: &Vec3| CornerLook {
            uv: [Vec2::new(place.x, place.y); 2],
            ..CornerLook::default()
        };
        RawLooks {
            looks: self.positions.iter().map(look).collect(),
            corners: self.triangles.clone(),
        }
    }
}

/// A ring in the picture.
struct Ring;

impl Region for Ring {
    fn inside(&self, look: &CornerLook) -> f64 {
        let out = f64::from(look.uv[0].length());
        (out - 1.0).min(3.0 - out)
    }

    fn extent(&self, _: [&CornerLook; 3]) -> Extent {
        Extent::Part
    }

    fn is_fine(&self, corners: [&CornerLook; 3]) -> bool {
        corners[0].uv[0].distance(corners[1].uv[0]) < 0.25
    }
}

fn cast(mesh: &Mesh, place: DVec3) {
    let caster = Caster::new(mesh.positions.clone(), mesh.triangles.clone());
    let vertices = caster.volume_vertices().len() as u32;
    let along = place.try_normalize().unwrap_or(DVec3::Z);
    for light in [LightPlace::Point(place), LightPlace::Along(along)] {
        for eye in [place + DVec3::X, place * -2.0] {
            let casting = caster.casting(light, eye);
            for part in caster.parts(light, casting, 3) {
                let sides = caster.side_indices(&part.silhouette);
                let caps = caster.cap_indices(&part.silhouette).concat();
                assert!(sides.iter().chain(&caps).all(|&index| index < vertices));
                assert!(part.layers >= 1 || sides.is_empty());
            }
            let lit = caster.lit_triangles(light, Some(eye), Some(&mesh.corner_normals));
            assert!(lit.facing.outer.len() <= mesh.triangles.len());
        }
        let _ = caster.outline_edges(light);
    }
}

fn work(soup: &Soup) {
    let raw = soup.raw();
    let (mesh, _) = Mesh::weld(&soup.positions, &raw, 0.5);
    assert!(mesh.positions.iter().all(|place| place.is_finite()));
    let place = soup
        .positions
        .first()
        .map_or(DVec3::Z, |place| place.as_dvec3() * 1.5);
    cast(&mesh, place);
    let _ = holes(&mesh);
    for level in levels(&mesh) {
        assert!(level.max_error_m >= 0.0 && level.mean_error_m >= 0.0);
    }
    let _ = SampledSurface::new(&mesh).map(|surface| surface.distance_to(&surface, &|| true));
    let corners_of = |triangle: &[u32; 3]| triangle.map(|index| mesh.positions[index as usize]);
    let corners: Vec<[Vec3; 3]> = mesh.triangles.iter().map(corners_of).collect();
    let exact: Vec<[DVec3; 3]> = corners
        .iter()
        .map(|t| t.map(|place| place.as_dvec3()))
        .collect();
    let _ = coincidence(&exact, &exact, IN_ONE_PLACE_M);
    let cornered = corners
        .iter()
        .map(|t| t.map(|place| (place, Vec3::Z)))
        .collect();
    let _ = subdivided(cornered, |_, _| 0.5, MOST_PIECES);
    let region_of = |_| Some(&Ring as &dyn Region);
    let cut = cut(
        (&soup.positions, &[]),
        &raw,
        &soup.looks(),
        region_of,
        MOST_PIECES,
    );
    let (cut_mesh, _) = Mesh::weld_with_looks(&cut.positions, &cut.triangles, &cut.looks, 0.5);
    assert_eq!(cut_mesh.corner_looks.len(), cut_mesh.triangles.len());
}

pub fn run(input: &[u8]) {
    if let Some(soup) = Soup::of_bytes(input) {
        work(&soup);
    }
}
