//! The quality controller: it keeps to a frame budget by fewer shadows, or by coarser things.

use crate::scene::{Scene, ShadowTechnique};

use super::rung_chooser::RungChooser;

/// Sources of the cheapest rung.
const FEWEST_SOURCES: u32 = 4;
/// Rungs for *all* sources stop here; no more of them make a difference that shows.
const MOST_SOURCES: u32 = 256;
/// Outlines are off by this at most where the budget asks for it, pixels.
const COARSEST_PX: f64 = 8.0;
/// The finest rung of a scene that asks for outlines without any error, pixels.
const FINEST_PX: f64 = 0.25;

/// A rung's setting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Setting {
    /// So many sources get a shadow each; `None`: all.
    Sources(Option<u32>),
    /// Outlines may be off by this much, pixels.
    SilhouettesPx(f64),
}

/// The settings of a scene with a frame budget, and which of them is used.
#[derive(Debug, Clone, PartialEq)]
pub struct QualityController {
    budget_ms: f64,
    settings: Vec<Setting>,
    chooser: RungChooser,
    lowest: usize,
}

impl QualityController {
    /// Of a scene; `None` where it has no frame budget.
    pub(super) fn new(scene: &Scene, technique: ShadowTechnique) -> Option<Self> {
        let budget_ms = scene.shadows.frame_budget_ms?;
        let (settings, costs): (Vec<Setting>, Vec<f64>) = match technique.has_shafts() {
            true => sources(scene.shadows.shafts.sources).unzip(),
            false => outlines(scene.shadows.max_silhouette_error_px).unzip(),
        };
        Some(Self {
            budget_ms,
            lowest: settings.len() - 1,
            chooser: RungChooser::new(budget_ms, costs),
            settings,
        })
    }

    /// Takes note of what a frame took. Returns whether the setting is another one from now on.
    pub(super) fn spent(&mut self, frame_ms: f64) -> bool {
        let changes = self.chooser.spent(frame_ms);
        self.lowest = self.lowest.min(self.chooser.rung());
        changes
    }

    /// What a frame may take, milliseconds.
    pub fn budget_ms(&self) -> f64 {
        self.budget_ms
    }

    /// The present setting.
    pub fn setting(&self) -> Setting {
        self.settings[self.chooser.rung()]
    }

    /// The cheapest setting that was used.
    pub fn lowest(&self) -> Setting {
        self.settings[self.lowest]
    }

    /// Whether there is nothing cheaper than the present setting.
    pub fn is_at_the_end(&self) -> bool {
        self.chooser.rung() == 0
    }
}

/// Rising by half an octave, the wanted one last; the cost is their number, and something that each frame has.
fn sources(wanted: Option<u32>) -> impl Iterator<Item = (Setting, f64)> {
    let most = wanted.unwrap_or(MOST_SOURCES);
    let rungs = (0..).map(|step| {
        let count = f64::from(FEWEST_SOURCES) * 2_f64.powf(f64::from(step) / 2.0);
        count.round() as u32
    });
    let fewer = rungs.take_while(move |&count| count < most);
    let fewer = fewer.map(|count| (Setting::Sources(Some(count)), f64::from(count)));
    fewer.chain([(Setting::Sources(wanted), f64::from(most))])
}

/// Halving, the wanted one last. What they cost is not known before; each is tried in turn.
fn outlines(wanted_px: f64) -> impl Iterator<Item = (Setting, f64)> {
    let finest_px = wanted_px.max(FINEST_PX);
    let rungs = (0..).map(|step| COARSEST_PX / f64::from(1 << step));
    let coarser = rungs.take_while(move |&error_px| error_px > finest_px);
    let settings = coarser.chain([wanted_px]).map(Setting::SilhouettesPx);
    settings.zip((0..).map(|step| 1.0 + 0.1 * f64::from(step)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ladders_rise_to_what_the_scene_asks_for() {
        let counts = |wanted| -> Vec<Option<u32>> {
            let counts = sources(wanted).map(|(setting, _)| match setting {
                Setting::Sources(count) => count,
                Setting::SilhouettesPx(_) => unreachable!(),
            });
            counts.collect()
        };
        let upto = [4, 6, 8, 11, 16, 23, 32, 45, 50].map(Some);
        assert_eq!(counts(Some(50)), upto);
        assert_eq!(counts(Some(4)), [Some(4)]);
        assert_eq!(counts(Some(1)), [Some(1)]);
        assert_eq!(counts(None).last(), Some(&None));
        let pixels: Vec<Setting> = outlines(0.5).map(|(setting, _)| setting).collect();
        let expected = [8.0, 4.0, 2.0, 1.0, 0.5].map(Setting::SilhouettesPx);
        assert_eq!(pixels, expected);
        assert_eq!(
            outlines(0.0).last().map(|(setting, _)| setting),
            Some(Setting::SilhouettesPx(0.0))
        );
        for costs in [
            sources(None).map(|(_, cost)| cost).collect::<Vec<_>>(),
            outlines(0.0).map(|(_, cost)| cost).collect(),
        ] {
            assert!(costs.windows(2).all(|pair| pair[0] < pair[1]));
        }
    }
}
