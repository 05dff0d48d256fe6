//! `gnomon chart`: measures speed and accuracy on this machine and draws them.

mod axis;
mod canvas;
mod compositing;
mod displacement;
mod drawing;
mod environment;
mod environment_gloss;
mod environment_pictures;
mod family;
mod figure;
mod footage;
pub mod known_scene;
mod lab;
mod left_out;
mod marker_view;
mod measured;
mod moved;
pub mod peers_table;
mod pictures;
mod scaling;
mod shadows;
mod shaft_settings;
mod sheet;
mod shots;
mod stability;
mod tracking;
mod wrong_pose;

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use anyhow::{Context as _, Result, bail};

use crate::app::files::LockedFolder;
use crate::app::files::job_files::{JobFiles, Replacing};
use crate::app::files::picture_files::{write_small_rgb_png, write_text};
use crate::app::files::result_kind::ResultKind;
use crate::app::stages::progress::Progress;
use crate::app::talk;
use canvas::{bitmap, svg};
use family::Chart;
use lab::Lab;
use measured::{Measured, made_from, to_csv};

/// A request to measure charts.
#[derive(Debug, Clone)]
pub struct ChartRequest {
    /// Where they go.
    pub out: PathBuf,
    /// These alone, by name or by family; none: all.
    pub only: Vec<String>,
    /// Fewer rounds, for a look.
    pub quick: bool,
    /// A folder with more recordings.
    pub sessions: Option<PathBuf>,
    /// Part of the graphics adapter's name.
    pub adapter: Option<String>,
    /// What the files may take the place of.
    pub replacing: Replacing,
}

/// Folders of the project that charts are made from.
const INPUTS: [&str; 4] = ["config", "models", "recordings", "tests"];

/// Where measurements wait below the charts' folder.
const MEASURED: &str = ".measured";

/// A chart whose kind of rows is nobody else's business.
trait AnyChart {
    fn name(&self) -> &'static str;
    fn family(&self) -> &'static str;
    fn shows(&self) -> &'static str;
    fn unit_count(&self, lab: &Lab<'_>) -> Result<usize>;
    /// Whether it was made to its end.
    fn make(&self, lab: &Lab<'_>, out: &Path, progress: &Progress) -> Result<bool>;
}

/// All charts, in the order in which they are made and read.
fn all() -> [Box<dyn AnyChart>; 16] {
    [
        Box::new(tracking::Tracking),
        Box::new(footage::Footage),
        Box::new(shadows::Shadows),
        Box::new(environment::EnvironmentChart),
        Box::new(environment_pictures::EnvironmentPictures),
        Box::new(pictures::ShadowPictures),
        Box::new(pictures::SourcePictures),
        Box::new(moved::Moved),
        Box::new(compositing::Compositing),
        Box::new(left_out::LeftOut),
        Box::new(shaft_settings::ShaftSettingsChart),
        Box::new(scaling::Scaling),
        Box::new(stability::Stability),
        Box::new(displacement::Displacement),
        Box::new(wrong_pose::WrongPose),
        Box::new(marker_view::MarkerView),
    ]
}

/// What `--only` may name.
pub fn names() -> Vec<&'static str> {
    let mut names = Vec::new();
    for name in all()
        .iter()
        .flat_map(|chart| [chart.family(), chart.name()])
    {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

/// Measures and draws. What has been measured is kept when `stop` ends it, and not measured again.
///
/// # Errors
/// A name that no chart has, an interrupt, or whatever keeps a chart from being measured or written.
pub fn chart(request: &ChartRequest, stop: &AtomicBool) -> Result<String> {
    let wanted = |chart: &dyn AnyChart| {
        let names = [chart.name(), chart.family()];
        request.only.is_empty()
            || request
                .only
                .iter()
                .any(|only| names.contains(&only.as_str()))
    };
    if let Some(unknown) = request
        .only
        .iter()
        .find(|only| !names().contains(&only.as_str()))
    {
        bail!(
            "--only {unknown}: no such chart; allowed: {}",
            names().join(", ")
        );
    }
    let lab = Lab::new(
        request.quick,
        request.sessions.clone(),
        request.adapter.clone(),
        stop,
    )?;
    let charts = all();
    let charts: Vec<_> = charts
        .iter()
        .filter(|chart| wanted(chart.as_ref()))
        .collect();
    let names = charts.iter().map(|chart| chart.name());
    files_of(request, names).check()?;
    let counts: Result<Vec<usize>> = charts.iter().map(|chart| chart.unit_count(&lab)).collect();
    let count = counts?.into_iter().sum();
    let measured = request.out.join(MEASURED);
    let _this_run_s = std::fs::create_dir_all(&measured)
        .and_then(|()| LockedFolder::open(&measured))
        .with_context(|| measured.display().to_string())?;
    let progress = Progress::of_measurements(count);
    for chart in &charts {
        let done = chart.make(&lab, &request.out, &progress);
        if !matches!(done, Ok(true)) {
            progress.finish();
        }
        if !done? {
            bail!("interrupted; what was measured until then is kept, run it again to go on");
        }
    }
    progress.finish();
    write_text(&request.out.join("README.md"), &readme(&request.out))?;
    Ok(format!(
        "{} in {}",
        talk::counted(charts.len(), "chart"),
        request.out.display()
    ))
}

/// What charts of these names are made from, and the files that they are.
fn files_of(request: &ChartRequest, names: impl Iterator<Item = &'static str>) -> JobFiles {
    let mut files = JobFiles::new(request.replacing);
    let folders = INPUTS.iter().map(Path::new);
    for folder in folders.chain(request.sessions.as_deref()) {
        files.reads(folder);
    }
    let mut writes = |name: String, kind| files.writes("--out", &request.out.join(name), kind);
    writes("README.md".to_owned(), ResultKind::ChartsPage);
    for name in names {
        writes(format!("{name}.csv"), ResultKind::Table);
        writes(format!("{name}.svg"), ResultKind::ChartDrawing);
        writes(format!("{name}.png"), ResultKind::ChartPicture);
        writes(format!("{MEASURED}/{name}.csv"), ResultKind::Measurements);
    }
    files
}

impl<C: Chart> AnyChart for C {
    fn name(&self) -> &'static str {
        C::NAME
    }

    fn family(&self) -> &'static str {
        C::FAMILY
    }

    fn shows(&self) -> &'static str {
        C::SHOWS
    }

    fn unit_count(&self, lab: &Lab<'_>) -> Result<usize> {
        Ok(self.units(lab)?.len())
    }

    fn make(&self, lab: &Lab<'_>, out: &Path, progress: &Progress) -> Result<bool> {
        let settings = (lab.program, lab.quick, &lab.adapter);
        let from = made_from(&settings, &self.inputs(lab)?)?;
        let file = out.join(MEASURED).join(format!("{}.csv", C::NAME));
        let mut measured = Measured::open(&file, from)?;
        let units = self.units(lab)?;
        for unit in &units {
            progress.tell(&format!("{}: {unit}", C::NAME));
            if !measured.has(unit) {
                let Some(rows) = self.measure(lab, unit)? else {
                    return Ok(false);
                };
                measured.add(unit, &rows)?;
            }
            progress.advance();
        }
        let rows: Vec<C::Row> = measured.rows(&units)?;
        let figure = self.figure(&rows);
        let file = |extension: &str| out.join(format!("{}.{extension}", C::NAME));
        write_text(&file("csv"), &to_csv(&rows, true)?)?;
        write_text(&file("svg"), &svg(&figure)?)?;
        let (size_px, rgba) = bitmap(&figure)?;
        write_small_rgb_png(&file("png"), size_px, &rgba)?;
        Ok(true)
    }
}

/// What each chart that is there shows, and how it is made.
fn readme(out: &Path) -> String {
    let mut text = String::from(
        "# Charts: speed against accuracy\n\
         Made by `gnomon chart`, all of them; `--only NAME` makes one, `--quick` takes fewer rounds, frames and \
         settings. Each has its figures beside it as CSV. Times are those of the machine that made them and change \
         with it; their ratios hold better, as all that is compared is timed in turn. Errors hold on any machine.\n",
    );
    for chart in all() {
        let name = chart.name();
        if !out.join(format!("{name}.png")).is_file() {
            continue;
        }
        let shows = chart.shows();
        text += &format!("\n## {name}\n![{name}]({name}.png)\n\n{shows}\n\n");
        if out.join(format!("{name}.csv")).is_file() {
            let svg = match out.join(format!("{name}.svg")).is_file() {
                true => format!(", also as [{name}.svg]({name}.svg)"),
                false => String::new(),
            };
            text += &format!("Figures: [{name}.csv]({name}.csv){svg}. ");
        }
        text += &format!("Made by `gnomon chart --only {name}`.\n");
    }
    text
}
