//! Layers as text, `.usda`.

use crate::file::Out;
use crate::layer::{
    Attribute, Component, Layer, Meta, Prim, Property, SampleValues, Samples, Specifier, Type, Value,
};
use std::fmt::Write as _;
use std::io::Result;

/// Bytes of text that are collected before they are written.
const CHUNK_BYTES: usize = 1 << 14;

pub(crate) fn write(layer: &Layer<'_>, out: &mut Out<'_>) -> Result<()> {
    let mut text = Text { out, line: String::new() };
    text.write_header(layer);
    for prim in &layer.prims {
        text.write_prim(prim, 0)?;
    }
    text.flush_line()
}

struct Text<'o, 'w> {
    out: &'o mut Out<'w>,
    line: String,
}

impl Text<'_, '_> {
    fn flush_line(&mut self) -> Result<()> {
        self.out.put(self.line.as_bytes())?;
        self.line.clear();
        Ok(())
    }

    fn flush_if_long(&mut self) -> Result<()> {
        if self.line.len() >= CHUNK_BYTES { self.flush_line() } else { Ok(()) }
    }

    fn write_header(&mut self, layer: &Layer<'_>) {
        let line = &mut self.line;
        let Layer { end, frames_per_second: rate, .. } = layer;
        line.push_str("#usda 1.0\n(\n");
        let _ = writeln!(line, "    {}", quoted(&layer.comment));
        write_dictionary("customLayerData", &layer.custom, 1, line);
        let _ = writeln!(line, "    defaultPrim = {}", quoted(&layer.default_prim));
        let _ =
            writeln!(line, "    endTimeCode = {end}\n    framesPerSecond = {rate}\n    metersPerUnit = 1");
        let _ =
            writeln!(line, "    startTimeCode = 0\n    timeCodesPerSecond = {rate}\n    upAxis = \"Y\"\n)");
    }

    fn write_prim(&mut self, prim: &Prim<'_>, depth: usize) -> Result<()> {
        let indent = "    ".repeat(depth);
        let specifier = match prim.specifier {
            Specifier::Def => "def",
            Specifier::Over => "over",
            Specifier::Class => "class",
        };
        let _ = write!(self.line, "\n{indent}{specifier} ");
        if !prim.kind.is_empty() {
            let _ = write!(self.line, "{} ", prim.kind);
        }
        let _ = write!(self.line, "\"{}\"", prim.name);
        self.write_metadata(prim, depth);
        let _ = writeln!(self.line, "\n{indent}{{");
        for property in &prim.properties {
            match property {
                Property::Attribute(attribute) => self.write_attribute(attribute, depth + 1)?,
                Property::Relationship { name, targets } => {
                    let _ = write!(self.line, "{indent}    rel {name} = ");
                    let list: Vec<String> = targets.iter().map(|path| format!("<{path}>")).collect();
                    match &list[..] {
                        [only] => self.line.push_str(only),
                        _ => {
                            let _ = write!(self.line, "[{}]", list.join(", "));
                        }
                    }
                    self.line.push('\n');
                }
            }
            self.flush_if_long()?;
        }
        for child in &prim.children {
            self.write_prim(child, depth + 1)?;
        }
        let _ = writeln!(self.line, "{indent}}}");
        self.flush_if_long()
    }

    fn write_metadata(&mut self, prim: &Prim<'_>, depth: usize) {
        let indent = "    ".repeat(depth);
        let mut lines = String::new();
        if !prim.api.is_empty() {
            let list: Vec<String> = prim.api.iter().map(|name| quoted(name)).collect();
            let _ = writeln!(lines, "{indent}    prepend apiSchemas = [{}]", list.join(", "));
        }
        write_dictionary("customData", &prim.custom, depth + 1, &mut lines);
        if let Some(name) = &prim.display_name {
            let _ = writeln!(lines, "{indent}    displayName = {}", quoted(name));
        }
        if let Some(path) = &prim.reference {
            let _ = writeln!(lines, "{indent}    prepend references = <{path}>");
        }
        if !lines.is_empty() {
            let _ = write!(self.line, " (\n{lines}{indent})");
        }
    }

    fn write_attribute(&mut self, a: &Attribute<'_>, depth: usize) -> Result<()> {
        let indent = "    ".repeat(depth);
        let custom = if a.is_custom() { "custom " } else { "" };
        let uniform = if a.uniform { "uniform " } else { "" };
        let array = if a.is_array { "[]" } else { "" };
        let declared = format!("{indent}{custom}{uniform}{}{array} {}", a.value_type.name, a.name);
        if a.value.is_some() || a.samples.is_none() && a.connection.is_none() {
            self.line.push_str(&declared);
            if let Some(value) = &a.value {
                self.line.push_str(" = ");
                self.write_value(a.value_type, value)?;
            }
            if a.interpolation.is_some() || a.element_size.is_some() {
                self.line.push_str(" (\n");
                if let Some(size) = a.element_size {
                    let _ = writeln!(self.line, "{indent}    elementSize = {size}");
                }
                if let Some(interpolation) = a.interpolation {
                    let _ = writeln!(self.line, "{indent}    interpolation = \"{interpolation}\"");
                }
                let _ = write!(self.line, "{indent})");
            }
            self.line.push('\n');
        }
        if let Some(samples) = &a.samples {
            let _ = writeln!(self.line, "{declared}.timeSamples = {{");
            self.write_samples(a.value_type, samples, &indent)?;
            let _ = writeln!(self.line, "{indent}}}");
        }
        if let Some(path) = &a.connection {
            let _ = writeln!(self.line, "{declared}.connect = <{path}>");
        }
        Ok(())
    }

    fn write_samples(&mut self, value_type: Type, samples: &Samples<'_>, indent: &str) -> Result<()> {
        match &samples.values {
            SampleValues::Texts(list) => {
                for (time, text) in samples.times.iter().zip(list) {
                    let _ = writeln!(self.line, "{indent}    {time}: {},", quoted(text));
                }
                Ok(())
            }
            SampleValues::Numbers { count, each } => {
                let mut place = 0;
                each(&mut |numbers| {
                    let _ = write!(self.line, "{indent}    {}: ", samples.times[place]);
                    place += 1;
                    match count {
                        None => write_element(value_type, &|i| numbers[i], 0, &mut self.line),
                        Some(count) => self.write_array(value_type, *count, &|i| numbers[i])?,
                    }
                    self.line.push_str(",\n");
                    self.flush_if_long()
                })
            }
        }
    }

    fn write_value(&mut self, value_type: Type, value: &Value<'_>) -> Result<()> {
        match value {
            Value::Text(text) => self.line.push_str(&self::value_text(value_type, text)),
            Value::Texts(list) => {
                let list: Vec<String> = list.iter().map(|text| self::value_text(value_type, text)).collect();
                let _ = write!(self.line, "[{}]", list.join(", "));
            }
            Value::Numbers { count: None, number } => write_element(value_type, &**number, 0, &mut self.line),
            Value::Numbers { count: Some(count), number } => {
                self.write_array(value_type, *count, &**number)?
            }
        }
        Ok(())
    }

    fn write_array(&mut self, value_type: Type, count: usize, number: &dyn Fn(usize) -> f64) -> Result<()> {
        self.line.push('[');
        for index in 0..count {
            if index > 0 {
                self.line.push_str(", ");
            }
            write_element(value_type, number, index * value_type.width, &mut self.line);
            self.flush_if_long()?;
        }
        self.line.push(']');
        Ok(())
    }
}

fn value_text(value_type: Type, text: &str) -> String {
    if value_type.name == "asset" { format!("@{text}@") } else { quoted(text) }
}

/// A string in quotes, with escapes.
fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            '\n' => out.push_str("\\n"),
            '\r' => out.push_str("\\r"),
            '\t' => out.push_str("\\t"),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

/// Writes one element of a type, whose numbers begin at index `at`.
fn write_element(value_type: Type, number: &dyn Fn(usize) -> f64, at: usize, out: &mut String) {
    if value_type.is_quaternion() {
        let turned = |i: usize| number(at + (i + 3) % 4);
        return write_tuple(value_type.component, 4, &turned, out);
    }
    match value_type.width {
        1 => write_number(value_type.component, number(at), out),
        16 => {
            out.push_str("( ");
            for row in 0..4 {
                out.push_str(if row > 0 { ", " } else { "" });
                write_tuple(value_type.component, 4, &|i| number(at + 4 * row + i), out);
            }
            out.push_str(" )");
        }
        width => write_tuple(value_type.component, width, &|i| number(at + i), out),
    }
}

fn write_tuple(component: Component, width: usize, number: &dyn Fn(usize) -> f64, out: &mut String) {
    out.push('(');
    for index in 0..width {
        out.push_str(if index > 0 { ", " } else { "" });
        write_number(component, number(index), out);
    }
    out.push(')');
}

/// Writes the shortest text that is read back as the same number.
fn write_number(component: Component, number: f64, out: &mut String) {
    let _ = match component {
        _ if number.is_nan() => write!(out, "nan"),
        Component::Bool => write!(out, "{}", number != 0.0),
        Component::Int => write!(out, "{}", number as i64),
        Component::Half => write!(out, "{}", half::f16::from_f64(number).to_f32()),
        Component::Float => write!(out, "{}", number as f32),
        Component::Double | Component::Text => write!(out, "{number}"),
    };
}

fn write_dictionary(name: &str, entries: &[(String, Meta)], depth: usize, out: &mut String) {
    if entries.is_empty() {
        return;
    }
    let indent = "    ".repeat(depth);
    let _ = writeln!(out, "{indent}{name} = {{");
    write_metas(entries, depth + 1, out);
    let _ = writeln!(out, "{indent}}}");
}

fn write_metas(entries: &[(String, Meta)], depth: usize, out: &mut String) {
    let indent = "    ".repeat(depth);
    for (key, meta) in entries {
        let key = quoted(key);
        match meta {
            Meta::Double(number) => _ = writeln!(out, "{indent}double {key} = {number}"),
            Meta::Text(text) => _ = writeln!(out, "{indent}string {key} = {}", quoted(text)),
            Meta::Dictionary(inner) => write_dictionary(&format!("dictionary {key}"), inner, depth, out),
        }
    }
}
