//! EXT_meshopt_compression and KHR_meshopt_compression: buffer views packed by meshoptimizer's codecs.
//!
//! An own decoder rather than the C++ one: it is short, it is safe whatever the bytes hold, and it spares every build a C++
//! compiler. Formats: the extensions' specifications, "Appendix A: Bitstream" and "Appendix B: Filters".

mod attributes;
mod filters;
mod indices;

/// `mode` of the extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    Attributes,
    Triangles,
    Indices,
}

/// `filter` of the extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filter {
    None,
    Octahedral,
    Quaternion,
    Exponential,
    /// KHR_meshopt_compression only.
    Color,
}

/// What the JSON says of one compressed view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Packed {
    pub mode: Mode,
    pub filter: Filter,
    /// Elements: vertices or indices.
    pub count: usize,
    /// Bytes an element when unpacked.
    pub stride: usize,
}

impl Packed {
    /// What the specification demands of count and stride; the text says what is wrong.
    pub fn check(&self) -> Result<(), String> {
        let Packed { mode, filter, count, stride } = *self;
        let strides = |allowed: bool, text: &str| match allowed {
            true => Ok(()),
            false => Err(format!("has a byteStride of {stride}; {text}")),
        };
        match mode {
            Mode::Attributes => {
                strides(
                    stride % 4 == 0 && (4..=256).contains(&stride),
                    "multiples of 4 up to 256 are allowed",
                )?;
            }
            Mode::Triangles | Mode::Indices => strides(stride == 2 || stride == 4, "indices have 2 or 4")?,
        }
        if mode == Mode::Triangles && count % 3 != 0 {
            return Err(format!("has {count} indices, which make no whole triangles"));
        }
        match filter {
            _ if filter != Filter::None && mode != Mode::Attributes => {
                Err("has a filter, but no attributes".into())
            }
            Filter::Octahedral | Filter::Color => {
                strides(stride == 4 || stride == 8, "this filter needs 4 or 8")
            }
            Filter::Quaternion => strides(stride == 8, "the QUATERNION filter needs 8"),
            Filter::None | Filter::Exponential => Ok(()),
        }
    }

    /// Bytes that unpacking makes. Right after [`Packed::check`].
    pub fn bytes(&self) -> u64 {
        (self.count as u64).saturating_mul(self.stride as u64)
    }

    /// The fewest bytes that this many elements can be packed into: a lying count is found out before anything is allocated.
    pub fn least(&self) -> u64 {
        match self.mode {
            Mode::Attributes => attributes::least(self.count, self.stride),
            Mode::Triangles => 1 + self.count as u64 / 3 + indices::TABLE as u64,
            Mode::Indices => 1 + self.count as u64 + indices::TAIL as u64,
        }
    }

    /// Unpacks. `check` must have passed. Every byte of `data` is accounted for, or it is an error.
    pub fn unpack(&self, data: &[u8]) -> Result<Vec<u8>, String> {
        if (data.len() as u64) < self.least() {
            let least = self.least();
            return Err(format!(
                "{} elements take {least} bytes or more, but there are {}",
                self.count,
                data.len()
            ));
        }
        let mut out = match self.mode {
            Mode::Attributes => attributes::unpack(self.count, self.stride, data)?,
            Mode::Triangles => bytes(indices::triangles(self.count, data)?, self.stride),
            Mode::Indices => bytes(indices::sequence(self.count, data)?, self.stride),
        };
        filters::apply(self.filter, self.stride, &mut out);
        Ok(out)
    }
}

/// Little endian; of two bytes an index, the lower half.
fn bytes(indices: Vec<u32>, stride: usize) -> Vec<u8> {
    match stride {
        2 => indices.iter().flat_map(|i| (*i as u16).to_le_bytes()).collect(),
        _ => indices.iter().flat_map(|i| i.to_le_bytes()).collect(),
    }
}

/// Bytes taken from the front; running out is an error, never a panic.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, n: usize) -> Result<&'a [u8], String> {
        let (head, rest) = self.0.split_at_checked(n).ok_or_else(ended)?;
        self.0 = rest;
        Ok(head)
    }

    fn byte(&mut self) -> Result<u8, String> {
        let (head, rest) = self.0.split_first().ok_or_else(ended)?;
        self.0 = rest;
        Ok(*head)
    }

    /// Nothing may be left.
    fn end(&self) -> Result<(), String> {
        match self.0.len() {
            0 => Ok(()),
            n => Err(format!("{n} bytes are left over after the last element")),
        }
    }
}

fn ended() -> String {
    "the data end in the middle of an element".into()
}

/// The codecs' first byte: what it is in the upper half, its version in the lower.
fn version(head: u8, kind: u8, newest: u8) -> Result<u8, String> {
    if head & 0xf0 != kind {
        return Err(format!("begins with {head:#04x}, but {kind:#04x} is this mode's mark"));
    }
    match head & 0x0f {
        v if v <= newest => Ok(v),
        v => Err(format!("is of version {v}; the newest known is {newest}")),
    }
}

#[cfg(test)]
mod tests;
