//! What every chart is: rows that are measured unit by unit, and a figure of them.

use std::path::PathBuf;

use anyhow::Result;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::figure::Figure;
use super::lab::Lab;

/// A chart: a CSV and its picture.
pub trait Chart {
    /// Of its files.
    const NAME: &'static str;
    /// What `--only` calls it and its kin.
    const FAMILY: &'static str;
    /// What it shows, for those who see it.
    const SHOWS: &'static str;
    /// A line of the CSV; fields that are not flat have no place in it.
    type Row: Serialize + DeserializeOwned;

    /// Files and folders that decide what is measured.
    ///
    /// # Errors
    /// One of them is not there.
    fn inputs(&self, lab: &Lab<'_>) -> Result<Vec<PathBuf>>;

    /// What is measured in one go each.
    ///
    /// # Errors
    /// An input is not there.
    fn units(&self, lab: &Lab<'_>) -> Result<Vec<String>>;

    /// Measures one of them; `None` where the lab was stopped.
    ///
    /// # Errors
    /// Whatever keeps it from being measured.
    fn measure(&self, lab: &Lab<'_>, unit: &str) -> Result<Option<Vec<Self::Row>>>;

    /// The picture of all rows.
    fn figure(&self, rows: &[Self::Row]) -> Figure;
}
