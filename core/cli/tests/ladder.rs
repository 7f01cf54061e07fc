//! Costs of a sequence of scenes ("rungs"), each with one feature more than the one before: commands, pipelines, bytes, compiled shaders.
//! A rung that pays for a feature of a later one fails. `cargo test -p choreo --test ladder -- --nocapture`
//! prints the table.

use choreo_image_diff::compare;
use choreo_motion::Time;
use choreo_plugin::{Frame, Registry};
use choreo_render::commands::{RecordOptions, Recording, record};
use choreo_render::explain::{self, CostKind, frame_costs};
use choreo_render::{
    CpuRenderer, GpuOptions, Plan, PlanOptions, RenderError, Renderer, SceneResources, VulkanRenderer,
};
use choreo_script::{ScriptOptions, run_text};
use choreo_stage::Stage;
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

const SIZE: [u32; 2] = [320, 180];

/// A scene with one feature more than the rung below.
struct Rung {
    name: &'static str,
    /// Continues the scripts of the rungs below.
    script: &'static str,
    samples: u32,
    /// Shader features that this rung adds, as `explain` names them.
    features: &'static [&'static str],
    /// Shader features of the rungs below that this rung no longer has.
    removed_features: &'static [&'static str],
    /// Kinds of per-frame data that this rung adds, without their counts.
    data: &'static [&'static str],
    cost: Cost,
}

/// Expected costs: counts must be equal, bytes may be fewer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Cost {
    commands: usize,
    passes: usize,
    draws: usize,
    pipelines: usize,
    frame_bytes: u64,
    resource_bytes: u64,
    target_bytes: u64,
}

impl Cost {
    fn of(recording: &Recording, parts: &[explain::Cost]) -> Cost {
        let counts = recording.counts();
        let bytes = |kinds: &[CostKind]| {
            parts.iter().filter(|p| kinds.contains(&p.kind)).filter_map(|p| p.bytes).sum::<u64>()
        };
        Cost {
            commands: recording.commands.len(),
            passes: counts.passes + counts.post_passes,
            draws: counts.draws,
            pipelines: parts.iter().filter(|p| p.kind == CostKind::Pipeline).count(),
            frame_bytes: bytes(&[CostKind::FrameData]),
            resource_bytes: bytes(&[CostKind::Mesh, CostKind::Material, CostKind::Texture]),
            target_bytes: bytes(&[CostKind::Target]),
        }
    }

    fn is_within(&self, bound: &Cost) -> bool {
        let counts = |c: &Cost| [c.commands, c.passes, c.draws, c.pipelines];
        let bytes = |c: &Cost| [c.frame_bytes, c.resource_bytes, c.target_bytes];
        counts(self) == counts(bound) && bytes(self).iter().zip(bytes(bound)).all(|(is, most)| *is <= most)
    }
}

const LADDER: &[Rung] = &[
    Rung {
        name: "a triangle",
        script: r#"
            stage(#{ size: [320, 180], background: "black" });
            camera("c").at(0, 1.2, 6).look_at([0, 0.8, 0]);
            let triangle = mesh(#{ positions: [[-1, 0, 0], [1, 0, 0], [0, 1.5, 0]], unlit: true });
            cast("triangle", triangle).at(0, 0, -1);"#,
        samples: 1,
        features: &[],
        removed_features: &[],
        data: &["camera and ambient light", "copies"],
        cost: Cost {
            commands: 9,
            passes: 1,
            draws: 1,
            pipelines: 1,
            frame_bytes: 336,
            resource_bytes: 570,
            target_bytes: 691200,
        },
    },
    Rung {
        name: "an unlit prop with an image",
        script: r#"cast("prop", shape("box", #{ size: 0.8, checker: "white", color: "teal", unlit: true })).at(-1.6, 0, 0);"#,
        samples: 1,
        features: &["BASE_COLOR_TEXTURE", "UV0", "UV_TRANSFORM"],
        removed_features: &[],
        data: &[],
        cost: Cost {
            commands: 13,
            passes: 1,
            draws: 2,
            pipelines: 2,
            frame_bytes: 416,
            resource_bytes: 1670,
            target_bytes: 691200,
        },
    },
    Rung {
        name: "a lit prop",
        script: r#"
            sun(#{ direction: [-1, -2, -1] });
            cast("lit", shape("sphere", #{ size: 0.8, color: "tomato" })).at(1.6, 0, 0);"#,
        samples: 1,
        features: &[
            "LIT",
            "METALLIC_ROUGHNESS",
            "NORMAL",
            "NORMAL_OUT",
            "ONE_LIGHT",
            "POSITION_OUT",
            "VIEW_TRANSFORM",
        ],
        removed_features: &[],
        data: &["lights"],
        cost: Cost {
            commands: 17,
            passes: 1,
            draws: 3,
            pipelines: 3,
            frame_bytes: 560,
            resource_bytes: 39906,
            target_bytes: 691200,
        },
    },
    Rung {
        name: "a skinned actor",
        script: r#"
            let figure = load("choreo:mannequin");
            cast("actor", figure).at(0, 0, 1).play(figure.clip("Dance_Groove"));"#,
        samples: 1,
        features: &["EMISSIVE", "JOINTS_UNIFORM", "SKIN"],
        removed_features: &[],
        data: &["joint matrices"],
        cost: Cost {
            commands: 31,
            passes: 1,
            draws: 7,
            pipelines: 5,
            frame_bytes: 3520,
            resource_bytes: 425634,
            target_bytes: 691200,
        },
    },
    Rung {
        name: "25 actors",
        script: r#"for i in 1..25 {
            cast(`actor ${i}`, figure).at(0.7 * (i % 5) - 1.4, 0, -0.7 * (i / 5)).play(figure.clip("Dance_Groove"));
        }"#,
        samples: 1,
        features: &[],
        removed_features: &["JOINTS_UNIFORM"],
        data: &[],
        cost: Cost {
            commands: 39,
            passes: 1,
            draws: 11,
            pipelines: 5,
            frame_bytes: 74560,
            resource_bytes: 505218,
            target_bytes: 691200,
        },
    },
    Rung {
        name: "25 actors and shadows",
        script: r#"
            cast("floor", shape("plane", #{ size: 8 }));
            sun(#{ direction: [1, -2, -1], intensity: 1.0, shadow: #{ size: 512 } });"#,
        samples: 1,
        features: &["SHADOW", "SHADOW_PASS"],
        removed_features: &["ONE_LIGHT"],
        data: &["views of shadow maps"],
        cost: Cost {
            commands: 70,
            passes: 2,
            draws: 23,
            pipelines: 7,
            frame_bytes: 83296,
            resource_bytes: 919770,
            target_bytes: 1739776,
        },
    },
    Rung {
        name: "… and 4 samples, effect",
        script: r#"effect("vignette");"#,
        samples: 4,
        features: &[],
        removed_features: &[],
        data: &["parameters of vignette"],
        cost: Cost {
            commands: 71,
            passes: 3,
            draws: 23,
            pipelines: 7,
            frame_bytes: 83696,
            resource_bytes: 919770,
            target_bytes: 4734976,
        },
    },
];

/// The scripts of all rungs up to this one, one after the other.
fn stage_of_rung(index: usize, registry: &Registry) -> Stage {
    let text: String = LADDER[..=index].iter().map(|r| format!("{}\n", r.script)).collect();
    let name = LADDER[index].name;
    let script = run_text(name, &text, Path::new("."), registry, &ScriptOptions::default());
    script.unwrap_or_else(|e| panic!("{name}: {e:?}")).stage
}

/// A frame of a rung, ready to be drawn.
struct Scene {
    stage: Stage,
    resources: Arc<SceneResources>,
}

impl Scene {
    fn new(index: usize, registry: &Registry) -> Scene {
        let stage = stage_of_rung(index, registry);
        let resources = Arc::new(SceneResources::new(&stage));
        Scene { stage, resources }
    }

    fn plan(&self, options: &PlanOptions) -> Plan {
        let snapshot = self.stage.at(Time::from_secs(0.5)).unwrap();
        Plan::new(&self.resources, &self.stage, &snapshot, options)
    }

    fn parts(&self, plan: &Plan) -> (Recording, Vec<explain::Cost>) {
        let triangles = |p: u32| self.resources.primitives[p as usize].primitive().indices.len() / 3;
        let recording = record(plan, RecordOptions::default(), triangles);
        let parts = frame_costs(&self.resources, plan, &recording);
        (recording, parts)
    }

    fn draw(&self, renderer: &mut dyn Renderer, options: &PlanOptions) -> Frame {
        renderer.load(self.resources.clone()).unwrap();
        renderer.submit(self.plan(options)).unwrap();
        renderer.collect(None).unwrap()
    }
}

fn options_of_rung<'a>(index: usize, registry: &'a Registry) -> PlanOptions<'a> {
    PlanOptions { effects: registry.effects(), ..PlanOptions::new(SIZE, LADDER[index].samples) }
}

/// Names of the cost entries of a kind, without their counts and in the plural.
fn part_names(parts: &[explain::Cost], kind: CostKind) -> BTreeSet<String> {
    let name = |p: &explain::Cost| {
        let name = p.what.trim_start_matches(|c: char| c.is_ascii_digit() || c == ' ');
        match name {
            "copy" => "copies".to_owned(),
            "light" => "lights".to_owned(),
            name => name.to_owned(),
        }
    };
    parts.iter().filter(|p| p.kind == kind).map(name).collect()
}

/// Features of a rung that neither it nor one below it requested, and features that it lacks.
fn faults(index: usize, recording: &Recording, parts: &[explain::Cost]) -> Vec<String> {
    let mut faults = Vec::new();
    let rungs = &LADDER[..=index];
    let asked = |of: fn(&Rung) -> &'static [&'static str]| -> BTreeSet<String> {
        let removed_features: BTreeSet<&str> =
            rungs.iter().flat_map(|r| r.removed_features).copied().collect();
        let names = rungs.iter().flat_map(&of).filter(|name| !removed_features.contains(*name));
        names.map(|name| name.to_string()).collect()
    };
    for (kind, wanted) in
        [(CostKind::Feature, asked(|r| r.features)), (CostKind::FrameData, asked(|r| r.data))]
    {
        let found = part_names(parts, kind);
        faults.extend(found.difference(&wanted).map(|n| format!("pays for {} {n}", kind.name())));
        faults.extend(wanted.difference(&found).map(|n| format!("lacks {} {n}", kind.name())));
    }
    let (cost, bound) = (Cost::of(recording, parts), LADDER[index].cost);
    if !cost.is_within(&bound) {
        faults.push(format!("costs {cost:?} in place of {bound:?}"));
    }
    faults
}

#[test]
fn no_rung_pays_for_a_higher_one() {
    let registry = choreo::registry();
    println!(
        "{:<34} commands passes draws pipelines  frame B  resources B   targets B",
        "320×180, one frame"
    );
    let mut found = Vec::new();
    for (index, rung) in LADDER.iter().enumerate() {
        let scene = Scene::new(index, &registry);
        let (recording, parts) = scene.parts(&scene.plan(&options_of_rung(index, &registry)));
        let c = Cost::of(&recording, &parts);
        println!(
            "{:<34} {:>8} {:>6} {:>5} {:>9} {:>8} {:>12} {:>11}",
            rung.name,
            c.commands,
            c.passes,
            c.draws,
            c.pipelines,
            c.frame_bytes,
            c.resource_bytes,
            c.target_bytes
        );
        found.extend(
            faults(index, &recording, &parts).into_iter().map(|fault| format!("{}: {fault}", rung.name)),
        );
    }
    assert_eq!(found, Vec::<String>::new());
}

/// The comparison can fail: forcing all features in is found on every rung, and so are four samples per pixel instead of one.
#[test]
fn a_rung_with_too_many_features_or_samples_is_found() {
    let registry = choreo::registry();
    for (index, rung) in LADDER.iter().enumerate() {
        let (scene, usual) = (Scene::new(index, &registry), options_of_rung(index, &registry));
        let found = |options: PlanOptions| {
            let (recording, parts) = scene.parts(&scene.plan(&options));
            faults(index, &recording, &parts)
        };
        let forced = found(PlanOptions { force_all: true, ..usual.clone() });
        assert!(forced.iter().any(|f| f.contains("pays for")), "{}: {forced:?}", rung.name);
        if usual.samples == 1 {
            let samples = found(PlanOptions { samples: 4, ..usual });
            assert!(samples.iter().any(|f| f.contains("target_bytes")), "{}: {samples:?}", rung.name);
        }
    }
}

/// Features that the plan leaves out would not have changed a pixel.
#[test]
fn forcing_all_features_in_changes_no_pixel() {
    let registry = choreo::registry();
    let mut renderers: Vec<(&str, Box<dyn Renderer>)> =
        vec![("CPU", Box::new(CpuRenderer::new(registry.effects())))];
    let effects = registry.effects().to_vec();
    match VulkanRenderer::new(GpuOptions { validation: true, effects, ..GpuOptions::default() }) {
        Ok(vulkan) => renderers.push(("Vulkan", Box::new(vulkan))),
        Err(RenderError::NoVulkan { why }) => println!("SKIP {}: {why}", LADDER.len()),
        Err(e) => panic!("{e}"),
    }
    for (index, rung) in LADDER.iter().enumerate() {
        let (scene, usual) = (Scene::new(index, &registry), options_of_rung(index, &registry));
        for (device, renderer) in &mut renderers {
            let needed = scene.draw(&mut **renderer, &usual);
            let all = scene.draw(&mut **renderer, &PlanOptions { force_all: true, ..usual.clone() });
            let apart = compare(&needed, &all, 0).unwrap();
            assert!(
                needed.rgba.chunks_exact(4).any(|p| p != &needed.rgba[..4]),
                "{}: nothing drawn",
                rung.name
            );
            assert!(apart.worst <= 1, "{} on {device}: {apart}", rung.name);
            // The comparison can fail: a different tint is found.
            let mut other = scene.plan(&PlanOptions { force_all: true, ..usual.clone() });
            let instances = other.instances.iter_mut();
            instances.for_each(|i| i.tint *= glam::Vec4::new(0.9, 1.0, 1.0, 1.0));
            renderer.submit(other).unwrap();
            let apart = compare(&needed, &renderer.collect(None).unwrap(), 0).unwrap();
            assert!(apart.worst > 1, "{} on {device}: the fault is not seen", rung.name);
        }
    }
}

/// A renderer compiles what a rung needs, once: a second frame compiles nothing, nor does a lower rung after the others.
#[test]
fn shaders_are_compiled_once() {
    let registry = choreo::registry();
    let effects = registry.effects().to_vec();
    let mut vulkan =
        match VulkanRenderer::new(GpuOptions { validation: true, effects, ..GpuOptions::default() }) {
            Ok(vulkan) => vulkan,
            Err(RenderError::NoVulkan { why }) => return println!("SKIP {}: {why}", LADDER.len()),
            Err(e) => panic!("{e}"),
        };
    let mut before = 0;
    for (index, rung) in LADDER.iter().enumerate() {
        let (scene, usual) = (Scene::new(index, &registry), options_of_rung(index, &registry));
        let new = BTreeSet::from_iter(part_names(&scene.parts(&scene.plan(&usual)).1, CostKind::Pipeline));
        scene.draw(&mut vulkan, &usual);
        let pipelines = vulkan.pipeline_count();
        println!("{:<34} {} compiled", rung.name, pipelines - before);
        assert!(
            pipelines - before <= new.len(),
            "{}: {} compiled for {new:?}",
            rung.name,
            pipelines - before
        );
        scene.draw(&mut vulkan, &usual);
        assert_eq!(vulkan.pipeline_count(), pipelines, "{}: a second frame compiled again", rung.name);
        before = pipelines;
    }
    let (lowest, usual) = (Scene::new(0, &registry), options_of_rung(0, &registry));
    lowest.draw(&mut vulkan, &usual);
    assert_eq!(vulkan.pipeline_count(), before, "the lowest rung compiled again");
}
