//! More than two materials: several bits for each point.
