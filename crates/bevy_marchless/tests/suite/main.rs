//! Tests of the plugin's public API, in one binary: each binary that links Bevy takes seconds and a hundred megabytes.
//!
//! A process has one log, so tests that read it are separate binaries.

mod common;

mod bad_stamps;
#[cfg(feature = "big_space")]
mod big_space;
mod bits;
mod chunk_components;
mod chunk_samples;
mod chunk_visibility;
mod clones;
mod closed;
mod despawn;
mod diagnostics;
mod disabled;
mod edit;
mod extent;
mod far_apart_digs;
mod far_stamps;
#[cfg(all(feature = "terrain_files", feature = "noise", feature = "png"))]
mod file_follow;
#[cfg(all(feature = "terrain_files", feature = "noise", feature = "png"))]
mod file_text;
mod fixed_update;
#[cfg(feature = "gizmos")]
mod gizmos;
mod hierarchy;
mod isovalue;
mod levels;
mod many;
#[cfg(feature = "pbr")]
mod materials;
mod mesh_usages;
mod mesher;
mod meshes;
mod observers;
mod parts;
mod pause;
mod query;
mod query_hidden;
mod query_lengths;
mod query_near;
mod query_transforms;
mod reflection;
mod running_task;
mod same_samples;
mod same_samples_anywhere;
mod sample_radius_settings;
#[cfg(all(feature = "serde", feature = "noise"))]
mod scenes;
mod settings;
mod settings_again;
mod settings_sweep;
#[cfg(all(feature = "noise", feature = "png"))]
mod source_bounds;
#[cfg(feature = "noise")]
mod source_calls;
#[cfg(feature = "png")]
mod source_height_map;
#[cfg(feature = "noise")]
mod source_landscape;
#[cfg(all(feature = "noise", feature = "png"))]
mod source_levels;
mod stream;
mod stream_bad_input;
mod stream_corners;
#[cfg(feature = "noise")]
mod stream_counts;
mod stream_cover;
mod stream_edits;
#[cfg(feature = "noise")]
mod stream_margin;
mod stream_soak;
mod stroke;
mod two_apps;
mod virtual_time;
mod without_assets;
