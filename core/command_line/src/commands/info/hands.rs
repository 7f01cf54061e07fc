//! Axes of hands, for `choreo info`: directions of fingers, palm and thumb in the space of the hand's joint, in which props are placed.

use choreo_asset::Asset;
use choreo_motion::HumanoidJoints;
use glam::Vec3;
use serde_json::{Value, json};

/// A hand in the rest pose. Directions are orthogonal unit vectors in the space of its joint.
struct Hand {
    joint: u32,
    /// Direction from the wrist to the knuckles.
    fingers: Vec3,
    /// Direction in which the palm faces.
    palm: Vec3,
    /// Direction towards the side of the thumb.
    thumb: Vec3,
}

/// Hands with an index finger and another finger, the left hand first.
fn find_hands(asset: &Asset) -> Vec<Hand> {
    let human = HumanoidJoints::of(&asset.skeleton);
    let rest = asset.rest_model_from_joint();
    let hand = |side: &str| {
        let joint = |name: &str| human.joint(&format!("{side} {name}"));
        let place = |joint: u32| Some(Vec3::from(rest.get(joint as usize)?.translation));
        let hand = joint("hand")?;
        let index = place(joint("handindex1")?)?;
        let outer = place(["handpinky1", "handring1", "handmiddle1"].into_iter().find_map(joint)?)?;
        let fingers = (0.5 * (index + outer) - place(hand)?).try_normalize()?;
        let thumb = (index - outer).reject_from_normalized(fingers).try_normalize()?;
        // If the thumb points up, the palm of a left hand is to the right of its fingers.
        let palm = if side == "left" { fingers.cross(thumb) } else { thumb.cross(fingers) };
        let joint_from_model = rest.get(hand as usize)?.inverse();
        let local = |direction| joint_from_model.transform_vector3(direction).try_normalize();
        Some(Hand { joint: hand, fingers: local(fingers)?, palm: local(palm)?, thumb: local(thumb)? })
    };
    ["left", "right"].into_iter().filter_map(hand).collect()
}

/// Formats hands, each as `mixamorig:LeftHand fingers +y, palm +z, thumb -x`.
pub(super) fn hands_text(asset: &Asset) -> Option<String> {
    let hand_text = |hand: &Hand| {
        let name = asset.skeleton.names().get(hand.joint as usize)?;
        let [fingers, palm, thumb] = [hand.fingers, hand.palm, hand.thumb].map(format_direction);
        Some(format!("{name} fingers {fingers}, palm {palm}, thumb {thumb}"))
    };
    let lines: Vec<String> = find_hands(asset).iter().filter_map(hand_text).collect();
    (!lines.is_empty()).then(|| lines.join("; "))
}

pub(super) fn hands_json(asset: &Asset) -> Vec<Value> {
    let hand_json = |hand: Hand| {
        json!({
            "joint": hand.joint, "fingers": hand.fingers.to_array(), "palm": hand.palm.to_array(),
            "thumb": hand.thumb.to_array(),
        })
    };
    find_hands(asset).into_iter().map(hand_json).collect()
}

/// Formats a direction: as `-y` if it is within 20° of an axis, else by its components.
fn format_direction(direction: Vec3) -> String {
    let parts = direction.to_array();
    let largest = (0..3).max_by(|a, b| parts[*a].abs().total_cmp(&parts[*b].abs())).unwrap_or(0);
    match parts[largest] {
        part if part.abs() < 0.94 => format!("({:.2}, {:.2}, {:.2})", parts[0], parts[1], parts[2]),
        part => format!("{}{}", if part < 0.0 { '-' } else { '+' }, ["x", "y", "z"][largest]),
    }
}
