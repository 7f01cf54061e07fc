//! Types of a shader as flat lists of 32-bit components: scalars, vectors, matrices column by column, arrays and structs.

use naga::{ScalarKind, TypeInner, UniqueArena};

/// Largest number of components of a value in registers (a 4×4 matrix, a surface sample, all parameters); larger arrays are read through
/// their variable.
pub(crate) const MAX_COMPONENTS: usize = choreo_plugin::parameters::MAX_PARAMETER_NUMBERS;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ComponentKind {
    Float,
    Int,
    Uint,
    Bool,
}

impl ComponentKind {
    /// Bits of a component of this type, made from a number of an effect's parameters.
    pub(crate) fn bits_of(self, number: f32) -> u32 {
        match self {
            ComponentKind::Float => number.to_bits(),
            ComponentKind::Int => number as i32 as u32,
            ComponentKind::Uint => number as u32,
            ComponentKind::Bool => u32::from(number > 0.5),
        }
    }
}

/// Types of all components of a type, in order.
pub(crate) fn component_kinds(inner: &TypeInner, types: &UniqueArena<naga::Type>) -> Vec<ComponentKind> {
    match inner {
        TypeInner::Struct { members, .. } => {
            members.iter().flat_map(|m| component_kinds(&types[m.ty].inner, types)).collect()
        }
        _ => shape(inner, types).map_or_else(Vec::new, |shape| vec![shape.kind; shape.size]),
    }
}

/// Layout of a type in components.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Shape {
    /// Kind of scalars, vectors and matrices.
    pub kind: ComponentKind,
    pub size: usize,
    /// Number of columns of a matrix, else 0.
    pub columns: usize,
    /// Components that one index step skips: 1 in a vector, the size of a column in a matrix, that of an element in an array; 0 for structs
    /// and scalars.
    pub step: usize,
    pub is_pointer: bool,
}

fn kind(scalar: naga::Scalar) -> Option<ComponentKind> {
    match (scalar.kind, scalar.width) {
        (ScalarKind::Float, 4) => Some(ComponentKind::Float),
        (ScalarKind::Sint, 4) => Some(ComponentKind::Int),
        (ScalarKind::Uint, 4) => Some(ComponentKind::Uint),
        (ScalarKind::Bool, _) => Some(ComponentKind::Bool),
        _ => None,
    }
}

/// Shape of a type; `None` for a type that effects do not need (textures, 16- and 64-bit numbers, arrays without a size).
pub(crate) fn shape(inner: &TypeInner, types: &UniqueArena<naga::Type>) -> Option<Shape> {
    let plain = |kind, size, columns, step| Some(Shape { kind, size, columns, step, is_pointer: false });
    match *inner {
        TypeInner::Scalar(scalar) => plain(kind(scalar)?, 1, 0, 0),
        TypeInner::Vector { size, scalar } => plain(kind(scalar)?, size as usize, 0, 1),
        TypeInner::Matrix { columns, rows, scalar } => {
            plain(kind(scalar)?, columns as usize * rows as usize, columns as usize, rows as usize)
        }
        TypeInner::Array { base, size: naga::ArraySize::Constant(count), .. } => {
            let element = shape(&types[base].inner, types)?;
            // Longer arrays are not needed in a function of one pixel.
            let size = element.size.checked_mul(count.get() as usize).filter(|s| *s <= 4096)?;
            plain(element.kind, size, 0, element.size)
        }
        TypeInner::Struct { ref members, .. } => {
            let sizes: Option<Vec<Shape>> =
                members.iter().map(|m| shape(&types[m.ty].inner, types)).collect();
            plain(ComponentKind::Float, sizes?.iter().map(|s| s.size).sum(), 0, 0)
        }
        TypeInner::Pointer { base, .. } => {
            shape(&types[base].inner, types).map(|s| Shape { is_pointer: true, ..s })
        }
        TypeInner::ValuePointer { size, scalar, .. } => {
            let size = size.map_or(1, |s| s as usize);
            let step = usize::from(size > 1);
            Some(Shape { kind: kind(scalar)?, size, columns: 0, step, is_pointer: true })
        }
        _ => None,
    }
}

/// Number of components before a member of a struct, or of a struct behind a pointer.
pub(crate) fn member_offset(
    inner: &TypeInner,
    index: usize,
    types: &UniqueArena<naga::Type>,
) -> Option<usize> {
    match inner {
        TypeInner::Pointer { base, .. } => member_offset(&types[*base].inner, index, types),
        TypeInner::Struct { members, .. } => {
            let before = members.get(..index)?;
            before.iter().map(|m| shape(&types[m.ty].inner, types).map(|s| s.size)).sum()
        }
        _ => None,
    }
}
