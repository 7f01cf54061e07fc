"""Imports a USD file into Blender and prints where the bones of its armatures are at some frames, and what else is there, as JSON after
RESULT: {"joints": {actor: {joint: [[x, y, z], ...]}}, "kinds": {kind of object: number}, "shapes": {object: [name, ...]},
"starts": [seconds at which each shot begins, ...]}; +Y up.
With a fourth argument, it also renders the last frame to this file through the camera of the fifth's name."""

import json
import sys

import bpy

path, frames, actors = sys.argv[1], json.loads(sys.argv[2]), json.loads(sys.argv[3])
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps = 30
bpy.ops.wm.usd_import(filepath=path)
out = {"joints": {}, "kinds": {}, "shapes": {}}
out["starts"] = sorted(o.data["start"] for o in scene.objects if o.type == "CAMERA")
for o in scene.objects:
    out["kinds"][o.type] = out["kinds"].get(o.type, 0) + 1
    if o.type == "MESH" and o.data.shape_keys:
        out["shapes"][o.name] = [key.name for key in o.data.shape_keys.key_blocks]
for armature in [o for o in scene.objects if o.type == "ARMATURE"]:
    above = armature
    while above is not None and above.name not in actors:
        above = above.parent
    if above is not None:
        out["joints"][above.name] = {bone.name: [] for bone in armature.pose.bones}
        armature["actor"] = above.name
for frame in frames:
    scene.frame_set(frame)
    graph = bpy.context.evaluated_depsgraph_get()
    for armature in [o for o in scene.objects if "actor" in o]:
        now = armature.evaluated_get(graph)
        for bone in now.pose.bones:
            x, y, z = now.matrix_world @ bone.head
            out["joints"][armature["actor"]][bone.name].append([x, z, -y])
print("RESULT " + json.dumps(out))
if len(sys.argv) > 4:
    scene.camera = next(o for o in scene.objects if o.type == "CAMERA" and sys.argv[5] in o.name)
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 16, False
    scene.view_settings.view_transform = "Standard"
    scene.render.resolution_x, scene.render.resolution_y = 480, 270
    scene.render.filepath = sys.argv[4]
    bpy.ops.render.render(write_still=True)
