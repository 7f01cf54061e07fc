//! Names of objects: the displayed name, which the creating call states, and the variable that goes with it.

use super::casting::identifier;
use super::object::ScriptObject;
use super::values::{option_value, set_option};
use super::{Edit, EditRefused};
use choreo_script::quoted;
use std::ops::Range;

/// Syntax in which an object states its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NamedBy {
    /// First argument, `cast("ada", …)`. A variable of the same name is renamed with it.
    Argument,
    /// Option `name`. Without it the variable is the name, `let key = sun(…)`; without a variable the option is added.
    Option,
    /// Variable only.
    Variable,
}

/// Changes that rename an object: the edit of the stated name, and the variable to rename.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Renaming {
    pub stated: Option<Edit>,
    /// A byte of the variable's declaration, and the new name.
    pub variable: Option<(usize, String)>,
}

impl ScriptObject<'_> {
    /// The name that the script states: the argument or option if that is a literal, else the variable.
    pub fn name(&self, by: NamedBy) -> Option<String> {
        let stated = self.stated_name(by).and_then(|range| unquoted(&self.text[range]));
        stated.or_else(|| self.variable.clone().filter(|_| by != NamedBy::Argument))
    }

    pub(super) fn stated_name(&self, by: NamedBy) -> Option<Range<usize>> {
        let inside = &self.creating_call.inside;
        let range = match by {
            NamedBy::Argument => inside.start..self.text.value_end(inside.start, inside.end),
            NamedBy::Option => option_value(&self.text, &self.creating_call, "name")?,
            NamedBy::Variable => return None,
        };
        Some(self.text.trimmed(&range))
    }

    /// The changes that rename the object.
    ///
    /// # Errors
    /// The name is computed, the object has none, or another object has the new name. The text is for the user.
    pub fn rename(&self, by: NamedBy, to: &str) -> Result<Renaming, EditRefused> {
        let to = to.trim();
        if to.is_empty() {
            return Err(EditRefused::at(self.line, "a name has at least one letter"));
        }
        let declared = self.variable_declaration();
        match (self.stated_name(by), declared) {
            (Some(range), declared) => {
                let old = unquoted(&self.text[range.clone()]).ok_or_else(|| {
                    let why =
                        format!("its name, {}, is computed; change it there", &self.text[range.clone()]);
                    EditRefused::at(self.line_of(range.start), &why)
                })?;
                self.refuse_taken(to)?;
                let goes_along = |(_, name): &(usize, &str)| *name == old || *name == identifier(&old);
                let variable = declared.filter(goes_along).filter(|(_, name)| *name != identifier(to));
                let variable = variable.map(|(at, _)| (at, identifier(to)));
                Ok(Renaming { stated: Some(Edit { range, text: quoted(to) }), variable })
            }
            (None, Some((_, name))) if name == to => Ok(Renaming::default()),
            (None, Some((at, _))) => {
                let is_word = to.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
                    && !to.starts_with(|c: char| c.is_ascii_digit());
                let name = if is_word { to.to_string() } else { identifier(to) };
                Ok(Renaming { stated: None, variable: Some((at, name)) })
            }
            (None, None) if by == NamedBy::Option => {
                let stated = set_option(&self.text, &self.creating_call, self.line, "name", &quoted(to))?;
                Ok(Renaming { stated: Some(stated), variable: None })
            }
            (None, None) => {
                Err(EditRefused::at(self.line, "it has no variable in the script; write let NAME = …"))
            }
        }
    }

    /// Byte at which the statement of the creating call declares the variable, and the variable.
    fn variable_declaration(&self) -> Option<(usize, &str)> {
        let start = self.text.statement_start(self.creating_call.name.start);
        let name = self.text.variable_of(start).filter(|name| self.variable.as_deref() == Some(name))?;
        Some((self.text.next_token_start(start + "let".len()), name))
    }

    /// Fails if another object of the same kind has this name.
    fn refuse_taken(&self, to: &str) -> Result<(), EditRefused> {
        let made = &self.text[self.creating_call.name.clone()];
        for other in self.text.calls_of(made).filter(|call| call.name != self.creating_call.name) {
            let first = other.inside.start..self.text.value_end(other.inside.start, other.inside.end);
            let option = option_value(&self.text, &other, "name").unwrap_or(first);
            if unquoted(self.text[option].trim()).as_deref() == Some(to) {
                let why = format!("{} is the name of another {made}", quoted(to));
                return Err(EditRefused::at(self.line_of(other.name.start), &why));
            }
        }
        Ok(())
    }
}

/// Content of a string literal, without quotes and escapes.
fn unquoted(text: &str) -> Option<String> {
    let inside = text.strip_prefix('"')?.strip_suffix('"')?;
    let rest = inside.replace("\\\\", "").replace("\\\"", "");
    (!rest.contains(['"', '\\'])).then(|| inside.replace("\\\"", "\"").replace("\\\\", "\\"))
}
