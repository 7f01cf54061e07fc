//! Numbers and texts in the bytes of a binary file, by their offsets.

use crate::ImportError;

/// The bytes of a binary file. Whatever the file claims, each method gives a value or an error that names the offset.
///
/// ```
/// use choreo_plugin::Binary;
/// // "row", then two vertices of three floats and a color of 4 bytes each.
/// let mut bytes = b"row\0".to_vec();
/// for vertex in [[1.0f32, 2.0, 3.0], [4.0, 5.0, 6.0]] {
///     bytes.extend(vertex.iter().flat_map(|v| v.to_le_bytes()));
///     bytes.extend([255, 0, 0, 255]);
/// }
/// let file = Binary::little_endian(&bytes);
/// assert_eq!(file.text(0, 4)?, "row");
/// assert_eq!(file.rows::<f32, 3>(4, 2, 16)?, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
/// assert_eq!((file.number::<f32>(20)?, file.array::<f32, 2>(8)?), (4.0, [2.0, 3.0]));
/// assert_eq!(file.numbers::<u8>(16, 4)?, file.part(16, 4)?);
/// assert_eq!(Binary::big_endian(&[1, 2]).number::<u16>(0)?, 0x102);
///
/// let error = file.number::<u32>(34).unwrap_err();
/// assert_eq!((error.at, error.what.as_str()), (34, "4 bytes are needed, the file has 36"));
/// assert_eq!(error.of_file("a.row").to_string(), "a.row: byte 34: 4 bytes are needed, the file has 36");
/// # Ok::<(), choreo_plugin::BinaryError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Binary<'b> {
    bytes: &'b [u8],
    big: bool,
}

/// Error of [`Binary`]: bytes beyond the end of the file, or rows that overlap.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BinaryError {
    /// Offset of the part.
    pub at: usize,
    /// The problem.
    pub what: String,
}

impl BinaryError {
    /// Converts this error to the [`ImportError`] of the file with this name.
    pub fn of_file(self, name: &str) -> ImportError {
        let BinaryError { at, what } = self;
        ImportError { file: name.to_string(), place: format!("byte {at}"), what, hint: None }
    }
}

choreo_motion::error_texts! { BinaryError:
    Self { at, what, .. } => "byte {at}: {what}";
}

type Result<T> = std::result::Result<T, BinaryError>;

mod sealed {
    pub trait Sealed: Sized {
        const SIZE: usize;
        /// Decodes the number from `SIZE` bytes, big-endian if `big` is set.
        fn of(bytes: &[u8], big: bool) -> Self;
    }
}

/// A number of a binary file: an integer of 8 to 64 bits, f32 or f64.
///
/// ```
/// use choreo_plugin::{Binary, BinaryError, BinaryNumber};
///
/// /// A list after its length.
/// fn list<T: BinaryNumber>(file: Binary, at: usize) -> Result<Vec<T>, BinaryError> {
///     file.numbers(at + 4, file.number::<u32>(at)? as usize)
/// }
///
/// assert_eq!(list::<u8>(Binary::little_endian(&[2, 0, 0, 0, 7, 8]), 0)?, [7, 8]);
/// # Ok::<(), BinaryError>(())
/// ```
pub trait BinaryNumber: Copy + sealed::Sealed {}

macro_rules! numbers {
    ($($type:ty),*) => {$(
        impl BinaryNumber for $type {}
        impl sealed::Sealed for $type {
            const SIZE: usize = size_of::<$type>();
            #[inline]
            fn of(bytes: &[u8], big: bool) -> $type {
                let mut own = [0; size_of::<$type>()];
                own.copy_from_slice(bytes);
                if big { <$type>::from_be_bytes(own) } else { <$type>::from_le_bytes(own) }
            }
        }
    )*};
}
numbers!(u8, i8, u16, i16, u32, i32, u64, i64, f32, f64);

impl<'b> Binary<'b> {
    /// A file of little-endian numbers.
    pub fn little_endian(bytes: &'b [u8]) -> Binary<'b> {
        Binary { bytes, big: false }
    }

    /// A file of big-endian numbers.
    pub fn big_endian(bytes: &'b [u8]) -> Binary<'b> {
        Binary { bytes, big: true }
    }

    /// Bytes at an offset.
    ///
    /// # Errors
    /// The bytes reach beyond the end of the file.
    #[inline]
    pub fn part(&self, at: usize, count: usize) -> Result<&'b [u8]> {
        let part = at.checked_add(count).and_then(|end| self.bytes.get(at..end));
        part.ok_or_else(|| self.too_short(at, count))
    }

    #[cold]
    fn too_short(&self, at: usize, count: usize) -> BinaryError {
        let has = self.bytes.len();
        BinaryError { at, what: format!("{count} bytes are needed, the file has {has}") }
    }

    /// The number at an offset.
    ///
    /// # Errors
    /// The bytes reach beyond the end of the file.
    #[inline]
    pub fn number<T: BinaryNumber>(&self, at: usize) -> Result<T> {
        Ok(T::of(self.part(at, T::SIZE)?, self.big))
    }

    /// `N` consecutive numbers at an offset.
    ///
    /// # Errors
    /// The numbers reach beyond the end of the file.
    #[inline]
    pub fn array<T: BinaryNumber, const N: usize>(&self, at: usize) -> Result<[T; N]> {
        let part = self.part(at, N.saturating_mul(T::SIZE))?;
        Ok(std::array::from_fn(|i| T::of(&part[i * T::SIZE..(i + 1) * T::SIZE], self.big)))
    }

    /// `count` consecutive numbers at an offset.
    ///
    /// # Errors
    /// The numbers reach beyond the end of the file; no memory is allocated then, whatever the count.
    #[inline]
    pub fn numbers<T: BinaryNumber>(&self, at: usize, count: usize) -> Result<Vec<T>> {
        let part = self.part(at, count.saturating_mul(T::SIZE))?;
        Ok(part.chunks_exact(T::SIZE).map(|bytes| T::of(bytes, self.big)).collect())
    }

    /// Rows of `N` numbers, each `stride` bytes after the one before, in one list.
    ///
    /// # Errors
    /// The rows reach beyond the end of the file, or they overlap.
    pub fn rows<T: BinaryNumber, const N: usize>(
        &self,
        at: usize,
        count: usize,
        stride: usize,
    ) -> Result<Vec<T>> {
        let size = N.saturating_mul(T::SIZE);
        if stride < size || size == 0 {
            let what =
                format!("rows of {N} numbers take {size} bytes, more than the stride of {stride} bytes");
            return Err(BinaryError { at, what });
        }
        let Some(before) = count.checked_sub(1) else { return Ok(Vec::new()) };
        let part = self.part(at, before.saturating_mul(stride).saturating_add(size))?;
        let mut numbers = Vec::with_capacity(count * N);
        for row in part.chunks(stride) {
            let row = &row[..size];
            let row: [T; N] = std::array::from_fn(|i| T::of(&row[i * T::SIZE..(i + 1) * T::SIZE], self.big));
            numbers.extend_from_slice(&row);
        }
        Ok(numbers)
    }

    /// The text at an offset, up to its first zero byte, in a field of `count` bytes. Bytes that are no UTF-8 become U+FFFD.
    ///
    /// # Errors
    /// The file ends before the field does.
    pub fn text(&self, at: usize, field: usize) -> Result<String> {
        let bytes = self.part(at, field)?;
        let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(field);
        Ok(String::from_utf8_lossy(&bytes[..end]).into_owned())
    }
}
