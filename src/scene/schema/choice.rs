//! Words that stand for choices.

/// A choice among a few, each by its word.
pub trait Choice: Copy + PartialEq + Send + Sync + 'static {
    /// What one is called in a message.
    const WHAT: &'static str;
    /// All of them, by the words that files use.
    const WORDS: &'static [(&'static str, Self)];
    /// What each means, in the same order.
    const SAYS: &'static [&'static str];

    /// Its word.
    fn word(self) -> &'static str {
        let found = Self::WORDS.iter().find(|(_, choice)| *choice == self);
        found.map_or("", |(word, _)| word)
    }
}
