//! What a tracker looks for, and what the markers of it look like.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use super::marker_template::MarkerTemplate;
use super::printed_marker::PrintedMarker;
use super::tracked_anchor::TrackedAnchor;
use super::{Detection, TrackingError};
use crate::scene::{Anchor, Family, Marker};

/// What a tracker looks for.
pub(super) enum Wanted {
    /// The anchors that it was given, whose markers' templates are found by anchor and number.
    Anchors(HashMap<(Family, u32), (usize, usize)>),
    /// Each marker of a family, alone; templates are kept of those that were seen.
    EveryMarker {
        family: Family,
        size_m: f64,
        templates: HashMap<u32, MarkerTemplate>,
    },
}

impl Wanted {
    /// The template of a detected marker, if it is wanted.
    pub(super) fn template_of<'a>(
        &'a mut self,
        anchors: &'a [TrackedAnchor],
        detection: &Detection,
    ) -> Result<Option<&'a MarkerTemplate>, TrackingError> {
        Ok(match self {
            Self::Anchors(places) => places
                .get(&(detection.family, detection.id))
                .map(|&(anchor, number)| &anchors[anchor].layout.templates[number]),
            Self::EveryMarker {
                family,
                size_m,
                templates,
            } => Some(match templates.entry(detection.id) {
                Entry::Occupied(entry) => &*entry.into_mut(),
                Entry::Vacant(entry) => {
                    let printed = PrintedMarker::of(*family, detection.id)?;
                    let marker = Marker::alone(*family, detection.id, *size_m);
                    entry.insert(MarkerTemplate::new(&marker, printed))
                }
            }),
        })
    }

    /// The anchors of markers that came by themselves, by their numbers.
    pub(super) fn lone_anchors(&self, ids: impl Iterator<Item = u32>) -> Vec<Anchor> {
        let Self::EveryMarker { family, size_m, .. } = self else {
            return Vec::new();
        };
        let mut counts: HashMap<u32, u32> = HashMap::new();
        ids.map(|id| {
            let count = counts.entry(id).or_default();
            *count += 1;
            let name = match *count {
                1 => id.to_string(),
                count => format!("{id}#{count}"),
            };
            Anchor::lone(name, *family, id, *size_m)
        })
        .collect()
    }
}
