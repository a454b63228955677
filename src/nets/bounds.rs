//! Bounds of the sizes that files may give networks: what no network can have is refused before anything is allocated for it.

use anyhow::ensure;

/// Whether each of a field's `sizes` lies between 1 and `most`.
///
/// # Errors
/// Names the field and the size.
pub(crate) fn sizes(field: &str, sizes: &[i64], most: i64) -> anyhow::Result<()> {
    for &size in sizes {
        ensure!((1..=most).contains(&size), "{field} is {size}, which is not between 1 and {most}");
    }
    Ok(())
}

/// Whether so large a share of units can be dropped.
///
/// # Errors
/// Names the field and the share.
pub(crate) fn dropout(field: &str, share: f64) -> anyhow::Result<()> {
    ensure!((0.0..1.0).contains(&share), "{field} is {share}, which is not a share");
    Ok(())
}
