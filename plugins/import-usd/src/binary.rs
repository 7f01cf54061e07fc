//! Reads layers as crate files, `.usdc` (pxr/usd/usd/crateFile.cpp). Counts are checked against the available bytes before
//! anything is allocated.

use crate::layer::{Attribute, Layer, Prim, Reference, Specifier, Value};
use choreo_importer_kit::{Budget, Problem, Result};
use std::collections::BTreeMap;
use std::sync::Arc;

const IS_ARRAY: u64 = 1 << 63;
const IS_INLINED: u64 = 1 << 62;
const IS_COMPRESSED: u64 = 1 << 61;
const PAYLOAD_MASK: u64 = (1 << 48) - 1;

/// Arrays with fewer elements are never compressed.
const MIN_COMPRESSED_LENGTH: usize = 16;
/// Largest expansion ratio of LZ4.
const MAX_EXPANSION_RATIO: usize = 256;
/// Nesting of prims, at most.
const MAX_DEPTH: usize = 96;

pub(crate) fn is_crate(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PXR-USDC")
}

fn damage_error(what: impl Into<String>) -> Problem {
    Problem::new("crate file", what)
}

/// A read position in the bytes.
#[derive(Clone, Copy)]
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    fn take(&mut self, length: usize) -> Result<&'a [u8]> {
        let end = self.at.checked_add(length);
        let out = end.and_then(|end| self.bytes.get(self.at..end));
        let out = out.ok_or_else(|| damage_error(format!("ends within the data at byte {}", self.at)))?;
        self.at += length;
        Ok(out)
    }

    fn take_array<const N: usize>(&mut self) -> Result<[u8; N]> {
        let mut out = [0; N];
        out.copy_from_slice(self.take(N)?);
        Ok(out)
    }

    fn u32(&mut self) -> Result<u32> {
        self.take_array().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Result<u64> {
        self.take_array().map(u64::from_le_bytes)
    }

    fn f64(&mut self) -> Result<f64> {
        self.take_array().map(f64::from_le_bytes)
    }

    /// Reads a count of elements of `size` bytes. Fails where the rest of the file is too short for them.
    fn read_count(&mut self, size: usize) -> Result<usize> {
        let count = self.u64()?;
        let left = self.bytes.len().saturating_sub(self.at) as u64;
        match count.checked_mul(size as u64) {
            Some(all) if all <= left => Ok(count as usize),
            _ => Err(damage_error(format!(
                "declares {count} elements at byte {}, but the file is too short for them",
                self.at - 8
            ))),
        }
    }

    fn with_offset(self, at: u64) -> Cursor<'a> {
        Cursor { bytes: self.bytes, at: usize::try_from(at).unwrap_or(usize::MAX) }
    }
}

struct Reader<'a> {
    file: Cursor<'a>,
    budget: &'a Budget,
    version: [u8; 3],
    tokens: Vec<String>,
    strings: Vec<u32>,
    /// Token index of the field's name, and value.
    fields: Vec<(u32, u64)>,
    field_sets: Vec<u32>,
    paths: Vec<Path>,
}

/// One element of a path, linked to its parent.
#[derive(Clone, Debug, Default)]
struct Path {
    parent: Option<u32>,
    element: String,
    is_property: bool,
    depth: usize,
}

/// Fields of a spec by name.
type Fields<'f> = BTreeMap<&'f str, u64>;

pub(crate) fn read(bytes: &[u8], budget: &Budget) -> Result<Layer> {
    let all = Cursor { bytes, at: 0 };
    let mut head = all;
    head.take(8)?;
    let version = head.take_array::<8>()?;
    let version = [version[0], version[1], version[2]];
    if version[0] != 0 || version[1] < 4 {
        let [a, b, c] = version;
        return Err(damage_error(format!("has version {a}.{b}.{c}; version 0.4 or later is needed")));
    }
    let (tokens, strings, fields, field_sets) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let paths = Vec::new();
    let mut reader = Reader { file: all, budget, version, tokens, strings, fields, field_sets, paths };
    let mut list = all.with_offset(head.u64()?);
    let mut sections: BTreeMap<String, Cursor<'_>> = BTreeMap::new();
    for _ in 0..list.read_count(32)? {
        let name = list.take_array::<16>()?;
        let name = String::from_utf8_lossy(&name).trim_end_matches('\0').to_string();
        let (start, _size) = (list.u64()?, list.u64()?);
        sections.insert(name, all.with_offset(start));
    }
    let section = |name: &str| {
        sections.get(name).copied().ok_or_else(|| damage_error(format!("has no section {name}")))
    };
    reader.read_tokens(section("TOKENS")?)?;
    reader.read_tables([section("STRINGS")?, section("FIELDS")?, section("FIELDSETS")?])?;
    reader.read_paths(section("PATHS")?)?;
    let specs = reader.read_specs(section("SPECS")?)?;
    reader.read_layer(&specs)
}

impl<'a> Reader<'a> {
    fn charge(&self, count: usize, size: usize) -> Result<()> {
        self.budget.charge(count as u64, size)
    }

    /// Decompresses an LZ4 block to at most `max_bytes` bytes.
    fn decompress(&self, cursor: &mut Cursor<'a>, max_bytes: usize) -> Result<Vec<u8>> {
        let length = cursor.read_count(1)?;
        let bytes = cursor.take(length)?;
        let Some((0, block)) = bytes.split_first().map(|(chunks, rest)| (*chunks, rest)) else {
            return Err(damage_error("is compressed in several parts, which are not read"));
        };
        let max_bytes = max_bytes.min(block.len().saturating_mul(MAX_EXPANSION_RATIO));
        self.charge(max_bytes, 1)?;
        lz4_flex::block::decompress(block, max_bytes).map_err(|e| damage_error(format!("is damaged: {e}")))
    }

    fn read_integers(&self, cursor: &mut Cursor<'a>, count: usize) -> Result<Vec<i32>> {
        if count == 0 {
            return Ok(Vec::new());
        }
        let codes = count.div_ceil(4);
        // Every integer takes at least two bits, so the bytes bound the count.
        let bytes = self.decompress(cursor, count.saturating_mul(4).saturating_add(codes + 4))?;
        if bytes.len() < 4 + codes {
            return Err(damage_error("has fewer integers than it declares"));
        }
        self.charge(count, 4)?;
        let mut numbers = Cursor { bytes: &bytes, at: 4 + codes };
        let common = i32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
        let (mut out, mut value) = (Vec::with_capacity(count), 0i32);
        for index in 0..count {
            let code = bytes[4 + index / 4] >> (2 * (index % 4)) & 3;
            let difference = match code {
                0 => common,
                1 => i32::from(i8::from_le_bytes(numbers.take_array()?)),
                2 => i32::from(i16::from_le_bytes(numbers.take_array()?)),
                _ => i32::from_le_bytes(numbers.take_array()?),
            };
            value = value.wrapping_add(difference);
            out.push(value);
        }
        Ok(out)
    }

    fn read_tokens(&mut self, mut cursor: Cursor<'a>) -> Result<()> {
        let count = cursor.u64()?;
        let length = usize::try_from(cursor.u64()?).unwrap_or(usize::MAX);
        let bytes = self.decompress(&mut cursor, length)?;
        self.charge(bytes.iter().filter(|b| **b == 0).count(), 32)?;
        self.tokens =
            bytes.split(|b| *b == 0).map(|token| String::from_utf8_lossy(token).into_owned()).collect();
        self.tokens.truncate(usize::try_from(count).unwrap_or(usize::MAX));
        Ok(())
    }

    fn read_tables(&mut self, [mut strings, mut fields, mut sets]: [Cursor<'a>; 3]) -> Result<()> {
        let count = strings.read_count(4)?;
        self.strings = (0..count).map(|_| strings.u32()).collect::<Result<_>>()?;
        let count = self.read_compressed_count(&mut fields)?;
        let names = self.read_integers(&mut fields, count)?;
        let values = self.decompress(&mut fields, count.saturating_mul(8))?;
        let mut values = Cursor { bytes: &values, at: 0 };
        self.charge(count, 16)?;
        self.fields = names.iter().map(|name| Ok((*name as u32, values.u64()?))).collect::<Result<_>>()?;
        let count = self.read_compressed_count(&mut sets)?;
        self.field_sets =
            self.read_integers(&mut sets, count)?.into_iter().map(|index| index as u32).collect();
        Ok(())
    }

    /// Reads the element count of a compressed list. Fails where the file could not contain as many.
    fn read_compressed_count(&self, cursor: &mut Cursor<'a>) -> Result<usize> {
        let count = cursor.u64()?;
        let most = cursor.bytes.len().saturating_mul(4 * MAX_EXPANSION_RATIO) as u64;
        match count <= most {
            true => Ok(count as usize),
            false => {
                Err(damage_error(format!("declares {count} elements, but the file is too short for them")))
            }
        }
    }

    fn read_paths(&mut self, mut cursor: Cursor<'a>) -> Result<()> {
        let number = self.read_compressed_count(&mut cursor)?;
        let count = self.read_compressed_count(&mut cursor)?;
        let indices = self.read_integers(&mut cursor, count)?;
        let tokens = self.read_integers(&mut cursor, count)?;
        let jumps = self.read_integers(&mut cursor, count)?;
        self.charge(number, size_of::<Path>())?;
        self.paths = vec![Path::default(); number];
        // (place, parent). Each place is visited once, so damaged jumps cannot loop.
        let mut open: Vec<(usize, Option<u32>)> = vec![(0, None)];
        let mut taken = vec![false; count];
        let mut assigned = vec![false; number];
        while let Some((mut place, mut parent)) = open.pop() {
            while place < count && !std::mem::replace(&mut taken[place], true) {
                let (index, token, jump) = (indices[place] as u32, tokens[place], jumps[place]);
                let depth = parent.map_or(0, |p| self.paths[p as usize].depth + 1);
                let element = match parent {
                    None => String::new(),
                    Some(_) => self.token(token.unsigned_abs())?.to_string(),
                };
                self.charge(element.len(), 1)?;
                // A path that occurs twice could be its own ancestor.
                if assigned.get_mut(index as usize).is_none_or(|was| std::mem::replace(was, true)) {
                    return Err(damage_error("has a path index that is out of range or repeated"));
                }
                if depth > MAX_DEPTH {
                    return Err(damage_error(format!("has more than {MAX_DEPTH} nested prims")));
                }
                self.paths[index as usize] = Path { parent, element, is_property: token < 0, depth };
                if jump > 0 {
                    open.push((place + jump as usize, parent));
                }
                match jump {
                    // The next entry is a child (−1, or positive with a sibling elsewhere); at 0 it is a sibling.
                    -1 | 1.. => parent = Some(index),
                    0 => {}
                    _ => break,
                }
                place += 1;
            }
        }
        Ok(())
    }

    fn token(&self, index: u32) -> Result<&str> {
        let token = self.tokens.get(index as usize);
        token.map(String::as_str).ok_or_else(|| damage_error("refers to a token that it does not have"))
    }

    fn string(&self, index: u32) -> Result<&str> {
        let token = self.strings.get(index as usize);
        self.token(*token.ok_or_else(|| damage_error("refers to a string that it does not have"))?)
    }

    /// A path as text.
    fn path_text(&self, index: u32) -> Result<String> {
        let mut elements = Vec::new();
        let mut at = Some(index);
        while let Some(index) = at {
            let path = self.paths.get(index as usize);
            let path = path.ok_or_else(|| damage_error("refers to a path that it does not have"))?;
            if path.parent.is_some() {
                elements.push(path);
            }
            at = path.parent;
            if elements.len() > MAX_DEPTH + 2 {
                return Err(damage_error("has an endless path"));
            }
        }
        let mut out = String::new();
        for path in elements.iter().rev() {
            out.push(if path.is_property { '.' } else { '/' });
            out.push_str(&path.element);
        }
        Ok(out)
    }

    /// Index of each spec's fields, by path.
    fn read_specs(&self, mut cursor: Cursor<'a>) -> Result<BTreeMap<u32, u32>> {
        let count = self.read_compressed_count(&mut cursor)?;
        let paths = self.read_integers(&mut cursor, count)?;
        let sets = self.read_integers(&mut cursor, count)?;
        self.charge(count, 64)?;
        Ok(paths.into_iter().map(|p| p as u32).zip(sets.into_iter().map(|s| s as u32)).collect())
    }

    fn read_fields(&self, set: u32) -> Result<Fields<'_>> {
        let mut out = BTreeMap::new();
        for field in self.field_sets.iter().skip(set as usize).take_while(|field| **field != u32::MAX) {
            let field = self.fields.get(*field as usize);
            let (name, value) =
                field.ok_or_else(|| damage_error("refers to a field that it does not have"))?;
            out.insert(self.token(*name)?, *value);
        }
        Ok(out)
    }

    fn read_layer(&self, specs: &BTreeMap<u32, u32>) -> Result<Layer> {
        let mut children: Vec<Vec<u32>> = vec![Vec::new(); self.paths.len()];
        self.charge(self.paths.len(), 32)?;
        let mut root = None;
        for index in specs.keys() {
            let Some(path) = self.paths.get(*index as usize) else { continue };
            match path.parent {
                Some(parent) => children[parent as usize].push(*index),
                None => root = root.or(Some(*index)),
            }
        }
        let root = root.ok_or_else(|| damage_error("has no root"))?;
        let fields = self.read_fields(specs[&root])?;
        let mut layer = Layer { root: self.read_prim(root, specs, &children)?, ..Layer::default() };
        let number = |name: &str| -> Result<Option<f64>> {
            let Some(value) = fields.get(name) else { return Ok(None) };
            Ok(self.read_value(*value, "double")?.and_then(|v| v.numbers().first().copied()))
        };
        let text = |name: &str| -> Result<Option<String>> {
            let Some(value) = fields.get(name) else { return Ok(None) };
            Ok(self.read_value(*value, "token")?.and_then(|v| v.texts().first().cloned()))
        };
        layer.up_axis = text("upAxis")?;
        layer.default_prim = text("defaultPrim")?.unwrap_or_default();
        layer.comment = text("comment")?.unwrap_or_default();
        layer.metres_per_unit = number("metersPerUnit")?;
        layer.time_codes_per_second = number("timeCodesPerSecond")?.or(number("framesPerSecond")?);
        layer.start_time_code = number("startTimeCode")?;
        if let Some(value) = fields.get("subLayers") {
            let mut cursor = self.file.with_offset(value & PAYLOAD_MASK);
            for _ in 0..cursor.read_count(4)? {
                layer.sublayers.push(self.string(cursor.u32()?)?.to_string());
            }
        }
        Ok(layer)
    }

    fn read_prim(&self, index: u32, specs: &BTreeMap<u32, u32>, children: &[Vec<u32>]) -> Result<Prim> {
        let fields = self.read_fields(specs[&index])?;
        let mut out = Prim { name: self.paths[index as usize].element.clone(), ..Prim::default() };
        self.charge(1, size_of::<Prim>())?;
        if let Some(specifier) = fields.get("specifier") {
            out.specifier = match specifier & PAYLOAD_MASK {
                0 => Specifier::Def,
                2 => Specifier::Class,
                _ => Specifier::Over,
            };
        }
        for (name, to) in [("typeName", &mut out.kind), ("displayName", &mut out.display_name)] {
            if let Some(value) = fields.get(name) {
                let value = self.read_value(*value, name)?;
                *to = value.and_then(|v| v.texts().first().cloned()).unwrap_or_default();
            }
        }
        if let Some(value) = fields.get("active") {
            out.inactive = value & PAYLOAD_MASK == 0;
        }
        for (name, has_offset) in [("references", true), ("payload", self.version >= [0, 8, 0])] {
            if let Some(value) = fields.get(name) {
                out.references.extend(self.read_references(*value, has_offset)?);
            }
        }
        for name in ["inheritPaths", "specializes"] {
            if let Some(value) = fields.get(name) {
                out.classes.extend(self.read_paths_of_list(*value)?);
            }
        }
        if let Some(value) = fields.get("variantSelection") {
            let mut cursor = self.file.with_offset(value & PAYLOAD_MASK);
            for _ in 0..cursor.read_count(8)? {
                let (set, selected) = (cursor.u32()?, cursor.u32()?);
                out.selections.insert(self.string(set)?.into(), self.string(selected)?.into());
            }
        }
        for child in &children[index as usize] {
            self.add_child(*child, (specs, children), &mut out)?;
        }
        if let Some(order) = fields.get("primChildren") {
            let order = self.read_token_vector(*order)?;
            let index_of_name: BTreeMap<&str, usize> =
                order.iter().enumerate().map(|(index, name)| (*name, index)).collect();
            out.children
                .sort_by_key(|child| index_of_name.get(child.name.as_str()).copied().unwrap_or(usize::MAX));
        }
        Ok(out)
    }

    fn add_child(
        &self,
        index: u32,
        (specs, children): (&BTreeMap<u32, u32>, &[Vec<u32>]),
        out: &mut Prim,
    ) -> Result<()> {
        let path = &self.paths[index as usize];
        if path.is_property {
            return self.add_property(&path.element, &self.read_fields(specs[&index])?, out);
        }
        let Some(variant) = path.element.strip_prefix('{') else {
            out.children.push(self.read_prim(index, specs, children)?);
            return Ok(());
        };
        // `{set=variant}`. The element of a set alone has no variant.
        let (set, name) = variant.trim_end_matches('}').split_once('=').unwrap_or_default();
        if !name.is_empty() {
            let variant = self.read_prim(index, specs, children)?;
            out.variants.entry(set.into()).or_default().insert(name.into(), variant);
        }
        Ok(())
    }

    fn add_property(&self, name: &str, fields: &Fields<'_>, out: &mut Prim) -> Result<()> {
        if let Some(targets) = fields.get("targetPaths") {
            out.relations.insert(name.into(), self.read_paths_of_list(*targets)?);
            return Ok(());
        }
        let kind = match fields.get("typeName") {
            Some(kind) => {
                self.read_value(*kind, "token")?.and_then(|v| v.texts().first().cloned()).unwrap_or_default()
            }
            None => return Ok(()),
        };
        if let Some(sources) = fields.get("connectionPaths") {
            out.connections.insert(name.into(), self.read_paths_of_list(*sources)?);
        }
        let mut attribute = Attribute { kind, ..Attribute::default() };
        if let Some(value) = fields.get("default") {
            attribute.value = self.read_value(*value, name)?;
        }
        if let Some(value) = fields.get("timeSamples") {
            attribute.samples = self.read_samples(*value, name)?;
        }
        if let Some(value) = fields.get("interpolation") {
            let value = self.read_value(*value, name)?;
            attribute.interpolation = value.and_then(|v| v.texts().first().cloned()).unwrap_or_default();
        }
        if let Some(value) = fields.get("elementSize") {
            attribute.element_size = (value & PAYLOAD_MASK) as u32 as usize;
        }
        out.attributes.insert(name.into(), Arc::new(attribute));
        Ok(())
    }

    fn read_token_vector(&self, value: u64) -> Result<Vec<&str>> {
        let mut cursor = self.file.with_offset(value & PAYLOAD_MASK);
        (0..cursor.read_count(4)?).map(|_| self.token(cursor.u32()?)).collect()
    }

    /// The paths of a list operation, without deleted and reordered ones.
    fn read_paths_of_list(&self, value: u64) -> Result<Vec<String>> {
        let mut out = Vec::new();
        self.read_list_op(value, 4, |cursor, is_kept| {
            let path = self.path_text(cursor.u32()?)?;
            out.extend(is_kept.then_some(path));
            Ok(())
        })?;
        Ok(out)
    }

    fn read_references(&self, value: u64, has_offset: bool) -> Result<Vec<Reference>> {
        let mut out = Vec::new();
        // Type 47 is a single payload; the other types are list operations.
        if value >> 48 & 0xff == 47 {
            let mut cursor = self.file.with_offset(value & PAYLOAD_MASK);
            return Ok(vec![self.read_reference(&mut cursor, has_offset, false)?]);
        }
        let is_payload = value >> 48 & 0xff == 55;
        self.read_list_op(value, 8, |cursor, is_kept| {
            let reference = self.read_reference(cursor, has_offset, !is_payload)?;
            out.extend(is_kept.then_some(reference));
            Ok(())
        })?;
        Ok(out)
    }

    fn read_reference(
        &self,
        cursor: &mut Cursor<'a>,
        has_offset: bool,
        has_custom_data: bool,
    ) -> Result<Reference> {
        let (file, path) = (cursor.u32()?, cursor.u32()?);
        let mut out = Reference { file: self.string(file)?.into(), scale: 1.0, ..Reference::default() };
        out.path = self.path_text(path).unwrap_or_default();
        if has_offset {
            (out.offset, out.scale) = (cursor.f64()?, cursor.f64()?);
        }
        if has_custom_data {
            for _ in 0..cursor.read_count(20)? {
                cursor.u32()?;
                let from = cursor.at as u64;
                let jump = cursor.u64()?;
                *cursor = cursor.with_offset(from.wrapping_add(jump).wrapping_add(8));
            }
        }
        Ok(out)
    }

    /// Reads a list operation. `receive` gets explicit, added, prepended and appended items with `true`, in this order, and deleted
    /// and reordered ones with `false`.
    fn read_list_op(
        &self,
        value: u64,
        size: usize,
        mut receive: impl FnMut(&mut Cursor<'a>, bool) -> Result<()>,
    ) -> Result<()> {
        let mut cursor = self.file.with_offset(value & PAYLOAD_MASK);
        let flags = cursor.take_array::<1>()?[0];
        for (bit, is_kept) in [(2, true), (4, true), (32, true), (64, true), (8, false), (16, false)] {
            if flags & bit != 0 {
                for _ in 0..cursor.read_count(size)? {
                    receive(&mut cursor, is_kept)?;
                }
            }
        }
        Ok(())
    }

    fn read_samples(&self, value: u64, name: &str) -> Result<Vec<(f64, Value)>> {
        let mut cursor = self.file.with_offset(value & PAYLOAD_MASK);
        let follow_jump = |cursor: &mut Cursor<'a>| -> Result<()> {
            let from = cursor.at as u64;
            let jump = cursor.u64()?;
            *cursor = cursor.with_offset(from.wrapping_add(jump));
            Ok(())
        };
        follow_jump(&mut cursor)?;
        let times = cursor.u64()?;
        follow_jump(&mut cursor)?;
        let times = self.read_times(times)?;
        let count = cursor.read_count(8)?;
        let mut out = Vec::with_capacity(count);
        for time in times.into_iter().take(count).filter(|time| time.is_finite()) {
            let value = cursor.u64()?;
            out.extend(self.read_value(value, name)?.map(|value| (time, value)));
        }
        out.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(out)
    }

    fn read_times(&self, value: u64) -> Result<Vec<f64>> {
        if value >> 48 & 0xff == 48 {
            let mut cursor = self.file.with_offset(value & PAYLOAD_MASK);
            return (0..cursor.read_count(8)?).map(|_| cursor.f64()).collect();
        }
        Ok(self.read_value(value, "times")?.map(|v| v.numbers().to_vec()).unwrap_or_default())
    }

    /// A value of an attribute; `None` for types that scene attributes do not have.
    fn read_value(&self, value: u64, name: &str) -> Result<Option<Value>> {
        let (kind, payload) = ((value >> 48 & 0xff) as u8, value & PAYLOAD_MASK);
        if matches!(kind, 10..=12) {
            return self.read_texts(value, kind).map(Some);
        }
        let Some((component, width)) = number_layout(kind) else { return Ok(None) };
        if value & IS_INLINED != 0 {
            return Ok(Some(Value::Numbers(decode_inlined(component, width, kind, payload).into())));
        }
        let mut cursor = self.file.with_offset(payload);
        if value & IS_ARRAY == 0 {
            let list = self.read_numbers(&mut cursor, component, width)?;
            return Ok(Some(Value::Numbers(list.into())));
        }
        if payload == 0 {
            return Ok(Some(Value::Numbers([].into())));
        }
        if self.version < [0, 5, 0] {
            cursor.u32()?;
        }
        let count = match self.version < [0, 7, 0] {
            true => u64::from(cursor.u32()?),
            false => cursor.u64()?,
        };
        let count = usize::try_from(count).unwrap_or(usize::MAX);
        let list = match value & IS_COMPRESSED != 0 && count >= MIN_COMPRESSED_LENGTH {
            true => self.read_compressed_numbers(&mut cursor, component, count)?,
            false => self.read_numbers(&mut cursor, component, count.saturating_mul(width))?,
        };
        if list.iter().any(|v| v.is_nan()) {
            return Err(damage_error(format!("{name} has a value that is not a number")));
        }
        Ok(Some(Value::Numbers(list.into())))
    }

    fn read_texts(&self, value: u64, kind: u8) -> Result<Value> {
        let text = |index: u32| if kind == 10 { self.string(index) } else { self.token(index) };
        if value & IS_ARRAY == 0 {
            return Ok(Value::Texts([text((value & PAYLOAD_MASK) as u32)?.to_string()].into()));
        }
        if value & PAYLOAD_MASK == 0 {
            return Ok(Value::Texts([].into()));
        }
        let mut cursor = self.file.with_offset(value & PAYLOAD_MASK);
        if self.version < [0, 5, 0] {
            cursor.u32()?;
        }
        let count = match self.version < [0, 7, 0] {
            true => cursor.u32()? as usize,
            false => cursor.read_count(4)?,
        };
        let mut out = Vec::new();
        for _ in 0..count {
            let text = text(cursor.u32()?)?;
            self.charge(text.len() + 24, 1)?;
            out.push(text.to_string());
        }
        Ok(Value::Texts(out.into()))
    }

    fn read_numbers(&self, cursor: &mut Cursor<'a>, component: Component, count: usize) -> Result<Vec<f64>> {
        let bytes = cursor.take(count.saturating_mul(component.size()))?;
        self.charge(count, 8)?;
        Ok(bytes.chunks_exact(component.size()).map(|b| component.number(b)).collect())
    }

    /// Reads a compressed array of scalars.
    fn read_compressed_numbers(
        &self,
        cursor: &mut Cursor<'a>,
        component: Component,
        count: usize,
    ) -> Result<Vec<f64>> {
        let numbers = |list: Vec<i32>| list.into_iter().map(f64::from).collect();
        match component {
            Component::Int | Component::Uint => {
                let list = self.read_integers(cursor, self.checked_count(count)?)?;
                self.charge(count, 8)?;
                let signed = component == Component::Int;
                Ok(list
                    .into_iter()
                    .map(|v| if signed { f64::from(v) } else { f64::from(v as u32) })
                    .collect())
            }
            Component::Half | Component::Float | Component::Double => match cursor.take_array::<1>()?[0] {
                b'i' => self.read_integers(cursor, self.checked_count(count)?).map(numbers),
                b't' => {
                    let length = cursor.u32()? as usize;
                    let table = self.read_numbers(cursor, component, length)?;
                    let places = self.read_integers(cursor, self.checked_count(count)?)?;
                    self.charge(count, 8)?;
                    let place = |place: i32| table.get(place as u32 as usize).copied();
                    let list: Option<Vec<f64>> = places.into_iter().map(place).collect();
                    list.ok_or_else(|| damage_error("refers to a number that it does not have"))
                }
                _ => Err(damage_error("has an array that is compressed in an unknown way")),
            },
            _ => Err(damage_error("has a compressed array of a type that is never compressed")),
        }
    }

    fn checked_count(&self, count: usize) -> Result<usize> {
        match count <= self.file.bytes.len().saturating_mul(4 * MAX_EXPANSION_RATIO) {
            true => Ok(count),
            false => {
                Err(damage_error(format!("declares {count} elements, but the file is too short for them")))
            }
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Component {
    Byte,
    Int,
    Uint,
    Int64,
    Uint64,
    Half,
    Float,
    Double,
}

impl Component {
    fn size(self) -> usize {
        match self {
            Component::Byte => 1,
            Component::Half => 2,
            Component::Int | Component::Uint | Component::Float => 4,
            Component::Int64 | Component::Uint64 | Component::Double => 8,
        }
    }

    /// Reads a number from exactly as many bytes as it has.
    fn number(self, bytes: &[u8]) -> f64 {
        let mut b = [0; 8];
        b[..bytes.len()].copy_from_slice(bytes);
        let four = [b[0], b[1], b[2], b[3]];
        match self {
            Component::Byte => f64::from(b[0]),
            Component::Half => f64::from(half::f16::from_le_bytes([b[0], b[1]])),
            Component::Int => f64::from(i32::from_le_bytes(four)),
            Component::Uint => f64::from(u32::from_le_bytes(four)),
            Component::Float => f64::from(f32::from_le_bytes(four)),
            Component::Int64 => i64::from_le_bytes(b) as f64,
            Component::Uint64 => u64::from_le_bytes(b) as f64,
            Component::Double => f64::from_le_bytes(b),
        }
    }
}

/// Component and width of a numeric type code; `None` for other types.
fn number_layout(kind: u8) -> Option<(Component, usize)> {
    use Component::{Byte, Double, Float, Half, Int, Int64, Uint, Uint64};
    Some(match kind {
        1 | 2 => (Byte, 1),
        3 => (Int, 1),
        4 => (Uint, 1),
        5 => (Int64, 1),
        6 => (Uint64, 1),
        7 => (Half, 1),
        8 => (Float, 1),
        9 | 56 => (Double, 1),
        13 => (Double, 4),
        14 => (Double, 9),
        15 => (Double, 16),
        16 => (Double, 4),
        17 => (Float, 4),
        18 => (Half, 4),
        19 => (Double, 2),
        20 => (Float, 2),
        21 => (Half, 2),
        22 => (Int, 2),
        23 => (Double, 3),
        24 => (Float, 3),
        25 => (Half, 3),
        26 => (Int, 3),
        27 => (Double, 4),
        28 => (Float, 4),
        29 => (Half, 4),
        30 => (Int, 4),
        _ => return None,
    })
}

/// A value stored in its own description: vectors as one signed byte for each component, matrices as bytes of their diagonal.
fn decode_inlined(component: Component, width: usize, kind: u8, payload: u64) -> Vec<f64> {
    let bytes = payload.to_le_bytes();
    let byte = |i: usize| f64::from(bytes[i] as i8);
    match (kind, width) {
        (13..=15, _) => {
            let side = [2, 3, 4][usize::from(kind) - 13];
            (0..side * side).map(|i| if i % (side + 1) == 0 { byte(i / (side + 1)) } else { 0.0 }).collect()
        }
        (_, 1) => {
            let four = &bytes[..4];
            vec![match component {
                Component::Byte => f64::from(bytes[0]),
                Component::Half => Component::Half.number(&bytes[..2]),
                Component::Int | Component::Int64 => Component::Int.number(four),
                Component::Uint | Component::Uint64 => Component::Uint.number(four),
                Component::Float | Component::Double => Component::Float.number(four),
            }]
        }
        (_, width) => (0..width.min(6)).map(byte).collect(),
    }
}
