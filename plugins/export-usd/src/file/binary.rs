//! Layers as crate files, `.usdc` (pxr/usd/usd/crateFile.cpp): first the values one after the other, then tables that say which
//! spec has which value.
//!
//! The header states where the tables begin, so it is written last.

use crate::file::integers::{compress, encode_differences};
use crate::file::out::Out;
use crate::file::paths::Paths;
use crate::layer::{
    Attribute, Component, Layer, Meta, Prim, Property, SampleValues, Samples, Specifier, Type, Value,
};
use std::collections::BTreeMap;
use std::io::Result;
use std::rc::Rc;

/// Version of the format. Readers of the last eight years know it.
const VERSION: [u8; 8] = [0, 8, 0, 0, 0, 0, 0, 0];
/// Bytes of the header.
pub(crate) const HEADER_BYTES: usize = 88;

const IS_ARRAY: u64 = 1 << 63;
const IS_INLINED: u64 = 1 << 62;

/// Type codes of values that are not attribute types.
const DICTIONARY: u8 = 31;
const TOKEN_LIST_OP: u8 = 32;
const PATH_LIST_OP: u8 = 34;
const REFERENCE_LIST_OP: u8 = 35;
const TOKEN_VECTOR: u8 = 41;
const SPECIFIER: u8 = 42;
const VARIABILITY: u8 = 44;
const TIME_SAMPLES: u8 = 46;
const DOUBLE_VECTOR: u8 = 48;

/// Flags of list operations: an explicit list, or items placed before those of weaker layers.
const EXPLICIT_LIST: u8 = 1 | 2;
const PREPENDED_ITEMS: u8 = 32;

/// Kinds of specs.
const ATTRIBUTE_SPEC: i32 = 1;
const PRIM_SPEC: i32 = 6;
const ROOT_SPEC: i32 = 7;
const RELATIONSHIP_SPEC: i32 = 8;

/// Header of a file whose table of contents begins at a position.
fn header(tables_at: u64) -> [u8; HEADER_BYTES] {
    let mut out = [0; HEADER_BYTES];
    out[..8].copy_from_slice(b"PXR-USDC");
    out[8..16].copy_from_slice(&VERSION);
    out[16..24].copy_from_slice(&tables_at.to_le_bytes());
    out
}

/// Writes everything after the header, and returns the header.
pub(crate) fn write_body(layer: &Layer<'_>, out: &mut Out<'_>) -> Result<[u8; HEADER_BYTES]> {
    let mut writer = Writer {
        out,
        tokens: Table::default(),
        strings: Table::default(),
        fields: Table::default(),
        field_sets: Vec::new(),
        paths: Paths::new(),
        specs: Vec::new(),
        times: Vec::new(),
    };
    // A property path stores its token negated, so no name may have token 0.
    writer.add_token(";-)");
    writer.write_layer(layer)?;
    Ok(header(writer.write_tables()?))
}

/// Distinct items, numbered in the order of their first use.
struct Table<T> {
    index_of_item: BTreeMap<T, u32>,
    items: Vec<T>,
}

impl<T> Default for Table<T> {
    fn default() -> Table<T> {
        Table { index_of_item: BTreeMap::new(), items: Vec::new() }
    }
}

impl<T: Ord + Clone> Table<T> {
    fn index_of(&mut self, item: T) -> u32 {
        if let Some(index) = self.index_of_item.get(&item) {
            return *index;
        }
        let index = self.items.len() as u32;
        self.index_of_item.insert(item.clone(), index);
        self.items.push(item);
        index
    }
}

struct Writer<'o, 'w> {
    out: &'o mut Out<'w>,
    tokens: Table<String>,
    /// Token index of each string.
    strings: Table<u32>,
    /// Fields: token index of the name, and value.
    fields: Table<(u32, u64)>,
    field_sets: Vec<i32>,
    paths: Paths,
    /// Specs: path index, index of the first field, kind.
    specs: Vec<[i32; 3]>,
    /// Time lists that are written already, with their positions.
    times: Vec<(Rc<[f64]>, u64)>,
}

/// Fields of one spec, by name and value.
type Fields = Vec<(&'static str, u64)>;

fn inlined(code: u8, payload: u64) -> u64 {
    u64::from(code) << 48 | IS_INLINED | payload
}

impl Writer<'_, '_> {
    fn add_token(&mut self, text: &str) -> u32 {
        self.tokens.index_of(text.to_string())
    }

    fn add_string(&mut self, text: &str) -> u32 {
        let token = self.add_token(text);
        self.strings.index_of(token)
    }

    fn add_path(&mut self, path: &str) -> u32 {
        let Writer { paths, tokens, .. } = self;
        paths.index_of(path, |name| tokens.index_of(name.to_string()))
    }

    /// The description of a value that is written at the current position.
    fn value_at_position(&self, code: u8) -> u64 {
        u64::from(code) << 48 | self.out.position()
    }

    fn write_u64(&mut self, word: u64) -> Result<()> {
        self.out.put(&word.to_le_bytes())
    }

    fn write_indices(&mut self, list: &[u32]) -> Result<()> {
        self.write_u64(list.len() as u64)?;
        list.iter().try_for_each(|index| self.out.put(&index.to_le_bytes()))
    }

    fn write_token_vector(&mut self, names: &[&str]) -> Result<u64> {
        let list: Vec<u32> = names.iter().map(|name| self.add_token(name)).collect();
        let value = self.value_at_position(TOKEN_VECTOR);
        self.write_indices(&list)?;
        Ok(value)
    }

    /// Writes a list operation over indices. `kind` is [`EXPLICIT_LIST`] or [`PREPENDED_ITEMS`].
    fn write_list_op(&mut self, code: u8, kind: u8, list: &[u32]) -> Result<u64> {
        let value = self.value_at_position(code);
        self.out.put(&[kind])?;
        self.write_indices(list)?;
        Ok(value)
    }

    fn add_spec(&mut self, path: u32, kind: i32, fields: Fields) {
        let first = self.field_sets.len() as i32;
        for (name, value) in fields {
            let name = self.add_token(name);
            let field = self.fields.index_of((name, value));
            self.field_sets.push(field as i32);
        }
        self.field_sets.push(-1);
        self.specs.push([path as i32, first, kind]);
    }

    fn write_layer(&mut self, layer: &Layer<'_>) -> Result<()> {
        let names: Vec<&str> = layer.prims.iter().map(|prim| prim.name.as_str()).collect();
        let mut fields: Fields = Vec::new();
        fields.push(("primChildren", self.write_token_vector(&names)?));
        let default = self.add_token(&layer.default_prim);
        fields.push(("defaultPrim", inlined(crate::layer::TOKEN.code, default.into())));
        for (name, number) in [
            ("startTimeCode", 0.0),
            ("endTimeCode", layer.end),
            ("timeCodesPerSecond", layer.frames_per_second),
            ("framesPerSecond", layer.frames_per_second),
            ("metersPerUnit", 1.0),
        ] {
            fields.push((name, self.write_double(number)?));
        }
        let up = self.add_token("Y");
        fields.push(("upAxis", inlined(crate::layer::TOKEN.code, up.into())));
        let comment = self.add_string(&layer.comment);
        fields.push(("comment", inlined(crate::layer::STRING.code, comment.into())));
        if !layer.custom.is_empty() {
            fields.push(("customLayerData", self.write_dictionary(&layer.custom)?));
        }
        self.add_spec(0, ROOT_SPEC, fields);
        layer.prims.iter().try_for_each(|prim| self.write_prim(prim, 0))
    }

    fn write_prim(&mut self, prim: &Prim<'_>, parent: u32) -> Result<()> {
        let name = self.add_token(&prim.name);
        let path = self.paths.child_index(parent, name, false);
        let specifier = match prim.specifier {
            Specifier::Def => 0,
            Specifier::Over => 1,
            Specifier::Class => 2,
        };
        let mut fields = vec![("specifier", inlined(SPECIFIER, specifier))];
        if !prim.kind.is_empty() {
            let kind = self.add_token(prim.kind);
            fields.push(("typeName", inlined(crate::layer::TOKEN.code, kind.into())));
        }
        if !prim.api.is_empty() {
            let list: Vec<u32> = prim.api.iter().map(|name| self.add_token(name)).collect();
            fields.push(("apiSchemas", self.write_list_op(TOKEN_LIST_OP, PREPENDED_ITEMS, &list)?));
        }
        if let Some(reference) = &prim.reference {
            fields.push(("references", self.write_reference(reference)?));
        }
        if let Some(name) = &prim.display_name {
            let name = self.add_string(name);
            fields.push(("displayName", inlined(crate::layer::STRING.code, name.into())));
        }
        if !prim.custom.is_empty() {
            fields.push(("customData", self.write_dictionary(&prim.custom)?));
        }
        let names: Vec<&str> = prim
            .properties
            .iter()
            .map(|property| match property {
                Property::Attribute(attribute) => attribute.name.as_str(),
                Property::Relationship { name, .. } => name,
            })
            .collect();
        if !names.is_empty() {
            fields.push(("properties", self.write_token_vector(&names)?));
        }
        let names: Vec<&str> = prim.children.iter().map(|prim| prim.name.as_str()).collect();
        if !names.is_empty() {
            fields.push(("primChildren", self.write_token_vector(&names)?));
        }
        self.add_spec(path, PRIM_SPEC, fields);
        for property in &prim.properties {
            match property {
                Property::Attribute(attribute) => self.write_attribute(attribute, path)?,
                Property::Relationship { name, targets } => self.write_relationship(name, targets, path)?,
            }
        }
        prim.children.iter().try_for_each(|child| self.write_prim(child, path))
    }

    fn write_reference(&mut self, path: &str) -> Result<u64> {
        let (file, path) = (self.add_string(""), self.add_path(path));
        let value = self.value_at_position(REFERENCE_LIST_OP);
        self.out.put(&[PREPENDED_ITEMS])?;
        self.write_u64(1)?;
        self.out.put(&file.to_le_bytes())?;
        self.out.put(&path.to_le_bytes())?;
        // Layer offset 0, layer scale 1, no custom data.
        self.out.put(&0.0f64.to_le_bytes())?;
        self.out.put(&1.0f64.to_le_bytes())?;
        self.write_u64(0)?;
        Ok(value)
    }

    fn write_relationship(&mut self, name: &str, targets: &[String], prim: u32) -> Result<()> {
        let token = self.add_token(name);
        let path = self.paths.child_index(prim, token, true);
        let list: Vec<u32> = targets.iter().map(|target| self.add_path(target)).collect();
        let targets = self.write_list_op(PATH_LIST_OP, EXPLICIT_LIST, &list)?;
        self.add_spec(
            path,
            RELATIONSHIP_SPEC,
            vec![("variability", inlined(VARIABILITY, 1)), ("targetPaths", targets)],
        );
        Ok(())
    }

    fn write_attribute(&mut self, a: &Attribute<'_>, prim: u32) -> Result<()> {
        let token = self.add_token(&a.name);
        let path = self.paths.child_index(prim, token, true);
        let name = match a.is_array {
            true => self.add_token(&format!("{}[]", a.value_type.name)),
            false => self.add_token(a.value_type.name),
        };
        let mut fields = vec![("typeName", inlined(crate::layer::TOKEN.code, name.into()))];
        if a.is_custom() {
            fields.push(("custom", inlined(crate::layer::BOOL.code, 1)));
        }
        if a.uniform {
            fields.push(("variability", inlined(VARIABILITY, 1)));
        }
        if let Some(value) = &a.value {
            fields.push(("default", self.write_value(a.value_type, value)?));
        }
        if let Some(samples) = &a.samples {
            fields.push(("timeSamples", self.write_samples(a.value_type, samples)?));
        }
        if let Some(interpolation) = a.interpolation {
            let token = self.add_token(interpolation);
            fields.push(("interpolation", inlined(crate::layer::TOKEN.code, token.into())));
        }
        if let Some(size) = a.element_size {
            fields.push(("elementSize", inlined(crate::layer::INT.code, size as u64)));
        }
        if let Some(source) = &a.connection {
            let source = self.add_path(source);
            fields.push(("connectionPaths", self.write_list_op(PATH_LIST_OP, EXPLICIT_LIST, &[source])?));
        }
        self.add_spec(path, ATTRIBUTE_SPEC, fields);
        Ok(())
    }

    fn write_value(&mut self, value_type: Type, value: &Value<'_>) -> Result<u64> {
        match value {
            Value::Text(text) => {
                let index = self.add_text(value_type, text);
                Ok(inlined(value_type.code, index.into()))
            }
            Value::Texts(list) => {
                let list: Vec<u32> = list.iter().map(|text| self.add_text(value_type, text)).collect();
                let value = self.value_at_position(value_type.code) | IS_ARRAY;
                self.write_indices(&list)?;
                Ok(value)
            }
            Value::Numbers { count, number } => self.write_numbers(value_type, *count, &**number),
        }
    }

    fn add_text(&mut self, value_type: Type, text: &str) -> u32 {
        if value_type.name == "string" { self.add_string(text) } else { self.add_token(text) }
    }

    fn write_numbers(
        &mut self,
        value_type: Type,
        count: Option<usize>,
        number: &dyn Fn(usize) -> f64,
    ) -> Result<u64> {
        let Some(count) = count else {
            if value_type.width == 1 && value_type.component != Component::Double {
                let mut bytes = [0; 8];
                let mut written = Vec::new();
                append_numbers(value_type.component, &[number(0)], &mut written);
                bytes[..written.len()].copy_from_slice(&written);
                return Ok(inlined(value_type.code, u64::from_le_bytes(bytes)));
            }
            let value = self.value_at_position(value_type.code);
            self.write_number_list(value_type, value_type.width, number)?;
            return Ok(value);
        };
        if count == 0 {
            return Ok(u64::from(value_type.code) << 48 | IS_ARRAY);
        }
        let value = self.value_at_position(value_type.code) | IS_ARRAY;
        self.write_u64(count as u64)?;
        self.write_number_list(value_type, count * value_type.width, number)?;
        Ok(value)
    }

    fn write_number_list(
        &mut self,
        value_type: Type,
        numbers: usize,
        number: &dyn Fn(usize) -> f64,
    ) -> Result<()> {
        const NUMBERS_PER_CHUNK: usize = 512;
        let (mut list, mut bytes) = (Vec::with_capacity(NUMBERS_PER_CHUNK), Vec::new());
        for from in (0..numbers).step_by(NUMBERS_PER_CHUNK) {
            list.clear();
            list.extend((from..numbers.min(from + NUMBERS_PER_CHUNK)).map(number));
            bytes.clear();
            append_numbers(value_type.component, &list, &mut bytes);
            self.out.put(&bytes)?;
        }
        Ok(())
    }

    fn write_double(&mut self, number: f64) -> Result<u64> {
        self.write_numbers(crate::layer::DOUBLE, None, &|_| number)
    }

    fn write_samples(&mut self, value_type: Type, samples: &Samples<'_>) -> Result<u64> {
        let times = self.write_times(&samples.times)?;
        let mut values = Vec::with_capacity(samples.times.len());
        match &samples.values {
            SampleValues::Texts(list) => {
                for text in list {
                    let index = self.add_text(value_type, text);
                    values.push(inlined(value_type.code, index.into()));
                }
            }
            SampleValues::Numbers { count, each } if count.is_some() || value_type.width > 1 => {
                // All samples have the same length, so each one's position is known beforehand.
                let flag = if count.is_some() { IS_ARRAY } else { 0 };
                let head = if count.is_some() { 8 } else { 0 };
                let numbers = count.unwrap_or(1) * value_type.width;
                let length = head + numbers as u64 * byte_size(value_type.component);
                let first = self.value_at_position(value_type.code) | flag;
                let number = samples.times.len() as u64;
                values.extend((0..number).map(|index| first + index * length));
                let mut bytes = Vec::new();
                each(&mut |list| {
                    bytes.clear();
                    if let Some(count) = count {
                        bytes.extend((*count as u64).to_le_bytes());
                    }
                    append_numbers(value_type.component, list, &mut bytes);
                    self.out.put(&bytes)
                })?;
                debug_assert_eq!(self.value_at_position(value_type.code) | flag, first + number * length);
            }
            SampleValues::Numbers { each, .. } => {
                let mut list = Vec::new();
                each(&mut |numbers| {
                    list.extend_from_slice(numbers);
                    Ok(())
                })?;
                for number in list {
                    values.push(self.write_numbers(value_type, None, &|_| number)?);
                }
            }
        }
        let value = self.value_at_position(TIME_SAMPLES);
        // The list of times and the list of values follow, each after its distance in bytes.
        self.write_u64(8)?;
        self.write_u64(times)?;
        self.write_u64(8)?;
        self.write_u64(values.len() as u64)?;
        values.into_iter().try_for_each(|value| self.write_u64(value))?;
        Ok(value)
    }

    fn write_times(&mut self, times: &Rc<[f64]>) -> Result<u64> {
        let is_same = |known: &(Rc<[f64]>, u64)| Rc::ptr_eq(&known.0, times);
        if let Some((_, value)) = self.times.iter().rev().take(4).find(|known| is_same(known)) {
            return Ok(*value);
        }
        let value = self.value_at_position(DOUBLE_VECTOR);
        self.write_u64(times.len() as u64)?;
        self.write_number_list(crate::layer::DOUBLE, times.len(), &|i| times[i])?;
        self.times.push((times.clone(), value));
        Ok(value)
    }

    fn write_dictionary(&mut self, entries: &[(String, Meta)]) -> Result<u64> {
        let mut values = Vec::with_capacity(entries.len());
        for (key, meta) in entries {
            let key = self.add_string(key);
            values.push((key, self.write_meta(meta)?));
        }
        let value = self.value_at_position(DICTIONARY);
        self.write_u64(values.len() as u64)?;
        for (key, value) in values {
            self.out.put(&key.to_le_bytes())?;
            self.write_u64(8)?;
            self.write_u64(value)?;
        }
        Ok(value)
    }

    fn write_meta(&mut self, meta: &Meta) -> Result<u64> {
        match meta {
            Meta::Double(number) => self.write_double(*number),
            Meta::Text(text) => {
                let index = self.add_string(text);
                Ok(inlined(crate::layer::STRING.code, index.into()))
            }
            Meta::Dictionary(inner) => self.write_dictionary(inner),
        }
    }

    /// Writes the tables, then the table of contents. Returns the position of the latter.
    fn write_tables(mut self) -> Result<u64> {
        let mut places: Vec<(&str, u64, u64)> = Vec::new();
        for name in ["TOKENS", "STRINGS", "FIELDS", "FIELDSETS", "PATHS", "SPECS"] {
            let from = self.out.position();
            match name {
                "TOKENS" => self.write_tokens_table()?,
                "STRINGS" => {
                    let list = std::mem::take(&mut self.strings.items);
                    self.write_indices(&list)?;
                }
                "FIELDS" => self.write_fields_table()?,
                "FIELDSETS" => {
                    let list = std::mem::take(&mut self.field_sets);
                    self.write_u64(list.len() as u64)?;
                    self.write_compressed_integers(&list)?;
                }
                "PATHS" => {
                    let encoded = self.paths.encode_tree();
                    self.write_u64(self.paths.len() as u64)?;
                    self.write_u64(encoded.indices.len() as u64)?;
                    [encoded.indices, encoded.tokens, encoded.jumps]
                        .iter()
                        .try_for_each(|list| self.write_compressed_integers(list))?;
                }
                _ => {
                    let specs = std::mem::take(&mut self.specs);
                    self.write_u64(specs.len() as u64)?;
                    for part in 0..3 {
                        let list: Vec<i32> = specs.iter().map(|spec| spec[part]).collect();
                        self.write_compressed_integers(&list)?;
                    }
                }
            }
            places.push((name, from, self.out.position() - from));
        }
        let at = self.out.position();
        self.write_u64(places.len() as u64)?;
        for (name, from, length) in places {
            let mut bytes = [0; 16];
            bytes[..name.len()].copy_from_slice(name.as_bytes());
            self.out.put(&bytes)?;
            self.write_u64(from)?;
            self.write_u64(length)?;
        }
        Ok(at)
    }

    fn write_tokens_table(&mut self) -> Result<()> {
        let mut bytes = Vec::new();
        for token in &self.tokens.items {
            bytes.extend(token.bytes().filter(|b| *b != 0).chain([0]));
        }
        self.write_u64(self.tokens.items.len() as u64)?;
        self.write_u64(bytes.len() as u64)?;
        self.write_compressed(&bytes)
    }

    fn write_fields_table(&mut self) -> Result<()> {
        let fields = std::mem::take(&mut self.fields.items);
        self.write_u64(fields.len() as u64)?;
        let names: Vec<i32> = fields.iter().map(|(name, _)| *name as i32).collect();
        self.write_compressed_integers(&names)?;
        let values: Vec<u8> = fields.iter().flat_map(|(_, value)| value.to_le_bytes()).collect();
        self.write_compressed(&values)
    }

    fn write_compressed_integers(&mut self, list: &[i32]) -> Result<()> {
        self.write_compressed(&encode_differences(list))
    }

    fn write_compressed(&mut self, bytes: &[u8]) -> Result<()> {
        let bytes = compress(bytes);
        self.write_u64(bytes.len() as u64)?;
        self.out.put(&bytes)
    }
}

fn byte_size(component: Component) -> u64 {
    match component {
        Component::Bool => 1,
        Component::Half => 2,
        Component::Int | Component::Float | Component::Text => 4,
        Component::Double => 8,
    }
}

/// Appends numbers in the file's format. The component is matched once a list, so that nearly all of the time goes to storing.
fn append_numbers(component: Component, numbers: &[f64], out: &mut Vec<u8>) {
    match component {
        Component::Bool => out.extend(numbers.iter().map(|number| u8::from(*number != 0.0))),
        Component::Int | Component::Text => append_each(numbers, out, |number| (number as i32).to_le_bytes()),
        Component::Half => append_each(numbers, out, |number| half::f16::from_f64(number).to_le_bytes()),
        Component::Float => append_each(numbers, out, |number| (number as f32).to_le_bytes()),
        Component::Double => append_each(numbers, out, f64::to_le_bytes),
    }
}

fn append_each<const N: usize>(numbers: &[f64], out: &mut Vec<u8>, bytes_of: impl Fn(f64) -> [u8; N]) {
    let from = out.len();
    out.resize(from + N * numbers.len(), 0);
    for (bytes, number) in out[from..].as_chunks_mut::<N>().0.iter_mut().zip(numbers) {
        *bytes = bytes_of(*number);
    }
}
