//! Why a live source gives no pictures, and what to do about it.

use super::format::Offer;
use crate::capture::CaptureError;

/// Why a live source cannot be opened or gives no pictures any more.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// The machine has no camera.
    #[error("{wanted}: there is no camera: {reason}")]
    NoCamera {
        /// As it was asked for.
        wanted: String,
        /// What was looked at, and what to do.
        reason: &'static str,
    },
    /// The machine has cameras, but not this one.
    #[error("{wanted}: no such camera; there {}", in_words(found))]
    NotThisCamera {
        /// As it was asked for.
        wanted: String,
        /// The cameras that are there.
        found: Vec<String>,
    },
    /// A part of a name that several different cameras share.
    #[error(
        "{wanted}: several cameras have this in their names; there {}",
        in_words(found)
    )]
    Ambiguous {
        /// As it was asked for.
        wanted: String,
        /// The cameras that it fits.
        found: Vec<String>,
    },
    /// The system does not let this user open it.
    #[error(
        "{camera}: permission denied; add yourself to the group that owns it (Debian: sudo usermod -aG video $USER) and \
         log in again"
    )]
    Denied {
        /// The camera.
        camera: String,
    },
    /// Another program has it.
    #[error(
        "{camera}: busy; close the other program that uses the camera (fuser -v /dev/video* names it)"
    )]
    Busy {
        /// The camera.
        camera: String,
    },
    /// It offers nothing that was asked for, or nothing that can be decoded.
    #[error(
        "{camera}: cannot give {wanted}; it offers {}",
        offers_in_words(offers, unknown)
    )]
    NoFormat {
        /// The camera.
        camera: String,
        /// What was asked for, in words.
        wanted: String,
        /// What it has.
        offers: Vec<Offer>,
        /// What it has besides, in formats that are not read: the camera's own names of them.
        unknown: Vec<String>,
    },
    /// The camera's driver refuses, or the camera has gone.
    #[error("{camera}: {message}")]
    Camera {
        /// The camera.
        camera: String,
        /// What the driver says.
        message: String,
    },
    /// Picture after picture cannot be decoded.
    #[error("{camera}: {count} pictures in a row cannot be decoded")]
    Unreadable {
        /// The camera.
        camera: String,
        /// How many.
        count: u32,
    },
    /// The address does not answer, or with no video.
    #[error(
        "{address}: no video comes from there; is the address right (a phone's camera app shows its own), and is the \
         camera on, in the same network?"
    )]
    NoStream {
        /// The address.
        address: String,
    },
    /// The stream has stopped.
    #[error("{address}: the stream has stopped")]
    StreamStopped {
        /// The address.
        address: String,
    },
    /// The stream goes on with pictures of another size.
    #[error(
        "{address}: its pictures are {} x {} from here on, they were {} x {}",
        size_px[0], size_px[1], before_px[0], before_px[1]
    )]
    StreamResized {
        /// The address.
        address: String,
        /// Width and height of the picture at hand.
        size_px: [u32; 2],
        /// Width and height of those before.
        before_px: [u32; 2],
    },
    /// A recording that is to be played cannot be.
    #[error(transparent)]
    Recording(#[from] CaptureError),
    /// It is open, but no picture comes.
    #[error("{source_name}: no picture for {silence_secs:.0} s (unplugged, or switched off?)")]
    Silent {
        /// The source.
        source_name: String,
        /// For how long, seconds.
        silence_secs: f64,
    },
    /// The thread that reads the source is gone.
    #[error("{source_name}: reading it has failed")]
    ReaderGone {
        /// The source.
        source_name: String,
    },
}

fn in_words(found: &[String]) -> String {
    match found {
        [one] => format!("is {one}"),
        several => format!("are {}", several.join(", ")),
    }
}

fn offers_in_words(offers: &[Offer], unknown: &[String]) -> String {
    if !unknown.is_empty() {
        let known: Vec<String> = offers.iter().map(ToString::to_string).collect();
        let unread = format!("{}, which gnomon does not read", unknown.join(", "));
        return [known, vec![unread]].concat().join(", ");
    }
    if offers.is_empty() {
        return "no format that gnomon reads (it may be the second device of a camera: try the number before)".to_owned();
    }
    let offers: Vec<String> = offers.iter().map(ToString::to_string).collect();
    offers.join(", ")
}
