//! The pictures of one model, of whatever format, held within one memory: where they would take more, the largest are halved.

use std::sync::Arc;

use super::texture_file::resized;
use crate::light::texture::Texture;

/// Memory that all pictures of a model may take, bytes.
const MOST_BYTES: usize = 1 << 30;

/// Pictures that were read so far, by the numbers that materials know them by.
#[derive(Debug)]
pub struct KeptPictures {
    pictures: Vec<Arc<Texture>>,
    /// What they take together.
    bytes: usize,
    most_bytes: usize,
    is_scaled: bool,
}

impl Default for KeptPictures {
    fn default() -> Self {
        Self::within(MOST_BYTES)
    }
}

impl KeptPictures {
    /// None yet, and so many bytes for all.
    fn within(most_bytes: usize) -> Self {
        Self {
            pictures: Vec::new(),
            bytes: 0,
            most_bytes,
            is_scaled: false,
        }
    }

    /// Keeps a picture; its number.
    pub fn keep(&mut self, picture: Texture) -> u32 {
        let number = self.pictures.len() as u32;
        self.bytes += picture.bytes();
        self.pictures.push(Arc::new(picture));
        while self.bytes > self.most_bytes && self.halve_largest() {
            self.is_scaled = true;
        }
        number
    }

    /// Makes the largest half as wide and high; false where that is a texel already.
    fn halve_largest(&mut self) -> bool {
        let largest = self.pictures.iter_mut().max_by_key(|it| it.bytes());
        let Some(largest) = largest.filter(|largest| largest.size_px != [1, 1]) else {
            return false;
        };
        let smaller = resized(largest, largest.size_px.map(|side| (side / 2).max(1)));
        self.bytes -= largest.bytes() - smaller.bytes();
        *largest = Arc::new(smaller);
        true
    }

    /// The picture of a number that was given.
    pub fn picture(&self, number: u32) -> &Texture {
        &self.pictures[number as usize]
    }

    /// What there is to say of all of them.
    pub fn told(&self) -> Option<String> {
        let most = self.most_bytes >> 20;
        self.is_scaled.then(|| {
            format!("its pictures would take more than {most} MiB: the largest are scaled down")
        })
    }

    /// All of them, in the order of their numbers.
    pub fn into_pictures(self) -> Vec<Arc<Texture>> {
        self.pictures
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain(side: u32, grey: u8) -> Texture {
        Texture {
            name: grey.to_string(),
            size_px: [side; 2],
            rgba: vec![grey; 4 * (side * side) as usize],
        }
    }

    #[test]
    fn what_would_take_too_much_is_halved_and_told() {
        let mut kept = KeptPictures::within(4 << 20);
        for grey in 0..4 {
            assert_eq!(kept.keep(plain(512, grey)), u32::from(grey));
            assert_eq!(kept.told(), None);
        }
        kept.keep(plain(64, 9));
        assert_eq!(
            kept.told().expect("a note"),
            "its pictures would take more than 4 MiB: the largest are scaled down"
        );
        (10..30).for_each(|grey| _ = kept.keep(plain(512, grey)));
        let pictures = kept.into_pictures();
        let bytes: usize = pictures.iter().map(|picture| picture.bytes()).sum();
        assert!(bytes <= 4 << 20 && bytes > 2 << 20, "{bytes}");
        for picture in pictures {
            // What is small stays, and each is what it was.
            assert!(picture.size_px[0] >= if picture.name == "9" { 64 } else { 128 });
            assert!(
                picture
                    .rgba
                    .iter()
                    .all(|part| part.to_string() == picture.name)
            );
        }
    }

    #[test]
    fn a_picture_that_alone_is_too_large_is_scaled_too() {
        let mut kept = KeptPictures::within(100);
        kept.keep(plain(64, 7));
        assert_eq!(kept.picture(0).size_px, [4, 4]);
        // No memory at all leaves a texel of each.
        let mut none = KeptPictures::within(0);
        none.keep(plain(3, 7));
        assert_eq!(none.picture(0).size_px, [1, 1]);
    }
}
