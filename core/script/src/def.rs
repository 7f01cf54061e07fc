//! The functions that a script can call, as data.

use crate::value::HandleKind;

/// Definition of a function or method of the script API, without the code that runs it. The macro [`api!`](crate::call::api)
/// declares tables of definitions, from which the functions are registered and messages and API.md are made.
pub(crate) struct Def {
    pub on: HandleKind,
    pub name: &'static str,
    /// Forms of the arguments, separated by `|`; arguments ending in `?` are optional: `x, y, z | point`.
    pub args: &'static str,
    pub returns: ResultType,
    /// The lines of its documentation comment.
    pub doc: &'static [&'static str],
    /// Function that returns the text to insert for `{}` in the documentation.
    pub options: Option<fn() -> String>,
    /// Whether the function can also be called inside `on_frame`.
    pub is_for_frames: bool,
    /// Whether the function can be called only inside a test section.
    pub is_for_tests: bool,
}

/// Type of a call's result. A failed call returns a placeholder of the same type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ResultType {
    Nothing,
    /// The receiver, for chaining.
    Receiver,
    Handle(HandleKind),
    /// A number, text or list, which has no placeholder, so that a failed call ends the statement.
    Value(&'static str),
}

impl Def {
    pub(crate) const fn in_frames(mut self) -> Def {
        self.is_for_frames = true;
        self
    }

    pub(crate) const fn options(mut self, options: fn() -> String) -> Def {
        self.options = Some(options);
        self
    }

    pub(crate) const fn in_tests(mut self) -> Def {
        self.is_for_tests = true;
        self
    }

    /// The description, then a paragraph for each group of options or aspect.
    pub(crate) fn about(&self) -> Vec<String> {
        let mut items: Vec<String> = Vec::new();
        for line in self.doc {
            let line = line.trim_start();
            match (line.strip_prefix("- "), items.last_mut()) {
                (None, Some(item)) => {
                    item.push(' ');
                    item.push_str(line);
                }
                (item, _) => items.push(item.unwrap_or(line).to_string()),
            }
        }
        if let Some(options) = self.options {
            items.iter_mut().for_each(|item| *item = item.replace("{}", &options()));
        }
        items
    }

    /// Lists of argument names, one for each number of arguments that a form allows.
    pub(crate) fn forms(&self) -> Vec<Vec<&'static str>> {
        let mut forms = Vec::new();
        for form in self.args.split('|') {
            let names: Vec<&str> = form.split(',').map(str::trim).filter(|n| !n.is_empty()).collect();
            let required = names.iter().take_while(|n| !n.ends_with('?')).count();
            for count in required..=names.len() {
                forms.push(names[..count].iter().map(|n| n.trim_end_matches('?')).collect());
            }
        }
        forms
    }

    /// Usage without the type of the receiver: `turn(degrees)`, `at(x, y, z) or at(point)`.
    pub(crate) fn usage(&self) -> String {
        self.usages(self.name).join(" or ")
    }

    /// Usage with the type of the receiver: `Actor.turn(degrees)`, `Actor.at(x, y, z) or Actor.at(point)`,
    /// `load(file, options?)`.
    pub(crate) fn full_usage(&self) -> String {
        self.usages(&self.full_name()).join(" or ")
    }

    /// Usages with the given name of the function, one for each form.
    pub(crate) fn usages(&self, name: &str) -> Vec<String> {
        self.args.split('|').map(|form| format!("{name}({})", form.trim())).collect()
    }

    /// Name with the type of the receiver: `Actor.turn`, `load`.
    pub(crate) fn full_name(&self) -> String {
        match self.on {
            HandleKind::None => self.name.to_string(),
            kind => format!("{}.{}", kind.name(), self.name),
        }
    }
}

/// All functions and methods of scripts, in the order of the reference.
pub(crate) struct Defs {
    /// Functions and methods with their headings.
    pub all: Vec<(&'static str, &'static Def)>,
    /// Name, arguments and description of each mathematical function.
    pub maths: &'static [(&'static str, &'static str, &'static str)],
}

impl Defs {
    pub(crate) fn iter(&self) -> impl Iterator<Item = &'static Def> {
        self.all.iter().map(|(_, def)| *def)
    }
}
