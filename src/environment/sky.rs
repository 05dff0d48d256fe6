//! Light from all around as it is gathered: what comes from everywhere alike, and what comes from single directions.

use std::f32::consts::{PI, TAU};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::light::REC_709;
use crate::light::probe::Probe;
use crate::light::regions::{Region, regions};

/// Of so many rays that a scene asks for one looks for what things reflect, where the sky's light has directions of its own.
const RAYS_FOR_ONE: usize = 4;

/// Light from afar.
#[derive(Debug, Clone)]
pub struct Sky {
    /// From everywhere.
    pub radiance: Vec3,
    /// Of regions of like power, each from one direction, the brightest first: a bright part of the sky gets many of them.
    pub sources: Vec<Region>,
    /// The sources' powers up to each of them and with it.
    powers: Vec<f64>,
    by_normal: IrradianceByNormal,
}

/// Irradiance of surfaces that see all of the sky, at normals on a grid of longitude and latitude, poles included.
#[derive(Debug, Clone)]
struct IrradianceByNormal {
    /// Of [`NORMALS`] columns and rows, the upper row first.
    grid: Vec<Vec3>,
}

/// Columns and rows of normals: between two of them irradiance is linear to a thousandth of a single direction's.
const NORMALS: [usize; 2] = [72, 37];

impl IrradianceByNormal {
    fn new(irradiance: impl Fn(Vec3) -> Vec3 + Sync) -> Self {
        let [columns, rows] = NORMALS;
        let at = |index: usize| {
            let across = TAU * (index % columns) as f32 / columns as f32;
            let down = PI * (index / columns) as f32 / (rows - 1) as f32;
            let (x, y) = (across.cos(), across.sin());
            irradiance(Vec3::new(x * down.sin(), y * down.sin(), down.cos()))
        };
        Self {
            grid: (0..columns * rows).into_par_iter().map(at).collect(),
        }
    }

    /// Of a unit normal.
    fn at(&self, normal: Vec3) -> Vec3 {
        let [columns, rows] = NORMALS;
        let across = normal.y.atan2(normal.x).rem_euclid(TAU) / TAU * columns as f32;
        let down = normal.z.clamp(-1.0, 1.0).acos() / PI * (rows - 1) as f32;
        let (column, row) = (across as usize, (down as usize).min(rows - 2));
        let row_at = |row: usize| {
            let of = |column: usize| self.grid[row * columns + column % columns];
            of(column).lerp(of(column + 1), across - column as f32)
        };
        row_at(row).lerp(row_at(row + 1), down - row as f32)
    }
}

impl Sky {
    /// A probe's radiance times `exposure`, from about so many directions over each hemisphere.
    pub fn new(probe: &Probe, exposure: f64, rays: usize) -> Self {
        let mut sources = regions(probe, 2 * rays);
        for source in &mut sources {
            source.irradiance *= exposure;
        }
        // Those of a sun lie together: few places that are evenly spread over the power are then in it as often as they should be.
        let radiance = |source: &Region| source.irradiance.dot(REC_709) / source.solid_angle_sr;
        sources.sort_by(|a, b| radiance(b).total_cmp(&radiance(a)));
        let mut power = 0.0;
        let powers = sources.iter().map(|source| {
            power += source.irradiance.dot(REC_709);
            power
        });
        Self {
            radiance: Vec3::ZERO,
            powers: powers.collect(),
            by_normal: IrradianceByNormal::new(|normal| {
                let given = sources.iter().map(|source| {
                    let cosine = source.toward.as_vec3().dot(normal).max(0.0);
                    source.irradiance.as_vec3() * cosine
                });
                given.sum()
            }),
            sources,
        }
    }

    /// The same radiance from everywhere.
    pub fn constant(radiance: DVec3) -> Self {
        Self {
            radiance: radiance.as_vec3(),
            sources: Vec::new(),
            powers: Vec::new(),
            by_normal: IrradianceByNormal::new(|_| PI * radiance.as_vec3()),
        }
    }

    /// Rays over a hemisphere, of so many that are asked for.
    pub fn rays(&self, asked_for: usize) -> usize {
        match self.sources.is_empty() {
            true => asked_for,
            false => asked_for.div_ceil(RAYS_FOR_ONE),
        }
    }

    /// The source that a part of all power (0 to 1) falls to, and how often it stands for all of them: one over its share of the
    /// power. `None` without sources.
    pub fn source_at(&self, part: f64) -> Option<(&Region, f32)> {
        let all = self.powers.last().filter(|all| **all > 0.0)?;
        let index = self.powers.partition_point(|power| *power <= part * all);
        let index = index.min(self.sources.len() - 1);
        let before = index
            .checked_sub(1)
            .map_or(0.0, |before| self.powers[before]);
        let share = (self.powers[index] - before) / all;
        (share > 0.0).then(|| (&self.sources[index], share.recip() as f32))
    }

    /// Irradiance of a surface with a unit normal that sees all of it.
    pub fn irradiance(&self, normal: Vec3) -> Vec3 {
        self.by_normal.at(normal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_radiance_gives_all_surfaces_pi_times_it() {
        let radiance = Vec3::new(0.5, 1.0, 2.0);
        let constant = Sky::constant(radiance.as_dvec3());
        let probe = Probe::new([64, 32], vec![0.25 * radiance; 64 * 32]).expect("pixels");
        let sky = Sky::new(&probe, 4.0, 256);
        for way in [Vec3::X, Vec3::NEG_Z, Vec3::new(0.6, 0.0, 0.8)] {
            let found = constant.irradiance(way);
            assert!((found / PI).distance(radiance) < 1e-5, "{found}");
            let found = sky.irradiance(way);
            assert!((found / PI).distance(radiance) < 0.03, "{found}");
            let of_sources = sky.sources.iter().map(|source| {
                let cosine = source.toward.as_vec3().dot(way).max(0.0);
                source.irradiance.as_vec3() * cosine
            });
            let found = of_sources.sum::<Vec3>() / PI;
            assert!(found.distance(radiance) < 0.03, "{way}: {found}");
        }
    }

    /// A plane under a sun gets its cosine's part, whichever way the plane looks, and nothing from behind.
    #[test]
    fn a_sun_gives_each_plane_the_cosine_of_its_height() {
        let mut pixels = vec![Vec3::ZERO; 256 * 128];
        pixels[40 * 256 + 100] = Vec3::splat(1e4);
        let probe = Probe::new([256, 128], pixels).expect("pixels");
        let sky = Sky::new(&probe, 1.0, 64);
        let [sun] = &sky.sources[..] else {
            panic!("{} sources", sky.sources.len())
        };
        let mut random = fastrand::Rng::with_seed(3);
        for _ in 0..500 {
            let mut part = || random.f32() * 2.0 - 1.0;
            let normal = Vec3::new(part(), part(), part()).normalize_or(Vec3::Z);
            let cosine = sun.toward.as_vec3().dot(normal).max(0.0);
            let off = sky.irradiance(normal) / sun.irradiance.as_vec3() - cosine;
            // (At the terminator the cosine has a bend.)
            let allowed = if cosine > 0.1 { 2e-3 } else { 0.025 };
            assert!(off.abs().max_element() < allowed, "{normal}: {off}");
        }
        // Light by its power: two suns, one three times as bright.
        let mut pixels = vec![Vec3::ZERO; 256 * 128];
        pixels[40 * 256 + 100] = Vec3::splat(1e4);
        pixels[40 * 256 + 200] = Vec3::splat(3e4);
        let sky = Sky::new(&Probe::new([256, 128], pixels).expect("pixels"), 1.0, 64);
        let mut sum = DVec3::ZERO;
        for step in 0..400 {
            let (source, stands_for) = sky.source_at((step as f64 + 0.5) / 400.0).expect("light");
            sum += source.irradiance * f64::from(stands_for) / 400.0;
        }
        let all: DVec3 = sky.sources.iter().map(|source| source.irradiance).sum();
        assert!((sum / all - 1.0).abs().max_element() < 0.01, "{sum} {all}");
    }
}
