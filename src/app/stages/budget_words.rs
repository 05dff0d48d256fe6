//! What became of a frame budget, in words.

use crate::render::{QualityController, Setting};

/// How much longer than the budget frames may take, now and then, and still be said to keep to it.
const HELD: f64 = 1.1;

/// A sentence for people. `p95_ms` is what 95 % of the frames kept.
pub fn budget_words(controller: &QualityController, p95_ms: f64) -> String {
    let budget_ms = controller.budget_ms();
    let lowest = setting_words(controller.lowest());
    if p95_ms <= HELD * budget_ms {
        return format!(
            "the frame budget of {budget_ms} ms was held: 95 % of the frames took at most {p95_ms:.1} ms, with {lowest} at \
             the least"
        );
    }
    let reason = match controller.is_at_the_end() {
        true => "there is nothing more to leave out",
        false => "frames take too different times",
    };
    format!(
        "the frame budget of {budget_ms} ms could not be held: 5 % of the frames took more than {p95_ms:.1} ms, with {lowest} \
         at the least; {reason}"
    )
}

/// A setting, for people.
pub fn setting_words(setting: Setting) -> String {
    match setting {
        Setting::Sources(Some(1)) => "1 source".to_owned(),
        Setting::Sources(Some(count)) => format!("{count} sources"),
        Setting::Sources(None) => "all sources".to_owned(),
        Setting::SilhouettesPx(error_px) => format!("outlines within {error_px} px"),
    }
}
