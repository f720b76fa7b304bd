"""Writes the oracle files of the .vtu reader with VTK, and what a reader must find in them.

    pip install vtk && python tests/interop/write_vtu.py tests/data/vtu

Every file is written by vtkXMLUnstructuredGridWriter, one for each combination of encoding, compressor, header type and
byte order, and some for number types, several blocks, several pieces, empty arrays and odd names. `expected.json` holds
the values as bit patterns, because JSON readers may round numbers: f64 as u64 for points and times, f32 as u32 for
fields.
"""

import json
import sys
from pathlib import Path

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk

TET = 10


def named(values, name):
    """A VTK array of that name; one row of `values` a tuple."""
    array = numpy_to_vtk(np.ascontiguousarray(values), deep=1)
    array.SetName(name)
    return array


class Grid:
    """Points, cells (type, vertices) and fields, as numpy arrays."""

    def __init__(self, points, cells, point_data, cell_data, time=None):
        self.points, self.cells, self.time = np.asarray(points), cells, time
        self.point_data, self.cell_data = point_data, cell_data

    def vtk(self):
        grid = vtk.vtkUnstructuredGrid()
        points = vtk.vtkPoints()
        points.SetData(named(self.points, "Points"))
        grid.SetPoints(points)
        for kind, vertices in self.cells:
            grid.InsertNextCell(kind, len(vertices), vertices)
        for name, values in self.point_data.items():
            grid.GetPointData().AddArray(named(values, name))
        for name, values in self.cell_data.items():
            grid.GetCellData().AddArray(named(values, name))
        if self.time is not None:
            grid.GetFieldData().AddArray(named(np.array([self.time]), "TimeValue"))
        return grid

    def expected(self):
        """What a reader must find: tetrahedra only, f32 fields."""
        tets = [i for i, (kind, _) in enumerate(self.cells) if kind == TET]
        fields = [("point", name, values) for name, values in self.point_data.items()]
        fields += [("cell", name, values[tets]) for name, values in self.cell_data.items()]
        return {
            "time": None if self.time is None else bits(np.float64(self.time), np.uint64)[0],
            "points": bits(self.points.astype(np.float64), np.uint64),
            "tets": [list(self.cells[i][1]) for i in tets],
            "skipped": len(self.cells) - len(tets),
            "fields": [
                {
                    "association": association,
                    "name": name,
                    "components": 1 if values.ndim == 1 else values.shape[1],
                    "values": bits(values.astype(np.float32), np.uint32),
                }
                for association, name, values in fields
            ],
        }


def bits(values, to):
    return np.ascontiguousarray(values).view(to).reshape(-1).tolist()


def block(n):
    """(n+1)^3 points, each cube cut into six tetrahedra around its diagonal."""
    index = lambda i, j, k: (i * (n + 1) + j) * (n + 1) + k
    grid = [(i, j, k) for i in range(n + 1) for j in range(n + 1) for k in range(n + 1)]
    cells = []
    for i, j, k in [g for g in grid if max(g) < n]:
        for a, b, c in [(0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)]:
            corner, path = [i, j, k], [index(i, j, k)]
            for axis in (a, b, c):
                corner[axis] += 1
                path.append(index(*corner))
            cells.append((TET, path))
    return np.array(grid, dtype=np.float64), cells


def main_grid():
    """Small enough that a file for each combination is small, with the values that conversions trip over."""
    rng = np.random.default_rng(1)
    points = rng.normal(size=(6, 3)).astype(np.float32)
    cells = [(TET, v) for v in ([0, 1, 2, 3], [1, 2, 3, 4], [5, 4, 3, 2])]
    scalar = np.array([0.1, -0.0, np.nan, np.inf, 1e-45, -3.4e38], dtype=np.float32)
    vector = rng.normal(size=(6, 3)) * np.array([1.0, 1e-300, 1e30])
    return Grid(points, cells, {"T": scalar, "velocity": vector}, {"region": np.array([7, -1, 2**40], dtype=np.int64)}, 0.1)


def types_grid():
    """One array for each number type, with both ends of its range."""
    points, cells = block(1)
    data = {}
    for kind in [np.int8, np.uint8, np.int16, np.uint16, np.int32, np.uint32, np.int64, np.uint64]:
        info = np.iinfo(kind)
        data[kind.__name__] = np.array([info.min, info.max, 0, 1, 2, 3, 100, 101], dtype=kind)
    data["float32"] = np.linspace(-1, 1, 8, dtype=np.float32)
    data["float64"] = np.array([0.1, 1e-310, 5e-324, -0.0, np.nan, -np.inf, 3.4028234e38, 16777217.0])
    return Grid(points, cells, data, {"nine": np.arange(54, dtype=np.int16).reshape(6, 9)})


def mixed_grid():
    """Cells of all dimensions below three between tetrahedra; names that XML would have escaped."""
    points, tets = block(1)
    cells = [(1, [0]), tets[0], (5, [0, 1, 2]), (9, [0, 1, 3, 2]), tets[1], (3, [1, 2]), (2, [0, 1, 2, 3, 4]), tets[2]]
    return Grid(
        points,
        cells,
        {"a<b&c>d": np.arange(8.0), "amp&sharp;": np.arange(8.0) * 2, "größe it's": np.arange(8.0) * 3},
        {"id": np.arange(8, dtype=np.int32), "flux": np.arange(16, dtype=np.float32).reshape(8, 2)},
    )


def blocks_grid():
    """Enough points for many blocks of 256 bytes, the last one short."""
    points, cells = block(3)
    rng = np.random.default_rng(2)
    return Grid(points.astype(np.float32), cells, {"T": rng.normal(size=len(points)).astype(np.float32)}, {})


def write(folder, name, grid, mode, encode=True, compressor="None", header=32, big=False, block_size=None):
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetFileName(str(folder / name))
    writer.SetInputData(grid)
    getattr(writer, f"SetDataModeTo{mode}")()
    writer.SetEncodeAppendedData(encode)
    getattr(writer, f"SetCompressorTypeTo{compressor}")()
    getattr(writer, f"SetHeaderTypeToUInt{header}")()
    (writer.SetByteOrderToBigEndian if big else writer.SetByteOrderToLittleEndian)()
    if block_size:
        writer.SetBlockSize(block_size)
    assert writer.Write() == 1


def in_pieces(grid, folder, name, **options):
    """One file with a piece for each half of the cells and an empty one between, written by hand around VTK's pieces."""
    half = len(grid.cells) // 2
    texts, parts = [], []
    for cells, part in [(slice(0, half), 0), (slice(half, None), 1)]:
        data = {k: v[cells] for k, v in grid.cell_data.items()}
        piece = Grid(grid.points + part, grid.cells[cells], {k: v + part for k, v in grid.point_data.items()}, data)
        write(folder, name, piece.vtk(), "Ascii", **options)
        texts.append((folder / name).read_text())
        parts.append(piece)
    begin, end = "    <Piece", "    </Piece>\n"
    body = [text[text.index(begin) : text.index(end) + len(end)] for text in texts]
    empty = '    <Piece NumberOfPoints="0" NumberOfCells="0">\n      <Points></Points><Cells></Cells>\n    </Piece>\n'
    head, tail = texts[0][: texts[0].index(begin)], texts[0][texts[0].index(end) + len(end) :]
    (folder / name).write_text(head + body[0] + empty + body[1] + tail)
    shift = len(grid.points)
    cells = parts[0].cells + [(kind, [v + shift for v in vertices]) for kind, vertices in parts[1].cells]
    join = lambda field: {k: np.concatenate([getattr(p, field)[k] for p in parts]) for k in getattr(grid, field)}
    return Grid(np.concatenate([p.points for p in parts]), cells, join("point_data"), join("cell_data"))


def main(folder):
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.vtu"):
        old.unlink()
    grids = {"main": main_grid(), "types": types_grid(), "mixed": mixed_grid(), "blocks": blocks_grid()}
    files = {}

    def add(name, grid, *args, **options):
        write(folder, name, grids[grid].vtk(), *args, **options)
        files[name] = grid

    add("ascii.vtu", "main", "Ascii")
    encodings = [("inline", "Binary", True), ("base64", "Appended", True), ("raw", "Appended", False)]
    for encoding, mode, encode in encodings:
        for compressor in ["None", "ZLib", "LZ4", "LZMA"]:
            for header in [32, 64]:
                for big in [False, True]:
                    name = f"{encoding}_{compressor.lower()}_{header}_{'be' if big else 'le'}.vtu"
                    add(name, "main", mode, encode, compressor, header, big)
    add("types_ascii.vtu", "types", "Ascii")
    add("types_raw_be.vtu", "types", "Appended", False, "None", 64, True)
    add("types_inline_zlib.vtu", "types", "Binary", True, "ZLib")
    add("mixed_ascii.vtu", "mixed", "Ascii")
    add("mixed_base64_lz4.vtu", "mixed", "Appended", True, "LZ4", 64)
    for compressor in ["ZLib", "LZ4", "LZMA"]:
        for encoding, mode, encode in encodings:
            add(f"blocks_{encoding}_{compressor.lower()}.vtu", "blocks", mode, encode, compressor, block_size=256)
    grids["pieces"] = in_pieces(mixed_grid(), folder, "pieces_ascii.vtu")
    files["pieces_ascii.vtu"] = "pieces"
    write(folder, "empty_base64_zlib.vtu", vtk.vtkUnstructuredGrid(), "Appended", True, "ZLib")
    write(folder, "empty_ascii.vtu", vtk.vtkUnstructuredGrid(), "Ascii")
    expected = {
        "vtk": vtk.vtkVersion().GetVTKVersion(),
        "empty": ["empty_ascii.vtu", "empty_base64_zlib.vtu"],
        "files": files,
        "grids": {name: grid.expected() for name, grid in grids.items()},
    }
    (folder / "expected.json").write_text(json.dumps(expected, separators=(",", ":")) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "tests/data/vtu"))
