//! The header of a file. The crate `exr` writes custom attributes in random order; sorting them makes equal frames equal in
//! bytes.

/// Sorts the attributes in the header of a single-part file by name. The bytes after the header do not move.
pub(crate) fn sort(file: &mut [u8]) {
    // Magic number and version fill the first eight bytes.
    let first = 8;
    let Some((mut attributes, end)) = attributes(file, first) else { return };
    attributes.sort_unstable();
    let sorted: Vec<u8> = attributes.concat();
    file[first..end].copy_from_slice(&sorted);
}

/// The attributes, each with name, type, length and value, and the offset at which they end.
fn attributes(file: &[u8], first: usize) -> Option<(Vec<Vec<u8>>, usize)> {
    let (mut all, mut at) = (Vec::new(), first);
    while *file.get(at)? != 0 {
        let text = |at: usize| Some(at + file.get(at..)?.iter().position(|byte| *byte == 0)? + 1);
        let length_at = text(text(at)?)?;
        let length = u32::from_le_bytes(file.get(length_at..length_at + 4)?.try_into().ok()?);
        let end = length_at + 4 + length as usize;
        all.push(file.get(at..end)?.to_vec());
        at = end;
    }
    Some((all, at))
}
