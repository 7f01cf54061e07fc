"""Reads a USD file with usd-core and prints, as JSON after RESULT, what it holds at some times (time codes):

problems: those of the validators; kinds: how many prims there are of each kind;
prims: {name of an actor: {"world": [matrix, ...], "visible": [bool, ...], "joints": {name: [[x, y, z], ...]},
"points": [[[x, y, z], ...] for each mesh, of the last time], "weights": {token: [number, ...]}}};
cameras: {name: {"world": [matrix, ...], "yfov": [radians, ...], "shot": {...}}}; lights: {name: {kind, intensity, world}}.
Matrices are rows one after the other, which multiply row vectors.
"""

import json
import math
import sys

from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdSkel, UsdValidation, Vt

MOST_POINTS = 60


def rows(matrix):
    return [matrix[i][j] for i in range(4) for j in range(4)]


def validated(stage):
    registry = UsdValidation.ValidationRegistry()
    context = UsdValidation.ValidationContext(registry.GetOrLoadAllValidators())
    return [f"{e.GetName()}: {e.GetMessage()}" for e in context.Validate(stage)]


def skinned_points(cache, root, code):
    """World positions of some vertices of each mesh of a character."""
    out = []
    xforms = UsdGeom.XformCache(code)
    for prim in Usd.PrimRange(root):
        if prim.GetTypeName() != "Mesh":
            continue
        skinning = cache.GetSkinningQuery(prim)
        points = UsdGeom.Mesh(prim).GetPointsAttr().Get()
        if not skinning or not skinning.HasJointInfluences():
            world = xforms.GetLocalToWorldTransform(prim)
            out.append([list(world.Transform(Gf.Vec3d(p))) for p in some(points)])
            continue
        skeleton = cache.GetSkelQuery(UsdSkel.BindingAPI(prim).GetInheritedSkeleton())
        animation = skeleton.GetAnimQuery()
        if skinning.HasBlendShapes() and animation and animation.GetBlendShapeOrder():
            weights = animation.ComputeBlendShapeWeights(code)
            mapper = skinning.GetBlendShapeMapper()
            weights = mapper.Remap(weights, Vt.FloatArray(len(skinning.GetBlendShapeOrder())))
            shapes = UsdSkel.BlendShapeQuery(UsdSkel.BindingAPI(prim))
            sub_weights, shape_indices, sub_indices = shapes.ComputeSubShapeWeights(weights)
            offsets = shapes.ComputeSubShapePointOffsets()
            indices = shapes.ComputeBlendShapePointIndices()
            points = Vt.Vec3fArray(points)
            shapes.ComputeDeformedPoints(sub_weights, shape_indices, sub_indices, indices, offsets, points)
        transforms = skeleton.ComputeSkinningTransforms(code)
        points = Vt.Vec3fArray(points)
        if not skinning.ComputeSkinnedPoints(transforms, points, code):
            raise SystemExit(f"{prim.GetPath()}: no skinned points")
        world = xforms.GetLocalToWorldTransform(skeleton.GetPrim())
        out.append([list(world.Transform(Gf.Vec3d(p))) for p in some(points)])
    return out


def some(points):
    step = max(1, len(points) // MOST_POINTS)
    return list(points)[::step]


def character(prim, codes):
    cache = UsdSkel.Cache()
    out = {"world": [], "visible": [], "joints": {}, "weights": {}}
    for code in codes:
        xforms = UsdGeom.XformCache(code)
        out["world"].append(rows(xforms.GetLocalToWorldTransform(prim)))
        out["visible"].append(UsdGeom.Imageable(prim).ComputeVisibility(code) != "invisible")
    roots = [p for p in Usd.PrimRange(prim) if p.IsA(UsdSkel.Root)]
    for root in roots:
        cache.Populate(UsdSkel.Root(root), Usd.PrimDefaultPredicate)
    skeletons = [p for p in Usd.PrimRange(prim) if p.IsA(UsdSkel.Skeleton)]
    for skeleton in skeletons[:1]:
        query = cache.GetSkelQuery(UsdSkel.Skeleton(skeleton))
        names = UsdSkel.Skeleton(skeleton).GetJointNamesAttr().Get() or query.GetJointOrder()
        out["joints"] = {name: [] for name in names}
        animation = query.GetAnimQuery()
        tokens = animation.GetBlendShapeOrder() if animation else None
        out["weights"] = {token: [] for token in tokens or []}
        for code in codes:
            world = UsdGeom.XformCache(code).GetLocalToWorldTransform(skeleton)
            for name, joint in zip(names, query.ComputeJointSkelTransforms(code)):
                out["joints"][name].append(list((joint * world).ExtractTranslation()))
            if tokens:
                for token, weight in zip(tokens, animation.ComputeBlendShapeWeights(code)):
                    out["weights"][token].append(weight)
    out["points"] = skinned_points(cache, prim, codes[-1])
    return out


def main():
    path, codes = sys.argv[1], json.loads(sys.argv[2])
    stage = Usd.Stage.Open(path)
    out = {"problems": validated(stage), "kinds": {}, "prims": {}, "cameras": {}, "lights": {}}
    out["up"], out["metres"] = UsdGeom.GetStageUpAxis(stage), UsdGeom.GetStageMetersPerUnit(stage)
    out["rate"], out["end"] = stage.GetTimeCodesPerSecond(), stage.GetEndTimeCode()
    for prim in stage.Traverse():
        kind = str(prim.GetTypeName())
        out["kinds"][kind] = out["kinds"].get(kind, 0) + 1
    for prim in stage.GetDefaultPrim().GetChildren():
        name = prim.GetDisplayName() or prim.GetName()
        if prim.IsA(UsdGeom.Camera):
            camera = {"world": [], "yfov": [], "shot": prim.GetCustomDataByKey("shot")}
            for code in codes:
                lens = UsdGeom.Camera(prim).GetCamera(code)
                camera["world"].append(rows(lens.transform))
                camera["yfov"].append(math.radians(lens.GetFieldOfView(Gf.Camera.FOVVertical)))
            out["cameras"][name] = camera
        elif prim.HasAPI(UsdLux.LightAPI):
            world = [rows(UsdGeom.XformCache(code).GetLocalToWorldTransform(prim)) for code in codes]
            intensity = [UsdLux.LightAPI(prim).GetIntensityAttr().Get(code) for code in codes]
            out["lights"][name] = {"kind": str(prim.GetTypeName()), "intensity": intensity, "world": world}
        else:
            out["prims"][name] = character(prim, codes)
    print("RESULT " + json.dumps(out))


main()
