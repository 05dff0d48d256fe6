//! Webcams: which one is meant, and what is done about its broken pictures.

use nokhwa::utils::{ApiBackend, CameraInfo};

use super::decode::{Tolerance, rgba_of};
use super::device::{self, Device};
use super::error::LiveError;
use super::feed::{Feed, Link, LivePicture, Opened, Opener};
use super::format::{self, Offer};
use crate::scene::{PixelFormat, WantedFormat};

/// Broken pictures in a row after which a camera's JPEGs are read less strictly, or else it is opened anew.
const BROKEN_IN_A_ROW: u32 = 30;
/// Cameras open their eyes slowly, and slow down to a few pictures per second in the dark.
const PATIENCE_SECS: f64 = 3.0;

/// A camera that the system knows.
#[derive(Debug)]
pub struct ListedCamera {
    /// What `webcam:N` calls it.
    pub number: u32,
    /// The camera's own name.
    pub name: String,
    /// The camera's formats, or why they cannot be told.
    pub offers: Result<Vec<Offer>, LiveError>,
}

/// All cameras, by their numbers.
///
/// # Errors
/// There is none.
pub fn list_cameras() -> Result<Vec<ListedCamera>, LiveError> {
    Ok(known("cameras")?
        .into_iter()
        .map(|KnownDevice { number, name }| {
            let label = label_of(number, &name);
            let offers = look_at_device(number, &label)
                .and_then(|()| device::offered(number, &label))
                .map(|offered| offered.offers);
            ListedCamera {
                number,
                name,
                offers,
            }
        })
        .collect())
}

/// Opens a webcam by its number or a part of its name.
pub(super) struct WebcamOpener {
    /// As the user names it.
    pub source_name: String,
    /// What follows `webcam:` or `/dev/video`.
    pub wanted_camera: String,
    pub wanted: WantedFormat,
}

impl Opener for WebcamOpener {
    fn source_name(&self) -> &str {
        &self.source_name
    }

    fn patience_secs(&self) -> Option<f64> {
        Some(PATIENCE_SECS)
    }

    fn open(&self, again: Option<&str>, link: &Link) -> Result<Box<dyn Feed>, LiveError> {
        let mut refusal = None;
        for KnownDevice { number, name } in self.candidates(again)? {
            match WebcamFeed::open(number, &name, &self.wanted, link) {
                Ok(feed) => return Ok(Box::new(feed)),
                // Many cameras have a second device, of the same name, that gives no pictures.
                Err(error) => refusal = refusal.or(Some(error)),
            }
        }
        Err(refusal.unwrap_or_else(|| LiveError::ReaderGone {
            source_name: self.source_name.clone(),
        }))
    }
}

impl WebcamOpener {
    /// The cameras that are meant, the likeliest first; at least one.
    fn candidates(&self, again: Option<&str>) -> Result<Vec<KnownDevice>, LiveError> {
        let known = known(&self.source_name)?;
        pick(&known, &self.wanted_camera, again)
            .map(|picked| picked.into_iter().cloned().collect())
            .map_err(|ambiguous| {
                let found = |known: &KnownDevice| label_of(known.number, &known.name);
                let wanted = self.source_name.clone();
                if ambiguous.is_empty() {
                    let found = known.iter().map(found).collect();
                    LiveError::NotThisCamera { wanted, found }
                } else {
                    let found = ambiguous.into_iter().map(found).collect();
                    LiveError::Ambiguous { wanted, found }
                }
            })
    }
}

#[derive(Debug, Clone, PartialEq)]
struct KnownDevice {
    number: u32,
    name: String,
}

/// Those of the known cameras that are meant by a number or a part of a name; all of one name. Again, a camera is known
/// by its name: it comes back under another number where its own is still taken.
///
/// # Errors
/// None, or those of several names.
fn pick<'a>(
    known: &'a [KnownDevice],
    wanted: &str,
    again: Option<&str>,
) -> Result<Vec<&'a KnownDevice>, Vec<&'a KnownDevice>> {
    let number: Option<u32> = wanted.parse().ok();
    if let Some(name) = again {
        let mut same: Vec<&KnownDevice> = known.iter().filter(|known| known.name == name).collect();
        same.sort_by_key(|known| (Some(known.number) != number, known.number));
        return if same.is_empty() { Err(same) } else { Ok(same) };
    }
    if number.is_some() {
        let one: Vec<&KnownDevice> = known
            .iter()
            .filter(|known| Some(known.number) == number)
            .collect();
        return if one.is_empty() { Err(one) } else { Ok(one) };
    }
    let part = wanted.trim().to_lowercase();
    let mut named: Vec<&KnownDevice> = known
        .iter()
        .filter(|known| known.name.to_lowercase().contains(&part))
        .collect();
    if let Some(whole) = named.iter().find(|known| known.name.to_lowercase() == part) {
        let name = whole.name.clone();
        named.retain(|known| known.name == name);
    }
    let one_name = named.windows(2).all(|pair| pair[0].name == pair[1].name);
    if named.is_empty() || !one_name {
        Err(named)
    } else {
        Ok(named)
    }
}

fn label_of(number: u32, name: &str) -> String {
    format!("webcam:{number} ({name})")
}

/// What the system lists; `wanted` is for the message.
fn known(wanted: &str) -> Result<Vec<KnownDevice>, LiveError> {
    let listed = nokhwa::query(ApiBackend::Auto).map_err(|error| LiveError::Camera {
        camera: wanted.to_owned(),
        message: error.to_string(),
    })?;
    let known = |info: &CameraInfo| {
        let number = info.index().as_index().ok()?;
        let name = info.human_name();
        Some(KnownDevice { number, name })
    };
    let mut known: Vec<KnownDevice> = listed.iter().filter_map(known).collect();
    known.sort_by_key(|known| known.number);
    if known.is_empty() {
        let reason = if cfg!(target_os = "linux") {
            "the system has no /dev/video*; plug one in, or on a virtual machine or in a container pass it on (dmesg tells \
             what happens as it is plugged in)"
        } else {
            "the system lists none; plug one in, and allow programs to use it in the system's privacy settings"
        };
        return Err(LiveError::NoCamera {
            wanted: wanted.to_owned(),
            reason,
        });
    }
    Ok(known)
}

/// A camera that sends pictures.
struct WebcamFeed {
    device: Device,
    name: String,
    label: String,
    offer: Offer,
    tolerance: Tolerance,
    broken_in_a_row: u32,
    link: Link,
}

impl WebcamFeed {
    fn open(
        number: u32,
        name: &str,
        wanted: &WantedFormat,
        link: &Link,
    ) -> Result<Self, LiveError> {
        let label = label_of(number, name);
        look_at_device(number, &label)?;
        let offered = device::offered(number, &label)?;
        let offer = format::choose(&offered.offers, wanted).ok_or_else(|| LiveError::NoFormat {
            camera: label.clone(),
            wanted: format::in_words(wanted),
            offers: offered.offers,
            unknown: offered.unknown,
        })?;
        Ok(Self {
            device: Device::open(number, offer, &label)?,
            name: name.to_owned(),
            label,
            offer,
            tolerance: Tolerance::Strict,
            broken_in_a_row: 0,
            link: link.clone(),
        })
    }

    /// Counts a picture that cannot be decoded.
    fn bear_broken(&mut self) -> Result<(), LiveError> {
        self.link.count_broken_picture();
        self.broken_in_a_row += 1;
        if self.broken_in_a_row < BROKEN_IN_A_ROW {
            return Ok(());
        }
        if self.tolerance == Tolerance::Strict && self.offer.pixels == PixelFormat::Mjpeg {
            self.tolerance = Tolerance::Lenient;
            self.broken_in_a_row = 0;
            return Ok(());
        }
        Err(LiveError::Unreadable {
            camera: self.label.clone(),
            count: self.broken_in_a_row,
        })
    }
}

impl Feed for WebcamFeed {
    fn opened(&self) -> Opened {
        Opened {
            name: self.name.clone(),
            format: self.offer.to_string(),
            fps: Some(f64::from(self.offer.fps)),
        }
    }

    fn next_picture(&mut self) -> Result<Option<LivePicture>, LiveError> {
        loop {
            let mut time_secs = 0.0;
            let (link, tolerance) = (&self.link, self.tolerance);
            let decoded = self.device.next(&self.label, |picture| {
                time_secs = link.now_secs();
                rgba_of(picture, tolerance)
            })?;
            if let Some((size_px, rgba)) = decoded {
                self.broken_in_a_row = 0;
                return Ok(Some(LivePicture {
                    index: None,
                    time_secs,
                    size_px,
                    rgba,
                }));
            }
            self.bear_broken()?;
        }
    }
}

/// Asks the system itself where it can tell more than a library, which has texts alone.
#[cfg(target_os = "linux")]
fn look_at_device(number: u32, label: &str) -> Result<(), LiveError> {
    let device = format!("/dev/video{number}");
    let opened = std::fs::OpenOptions::new()
        .read(true)
        .write(true)
        .open(&device);
    match opened {
        Err(error) if error.kind() == std::io::ErrorKind::PermissionDenied => {
            Err(LiveError::Denied {
                camera: format!("{label}, {device}"),
            })
        }
        Err(error) if error.kind() == std::io::ErrorKind::ResourceBusy => Err(LiveError::Busy {
            camera: label.to_owned(),
        }),
        Err(error) => Err(LiveError::Camera {
            camera: label.to_owned(),
            message: format!("{device}: {error}"),
        }),
        Ok(_) => Ok(()),
    }
}

#[cfg(not(target_os = "linux"))]
fn look_at_device(_: u32, _: &str) -> Result<(), LiveError> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cameras(names: &[(u32, &str)]) -> Vec<KnownDevice> {
        names
            .iter()
            .map(|&(number, name)| KnownDevice {
                number,
                name: name.to_owned(),
            })
            .collect()
    }

    fn numbers(picked: Vec<&KnownDevice>) -> Vec<u32> {
        picked.into_iter().map(|known| known.number).collect()
    }

    #[test]
    fn a_camera_is_picked_by_number_or_name() {
        let known = cameras(&[
            (0, "Integrated Camera"),
            (1, "Integrated Camera"),
            (2, "HD Pro Webcam C920"),
            (4, "HD Pro Webcam C920 II"),
        ]);
        let by = |wanted: &str| pick(&known, wanted, None).map(numbers).map_err(numbers);
        assert_eq!(by("2"), Ok(vec![2]));
        assert_eq!(by("3"), Err(vec![]));
        assert_eq!(by("integrated"), Ok(vec![0, 1]));
        assert_eq!(by("hd pro webcam c920"), Ok(vec![2]), "the whole name");
        assert_eq!(by("C920"), Err(vec![2, 4]), "two cameras");
        assert_eq!(by("front"), Err(vec![]));
    }

    #[test]
    fn a_camera_that_comes_back_is_known_by_its_name() {
        let known = cameras(&[(0, "Other"), (1, "Mine"), (2, "Mine")]);
        let again = |wanted: &str| pick(&known, wanted, Some("Mine")).map(numbers);
        assert_eq!(again("0"), Ok(vec![1, 2]), "its number is another's now");
        assert_eq!(again("2"), Ok(vec![2, 1]));
        assert!(pick(&known, "0", Some("Gone")).is_err());
    }
}
