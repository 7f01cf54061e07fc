//! Static analysis of a script, before it runs: finds the files that it uses for their clips only, and the clips that it plays.
//!
//! No mesh or image is imported from a file that is used for its clips only. Such a file must satisfy one of two conditions: the
//! asset is in a variable that the whole script uses only for `.clip(…)`, `.clips()` and `.joints()`; or the script calls one of
//! these methods on the result of `load(…)` directly. Any other use counts as if the asset were cast.

use crate::api_error::Place;
use crate::loader::PlayedClips;
use rhai::{AST, ASTNode, Expr, FnCallExpr, Position, Stmt};
use std::collections::BTreeSet;

/// Methods of an asset that need no geometry.
const CLIP_METHODS: [&str; 3] = ["clip", "clips", "joints"];

/// Places of `load(…)` calls whose file is used for its clips only.
pub(crate) fn find_loads_of_clips_only(ast: &AST, source: &str) -> Vec<Place> {
    // A function that the script defines by one of these names could use the asset in any way.
    if ast.iter_functions().any(|f| CLIP_METHODS.contains(&f.name) || f.name == "load") {
        return Vec::new();
    }
    let mut loads: Vec<(Position, Option<String>, String)> = Vec::new();
    // Names of variables and files that are used for more than clips.
    let mut variables: BTreeSet<String> = BTreeSet::new();
    let mut files: BTreeSet<String> = BTreeSet::new();
    ast.walk(&mut |path| {
        let parent = path.len().checked_sub(2).map(|at| &path[at]);
        match path.last() {
            Some(ASTNode::Expr(Expr::FnCall(call, at))) if call.name == "load" => {
                let file = match call.args.first() {
                    Some(Expr::StringConstant(text, _)) => Some(text.to_string()),
                    _ => None,
                };
                let here = path.last().map(address);
                let load = match parent {
                    Some(ASTNode::Stmt(Stmt::Var(variable, ..))) => Some(variable.0.name.to_string()),
                    Some(ASTNode::Expr(Expr::Dot(dot, ..)))
                        if Some(std::ptr::from_ref(&dot.lhs).cast()) == here
                            && needs_only_clips(&dot.rhs) =>
                    {
                        Some(String::new())
                    }
                    _ => None,
                };
                match load {
                    Some(variable) => loads.push((*at, file, variable)),
                    None => files.extend(file),
                }
            }
            Some(ASTNode::Stmt(Stmt::FnCall(call, _))) if call.name == "load" => {
                if let Some(Expr::StringConstant(text, _)) = call.args.first() {
                    files.insert(text.to_string());
                }
            }
            Some(ASTNode::Stmt(Stmt::Export(names, _))) => {
                variables.insert(names.0.name.to_string());
            }
            Some(node @ ASTNode::Expr(Expr::Variable(variable, ..))) => {
                let is_clip_use = match parent {
                    Some(ASTNode::Expr(Expr::Dot(dot, ..))) => {
                        std::ptr::from_ref(&dot.lhs).cast() == address(node) && needs_only_clips(&dot.rhs)
                    }
                    // A closure captures the variable; the uses in its body have the same name and are visited as well.
                    Some(ASTNode::Expr(Expr::FnCall(call, _)) | ASTNode::Stmt(Stmt::FnCall(call, _))) => {
                        call.name == "curry"
                    }
                    _ => false,
                };
                if !is_clip_use {
                    variables.insert(variable.1.to_string());
                }
            }
            _ => {}
        }
        true
    });
    for (_, file, variable) in &loads {
        if variables.contains(variable) {
            files.extend(file.clone());
        }
    }
    let only = |(_, file, variable): &&(Position, Option<String>, String)| {
        !variables.contains(variable) && !file.as_ref().is_some_and(|f| files.contains(f))
    };
    let place = |at: &Position| Place {
        file: source.to_string(),
        line: at.line().unwrap_or(0),
        column: at.position().unwrap_or(0),
    };
    loads.iter().filter(only).map(|(at, ..)| place(at)).collect()
}

/// Clips that a script can play: those named in its calls of `clip`. The result is all clips if a name is not a literal, if the
/// script calls `clips`, or if modules or function pointers could call `clip`.
pub(crate) fn played_clips(ast: &AST) -> PlayedClips {
    let mut names = BTreeSet::new();
    let mut all = ast.iter_functions().any(|f| f.name == "clip");
    let mut call = |call: &FnCallExpr| match (call.name.as_str(), call.args.last()) {
        ("clip", Some(Expr::StringConstant(name, _))) => _ = names.insert(name.to_string()),
        ("clip" | "clips" | "Fn", _) => all = true,
        _ => {}
    };
    let mut has_hidden_calls = false;
    ast.walk(&mut |path| {
        match path.last() {
            Some(ASTNode::Expr(Expr::FnCall(c, _) | Expr::MethodCall(c, _))) => call(c),
            Some(ASTNode::Stmt(Stmt::FnCall(c, _))) => call(c),
            Some(ASTNode::Stmt(Stmt::Import(..))) => has_hidden_calls = true,
            // Literal function pointers are constants in the syntax tree.
            Some(ASTNode::Expr(Expr::DynamicConstant(value, _))) => {
                has_hidden_calls |= format!("{value:?}").contains("clip");
            }
            _ => {}
        }
        true
    });
    if all || has_hidden_calls { PlayedClips::All } else { PlayedClips::Named(names) }
}

/// Address of a node of the syntax tree, to compare nodes by identity.
fn address(node: &ASTNode<'_>) -> *const () {
    match node {
        ASTNode::Expr(expr) => std::ptr::from_ref(*expr).cast(),
        ASTNode::Stmt(stmt) => std::ptr::from_ref(*stmt).cast(),
        _ => std::ptr::null(),
    }
}

/// Whether the first method in a chain of calls is one of [`CLIP_METHODS`].
fn needs_only_clips(right: &Expr) -> bool {
    match right {
        Expr::MethodCall(call, _) => CLIP_METHODS.contains(&call.name.as_str()),
        Expr::Dot(dot, ..) | Expr::Index(dot, ..) => needs_only_clips(&dot.lhs),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    /// Lines of the `load` calls that are found to be used for clips only.
    fn clips_only_lines(text: &str) -> Vec<usize> {
        let mut engine = rhai::Engine::new_raw();
        engine.set_allow_shadowing(true);
        let ast = engine.compile(text).unwrap();
        super::find_loads_of_clips_only(&ast, "t").iter().map(|place| place.line).collect()
    }

    /// Names of the clips that a script can play; `None`: all clips.
    fn played_names(text: &str) -> Option<Vec<String>> {
        let ast = rhai::Engine::new_raw().compile(text).unwrap();
        match super::played_clips(&ast) {
            super::PlayedClips::Named(names) => Some(names.into_iter().collect()),
            _ => None,
        }
    }

    #[test]
    fn played_clips_are_those_named_by_literals_else_all() {
        let named = |names: &[&str]| Some(names.iter().map(|n| n.to_string()).collect::<Vec<_>>());
        let text = "let m = load(\"a\"); fn g(m) { m.clip(\"Run\") } on_frame(|t| clip(m, \"Jump\")); m.clip(\"Walk\").mirror();";
        assert_eq!(played_names(text), named(&["Jump", "Run", "Walk"]));
        assert_eq!(played_names("cast(\"x\", load(\"a\"));"), named(&[]));
        for text in [
            "m.clip(0);",
            "m.clip(name);",
            "m.clip(\"a\" + i);",
            "m.clip(`a${i}`);",
            "m.clips();",
            "for n in [\"a\"] { f(m.clip(n)); }",
            "Fn(\"clip\").call(m, \"a\");",
            "import \"x\" as x; m.clip(\"a\");",
            "fn clip(m, n) { 1 } m.clip(\"a\");",
        ] {
            assert_eq!(played_names(text), None, "{text}");
        }
    }

    #[test]
    fn loads_used_only_by_clip_methods_are_found() {
        assert_eq!(
            clips_only_lines("let m = load(\"a\");\nlet w = m.clip(\"Walk\");\nf(m.clips().len(), w);"),
            [1]
        );
        assert_eq!(clips_only_lines("f(load(\"a\").clip(0));"), [1]);
        assert_eq!(clips_only_lines("f(load(\"a\").clips()[0]);"), [1]);
        assert_eq!(clips_only_lines("let m = load(\"a\");\nf(|t| m.clip(0));"), [1]);
        assert_eq!(clips_only_lines("for n in [\"a\", \"b\"] { let m = load(n); f(m.clip(0)); }"), [1]);
        assert_eq!(clips_only_lines("let m = load(\"a\");"), [1], "nothing at all is used");
    }

    #[test]
    fn loads_that_may_be_cast_are_not_found() {
        for text in [
            "let m = load(\"a\"); cast(\"x\", m); m.clip(0);",
            "cast(\"x\", load(\"a\"));",
            "let m = load(\"a\"); let n = m; n.clip(0);",
            "let m = load(\"a\"); let all = [m];",
            "let m = load(\"a\"); f(#{ m: m });",
            "let m = (); m = load(\"a\"); m.clip(0);",
            "let m = load(\"a\"); m.camera(0);",
            "let m = load(\"a\"); f(|| cast(\"x\", m));",
            "let m = load(\"a\"); export m;",
            "let m = load(\"a\"); m.clip(0); cast(\"x\", load(\"a\"));",
            "let m = load(\"a\"); let n = load(\"a\"); m.clip(0); cast(\"x\", n);",
            "fn clip(n) { cast(\"x\", this) } let m = load(\"a\"); m.clip(0);",
            "fn g(m) { cast(\"x\", m) } let m = load(\"a\"); m.clip(0);",
            "let m = load(\"a\"); `${m}`;",
        ] {
            assert_eq!(clips_only_lines(text), [0usize; 0], "{text}");
        }
    }
}
