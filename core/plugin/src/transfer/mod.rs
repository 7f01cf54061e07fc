//! Values as bytes, for plugins in WebAssembly, which have a memory of their own: little-endian, without padding, lists with their length
//! first. A long list of numbers may be an address in the plugin's memory instead, so that only the program copies it. The bytes are
//! untrusted: whatever they are, reading returns a value or an error, and takes memory in proportion to them.

mod asset;
mod request;
mod scene;

pub use asset::missing_parts;
pub use request::{ExportReply, ExportRequest, ImportReply, ImportRequest};
pub use scene::{NoAsset, TransferredScene, snapshot_bytes};

use std::collections::BTreeMap;
use std::sync::Arc;

/// Error: the bytes are no value of the expected type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TransferError {
    /// Offset of the part that is wrong.
    pub at: usize,
    /// The problem.
    pub what: String,
}

choreo_motion::error_texts! { TransferError:
    Self { at, what } => "byte {at}: {what}";
}

type Result<T> = std::result::Result<T, TransferError>;

/// A value that can be written as bytes and read back.
pub trait Transfer: Sized {
    /// Appends the bytes of the value.
    fn write(&self, out: &mut Written);

    /// Reads the value.
    fn read(from: &mut Bytes<'_>) -> Result<Self>;

    /// Appends the elements of a list; numbers are copied in one block.
    fn write_all(list: &[Self], out: &mut Written) {
        list.iter().for_each(|element| element.write(out));
    }

    /// Reads the elements of a list.
    fn read_all(count: usize, from: &mut Bytes<'_>) -> Result<Vec<Self>> {
        // Each element takes a byte at least, whatever the count claims.
        let mut list = Vec::with_capacity(count.min(from.bytes_left()).min(1 << 12));
        for _ in 0..count {
            list.push(Self::read(from)?);
        }
        Ok(list)
    }

    /// Appends a list with its length.
    fn write_list(list: &[Self], out: &mut Written) {
        list.len().write(out);
        Self::write_all(list, out);
    }

    /// Reads a list that begins with its length.
    fn read_list(from: &mut Bytes<'_>) -> Result<Vec<Self>> {
        let count = usize::read(from)?;
        Self::read_all(count, from)
    }
}

/// Bytes that are being written.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Written {
    bytes: Vec<u8>,
    /// Whether long lists of numbers are written as addresses in memory.
    by_address: bool,
}

impl Written {
    /// Bytes that refer to lists in the memory of the writer, which must not change until the bytes are read.
    pub fn by_address() -> Written {
        Written { bytes: Vec::new(), by_address: true }
    }

    /// Bytes so far.
    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }
}

/// Bit of a list's length which means that the list is elsewhere in memory; its address follows.
const BY_ADDRESS_BIT: u64 = 1 << 63;

/// Size in bytes of the shortest list that is written as an address.
const MIN_BYTES_BY_ADDRESS: usize = 1024;

/// The bytes of a value.
pub fn to_bytes(value: &impl Transfer) -> Vec<u8> {
    let mut out = Written::default();
    value.write(&mut out);
    out.bytes
}

/// Reads a value that takes up all these bytes.
///
/// # Errors
/// The bytes are no such value, or some are left over.
///
/// ```
/// use choreo_plugin::transfer::{from_bytes, to_bytes};
/// let bytes = to_bytes(&vec!["hips".to_string(), "spine".to_string()]);
/// assert_eq!(from_bytes::<Vec<String>>(&bytes)?, ["hips", "spine"]);
/// assert!(from_bytes::<Vec<String>>(&bytes[1..]).is_err());
/// # Ok::<(), choreo_plugin::transfer::TransferError>(())
/// ```
pub fn from_bytes<T: Transfer>(bytes: &[u8]) -> Result<T> {
    from_memory(bytes, &[])
}

/// Reads a value that takes up all these bytes. Long lists may lie in `memory`, the memory of the plugin that has written the value. All
/// such lists together are at most as long as the memory.
pub fn from_memory<T: Transfer>(bytes: &[u8], memory: &[u8]) -> Result<T> {
    let mut from = Bytes { bytes, at: 0, memory, budget: memory.len() };
    let value = T::read(&mut from)?;
    match from.bytes_left() {
        0 => Ok(value),
        left => Err(from.error(format!("{left} bytes too many"))),
    }
}

/// Bytes that are being read.
pub struct Bytes<'b> {
    bytes: &'b [u8],
    at: usize,
    memory: &'b [u8],
    /// Bytes that further lists in `memory` may still take.
    budget: usize,
}

impl<'b> Bytes<'b> {
    fn bytes_left(&self) -> usize {
        self.bytes.len() - self.at
    }

    fn error(&self, what: impl Into<String>) -> TransferError {
        TransferError { at: self.at, what: what.into() }
    }

    fn take_bytes(&mut self, count: usize) -> Result<&'b [u8]> {
        if count > self.bytes_left() {
            return Err(self.error(format!("{count} bytes are needed, {} are left", self.bytes_left())));
        }
        let taken = &self.bytes[self.at..self.at + count];
        self.at += count;
        Ok(taken)
    }

    /// Bytes at an address of the memory.
    fn bytes_at(&mut self, place: usize, count: usize) -> Result<&'b [u8]> {
        let found = self.memory.get(place..place.saturating_add(count));
        let found = found.ok_or_else(|| {
            self.error(format!("a list of {count} bytes at {place}, outside of its memory"))
        })?;
        let left = self.budget.checked_sub(count);
        self.budget = left.ok_or_else(|| self.error("its lists have more bytes than its memory"))?;
        Ok(found)
    }
}

/// Numbers from bytes of any alignment.
fn numbers<T: bytemuck::Pod>(bytes: &[u8]) -> Vec<T> {
    match bytemuck::try_cast_slice::<u8, T>(bytes) {
        Ok(list) => list.to_vec(),
        Err(_) => bytes.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect(),
    }
}

/// Takes the bytes of `count` values without padding.
fn bytes_of_all<'b, T>(count: usize, from: &mut Bytes<'b>) -> Result<&'b [u8]> {
    let size = count.checked_mul(size_of::<T>());
    from.take_bytes(size.ok_or_else(|| from.error("a list without end"))?)
}

/// Takes the bytes of a list of values without padding, which begins with its length.
fn bytes_of_list<'b, T>(from: &mut Bytes<'b>) -> Result<&'b [u8]> {
    let length = u64::read(from)?;
    let count = usize::try_from(length & !BY_ADDRESS_BIT).map_err(|_| from.error("a list without end"))?;
    if length & BY_ADDRESS_BIT == 0 {
        return bytes_of_all::<T>(count, from);
    }
    let place = usize::read(from)?;
    let size = count.checked_mul(size_of::<T>());
    from.bytes_at(place, size.ok_or_else(|| from.error("a list without end"))?)
}

/// Writes a list of values without padding: its bytes, or its address if it is long and the writer allows that.
fn write_plain_list<T: Transfer>(list: &[T], out: &mut Written) {
    if !out.by_address || size_of_val(list) < MIN_BYTES_BY_ADDRESS {
        list.len().write(out);
        return T::write_all(list, out);
    }
    (list.len() as u64 | BY_ADDRESS_BIT).write(out);
    (list.as_ptr().addr() as u64).write(out);
}

/// Implements the methods for lists of values without padding. `$list` is the function that makes a list from bytes.
macro_rules! plain_lists {
    ($list:expr) => {
        fn read_all(count: usize, from: &mut Bytes<'_>) -> Result<Vec<Self>> {
            Ok($list(bytes_of_all::<Self>(count, from)?))
        }
        fn write_list(list: &[Self], out: &mut Written) {
            write_plain_list(list, out);
        }
        fn read_list(from: &mut Bytes<'_>) -> Result<Vec<Self>> {
            Ok($list(bytes_of_list::<Self>(from)?))
        }
    };
}

/// Implements [`Transfer`] for numbers, whose lists are one block of bytes.
macro_rules! numbers {
    ($($type:ty),*) => {$(
        impl Transfer for $type {
            fn write(&self, out: &mut Written) {
                out.bytes.extend_from_slice(bytemuck::bytes_of(self));
            }
            fn read(from: &mut Bytes<'_>) -> Result<$type> {
                Ok(bytemuck::pod_read_unaligned(from.take_bytes(size_of::<$type>())?))
            }
            fn write_all(list: &[$type], out: &mut Written) {
                out.bytes.extend_from_slice(bytemuck::cast_slice(list));
            }
            plain_lists!(numbers::<$type>);
        }
    )*};
}
numbers!(u8, u16, u32, u64, i64, f32, f64);

/// Implements [`Transfer`] for vectors and matrices as arrays of numbers, whose lists are one block of bytes. (They are plain bytes only
/// with glam's feature bytemuck, which brings procedural macros to every plugin.)
macro_rules! vectors {
    ($($type:ident: $array:ty, $to:ident, $from:expr;)*) => {$(
        impl Transfer for glam::$type {
            fn write(&self, out: &mut Written) {
                out.bytes.extend_from_slice(bytemuck::bytes_of(&self.$to()));
            }
            fn read(from: &mut Bytes<'_>) -> Result<glam::$type> {
                let numbers: $array = bytemuck::pod_read_unaligned(from.take_bytes(size_of::<$array>())?);
                Ok($from(numbers))
            }
            plain_lists!(|bytes| numbers::<$array>(bytes).into_iter().map($from).collect());
        }
    )*};
}
vectors! {
    Vec2: [f32; 2], to_array, glam::Vec2::from_array;
    Vec3: [f32; 3], to_array, glam::Vec3::from_array;
    Vec4: [f32; 4], to_array, glam::Vec4::from_array;
    Quat: [f32; 4], to_array, glam::Quat::from_array;
    Mat4: [f32; 16], to_cols_array, |columns| glam::Mat4::from_cols_array(&columns);
    DVec3: [f64; 3], to_array, glam::DVec3::from_array;
}

impl Transfer for usize {
    fn write(&self, out: &mut Written) {
        (*self as u64).write(out);
    }
    fn read(from: &mut Bytes<'_>) -> Result<usize> {
        usize::try_from(u64::read(from)?).map_err(|_| from.error("a number that is too large"))
    }
}

impl Transfer for bool {
    fn write(&self, out: &mut Written) {
        u8::from(*self).write(out);
    }
    fn read(from: &mut Bytes<'_>) -> Result<bool> {
        match u8::read(from)? {
            0 => Ok(false),
            1 => Ok(true),
            other => Err(from.error(format!("{other} is neither true nor false"))),
        }
    }
}

impl<T: Transfer> Transfer for Vec<T> {
    fn write(&self, out: &mut Written) {
        T::write_list(self, out);
    }
    fn read(from: &mut Bytes<'_>) -> Result<Vec<T>> {
        T::read_list(from)
    }
}

impl<T: Transfer> Transfer for Arc<[T]> {
    fn write(&self, out: &mut Written) {
        T::write_list(self, out);
    }
    fn read(from: &mut Bytes<'_>) -> Result<Arc<[T]>> {
        Ok(T::read_list(from)?.into())
    }
}

/// Texts are short and often temporary, so they are never written as addresses.
impl Transfer for String {
    fn write(&self, out: &mut Written) {
        self.len().write(out);
        u8::write_all(self.as_bytes(), out);
    }
    fn read(from: &mut Bytes<'_>) -> Result<String> {
        let count = usize::read(from)?;
        String::from_utf8(u8::read_all(count, from)?).map_err(|_| from.error("a text that is not UTF-8"))
    }
}

impl<T: Transfer> Transfer for Option<T> {
    fn write(&self, out: &mut Written) {
        self.is_some().write(out);
        self.iter().for_each(|value| value.write(out));
    }
    fn read(from: &mut Bytes<'_>) -> Result<Option<T>> {
        Ok(if bool::read(from)? { Some(T::read(from)?) } else { None })
    }
}

/// Implements [`Transfer`] for pointers, as the value behind them.
macro_rules! pointers {
    ($($pointer:ident),*) => {$(
        impl<T: Transfer> Transfer for $pointer<T> {
            fn write(&self, out: &mut Written) {
                (**self).write(out);
            }
            fn read(from: &mut Bytes<'_>) -> Result<$pointer<T>> {
                Ok($pointer::new(T::read(from)?))
            }
        }
    )*};
}
pointers!(Arc, Box);

impl<A: Transfer, B: Transfer> Transfer for (A, B) {
    fn write(&self, out: &mut Written) {
        self.0.write(out);
        self.1.write(out);
    }
    fn read(from: &mut Bytes<'_>) -> Result<(A, B)> {
        Ok((A::read(from)?, B::read(from)?))
    }
}

impl<T: Transfer, const N: usize> Transfer for [T; N] {
    fn write(&self, out: &mut Written) {
        T::write_all(self, out);
    }
    fn read(from: &mut Bytes<'_>) -> Result<[T; N]> {
        T::read_all(N, from)?.try_into().map_err(|_| from.error("a list of another length"))
    }
}

impl<K: Transfer + Ord, V: Transfer> Transfer for BTreeMap<K, V> {
    fn write(&self, out: &mut Written) {
        self.len().write(out);
        for (key, value) in self {
            key.write(out);
            value.write(out);
        }
    }
    fn read(from: &mut Bytes<'_>) -> Result<BTreeMap<K, V>> {
        Ok(Vec::<(K, V)>::read(from)?.into_iter().collect())
    }
}

/// Implements [`Transfer`] for structs, field by field; fields after `without` are left out and have their default. A field that is added
/// to a struct is an error here until it is listed.
macro_rules! fields {
    ($($type:ident { $($field:ident),* $(,)? $(; without $($without:ident),*)? })*) => {$(
        impl Transfer for $type {
            fn write(&self, out: &mut Written) {
                let $type { $($field,)* $($($without: _),*)? } = self;
                $($field.write(out);)*
            }
            fn read(from: &mut Bytes<'_>) -> Result<$type> {
                Ok($type { $($field: Transfer::read(from)?,)* $($($without: Default::default()),*)? })
            }
        }
    )*};
}

/// Implements [`Transfer`] for enums: the number of the variant in this list, then its fields.
macro_rules! variants {
    ($($type:ident { $($number:literal $variant:ident $(($($value:ident),*))? $({ $($field:ident),* })?),* $(,)? })*) => {$(
        impl Transfer for $type {
            fn write(&self, out: &mut Written) {
                match self {
                    $($type::$variant $(($($value),*))? $({ $($field),* })? => {
                        ($number as u8).write(out);
                        $($($value.write(out);)*)?
                        $($($field.write(out);)*)?
                    })*
                }
            }
            fn read(from: &mut Bytes<'_>) -> Result<$type> {
                Ok(match u8::read(from)? {
                    $($number => $type::$variant
                        $(($({ let $value = Transfer::read(from)?; $value }),*))?
                        $({ $($field: Transfer::read(from)?),* })?,)*
                    other => return Err(from.error(format!("{} has no variant {other}", stringify!($type)))),
                })
            }
        }
    )*};
}
use {fields, variants};
