//! The report: the fields and the tables, printed, and recorded on request.

use std::{env, fs, io, path::Path};

use crate::{
    fields::{Field, Kind},
    tally::{Tally, fields_table, kinds_table, totals_table},
};

/// Prints the tables, and writes them to `record/` if `MARCHLESS_RECORD=1`.
pub(crate) fn report(fields: &[Field], tallies: &[Tally]) -> io::Result<()> {
    let report = text(fields, tallies);
    println!("\n{report}");
    if env::var_os("MARCHLESS_RECORD").is_none_or(|value| value != "1") {
        return Ok(());
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("record");
    let path = folder.join("soundness.md");
    fs::create_dir_all(&folder)?;
    fs::write(&path, report)?;
    println!("written to {}", path.display());
    Ok(())
}

fn text(fields: &[Field], tallies: &[Tally]) -> String {
    let kinds: String = Kind::ALL.iter().map(|kind| format!("- {}: {}\n", kind.name(), kind.description())).collect();
    format!(
        "# Sound and unsound meshes\n\n\
         {} fields of 8 to 33 samples per axis, {} of each kind, all with a layer outside around them, so that a right \
         mesh is closed; meshed at 0 by marchless {} and its peers, and judged by its `MeshReport`. What asks for \
         gradients (isomesh's dual contouring) gets central differences of the trilinear interpolation. Vertices that \
         isosurface and mcubes do not share were made one where they are at most 1/65536 of a cell apart, since they \
         differ by rounding; the other meshes were judged as they came, in `f32`.\n\n\
         ## Fields with a flaw\n\n\
         In how many of the {0} fields the mesh has any flaw, and each. Open edges are cracks and holes. Zero-area \
         triangles name a vertex twice or have their vertices on one line, exactly; their share is of all triangles of \
         all meshes. Crossing triangles have a point in common that is on no common vertex or edge. No mesh is an \
         error, a panic, or nothing where samples are inside.\n\n{}\n\
         ## Flaws in all fields\n\n{}\n\
         ## Fields with any flaw, by kind\n\n\
         Of {1} each. Columns are numbered in the order of the rows above.\n\n{}\n{kinds}",
        fields.len(),
        fields.len() / Kind::ALL.len(),
        env!("CARGO_PKG_VERSION"),
        fields_table(tallies),
        totals_table(tallies),
        kinds_table(tallies),
    )
}
