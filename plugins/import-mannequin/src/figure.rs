//! The parts of the body. Each has a signed distance field, a ray grid that meshes it, a material and a skinning rule.
//!
//! The figure is ball-jointed: shells over darker balls that are concentric with the joints, so that a bent joint shows the ball
//! instead of folding the shell. Left-hand parts are mirrored. T-pose, metres.

use crate::cast::{Grid, Lens};
use crate::field::{
    below, ellipsoid, rounded_box, smooth_difference, smooth_intersection, smooth_union, sphere, taper,
};
use crate::rig::{self, FINGERS, Side};
use glam::{Vec3, vec2, vec3};

pub(crate) const SHELL: u32 = 0;
pub(crate) const JOINTS: u32 = 1;
pub(crate) const VISOR: u32 = 2;
pub(crate) const EYES: u32 = 3;

/// How joint weights vary over a part.
#[derive(Clone, Copy)]
pub(crate) enum Skinning {
    Rigid(fn(Side) -> usize),
    /// (joint, coordinate along the axis at which it takes over from the joint before), and half the width of each transition,
    /// metres.
    Chain {
        axis: Vec3,
        joints: fn(Side) -> Vec<(usize, f32)>,
        blend: f32,
    },
    /// The chest: its upper edges partly follow the collarbones.
    Chest,
}

pub(crate) struct BodyPart {
    pub material: u32,
    /// Modeled on the left, mirrored to the right.
    pub paired: bool,
    pub field: fn(Vec3) -> f32,
    pub grid: Grid,
    pub skinning: Skinning,
}

const SHOULDER: Vec3 = vec3(0.178, 1.42, -0.012);
const ELBOW: Vec3 = vec3(0.460, 1.42, -0.012);
const WRIST: Vec3 = vec3(0.712, 1.42, -0.012);
const HIP: Vec3 = vec3(rig::HIP_WIDTH, rig::ANKLE_HEIGHT + 2.0 * rig::LEG_SEGMENT, 0.0);
const KNEE: Vec3 = vec3(rig::HIP_WIDTH, rig::ANKLE_HEIGHT + rig::LEG_SEGMENT, 0.0);
const ANKLE: Vec3 = vec3(rig::HIP_WIDTH, rig::ANKLE_HEIGHT, 0.0);

/// Mirrors a point to the left side, for the symmetric parts of the trunk.
fn folded(p: Vec3) -> Vec3 {
    vec3(p.x.abs(), p.y, p.z)
}

fn skull(p: Vec3) -> f32 {
    let p = folded(p);
    let crown = ellipsoid(p, vec3(0.0, 1.660, -0.006), vec3(0.078, 0.090, 0.097));
    let jaw = ellipsoid(p, vec3(0.0, 1.600, 0.028), vec3(0.050, 0.064, 0.060));
    let cheek = ellipsoid(p, vec3(0.030, 1.628, 0.038), vec3(0.038, 0.045, 0.045));
    smooth_union(smooth_union(crown, jaw, 0.05), cheek, 0.04)
}

fn ear(p: Vec3) -> f32 {
    ellipsoid(p, vec3(0.072, 1.643, -0.006), vec3(0.014, 0.027, 0.027))
}

fn neck(p: Vec3) -> f32 {
    taper(p, vec3(0.0, 1.43, -0.020), 0.047, vec3(0.0, 1.58, -0.008), 0.043)
}

fn chest(p: Vec3) -> f32 {
    let q = folded(p);
    let ribs = ellipsoid(q, vec3(0.0, 1.290, -0.010), vec3(0.136, 0.170, 0.098));
    let breast = ellipsoid(q, vec3(0.063, 1.322, 0.048), vec3(0.074, 0.056, 0.042));
    let yoke = taper(q, vec3(0.0, 1.418, -0.022), 0.062, vec3(0.142, 1.406, -0.014), 0.046);
    let collar = taper(q, vec3(0.0, 1.400, -0.022), 0.068, vec3(0.0, 1.474, -0.020), 0.038);
    let blade = ellipsoid(q, vec3(0.072, 1.350, -0.068), vec3(0.062, 0.085, 0.034));
    let solid = smooth_union(smooth_union(smooth_union(ribs, yoke, 0.06), breast, 0.035), blade, 0.04);
    let solid = smooth_union(solid, collar, 0.045);
    // An arch under the ribs, open at the front.
    let arch = ellipsoid(q, vec3(0.0, 1.070, 0.035), vec3(0.115, 0.125, 0.16));
    let solid = smooth_difference(solid, arch, 0.030);
    smooth_difference(solid, below(q, vec3(0.0, 1.140, 0.0), Vec3::Y), 0.035)
}

fn belly(p: Vec3) -> f32 {
    let q = folded(p);
    let waist =
        taper(vec3(q.x * 0.72, q.y, q.z + 0.006), vec3(0.0, 0.985, 0.0), 0.078, vec3(0.0, 1.23, 0.0), 0.074);
    let waist = waist + 0.004 * bump((q.y - 1.105) / 0.11);
    // Ripples, as of bellows.
    waist + 0.0013 * libm::cosf((q.y - 1.1) * (core::f32::consts::TAU / 0.034))
}

/// A smooth bump: 1 at 0, falling to 0 at ±1.
fn bump(x: f32) -> f32 {
    let w = (1.0 - x * x).max(0.0);
    w * w
}

fn pelvis(p: Vec3) -> f32 {
    let q = folded(p);
    let bowl = ellipsoid(q, vec3(0.0, 0.992, -0.004), vec3(0.130, 0.098, 0.092));
    let flank = ellipsoid(q, vec3(0.098, 0.950, -0.008), vec3(0.066, 0.074, 0.084));
    let seat = ellipsoid(q, vec3(0.068, 0.918, -0.048), vec3(0.072, 0.074, 0.064));
    let fork = ellipsoid(q, vec3(0.0, 0.905, 0.002), vec3(0.062, 0.078, 0.078));
    let solid = smooth_union(smooth_union(smooth_union(bowl, flank, 0.05), seat, 0.05), fork, 0.05);
    // Leg openings, cut high at the sides.
    let leg = taper(q, HIP + vec3(0.022, -0.030, 0.012), 0.074, HIP + vec3(0.080, -0.22, 0.03), 0.10);
    let solid = smooth_difference(solid, leg, 0.030);
    smooth_difference(solid, -below(q, vec3(0.0, 1.040, 0.0), Vec3::Y), 0.022)
}

fn thigh(p: Vec3) -> f32 {
    let core = taper(p, HIP + vec3(0.004, -0.01, 0.0), 0.076, KNEE + vec3(0.0, 0.0, 0.002), 0.050);
    let quad = ellipsoid(p, vec3(0.102, 0.750, 0.020), vec3(0.066, 0.165, 0.064));
    let ham = ellipsoid(p, vec3(0.098, 0.740, -0.022), vec3(0.060, 0.155, 0.057));
    let solid = smooth_union(smooth_union(core, quad, 0.03), ham, 0.03);
    // Slanted: higher on the outside, like the crease of the groin.
    let solid =
        smooth_intersection(solid, below(p, HIP + vec3(0.0, 0.004, 0.0), vec3(-0.46, 0.89, 0.0)), 0.016);
    let end = KNEE + vec3(0.0, 0.018, 0.0);
    smooth_intersection(solid, -below(p, end, Vec3::Y), 0.016)
}

fn shin(p: Vec3) -> f32 {
    let core = taper(p, KNEE, 0.050, ANKLE + vec3(0.0, 0.0, -0.004), 0.030);
    let calf = ellipsoid(p, vec3(0.099, 0.375, -0.026), vec3(0.049, 0.112, 0.046));
    let front = ellipsoid(p, vec3(0.094, 0.400, 0.014), vec3(0.036, 0.125, 0.034));
    let solid = smooth_union(smooth_union(core, calf, 0.035), front, 0.03);
    let solid =
        smooth_intersection(solid, below(p, KNEE + vec3(0.0, -0.018, 0.0), vec3(0.0, 0.97, -0.24)), 0.016);
    smooth_intersection(solid, -below(p, ANKLE + vec3(0.0, 0.016, 0.0), Vec3::Y), 0.012)
}

fn foot(p: Vec3) -> f32 {
    let x = rig::HIP_WIDTH;
    let heel = ellipsoid(p, vec3(x, 0.034, -0.022), vec3(0.033, 0.046, 0.040));
    let instep = taper(p, vec3(x, 0.062, 0.010), 0.034, vec3(x + 0.003, 0.022, 0.120), 0.022);
    let ball = ellipsoid(p, vec3(x + 0.004, 0.020, 0.115), vec3(0.046, 0.030, 0.062));
    let toes = ellipsoid(p, vec3(x - 0.001, 0.014, 0.165), vec3(0.038, 0.022, 0.050));
    let solid = smooth_union(smooth_union(smooth_union(heel, instep, 0.05), ball, 0.04), toes, 0.03);
    smooth_difference(solid, below(p, Vec3::ZERO, Vec3::Y), 0.012)
}

fn upper_arm(p: Vec3) -> f32 {
    let core = taper(p, SHOULDER + vec3(0.02, 0.0, 0.0), 0.050, ELBOW, 0.036);
    let deltoid = ellipsoid(p, vec3(0.216, 1.427, -0.012), vec3(0.070, 0.053, 0.056));
    let biceps = ellipsoid(p, vec3(0.335, 1.418, 0.000), vec3(0.085, 0.039, 0.040));
    let solid = smooth_union(smooth_union(core, deltoid, 0.03), biceps, 0.03);
    // Slanted: with the arm down, the shoulder cap covers the ball at the side.
    let solid =
        smooth_intersection(solid, -below(p, SHOULDER + vec3(0.002, 0.0, 0.0), vec3(0.80, 0.60, 0.0)), 0.014);
    smooth_intersection(solid, below(p, ELBOW - vec3(0.014, 0.0, 0.0), Vec3::X), 0.012)
}

fn fore_arm(p: Vec3) -> f32 {
    let core = taper(p, ELBOW, 0.037, WRIST, 0.0240);
    let muscle = ellipsoid(p, vec3(0.535, 1.421, -0.010), vec3(0.080, 0.039, 0.040));
    let solid = smooth_union(core, muscle, 0.03);
    let solid = smooth_intersection(solid, -below(p, ELBOW + vec3(0.014, 0.0, 0.0), Vec3::X), 0.012);
    smooth_intersection(solid, below(p, WRIST - vec3(0.010, 0.0, 0.0), Vec3::X), 0.008)
}

fn palm(p: Vec3) -> f32 {
    let slab = rounded_box(p, vec3(0.776, 1.420, -0.010), vec3(0.043, 0.0150, 0.041), 0.0145);
    let wrist = taper(p, WRIST + vec3(0.018, 0.0, 0.0), 0.019, vec3(0.770, 1.421, -0.008), 0.015);
    let thenar = ellipsoid(p, vec3(0.762, 1.413, 0.016), vec3(0.030, 0.015, 0.018));
    smooth_union(smooth_union(slab, wrist, 0.03), thenar, 0.015)
}

/// Radii at the root and the tip of each finger, in the order of [`FINGERS`].
const FINGER_RADII: [(f32, f32); 5] =
    [(0.0135, 0.0090), (0.0105, 0.0078), (0.0108, 0.0080), (0.0103, 0.0076), (0.0092, 0.0068)];

fn finger<const F: usize>() -> BodyPart {
    let (_, knuckle, direction, lengths) = FINGERS[F];
    let direction = direction.normalize();
    let field = |p: Vec3| {
        let (_, knuckle, direction, lengths) = FINGERS[F];
        let (root, tip) = FINGER_RADII[F];
        let length = lengths.iter().sum::<f32>();
        taper(p, knuckle, root, knuckle + direction.normalize() * (length - tip), tip)
    };
    let joints = |side: Side| {
        let (_, knuckle, direction, lengths) = FINGERS[F];
        let start = knuckle.dot(direction.normalize());
        vec![
            (side.finger(F, 0), f32::MIN),
            (side.finger(F, 1), start + lengths[0]),
            (side.finger(F, 2), start + lengths[0] + lengths[1]),
        ]
    };
    let tip = knuckle + direction * (lengths.iter().sum::<f32>() - 0.009);
    let skinning = Skinning::Chain { axis: direction, joints, blend: 0.008 };
    paired(SHELL, field, grid(knuckle, tip, [1, 5], 6, 0.03), skinning)
}

fn grid(from: Vec3, to: Vec3, rings: [usize; 2], sectors: usize, reach: f32) -> Grid {
    Grid { from, to, cap_rings: rings[0], side_rings: rings[1], sectors, reach }
}

fn single(material: u32, field: fn(Vec3) -> f32, grid: Grid, skinning: Skinning) -> BodyPart {
    BodyPart { material, paired: false, field, grid, skinning }
}

fn paired(material: u32, field: fn(Vec3) -> f32, grid: Grid, skinning: Skinning) -> BodyPart {
    BodyPart { material, paired: true, field, grid, skinning }
}

fn ball(field: fn(Vec3) -> f32, at: Vec3, reach: f32, joint: fn(Side) -> usize) -> BodyPart {
    paired(JOINTS, field, grid(at, at, [3, 1], 14, reach), Skinning::Rigid(joint))
}

/// A thin shape on the front of the head.
pub(crate) struct Inlay {
    pub material: u32,
    pub paired: bool,
    pub field: fn(Vec3) -> f32,
    pub lens: Lens,
}

/// The visor and the eyes in it, rigid with the head.
pub(crate) fn inlays() -> [Inlay; 2] {
    let lens = |center, half, power, rise, sectors| Lens { center, half, power, rise, sectors };
    [
        Inlay {
            material: VISOR,
            paired: false,
            field: skull,
            lens: lens(vec3(0.0, 1.640, 0.2), vec2(0.063, 0.040), 2.9, 0.0022, 36),
        },
        Inlay {
            material: EYES,
            paired: true,
            field: skull,
            lens: lens(vec3(0.0265, 1.643, 0.2), vec2(0.0100, 0.0155), 2.2, 0.0034, 18),
        },
    ]
}

/// The parts of the left half and the middle.
pub(crate) fn parts() -> Vec<BodyPart> {
    let fingers = [finger::<0>(), finger::<1>(), finger::<2>(), finger::<3>(), finger::<4>()];
    trunk().into_iter().chain(leg()).chain(arm()).chain(fingers).collect()
}

fn trunk() -> [BodyPart; 6] {
    let head = Skinning::Rigid(|_| rig::HEAD);
    let neck_chain = Skinning::Chain {
        axis: Vec3::Y,
        joints: |_| vec![(rig::SPINE2, f32::MIN), (rig::NECK, 1.462), (rig::HEAD, 1.545)],
        blend: 0.035,
    };
    let belly_chain = Skinning::Chain {
        axis: Vec3::Y,
        joints: |_| {
            vec![(rig::HIPS, f32::MIN), (rig::SPINE, 1.045), (rig::SPINE1, 1.115), (rig::SPINE2, 1.185)]
        },
        blend: 0.045,
    };
    [
        single(SHELL, skull, grid(vec3(0.0, 1.625, 0.004), vec3(0.0, 1.66, 0.0), [7, 4], 28, 0.2), head),
        paired(
            JOINTS,
            ear,
            grid(vec3(0.072, 1.643, -0.006), vec3(0.073, 1.643, -0.006), [3, 1], 14, 0.05),
            head,
        ),
        single(
            JOINTS,
            neck,
            grid(vec3(0.0, 1.43, -0.018), vec3(0.0, 1.58, -0.006), [1, 7], 16, 0.1),
            neck_chain,
        ),
        single(
            SHELL,
            chest,
            grid(vec3(0.0, 1.25, -0.012), vec3(0.0, 1.385, -0.018), [8, 6], 36, 0.3),
            Skinning::Chest,
        ),
        single(
            JOINTS,
            belly,
            grid(vec3(0.0, 1.0, -0.006), vec3(0.0, 1.22, -0.006), [1, 25], 22, 0.2),
            belly_chain,
        ),
        single(
            SHELL,
            pelvis,
            grid(vec3(-0.03, 0.962, -0.006), vec3(0.03, 0.962, -0.006), [9, 4], 36, 0.3),
            Skinning::Rigid(|_| rig::HIPS),
        ),
    ]
}

fn leg() -> [BodyPart; 6] {
    let limb = |field, grid, joint| paired(SHELL, field, grid, Skinning::Rigid(joint));
    let foot_chain = Skinning::Chain {
        axis: Vec3::Z,
        joints: |side| vec![(side.foot(), f32::MIN), (side.toe_base(), rig::BALL_AHEAD)],
        blend: 0.02,
    };
    [
        ball(|p| sphere(p, HIP, 0.0620), HIP, 0.12, Side::up_leg),
        limb(thigh, grid(vec3(0.100, 0.80, 0.0), vec3(0.097, 0.565, 0.002), [5, 6], 20, 0.16), Side::up_leg),
        ball(|p| sphere(p, KNEE, 0.0475), KNEE, 0.1, Side::leg),
        limb(shin, grid(vec3(0.096, 0.43, -0.004), vec3(0.095, 0.14, -0.004), [4, 7], 16, 0.12), Side::leg),
        ball(|p| sphere(p, ANKLE, 0.0315), ANKLE, 0.08, Side::foot),
        paired(
            SHELL,
            foot,
            grid(vec3(0.096, 0.026, -0.012), vec3(0.097, 0.018, 0.150), [4, 7], 16, 0.12),
            foot_chain,
        ),
    ]
}

fn arm() -> [BodyPart; 6] {
    let limb = |field, grid, joint| paired(SHELL, field, grid, Skinning::Rigid(joint));
    [
        ball(|p| sphere(p, SHOULDER, 0.0500), SHOULDER, 0.1, Side::arm),
        limb(
            upper_arm,
            grid(vec3(0.262, 1.42, -0.012), vec3(0.415, 1.42, -0.012), [5, 5], 16, 0.12),
            Side::arm,
        ),
        ball(|p| sphere(p, ELBOW, 0.036), ELBOW, 0.07, Side::fore_arm),
        limb(
            fore_arm,
            grid(vec3(0.520, 1.42, -0.012), vec3(0.675, 1.42, -0.012), [4, 5], 16, 0.1),
            Side::fore_arm,
        ),
        ball(|p| sphere(p, WRIST, 0.0235), WRIST, 0.05, Side::hand),
        limb(palm, grid(vec3(0.758, 1.42, -0.009), vec3(0.795, 1.42, -0.010), [4, 3], 14, 0.08), Side::hand),
    ]
}
