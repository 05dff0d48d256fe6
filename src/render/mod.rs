//! Draws a frame: the GPU side of the pipeline.
