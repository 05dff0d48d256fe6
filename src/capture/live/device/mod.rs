//! A camera as the system has it: on Linux straight from its driver, which knows formats and rows that nokhwa does not;
//! elsewhere through nokhwa.

#[cfg_attr(target_os = "linux", path = "v4l2.rs")]
#[cfg_attr(not(target_os = "linux"), path = "through_nokhwa.rs")]
mod system;

pub(super) use system::{Device, offered};

use super::format::Offer;

/// The formats that a camera has.
pub(super) struct Offered {
    /// Those that can be read.
    pub offers: Vec<Offer>,
    /// The camera's own names of the others.
    pub unknown: Vec<String>,
}

impl Offered {
    fn sorted(mut offers: Vec<Offer>, mut unknown: Vec<String>) -> Self {
        offers.sort_by_key(|offer| (offer.pixels.name(), offer.size_px, offer.fps));
        offers.dedup();
        unknown.sort();
        unknown.dedup();
        Self { offers, unknown }
    }
}
