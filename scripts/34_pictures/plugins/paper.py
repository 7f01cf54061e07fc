#!/usr/bin/env python3
"""Writes paper.png beside itself: 128 x 128 gray, fibers that repeat without a seam. Ours, made by this script alone."""

import math
import random
import struct
import zlib
from pathlib import Path

SIDE = 128
random.seed(7)
light = [[0.5] * SIDE for _ in range(SIDE)]
for _ in range(900):
    x, y, angle = random.uniform(0, SIDE), random.uniform(0, SIDE), random.uniform(0, math.tau)
    tone, bend = random.uniform(-0.22, 0.22), random.uniform(-0.08, 0.08)
    for _ in range(random.randint(6, 26)):
        light[int(y) % SIDE][int(x) % SIDE] += tone
        angle += bend
        x, y = x + math.cos(angle), y + math.sin(angle)
rows = b"".join(b"\0" + bytes(round(255 * min(max(v, 0.0), 1.0)) for v in row) for row in light)


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


header = struct.pack(">IIBBBBB", SIDE, SIDE, 8, 0, 0, 0, 0)
png = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")
Path(__file__).with_name("paper.png").write_bytes(png)
