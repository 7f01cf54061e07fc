//! Procedural assets: `shape`, `mesh`, `lines`, `points`, `image`, instancing and textures.

use crate::call::{Call, Reply, api};
use crate::procedural;
use crate::value::AssetRef;
use choreo_asset::{Asset, Topology};
use rhai::Dynamic;
use std::sync::Arc;

api! {
    /// Makes a procedural mesh with one material and one joint: "plane" (in x and z), "quad" (upright in x and y,
    /// for images), "box", "sphere", "cylinder", "cone", "capsule" or "torus". It stands on the ground, y = 0.
    /// - Mesh: size (metres: a number, or [x, y, z], for a plane [x, z], for a quad [x, y]; default 10 for a plane,
    ///   else 1), name (of the joint, default the kind).
    /// - Color: color (default gray, white with an image), image (an Image from `image(…)`), checker (second color
    ///   of a checkerboard), tiles (1 to 4096: repeats of the image and the maps, default 1, or squares of the
    ///   checkerboard along a side, default 10), alpha ("opaque", "mask", "blend"; default by the alpha of color
    ///   and image).
    /// - Metallic-roughness material: roughness (0 to 1, default 0.9), metallic (0 to 1, default 0), emissive (a
    ///   color, default black) with emissive_strength (0 to 1000000, default 1; above 1 it is brighter than white,
    ///   for bloom), unlit (true: no lighting), double_sided (true: no back-face culling).
    /// - Blinn–Phong material, in place of roughness and metallic: shininess (exponent, 1 to 10000), specular (a
    ///   color), phong (true: the Phong highlight), specular_map (an Image: strength and color of the highlight),
    ///   reflection (0 to 1, or a color: the share of the environment reflection, blurred according to shininess,
    ///   that replaces its own color), reflection_map (an Image: where it reflects), environment_map (an Image, a
    ///   panorama twice as wide as high, reflected in place of the sky; its center is seen in the direction -z).
    /// - Maps (each an Image): normal_map, opacity_map (bright is opaque), height_map (parallax mapping; bright is
    ///   high) with depth (0 to 1, in widths of the texture, default 0.05).
    /// - Layers of the metallic-roughness material, as in the glTF extensions: clearcoat (0 to 1) with
    ///   clearcoat_roughness (0 to 1, default 0); sheen (a color) with sheen_roughness (0 to 1, default 0.3);
    ///   iridescence (0 to 1) with film (thickness in nanometres, default 400); anisotropy (0 to 1) with brushed
    ///   (degrees from the u direction, default 0).
    /// - Transmission and refraction, as in the glTF extensions: transmission (0 to 1, glass); with thickness
    ///   (metres) light is refracted by ior (index of refraction, 1 to 10, default 1.5), split into colors by
    ///   dispersion (0 to 100, default 0) and tinted by attenuation (a color) over attenuation_distance (metres,
    ///   default 1); translucent (diffuse transmission, 0 to 1: leaves lit from behind) with translucent_color
    ///   (default the color).
    /// - Moving textures: scroll ([right, down], images per second), spin (degrees per second).
    /// - Texture animation: frames ([columns, rows] of the sprite sheet in image and maps). Or an array of Images,
    ///   or an Image of numbered files, for image, normal_map, opacity_map, height_map, specular_map and
    ///   reflection_map, the same number in each. fps (0 to 1000, default 12) is the frame rate; `once: true` stops
    ///   at the last frame, else the frames loop.
    /// - Displacement: displacement_map (an Image) moves the vertices along their normals, such as for a terrain,
    ///   by displacement (metres where it is white, default 0.1), after each triangle has been subdivided detail
    ///   times (0 to 8, default 2) into four.
    /// - Texture projection: projection ("plane" from above, "box", "sphere", "cylinder", "cone", or "triplanar":
    ///   from all sides, blended by the normal with sharpness, 1 to 64, default 4).
    shape("kind, options?") -> Asset = shape;
    /// Makes a triangle mesh from arrays.
    /// - Arrays: positions, indices (three per triangle, counter-clockwise seen from outside; default: the vertices
    ///   in their order), normals (default: smooth where triangles share vertices), uvs (texture coordinates, v
    ///   down), uvs2 (a second set, for textures with uv_set: 1), colors (one per vertex).
    /// - Format: arrays of vectors, [[x, y, z], …]; their numbers one after another; or blobs of little-endian 32-bit
    ///   floats, of 32-bit integers for indices and of 4 bytes per color.
    /// - Material: all options of `shape` except size.
    mesh("options") -> Asset = mesh;
    /// Makes lines. They are unlit.
    /// - Options: positions and indices (two per line) as in `mesh`; strip (true: one polyline through all
    ///   vertices), color or colors, name; width (line width in pixels at any distance, default 1) or metres (line
    ///   width in metres, at least a pixel); round (false: square ends, default true).
    lines("options") -> Asset = lines;
    /// Makes points. They are unlit.
    /// - Options: positions as in `mesh`, color or colors, name; size (in pixels at any distance, default 1) or
    ///   metres (size in metres, at least a pixel); round (false: squares, default true).
    points("options") -> Asset = points;
    /// Returns an asset with one copy of this asset at each place (instancing, for crowds and swarms). A place is a
    /// point [x, y, z] or #{ at, turn, scale }; `turn` is degrees about the vertical, or [x, y, z] as in
    /// Actor.rotate.
    /// - Cast it once: the copies are drawn together, each is culled by itself, and a character's pose is
    ///   evaluated once for all of them, whatever clips it plays. Actor.count sets how many of them exist.
    /// - Level of detail (LOD): small copies are drawn by simplified versions where the difference is not visible;
    ///   see the option levels_of_detail of `stage`.
    Asset.repeat("places") -> Asset = crate::procedural::repeat;
    /// Returns the names of the materials.
    Asset.materials("") -> "array of texts" = materials;
    /// Returns the asset with another texture on the material of that name: an Image, or a texture animation (an
    /// array of Images, or an Image of numbered files).
    /// - Slots, as in glTF: "color" (base color), "normal", "metallic_roughness" (metallic in blue, roughness in
    ///   green), "occlusion" (ambient occlusion), "emissive", "specular" (in alpha), "specular_color"; for
    ///   Blinn–Phong materials also "reflection".
    /// - Options: fps (of a texture animation, 0 to 1000, default 12), once (true: stops at the last frame), uv_set
    ///   (1: uses the second set of texture coordinates).
    Asset.texture("material, slot, image, options?") -> Asset = crate::procedural::texture;
    /// Makes an image for textures and 2D layers. File: PNG, JPEG, WebP, BMP or TGA. An image sequence has a # for
    /// each digit of the number ("smoke_###.png"); only the images that are visible are kept in memory.
    /// - Pixels: rows from the top, in an array or a blob; each pixel is a color, or 1, 3 or 4 numbers from 0 to
    ///   255 (gray; red, green, blue; with alpha). `image(options)` takes width, height and pixels as options.
    /// - Options: filter ("linear", the default, or "nearest": pixels stay squares when magnified), wrap ("repeat",
    ///   the default, "clamp", "mirror", or an array of two of them: across and down), name; for image sequences
    ///   first and last (numbers; default: from 0 or 1 to the last file without a gap).
    image("width, height, pixels, options? | file, options? | options") -> Image = image;
}

fn materials(c: &mut Call) -> Reply {
    let asset = c.this_asset()?;
    Ok(asset.materials.iter().map(|m| Dynamic::from(m.name.clone())).collect::<rhai::Array>().into())
}

fn made(c: &Call, asset: Arc<Asset>) -> Reply {
    let load = c.stage_draft().add_procedural_load(&asset, &c.place);
    Ok(Dynamic::from(AssetRef { load, dead: false }))
}

fn shape(c: &mut Call) -> Reply {
    made(c, procedural::shape(c)?)
}

fn mesh(c: &mut Call) -> Reply {
    made(c, procedural::mesh(c, Topology::Triangles)?)
}

fn lines(c: &mut Call) -> Reply {
    made(c, procedural::mesh(c, Topology::Lines)?)
}

fn points(c: &mut Call) -> Reply {
    made(c, procedural::mesh(c, Topology::Points)?)
}

fn image(c: &mut Call) -> Reply {
    Ok(Dynamic::from(procedural::image(c)?))
}
