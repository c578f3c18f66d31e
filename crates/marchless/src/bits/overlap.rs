//! What a grid has in common with boxes, balls and other grids.
