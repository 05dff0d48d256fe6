//! Places on the measured front of speed against accuracy.

choices! {
    /// A place on the measured front of speed against accuracy (`charts/shadows.csv`).
    pub enum Quality, "quality" {
        /// The least time at which no shadow is visibly elsewhere.
        Fast = "fast",
        /// Smooth outlines; things as coarse as no eye can see.
        Balanced = "balanced",
        /// Nothing is left out.
        Accurate = "accurate",
    }
}
