//! The first directory of a TIFF file, as far as its counts go: decoders reserve memory for as many values as an entry says that
//! it has.

/// Whether no entry of the first directory has more values than its file has bytes; so with all that is no TIFF.
pub fn counts_fit(bytes: &[u8]) -> bool {
    let little = match bytes.get(..2) {
        Some(b"II") => true,
        Some(b"MM") => false,
        _ => return true,
    };
    let number = |at: u64, width: u64| -> Option<u64> {
        let at = usize::try_from(at).ok()?;
        let digits = bytes.get(at..)?.get(..width as usize)?;
        let add = |sum: u64, digit: &u8| sum << 8 | u64::from(*digit);
        Some(match little {
            true => digits.iter().rev().fold(0, add),
            false => digits.iter().fold(0, add),
        })
    };
    // (Where the directory's offset stands, its width, that of the number of entries, and an entry's size.)
    let (offset_at, wide, count_width, entry_size) = match number(2, 2) {
        Some(42) => (4, 4, 2, 12),
        Some(43) => (8, 8, 8, 20),
        _ => return true,
    };
    let Some(directory) = number(offset_at, wide) else {
        return true;
    };
    let entries = number(directory, count_width).unwrap_or(0);
    let most = bytes.len() as u64;
    let fits = |entry: u64| {
        let at = directory
            .saturating_add(count_width)
            .saturating_add(entry.saturating_mul(entry_size));
        number(at.saturating_add(4), wide).is_none_or(|count| count <= most)
    };
    // (Entries beyond the end of the file are none.)
    (0..entries.min(most / entry_size)).all(fits)
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
