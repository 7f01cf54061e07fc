"""Writes scene.usda, scene.usdc and scene.usdz into a folder with usd-core: centimetres, +Z up, a character with two joints and a blend
shape, a mesh of two materials with indexed texture coordinates, a variant, a reference, a payload."""

import struct
import sys
import zlib
from pathlib import Path

from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, UsdSkel, UsdUtils, Vt

folder = Path(sys.argv[1])


def png(path):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows = b"".join(b"\0" + bytes([255, 0, 0, 0, 255, 0]) for _ in range(2))
    head = struct.pack(">IIBBBBB", 2, 2, 8, 2, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def tube(stage, path):
    """A square tube along z, 20 units high, of three rings."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    points = [(x, y, z) for z in (0, 10, 20) for x, y in ((-2, -2), (2, -2), (2, 2), (-2, 2))]
    faces = [(4 * r + i, 4 * r + (i + 1) % 4, 4 * r + 4 + (i + 1) % 4, 4 * r + 4 + i) for r in (0, 1) for i in range(4)]
    mesh.CreatePointsAttr(points)
    mesh.CreateFaceVertexCountsAttr([4] * len(faces))
    mesh.CreateFaceVertexIndicesAttr([i for f in faces for i in f])
    mesh.CreateSubdivisionSchemeAttr("none")
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("UVMap", Sdf.ValueTypeNames.TexCoord2fArray, "faceVarying")
    st.Set([(0, 0), (1, 0), (1, 1), (0, 1)])
    st.SetIndices(Vt.IntArray([0, 1, 2, 3] * len(faces)))
    return mesh


def material(stage, path, texture):
    out = UsdShade.Material.Define(stage, path)
    surface = UsdShade.Shader.Define(stage, path + "/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    out.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    color = surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
    if texture:
        reader = UsdShade.Shader.Define(stage, path + "/reader")
        reader.CreateIdAttr("UsdPrimvarReader_float2")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("UVMap")
        image = UsdShade.Shader.Define(stage, path + "/image")
        image.CreateIdAttr("UsdUVTexture")
        image.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(texture)
        image.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(reader.ConnectableAPI(), "result")
        color.ConnectToSource(image.ConnectableAPI(), "rgb")
    else:
        color.Set((0.2, 0.4, 0.8))
    return out


def character(stage):
    root = UsdSkel.Root.Define(stage, "/robot")
    stage.SetDefaultPrim(root.GetPrim())
    skeleton = UsdSkel.Skeleton.Define(stage, "/robot/rig")
    skeleton.CreateJointsAttr(["hip", "hip/head"])
    up = Gf.Matrix4d().SetTranslate((0, 0, 10))
    skeleton.CreateBindTransformsAttr([Gf.Matrix4d(1), up])
    skeleton.CreateRestTransformsAttr([Gf.Matrix4d(1), up])
    animation = UsdSkel.Animation.Define(stage, "/robot/moves")
    animation.CreateJointsAttr(["hip/head", "hip"])
    animation.CreateBlendShapesAttr(["wide"])
    for code, turn, shift, wide in ((1, 0, 0, 0), (13, 50, 4, 1), (25, -30, 8, 0.25)):
        rotation = Gf.Quatf(Gf.Rotation((1, 0, 0), turn).GetQuat())
        animation.CreateRotationsAttr().Set([rotation, Gf.Quatf(1)], code)
        animation.CreateTranslationsAttr().Set([(0, 0, 10), (shift, 0, 0)], code)
        animation.CreateScalesAttr().Set([(1, 1, 1), (1, 1, 1)], code)
        animation.CreateBlendShapeWeightsAttr().Set([wide], code)
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets(["/robot/moves"])
    mesh = tube(stage, "/robot/body")
    mesh.AddTranslateOp().Set((0, 0, 0))
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets(["/robot/rig"])
    binding.CreateGeomBindTransformAttr(Gf.Matrix4d().SetScale((1, 1, 1.1)))
    binding.CreateJointIndicesPrimvar(False, 2).Set([0, 1] * 12)
    binding.CreateJointWeightsPrimvar(False, 2).Set([1, 0] * 4 + [0.5, 0.5] * 4 + [0, 1] * 4)
    shape = UsdSkel.BlendShape.Define(stage, "/robot/body/wide")
    shape.CreateOffsetsAttr([(-1, 0, 0), (1, 0, 0)])
    shape.CreatePointIndicesAttr([8, 9])
    binding.CreateBlendShapesAttr(["wide"])
    binding.CreateBlendShapeTargetsRel().SetTargets(["/robot/body/wide"])
    red = material(stage, "/robot/looks_image", "./red.png")
    blue = material(stage, "/robot/looks_plain", None)
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(red)
    for name, faces, look in (("low", [0, 1, 2, 3], red), ("high", [4, 5, 6, 7], blue)):
        subset = UsdShade.MaterialBindingAPI(mesh).CreateMaterialBindSubset(name, faces)
        UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(look)


def scene(stage):
    UsdGeom.SetStageUpAxis(stage, "Z")
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(25)
    stage.SetTimeCodesPerSecond(24)
    world = UsdGeom.Xform.Define(stage, "/world")
    stage.SetDefaultPrim(world.GetPrim())
    robot = stage.DefinePrim("/world/robot")
    robot.GetReferences().AddReference("./robot.usdc")
    placed = UsdGeom.Xformable(robot)
    placed.AddTranslateOp().Set((30, 0, 5))
    turned = placed.AddRotateXYZOp()
    turned.Set((0, 0, 0), 1)
    turned.Set((20, 30, 40), 25)
    placed.AddScaleOp().Set((1, 2, 1))
    post = UsdGeom.Xform.Define(stage, "/world/post")
    post.AddTranslateOp(opSuffix="pivot").Set((0, 10, 0))
    post.AddRotateZOp().Set(45)
    post.AddTranslateOp(opSuffix="pivot", isInverseOp=True)
    sets = post.GetPrim().GetVariantSets().AddVariantSet("kind")
    for kind in ("thin", "thick"):
        sets.AddVariant(kind)
        sets.SetVariantSelection(kind)
        with sets.GetVariantEditContext():
            mesh = tube(stage, "/world/post/pole")
            if kind == "thick":
                mesh.AddScaleOp().Set((3, 3, 1))
    far = stage.DefinePrim("/world/far")
    far.GetPayloads().AddPayload(Sdf.Payload("./robot.usdc"))
    UsdGeom.Xformable(far).AddTranslateOp(opSuffix="away").Set((0, 80, 0))
    lens = UsdGeom.Camera.Define(stage, "/world/lens")
    lens.CreateVerticalApertureAttr(24)
    lens.CreateHorizontalApertureAttr(36)
    place = lens.AddTranslateOp()
    turn = lens.AddRotateXYZOp()
    for code, focal, x in ((1, 35, 0), (13, 90, 40), (25, 20, -60)):
        lens.CreateFocalLengthAttr().Set(focal, code)
        place.Set((x, -300, 100), code)
        turn.Set((90, 0, x / 10), code)
    panel = UsdLux.RectLight.Define(stage, "/world/panel")
    panel.CreateWidthAttr(200)
    panel.CreateHeightAttr(50)
    panel.CreateIntensityAttr().Set(10, 1)
    panel.CreateIntensityAttr().Set(30, 25)
    panel.CreateColorAttr().Set((1, 1, 1), 1)
    panel.CreateColorAttr().Set((1, 0.5, 0), 25)
    disk = UsdLux.DiskLight.Define(stage, "/world/disk")
    disk.CreateRadiusAttr(100)
    disk.CreateNormalizeAttr(True)
    disk.CreateIntensityAttr(7)
    spot = UsdLux.SphereLight.Define(stage, "/world/spot")
    spot.CreateNormalizeAttr(True)
    spot.CreateIntensityAttr(8)
    spot.CreateExposureAttr(1)
    shape = UsdLux.ShapingAPI.Apply(spot.GetPrim())
    shape.CreateShapingConeAngleAttr().Set(20, 1)
    shape.CreateShapingConeAngleAttr().Set(44, 25)
    dome = UsdLux.DomeLight.Define(stage, "/world/dome")
    dome.CreateColorAttr((0.5, 0.25, 1))
    dome.CreateIntensityAttr(0.4)


png(folder / "red.png")
part = Usd.Stage.CreateNew(str(folder / "robot.usdc"))
character(part)
part.GetRootLayer().Save()
for name in ("scene.usda", "scene.usdc"):
    whole = Usd.Stage.CreateNew(str(folder / name))
    scene(whole)
    whole.GetRootLayer().Save()
UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(folder / "scene.usdc")), str(folder / "scene.usdz"))
