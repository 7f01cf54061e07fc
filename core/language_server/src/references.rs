//! Declaration, uses and renaming of names, in a script and in the modules of its folder.

use crate::calls::NoModules;
use crate::document::uri_of;
use crate::request::Request;
use crate::source::{InnerWord, Source, is_string, is_word};
use crate::transport::ResponseError;
use crate::values::{Budget, Declaration, DeclarationKind, Modules, Types, is_keyword};
use crate::view::View;
use choreo_script::describe;
use serde_json::{Map, Value, json};
use std::ops::Range;
use std::sync::Arc;
use thiserror::Error;

/// The name under the cursor.
struct NameAtCursor {
    name: String,
    /// Bytes of the name at the cursor.
    range: Range<usize>,
    /// Module that declares the name; `None` if this script does.
    module: Option<String>,
    declaration: Declaration,
}

/// Largest number of scripts in a folder that are searched for uses of a module.
const MAX_FILES: usize = 300;

pub(crate) fn definition(request: &Request) -> Result<Value, ResponseError> {
    let view = request.view;
    if let Some(named) = name_at_cursor(view, request.byte()) {
        return Ok(declaration_location(request, &named).unwrap_or(Value::Null));
    }
    let Some(token) = view.source.token_at(request.byte()) else { return Ok(Value::Null) };
    if is_string(view.source.get(token)) {
        let name = view.source.string_value(token).unwrap_or_default();
        let is_script_path = matches!(
            (view.source.token_before(token, 1), view.source.token_before(token, 2)),
            ("import", _) | ("(", "scene")
        );
        let path = view.modules.path(&name).filter(|_| is_script_path);
        return Ok(path.map_or(Value::Null, |path| location(&uri_of(&path), file_start())));
    }
    Ok(Value::Null)
}

fn file_start() -> Value {
    json!({ "start": { "line": 0, "character": 0 }, "end": { "line": 0, "character": 0 } })
}

fn location(uri: &str, range: Value) -> Value {
    json!({ "uri": uri, "range": range })
}

fn declaration_location(request: &Request, named: &NameAtCursor) -> Option<Value> {
    let view = request.view;
    let Some(module) = &named.module else {
        let range = view.source.range(&view.source.tokens[named.declaration.token]);
        return Some(location(request.uri, range));
    };
    let source = view.modules.module(module)?;
    let range = source.range(&source.tokens[named.declaration.token]);
    Some(location(&uri_of(&view.modules.path(module)?), range))
}

/// The variable, parameter, function or module under the cursor, also in code inside a string. Names of the API are left out.
fn name_at_cursor(view: &View, byte: usize) -> Option<NameAtCursor> {
    let (source, types) = (view.source, view.types());
    let touches = |word: &InnerWord| (word.range.start..=word.range.end).contains(&byte);
    if let Some(word) = source.inner_words().find(touches) {
        if is_keyword(word.text) || word.is_member() {
            return None;
        }
        if word.before[0] == "::" {
            return module_member(view, word.before[1], word.text, word.string, word.range);
        }
        let declaration = types.declaration(word.text, word.string)?;
        return Some(NameAtCursor {
            name: word.text.to_string(),
            range: word.range,
            module: None,
            declaration,
        });
    }
    let token = source.token_at(byte)?;
    let (name, range) = (source.get(token), source.tokens[token].clone());
    if !is_word(name) || is_keyword(name) || is_member(source, token) {
        return None;
    }
    if source.token_before(token, 1) == "::" {
        return module_member(view, source.token_before(token, 2), name, token, range);
    }
    let declaration = types.declaration_at(token).or_else(|| types.declaration(name, token))?;
    Some(NameAtCursor { name: name.to_string(), range, module: None, declaration })
}

/// The name of a module member, given the alias under which the module is imported at a token.
fn module_member(
    view: &View,
    alias: &str,
    name: &str,
    from: usize,
    range: Range<usize>,
) -> Option<NameAtCursor> {
    let types = view.types();
    let module = types.declared_value(&types.declaration(alias, from)?).name?;
    let declaration = exported_declaration(&*view.modules.module(&module)?, name, view.modules)?;
    Some(NameAtCursor { name: name.to_string(), range, module: Some(module), declaration })
}

/// Whether a token is a method, a property, or the key of an object map.
fn is_member(source: &Source, token: usize) -> bool {
    let in_map = source.enclosing_bracket(token).is_some_and(|open| source.get(open) == "#{");
    matches!(source.token_before(token, 1), "." | "?.") || (in_map && source.get(token + 1) == ":")
}

/// Declaration of a function or variable that a module exports.
fn exported_declaration(source: &Source, name: &str, modules: &dyn Modules) -> Option<Declaration> {
    let budget = Budget::default();
    let types = Types::new(source, modules, &budget);
    let of_name = (0..source.tokens.len())
        .filter(|token| source.get(*token) == name && source.enclosing_bracket(*token).is_none());
    let mut declared = of_name.filter_map(|token| types.declaration_at(token));
    declared.find(|d| d.kind == DeclarationKind::Function || source.token_before(d.token, 2) == "export")
}

/// Ranges in a source that refer to a name that the source declares.
fn find_uses(source: &Source, named: &NameAtCursor, modules: &dyn Modules) -> Vec<Range<usize>> {
    let is_same = |declared: Option<Declaration>| declared.as_ref() == Some(&named.declaration);
    let is_use_in_code = |token: &usize| {
        let budget = Budget::default();
        let types = Types::new(source, modules, &budget);
        let is_other_name = is_member(source, *token) || source.token_before(*token, 1) == "::";
        !is_other_name
            && is_same(types.declaration_at(*token).or_else(|| types.declaration(&named.name, *token)))
    };
    let is_use_in_string = |word: &InnerWord| {
        let budget = Budget::default();
        let types = Types::new(source, modules, &budget);
        let is_other_name = word.text != named.name || word.is_member() || word.before[0] == "::";
        !is_other_name && is_same(types.declaration(word.text, word.string))
    };
    let tokens = (0..source.tokens.len()).filter(|token| source.get(*token) == named.name);
    let tokens = tokens.filter(is_use_in_code).map(|token| source.tokens[token].clone());
    sorted_by_start(tokens.chain(source.inner_words().filter(is_use_in_string).map(|word| word.range)))
}

fn sorted_by_start(ranges: impl Iterator<Item = Range<usize>>) -> Vec<Range<usize>> {
    let mut ranges: Vec<_> = ranges.collect();
    ranges.sort_by_key(|range| range.start);
    ranges
}

/// Ranges in a script that refer to a name of a module.
fn find_uses_of_module_member(source: &Source, module: &str, name: &str) -> Vec<Range<usize>> {
    let imports = (0..source.tokens.len()).filter(|i| {
        source.token_before(*i, 1) == "import"
            && source.string_value(*i).is_some_and(|s| s.trim_end_matches(".rhai") == module)
    });
    let aliases: Vec<&str> =
        imports.filter(|i| source.get(i + 1) == "as").map(|i| source.get(i + 2)).collect();
    let is_member_name =
        |text: &str, before: [&str; 2]| text == name && before[0] == "::" && aliases.contains(&before[1]);
    let is_use = |token: &usize| {
        is_member_name(source.get(*token), [source.token_before(*token, 1), source.token_before(*token, 2)])
    };
    let tokens = (0..source.tokens.len()).filter(is_use).map(|token| source.tokens[token].clone());
    let inner =
        source.inner_words().filter(|word| is_member_name(word.text, word.before)).map(|word| word.range);
    sorted_by_start(tokens.chain(inner))
}

/// All occurrences of a name: URI, source and bytes.
fn find_occurrences(request: &Request, named: &NameAtCursor) -> Vec<(String, Arc<Source>, Range<usize>)> {
    let view = request.view;
    let script = Arc::new(Source::new(&view.source.text));
    let declaring_source = match &named.module {
        None => Some((request.uri.to_string(), script)),
        Some(module) => view.modules.path(module).map(|p| uri_of(&p)).zip(view.modules.module(module)),
    };
    let Some((declaring_uri, declaring_source)) = declaring_source else { return Vec::new() };
    let mut found: Vec<(String, Arc<Source>, Range<usize>)> = Vec::new();
    let mut add = |uri: &str, source: &Arc<Source>, ranges: Vec<Range<usize>>| {
        found.extend(ranges.into_iter().map(|range| (uri.to_string(), source.clone(), range)));
    };
    add(&declaring_uri, &declaring_source, find_uses(&declaring_source, named, view.modules));
    if exported_declaration(&declaring_source, &named.name, view.modules).as_ref() != Some(&named.declaration)
    {
        return found;
    }
    for file in view.files_named(&["rhai".into()]).into_iter().take(MAX_FILES) {
        let (Some(path), Some(source)) = (view.modules.path(&file), view.modules.module(&file)) else {
            continue;
        };
        let uri = uri_of(&path);
        let module = import_name(view, &declaring_uri);
        if uri != declaring_uri
            && let Some(module) = module
        {
            add(&uri, &source, find_uses_of_module_member(&source, &module, &named.name));
        }
    }
    found
}

/// Name by which scripts in the folder import a file.
fn import_name(view: &View, uri: &str) -> Option<String> {
    let names = view.files_named(&["rhai".into()]);
    let is_it = |name: &&String| view.modules.path(name).is_some_and(|path| uri_of(&path) == uri);
    names.iter().find(is_it).map(|name| name.trim_end_matches(".rhai").to_string())
}

pub(crate) fn references(request: &Request) -> Result<Value, ResponseError> {
    let Some(named) = name_at_cursor(request.view, request.byte()) else { return Ok(json!([])) };
    let with_declaration = request.parameters["context"]["includeDeclaration"] != false;
    let declared = declaration_location(request, &named);
    let all = find_occurrences(request, &named)
        .into_iter()
        .map(|(uri, source, bytes)| location(&uri, source.range(&bytes)));
    Ok(all.filter(|place| with_declaration || Some(place) != declared.as_ref()).collect::<Vec<_>>().into())
}

pub(crate) fn prepare_rename(request: &Request) -> Result<Value, ResponseError> {
    let named = name_to_rename(request)?;
    Ok(json!({ "range": request.view.source.range(&named.range), "placeholder": named.name }))
}

fn name_to_rename(request: &Request) -> Result<NameAtCursor, ResponseError> {
    let why = "only variables, parameters, functions and names of modules can be renamed";
    name_at_cursor(request.view, request.byte()).ok_or_else(|| rename_error(why))
}

fn rename_error(why: &str) -> ResponseError {
    ResponseError::new(ResponseError::FAILED, why)
}

pub(crate) fn rename(request: &Request) -> Result<Value, ResponseError> {
    let named = name_to_rename(request)?;
    let new = request.parameters["newName"].as_str().unwrap_or_default();
    invalid_name_reason(new, &named.declaration).map_or(Ok(()), |why| Err(rename_error(&why)))?;
    let places = find_occurrences(request, &named);
    let mut changes: Map<String, Value> = Map::new();
    for (uri, source, bytes) in &places {
        rename_conflict(source, &named, new).map_or(Ok(()), |conflict| Err(rename_error(&conflict.why)))?;
        let edit = json!({ "range": source.range(bytes), "newText": new });
        match changes.get_mut(uri).and_then(Value::as_array_mut) {
            Some(edits) => edits.push(edit),
            None => drop(changes.insert(uri.clone(), json!([edit]))),
        }
    }
    Ok(json!({ "changes": changes }))
}

/// Reason why a text is not a valid new name. A variable may have the name of an API function, since scripts can still call the function.
fn invalid_name_reason(new: &str, declaration: &Declaration) -> Option<String> {
    let plain = is_word(new) && new.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    if !plain || is_keyword(new) {
        let why = "cannot be a name: write letters, digits and _, and no keyword of the language";
        return Some(format!("\"{new}\" {why}"));
    }
    let taken = describe::entry("", new).filter(|_| declaration.kind == DeclarationKind::Function);
    taken.map(|_| format!("{new} is a function of the API; choose another name"))
}

/// Reason why a variable is not renamed, for the user.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{why}")]
pub struct NotRenamed {
    pub why: String,
    /// Line with the conflict, from 1.
    pub line: Option<usize>,
}

/// Ranges in a script that refer to the variable declared at a byte, if all of them can safely be renamed.
///
/// # Errors
/// The new name is in use, or the variable is visible to other scripts or referenced by a text.
pub fn variable_uses(text: &str, byte: usize, new: &str) -> Result<Vec<Range<usize>>, NotRenamed> {
    let (source, budget) = (Source::new(text), Budget::default());
    let line = source.lines.line_of(byte) + 1;
    let refuse = |why: String| NotRenamed { why: format!("line {line}: {why}"), line: Some(line) };
    let token = source.token_at(byte);
    let types = Types::new(&source, &NoModules, &budget);
    let declared = token.and_then(|token| Some((token, types.declaration_at(token)?)));
    let (token, declaration) = declared.ok_or_else(|| refuse("no variable is declared there".to_string()))?;
    invalid_name_reason(new, &declaration).map_or(Ok(()), |why| Err(refuse(why)))?;
    let (name, range) = (source.get(token).to_string(), source.tokens[token].clone());
    if exported_declaration(&source, &name, &NoModules).as_ref() == Some(&declaration) {
        return Err(refuse(format!("other scripts can use it as {name}; rename it in the script")));
    }
    let named = NameAtCursor { name, range, module: None, declaration };
    rename_conflict(&source, &named, new).map_or(Ok(()), Err)?;
    Ok(find_uses(&source, &named, &NoModules))
}

/// Reason why a name cannot be changed safely in a source.
fn rename_conflict(source: &Source, named: &NameAtCursor, new: &str) -> Option<NotRenamed> {
    let is_function = named.declaration.kind == DeclarationKind::Function;
    let line = |range: &Range<usize>| source.lines.line_of(range.start) + 1;
    let conflict =
        |line: usize, why: String| Some(NotRenamed { why: format!("line {line} {why}"), line: Some(line) });
    let used = |line: usize| conflict(line, format!("uses the name {new} already"));
    let as_method = |line: usize| conflict(line, format!("may call {} as a method", named.name));
    for token in 0..source.tokens.len() {
        let (text, line) = (source.get(token), line(&source.tokens[token]));
        if text == new && !is_member(source, token) {
            return used(line);
        }
        let mentions_name =
            |text: &str| text.split(|c: char| !(c.is_alphanumeric() || c == '_')).any(|w| w == named.name);
        if is_function && is_string(text) && source.token_before(token, 2) == "Fn" && mentions_name(text) {
            return conflict(line, format!("calls {} by its name in a text", named.name));
        }
        if is_function && text == named.name && matches!(source.token_before(token, 1), "." | "?.") {
            return as_method(line);
        }
    }
    for word in source.inner_words() {
        let line = line(&word.range);
        if word.text == new && !word.is_member() {
            return used(line);
        }
        let declares = matches!(word.before[0], "let" | "const" | "for" | "|")
            || word.next == "|"
            || (word.before[0] == "(" && word.before[1] == "for");
        if word.text == named.name && declares {
            return conflict(line, format!("declares another {} inside a text", named.name));
        }
        if is_function && word.text == named.name && matches!(word.before[0], "." | "?.") {
            return as_method(line);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Renames the variable that is declared at `|`.
    fn renamed(text: &str, new: &str) -> Result<String, NotRenamed> {
        let at = text.find('|').unwrap();
        let mut text = text.replacen('|', "", 1);
        for range in variable_uses(&text, at, new)?.into_iter().rev() {
            text.replace_range(range, new);
        }
        Ok(text)
    }

    #[test]
    fn a_variable_is_renamed_only_where_its_declaration_is_visible() {
        let text = "let |a = cast(\"a\", m);\na.play(`${a.name} a`); b.a(#{ a: a });\nfn f(a) { a }\n{ let a = 2; a }\nlist.map(|a| a + 1); c(|x| x + a);";
        let wanted = "let e = cast(\"a\", m);\ne.play(`${e.name} a`); b.a(#{ a: e });\nfn f(a) { a }\n{ let a = 2; a }\nlist.map(|a| a + 1); c(|x| x + e);";
        assert_eq!(renamed(text, "e").unwrap(), wanted);
    }

    #[test]
    fn an_unsafe_rename_is_refused_with_the_line_of_the_conflict() {
        for (text, new, why, line) in [
            ("let |a = 1;\nlet e = a;", "e", "line 2 uses the name e already", 2),
            ("let |a = 1;\nsun(1);", "sun", "line 2 uses the name sun already", 2),
            (
                "let |a = 1;",
                "if",
                "line 1: \"if\" cannot be a name: write letters, digits and _, and no keyword of the \
                 language",
                1,
            ),
            ("x = 1;\n|a.b();", "e", "line 2: no variable is declared there", 2),
            (
                "let b = 1;\nexport let |a = 1;",
                "e",
                "line 2: other scripts can use it as a; rename it in the script",
                2,
            ),
        ] {
            let refused = renamed(text, new).unwrap_err();
            assert_eq!((refused.why.as_str(), refused.line), (why, Some(line)));
        }
    }
}
