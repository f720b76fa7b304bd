#!/usr/bin/env python3
"""Writes the EnSight Gold cases of tests/data/ensight: the same series as text and in C binary.

    python3 tests/interop/write_ensight.py [FOLDER]

Files are written number by number, to know what is in them: tests/it/import/ensight.rs does too. VTK's reader reads both
(vtkGenericEnSightReader, highest byte first).
"""

import struct
import sys
from pathlib import Path

CASE = """FORMAT
type: ensight gold
GEOMETRY
model: {kind}.mesh.geo
VARIABLE
scalar per node: 1 T {kind}.T.*
scalar per element: p {kind}.p
TIME
time set: 1
number of steps: 2
filename start number: 0
filename increment: 1
time values: 0.25 1.5
"""


def encoded(kind, items):
    """Lines are str, integers int, floats float, rows of integers tuples."""
    out = b""
    for item in items:
        if isinstance(item, tuple) and kind == "text":
            out += ("".join(f"{number:10}" for number in item) + "\n").encode()
        elif isinstance(item, tuple):
            out += encoded(kind, item)
        elif kind == "text":
            out += f"{item:12.5e}\n".encode() if isinstance(item, float) else f"{item}\n".encode()
        elif isinstance(item, str):
            out += item.encode().ljust(80)
        else:
            out += struct.pack(">f" if isinstance(item, float) else ">i", item)
    return out


def geometry():
    points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1), (0.5, 0.5, 2)]
    items = ["by hand", "a cube and its roof", "node id off", "element id assign", "part", 3, "all", "coordinates", len(points)]
    items += [float(point[axis]) for axis in range(3) for point in points]
    items += ["quad4", 1, (1, 2, 3, 4), "hexa8", 1, (1, 2, 3, 4, 5, 6, 7, 8), "pyramid5", 1, (5, 6, 7, 8, 9)]
    return items


def main():
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parents[1] / "data/ensight")
    folder.mkdir(parents=True, exist_ok=True)
    for kind in ["text", "binary"]:
        (folder / f"{kind}.case").write_text(CASE.format(kind=kind))
        mesh = encoded(kind, (["C Binary"] if kind == "binary" else []) + geometry())
        (folder / f"{kind}.mesh.geo").write_bytes(mesh)
        for step in range(2):
            values = [float(10 * step + i) for i in range(9)]
            (folder / f"{kind}.T.{step}").write_bytes(encoded(kind, ["T", "part", 3, "coordinates", *values]))
        items = ["p", "part", 3, "quad4", 1.0, "hexa8", 2.0, "pyramid5", 3.0]
        (folder / f"{kind}.p").write_bytes(encoded(kind, items))


main()
