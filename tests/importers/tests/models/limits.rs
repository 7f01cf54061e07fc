//! Images whose header declares far more pixels than the file holds, in every format that names image files: the warning names the
//! limit, and the model is imported without them. glTF embeds its images; the tests of import-gltf cover it.

use choreo_importer_kit_testing::{Companions, import, source, warnings};
use choreo_plugin::{ImportScope, Importer};

/// A PNG whose header declares this size, with an empty IDAT chunk.
fn png_header(width: u32, height: u32) -> Vec<u8> {
    let mut out = b"\x89PNG\r\n\x1a\n".to_vec();
    let size = [width.to_be_bytes(), height.to_be_bytes()].concat();
    for (kind, data) in [(b"IHDR", [&size[..], &[8, 6, 0, 0, 0]].concat()), (b"IDAT", Vec::new())] {
        let body = [&kind[..], &data].concat();
        // CRC-32 of the chunk (PNG specification, annex D), bit by bit.
        let crc = !body.iter().fold(!0u32, |crc, byte| {
            let step = |c: u32| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 };
            (0..8).fold(crc ^ u32::from(*byte), |c, _| step(c))
        });
        out.extend((data.len() as u32).to_be_bytes());
        out.extend(body);
        out.extend(crc.to_be_bytes());
    }
    out
}

const OBJ: &str = "mtllib a.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n";
const MTL: &str = "newmtl a\nmap_Kd bomb.png\n";

const DAE: &str = r##"<COLLADA version="1.4.1">
<library_images><image id="i"><init_from>bomb.png</init_from></image></library_images>
<library_effects><effect id="e"><profile_COMMON>
<newparam sid="f"><surface type="2D"><init_from>i</init_from></surface></newparam>
<newparam sid="s"><sampler2D><source>f</source></sampler2D></newparam>
<technique sid="t"><lambert><diffuse><texture texture="s" texcoord="UV"/></diffuse></lambert></technique>
</profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="9">0 0 0 1 0 0 0 1 0</float_array>
<technique_common><accessor source="#pa" count="3" stride="3"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1" material="m"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="w"><node id="n"><instance_geometry url="#g">
<bind_material><technique_common><instance_material symbol="m" target="#m"/></technique_common></bind_material>
</instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#w"/></scene></COLLADA>"##;

const FBX: &str = "; FBX 7.4.0 project file
FBXHeaderExtension: {
FBXVersion: 7400
}
Objects: {
Model: 1, \"Model::n\", \"Mesh\" {
}
Geometry: 2, \"Geometry::g\", \"Mesh\" {
Vertices: *9 {
a: 0,0,0,1,0,0,0,1,0
}
PolygonVertexIndex: *3 {
a: 0,1,-3
}
}
Material: 3, \"Material::m\", \"\" {
ShadingModel: \"lambert\"
}
Texture: 4, \"Texture::t\", \"\" {
FileName: \"bomb.png\"
RelativeFilename: \"bomb.png\"
}
}
Connections: {
C: \"OO\",1,0
C: \"OO\",2,1
C: \"OO\",3,1
C: \"OP\",4,3, \"DiffuseColor\"
}
";

#[test]
fn images_over_the_size_limit_are_not_decoded() {
    let importers: [(&str, &str, &dyn Importer); 3] = [
        ("a.obj", OBJ, &import_obj::ObjImporter),
        ("a.dae", DAE, &import_collada::ColladaImporter),
        ("a.fbx", FBX, &import_fbx::FbxImporter),
    ];
    let cases = [
        (20_000, 2, "\"bomb.png\" has 20000 x 2 pixels; the limit is 16384 a side"),
        (10_000, 10_000, "\"bomb.png\" has 10000 x 10000 pixels; the limits are 1 pixel and 64 megapixels"),
        (0, 4, "\"bomb.png\" has"),
    ];
    for (name, text, importer) in importers {
        for (width, height, words) in cases {
            let files = Companions::of(vec![("a.mtl", MTL.into()), ("bomb.png", png_header(width, height))]);
            let asset = import(importer, &source(name, text), &files, ImportScope::ALL);
            let asset = asset.unwrap_or_else(|e| panic!("{e}"));
            let said = warnings(&asset);
            assert!(said.iter().any(|w| w.contains(words)), "{name} {width} x {height}: {said:#?}");
            assert_eq!(asset.instances.len(), 1, "{name}");
            assert!(asset.images.iter().all(|i| i.rgba.len() <= 4), "{name}");
        }
    }
}
