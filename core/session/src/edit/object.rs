//! Statements of a script about one object: `let anna = cast(…).at(…);` and, further on, `anna.turn(…);`. Each change here edits one call. If the
//! value is computed, the refusal offers a line that states the value anew.

use super::casting::{first_free, identifier};
use super::cues::statement_start;
use super::key_name::{JointKey, joint_keys};
use super::number_style::in_number_style;
use super::parameter_calls::{ParameterCall, parameter_calls};
use super::refused::ADD_LINE_LABEL;
use super::scan::{Call, Source, Tokens, tokens_of};
use super::times::{EditTime, TimeLiteral, restated};
use super::values::{
    add_to_numbers, format_number, is_calculation, keeps_computed, option_of, overwrite_numbers,
    parse_literals, rewrite_literals, set_option,
};
use super::{Edit, EditRefused, chain};
use choreo_script::quoted;
use glam::{DMat3, DQuat, DVec3};
use std::sync::Arc;

#[derive(Clone)]
pub struct ScriptObject<'a> {
    pub(super) text: Source<'a>,
    pub(super) line: usize,
    pub(super) creating_call: Call,
    /// Variable that holds the object.
    pub variable: Option<String>,
    /// Calls of the object's methods in the order of the text; the last call of a name counts. Calls on its joints are not among them.
    pub(super) calls: Vec<Call>,
    /// Keys of the actor's joints in the order of the text.
    pub(super) joints: Vec<JointKey>,
    /// Method calls on the object in functions of the script that get it as an argument, in the order in which the script calls those functions.
    pub(super) calls_in_functions: Vec<ParameterCall>,
    /// Whether an edit of a call in such a function is allowed, although it may change other objects, too.
    pub(super) allows_shared_edits: bool,
    /// Byte of the last statement at the same bracket depth that calls the object's methods.
    pub(super) last_statement_at: usize,
}

/// A script's text, split into tokens once for many objects.
pub struct ScriptText {
    text: Arc<str>,
    tokens: Tokens,
}

impl ScriptText {
    pub fn new(text: Arc<str>) -> ScriptText {
        ScriptText { tokens: tokens_of(&text), text }
    }

    /// The object created by the call at a position, like [`ScriptObject::at`].
    ///
    /// # Errors
    /// There is no call.
    pub fn object(&self, line: usize, column: usize) -> Result<ScriptObject<'_>, EditRefused> {
        ScriptObject::from_source(Source::of(&self.text, self.tokens.clone()), line, column)
    }
}

impl<'a> ScriptObject<'a> {
    /// The object created by the call at a position: line and column in characters, from 1.
    pub fn at(text: &'a str, line: usize, column: usize) -> Result<ScriptObject<'a>, EditRefused> {
        ScriptObject::from_source(Source::new(text), line, column)
    }

    fn from_source(text: Source<'a>, line: usize, column: usize) -> Result<ScriptObject<'a>, EditRefused> {
        let refuse = |why: &str| EditRefused::at(line, why);
        let at = text.byte_at(line, column).ok_or_else(|| refuse("the script has no such line"))?;
        let creating_call = text.call_from(at).ok_or_else(|| refuse("there is no call to change here"))?;
        let start =
            statement_start(&text, &creating_call).filter(|_| text[creating_call.name.clone()] == *"play");
        let variable = text.variable_before(start.unwrap_or(creating_call.name.start)).map(str::to_string);
        let chain = text.chain_after(creating_call.end);
        let mut joints = joint_keys(&text, creating_call.end, &chain);
        let mut calls = calls_before_joint(&text, chain);
        let (mut last_statement_at, mut calls_in_functions) = (creating_call.end, Vec::new());
        if let Some(name) = &variable {
            let later = text
                .chains_of(name, creating_call.name.start)
                .into_iter()
                .filter(|(at, _)| *at > creating_call.end);
            for (at, chain) in later {
                last_statement_at = at;
                joints.extend(joint_keys(&text, at, &chain));
                calls.extend(calls_before_joint(&text, chain));
            }
            calls_in_functions = parameter_calls(&text, name, creating_call.name.start);
        }
        Ok(ScriptObject {
            text,
            line,
            creating_call,
            variable,
            calls,
            joints,
            calls_in_functions,
            allows_shared_edits: false,
            last_statement_at,
        })
    }

    /// The same object, with edits allowed that change other objects, too: those that are passed to the same function.
    #[must_use]
    pub fn allow_shared_edits(self) -> ScriptObject<'a> {
        ScriptObject { allows_shared_edits: true, ..self }
    }

    /// The variable of an actor. Without one, also the edit that declares it, named after `name`: `cast("ada", hero).play(walk);` becomes `let ada
    /// = cast("ada", hero);` and `ada.play(walk);`. `None` if the call is part of an expression or stands in a block.
    pub fn with_variable(&self, name: &str) -> Option<(String, Option<Edit>)> {
        /// Calls that return the actor itself.
        const METHODS_RETURNING_ACTOR: [&str; 7] =
            ["at", "move_by", "turn", "rotate", "scale", "face", "tint"];
        if let Some(variable) = &self.variable {
            return Some((variable.clone(), None));
        }
        let start = self.creating_call.name.start;
        if self.text.statement_start(start) != start || self.text.bracket_depth_at(start) > 0 {
            return None;
        }
        let name = first_free(
            |n| if n == 1 { identifier(name) } else { format!("{}_{n}", identifier(name)) },
            |name| self.text.contains(&format!("let {name} ")),
        );
        let own = self.text.chain_after(self.creating_call.end).into_iter();
        let own = own.take_while(|call| METHODS_RETURNING_ACTOR.contains(&&self.text[call.name.clone()]));
        let end = own.last().map_or(self.creating_call.end, |call| call.end);
        let rest =
            if self.text[end..].trim_start().starts_with('.') { format!(";\n{name}") } else { String::new() };
        let after = self.text.next_token_start(end);
        let blanks = if rest.is_empty() { end..end } else { end..after };
        let text = format!("let {name} = {}{rest}", &self.text[start..blanks.start]);
        Some((name, Some(Edit { range: start..blanks.end, text })))
    }

    /// Line of the last call of a method, from 1.
    pub fn line_of_call(&self, name: &str) -> Option<usize> {
        self.last_call(&[name]).map(|call| self.line_of(call.name.start))
    }

    pub(super) fn last_call(&self, names: &[&str]) -> Option<&Call> {
        self.calls.iter().rev().find(|call| names.contains(&&self.text[call.name.clone()]))
    }

    pub(super) fn line_of(&self, byte: usize) -> usize {
        self.text[..byte].matches('\n').count() + 1
    }

    fn refuse_computed(&self, call: &Call, new_call: &str) -> EditRefused {
        let (name, inside) = (&self.text[call.name.clone()], self.text[call.inside.clone()].trim());
        let line = self.line_of(call.name.start);
        let why = format!(".{name}({inside}) is computed; change it there, or add a line that sets it again");
        let alternative = self.variable.as_ref().and_then(|_| self.add_line(new_call));
        EditRefused {
            alternative,
            alternative_label: ADD_LINE_LABEL,
            is_computed: true,
            ..EditRefused::at(line, &why)
        }
    }

    /// Adds `variable.call;` after the last statement about the object.
    pub(super) fn add_line(&self, call: &str) -> Option<Edit> {
        self.add_line_after(call, self.last_mention())
    }

    /// A byte in the last statement about the object: one that calls its methods (also within a block) or passes it to a function of the script.
    fn last_mention(&self) -> usize {
        let (text, depth) = (&self.text, self.depth());
        let Some(name) = self.variable.as_deref() else { return self.last_statement_at };
        // The name may belong to something else in another block.
        let is_called = |at: usize| {
            depth == 0
                && text[text.next_token_start(at + name.len())..].starts_with('.')
                && text.begins_statement(text.statement_start(at))
        };
        let is_handed = |at: usize| {
            let given = text.argument_at(at).filter(|_| depth == 0 || text.bracket_depth_at(at) == depth + 1);
            given.is_some_and(|(call, number)| text.parameter(&text[call.name], number).is_some())
        };
        let uses = text
            .uses_of(name)
            .filter(|at| *at > self.last_statement_at && (is_called(*at) || is_handed(*at)));
        uses.filter(|at| depth > 0 || !text.is_in_function(*at)).last().unwrap_or(self.last_statement_at)
    }

    /// The last byte outside functions at which a name occurs, else `after`, the byte after the call that makes its value.
    fn last_use(&self, name: &str, after: usize) -> usize {
        let uses = self.text.uses_of(name).filter(|at| *at > after && self.depth() == 0);
        uses.filter(|at| !self.text.is_in_function(*at)).last().unwrap_or(after)
    }

    /// Number of brackets that are open at the creating call.
    pub(super) fn depth(&self) -> usize {
        self.text.bracket_depth_at(self.creating_call.name.start)
    }

    /// Adds `variable.call;` after the statement around a byte.
    fn add_line_after(&self, call: &str, at: usize) -> Option<Edit> {
        let name = self.variable.as_ref()?;
        let mut end = self.text.statement_around(at, self.depth()).end;
        // A comment on the same line stays before the new line.
        let rest = self.text[end..].find('\n').map_or(&self.text[end..], |n| &self.text[end..end + n]);
        if rest.trim().is_empty() || rest.trim_start().starts_with("//") {
            end += rest.trim_end().len();
        }
        let start = self.text[..self.creating_call.name.start].rfind('\n').map_or(0, |n| n + 1);
        let indent: String = self.text[start..].chars().take_while(|c| *c == ' ' || *c == '\t').collect();
        Some(Edit { range: end..end, text: format!("\n{indent}{name}.{call};") })
    }

    /// Adds a method, `scale(2.0)`, to the chain of the creating call.
    pub(super) fn add_method(&self, method: &str) -> Edit {
        chain::add_method(&self.text, &self.creating_call, method)
    }

    /// Writes `.name(values)`: over the last call of this name, else as a new one in the chain of the creating call.
    pub fn set(&self, name: &str, values: &[f64]) -> Result<Edit, EditRefused> {
        let new = call_text(name, values);
        let Some(call) = self.last_call(&[name]) else { return Ok(self.add_method(&new)) };
        if let Some(edit) = overwrite_numbers(&self.text, &call.inside, values) {
            return Ok(edit);
        }
        match parse_literals(&self.text, &call.inside) {
            // One factor becomes three.
            Some(old) if old.len() != values.len() => {
                let inside = values.iter().map(|v| format_number(*v)).collect::<Vec<_>>().join(", ");
                Ok(Edit::in_old_style(&self.text, call.inside.clone(), &inside))
            }
            _ => match values {
                [value] => self.overwrite(call, call.inside.clone(), &format_number(*value)),
                _ => Err(self.refuse_computed(call, &new)),
            },
        }
    }

    /// Writes a method in place of the last of several methods that exclude each other (`names`), else in the chain of the creating call.
    ///
    /// # Errors
    /// The script computes the value of the method to be replaced.
    pub fn set_one_of(&self, names: &[&str], name: &str, value: &str) -> Result<Edit, EditRefused> {
        let new = format!("{name}({value})");
        let Some(old) = self.last_call(names) else { return Ok(self.add_method(&new)) };
        parse_literals(&self.text, &old.inside).ok_or_else(|| self.refuse_computed(old, &new))?;
        let value = in_number_style(&self.text[old.inside.clone()], value);
        Ok(Edit { range: old.name.start..old.end, text: format!("{name}({value})") })
    }

    /// Writes `.name([x, y, z])`: over the last call of this name, else as a new one in the chain of the creating call.
    pub fn set_point(&self, name: &str, point: DVec3) -> Result<Edit, EditRefused> {
        let [x, y, z] = point.to_array().map(format_number);
        let new = format!("{name}([{x}, {y}, {z}])");
        let Some(call) = self.last_call(&[name]) else { return Ok(self.add_method(&new)) };
        let changed = overwrite_numbers(&self.text, &call.inside, &point.to_array());
        changed.ok_or_else(|| self.refuse_computed(call, &new))
    }

    /// Moves the object by `by`: adds it to the last `.at` or `.move_by`. Numbers that do not change stay as they are written. `to`: the resulting
    /// position, written as `.at` if there is neither call.
    pub fn move_by(&self, by: DVec3, to: DVec3) -> Result<Edit, EditRefused> {
        let Some(call) = self.last_call(&["at", "move_by"]) else { return self.set("at", &to.to_array()) };
        let new = call_text("move_by", &by.to_array());
        let moved = add_to_numbers(&self.text, &call.inside, &by.to_array());
        moved.ok_or_else(|| self.refuse_computed(call, &new))
    }

    /// Rotates the object about the axes of its parent, after all its `.turn` and `.rotate` calls, which add up.
    pub fn turn_by(&self, by: DQuat) -> Edit {
        let upright = by.x.abs() < 1e-9 && by.z.abs() < 1e-9;
        let degrees = 2.0 * libm::atan2(by.y, by.w).to_degrees();
        let angles = euler_degrees(by);
        let new =
            if upright { call_text("turn", &[degrees]) } else { call_text("rotate", &angles.to_array()) };
        let Some(call) = self.last_call(&["turn", "rotate"]) else { return self.add_method(&new) };
        let old = parse_literals(&self.text, &call.inside).unwrap_or_default();
        let values: Vec<f64> = old.iter().map(|(_, v)| *v).collect();
        let changed = match (&self.text[call.name.clone()], values.as_slice()) {
            ("turn", [turned]) if upright => {
                rewrite_literals(&self.text, &old, &[wrap_degrees(turned + degrees)])
            }
            ("rotate", [x, y, z]) => {
                let turned = euler_degrees(by * rotation_of(DVec3::new(*x, *y, *z)));
                rewrite_literals(&self.text, &old, &turned.to_array())
            }
            _ => None,
        };
        let new_call = || match self.text.chain_after(self.creating_call.end).contains(call) {
            true => chain::add_method_after(&self.text, &self.creating_call, call.end, &new),
            false => Edit { range: call.end..call.end, text: format!(".{new}") },
        };
        changed.unwrap_or_else(new_call)
    }

    /// Writes a time as `.from(…)`, `.until(…)`, `.cut(…)` …: over the last call of this name, else as a new one.
    pub fn set_time(&self, name: &str, time: EditTime) -> Result<Edit, EditRefused> {
        let new = format!("{name}({})", time.new_text(&self.text));
        let Some(call) = self.last_call(&[name]) else { return Ok(self.add_method(&new)) };
        restated(&self.text, &call.inside, time).ok_or_else(|| self.refuse_computed(call, &new))
    }

    /// Sets an option of the creating call, or the value of a later method with that name. `value`: source text.
    pub fn set_option(&self, name: &str, value: &str) -> Result<Edit, EditRefused> {
        if let Some(call) = self.last_call(&[name]) {
            return self.overwrite(call, call.inside.clone(), value);
        }
        // A light has either `kelvin` or `color`.
        if let (Some(old), "color") = (option_of(&self.text, &self.creating_call, "kelvin"), name) {
            let line = self.line_of(old.start);
            let why = format!("{} sets its color; a color would replace that", &self.text[old.clone()]);
            let alternative = Some(Edit { range: old, text: format!("color: {value}") });
            return Err(EditRefused {
                alternative,
                alternative_label: "Write the color",
                ..EditRefused::at(line, &why)
            });
        }
        set_option(&self.text, &self.creating_call, self.line, name, value)
    }

    /// Sets a parameter: in the last `.set("name", …)`, else as an option.
    pub fn set_parameter(&self, name: &str, value: &str) -> Result<Edit, EditRefused> {
        let quoted = format!("\"{name}\"");
        let is_it = |call: &&Call| {
            self.text[call.name.clone()] == *"set"
                && self.text[call.inside.clone()].trim_start().starts_with(&quoted)
        };
        if let Some(call) = self.calls.iter().rev().find(is_it) {
            let first = self.text.value_end(call.inside.start, call.inside.end);
            return self.overwrite(call, (first + 1).min(call.inside.end)..call.inside.end, value);
        }
        set_option(&self.text, &self.creating_call, self.line, name, value)
    }

    pub(super) fn overwrite(
        &self,
        call: &Call,
        bytes: std::ops::Range<usize>,
        value: &str,
    ) -> Result<Edit, EditRefused> {
        let inside = &self.text[bytes.clone()];
        let quoted = inside.trim().starts_with('"') && inside.trim().ends_with('"');
        let is_literal = parse_literals(&self.text, &bytes).is_some_and(|l| !l.is_empty());
        let is_time = TimeLiteral::of(&self.text, &bytes).is_some();
        let is_written = quoted || is_literal || is_time || is_calculation(&self.text, &bytes);
        if !is_written && !keeps_computed(&self.text, &bytes, value) {
            return Err(self.refuse_computed(call, &format!("{}({value})", &self.text[call.name.clone()])));
        }
        let start = bytes.start + (inside.len() - inside.trim_start().len());
        Ok(Edit::in_old_style(&self.text, start..start + inside.trim().len(), value))
    }

    /// Adds a line that plays a clip from a time on: `anna.play(hero.clip("Wave"), #{ fade: 0.3 }).from(2.0);`. The clip comes from the actor's own
    /// file, or from the file of another actor (`of`).
    ///
    /// # Errors
    /// The object has no name in the script, or the actor is not cast from a file. The text is for the user.
    pub fn play(
        &self,
        clip: &str,
        from: EditTime,
        options: &str,
        of: Option<&ScriptObject>,
    ) -> Result<Edit, EditRefused> {
        let asset = of.unwrap_or(self).asset_source()?;
        let call = format!("play({asset}.clip({}){options}){}", quoted(clip), self.start_call(from));
        self.add_call(&call, of.map(|of| (asset.as_str(), of.creating_call.end)))
    }

    /// Adds a line that plays a clip of a file, `file` as in `load`. The line uses the variable of the loaded file, if the script has one.
    ///
    /// # Errors
    /// The object has no name in the script.
    pub fn play_file(
        &self,
        file: &str,
        clip: &str,
        from: EditTime,
        options: &str,
    ) -> Result<Edit, EditRefused> {
        let file = quoted(file);
        let asset = variable_of_file(&self.text, &file, self.last_statement_at).map(str::to_string);
        let asset = asset.unwrap_or_else(|| format!("load({file})"));
        let call = format!("play({asset}.clip({}){options}){}", quoted(clip), self.start_call(from));
        self.add_call(&call, None)
    }

    /// `.from(1.0)` in the style of the script; empty at time 0, where a clip starts by default.
    fn start_call(&self, from: EditTime) -> String {
        if from.secs == 0.0 { String::new() } else { format!(".from({})", from.new_text(&self.text)) }
    }

    /// Adds a call as a line of its own after the last statement about the object. `needs`: a variable that the line uses, and the byte after the
    /// call that makes its value; if that byte comes later, the new line follows the last statement that uses the variable. If the object has no
    /// variable, the call is added to the chain of the creating call.
    pub(super) fn add_call(&self, call: &str, needs: Option<(&str, usize)>) -> Result<Edit, EditRefused> {
        let own = self.last_mention();
        let needs = needs.filter(|(_, made)| *made > own);
        let at = needs.map_or(own, |(name, made)| self.last_use(name, made));
        if let Some(line) = self.add_line_after(call, at) {
            return Ok(line);
        }
        let end = self.calls.last().map_or(self.creating_call.end, |c| c.end);
        let is_later = needs.is_some_and(|(_, made)| made > end);
        // A call after a constraint in an actor's chain would be about the constraint.
        let is_constrained = self.text[self.creating_call.name.clone()] == *"cast"
            && self.last_call(&["reach", "aim", "look_at"]).is_some();
        if self.text[self.text.next_token_start(end)..].starts_with('.') || is_later || is_constrained {
            return Err(EditRefused::at(
                self.line,
                "it has no variable in the script; write let NAME = cast(…)",
            ));
        }
        Ok(chain::add_method_after(&self.text, &self.creating_call, end, call))
    }

    /// Source text of the asset that the actor is cast from: the variable of the loaded file, if there is one, else the argument of `cast`.
    ///
    /// # Errors
    /// The call has no asset argument.
    pub(super) fn asset_source(&self) -> Result<String, EditRefused> {
        let asset = self.text.argument(&self.creating_call.inside, 1);
        let asset = asset.ok_or_else(|| EditRefused::at(self.line, "it is not cast from a file"))?;
        let named = self.text.call_from(asset.start).filter(|load| self.text[load.name.clone()] == *"load");
        let named = named.and_then(|load| {
            let file = self.text.argument(&load.inside, 0)?;
            variable_of_file(&self.text, &self.text[file], self.creating_call.name.start)
        });
        Ok(named.unwrap_or(&self.text[asset]).to_string())
    }
}

/// Calls of a chain before the first one that returns another object, a joint.
fn calls_before_joint(text: &Source, chain: Vec<Call>) -> Vec<Call> {
    chain.into_iter().take_while(|call| text[call.name.clone()] != *"joint").collect()
}

/// Sets the first argument of the call at a position, which is a time: `.cut(2.0)`.
pub fn set_call_time(text: &str, line: usize, column: usize, time: EditTime) -> Result<Edit, EditRefused> {
    let refuse = |why: String| EditRefused::at(line, &why);
    let text = &Source::new(text);
    let call = text.byte_at(line, column).and_then(|at| text.call_from(at));
    let call = call.ok_or_else(|| refuse("there is no call to change here".into()))?;
    let shown = || text[call.inside.clone()].trim();
    let first = call.inside.start..text.value_end(call.inside.start, call.inside.end);
    restated(text, &first, time).ok_or_else(|| {
        refuse(format!("the time in {}({}) is computed; change it there", &text[call.name.clone()], shown()))
    })
}

/// Sets the time of a marker, `marker("name", time)`, if exactly one call of the script sets it.
pub fn set_marker(text: &str, name: &str, time: EditTime) -> Result<Edit, EditRefused> {
    let (text, wanted) = (&Source::new(text), quoted(name));
    let sets_it = |call: &Call| {
        text[call.inside.clone()].trim_start().starts_with(&wanted)
            && text.value_end(call.inside.start, call.inside.end) < call.inside.end
    };
    let found: Vec<Call> = text.calls_of("marker").filter(sets_it).collect();
    let [call] = found.as_slice() else {
        return Err(match found.len() {
            0 => format!("no line states the time of the marker \"{name}\""),
            count => format!("{count} lines set the marker \"{name}\"; change it there"),
        }
        .into());
    };
    let second = text.value_end(call.inside.start, call.inside.end) + 1..call.inside.end;
    let line = text[..call.name.start].matches('\n').count() + 1;
    restated(text, &second, time)
        .ok_or_else(|| EditRefused::at(line, &format!("the time of \"{name}\" is computed; change it there")))
}

fn call_text(name: &str, values: &[f64]) -> String {
    format!("{name}({})", values.iter().map(|v| format_number(*v)).collect::<Vec<_>>().join(", "))
}

/// Variable of a file that the script loads before a byte: `let NAME = load("FILE" …)`; `file` with its quotes.
pub(super) fn variable_of_file<'a>(text: &Source<'a>, file: &str, before: usize) -> Option<&'a str> {
    loads_of(text, file).find(|(load, _)| load.name.start < before).map(|(_, name)| name)
}

/// Calls `let NAME = load("FILE" …);` outside blocks that load a file, each with its variable; `file` with its quotes.
pub(super) fn loads_of<'a>(text: &Source<'a>, file: &str) -> impl Iterator<Item = (Call, &'a str)> {
    let is_it = move |call: &Call| {
        file.starts_with('"')
            && text.argument(&call.inside, 0).is_some_and(|first| text[first] == *file)
            && text.bracket_depth_at(call.name.start) == 0
            && text[text.next_token_start(call.end)..].starts_with(';')
    };
    let named = move |call: Call| text.variable_before(call.name.start).map(|name| (call, name));
    text.calls_of("load").filter(is_it).filter_map(named)
}

fn wrap_degrees(degrees: f64) -> f64 {
    if degrees.abs() <= 360.0 { degrees } else { degrees % 360.0 }
}

/// Rotation about x, then y, then z (fixed axes) as in scripts, angles in degrees.
pub fn rotation_of(degrees: DVec3) -> DQuat {
    let about = |axis: DVec3, degrees: f64| {
        let (sin, cos) = libm::sincos(degrees.to_radians() / 2.0);
        DQuat::from_xyzw(axis.x * sin, axis.y * sin, axis.z * sin, cos)
    };
    about(DVec3::Z, degrees.z) * about(DVec3::Y, degrees.y) * about(DVec3::X, degrees.x)
}

/// Angles about x, then y, then z (fixed axes) of a rotation as in scripts, degrees. At y = ±90° (gimbal lock) z is 0.
pub(super) fn euler_degrees(q: DQuat) -> DVec3 {
    let m = DMat3::from_quat(q.normalize());
    let y = libm::asin((-m.x_axis.z).clamp(-1.0, 1.0));
    let (x, z) = match m.x_axis.z.abs() < 1.0 - 1e-12 {
        true => (libm::atan2(m.y_axis.z, m.z_axis.z), libm::atan2(m.x_axis.y, m.x_axis.x)),
        false => (libm::atan2(-m.z_axis.y, m.y_axis.y), 0.0),
    };
    DVec3::new(x, y, z).map(f64::to_degrees)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edit::NewValueSyntax;
    use crate::edit::marked::marked;

    fn at(secs: f64) -> EditTime {
        EditTime { secs, fps: 30.0 }
    }

    fn changed(
        text: &str,
        change: impl FnOnce(&ScriptObject) -> Result<Edit, EditRefused>,
    ) -> Result<String, EditRefused> {
        let (text, line, column) = marked(text);
        let edit = change(&ScriptObject::at(&text, line, column)?)?;
        let after = edit.apply(&text);
        assert_eq!(edit.inverse(&text).apply(&after), text);
        Ok(after)
    }

    #[test]
    fn moving_changes_the_last_position_call() {
        let text =
            "let a = |cast(\"a\", m).at(1.0, 0, 2.0); // here\nlet b = 1;\na.turn(5).at([ 3.0, -1.5, 0 ]);\n";
        let moved = |o: &ScriptObject| o.move_by(DVec3::new(0.25, 0.0, -1.0), DVec3::ZERO);
        assert!(changed(text, moved).unwrap().contains("a.turn(5).at([ 3.25, -1.5, -1 ]);"));
        let inline = "|cast(\"a\", m).at(1.0, 0, 2.0).play(m.clip(\"x\")).from(1.0);";
        assert_eq!(
            changed(inline, moved).unwrap(),
            "cast(\"a\", m).at(1.25, 0, 1.0).play(m.clip(\"x\")).from(1.0);"
        );
        let none = |o: &ScriptObject| o.move_by(DVec3::ONE, DVec3::ONE);
        assert_eq!(
            changed("let a = |cast(\"a\", m);", none).unwrap(),
            "let a = cast(\"a\", m).at(1.0, 1.0, 1.0);"
        );
    }

    #[test]
    fn edits_do_not_change_calls_in_callbacks_and_conditions() {
        let text =
            "let a = |cast(\"a\", m).turn(10);\non_frame(|t| a.turn(10.0 * t));\nif x { a.turn(3); }\n";
        let turned = |o: &ScriptObject| Ok(o.turn_by(rotation_of(DVec3::new(0.0, 20.0, 0.0))));
        let after = changed(text, turned).unwrap();
        assert!(
            after.starts_with("let a = cast(\"a\", m).turn(30);\non_frame(|t| a.turn(10.0 * t));"),
            "{after}"
        );
    }

    #[test]
    fn a_computed_value_is_refused_with_an_alternative_line() {
        let text = "  let a = |cast(\"a\", m)\n    .at(x + 1, 0, 0);\nlet b = 2;\n";
        let by = DVec3::new(0.5, 0.0, 0.0);
        let refused = changed(text, |o| o.move_by(by, by)).unwrap_err();
        assert!(refused.why.starts_with("line 2: .at(x + 1, 0, 0) is computed"), "{}", refused.why);
        let plain = text.replacen('|', "", 1);
        let over = refused.alternative.unwrap().apply(&plain);
        assert!(over.contains("(x + 1, 0, 0);\n  a.move_by(0.5, 0.0, 0.0);\nlet b"), "{over}");
        let nameless = changed("|cast(\"a\", m).at(x, 0, 0);", |o| o.move_by(by, by)).unwrap_err();
        assert_eq!(nameless.alternative, None);
    }

    #[test]
    fn numbers_beside_a_computed_one_are_changed() {
        let text = "|cast(\"a\", m).at(1.0 / 3.0, 0, 2.0 * x);";
        let moved = |x: f64, y: f64, z: f64| changed(text, |o| o.move_by(DVec3::new(x, y, z), DVec3::ZERO));
        assert_eq!(moved(1e-12, 2.0, 0.0).unwrap(), "cast(\"a\", m).at(1.0 / 3.0, 2, 2.0 * x);");
        assert_eq!(moved(1.0, 0.0, -1e-12).unwrap(), "cast(\"a\", m).at(1.333, 0, 2.0 * x);");
        let refused = moved(0.0, 1.0, 1.0).unwrap_err().why;
        assert!(refused.starts_with("line 1: .at(1.0 / 3.0, 0, 2.0 * x) is computed"), "{refused}");
        // A stated value is written even if the computed value is the same.
        let stated = |value: &str| {
            let at = |o: &ScriptObject| o.set_value("at", value, NewValueSyntax::Method);
            changed("|camera(\"c\").at(0, 1, 2 * x);", at)
        };
        assert_eq!(stated("0.0, 2.0, 2 * x").unwrap(), "camera(\"c\").at(0, 2, 2 * x);");
        assert!(stated("0.0, 2.0, 3.0").unwrap_err().why.contains("is computed"));
    }

    #[test]
    fn turn_by_gives_the_requested_rotation() {
        let by = rotation_of(DVec3::new(30.0, 0.0, 0.0));
        for old in [DVec3::new(10.0, 20.0, 30.0), DVec3::new(-170.0, 5.0, 99.0), DVec3::new(0.0, 89.0, 0.0)] {
            let text = format!("|cast(\"a\", m).rotate({:?}, {:?}, {:?});", old.x, old.y, old.z);
            let after = changed(&text, |o| Ok(o.turn_by(by))).unwrap();
            let inside = &after[after.find("rotate(").unwrap() + 7..after.len() - 2];
            let new: Vec<f64> = inside.split(", ").map(|v| v.parse().unwrap()).collect();
            let (got, wanted) = (rotation_of(DVec3::new(new[0], new[1], new[2])), by * rotation_of(old));
            // Angles are written with three decimal places.
            assert!(got.dot(wanted).abs() > 1.0 - 1e-9, "{after}");
        }
        let text = "|cast(\"a\", m).turn(45);";
        assert_eq!(
            changed(text, |o| Ok(o.turn_by(by))).unwrap(),
            "cast(\"a\", m).turn(45).rotate(30.0, 0.0, 0.0);"
        );
    }

    #[test]
    fn options_parameters_and_times_are_set() {
        let light = "let s = |sun(#{ intensity: 3.0, color: \"white\" });\ns.intensity(2);\n";
        assert!(changed(light, |o| o.set_option("intensity", "4.5")).unwrap().contains("s.intensity(4.5);"));
        assert!(
            changed(light, |o| o.set_option("color", "\"#ff0000\""))
                .unwrap()
                .contains("color: \"#ff0000\" }")
        );
        assert_eq!(
            changed("|sun();", |o| o.set_option("intensity", "2.0")).unwrap(),
            "sun(#{ intensity: 2.0 });"
        );
        let effect = "|effect(\"glow\", #{ amount: 0.2 }).set(\"size\", 1.5).from(1.0);";
        assert!(changed(effect, |o| o.set_parameter("size", "2.0")).unwrap().contains(".set(\"size\", 2.0)"));
        assert!(changed(effect, |o| o.set_parameter("amount", "0.3")).unwrap().contains("amount: 0.3 }"));
        assert!(changed(effect, |o| o.set_time("from", at(1.25))).unwrap().ends_with(".from(1.25);"));
        assert!(
            changed(effect, |o| o.set_time("until", at(3.0))).unwrap().ends_with(".from(1.0).until(3.0);")
        );
        let refused =
            changed("|effect(\"glow\", #{ amount: x });", |o| o.set_parameter("amount", "1.0")).unwrap_err();
        assert!(refused.why.contains("amount: x is computed"), "{}", refused.why);
    }

    #[test]
    fn a_played_clip_uses_the_variable_of_its_file() {
        let text = "let hero = load(\"a.glb\");\nlet a = |cast(\"a\", hero).at(0, 0, 0);\na.play(hero.clip(\"Walk\")).until(2.0);\n";
        let after = changed(text, |o| o.play("Wave \"1\"", at(2.0), "", None)).unwrap();
        assert!(after.contains("a.play(hero.clip(\"Wave \\\"1\\\"\")).from(2.0);"), "{after}");
        assert!(
            changed("|cast(\"a\", hero);", |o| o.play("Wave", at(0.0), "", None))
                .unwrap()
                .contains("hero).play(hero.clip")
        );
        assert!(changed("|cast(\"a\", hero).play(x);", |o| o.play("Wave", at(0.0), "", None)).is_err());
    }

    #[test]
    fn a_clip_of_another_actor_is_added_after_that_actor() {
        let text = "let bob = cast(\"bob\", load(\"b.glb\"));\nlet hero = load(\"a.glb\");\nlet ada = cast(\"ada\", hero); // she\nlet eve = cast(\"eve\", load(\"e.glb\"));\n";
        let place = |name: &str| (text.lines().position(|l| l.contains(name)).unwrap() + 1, 11);
        let object = |name: &str| ScriptObject::at(text, place(name).0, place(name).1).unwrap();
        let played = |on: &str, of: &str| {
            object(on).play("Walk", at(1.0), "", Some(&object(of))).map(|edit| edit.apply(text))
        };
        let after = played("\"bob\"", "\"ada\"").unwrap();
        assert!(
            after.contains("hero); // she\nbob.play(hero.clip(\"Walk\")).from(1.0);\nlet eve"),
            "{after}"
        );
        let after = played("\"ada\"", "\"eve\"").unwrap();
        assert!(after.ends_with("\nada.play(load(\"e.glb\").clip(\"Walk\")).from(1.0);\n"), "{after}");
    }

    /// The new line follows loops and functions in which the actor plays, but not lines about other objects.
    #[test]
    fn a_new_clip_follows_all_statements_about_its_actor() {
        for last in [
            "for t in [1.0, 2.0] {\n    a.play(c).from(t);\n}",
            "dance(a, 2);",
            "if x { let w = a.play(c); w.once(); }",
        ] {
            let text = format!(
                "fn dance(a, n) {{ a.play(n); }}\nlet a = cast(\"a\", m);\n{last} // so\ncamera(\"c\").look_at(a.joint(\"Head\"));\n"
            );
            let object = ScriptObject::at(&text, 2, 9).unwrap();
            let after = object.play("x", at(3.0), "", None).unwrap().apply(&text);
            assert_eq!(after, text.replace("// so\n", "// so\na.play(m.clip(\"x\")).from(3.0);\n"));
        }
    }

    #[test]
    fn the_time_argument_of_a_call_is_rewritten() {
        let text = "camera(\"b\").at(0, 1, 2).cut( 2.0 );\ncamera(\"c\").cut(x);";
        let column = text.find(".cut").unwrap() + 2;
        assert!(set_call_time(text, 1, column, at(2.5)).unwrap().apply(text).contains(".cut( 2.5 );"));
        assert!(set_call_time(text, 2, 13, at(2.5)).unwrap_err().why.contains("cut(x) is computed"));
        let title = "text(\"a\").fade(1.0 / 3.0);";
        let faded = ScriptObject::at(title, 1, 1).unwrap().set("fade", &[0.5]).unwrap().apply(title);
        assert_eq!(faded, "text(\"a\").fade(0.5);");
        let dissolve = "c.cut(2.0, #{ dissolve: 0.8 });";
        assert_eq!(
            set_call_time(dissolve, 1, 3, at(2.5)).unwrap().apply(dissolve),
            dissolve.replace("2.0", "2.5")
        );
    }

    #[test]
    fn markers_are_set_by_their_name() {
        let text = "marker(\"go\", 1.5); // marker(\"go\", 3)\nlet m = marker(\"go\");\nmarker(\"end\", x);";
        assert!(set_marker(text, "go", at(2.0)).unwrap().apply(text).starts_with("marker(\"go\", 2.0);"));
        assert!(set_marker(text, "end", at(2.0)).unwrap_err().why.contains("line 3"));
        let unknown = set_marker(text, "no", at(2.0)).unwrap_err();
        assert_eq!(unknown.why, "no line states the time of the marker \"no\"");
    }
}
