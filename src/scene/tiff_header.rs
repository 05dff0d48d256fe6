//! The first directory of a TIFF file: decoders reserve memory for as many values as an entry says that it has, and turn pictures.

/// The tag of how the camera was held (TIFF 6.0, section 8).
const ORIENTATION: u64 = 0x112;

/// The tag of what a picture is to the others of its file (TIFF 6.0, section 8)…
const KIND: u64 = 0xfe;
/// …of which this bit says that it is a smaller copy of another, and this one that it is a mask.
const COPY_OR_MASK: u64 = 1 | 4;

/// Where a directory's entries are.
struct Directory {
    is_little: bool,
    /// Of the first entry.
    at: u64,
    entries: u64,
    entry_size: u64,
    /// Bytes of a count and of an offset.
    wide: u64,
    /// Where the next directory is; 0 after the last.
    next: u64,
}

impl Directory {
    /// `None` where there is none, or it is no TIFF.
    fn of(bytes: &[u8]) -> Option<Self> {
        let is_little = match bytes.get(..2) {
            Some(b"II") => true,
            Some(b"MM") => false,
            _ => return None,
        };
        // (Where the directory's offset stands, its width, that of the number of entries, and an entry's size.)
        let (offset_at, wide, count_width, entry_size) = match number(bytes, is_little, 2, 2) {
            Some(42) => (4, 4, 2, 12),
            Some(43) => (8, 8, 8, 20),
            _ => return None,
        };
        let first = number(bytes, is_little, offset_at, wide)?;
        let unread = Self {
            is_little,
            at: 0,
            entries: 0,
            entry_size,
            wide,
            next: first,
        };
        Some(unread.following(bytes, count_width))
    }

    /// The next directory.
    fn following(&self, bytes: &[u8], count_width: u64) -> Self {
        let entries = number(bytes, self.is_little, self.next, count_width).unwrap_or(0);
        // (Entries beyond the end of the file are none.)
        let entries = entries.min(bytes.len() as u64 / self.entry_size);
        let at = self.next.saturating_add(count_width);
        let end = at.saturating_add(entries.saturating_mul(self.entry_size));
        Self {
            at,
            entries,
            next: number(bytes, self.is_little, end, self.wide).unwrap_or(0),
            ..*self
        }
    }

    /// The first value of a tag that is among the first and has short or long ones.
    fn value(&self, bytes: &[u8], tag: u64) -> Option<u64> {
        const SHORT: u64 = 3;
        const FIRST_FEW: usize = 4;
        let number = |at: u64, width: u64| number(bytes, self.is_little, at, width);
        // (Tags increase.)
        let mut places = self.places().take(FIRST_FEW);
        let entry = places.find(|&entry| number(entry, 2) == Some(tag))?;
        let width = match number(entry + 2, 2)? {
            SHORT => 2,
            _ => 4,
        };
        number(entry + 4 + self.wide, width)
    }

    /// Where each entry begins.
    fn places(&self) -> impl Iterator<Item = u64> {
        (0..self.entries).map(|entry| {
            self.at
                .saturating_add(entry.saturating_mul(self.entry_size))
        })
    }
}

fn number(bytes: &[u8], is_little: bool, at: u64, width: u64) -> Option<u64> {
    let at = usize::try_from(at).ok()?;
    let digits = bytes.get(at..)?.get(..width as usize)?;
    let add = |sum: u64, digit: &u8| sum << 8 | u64::from(*digit);
    Some(match is_little {
        true => digits.iter().rev().fold(0, add),
        false => digits.iter().fold(0, add),
    })
}

/// How many pictures a file holds, smaller copies and masks of others not counted.
pub fn pictures(bytes: &[u8]) -> u32 {
    /// Directories may go round in a circle.
    const MOST: usize = 10_000;
    let count_width = |directory: &Directory| if directory.wide == 8 { 8 } else { 2 };
    let directories = std::iter::successors(Directory::of(bytes), |directory| {
        let more = directory.next != 0 && directory.entries > 0;
        more.then(|| directory.following(bytes, count_width(directory)))
    });
    let is_picture = |directory: &Directory| {
        let kind = directory.value(bytes, KIND).unwrap_or(0);
        directory.entries > 0 && kind & COPY_OR_MASK == 0
    };
    directories.take(MOST).filter(is_picture).count() as u32
}

/// Whether no entry of the first directory has more values than its file has bytes; so with all that is no TIFF.
pub fn counts_fit(bytes: &[u8]) -> bool {
    let most = bytes.len() as u64;
    Directory::of(bytes).is_none_or(|directory| {
        directory.places().all(|at| {
            number(
                bytes,
                directory.is_little,
                at.saturating_add(4),
                directory.wide,
            )
            .is_none_or(|count| count <= most)
        })
    })
}

/// Says in place of how the camera was held that the picture is as it is shown.
pub fn forget_orientation(bytes: &mut [u8]) {
    let Some(directory) = Directory::of(bytes) else {
        return;
    };
    let is_little = directory.is_little;
    for at in directory.places() {
        if number(bytes, is_little, at, 2) != Some(ORIENTATION) {
            continue;
        }
        // A short integer, in the first bytes of the room for a value.
        let value_at = usize::try_from(at.saturating_add(4).saturating_add(directory.wide));
        let value = value_at
            .ok()
            .and_then(|at| bytes.get_mut(at..)?.get_mut(..2));
        if let Some(value) = value {
            let as_shown = 1_u16;
            value.copy_from_slice(&match is_little {
                true => as_shown.to_le_bytes(),
                false => as_shown.to_be_bytes(),
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tiff() -> Vec<u8> {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let picture = image::DynamicImage::new_rgb8(3, 2);
        picture
            .write_to(&mut bytes, image::ImageFormat::Tiff)
            .unwrap();
        bytes.into_inner()
    }

    /// A file of empty directories that say what they are, the last of which names the first as the next one.
    #[test]
    fn pictures_are_counted_without_copies_masks_and_circles() {
        let file = |kinds: &[u16], last: u32| {
            let mut bytes = b"II*\0\x08\0\0\0".to_vec();
            for (k, kind) in (1..).zip(kinds) {
                let next = if k == kinds.len() as u32 {
                    last
                } else {
                    8 + 18 * k
                };
                bytes.extend([1, 0, 0xfe, 0, 3, 0, 1, 0, 0, 0]);
                bytes.extend(u32::from(*kind).to_le_bytes());
                bytes.extend(next.to_le_bytes());
            }
            bytes
        };
        assert_eq!(pictures(&tiff()), 1);
        assert_eq!(pictures(&file(&[0, 2, 2], 0)), 3);
        assert_eq!(pictures(&file(&[0, 1, 4, 2], 0)), 2);
        assert_eq!(pictures(&file(&[1, 1], 8)), 0);
        assert_eq!(pictures(&file(&[0, 0], 9999)), 2);
        assert_eq!(pictures(b"P6 1 1"), 0);
    }

    #[test]
    fn an_entry_with_more_values_than_bytes_is_a_lie() {
        let honest = tiff();
        assert!(
            counts_fit(&honest) && counts_fit(b"") && counts_fit(b"II*\0") && counts_fit(b"P6 1 1")
        );
        let directory = u32::from_le_bytes(honest[4..8].try_into().unwrap()) as usize;
        let entries = usize::from(u16::from_le_bytes([
            honest[directory],
            honest[directory + 1],
        ]));
        assert!(entries > 5);
        for entry in 0..entries {
            let mut lying = honest.clone();
            let at = directory + 2 + 12 * entry + 4;
            lying[at..at + 4].copy_from_slice(&0x80_0000_u32.to_le_bytes());
            assert!(!counts_fit(&lying), "{entry}");
        }
        // BigTIFF, and Motorola's order.
        for count in [1_u64, 1 << 40] {
            let mut big = b"MM\0\x2b\0\x08\0\0".to_vec();
            big.extend(16_u64.to_be_bytes());
            big.extend(1_u64.to_be_bytes());
            big.extend([1, 0, 0, 3]);
            big.extend(count.to_be_bytes());
            big.extend([0; 8]);
            assert_eq!(counts_fit(&big), count == 1);
        }
    }
}
