//! One step of a cellular automaton.
