//! Tells what the pictures show in place of an anchor that is never found: other ids, families, borders, inks.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::Result;

use crate::capture::Frame;
use crate::scene::{Anchor, Family};
use crate::tracking::Survey;

/// Frames that are surveyed at most: each costs dozens of searches.
const MOST_LOOKS: u32 = 8;

/// A watch for anchors that are never found, which looks for all kinds of markers in a few of the frames without them.
pub(crate) struct Sightings {
    wanted: Vec<Wanted>,
    survey: Option<Survey>,
    frames: u32,
    looks: u32,
    seen: BTreeMap<Family, BTreeSet<u32>>,
    /// Markers of weak families, which one look among several does not prove.
    seen_once: BTreeSet<(Family, u32)>,
    /// Markers that tracking saw and did not believe for want of another picture.
    unconfirmed: BTreeMap<Family, BTreeSet<u32>>,
}

/// Something that is looked for.
struct Wanted {
    /// As it is told of.
    name: String,
    markers: BTreeMap<Family, BTreeSet<u32>>,
    is_found: bool,
}

impl Sightings {
    /// A watch for anchors.
    pub(crate) fn of_anchors(anchors: &[Anchor]) -> Self {
        Self::of(anchors.iter().map(|anchor| {
            let mut markers: BTreeMap<Family, BTreeSet<u32>> = BTreeMap::new();
            for marker in &anchor.markers {
                markers.entry(marker.family).or_default().insert(marker.id);
            }
            Wanted {
                name: format!("\"{}\"", anchor.name),
                markers,
                is_found: false,
            }
        }))
    }

    /// A watch for any marker of a family.
    pub(crate) fn of_family(family: Family) -> Self {
        Self::of([Wanted {
            name: format!("a marker of {family}"),
            markers: BTreeMap::new(),
            is_found: false,
        }])
    }

    fn of(wanted: impl IntoIterator<Item = Wanted>) -> Self {
        Self {
            wanted: wanted.into_iter().collect(),
            survey: None,
            frames: 0,
            looks: 0,
            seen: BTreeMap::new(),
            seen_once: BTreeSet::new(),
            unconfirmed: BTreeMap::new(),
        }
    }

    /// Takes the markers of the frame watched next that are not believed before another one shows them.
    pub(crate) fn note_unconfirmed(&mut self, markers: impl Iterator<Item = (Family, u32)>) {
        for (family, id) in markers {
            self.unconfirmed.entry(family).or_default().insert(id);
        }
    }

    /// Takes a frame and whether it shows what is looked for, each in turn; one watched for that is not told of is not there.
    pub(crate) fn watch(
        &mut self,
        frame: &Frame,
        shown: impl IntoIterator<Item = bool>,
    ) -> Result<()> {
        for (wanted, is_shown) in self.wanted.iter_mut().zip(shown) {
            wanted.is_found |= is_shown;
        }
        self.frames += 1;
        let is_missing = self.wanted.iter().any(|wanted| !wanted.is_found);
        if is_missing && self.looks < MOST_LOOKS && self.frames.is_power_of_two() {
            self.looks += 1;
            let survey = match &mut self.survey {
                Some(survey) => survey,
                none => none.insert(Survey::new()?),
            };
            let looked: BTreeSet<(Family, u32)> = (survey.look(frame)?.into_iter())
                .map(|detection| (detection.family, detection.id))
                .collect();
            for (family, id) in looked {
                let is_strong = family.false_rate(0) < Family::STRONG_RATE;
                if is_strong || !self.seen_once.insert((family, id)) {
                    self.seen.entry(family).or_default().insert(id);
                }
            }
        }
        Ok(())
    }

    /// Whether anything was seen in place of what is looked for.
    pub(crate) fn saw_others(&self) -> bool {
        !self.seen().is_empty()
    }

    /// What is wanted and seen in a single picture, which has no other to confirm it.
    fn seen_unconfirmed(&self) -> Option<String> {
        (self.frames == 1 && !self.unconfirmed.is_empty()).then(|| {
            format!(
                "{} and not believed: so weak a code needs a second picture that shows it",
                are_seen(&self.unconfirmed)
            )
        })
    }

    /// What was seen: in two looks where the code alone proves little, unless there was but one.
    fn seen(&self) -> BTreeMap<Family, BTreeSet<u32>> {
        let mut seen = self.seen.clone();
        if self.looks == 1 {
            for &(family, id) in &self.seen_once {
                seen.entry(family).or_default().insert(id);
            }
        }
        seen
    }

    /// What was never found, and what was seen instead, in words; `None` where all was.
    pub(crate) fn never_found(&self) -> Option<String> {
        let seen = self.seen();
        let unconfirmed = self.seen_unconfirmed();
        // Nobody said that there is any marker where every one is wanted.
        let is_any_seen = unconfirmed.is_some() || self.saw_others();
        let is_told = |wanted: &&Wanted| !wanted.markers.is_empty() || is_any_seen;
        let seen = unconfirmed.unwrap_or_else(|| match seen.is_empty() {
            true => "no marker of any family is seen".to_owned(),
            false => are_seen(&seen),
        });
        let missing = self.wanted.iter().filter(|wanted| !wanted.is_found);
        let missing = missing.filter(is_told);
        let told: Vec<String> = missing
            .map(|wanted| {
                let wants: Vec<String> = wanted.markers.iter().map(in_words).collect();
                let wants = match wants.is_empty() {
                    true => String::new(),
                    false => format!("; the scene wants {}", listed(&wants)),
                };
                format!("{} was never found: {seen}{wants}", wanted.name)
            })
            .collect();
        (!told.is_empty()).then(|| told.join("\n"))
    }
}

/// `tag36h11 0 to 5 and DICT_4X4_50 3 are seen`.
fn are_seen(markers: &BTreeMap<Family, BTreeSet<u32>>) -> String {
    let is_or_are = match markers.values().map(BTreeSet::len).sum() {
        1 => "is",
        _ => "are",
    };
    let markers: Vec<String> = markers.iter().map(in_words).collect();
    format!("{} {is_or_are} seen", listed(&markers))
}

/// `tag36h11 0 to 5 and 17`; of OpenCV's dictionaries, which are parts of each other, the smallest that has them all.
fn in_words((family, ids): (&Family, &BTreeSet<u32>)) -> String {
    let last = ids.last().copied().unwrap_or(0);
    let family = family.smallest_with(last);
    let mut runs: Vec<[u32; 2]> = Vec::new();
    for &id in ids {
        match runs.last_mut() {
            Some(run) if run[1] + 1 == id => run[1] = id,
            _ => runs.push([id, id]),
        }
    }
    let runs: Vec<String> = runs
        .iter()
        .map(|&[first, last]| match last - first {
            0 => first.to_string(),
            1 => format!("{first}, {last}"),
            _ => format!("{first} to {last}"),
        })
        .collect();
    format!("{family} {}", runs.join(", "))
}

/// `a`, `a and b`, `a, b and c`.
fn listed(parts: &[String]) -> String {
    match parts {
        [] => String::new(),
        [only] => only.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_seen_is_told_beside_what_is_wanted() {
        let anchor = |ids: &[u32]| Anchor {
            name: "table".to_owned(),
            markers: ids
                .iter()
                .flat_map(|&id| Anchor::lone(String::new(), Family::TAG36H11, id, 0.04).markers)
                .collect(),
        };
        let mut sightings = Sightings::of_anchors(&[anchor(&[10, 11, 12, 15])]);
        let seen = (Family::TAG36H11, BTreeSet::from([0, 1, 2, 7]));
        sightings.seen.extend([seen]);
        assert_eq!(
            sightings.never_found().as_deref(),
            Some(
                "\"table\" was never found: tag36h11 0 to 2, 7 are seen; the scene wants tag36h11 10 to 12, 15"
            )
        );
        let dictionary = Family::from_name("DICT_4X4_1000").unwrap();
        assert_eq!(
            in_words((&dictionary, &BTreeSet::from([3]))),
            "DICT_4X4_50 3"
        );
        // A weak code in one of several looks proves nothing; in the only one it is told.
        sightings.seen.clear();
        sightings.seen_once.insert((dictionary, 3));
        sightings.looks = 8;
        assert!(!sightings.saw_others());
        sightings.looks = 1;
        assert!(sightings.saw_others());
        // What tracking read in the only picture and could not confirm goes before that.
        sightings.frames = 1;
        sightings.note_unconfirmed([(dictionary, 3)].into_iter());
        let told = sightings.never_found().unwrap();
        assert!(
            told.contains(
                "DICT_4X4_50 3 is seen and not believed: so weak a code needs a second picture"
            ),
            "{told}"
        );
        sightings.wanted[0].is_found = true;
        assert_eq!(sightings.never_found(), None);
    }
}
