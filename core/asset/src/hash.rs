//! Content hashes (BLAKE3): equal content, equal hash, on every machine. Floats are hashed by their bits, lists by length and content.
//!
//! Types are hashed member by member ([`hashed!`](crate::hashed)) or by a function ([`written!`](crate::written)).

use choreo_motion::Time;
use glam::{Affine2, Affine3A, DAffine3, DQuat, DVec2, DVec3, Mat4, Quat, Vec2, Vec3, Vec4};
use std::collections::BTreeMap;
use std::sync::Arc;

/// BLAKE3 hash of content.
pub type ContentHash = [u8; 32];

/// Elements of a list that are serialized together before they are hashed: 384 KiB of the largest type.
const ELEMENTS_PER_BLOCK: usize = 4096;

/// A hasher that gets a length or tag before all data of variable size, so that no two contents share a byte stream.
#[derive(Default)]
pub struct Writer {
    hasher: blake3::Hasher,
    /// Hashes of the images that textures refer to. A texture whose image is not among them counts by its index.
    pub(crate) images: Vec<ContentHash>,
    /// Whether textures are left out of the hash.
    pub(crate) without_textures: bool,
    /// Hashes of contents that many values share, by address; the content outlives the writer.
    shared: BTreeMap<usize, ContentHash>,
}

/// A type that is part of a content hash.
pub trait Hashed {
    /// Adds the value to a hash.
    fn hash(&self, w: &mut Writer);
    /// Adds the elements of a list, without their number.
    fn hash_all(list: &[Self], w: &mut Writer)
    where
        Self: Sized,
    {
        list.iter().for_each(|item| item.hash(w));
    }
}

impl Writer {
    /// Adds bytes, preceded by their number.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.count(bytes.len());
        self.hasher.update(bytes);
    }
    /// Adds a text, preceded by its length in bytes.
    pub fn text(&mut self, text: &str) {
        self.bytes(text.as_bytes());
    }
    /// Adds the number of a variant.
    pub fn tag(&mut self, tag: u8) {
        self.hasher.update(&[tag]);
    }
    /// Adds a number of elements.
    pub fn count(&mut self, n: usize) {
        self.hasher.update(&(n as u64).to_le_bytes());
    }
    /// Adds the hash of content that many values share, which is computed once.
    pub fn once<T: ?Sized>(&mut self, content: &Arc<T>, hash: impl FnOnce() -> ContentHash) {
        let address = Arc::as_ptr(content).cast::<()>() as usize;
        let hash = *self.shared.entry(address).or_insert_with(hash);
        self.bytes(&hash);
    }
    /// The hash of all that was added.
    pub fn finish(self) -> ContentHash {
        *self.hasher.finalize().as_bytes()
    }
}

/// Hash of everything that the function `write` adds.
pub fn hash_of(write: impl FnOnce(&mut Writer)) -> ContentHash {
    let mut w = Writer::default();
    write(&mut w);
    w.finish()
}

/// Hashes values by a function of the value and the [`Writer`](crate::hash::Writer).
#[macro_export]
macro_rules! written {
    ($($ty:ty: |$this:ident, $w:ident| $write:expr;)*) => {
        $(impl $crate::hash::Hashed for $ty {
            fn hash(&self, $w: &mut $crate::hash::Writer) {
                let $this = self;
                $write
            }
        })*
    };
}

/// Hashes structs member by member, and enums by a number and members. Variants must keep their numbers, so that hashes stay
/// valid.
#[macro_export]
macro_rules! hashed {
    (@one struct $name:ident { $($member:ident),* $(; without $($skipped:ident),*)? }) => {
        impl $crate::hash::Hashed for $name {
            fn hash(&self, w: &mut $crate::hash::Writer) {
                let $name { $($member,)* $($($skipped: _),*)? } = self;
                $($crate::hash::Hashed::hash($member, w);)*
            }
        }
    };
    (@one enum $name:ident {
        $($number:literal $variant:ident $(($($item:ident),+))? $({ $($member:ident),* $(; without $($skipped:ident),*)? })?,)*
    }) => {
        impl $crate::hash::Hashed for $name {
            fn hash(&self, w: &mut $crate::hash::Writer) {
                match self {
                    $($name::$variant $(($($item),+))? $({ $($member,)* $($($skipped: _),*)? })? => {
                        w.tag($number);
                        $($($crate::hash::Hashed::hash($item, w);)+)?
                        $($($crate::hash::Hashed::hash($member, w);)*)?
                    })*
                }
            }
        }
    };
    ($($what:ident $name:ident { $($body:tt)* })*) => {
        $($crate::hashed!(@one $what $name { $($body)* });)*
    };
}

/// Hashes numbers and vectors of numbers as little-endian bytes, lists of them block by block.
macro_rules! impl_hashed_for_numbers {
    ($($ty:ty: |$value:ident| $numbers:expr;)*) => {
        $(impl Hashed for $ty {
            fn hash(&self, w: &mut Writer) {
                let $value = self;
                $numbers.iter().for_each(|number| _ = w.hasher.update(&number.to_le_bytes()));
            }
            fn hash_all(list: &[$ty], w: &mut Writer) {
                let mut bytes = Vec::with_capacity(size_of_val(list).min(ELEMENTS_PER_BLOCK * size_of::<$ty>()));
                for block in list.chunks(ELEMENTS_PER_BLOCK) {
                    bytes.clear();
                    for $value in block {
                        $numbers.iter().for_each(|number| bytes.extend(number.to_le_bytes()));
                    }
                    w.hasher.update(&bytes);
                }
            }
        })*
    };
}

impl_hashed_for_numbers! {
    u16: |v| [*v];
    u32: |v| [*v];
    f32: |v| [*v];
    f64: |v| [*v];
    Time: |t| [t.0];
    Vec2: |v| v.to_array();
    Vec3: |v| v.to_array();
    Vec4: |v| v.to_array();
    Quat: |v| v.to_array();
    DVec2: |v| v.to_array();
    DVec3: |v| v.to_array();
    DQuat: |v| v.to_array();
    Mat4: |v| v.to_cols_array();
    Affine2: |v| v.to_cols_array();
    Affine3A: |v| v.to_cols_array();
    DAffine3: |v| v.to_cols_array();
}

written! {
    bool: |v, w| w.tag((*v).into());
    usize: |v, w| w.count(*v);
    String: |v, w| w.text(v);
    ContentHash: |v, w| w.bytes(v);
    // The coefficients of an attenuation.
    [f32; 3]: |v, w| v.as_slice().hash(w);
}

impl Hashed for u8 {
    fn hash(&self, w: &mut Writer) {
        w.tag(*self);
    }
    fn hash_all(list: &[u8], w: &mut Writer) {
        w.hasher.update(list);
    }
}

/// Hashes pointers as the values behind them.
macro_rules! impl_hashed_for_pointers {
    ($($ty:ty),*) => {
        $(impl<T: Hashed + ?Sized> Hashed for $ty {
            fn hash(&self, w: &mut Writer) {
                (**self).hash(w);
            }
        })*
    };
}

impl_hashed_for_pointers!(&T, Box<T>, Arc<T>);

impl<T: Hashed> Hashed for Option<T> {
    fn hash(&self, w: &mut Writer) {
        self.is_some().hash(w);
        self.iter().for_each(|v| v.hash(w));
    }
}

impl<T: Hashed> Hashed for [T] {
    fn hash(&self, w: &mut Writer) {
        w.count(self.len());
        T::hash_all(self, w);
    }
}

impl<T: Hashed> Hashed for Vec<T> {
    fn hash(&self, w: &mut Writer) {
        self.as_slice().hash(w);
    }
}

impl<T: Hashed> Hashed for [T; 2] {
    fn hash(&self, w: &mut Writer) {
        self.iter().for_each(|v| v.hash(w));
    }
}

impl<T: Hashed> Hashed for [T; 4] {
    fn hash(&self, w: &mut Writer) {
        self.iter().for_each(|v| v.hash(w));
    }
}

impl<A: Hashed, B: Hashed> Hashed for (A, B) {
    fn hash(&self, w: &mut Writer) {
        self.0.hash(w);
        self.1.hash(w);
    }
}

impl<A: Hashed, B: Hashed, C: Hashed> Hashed for (A, B, C) {
    fn hash(&self, w: &mut Writer) {
        (&self.0, &self.1).hash(w);
        self.2.hash(w);
    }
}
