//! Assets that several actors share: a change affects all of them, unless one actor gets an asset of its own.

use super::Edit;
use super::casting::free_name;
use super::cues::statement_start;
use super::object::ScriptObject;
use super::refused::EditRefused;
use super::scan::{Call, Source};

impl ScriptObject<'_> {
    /// Variable of the asset that an actor is cast from, and the number of `cast` calls that use it. `None` if the actor's own call makes the
    /// asset.
    pub fn asset_variable(&self) -> Option<(&str, usize)> {
        let name = self.text.argument(&self.creating_call.inside, 1)?;
        let made = self.text.assigned_call(&self.text[name.clone()], self.creating_call.name.start)?;
        let is_of_it = |call: &Call| {
            self.text.argument(&call.inside, 1).is_some_and(|other| {
                self.text[other.clone()] == self.text[name.clone()]
                    && self.text.assigned_call(&self.text[other], call.inside.start) == Some(made)
            })
        };
        let count = self.text.calls_of("cast").filter(is_of_it).count();
        Some((&self.text[name], count))
    }

    /// Gives an actor an asset of its own, with a variable declared before the actor's line. `change`: the edit of the shared asset, which the new
    /// one gets.
    ///
    /// # Errors
    /// The asset is not made by `let NAME = …`.
    pub fn own_asset(&self, change: &Edit) -> Result<Edit, EditRefused> {
        let refuse = || EditRefused::at(self.line, "its asset is made elsewhere; change it there");
        let argument = self.text.argument(&self.creating_call.inside, 1).ok_or_else(refuse)?;
        let made = self
            .text
            .assigned_call(&self.text[argument.clone()], self.creating_call.name.start)
            .ok_or_else(refuse)?;
        let changed = change.apply(&self.text);
        let source = Source::new(&changed);
        let value = changed[made..source.statement_end(made)].trim_end_matches(';').to_string();
        let first = self.creating_call.inside.start
            ..self.text.value_end(self.creating_call.inside.start, self.creating_call.inside.end);
        let actor = self.text[first].trim().trim_matches('"');
        let kind = if value.starts_with("load") { "model" } else { "asset" };
        let name = free_name(&self.text, &format!("{actor}_{kind}"));
        let start = statement_start(&self.text, &self.creating_call).unwrap_or(self.creating_call.name.start);
        let start = self.text.statement_start(start);
        let line = self.text[..start].rfind('\n').map_or(0, |end| end + 1);
        let indent = &self.text[line..start];
        let indent = if indent.trim().is_empty() { indent } else { "" };
        let mut after = self.text.to_string();
        after.replace_range(argument, &name);
        after.insert_str(start, &format!("let {name} = {value};\n{indent}"));
        Ok(Edit::between(&self.text, &after))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCRIPT: &str = "let m = load(\"choreo:mannequin\", #{ color: \"red\" });
let ada = cast(\"ada\", m).at(1.0, 0.0, 0.0);
let bob = cast(\"bob\", m);
let box = cast(\"box\", shape(\"box\"));
";

    fn object(line: usize) -> ScriptObject<'static> {
        ScriptObject::at(SCRIPT, line, 11).unwrap()
    }

    #[test]
    fn one_of_several_actors_gets_an_asset_of_its_own() {
        let bob = object(3);
        assert_eq!(bob.asset_variable(), Some(("m", 2)));
        assert_eq!(object(4).asset_variable(), None);
        let at = SCRIPT.find("red").unwrap();
        let blue = Edit { range: at..at + 3, text: "blue".into() };
        let own = bob.own_asset(&blue).unwrap().apply(SCRIPT);
        let anew = "let bob_model = load(\"choreo:mannequin\", #{ color: \"blue\" });\nlet bob = cast(\"bob\", bob_model);";
        assert_eq!(own, SCRIPT.replace("let bob = cast(\"bob\", m);", anew));
        assert!(object(4).own_asset(&blue).is_err());
        let ada = ScriptObject::at(&own, 2, 11).unwrap();
        assert_eq!(ada.asset_variable(), Some(("m", 1)));
    }
}
