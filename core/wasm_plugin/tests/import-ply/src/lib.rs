//! Importer of PLY, ASCII and binary: the positions and normals of vertices, and faces. Compiled into a program or to WebAssembly, and
//! measured against itself in both forms.

use choreo_plugin::asset::Asset;
use choreo_plugin::{
    AssetBuilder, Binary, BinaryError, Files, ImportError, ImportOptions, ImportScope, Importer, Manifest,
    MeshData, Source, TextNumbers,
};
use std::sync::LazyLock;

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("ply", "1.0.0", "Stanford polygons: vertices with normals, and faces")
        .extensions(["ply"])
        .magic(b"ply\n")
        .number("scale", "metres per file unit", 1.0, 1e-6..=1e6)
});

#[derive(Clone, Copy, Debug, Default)]
pub struct PlyImporter;

choreo_plugin::wasm_importer!(PlyImporter);

impl Importer for PlyImporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn import(
        &self,
        source: &Source,
        _files: &dyn Files,
        _needs: ImportScope,
        options: &ImportOptions,
    ) -> Result<Asset, ImportError> {
        let error = |(place, what): (usize, String)| ImportError {
            file: source.name.clone(),
            place: format!("byte {place}"),
            what,
            hint: None,
        };
        let (header, at) = Header::read(&source.bytes).map_err(error)?;
        let mut mesh = match header.binary {
            true => binary(&header, &source.bytes, at).map_err(|e| (e.at, e.what)),
            false => ascii(&header, &source.bytes, at),
        }
        .map_err(error)?;
        let scale = options.number("scale").unwrap_or(1.0) as f32;
        if scale != 1.0 {
            mesh.positions.iter_mut().for_each(|v| *v *= scale);
        }
        let mut builder = AssetBuilder::default();
        builder.mesh(mesh).map_err(|e| error((0, e.to_string())))?;
        builder.finish(&source.name).map_err(|e| error((0, e.to_string())))
    }
}

/// Byte offset of an error, and the error.
type PlyError = (usize, String);

struct Header {
    binary: bool,
    vertices: usize,
    faces: usize,
    /// Numbers per vertex: 3, or 6 with a normal.
    width: usize,
}

impl Header {
    /// The header, and where it ends.
    fn read(bytes: &[u8]) -> Result<(Header, usize), PlyError> {
        let mut header = Header { binary: false, vertices: 0, faces: 0, width: 0 };
        let (mut at, mut of_vertices) = (0, false);
        loop {
            let rest = &bytes[at..];
            let end = rest
                .iter()
                .position(|b| *b == b'\n')
                .ok_or_else(|| (at, "the header has no end".to_string()))?;
            let line = String::from_utf8_lossy(&rest[..end]);
            let words: Vec<&str> = line.split_whitespace().collect();
            let count = |word: &str| word.parse().map_err(|_| (at, format!("\"{word}\" is no count")));
            match words.as_slice() {
                ["format", "binary_little_endian", _] => header.binary = true,
                ["format", "ascii", _] | ["ply"] | ["comment", ..] => {}
                ["element", "vertex", n] => (header.vertices, of_vertices) = (count(n)?, true),
                ["element", "face", n] => (header.faces, of_vertices) = (count(n)?, false),
                ["property", "float" | "float32", _] if of_vertices => header.width += 1,
                ["property", "list", "uchar" | "uint8", "int" | "int32" | "uint", _] if !of_vertices => {}
                ["end_header"] => break at += end + 1,
                _ => return Err((at, format!("unknown line \"{line}\""))),
            }
            at += end + 1;
        }
        match header.width {
            3 | 6 => Ok((header, at)),
            other => Err((at, format!("a vertex has 3 or 6 numbers, here {other}"))),
        }
    }
}

/// Adds a vertex's numbers to the arrays.
fn push_vertex(mesh: &mut MeshData, row: &[f32]) {
    mesh.positions.extend_from_slice(&row[..3]);
    mesh.normals.extend_from_slice(&row[3..]);
}

/// Reserves memory for the counts of the header, at most `most` numbers per list, because growing lists would be copied repeatedly.
fn reserve(mesh: &mut MeshData, header: &Header, most: usize) {
    mesh.positions.reserve(header.vertices.saturating_mul(3).min(most));
    mesh.normals.reserve(header.vertices.saturating_mul(header.width - 3).min(most));
    mesh.indices.reserve(header.faces.saturating_mul(3).min(most));
}

fn ascii(header: &Header, bytes: &[u8], at: usize) -> Result<MeshData, PlyError> {
    let unreadable = |place: usize| match bytes[place..].split(u8::is_ascii_whitespace).next() {
        Some(word) if place < bytes.len() => {
            (place, format!("\"{}\" is no number", String::from_utf8_lossy(word)))
        }
        _ => (place, "the file ends here".to_string()),
    };
    let mut numbers = TextNumbers::new(bytes, at);
    let mut mesh = MeshData { name: "ply".into(), ..MeshData::default() };
    // A number takes two bytes at least, whatever the header claims.
    let most = (bytes.len() - at) / 2;
    reserve(&mut mesh, header, most);
    let mut row = [0.0f32; 6];
    for _ in 0..header.vertices {
        for value in &mut row[..header.width] {
            *value = numbers.next().map_err(unreadable)?;
        }
        push_vertex(&mut mesh, &row[..header.width]);
    }
    for _ in 0..header.faces {
        let mut next = || numbers.next::<u32>().map_err(unreadable);
        let (count, first, mut before) = (next()?, next()?, next()?);
        for _ in 2..count {
            let vertex = next()?;
            mesh.indices.extend([first, before, vertex]);
            before = vertex;
        }
    }
    Ok(mesh)
}

fn binary(header: &Header, bytes: &[u8], mut at: usize) -> Result<MeshData, BinaryError> {
    let file = Binary::little_endian(bytes);
    let stride = 4 * header.width;
    let positions = file.rows::<_, 3>(at, header.vertices, stride)?;
    let normals =
        if header.width == 6 { file.rows::<_, 3>(at + 12, header.vertices, stride)? } else { Vec::new() };
    let mut mesh = MeshData { name: "ply".into(), positions, normals, ..MeshData::default() };
    at += header.vertices * stride;
    // A face takes 13 bytes at least, whatever the header claims.
    mesh.indices.reserve(header.faces.saturating_mul(3).min(bytes.len() / 4));
    for _ in 0..header.faces {
        let count = usize::from(file.number::<u8>(at)?);
        let face = file.part(at + 1, 4 * count)?.as_chunks::<4>().0;
        if let [first, others @ ..] = face {
            for pair in others.windows(2) {
                mesh.indices.extend([*first, pair[0], pair[1]].map(u32::from_le_bytes));
            }
        }
        at += 1 + 4 * count;
    }
    Ok(mesh)
}
