//! Tables for reports.

/// A Markdown table with aligned columns. The first row is the head; all rows have the same number of cells.
pub fn aligned(rows: &[impl AsRef<[String]>]) -> String {
    let columns = rows.first().map_or(0, |row| row.as_ref().len());
    let width = |column: usize| rows.iter().map(|row| row.as_ref()[column].chars().count()).max().unwrap_or(0).max(3);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut table = String::new();
    for (index, row) in rows.iter().enumerate() {
        for (cell, &width) in row.as_ref().iter().zip(&widths) {
            table += &format!("| {cell}{} ", " ".repeat(width - cell.chars().count()));
        }
        table += "|\n";
        if index == 0 {
            for width in &widths {
                table += &format!("|{}", "-".repeat(width + 2));
            }
            table += "|\n";
        }
    }
    table
}

/// A time with about three digits.
pub fn duration(seconds: f64) -> String {
    match seconds {
        ..1e-4 => format!("{:.1} µs", seconds * 1e6),
        ..1e-3 => format!("{:.0} µs", seconds * 1e6),
        ..0.1 => format!("{:.2} ms", seconds * 1e3),
        _ => format!("{:.0} ms", seconds * 1e3),
    }
}
