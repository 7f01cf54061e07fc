"""Makes the camera move and the lamp of lesson 49 in Blender: python3 scripts/models/camera_move.py camera_move.glb camera_move.json, with the package bpy.

The JSON says where Blender has them in every eighth frame, for the test of the importer. Further names ending in .fbx and .usdc write those as well.
"""

import json
import math
import sys

import bpy

glb, truth = sys.argv[1:3]
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps = 24
scene.frame_start, scene.frame_end = 0, 96
scene.render.resolution_x, scene.render.resolution_y = 1280, 720


def keyed(target, path, keys, index=-1):
    for frame, value in keys:
        setattr(target, path, value)
        target.keyframe_insert(path, frame=frame)


# The camera rides on an empty that turns about the scene; its own place and lens are keyed as well.
arm = bpy.data.objects.new("arm", None)
scene.collection.objects.link(arm)
keyed(arm, "rotation_euler", [(0, (0, 0, math.radians(-30))), (48, (0, 0, math.radians(35))), (96, (0, 0, math.radians(60)))])
lens = bpy.data.cameras.new("lens")
lens.sensor_fit = "HORIZONTAL"
keyed(lens, "lens", [(0, 35.0), (60, 85.0), (96, 50.0)])
camera = bpy.data.objects.new("camera", lens)
camera.parent = arm
scene.collection.objects.link(camera)
keyed(camera, "location", [(0, (0, -6.0, 1.0)), (50, (0, -4.2, 1.9)), (96, (0.4, -4.6, 1.4))])
keyed(camera, "rotation_euler", [(0, (math.radians(90), 0, 0)), (50, (math.radians(80), 0.05, 0)), (96, (math.radians(86), 0, 0.06))])
scene.camera = camera
lamp = bpy.data.lights.new("lamp", "POINT")
keyed(lamp, "energy", [(0, 6.0), (40, 22.0), (96, 12.0)])
keyed(lamp, "color", [(0, (1.0, 0.5, 0.2)), (96, (0.3, 0.6, 1.0))])
bulb = bpy.data.objects.new("bulb", lamp)
scene.collection.objects.link(bulb)
keyed(bulb, "location", [(0, (-1.6, -1.0, 2.4)), (96, (1.6, -1.0, 1.6))])

bpy.ops.export_scene.gltf(
    filepath=glb,
    export_format="GLB",
    export_cameras=True,
    export_lights=True,
    export_animation_mode="SCENE",
    export_anim_scene_split_object=False,
    export_import_convert_lighting_mode="RAW",
    export_force_sampling=True,
    export_frame_step=1,
    export_convert_animation_pointer=True,
    export_pointer_animation=True,
)
for path in sys.argv[3:]:
    if path.endswith(".fbx"):
        # One take with everything that moves, not one for each action and object.
        bpy.ops.export_scene.fbx(filepath=path, bake_anim_use_all_actions=False, bake_anim_use_nla_strips=False, bake_anim_simplify_factor=0.0)
    else:
        bpy.ops.wm.usd_export(filepath=path, export_animation=True)


def place(o):
    """World matrix as glTF has it, columns: +Y up; cameras look along -Z in both."""
    turn = [[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]]
    m = o.matrix_world
    rows = [[sum(turn[r][k] * m[k][c] for k in range(4)) for c in range(4)] for r in range(4)]
    return [rows[r][c] for c in range(4) for r in range(4)]


out = []
for frame in range(0, 97, 8):
    scene.frame_set(frame)
    out.append({
        "secs": frame / 24.0,
        "camera": place(camera),
        "yfov": 2.0 * math.atan(math.tan(0.5 * lens.angle) * 720 / 1280),
        "bulb": place(bulb)[12:15],
        "energy": lamp.energy,
        "color": list(lamp.color),
    })
json.dump(out, open(truth, "w"))
