//! The built-in effects: one WGSL file for each, beside this crate's folder `src`, and the skeleton, whose labels need Rust.

mod skeleton;

use choreo_plugin::Effect;
use choreo_wgsl_effect::WgslEffect;

/// Calls a macro with the names of the WGSL effects, in the order of listings.
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

/// The WGSL effects, as (name, text).
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

/// The documentation pages, by their paths in the sources.
pub const PAGES: &[(&str, &str)] = names!(pages);

// Development builds read the WGSL files at startup, so that a changed effect needs no build.
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

/// All built-in effects, in the order of listings.
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

/// The built-in effects with these names.
///
/// # Panics
/// Panics where no effect has one of the names.
pub fn named(names: &[&str]) -> Vec<Effect> {
    let all = all();
    let find = |name: &&str| all.iter().find(|e| e.manifest().name == *name);
    names.iter().map(|name| find(name).unwrap_or_else(|| panic!("no effect {name}")).clone()).collect()
}
