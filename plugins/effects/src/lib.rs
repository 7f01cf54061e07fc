//! The built-in effects: one WGSL file each beside this crate's folder `src`, and the skeleton, whose labels need Rust.

mod skeleton;

use choreo_plugin::Effect;
use choreo_wgsl_effect::WgslEffect;

/// Calls a macro with the effects in WGSL, in the order of listings.
macro_rules! names {
    ($with:ident) => {
        $with![
            "tonemap",
            "outline",
            "fog",
            "toon",
            "views",
            "xray",
            "wireframe",
            "fxaa",
            "bloom",
            "grid",
            "shadow_catcher",
            "motion_blur",
            "vignette",
            "ambient_occlusion",
            "depth_of_field",
            "god_rays",
            "edge_lines",
            "heat_haze",
            "film_grain"
        ]
    };
}

/// The effects with their texts.
macro_rules! wgsl_effects {
    ($($name:literal),*) => { [$(($name, text!($name))),*] };
}

macro_rules! pages {
    ($($name:literal),*) => {
        &[
            $((concat!("plugins/effects/", $name, "/README.md"), include_str!(concat!("../", $name, "/README.md"))),)*
            ("plugins/effects/skeleton/README.md", include_str!("../skeleton/README.md")),
        ]
    };
}

/// The pages of the documentation, by their paths in the sources.
pub const PAGES: &[(&str, &str)] = names!(pages);

// Development builds read the files when the program starts: a change in an effect needs no build.
#[cfg(debug_assertions)]
macro_rules! text {
    ($name:literal) => {{
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/", $name, ".wgsl");
        std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{path}: {e}"))
    }};
}
#[cfg(not(debug_assertions))]
macro_rules! text {
    ($name:literal) => {
        include_str!(concat!("../", $name, ".wgsl"))
    };
}

/// All built-in effects.
pub fn all() -> Vec<Effect> {
    let texts = names!(wgsl_effects);
    let wgsl = |(name, text)| -> Effect {
        let text = AsRef::<str>::as_ref(&text);
        WgslEffect::built_in(&format!("{name}.wgsl"), text, env!("CARGO_PKG_VERSION")).into()
    };
    let mut all: Vec<Effect> = texts.into_iter().map(wgsl).collect();
    let bloom = all.iter().position(|effect| effect.manifest().name == "bloom");
    all.insert(bloom.map_or(0, |bloom| bloom + 1), Effect::overlay(skeleton::Skeleton));
    all
}

/// Built-in effects by name.
///
/// # Panics
/// Panics where there is no effect of a name.
pub fn named(names: &[&str]) -> Vec<Effect> {
    let all = all();
    let find = |name: &&str| all.iter().find(|e| e.manifest().name == *name);
    names.iter().map(|name| find(name).unwrap_or_else(|| panic!("no effect {name}")).clone()).collect()
}
