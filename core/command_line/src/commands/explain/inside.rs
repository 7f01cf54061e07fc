//! Content of a frame: its parts, what requested each part, and the line of the script that created the requester.

use choreo_bench::plots::{Cell, Table, bytes};
use choreo_render::SceneResources;
use choreo_render::explain::{Cost, RequestedBy};
use choreo_script::Places;
use choreo_stage::{Stage, Subject};
use serde_json::{Value, json};

/// Largest number of names per part; further ones are only counted.
const MAX_NAMES_PER_PART: usize = 3;

pub(super) struct FrameContent<'a> {
    pub stage: &'a Stage,
    pub resources: &'a SceneResources,
    pub places: &'a Places,
    pub parts: Vec<Cost>,
}

impl FrameContent<'_> {
    pub(super) fn table(&self) -> Table {
        let columns = [("", "kind"), ("included", "what"), (">size", "bytes"), ("requested by", "asked_by")];
        let mut table = Table::new("", &columns);
        for part in &self.parts {
            table.rows.push(vec![
                Cell::text(part.kind.name()),
                Cell::text(&part.what),
                part.bytes.map_or_else(Cell::empty, |b| Cell::number(bytes(b as f64), b as f64)),
                Cell::text(self.requested_by_text(&part.requested_by)),
            ]);
        }
        table
    }

    pub(super) fn json(&self) -> Value {
        let part = |part: &Cost| {
            let by = &part.requested_by;
            let actors: Vec<Value> = by.actors.iter().map(|a| self.actor_json(*a as usize)).collect();
            let materials: Vec<&str> = by.materials.iter().map(|m| self.material_name(*m)).collect();
            json!({
                "kind": part.kind.name(), "what": part.what, "bytes": part.bytes,
                "asked_by": { "actors": actors, "materials": materials, "effects": by.effects, "other": by.other },
            })
        };
        self.parts.iter().map(part).collect()
    }

    /// Bytes of each part, for the chart.
    pub(super) fn bytes_by_part(&self) -> Vec<(String, u64)> {
        let named = |p: &Cost| Some((format!("{} {}", p.kind.name(), p.what), p.bytes?));
        self.parts.iter().filter_map(named).collect()
    }

    fn material_name(&self, index: u32) -> &str {
        self.resources.materials.get(index as usize).map_or("", |m| m.material.name.as_str())
    }

    fn actor_json(&self, index: usize) -> Value {
        let place = self.places.of(Subject::Actor(index));
        let name = self.stage.actors.get(index).map_or("", |a| a.name.as_str());
        match place.line {
            0 => json!({ "name": name }),
            _ => json!({ "name": name, "file": place.file, "line": place.line, "column": place.column }),
        }
    }

    fn requested_by_text(&self, by: &RequestedBy) -> String {
        let mut words: Vec<String> = by.other.iter().map(|w| w.to_string()).collect();
        for effect in &by.effects {
            let used = self.stage.effects.iter().position(|e| e.effect_name() == *effect);
            let place = used.map(|e| self.place_suffix(Subject::Effect(e))).unwrap_or_default();
            words.push(format!("effect {effect}{place}"));
        }
        let more = |left: usize| if left > 0 { format!(" and {left} more") } else { String::new() };
        if !by.actors.is_empty() {
            let name = |index: &u32| {
                let actor = self.stage.actors.get(*index as usize).map_or("", |a| a.name.as_str());
                format!("{actor}{}", self.place_suffix(Subject::Actor(*index as usize)))
            };
            let names: Vec<String> = by.actors.iter().take(MAX_NAMES_PER_PART).map(name).collect();
            words.push(names.join(", ") + more(by.actors.len() - names.len()).as_str());
        }
        if !by.materials.is_empty() {
            // Several materials of a file may have the same name.
            let mut names: Vec<String> =
                by.materials.iter().map(|m| format!("\"{}\"", self.material_name(*m))).collect();
            names.sort();
            names.dedup();
            let left = names.len().saturating_sub(MAX_NAMES_PER_PART);
            names.truncate(MAX_NAMES_PER_PART);
            let plural = if names.len() == 1 { "material" } else { "materials" };
            words.push(format!("{plural} {}", names.join(", ")) + more(left).as_str());
        }
        words.join("; ")
    }

    /// Place in the script as ` (line 7)`, with the file if it is a module.
    fn place_suffix(&self, subject: Subject) -> String {
        let place = self.places.of(subject);
        match place.line {
            0 => String::new(),
            line if self.places.is_main(&place.file) => format!(" (line {line})"),
            line => format!(" ({}:{line})", place.file),
        }
    }
}
