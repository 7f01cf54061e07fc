//! Every pipeline key that the planner can produce compiles, without a GPU.
//!
//! The rules of the table of shader features (`choreo_render::plan::shader_features`) say which sets of switches are possible. They are
//! far too many to compile each, but what can go wrong in one depends on few switches: a name must be declared wherever it is
//! used, once, and braces and returns must match. So the shaders' text is searched for switches that meet: those that decide
//! whether a line is in, and those that decide whether the names on it are declared. Every possible combination of
//! switches that meet is compiled in at least one set, and every possible pair of all switches, too.

use choreo_plugin::Hook;
use choreo_render::plan::REACH_ROWS;
use choreo_render::plan::shader_features::{FEATURES, Features, names};
use choreo_render::shader::switches::{SWITCHES, SwitchSource, broken_rule, switch_names};
use choreo_render::shader::{
    BACKGROUND, LAYERS_BEHIND, OVERLAY, PRESKIN, ParameterRows, SCENE, SKY, SceneEffect, ShaderSources,
    SourceFile, compile, entry_points, parse, preprocess, surface_files,
};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet, HashSet};

/// Switches of modules other than the scene's.
const OF_OTHERS: [&str; 5] = ["DITHER", "SKY_BACKGROUND", "PICTURE", "SURFACE_INPUT", "MOTION_INPUT"];

/// Switches that are on and switches that are off; all others are undecided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
struct Partial {
    on: u128,
    off: u128,
}

impl Partial {
    fn meets(self, other: Partial) -> bool {
        self.on & other.off == 0 && self.off & other.on == 0
    }
    fn with(self, other: Partial) -> Partial {
        Partial { on: self.on | other.on, off: self.off | other.off }
    }
    fn contains(self, other: Partial) -> bool {
        self.on & other.on == other.on && self.off & other.off == other.off
    }
}

/// The rules of the table as clauses, of which each must hold: some switch of `on` is on or some of `off` is off.
struct Rules {
    names: Vec<&'static str>,
    clauses: Vec<Partial>,
}

impl Rules {
    fn of_table() -> Rules {
        let mut rules = Rules { names: switch_names().collect(), clauses: Vec::new() };
        assert!(rules.names.len() <= 128);
        let of_features = FEATURES.iter().map(|f| (f.name, f.needs, None, None));
        let of_switches = SWITCHES.iter().map(|s| (s.name, s.needs, s.only, Some(s.source)));
        for (name, needs, only, source) in of_features.chain(of_switches) {
            let own = rules.bit(name);
            for condition in needs {
                rules.implies(own, &rules.groups(condition));
            }
            for feature in FEATURES.iter().filter(|f| only.is_some_and(|only: Features| !only.has(f.bit))) {
                let off = own | rules.bit(feature.name);
                rules.clauses.push(Partial { on: 0, off });
            }
            match source {
                Some(SwitchSource::Condition(condition)) => {
                    let groups = rules.groups(condition);
                    rules.implies(own, &groups);
                    for group in groups {
                        rules.clauses.push(Partial { on: own | group.off, off: group.on });
                    }
                }
                // Of these switches, the scene's shader has only those for textures and faults of effects.
                Some(SwitchSource::OtherModules) if name != "TEXTURES" && name != "FAULT_RECORDS" => {
                    rules.clauses.push(Partial { on: 0, off: own });
                }
                _ => {}
            }
        }
        rules
    }

    fn bit(&self, name: &str) -> u128 {
        let at = self.names.iter().position(|n| *n == name);
        1 << at.unwrap_or_else(|| panic!("no switch {name}"))
    }

    /// The condition in disjunctive normal form: alternatives (`||`), each a conjunction (`&&`).
    fn groups(&self, condition: &str) -> Vec<Partial> {
        let group = |group: &str| {
            group.split("&&").fold(Partial::default(), |all, term| match term.trim().strip_prefix('!') {
                Some(name) => Partial { off: all.off | self.bit(name.trim()), ..all },
                None => Partial { on: all.on | self.bit(term.trim()), ..all },
            })
        };
        condition.split("||").map(group).collect()
    }

    /// Adds the clauses of an implication in conjunctive normal form: one literal of each group.
    fn implies(&mut self, own: u128, groups: &[Partial]) {
        let mut clauses = vec![Partial { on: 0, off: own }];
        for group in groups {
            let literals = bits(group.on).map(|on| Partial { on, off: 0 });
            let literals: Vec<Partial> =
                literals.chain(bits(group.off).map(|off| Partial { on: 0, off })).collect();
            clauses = clauses.iter().flat_map(|c| literals.iter().map(|l| c.with(*l))).collect();
        }
        self.clauses.extend(clauses);
    }

    /// Unit propagation: the set with all implied switches; `None` if it contradicts the rules.
    fn propagated(&self, mut set: Partial) -> Option<Partial> {
        loop {
            let before = set;
            for clause in &self.clauses {
                if clause.on & set.on | clause.off & set.off != 0 {
                    continue;
                }
                let open = Partial { on: clause.on & !set.off, off: clause.off & !set.on };
                match open.on.count_ones() + open.off.count_ones() {
                    0 => return None,
                    1 => set = set.with(open),
                    _ => {}
                }
            }
            if set == before {
                return Some(set);
            }
        }
    }

    /// A complete set that satisfies the rules, with few switches on.
    fn solved(&self, set: Partial) -> Option<Partial> {
        let set = self.propagated(set)?;
        let open = !(set.on | set.off) & (u128::MAX >> (128 - self.names.len()));
        let least = Partial { off: set.off | open, ..set };
        if self.clauses.iter().all(|c| c.on & least.on | c.off & least.off != 0) {
            return Some(least);
        }
        let next = open & open.wrapping_neg();
        let without = self.solved(Partial { off: set.off | next, ..set });
        without.or_else(|| self.solved(Partial { on: set.on | next, ..set }))
    }

    fn on(&self, set: Partial) -> Vec<&'static str> {
        bits(set.on).map(|bit| self.names[bit.trailing_zeros() as usize]).collect()
    }
}

fn bits(set: u128) -> impl Iterator<Item = u128> {
    (0..128).map(|i| 1 << i).filter(move |bit| set & bit != 0)
}

/// A line of a shader, with the conditions under which it is kept.
struct Line {
    text: String,
    conditions: Vec<(Vec<Partial>, bool)>,
    /// Name of the function or struct around it.
    scope: String,
}

impl Line {
    fn switches(&self) -> u128 {
        self.conditions.iter().flat_map(|(groups, _)| groups).fold(0, |all, g| all | g.on | g.off)
    }

    /// Whether the line is kept by a set that decides all its switches.
    fn is_in(&self, set: Partial) -> bool {
        self.conditions.iter().all(|(groups, holds)| groups.iter().any(|g| set.contains(*g)) == *holds)
    }
}

fn words(text: &str) -> Vec<&str> {
    let code = text.split("//").next().unwrap_or_default();
    code.split_inclusive(|c: char| !(c.is_alphanumeric() || c == '_'))
        .flat_map(|part| {
            let end = part.trim_end_matches(|c: char| !(c.is_alphanumeric() || c == '_')).len();
            [&part[..end], &part[end..]]
        })
        .filter(|w| !w.trim().is_empty())
        .collect()
}

fn lines(files: &[SourceFile], rules: &Rules) -> Vec<Line> {
    let mut out = Vec::new();
    for file in files {
        let mut open: Vec<(Vec<Partial>, bool)> = Vec::new();
        let mut scope = String::new();
        for line in file.text.lines() {
            let code = line.trim_start();
            let mut conditions = open.clone();
            let mut text = code;
            if let Some(rest) = code.strip_prefix("@if(") {
                let (condition, after) = rest.split_once(')').unwrap();
                conditions.push((rules.groups(condition), true));
                if after.trim().is_empty() {
                    open = conditions;
                    continue;
                }
                text = after;
            } else if code.trim_end() == "@else" {
                let last = open.last_mut().unwrap();
                last.1 = !last.1;
                continue;
            } else if code.trim_end() == "@end" {
                open.pop();
                continue;
            }
            let words = words(text);
            if let Some(at) = words.iter().position(|w| ["fn", "struct"].contains(w)) {
                scope = words[at + 1].to_string();
            }
            out.push(Line { text: text.to_string(), conditions, scope: scope.clone() });
        }
    }
    out
}

/// Names that a line declares, and whether each is local to its scope.
fn declared(text: &str) -> Vec<(&str, bool)> {
    let words = words(text);
    let mut out = Vec::new();
    for (i, word) in words.iter().enumerate() {
        let before = if i > 0 { words[i - 1].trim() } else { "" };
        let after = words.get(i + 1).map_or("", |w| w.trim());
        if ["let", "var"].contains(&before) {
            out.push((*word, true));
        } else if ["fn", "struct", "const", "alias"].contains(&before) {
            out.push((*word, false));
        } else if after.starts_with(':') {
            // A parameter, or a member, which other scopes name after a dot.
            out.push((*word, true));
            out.push((*word, false));
        }
    }
    out
}

/// Switches that meet, with the line that they decide about, if it is a single one.
fn meetings(lines: &[Line]) -> BTreeMap<(u128, Option<usize>), ()> {
    let mut local: BTreeMap<(&str, &str), u128> = BTreeMap::new();
    let mut global: BTreeMap<&str, u128> = BTreeMap::new();
    let mut shape: BTreeMap<(&str, bool), u128> = BTreeMap::new();
    for line in lines {
        let switches = line.switches();
        for (name, is_local) in declared(&line.text) {
            match is_local {
                true => *local.entry((&line.scope, name)).or_default() |= switches,
                false => *global.entry(name).or_default() |= switches,
            }
        }
        let code = line.text.split("//").next().unwrap_or_default();
        if code.matches('{').count() != code.matches('}').count() {
            *shape.entry((&line.scope, true)).or_default() |= switches;
        }
        if words(&line.text).contains(&"return") {
            *shape.entry((&line.scope, false)).or_default() |= switches;
        }
    }
    let mut out: BTreeMap<(u128, Option<usize>), ()> =
        shape.into_values().map(|switches| ((switches, None), ())).collect();
    for (i, line) in lines.iter().enumerate() {
        let own = line.switches();
        out.insert((own, Some(i)), ());
        let words = words(&line.text);
        for (at, word) in words.iter().enumerate() {
            let member = at > 0 && words[at - 1].trim_end().ends_with('.');
            let of_scope = local.get(&(line.scope.as_str(), *word)).filter(|_| !member);
            if let Some(switches) = of_scope.or_else(|| global.get(word)) {
                out.insert((own | switches, Some(i)), ());
            }
        }
    }
    out
}

/// Every possible combination of switches that meet.
fn combinations(rules: &Rules, lines: &[Line]) -> HashSet<Partial> {
    let possible =
        meetings(lines).into_keys().collect::<Vec<_>>().into_par_iter().flat_map_iter(|(switches, line)| {
            let mut all = vec![Partial::default()];
            for bit in bits(switches) {
                let both =
                    |p: &Partial| [Partial { on: p.on | bit, ..*p }, Partial { off: p.off | bit, ..*p }];
                all = all.iter().flat_map(both).filter(|p| rules.propagated(*p).is_some()).collect();
            }
            all.retain(|p| line.is_none_or(|i| lines[i].is_in(*p)) && rules.solved(*p).is_some());
            all
        });
    possible.chain(pairs(rules)).collect()
}

/// Every possible pair of switches, on or off.
fn pairs(rules: &Rules) -> impl ParallelIterator<Item = Partial> {
    let all: Vec<u128> = (0..rules.names.len()).map(|i| 1 << i).collect();
    let of = move |(a, b): (u128, u128)| {
        [
            Partial { on: a | b, off: 0 },
            Partial { on: a, off: b },
            Partial { on: b, off: a },
            Partial { on: 0, off: a | b },
        ]
    };
    let pairs: Vec<(u128, u128)> =
        all.iter().flat_map(|a| all.iter().filter(move |b| a < *b).map(move |b| (*a, *b))).collect();
    pairs.into_par_iter().flat_map_iter(of).filter(|p| rules.solved(*p).is_some())
}

/// Number of sets into which merging a combination is tried.
const TRIES: usize = 40;

/// Sets of switches that together contain all these combinations.
fn cover(rules: &Rules, combinations: HashSet<Partial>) -> Vec<Partial> {
    let mut sorted: Vec<Partial> = combinations.into_iter().collect();
    sorted.sort_by_key(|p| (std::cmp::Reverse((p.on | p.off).count_ones()), *p));
    // The switches that are decided, and a whole set that satisfies the rules.
    let mut sets: Vec<(Partial, Partial)> = Vec::new();
    for wanted in sorted {
        if let Some((set, _)) = sets.iter_mut().find(|(_, whole)| whole.contains(wanted)) {
            *set = set.with(wanted);
            continue;
        }
        let merged = sets.iter().enumerate().filter(|(_, (set, _))| set.meets(wanted)).take(TRIES).find_map(
            |(i, (set, _))| {
                let both = rules.propagated(set.with(wanted))?;
                Some((i, both, rules.solved(both)?))
            },
        );
        match merged {
            Some((i, both, whole)) => sets[i] = (both, whole),
            None => {
                let wanted = rules.propagated(wanted).unwrap_or(wanted);
                sets.extend(rules.solved(wanted).map(|whole| (wanted, whole)));
            }
        }
    }
    sets.into_iter().map(|(_, whole)| whole).collect()
}

/// Effects of each hook, two of which use the same names.
fn effects(on: &[&str]) -> Vec<SceneEffect> {
    let textured = on.contains(&"TEXTURES");
    let surface = |k: &str| {
        format!(
            "const k = {k};\nfn part(x: f32) -> f32 {{ return x * k; }}\n\
             fn effect(color: vec4<f32>, surface: SurfaceSample, p: array<f32, 8>) -> vec4<f32> {{\n\
             return color * part(surface.distance) * effect_frame_row_1().x + vec4<f32>(surface.normal + surface.joints + surface.background, surface.uv.x * p[0]); }}"
        )
    };
    let vertex = "fn effect(vertex: VertexSample, p: array<f32, 8>) -> vec3<f32> {\n\
                  return vertex.normal * vertex.world.x + vertex.model + vec3(vertex.uv, paper(vertex.uv).x); }\n";
    let paper = match textured {
        true => "fn paper(uv: vec2<f32>) -> vec4<f32> { return effect_texture(0u, vec2(2u, 2u), uv); }",
        false => "fn paper(uv: vec2<f32>) -> vec4<f32> { return vec4(uv, uv); }",
    };
    let lighting = "fn effect(sample: LightSample, p: array<f32, 8>) -> vec3<f32> {\n\
                    return sample.lit + effect_frame_row_0().xyz + sample.cosine * sample.share * sample.color * sample.base * sample.light; }";
    let all = [
        ("SURFACE", Hook::Surface, surface("0.5")),
        ("DISPLACED", Hook::Vertex, format!("{vertex}{paper}")),
        ("LIGHTING", Hook::Lighting, lighting.to_string()),
        ("SURFACE", Hook::Surface, surface("2.0")),
        ("DISPLACED", Hook::Vertex, format!("{vertex}{paper}")),
    ];
    let used = (0u8..).zip(all).filter(|(_, (switch, ..))| on.contains(switch));
    used.map(|(bit, (_, hook, wgsl))| SceneEffect {
        bit,
        name: format!("e{bit}"),
        wgsl,
        hook,
        in_model_space: bit == 4,
        faults: 16 * u32::from(bit),
        parameters: ParameterRows { first: REACH_ROWS + 4 * u32::from(bit), length: 8, reads_frame: true },
    })
    .collect()
}

/// The scene's files with the effects that the switches require.
fn scene_files(scene: &[SourceFile], on: &[&str]) -> Vec<SourceFile> {
    let mut files = scene.to_vec();
    if on.contains(&"TEXTURES") {
        files.push(ShaderSources::default().file("textures.wgsl").unwrap());
    }
    if on.contains(&"EFFECTS") {
        files.extend(surface_files(&effects(on)));
    }
    files
}

fn scene() -> Vec<SourceFile> {
    ShaderSources::default().files(&SCENE).unwrap()
}

#[test]
fn every_key_that_the_planner_can_produce_compiles() {
    let rules = Rules::of_table();
    let scene = scene();
    let lines = lines(&scene, &rules);
    let of_others = OF_OTHERS.iter().fold(0, |all, name| all | rules.bit(name));
    for line in lines.iter().filter(|line| line.switches() & of_others == 0) {
        let switches: Vec<u128> = bits(line.switches()).collect();
        let some = (0..1u32 << switches.len()).any(|n| {
            let on =
                switches.iter().enumerate().filter(|(i, _)| n >> i & 1 == 1).fold(0, |all, (_, b)| all | b);
            let set = Partial { on, off: line.switches() & !on };
            line.is_in(set) && rules.solved(set).is_some()
        });
        assert!(some, "no key asks for this line of a shader: {}", line.text);
    }
    let combinations = combinations(&rules, &lines);
    let count = combinations.len();
    let sets = cover(&rules, combinations);
    let mut texts = HashSet::new();
    let distinct: Vec<Vec<&str>> = sets
        .iter()
        .map(|set| rules.on(*set))
        .filter(|on| {
            assert_eq!(broken_rule(on), None, "{on:?}");
            let text = |file: &SourceFile| preprocess(&file.text, on).unwrap();
            texts.insert(scene_files(&scene, on).iter().map(text).collect::<String>())
        })
        .collect();
    println!("{count} combinations of switches that meet, in {} keys, {} texts", sets.len(), distinct.len());
    assert!(count > 1000 && distinct.len() > 100);
    distinct.par_iter().for_each(|on| {
        let stages = entry_points(on);
        compile(&scene_files(&scene, on), on, &stages, false).unwrap_or_else(|e| panic!("{on:?}: {e}"));
    });
    // Each switch is on in at least one key and off in another.
    for name in switch_names().filter(|name| !OF_OTHERS.contains(name)) {
        assert!(distinct.iter().any(|on| on.contains(&name)), "{name} is on nowhere");
        assert!(distinct.iter().any(|on| !on.contains(&name)), "{name} is on everywhere");
    }
}

#[test]
fn the_check_finds_an_error_in_a_rare_feature_combination() {
    let rules = Rules::of_table();
    let mut scene = scene();
    let vertex = scene.iter_mut().find(|f| f.name.ends_with("vertex.wgsl")).unwrap();
    let sound = "    @if(UV0) out.uv0 = in.uv0;\n";
    let fault = "    @if(PRE_SKINNED && OUTLINE && TINT) out.uv1 = vec2(0.0);\n";
    assert!(vertex.text.contains(sound));
    vertex.text = vertex.text.replace(sound, &format!("{sound}{fault}"));
    let sets = cover(&rules, combinations(&rules, &lines(&scene, &rules)));
    let asked = ["PRE_SKINNED", "OUTLINE", "TINT"];
    let with = sets.iter().map(|set| rules.on(*set)).filter(|on| asked.iter().all(|name| on.contains(name)));
    let failed: Vec<String> =
        with.filter_map(|on| parse(&scene_files(&scene, &on), &on).err()).map(|e| e.to_string()).collect();
    assert!(failed.iter().any(|e| e.contains("uv1")), "{failed:?}");
}

#[test]
fn every_pre_skinning_variant_compiles() {
    let files = ShaderSources::default().files(&PRESKIN).unwrap();
    let skinning: Vec<&str> = names(Features::SKINNING).collect();
    let others = ["NORMAL", "TANGENT", "JOINTS_UNIFORM"];
    let all: Vec<&str> = skinning.iter().chain(&others).copied().collect();
    let mut compiled = 0;
    for subset in 0..1u32 << all.len() {
        let on: Vec<&str> =
            all.iter().enumerate().filter(|(i, _)| subset >> i & 1 == 1).map(|(_, n)| *n).collect();
        let poses = on.iter().any(|n| skinning.contains(n));
        let with = |a: &str, b: &str| !on.contains(&a) || on.contains(&b);
        let possible = with("JOINTS_UNIFORM", "SKIN") && with("TANGENT", "NORMAL");
        let of_features: Vec<&str> = on.iter().copied().filter(|n| !others.contains(n)).collect();
        if poses && possible && broken_rule(&of_features).is_none() {
            compile(&files, &on, &[("pose", naga::ShaderStage::Compute)], false)
                .unwrap_or_else(|e| panic!("{on:?}: {e}"));
            compiled += 1;
        }
    }
    assert!(compiled > 50, "{compiled}");
}

#[test]
fn modules_outside_the_scene_shader_compile() {
    let sources = ShaderSources::default();
    for surface in [&[][..], &["SURFACE", "EFFECTS"], &["SURFACE", "EFFECTS", "TEXTURES"]] {
        for (files, switch) in [(&BACKGROUND[..], None), (&SKY, Some("SKY_BACKGROUND"))] {
            for dither in [None, Some("DITHER")] {
                let on: Vec<&str> = surface.iter().copied().chain(switch).chain(dither).collect();
                let files = scene_files(&sources.files(files).unwrap(), &on);
                parse(&files, &on).unwrap_or_else(|e| panic!("{on:?}: {e}"));
            }
        }
    }
    parse(&sources.files(&LAYERS_BEHIND).unwrap(), &[]).unwrap();
    parse(&sources.files(&OVERLAY).unwrap(), &[]).unwrap();
}

#[test]
fn the_feature_table_is_consistent() {
    let names: BTreeSet<&str> = switch_names().collect();
    assert_eq!(names.len(), switch_names().count(), "a name occurs twice");
    let rules = Rules::of_table();
    for feature in FEATURES {
        let own = Partial { on: rules.bit(feature.name), off: 0 };
        assert!(rules.solved(own).is_some(), "no key can have {}", feature.name);
    }
    // Features that share a texture slot exclude each other.
    for (i, a) in FEATURES.iter().enumerate() {
        for b in FEATURES[..i].iter().filter(|b| a.texture.is_some() && a.texture == b.texture) {
            let both = Partial { on: rules.bit(a.name) | rules.bit(b.name), off: 0 };
            assert_eq!(rules.solved(both), None, "{} and {}", a.name, b.name);
        }
    }
}
