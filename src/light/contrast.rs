//! How strong a light is beside what surrounds it, from the brightness on both sides of shadows' edges.

use std::f64::consts::PI;

use glam::DVec3;

/// Two neighbouring places of one surface, one in the light and one in the shadow, and what a camera saw of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContrastSample {
    /// Radiance in the light, linear RGB.
    pub lit: DVec3,
    /// Radiance in the shadow.
    pub shaded: DVec3,
    /// Diffuse reflectance of the surface.
    pub albedo: DVec3,
    /// What the light gives the lit place if its strength is 1: irradiance, straight and by way of the things around.
    pub of_light_lit: DVec3,
    /// What it gives the shaded place, by way of the things around alone.
    pub of_light_shaded: DVec3,
    /// What surroundings of radiance 1 give the lit place.
    pub of_ambient_lit: DVec3,
    /// What surroundings of radiance 1 give the shaded place.
    pub of_ambient_shaded: DVec3,
}

/// The strengths of a light and of what surrounds it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strengths {
    /// The light's strength (W/sr, or W/m² if it is infinitely far).
    pub light: DVec3,
    /// Radiance of the surroundings.
    pub ambient: DVec3,
    /// How much of each sample's brightness the two leave unexplained, as a part of it: the median.
    pub unexplained: f64,
}

/// Fewer samples are no measurement.
pub const LEAST_SAMPLES: usize = 8;

impl ContrastSample {
    /// The weight of what the sample says of the surroundings. What the things around a place hide of them and throw
    /// back is known to one bounce alone: the more of that there is in the shade, the less it says.
    fn trust(&self) -> f64 {
        /// As much is uncertain in the open as well.
        const FLOOR: f64 = 0.02;
        let hidden = 1.0 - self.of_ambient_shaded.element_sum() / (3.0 * PI);
        let thrown_back = (self.of_light_shaded * self.lit).element_sum()
            / (self.of_light_lit * self.shaded).element_sum().max(1e-9);
        (FLOOR + hidden.max(0.0) + thrown_back.max(0.0)).powi(-2)
    }
}

/// The medians, over all samples, of the surroundings beside the light and then of the light itself: a stain on the
/// table, or an edge that is not the shadow's, moves neither. Between the two places of a sample the albedo is the same,
/// so it has no say in the first; `None` with fewer than [`LEAST_SAMPLES`].
pub fn strengths(samples: &[ContrastSample]) -> Option<Strengths> {
    let mut light = DVec3::ZERO;
    let mut ambient = DVec3::ZERO;
    for channel in 0..3 {
        let beside = median(samples.iter().filter_map(|sample| {
            let [
                lit,
                shaded,
                light_lit,
                light_shaded,
                ambient_lit,
                ambient_shaded,
            ] = [
                sample.lit,
                sample.shaded,
                sample.of_light_lit,
                sample.of_light_shaded,
                sample.of_ambient_lit,
                sample.of_ambient_shaded,
            ]
            .map(|rgb| rgb[channel]);
            // shaded / lit = (light_shaded + x ambient_shaded) / (light_lit + x ambient_lit), x: ambient by light.
            let slope = lit * ambient_shaded - shaded * ambient_lit;
            (slope > 0.0).then(|| {
                let beside = (shaded * light_lit - lit * light_shaded) / slope;
                (beside.max(0.0), sample.trust())
            })
        }))?;
        light[channel] = median(samples.iter().filter_map(|sample| {
            let unit = sample.albedo[channel] / PI
                * (sample.of_light_lit[channel] + beside * sample.of_ambient_lit[channel]);
            (unit > 0.0).then(|| (sample.lit[channel] / unit, 1.0))
        }))?;
        ambient[channel] = beside * light[channel];
    }
    let unexplained = median(samples.iter().map(|sample| {
        let predicted = sample.albedo / PI
            * (light * sample.of_light_shaded + ambient * sample.of_ambient_shaded);
        // Beside its own lit place, so that an albedo that is a little off does not count.
        let lit =
            sample.albedo / PI * (light * sample.of_light_lit + ambient * sample.of_ambient_lit);
        let seen = sample.shaded.element_sum() / sample.lit.element_sum();
        let off = (predicted.element_sum() / lit.element_sum() / seen - 1.0).abs();
        (off, sample.trust())
    }))?;
    Some(Strengths {
        light,
        ambient,
        unexplained,
    })
}

/// The median of values with their weights; `None` with fewer than [`LEAST_SAMPLES`].
fn median(weighted: impl Iterator<Item = (f64, f64)>) -> Option<f64> {
    let mut weighted: Vec<(f64, f64)> = weighted.filter(|(value, _)| value.is_finite()).collect();
    if weighted.len() < LEAST_SAMPLES {
        return None;
    }
    weighted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * weighted.iter().map(|(_, weight)| weight).sum::<f64>();
    let mut sum = 0.0;
    let reached = weighted.iter().find(|(_, weight)| {
        sum += weight;
        sum >= half
    });
    reached.map(|(value, _)| *value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(index: usize, light: DVec3, ambient: DVec3) -> ContrastSample {
        let share = index as f64 / 40.0;
        let [of_light_lit, of_light_shaded] = [2.0 + share, 0.01 * share].map(DVec3::splat);
        let [of_ambient_lit, of_ambient_shaded] =
            [3.1 - 0.2 * share, 3.0 - 0.3 * share].map(DVec3::splat);
        let albedo = DVec3::new(0.8, 0.5, 0.3) * (1.0 - 0.5 * share);
        ContrastSample {
            lit: albedo / PI * (light * of_light_lit + ambient * of_ambient_lit),
            shaded: albedo / PI * (light * of_light_shaded + ambient * of_ambient_shaded),
            albedo,
            of_light_lit,
            of_light_shaded,
            of_ambient_lit,
            of_ambient_shaded,
        }
    }

    #[test]
    fn known_strengths_come_back_though_a_third_of_the_samples_is_wrong() {
        let (light, ambient) = (DVec3::new(1.15, 1.06, 0.9), DVec3::new(0.1, 0.11, 0.13));
        let mut samples: Vec<ContrastSample> = (0..40).map(|i| sample(i, light, ambient)).collect();
        let found = strengths(&samples).unwrap();
        assert!((found.light - light).length() < 1e-12);
        assert!((found.ambient - ambient).length() < 1e-12);
        assert!(found.unexplained < 1e-12);
        for (index, sample) in samples
            .iter_mut()
            .enumerate()
            .filter(|(index, _)| index % 3 == 0)
        {
            // As many that are too bright as too dark.
            let factor = if index % 2 == 0 { 0.2 } else { 3.0 };
            sample.shaded *= factor;
            sample.lit *= factor.sqrt();
        }
        let found = strengths(&samples).unwrap();
        assert!(
            (found.light / light - DVec3::ONE).length() < 0.05,
            "{found:?}"
        );
        assert!(
            (found.ambient / ambient - DVec3::ONE).length() < 0.1,
            "{found:?}"
        );
        assert_eq!(strengths(&samples[..LEAST_SAMPLES - 1]), None);
    }
}
