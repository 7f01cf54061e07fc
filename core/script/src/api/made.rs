//! `shape`, `mesh`, `lines`, `points`, `image`: what a script makes of numbers.

use crate::call::{Call, Def, Gives, Reply};
use crate::made;
use crate::value::{AssetRef, Kind};
use choreo_stage::{Asset, Topology};
use rhai::Dynamic;
use std::sync::Arc;

pub const DEFS: &[Def] = &[
    Def::new(
        Kind::None,
        "shape",
        "kind, options?",
        Gives::A(Kind::Asset),
        "A \"plane\", \"quad\" (upright, for pictures), \"box\", \"sphere\", \"cylinder\", \"cone\", \"capsule\" or \"torus\" on the ground: size, and a look: color, image and normal_map (from image(…)), opacity_map (bright is solid), height_map (bright is high; seen to be depth, 0.05 widths of it, deep), checker (a second color), tiles (how often either is repeated), alpha (\"opaque\", \"mask\", \"blend\"), roughness, metallic, emissive, unlit, double_sided, or shininess and specular (a color) for Blinn–Phong, with phong: true Phong's own highlight, and specular_map (an Image: where it shines, in which color), and with reflection (0 to 1, or a color: how much of its surroundings it mirrors, as sharply as its shininess has it, in place of its own color) and reflection_map (an Image: where) of the sky, or of environment_map (an Image twice as wide as high, all around it: its middle is seen looking along -z); over it clearcoat and clearcoat_roughness, sheen (a color) and sheen_roughness, iridescence with film (400 nanometres), anisotropy with brushed (degrees from the u direction), and let through transmission (glass; with thickness in metres it bends light by ior, 1.5, colours apart by dispersion, and has the color attenuation after attenuation_distance, 1 m) or translucent (leaves: light from behind) with translucent_color; textures move by scroll ([right, down], pictures a second) and spin (degrees a second), or are frames ([columns, rows] of image and maps, or arrays of pictures or numbered files in place of image, normal_map, opacity_map, height_map, specular_map and reflection_map, as many of each) of which fps (12) are seen a second, again and again or once; displacement_map raises the shape itself by displacement (0.1 m where it is bright), its triangles halved detail (2) times; projection lays textures on it: \"plane\" (from above), \"box\", \"sphere\", \"cylinder\", \"cone\" or \"triplanar\" (from all sides at once, mixed by where the surface faces, the more by its sharpness, 4); name, of its joint.",
        shape,
    ),
    Def::new(
        Kind::None,
        "mesh",
        "options",
        Gives::A(Kind::Asset),
        "Triangles from arrays: positions, indices (three a triangle, counter-clockwise from outside; without, the vertices in their order), normals (without, smooth where triangles share vertices), uvs (v down), uvs2 (a second set, for textures of uv_set: 1), colors, and a look as of shape. Arrays hold vectors, [[x, y, z], …], or their numbers one after the other, or are blobs: little-endian 32-bit floats, indices as 32-bit whole numbers, colors as 4 bytes.",
        mesh,
    ),
    Def::new(
        Kind::None,
        "lines",
        "options",
        Gives::A(Kind::Asset),
        "Lines, which no light changes: positions and indices (two a line) as for mesh, strip: true (one line through all), color or colors; width in pixels at any distance (else 1), or how many metres, never less than a pixel; round: false for ends that are cut off.",
        lines,
    ),
    Def::new(
        Kind::None,
        "points",
        "options",
        Gives::A(Kind::Asset),
        "Points, which no light changes: positions as for mesh, color or colors; size in pixels at any distance (else 1), or how many metres, never less than a pixel; round: false for squares.",
        points,
    ),
    Def::new(
        Kind::Asset,
        "repeat",
        "places",
        Gives::A(Kind::Asset),
        "The asset so many times in one: places are points [x, y, z], or #{ at, turn (degrees, as Actor.turn, or [x, y, z] as Actor.rotate), scale }. Cast once, its copies are drawn together and each only where it is in view; a body is posed once for all of them, whatever its clips do. Actor.count says how many are there.",
        crate::made::repeat,
    ),
    Def::new(
        Kind::Asset,
        "materials",
        "",
        Gives::Value("array of texts"),
        "Names of the materials.",
        materials,
    ),
    Def::new(
        Kind::Asset,
        "texture",
        "material, slot, image, options?",
        Gives::A(Kind::Asset),
        "The asset with another picture on a material, by its name, or with several that follow each other (an array, or numbered files; options: fps, 12, and once); option uv_set: 1 lays it by the second set of texture coordinates; slot: \"color\", \"normal\", \"metallic_roughness\" (green and blue), \"occlusion\", \"emissive\", \"specular\" (alpha) or \"specular_color\", as glTF has them, or \"reflection\" of what has shininess.",
        crate::made::texture,
    ),
    Def::new(
        Kind::None,
        "image",
        "width, height, pixels, options? | file, options? | options",
        Gives::A(Kind::Image),
        "A picture for surfaces: a PNG, JPEG, WebP, BMP or TGA file, or with # for each digit numbered ones that follow each other (\"smoke_###.png\"; first and last say which, else all from 0 or 1 on), of which those that are seen are held in memory. Or rows from the top: pixels are a color each, or 1, 3 or 4 numbers from 0 to 255 each (grey, red green blue, with alpha), in an array or a blob; options: filter (\"linear\" or \"nearest\", squares), wrap (\"repeat\", \"clamp\", \"mirror\", or two of them: across and down), name.",
        image,
    ),
];

fn materials(c: &mut Call) -> Reply {
    let asset = c.this_asset()?;
    Ok(asset.materials.iter().map(|m| Dynamic::from(m.name.clone())).collect::<rhai::Array>().into())
}

fn made(c: &Call, asset: Arc<Asset>) -> Reply {
    let from = c.build().made(&asset, &c.place);
    Ok(Dynamic::from(AssetRef { from, dead: false }))
}

fn shape(c: &mut Call) -> Reply {
    made(c, made::shape(c)?)
}

fn mesh(c: &mut Call) -> Reply {
    made(c, made::mesh(c, Topology::Triangles)?)
}

fn lines(c: &mut Call) -> Reply {
    made(c, made::mesh(c, Topology::Lines)?)
}

fn points(c: &mut Call) -> Reply {
    made(c, made::mesh(c, Topology::Points)?)
}

fn image(c: &mut Call) -> Reply {
    Ok(Dynamic::from(made::image(c)?))
}
