"""Reads what `choreo render -o NAME.exr` wrote with the library OpenEXR, and compares it with closed forms in f64.

The scene is scene.rhai beside this file. Prints a line for each comparison; ends with an error at the first that is beyond its bound.
"""

import json
import sys
import zlib

import numpy as np
import OpenEXR

WIDTH, HEIGHT = 160, 90
EYE, TARGET, FOV = np.array([2.0, 1.5, 4.0]), np.array([0.0, 0.2, 0.0]), np.radians(35.0)
# The middle of the box (it stands on its position) at the time of the image, and where it was one frame before.
BOX, SIDE, STEP = np.array([0.25, 0.6 + 0.25, 0.1]), 0.5, np.array([0.1, 0.05, -0.1])
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
    """Pixels whose neighbors show the same face: a vertex lies on a grid of 1/256 pixels, so edges may differ."""
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
    assert np.abs(moved).max(axis=(0, 1)).min() > 2.0
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


def decoded(codes):
    share = np.array(codes) / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def albedo(name):
    found, _ = channels(name)
    depth, normal, surface = cast()
    same = inner(surface, normal)
    colors = np.array([[0, 0, 0, 0], [*decoded([0x80, 0x90, 0xA0]), 1], [*decoded([0xE0, 0x80, 0x40]), 1]])
    is_ = image(found, ["albedo.R", "albedo.G", "albedo.B", "albedo.A"])
    check(f"{name} albedo", is_[same], colors[surface][same], 5e-4)
    if "A" in found:
        check(f"{name} alpha of albedo", is_[..., 3], found["A"], 1e-3)


def murmur3(text):
    """MurmurHash3_x86_32, from the reference's description."""
    data, hash_ = text.encode(), 0
    mask = 0xFFFFFFFF
    for i in range(0, len(data), 4):
        block = int.from_bytes(data[i : i + 4], "little") * 0xCC9E2D51 & mask
        block = (block << 15 | block >> 17) & mask
        hash_ ^= block * 0x1B873593 & mask
        if i + 4 <= len(data):
            hash_ = (hash_ << 13 | hash_ >> 19) & mask
            hash_ = (hash_ * 5 + 0xE6546B64) & mask
    hash_ ^= len(data)
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35), (16, 1)):
        hash_ = (hash_ ^ hash_ >> shift) * factor & mask
    return hash_


def mattes(name, layer):
    """The share of each name at each pixel, decoded as the specification of Cryptomatte 1.2 says."""
    part = OpenEXR.File(name, separate_channels=True).parts[0]
    key = f"cryptomatte/{murmur3(layer):08x}"[:-1]
    values = {word: part.header[f"{key}/{word}"] for word in ("name", "hash", "conversion", "manifest")}
    assert (values["name"], values["hash"]) == (layer, "MurmurHash3_32"), values
    assert values["conversion"] == "uint32_to_float32"
    manifest = json.loads(values["manifest"])
    for text, hex_ in manifest.items():
        bits = murmur3(text)
        bits ^= 1 << 23 if bits >> 23 & 255 in (0, 255) else 0
        assert bits == int(hex_, 16), text
    names = {int(hex_, 16): text for text, hex_ in manifest.items()}
    found, total = {}, np.zeros((HEIGHT, WIDTH))
    for number in range(3):
        for id_, share in (("R", "G"), ("B", "A")):
            if f"{layer}{number:02}.{id_}" not in part.channels:
                continue
            ids = part.channels[f"{layer}{number:02}.{id_}"].pixels
            shares = part.channels[f"{layer}{number:02}.{share}"].pixels
            assert ids.dtype == np.float32 and shares.dtype == np.float32
            bits = ids.view(np.uint32)
            for value in np.unique(bits[shares > 0]):
                text = names[int(value)]
                found[text] = found.get(text, 0) + np.where(bits == value, shares, 0)
            total += shares
    return found, total


PLACES = {
    4: [(6, 2), (14, 6), (2, 10), (10, 14)],
    16: [(9, 9), (7, 5), (5, 10), (12, 7), (3, 6), (10, 13), (13, 11), (11, 3)]
    + [(6, 14), (8, 1), (4, 2), (2, 12), (0, 8), (15, 4), (14, 15), (1, 0)],
}


def ids(name, samples, of_layer):
    for layer, texts in of_layer.items():
        found, total = mattes(name, layer)
        assert found.keys() == set(texts), (layer, found.keys())
        # The same places in each pixel, by ray casts; a vertex lies on a grid of 1/256 pixels.
        casts = [cast((x / 16, y / 16))[2] for x, y in PLACES[samples]]
        for number, text in enumerate(texts, 1):
            should = np.mean([surface == number for surface in casts], axis=0)
            off = np.abs(found[text] - should)
            beyond = float((off > 1e-6).mean())
            print(f"{name} {layer} {text}: {beyond:.4f} of the pixels have another share, at most {off.max():.3g}")
            assert ((should > 0) & (should < 1)).sum() > 30
            assert beyond < 2e-3 and off.max() <= 2 / samples
        covered = np.mean([surface > 0 for surface in casts], axis=0)
        whole = covered == 1
        check(f"{name} {layer}, sum of the shares", total[whole], 1.0, 1e-6)
        alpha = channels(name)[0].get("A")
        if alpha is not None:
            beyond = float((np.abs(total - alpha) > 1e-3).mean())
            print(f"{name} {layer}: {beyond:.4f} of the pixels have another alpha")
            assert beyond < 2e-3


def straight(name, of_png, codes):
    """A transparent PNG holds straight alpha. A code is 0.009 of light near white; of 16 bits, light has been half floats."""
    (above, _), pixels = channels(name), png(of_png)
    alpha = pixels[..., 3:] / codes
    assert pixels.shape[2] == 4 and ((alpha > 0.1) & (alpha < 0.9)).sum() > 50
    light = decoded(pixels[..., :3] * 255.0 / codes) * alpha
    check(f"{of_png}, light times alpha", light, image(above, "RGB"), 9e-3 if codes == 255 else 1e-3)


def sixteen(name, of_png):
    found, _ = channels(name)
    check(f"{of_png}, codes of 16 bits", png(of_png), encoded(image(found, "RGB"), 65535.0), 30.0)


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
        straight(f"{device}_ids.exr", f"{device}_straight.png", 255)
        straight(f"{device}_ids.exr", f"{device}_straight16.png", 65535)
        sixteen(f"{device}_none.exr", f"{device}_none16.png")
        composite(f"{device}_alpha.exr", f"{device}_none4.exr")
        albedo(f"{device}_ids.exr")
        names = {"CryptoObject": ["floor", "box"], "CryptoMaterial": ["mesh", "shape"]}
        ids(f"{device}_ids.exr", 4, names)
        ids(f"{device}_ids16.exr", 16, names)
        header(f"{device}.exr", {"choreo:source": "scene.rhai", "framesPerSecond": "24", "Software": "choreo"})
    if len(sys.argv) > 2:
        twins("cpu.exr", "vulkan.exr", {"Z": (1e-5, 0.001), "N": (1e-3, 0.001), "motion": (1e-3, 0.001)})
        rare = {kind: (1e-3, 0.005) for kind in ("CryptoObject00", "CryptoMaterial00", "albedo")}
        rare |= {kind: (1e-3, 0.005) for kind in ("CryptoObject01", "CryptoMaterial01")}
        twins("cpu_ids.exr", "vulkan_ids.exr", rare)
        twins("cpu_none4.exr", "vulkan_none4.exr", {})
