//! Dilation, erosion, opening, closing.
