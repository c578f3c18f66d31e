//! Filling from seeds through a mask.
