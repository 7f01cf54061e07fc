//! Converts the result of `fn manifest()` to a [`Manifest`].

use crate::fields::{Fields, Result};
use choreo_plugin::Manifest;
use rhai::{Array, Dynamic, Map};

/// Reads the manifest. Error: the value is no object map, or a field is missing or wrong.
pub(crate) fn read_manifest(value: &Dynamic) -> Result<Manifest> {
    let map = value.read_lock::<Map>().ok_or("manifest() must return an object map #{ name: …, … }")?;
    let f = Fields::new("manifest", &map, &["name", "version", "about", "extensions", "magic", "options"])?;
    let name = f.text("name")?.ok_or("manifest: name is missing")?;
    let valid = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if name.is_empty() || name.len() > 60 || !name.chars().all(valid) {
        return Err(format!("manifest: name \"{name}\" must be letters, digits, - and _, at most 60").into());
    }
    let version = f.text("version")?.unwrap_or_else(|| "1".into());
    let about = f.text("about")?.unwrap_or_default();
    let mut manifest = Manifest::new(&name, &version, &about);
    for extension in text_list(&f, "extensions")? {
        let plain = extension.trim_start_matches('.').to_ascii_lowercase();
        manifest.extensions.push(plain);
    }
    for magic in text_list(&f, "magic")?.into_iter().filter(|m| !m.is_empty()) {
        manifest = manifest.magic(latin1_bytes(&magic)?);
    }
    if let Some(options) = f.value("options") {
        let options = options.read_lock::<Map>().ok_or("manifest: options must be an object map")?;
        for (name, spec) in options.iter() {
            manifest = add_option(manifest, name, spec)?;
        }
    }
    Ok(manifest)
}

/// One text, or an array of texts.
fn text_list(f: &Fields<'_>, name: &str) -> Result<Vec<String>> {
    let Some(value) = f.value(name) else { return Ok(Vec::new()) };
    if let Some(array) = value.read_lock::<Array>() {
        let all: Option<Vec<String>> = array.iter().map(|v| v.clone().into_string().ok()).collect();
        return all.ok_or_else(|| format!("manifest: {name} must be a text or an array of texts").into());
    }
    Ok(f.text(name)?.into_iter().collect())
}

/// Bytes of a text such as `"\x89PNG"`, one per character. A character beyond U+00FF is an error.
fn latin1_bytes(text: &str) -> Result<Vec<u8>> {
    text.chars()
        .map(|c| {
            u8::try_from(u32::from(c)).map_err(|_| {
                format!("manifest: magic holds '{c}', which is beyond U+00FF and so is not a byte").into()
            })
        })
        .collect()
}

/// Adds an option to the manifest. The type of its default value is the type of the option.
fn add_option(manifest: Manifest, name: &str, spec: &Dynamic) -> Result<Manifest> {
    let what = format!("manifest: option {name}");
    let map = spec.read_lock::<Map>().ok_or_else(|| format!("{what} must be #{{ value: …, about: … }}"))?;
    let f = Fields::new(&what, &map, &["value", "about", "min", "max", "one_of"])?;
    let about = f.text("about")?.unwrap_or_default();
    let default = f.value("value").ok_or_else(|| format!("{what}: value is missing"))?;
    if let Ok(flag) = default.as_bool() {
        return Ok(manifest.flag(name, &about, flag));
    }
    if default.is_string() {
        let text = f.text("value")?.unwrap_or_default();
        let one_of = text_list(&f, "one_of")?;
        if !one_of.is_empty() && !one_of.contains(&text) {
            return Err(format!("{what}: the value \"{text}\" is not in one_of").into());
        }
        let one_of: Vec<&str> = one_of.iter().map(String::as_str).collect();
        return Ok(manifest.text(name, &about, &text, &one_of));
    }
    let number = f.number("value")?.unwrap_or_default();
    let (min, max) = (f.number("min")?.unwrap_or(-1e9), f.number("max")?.unwrap_or(1e9));
    if !(min..=max).contains(&number) {
        return Err(format!("{what}: the value {number} is not within {min} to {max}").into());
    }
    Ok(manifest.number(name, &about, number, min..=max))
}
