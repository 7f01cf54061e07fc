//! Values that the script states for an object or a cue: reads them as source text, writes them, and removes them so that the default applies.

use super::object::ScriptObject;
use super::scan::Call;
use super::times::{EditTime, restated};
use super::values::{becomes_method, option_value, set_option};
use super::{Edit, EditRefused};
use choreo_script::quoted;
use std::collections::BTreeMap;
use std::ops::Range;

/// Syntax of a value that the script does not state yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NewValueSyntax {
    /// `.fov(40.0)`
    Method,
    /// `#{ fade: 0.5 }`
    Option,
    /// An option if the cue has options or no option-like methods, else a method, to match its other values.
    LikeOthers,
}

impl<'a> ScriptObject<'a> {
    /// Source text of a value: the arguments of the last call of the method `name`, else the value of the option `name` of the creating call.
    pub fn written(&self, name: &str) -> Option<&str> {
        let range = match self.last_call(&[name]) {
            Some(call) => call.inside.clone(),
            None => option_value(&self.text, &self.creating_call, name)?,
        };
        Some(self.text[range].trim())
    }

    /// Source text of all values that the script states for the object, by name: the options of the creating call and its methods. The last call of
    /// a method counts.
    pub fn all_written(&self) -> BTreeMap<String, String> {
        let mut all = BTreeMap::new();
        for (entry, _) in self.options(&[]) {
            if let Some((name, value)) = self.text[entry].split_once(':') {
                all.insert(name.trim().to_string(), value.trim().to_string());
            }
        }
        for call in &self.calls {
            let value = self.text[call.inside.clone()].trim().to_string();
            all.insert(self.text[call.name.clone()].to_string(), value);
        }
        all
    }

    /// States a value: in place of the stated one, else as a new method or option. `value`: source text. A computed value is not overwritten.
    ///
    /// # Errors
    /// The script computes the value.
    pub fn set_value(&self, name: &str, value: &str, syntax: NewValueSyntax) -> Result<Edit, EditRefused> {
        if let Some(call) = self.last_call(&[name]) {
            return self.overwrite(call, call.inside.clone(), value);
        }
        let is_method = match syntax {
            NewValueSyntax::Option => false,
            NewValueSyntax::Method => true,
            NewValueSyntax::LikeOthers => becomes_method(&self.text, &self.creating_call, &self.calls, name),
        };
        match is_method && option_value(&self.text, &self.creating_call, name).is_none() {
            true => Ok(self.add_method(&format!("{name}({value})"))),
            false => set_option(&self.text, &self.creating_call, self.line, name, value),
        }
    }

    /// Like [`ScriptObject::set_value`], but also overwrites a computed value.
    ///
    /// # Errors
    /// The options of the creating call are computed.
    pub fn overwrite_value(
        &self,
        name: &str,
        value: &str,
        syntax: NewValueSyntax,
    ) -> Result<Edit, EditRefused> {
        let over = match self.last_call(&[name]) {
            Some(call) => Some(call.inside.clone()),
            None => option_value(&self.text, &self.creating_call, name),
        };
        match over {
            Some(range) => Ok(Edit::in_old_style(&self.text, self.text.trimmed(&range), value)),
            None => self.set_value(name, value, syntax),
        }
    }

    /// States a time: in place of the stated one, else as a new method or option.
    ///
    /// # Errors
    /// The script computes the time.
    pub fn set_time_value(
        &self,
        name: &str,
        time: EditTime,
        syntax: NewValueSyntax,
    ) -> Result<Edit, EditRefused> {
        let option = option_value(&self.text, &self.creating_call, name);
        let old = option.as_ref().and_then(|bytes| restated(&self.text, bytes, time));
        match (self.last_call(&[name]), old) {
            (None, Some(edit)) => Ok(edit),
            (None, None) if syntax == NewValueSyntax::Option || option.is_some() => {
                set_option(&self.text, &self.creating_call, self.line, name, &time.new_text(&self.text))
            }
            _ => self.set_time(name, time),
        }
    }

    /// The map of an option as an object: `#{ size: 1024 }` in `sun(#{ shadow: #{ size: 1024 } })`.
    pub fn within_option(&self, option: &str) -> Option<ScriptObject<'a>> {
        let inside = self.text.trimmed(&option_value(&self.text, &self.creating_call, option)?);
        self.text.options_map(&inside)?;
        let start = self.text[..inside.start].rfind(option)?;
        let creating_call = Call { name: start..start + option.len(), end: inside.end, inside };
        Some(ScriptObject { creating_call, calls: Vec::new(), variable: None, ..self.clone() })
    }

    /// States a value in the map of an option. An option that is `true` becomes a map.
    ///
    /// # Errors
    /// The script computes the option or the value.
    pub fn set_value_in_option(&self, option: &str, name: &str, value: &str) -> Result<Edit, EditRefused> {
        match (self.within_option(option), self.written(option)) {
            (Some(map), _) => set_option(&self.text, &map.creating_call, self.line, name, value),
            (None, None | Some("true")) => {
                self.overwrite_value(option, &format!("#{{ {name}: {value} }}"), NewValueSyntax::Option)
            }
            (None, Some(written)) => {
                let why = format!("{option}: {written} is computed; change it there");
                Err(EditRefused::at(self.line, &why))
            }
        }
    }

    /// Removes a value from the map of an option. The option becomes `true` if nothing else is in the map.
    pub fn remove_value_in_option(&self, option: &str, name: &str) -> Edit {
        match self.within_option(option) {
            Some(map) if map.all_written().keys().all(|other| other == name) => {
                Edit { range: map.creating_call.inside, text: "true".to_string() }
            }
            Some(map) => map.remove_values(&[name]),
            None => Edit { range: 0..0, text: String::new() },
        }
    }

    /// Source text of an argument of the creating call, counted from 0: the target in `.follow(target, offset)`.
    pub fn argument(&self, number: usize) -> Option<&str> {
        Some(&self.text[self.text.argument(&self.creating_call.inside, number)?])
    }

    /// Replaces an argument of the creating call, computed or not.
    ///
    /// # Errors
    /// The call has no argument with this number.
    pub fn set_argument(&self, number: usize, value: &str) -> Result<Edit, EditRefused> {
        let range = self.text.argument(&self.creating_call.inside, number);
        let range = range.ok_or_else(|| EditRefused::at(self.line, "the call has no such argument"))?;
        Ok(Edit::in_old_style(&self.text, range, value))
    }

    /// Source text of all arguments of the creating call.
    pub fn all_arguments(&self) -> &str {
        self.text[self.creating_call.inside.clone()].trim()
    }

    /// Replaces all arguments of the creating call. They must be literals: numbers, calculations with numbers alone, strings, and lists and maps of
    /// these.
    ///
    /// # Errors
    /// The script computes an argument.
    pub fn set_arguments(&self, value: &str) -> Result<Edit, EditRefused> {
        let range = self.text.trimmed(&self.creating_call.inside);
        let tokens: Vec<&str> = self.text.tokens_within(&range).collect();
        let is_name = |token: &str| token.starts_with(|c: char| c.is_alphabetic() || c == '_');
        // Names of map entries are not variables.
        let is_entry = |index: usize| tokens.get(index + 1) == Some(&":");
        if tokens.iter().enumerate().any(|(index, token)| is_name(token) && !is_entry(index)) {
            let name = &self.text[self.creating_call.name.clone()];
            let why = format!("{name}({}) is computed; change it there", &self.text[range]);
            return Err(EditRefused::at(self.line, &why));
        }
        Ok(Edit::in_old_style(&self.text, range, value))
    }

    /// Source text of the arguments of the creating call before its options.
    pub fn arguments_before_options(&self) -> &str {
        let inside = self.creating_call.inside.clone();
        let end = self.text.options_map(&inside).and_then(|map| self.text[..map.start].rfind("#{"));
        self.text[inside.start..end.unwrap_or(inside.end)].trim().trim_end_matches(',')
    }

    /// Positions of the object's calls with these names, line and column from 1, in the order of the text.
    pub fn places_of(&self, names: &[&str]) -> Vec<(usize, usize)> {
        let calls = self.calls.iter().filter(|call| names.contains(&&self.text[call.name.clone()]));
        calls.map(|call| self.text.place_of(call.name.start)).collect()
    }

    /// Removes the methods and options with these names. The text does not change if there are none.
    pub fn remove_values(&self, names: &[&str]) -> Edit {
        let mut ranges: Vec<Range<usize>> = self
            .calls
            .iter()
            .filter(|call| names.contains(&&self.text[call.name.clone()]))
            .map(|call| self.method_range(call))
            .collect();
        ranges.extend(self.options_range(names));
        ranges.sort_by_key(|range| range.start);
        let mut after = self.text.to_string();
        for range in ranges.into_iter().rev() {
            after.replace_range(range, "");
        }
        Edit::between(&self.text, &after)
    }

    /// Bytes of `.name(…)` with the whitespace before it; of the whole line if the call is a statement of its own.
    fn method_range(&self, call: &Call) -> Range<usize> {
        let text: &str = &self.text;
        let dot = text[..call.name.start].rfind('.').unwrap_or(call.name.start);
        let line = text[..dot].rfind('\n').map_or(0, |end| end + 1);
        let is_alone = self.variable.as_deref() == Some(text[line..dot].trim());
        if is_alone && let Some(rest) = text[call.end..].strip_prefix(';') {
            let end = rest.find('\n').map_or(rest.len(), |end| end + 1);
            if rest[..end].trim().is_empty() {
                return line..call.end + 1 + end;
            }
        }
        let rest = text[call.end..].trim_start_matches([' ', '\t']);
        let ends_line = rest.is_empty() || rest.starts_with(['\n', '\r']) || rest.starts_with("//");
        // Code that follows on the same line must not end up in a comment.
        if ends_line { text[..dot].trim_end().len()..call.end } else { dot..call.end }
    }

    /// Bytes of each option of the creating call up to its comma, and whether its name is among `names`.
    fn options(&self, names: &[&str]) -> Vec<(Range<usize>, bool)> {
        let Some(map) = self.text.options_map(&self.creating_call.inside) else { return Vec::new() };
        let mut all: Vec<(Range<usize>, bool)> = Vec::new();
        let mut at = map.start;
        while at < map.end {
            let end = self.text.value_end(at, map.end);
            let entry = self.text.trimmed(&(at..end));
            let name = self.text[entry.clone()].split(':').next().unwrap_or_default().trim();
            if !entry.is_empty() {
                all.push((entry.start..end, names.contains(&name)));
            }
            at = end + 1;
        }
        all
    }

    /// Bytes to remove for the options with these names, each with one comma; the whole map if it holds no other option.
    fn options_range(&self, names: &[&str]) -> Vec<Range<usize>> {
        let inside = &self.creating_call.inside;
        let Some(map) = self.text.options_map(inside) else { return Vec::new() };
        let all = self.options(names);
        if !all.is_empty() && all.iter().all(|(_, goes)| *goes) {
            // The comma after the previous argument is removed, too.
            let brace = self.text[..map.start].rfind("#{").unwrap_or(map.start);
            let before = self.text[..brace].trim_end();
            let start = before.strip_suffix(',').map_or(before.len(), str::len);
            let argument = start.max(inside.start)..inside.end;
            return vec![argument];
        }
        let kept_after = |number: usize| all[number + 1..].iter().any(|(_, goes)| !goes);
        let ranges = all.iter().enumerate().filter(|(_, (_, goes))| *goes).map(|(number, (entry, _))| {
            match kept_after(number) {
                // The range ends at the next option.
                true => entry.start..all[number + 1].0.start,
                // The range begins at the end of the previous option.
                false => {
                    number.checked_sub(1).map_or(map.start, |before| all[before].0.end)
                        ..self.text.trimmed(entry).end
                }
            }
        });
        ranges.collect()
    }

    /// Replaces the name of the clip that a cue plays, `moves.clip("Walk")`.
    ///
    /// # Errors
    /// The clip is not written as `.clip("NAME")`.
    pub fn set_clip(&self, name: &str) -> Result<Edit, EditRefused> {
        let inside = &self.creating_call.inside;
        let first = inside.start..self.text.value_end(inside.start, inside.end);
        let calls = self.text.calls_within(&first);
        let plain = |call: &&Call| {
            let argument = self.text[call.inside.clone()].trim();
            self.text[call.name.clone()] == *"clip" && argument.starts_with('"') && argument.ends_with('"')
        };
        match calls.iter().find(plain) {
            Some(call) => Ok(Edit { range: self.text.trimmed(&call.inside), text: quoted(name) }),
            None => {
                let why =
                    format!("{} is not written as .clip(NAME); change it there", self.text[first].trim());
                Err(EditRefused::at(self.line, &why))
            }
        }
    }

    /// Replaces the words of a title: its `.words(…)`, else the first argument of the creating call.
    ///
    /// # Errors
    /// The script computes the words.
    pub fn set_words(&self, words: &str) -> Result<Edit, EditRefused> {
        if let Some(call) = self.last_call(&["words"]) {
            return self.overwrite(call, call.inside.clone(), &quoted(words));
        }
        let inside = &self.creating_call.inside;
        let first = inside.start..self.text.value_end(inside.start, inside.end);
        self.overwrite(&self.creating_call, first, &quoted(words))
    }

    /// The object that makes the asset of an actor: `shape(…)` as an argument of `cast`, or the call after `let NAME =`.
    ///
    /// # Errors
    /// The script makes the asset in another way.
    pub fn asset_object(&self) -> Result<ScriptObject<'a>, EditRefused> {
        let refuse = || EditRefused::at(self.line, "its asset is made elsewhere; change it there");
        let asset = self.text.argument(&self.creating_call.inside, 1).ok_or_else(refuse)?;
        let is_own = |call: &Call| call.name.start == asset.start && call.end <= asset.end;
        let own = self.text.call_from(asset.start).filter(is_own).map(|call| call.name.start);
        let made =
            own.or_else(|| self.text.assigned_call(&self.text[asset.clone()], self.creating_call.name.start));
        let (line, column) = self.text.place_of(made.ok_or_else(refuse)?);
        ScriptObject::at(self.text.whole(), line, column)
    }

    /// Line and column of the creating call, from 1.
    pub fn place(&self) -> (usize, usize) {
        self.text.place_of(self.creating_call.name.start)
    }

    /// Name of the function or method that creates the object.
    pub fn creating_function(&self) -> &str {
        &self.text[self.creating_call.name.clone()]
    }
}
