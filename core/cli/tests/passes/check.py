"""Reads what `choreo render -o NAME.exr` wrote with the library OpenEXR, and compares it with closed forms in f64.

The scene is scene.rhai beside this file. Prints a line for each comparison; ends with an error at the first that is beyond its bound.
"""

import sys
import zlib

import numpy as np
import OpenEXR

WIDTH, HEIGHT = 160, 90
EYE, TARGET, FOV = np.array([2.0, 1.5, 4.0]), np.array([0.0, 0.2, 0.0]), np.radians(35.0)
# The middle of the box (it stands on its position) at the time of the image, and where it was one frame before.
BOX, SIDE, STEP = np.array([0.25, 0.6 + 0.25, 0.1]), 0.5, np.array([0.1, 0.0, -0.05])
FLOOR, FLOOR_SIDE = 0.0, 3.0
FAR = 1e10


def channels(name):
    part = OpenEXR.File(name, separate_channels=True).parts[0]
    return {k: c.pixels.astype(np.float64) for k, c in part.channels.items()}, part


def image(found, names):
    return np.stack([found[name] for name in names], axis=-1)


def png(name):
    """RGB or RGBA of 8 or 16 bits, by the specification: chunks, deflate, five filters."""
    data = open(name, "rb").read()
    at, packed, head = 8, b"", None
    while at < len(data):
        length, kind = int.from_bytes(data[at : at + 4], "big"), data[at + 4 : at + 8]
        if kind == b"IHDR":
            head = data[at + 8 : at + 8 + length]
        if kind == b"IDAT":
            packed += data[at + 8 : at + 8 + length]
        at += 12 + length
    width, height = (int.from_bytes(head[i : i + 4], "big") for i in (0, 4))
    size = head[8] // 8
    bpp = {2: 3, 6: 4}[head[9]] * size
    raw, rows, before = zlib.decompress(packed), [], np.zeros(width * bpp, int)
    for y in range(height):
        start = y * (width * bpp + 1)
        kind, row = raw[start], np.frombuffer(raw[start + 1 : start + 1 + width * bpp], np.uint8).astype(int)
        out = np.zeros(width * bpp, int)
        for x in range(0, width * bpp, bpp):
            left = out[x - bpp : x] if x else np.zeros(bpp, int)
            up, corner = before[x : x + bpp], before[x - bpp : x] if x else np.zeros(bpp, int)
            if kind == 4:
                guess = left + up - corner
                a, b, c = abs(guess - left), abs(guess - up), abs(guess - corner)
                add = np.where((a <= b) & (a <= c), left, np.where(b <= c, up, corner))
            else:
                add = [0, left, up, (left + up) // 2][kind]
            out[x : x + bpp] = (row[x : x + bpp] + add) & 255
        rows.append(out)
        before = out
    pixels = np.array(rows)
    if size == 2:
        pixels = pixels[:, 0::2] * 256 + pixels[:, 1::2]
    return pixels.reshape(height, width, bpp // size)


def encoded(light, codes=255.0):
    light = np.clip(light, 0.0, 1.0)
    return np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055) * codes


def neutral(light):
    """Khronos PBR Neutral Tone Mapper 1.0."""
    low = np.minimum(light.min(axis=-1, keepdims=True), 0.08)
    color = light - (low - 6.25 * low * low)
    peak = color.max(axis=-1, keepdims=True)
    high = np.maximum(peak, 0.76)
    shown = 1 - 0.0576 / (high - 0.52)
    pale = 1 - 1 / (0.15 * (high - shown) + 1)
    compressed = color * (shown / high) * (1 - pale) + shown * pale
    return np.where(peak < 0.76, color, compressed)


def camera():
    forward = (TARGET - EYE) / np.linalg.norm(TARGET - EYE)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    return forward, right, np.cross(right, forward)


def rays(shift=(0.5, 0.5)):
    """Directions that are one metre long along the view."""
    forward, right, up = camera()
    t = np.tan(FOV / 2)
    x = ((np.arange(WIDTH) + shift[0]) / WIDTH * 2 - 1) * t * WIDTH / HEIGHT
    y = (1 - (np.arange(HEIGHT) + shift[1]) / HEIGHT * 2) * t
    return forward + x[None, :, None] * right + y[:, None, None] * up


def pixels_of(points):
    forward, right, up = camera()
    away = points - EYE
    depth, t = away @ forward, np.tan(FOV / 2)
    x = (away @ right) / depth / (t * WIDTH / HEIGHT)
    y = (away @ up) / depth / t
    return np.stack([(x + 1) / 2 * WIDTH, (1 - y) / 2 * HEIGHT], axis=-1)


def cast(shift=(0.5, 0.5)):
    """Depth, normal and surface (0 nothing, 1 floor, 2 box) of every pixel."""
    way = rays(shift)
    depth = np.full(way.shape[:2], FAR)
    normal, surface = np.zeros(way.shape), np.zeros(way.shape[:2], int)

    def meet(distance, points, inside, facing, number):
        here = inside & (distance > 0) & (distance < depth)
        depth[here], normal[here], surface[here] = distance[here], facing, number

    distance = (FLOOR - EYE[1]) / way[..., 1]
    points = EYE + distance[..., None] * way
    inside = (abs(points[..., 0]) < FLOOR_SIDE / 2) & (abs(points[..., 2]) < FLOOR_SIDE / 2)
    meet(distance, points, inside, np.array([0.0, 1.0, 0.0]), 1)
    for axis in range(3):
        for sign in (-1.0, 1.0):
            facing = np.zeros(3)
            facing[axis] = sign
            distance = (BOX[axis] + sign * SIDE / 2 - EYE[axis]) / way[..., axis]
            points = EYE + distance[..., None] * way
            others = [i for i in range(3) if i != axis]
            inside = np.all(abs(points - BOX)[..., others] < SIDE / 2, axis=-1)
            meet(distance, points, inside, facing, 2)
    return depth, normal, surface


def inner(surface, normal):
    """Pixels whose neighbours show the same face: a vertex lies on a grid of 1/256 pixels, so edges may differ."""
    key = surface * 100 + normal @ np.array([1.0, 3.0, 9.0])
    same = np.zeros(key.shape, bool)
    same[1:-1, 1:-1] = True
    for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        same &= np.roll(key, (dy, dx), (0, 1)) == key
    return same


def check(what, is_, should, bound):
    worst = float(np.max(np.abs(is_ - should)))
    print(f"{what}: at most {worst:.3g} of {bound:g}")
    assert worst <= bound, f"{what}: {worst} is more than {bound}"


def geometry(name):
    found, _ = channels(name)
    depth, normal, surface = cast()
    same = inner(surface, normal)
    assert same.sum() > 0.8 * same.size and (surface == 2).sum() > 300
    check(f"{name} depth, metres", found["Z"][same & (surface > 0)], depth[same & (surface > 0)], 2e-5)
    check(f"{name} depth of nothing", found["Z"][same & (surface == 0)], FAR, 1.0)
    # Normals of a mesh are stored in 16 bits.
    check(f"{name} normals", image(found, ["N.X", "N.Y", "N.Z"])[same], normal[same], 1e-4)
    points = EYE + depth[..., None] * rays()
    before = points - np.where((surface == 2)[..., None], STEP, 0.0)
    moved = pixels_of(points) - pixels_of(before)
    moved[..., 1] *= -1
    moved[surface == 0] = 0.0
    assert np.abs(moved).max() > 2.0
    check(f"{name} motion, pixels", image(found, ["motion.X", "motion.Y"])[same], moved[same], 1e-3)


def twins(one, other, bounds):
    (a, _), (b, _) = channels(one), channels(other)
    assert a.keys() == b.keys(), (a.keys(), b.keys())
    for name in sorted(a):
        kind = name.split(".")[0] if "." in name else name
        bound, share = bounds.get(kind, (2e-3, 0.0))
        off = np.abs(a[name] - b[name])
        beyond = float((off > bound).mean())
        print(f"{name}: {beyond:.4f} of the pixels differ by more than {bound:g}")
        assert beyond <= share, f"{name} of {one} and {other}"


def shown(name, of_png, view, only_surfaces):
    """The image of an EXR after the view transform, in codes of 8 bits, and the one that is rendered."""
    found, _ = channels(name)
    light = image(found, "RGB")
    pixels = png(of_png)[..., :3]
    codes = encoded(view(light))
    there = cast()[2] > 0 if only_surfaces else np.ones(codes.shape[:2], bool)
    if only_surfaces:
        there &= inner(*cast()[2::-1][:2])
    assert codes[there].std() > 10
    # Rounding to a code, and of halves.
    check(f"{name} as {of_png}, codes", codes[there], pixels[there], 0.75)


def composite(name, over):
    """A transparent image over a color is the image with that background."""
    (above, part), (whole, _) = channels(name), channels(over)
    alpha = above["A"][..., None]
    assert ((alpha > 0.1) & (alpha < 0.9)).sum() > 50 and (alpha == 0).sum() > 1000
    background = image(whole, "RGB")[0, 0]
    is_ = image(above, "RGB") + (1 - alpha) * background
    check(f"{name} over the background of {over}", is_, image(whole, "RGB"), 1e-3)


def header(name, keys):
    _, part = channels(name)
    for key, text in keys.items():
        assert text in str(part.header[key]), (key, part.header[key])
    print(f"{name}: {len(part.channels)} channels")


IDENTITY = lambda light: light

if __name__ == "__main__":
    for device in sys.argv[1:]:
        geometry(f"{device}.exr")
        shown(f"{device}_none.exr", f"{device}_none.png", IDENTITY, False)
        shown(f"{device}_neutral.exr", f"{device}_neutral.png", neutral, True)
        composite(f"{device}_alpha.exr", f"{device}_none4.exr")
        header(f"{device}.exr", {"choreo:source": "scene.rhai", "framesPerSecond": "24", "Software": "choreo"})
    if len(sys.argv) > 2:
        twins("cpu.exr", "vulkan.exr", {"Z": (1e-5, 0.001), "N": (1e-3, 0.001), "motion": (1e-3, 0.001)})
        twins("cpu_none4.exr", "vulkan_none4.exr", {})
