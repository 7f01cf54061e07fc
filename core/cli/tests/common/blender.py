"""Imports a glTF file into Blender and prints where the bones of its armatures are: {actor: {joint: [[x, y, z], ...]}}, +Y up."""

import json
import sys

import bpy

path, times, actors = sys.argv[1], json.loads(sys.argv[2]), json.loads(sys.argv[3])
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps = 30
bpy.ops.import_scene.gltf(filepath=path, bone_heuristic="BLENDER")
out = {}
for armature in [o for o in scene.objects if o.type == "ARMATURE"]:
    above = armature
    while above is not None and above.name not in actors:
        above = above.parent
    if above is not None:
        out[above.name] = {bone.name: [] for bone in armature.pose.bones}
        armature["actor"] = above.name
for time in times:
    frame = time * scene.render.fps
    scene.frame_set(int(frame), subframe=frame - int(frame))
    for armature in [o for o in scene.objects if "actor" in o]:
        for bone in armature.pose.bones:
            x, y, z = armature.matrix_world @ bone.head
            out[armature["actor"]][bone.name].append([x, z, -y])
print("RESULT " + json.dumps(out))
