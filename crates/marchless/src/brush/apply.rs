//! Applying stamps to samples.
