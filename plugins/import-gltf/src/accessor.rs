//! Typed arrays from accessors (glTF 2.0 §3.6.2). Every offset and count is checked before anything is allocated.

use crate::file::File;
use crate::problem::{Problem, Result, WithPlace, element};
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::validation::Checked;

/// Element limit of an accessor without a buffer view: it is all zeros, and could request any amount of memory.
const MAX_ZERO_ELEMENTS: u64 = 1 << 24;

/// How integer components become floats.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Integers {
    /// Normalized only where the accessor's `normalized` is set (KHR_mesh_quantization has plain integers).
    AsFlagged,
    /// Always normalized, as colors, weights and animation outputs are. Writers forget the flag.
    Normalized,
}

/// Elements of an accessor that were decoded from compressed data, tightly packed.
pub(crate) struct Decoded {
    pub component: ComponentType,
    pub count: usize,
    pub bytes: Vec<u8>,
}

struct Strided<'a> {
    bytes: &'a [u8],
    stride: usize,
    count: usize,
}

impl Strided<'_> {
    /// Converts all elements, of `N` components of `B` bytes each.
    fn map<const N: usize, const B: usize, T: Copy + Default>(
        &self,
        convert: impl Fn([u8; B]) -> T,
    ) -> Vec<[T; N]> {
        let mut out = Vec::with_capacity(self.count);
        for i in 0..self.count {
            let (components, _) = self.bytes[i * self.stride..i * self.stride + N * B].as_chunks::<B>();
            let mut element = [T::default(); N];
            for (to, from) in element.iter_mut().zip(components) {
                *to = convert(*from);
            }
            out.push(element);
        }
        out
    }
}

impl File<'_> {
    /// Elements of `N` floats. Integers are converted. Fails on values that are not finite.
    pub(crate) fn read_floats<const N: usize>(
        &self,
        index: usize,
        integers: Integers,
    ) -> Result<Vec<[f32; N]>> {
        let normalized =
            integers == Integers::Normalized || self.root.accessors.get(index).is_some_and(|a| a.normalized);
        let out = self.read_elements::<N, f32>(index, |source, component| {
            // glTF 2.0 §3.11: f = c / 255, max(c / 127, -1), c / 65535, max(c / 32767, -1).
            Some(match (component, normalized) {
                (ComponentType::F32, _) => source.map(f32::from_le_bytes),
                (ComponentType::U8, false) => source.map(|b: [u8; 1]| f32::from(b[0])),
                (ComponentType::U8, true) => source.map(|b: [u8; 1]| f32::from(b[0]) / 255.0),
                (ComponentType::I8, false) => source.map(|b: [u8; 1]| f32::from(b[0] as i8)),
                (ComponentType::I8, true) => {
                    source.map(|b: [u8; 1]| (f32::from(b[0] as i8) / 127.0).max(-1.0))
                }
                (ComponentType::U16, false) => source.map(|b| f32::from(u16::from_le_bytes(b))),
                (ComponentType::U16, true) => source.map(|b| f32::from(u16::from_le_bytes(b)) / 65535.0),
                (ComponentType::I16, false) => source.map(|b| f32::from(i16::from_le_bytes(b))),
                (ComponentType::I16, true) => {
                    source.map(|b| (f32::from(i16::from_le_bytes(b)) / 32767.0).max(-1.0))
                }
                (ComponentType::U32, _) => return None,
            })
        })?;
        if let Some(bad) = out.as_flattened().iter().position(|v| !v.is_finite()) {
            return Err(Problem::new(
                format!("accessors[{index}]"),
                format!(
                    "element {} holds {}, only finite numbers are allowed",
                    bad / N,
                    out.as_flattened()[bad]
                ),
            ));
        }
        Ok(out)
    }

    /// Unsigned integers, not normalized: indices and joints.
    pub(crate) fn read_integers<const N: usize>(&self, index: usize) -> Result<Vec<[u32; N]>> {
        // Checked first, because an accessor without data has no bytes whose decoding could fail.
        if let Some(accessor) = self.root.accessors.get(index)
            && let Checked::Valid(component) = accessor.component_type
            && !matches!(component.0, ComponentType::U8 | ComponentType::U16 | ComponentType::U32)
        {
            let what = format!("has component type {:?}; U8, U16 and U32 are allowed here", component.0);
            return Err(Problem::new(format!("accessors[{index}]"), what)
                .hint("indices and joints are whole numbers; export the file again"));
        }
        self.read_elements::<N, u32>(index, read_unsigned)
    }

    pub(crate) fn count(&self, index: usize) -> Result<u64> {
        if let Some(decoded) = self.unpacked_primitive.borrow().attributes.get(&index) {
            return Ok(decoded.count as u64);
        }
        let place = || format!("accessors[{index}]");
        Ok(element(&self.root.accessors, index, "accessors", place)?.count.0)
    }

    /// Number of components of an element; `None` where the file names an unknown type.
    pub(crate) fn width(&self, index: usize) -> Option<usize> {
        match self.root.accessors.get(index)?.type_ {
            Checked::Valid(t) => Some(t.multiplicity()),
            Checked::Invalid => None,
        }
    }

    fn read_elements<const N: usize, T: Copy + Default>(
        &self,
        index: usize,
        decode: impl Fn(&Strided<'_>, ComponentType) -> Option<Vec<[T; N]>>,
    ) -> Result<Vec<[T; N]>> {
        let place = || format!("accessors[{index}]");
        let accessor = element(&self.root.accessors, index, "accessors", place)?;
        let fail = |what: String| Problem::new(place(), what);
        let (Checked::Valid(component), Checked::Valid(shape)) = (accessor.component_type, accessor.type_)
        else {
            return Err(fail("has an unknown componentType or type".into()));
        };
        let component = component.0;
        if shape.multiplicity() != N || (N == 4 && shape == Type::Mat2) {
            let name = format!("{shape:?}").to_uppercase();
            return Err(fail(format!("is of type {name}, but {} is needed here", shape_name(N))));
        }
        let element_bytes = N * component.size();
        let wrong_component = || fail(format!("has component type {component:?}, which is not allowed here"));
        if let Some(decoded) = self.unpacked_primitive.borrow().attributes.get(&index) {
            self.charge(decoded.count as u64, N * size_of::<T>()).at(place)?;
            let source = Strided { bytes: &decoded.bytes, stride: element_bytes, count: decoded.count };
            return decode(&source, decoded.component).ok_or_else(wrong_component);
        }

        self.charge(accessor.count.0, N * size_of::<T>()).at(place)?;
        let mut out = match accessor.buffer_view {
            Some(view) => {
                let offset = accessor.byte_offset.map_or(0, |o| o.0);
                let source =
                    self.strided_view(view.value(), offset, accessor.count.0, element_bytes, &place)?;
                decode(&source, component).ok_or_else(wrong_component)?
            }
            None if accessor.count.0 <= MAX_ZERO_ELEMENTS => {
                vec![[T::default(); N]; accessor.count.0 as usize]
            }
            None => {
                let count = accessor.count.0;
                return Err(fail(format!(
                    "has no bufferView and {count} elements; the limit for those is {MAX_ZERO_ELEMENTS}"
                )));
            }
        };
        if let Some(sparse) = &accessor.sparse {
            let place = || format!("accessors[{index}].sparse");
            let Checked::Valid(index_type) = sparse.indices.component_type else {
                return Err(Problem::new(place(), "has an unknown index componentType"));
            };
            if sparse.count.0 > accessor.count.0 {
                let what = format!("replaces {} of {} elements", sparse.count.0, accessor.count.0);
                return Err(Problem::new(place(), what));
            }
            self.charge(sparse.count.0, 4 + N * size_of::<T>()).at(place)?;
            let indices = self.strided_view(
                sparse.indices.buffer_view.value(),
                sparse.indices.byte_offset.0,
                sparse.count.0,
                index_type.0.size(),
                &place,
            )?;
            let values = self.strided_view(
                sparse.values.buffer_view.value(),
                sparse.values.byte_offset.0,
                sparse.count.0,
                element_bytes,
                &place,
            )?;
            let indices: Vec<[u32; 1]> = read_unsigned(&indices, index_type.0).ok_or_else(wrong_component)?;
            let values = decode(&values, component).ok_or_else(wrong_component)?;
            for ([at], value) in indices.into_iter().zip(values) {
                match out.get_mut(at as usize) {
                    Some(slot) => *slot = value,
                    None => {
                        let what = format!("replaces element {at} of {}", accessor.count.0);
                        return Err(Problem::new(place(), what));
                    }
                }
            }
        }
        Ok(out)
    }

    fn strided_view(
        &self,
        view: usize,
        offset: u64,
        count: u64,
        element_bytes: usize,
        place: &dyn Fn() -> String,
    ) -> Result<Strided<'_>> {
        let (bytes, stride) = self.view(view, place)?;
        let stride = if stride == 0 { element_bytes } else { stride };
        if stride < element_bytes {
            return Err(Problem::new(
                place(),
                format!(
                    "elements of {element_bytes} bytes do not fit the stride of {stride} of bufferViews[{view}]"
                ),
            ));
        }
        let need = match count {
            0 => 0,
            n => (n - 1).saturating_mul(stride as u64).saturating_add(element_bytes as u64),
        };
        let end = offset.saturating_add(need);
        if end > bytes.len() as u64 {
            return Err(Problem::new(
                place(),
                format!(
                    "{count} elements end at byte {end} of bufferViews[{view}], which has {} bytes",
                    bytes.len()
                ),
            )
            .hint("the count or the offset is wrong, or the buffer was cut off"));
        }
        // The casts lose nothing: `end` is at most the length of a slice.
        Ok(Strided { bytes: &bytes[offset as usize..], stride, count: count as usize })
    }
}

fn read_unsigned<const N: usize>(source: &Strided<'_>, component: ComponentType) -> Option<Vec<[u32; N]>> {
    Some(match component {
        ComponentType::U8 => source.map(|b: [u8; 1]| u32::from(b[0])),
        ComponentType::U16 => source.map(|b| u32::from(u16::from_le_bytes(b))),
        ComponentType::U32 => source.map(u32::from_le_bytes),
        _ => return None,
    })
}

fn shape_name(components: usize) -> &'static str {
    match components {
        1 => "SCALAR",
        2 => "VEC2",
        3 => "VEC3",
        4 => "VEC4",
        9 => "MAT3",
        _ => "MAT4",
    }
}
