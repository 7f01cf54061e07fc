//! Composition: combines layers, classes, variants, references and payloads into one tree of prims. A stronger opinion about an
//! attribute's value or samples replaces a weaker one completely.

use crate::archive::{Archive, is_archive};
use crate::layer::{Attribute, Layer, Prim, Reference, Value};
use crate::{binary, text};
use choreo_importer_kit::{Budget, Notes, Problem, Result};
use choreo_plugin::Files;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::Arc;

/// Nesting of prims and chained arcs, at most.
const MAX_DEPTH: usize = 100;
/// Prims of the scene, at most: nested references multiply.
const MAX_PRIMS: usize = 500_000;

/// Files beside the scene, and files in its packages: `robot.usdz[skin.png]`.
pub(crate) struct Packages<'a> {
    files: &'a dyn Files,
    archives: RefCell<BTreeMap<String, Rc<Archive>>>,
}

impl<'a> Packages<'a> {
    pub(crate) fn new(files: &'a dyn Files) -> Packages<'a> {
        Packages { files, archives: RefCell::default() }
    }

    /// Opens and keeps a package. Returns the path and bytes of its root layer.
    fn open(&self, name: &str, bytes: Arc<Vec<u8>>) -> Result<(String, Arc<Vec<u8>>)> {
        let archive = Rc::new(Archive::open(bytes)?);
        let first = archive.first.clone();
        let layer = archive.read(&first).unwrap_or_default();
        self.archives.borrow_mut().insert(name.to_string(), archive);
        Ok((format!("{name}[{first}]"), layer))
    }
}

impl Files for Packages<'_> {
    fn read(&self, relative: &str) -> std::result::Result<Arc<Vec<u8>>, String> {
        match relative.strip_suffix(']').and_then(|path| path.split_once('[')) {
            Some((package, inner)) => {
                let known = self.archives.borrow();
                let found = known.get(package).and_then(|archive| archive.read(inner));
                found.ok_or_else(|| format!("{relative}: the package has no such file"))
            }
            None => self.files.read(relative),
        }
    }

    fn progress(&self, part: f32) -> bool {
        self.files.progress(part)
    }

    fn wants_clip(&self, index: usize, name: &str) -> bool {
        self.files.wants_clip(index, name)
    }
}

/// Resolves a file name relative to the file that contains it.
fn path_beside(layer_path: &str, file: &str) -> String {
    if let Some((package, inner)) = layer_path.strip_suffix(']').and_then(|path| path.split_once('[')) {
        return format!("{package}[{}]", path_beside(inner, file));
    }
    let folder = layer_path.rsplit_once('/').map_or("", |(folder, _)| folder);
    let mut parts: Vec<&str> = folder.split('/').filter(|part| !part.is_empty()).collect();
    if file.starts_with('/') {
        return file.to_string();
    }
    for part in file.split('/').filter(|part| !part.is_empty() && *part != ".") {
        match (part, parts.last()) {
            ("..", Some(last)) if *last != ".." => _ = parts.pop(),
            _ => parts.push(part),
        }
    }
    parts.join("/")
}

pub(crate) struct Composer<'a> {
    packages: &'a Packages<'a>,
    budget: &'a Budget,
    notes: &'a Notes,
    /// Layer stacks by the path of their root layer.
    stacks: BTreeMap<String, Rc<Layer>>,
    prim_count: usize,
}

impl<'a> Composer<'a> {
    pub(crate) fn new(packages: &'a Packages<'a>, budget: &'a Budget, notes: &'a Notes) -> Composer<'a> {
        Composer { packages, budget, notes, stacks: BTreeMap::new(), prim_count: 0 }
    }

    /// The composed scene of a file, with the metadata of its root layer.
    pub(crate) fn compose_scene(&mut self, name: &str, bytes: Arc<Vec<u8>>) -> Result<Layer> {
        let stack = self.load_layer_stack(name, Some(bytes), 0)?;
        let root = self.compose_prim((&stack, name), &stack.root, "", (None, 0))?;
        Ok(Layer { root, ..Layer::clone(&stack) })
    }

    /// A layer merged with its sublayers.
    fn load_layer_stack(
        &mut self,
        name: &str,
        bytes: Option<Arc<Vec<u8>>>,
        depth: usize,
    ) -> Result<Rc<Layer>> {
        if let Some(known) = self.stacks.get(name) {
            return Ok(known.clone());
        }
        if depth > 16 {
            return Err(Problem::new(name, "layers include each other in a cycle"));
        }
        let mut bytes = match bytes {
            Some(bytes) => bytes,
            None => self.packages.read(name).map_err(|e| Problem::new(name, e))?,
        };
        self.budget.charge(bytes.len() as u64, 1)?;
        let mut place = name.to_string();
        if is_archive(&bytes) {
            (place, bytes) = self.packages.open(name, bytes)?;
        }
        let mut layer = match binary::is_crate(&bytes) {
            true => binary::read(&bytes, self.budget)?,
            false => text::read(&bytes, self.budget)?,
        };
        resolve_asset_paths(&mut layer.root, &place);
        for sublayer in std::mem::take(&mut layer.sublayers) {
            let path = path_beside(&place, &sublayer);
            match self.load_layer_stack(&path, None, depth + 1) {
                Ok(below) => merge_specs(&mut layer.root, below.root.clone()),
                Err(problem) => self.notes.warn(name, format!("{problem}; the layer is left out")),
            }
        }
        let layer = Rc::new(layer);
        self.stacks.insert(name.to_string(), layer.clone());
        Ok(layer)
    }

    /// A prim merged with the targets of all its arcs. `stronger`: the stronger prim that it is composed for, whose variant
    /// selections win.
    fn compose_prim(
        &mut self,
        (stack, name): (&Rc<Layer>, &str),
        spec: &Prim,
        path: &str,
        (stronger, depth): (Option<&Prim>, usize),
    ) -> Result<Prim> {
        self.prim_count += 1;
        self.budget.charge(1, size_of::<Prim>())?;
        if depth > MAX_DEPTH || self.prim_count > MAX_PRIMS {
            let what = "has too many references to be read; check for references in a cycle";
            return Err(Problem::new(if path.is_empty() { "/" } else { path }, what));
        }
        let mut spec = spec.clone();
        for _ in 0..8 {
            let variants = std::mem::take(&mut spec.variants);
            if variants.is_empty() {
                break;
            }
            for (set, mut all) in variants {
                let chosen = stronger.and_then(|stronger| stronger.selections.get(&set));
                let Some(chosen) = chosen.or_else(|| spec.selections.get(&set)).cloned() else { continue };
                if let Some(variant) = all.remove(&chosen) {
                    merge_specs(&mut spec, variant);
                }
            }
        }
        let mut out =
            Prim { children: Vec::new(), references: Vec::new(), classes: Vec::new(), ..spec.clone() };
        for class in &spec.classes {
            let arc = Reference { path: class.clone(), scale: 1.0, ..Reference::default() };
            self.merge_arc((stack, name), &arc, (&spec, path, depth), &mut out)?;
        }
        for reference in &spec.references {
            self.merge_arc((stack, name), reference, (&spec, path, depth), &mut out)?;
        }
        let mut places = index_by_name(&out.children);
        for child in &spec.children {
            let below = format!("{path}/{}", child.name);
            let stronger = stronger.and_then(|stronger| stronger.child(&child.name));
            let composed = self.compose_prim((stack, name), child, &below, (stronger, depth + 1))?;
            match places.get(&child.name) {
                Some(place) => {
                    let weaker = std::mem::replace(&mut out.children[*place], composed);
                    merge(&mut out.children[*place], weaker);
                }
                None => {
                    places.insert(child.name.clone(), out.children.len());
                    out.children.push(composed);
                }
            }
        }
        Ok(out)
    }

    /// Merges the target of an arc into a prim, as the weaker opinion.
    fn merge_arc(
        &mut self,
        (stack, name): (&Rc<Layer>, &str),
        arc: &Reference,
        (spec, path, depth): (&Prim, &str, usize),
        out: &mut Prim,
    ) -> Result<()> {
        let (target, target_name) = match arc.file.is_empty() {
            true => (stack.clone(), name.to_string()),
            false => match self.load_layer_stack(&arc.file, None, 0) {
                Ok(target) => (target, arc.file.clone()),
                Err(problem) => {
                    self.notes.warn(path, format!("{problem}; the reference is left out"));
                    return Ok(());
                }
            },
        };
        let target_path = match arc.path.is_empty() {
            true => format!("/{}", target.default_prim),
            false => arc.path.clone(),
        };
        let Some(found) = target.root.at(&target_path).filter(|_| target_path != "/") else {
            self.notes.warn(path, format!("refers to <{target_path}>, which does not exist"));
            return Ok(());
        };
        let mut weak =
            self.compose_prim((&target, &target_name), found, &target_path, (Some(spec), depth + 1))?;
        remap_paths(&mut weak, &target_path, path);
        if arc.offset != 0.0 || arc.scale != 1.0 {
            retime(&mut weak, arc.offset, arc.scale);
        }
        merge(out, weak);
        Ok(())
    }
}

/// Index of each prim by name.
fn index_by_name(children: &[Prim]) -> BTreeMap<String, usize> {
    children.iter().enumerate().map(|(place, child)| (child.name.clone(), place)).collect()
}

/// Makes asset paths in a layer relative to the scene's folder.
fn resolve_asset_paths(prim: &mut Prim, layer: &str) {
    for reference in prim.references.iter_mut().filter(|r| !r.file.is_empty()) {
        reference.file = path_beside(layer, &reference.file);
    }
    for attribute in prim.attributes.values_mut().filter(|a| a.kind.starts_with("asset")) {
        let attribute = Arc::make_mut(attribute);
        let samples = attribute.samples.iter_mut().map(|(_, value)| value);
        for value in attribute.value.iter_mut().chain(samples) {
            let Value::Texts(list) = value else { continue };
            let placed =
                list.iter().map(|f| if f.is_empty() { String::new() } else { path_beside(layer, f) });
            *value = Value::Texts(placed.collect());
        }
    }
    prim.children.iter_mut().for_each(|child| resolve_asset_paths(child, layer));
    for variant in prim.variants.values_mut().flat_map(BTreeMap::values_mut) {
        resolve_asset_paths(variant, layer);
    }
}

/// Merges a weaker spec whose arcs are not composed yet.
fn merge_specs(strong: &mut Prim, weak: Prim) {
    let Prim { references, classes, selections, variants, .. } = &weak;
    strong.references.extend(references.iter().cloned());
    strong.classes.extend(classes.iter().cloned());
    for (set, chosen) in selections {
        strong.selections.entry(set.clone()).or_insert_with(|| chosen.clone());
    }
    for (set, all) in variants {
        let own = strong.variants.entry(set.clone()).or_default();
        for (name, variant) in all {
            match own.get_mut(name) {
                Some(known) => merge_specs(known, variant.clone()),
                None => _ = own.insert(name.clone(), variant.clone()),
            }
        }
    }
    merge_opinions(strong, weak, merge_specs);
}

/// Merges a weaker prim that is already composed.
fn merge(strong: &mut Prim, weak: Prim) {
    merge_opinions(strong, weak, merge);
}

fn merge_opinions(strong: &mut Prim, weak: Prim, each_child: fn(&mut Prim, Prim)) {
    if strong.specifier == crate::layer::Specifier::Over {
        strong.specifier = weak.specifier;
    }
    for (own, other) in [(&mut strong.kind, weak.kind), (&mut strong.display_name, weak.display_name)] {
        if own.is_empty() {
            *own = other;
        }
    }
    strong.inactive |= weak.inactive;
    for (name, attribute) in weak.attributes {
        match strong.attributes.get_mut(&name) {
            None => _ = strong.attributes.insert(name, attribute),
            Some(own) => {
                let Attribute { value, samples, interpolation, element_size, .. } = &*attribute;
                let opinion = own.value.is_some() || !own.samples.is_empty();
                let own = Arc::make_mut(own);
                if !opinion {
                    (own.value, own.samples) = (value.clone(), samples.clone());
                }
                if own.interpolation.is_empty() {
                    own.interpolation.clone_from(interpolation);
                }
                if own.element_size == 0 {
                    own.element_size = *element_size;
                }
            }
        }
    }
    for (name, sources) in weak.connections {
        strong.connections.entry(name).or_insert(sources);
    }
    for (name, targets) in weak.relations {
        strong.relations.entry(name).or_insert(targets);
    }
    let places = index_by_name(&strong.children);
    for child in weak.children {
        match places.get(&child.name) {
            Some(place) => each_child(&mut strong.children[*place], child),
            None => strong.children.push(child),
        }
    }
}

/// Rewrites connection and relationship targets below one path to another path.
fn remap_paths(prim: &mut Prim, old_root: &str, new_root: &str) {
    let lists = prim.connections.values_mut().chain(prim.relations.values_mut());
    for path in lists.flatten() {
        if let Some(rest) = path.strip_prefix(old_root)
            && (rest.is_empty() || rest.starts_with(['/', '.']))
        {
            *path = format!("{new_root}{rest}");
        }
    }
    prim.children.iter_mut().for_each(|child| remap_paths(child, old_root, new_root));
}

fn retime(prim: &mut Prim, offset: f64, scale: f64) {
    for attribute in prim.attributes.values_mut().filter(|a| !a.samples.is_empty()) {
        let attribute = Arc::make_mut(attribute);
        attribute.samples.iter_mut().for_each(|(time, _)| *time = *time * scale + offset);
        attribute.samples.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    prim.children.iter_mut().for_each(|child| retime(child, offset, scale));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn asset_paths_are_relative_to_their_layer() {
        assert_eq!(path_beside("a/b.usda", "./c.png"), "a/c.png");
        assert_eq!(path_beside("a/b.usda", "../c.png"), "c.png");
        assert_eq!(path_beside("b.usda", "../c.png"), "../c.png");
        assert_eq!(path_beside("p.usdz[m/a.usdc]", "../t.png"), "p.usdz[t.png]");
    }
}
