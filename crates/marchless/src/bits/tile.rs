//! 8 × 8 × 8 bits in one cache line.
