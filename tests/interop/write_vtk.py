"""Writes the oracle files of the reader of legacy files with VTK, and what a reader must find in them.

    pip install vtk && python tests/interop/write_vtk.py tests/data/vtk

Unstructured grids are those of `write_vtu.py`, as text and binary, in the old and the new layout of cells; the others are a
grid of each structured kind, and polyhedra. `expected.json` holds what VTK itself reads back, as bit patterns: text has fewer
digits than the numbers had.
"""

import json
import sys
from pathlib import Path

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy
from write_vtu import Grid, bits, main_grid, mixed_grid, named, types_grid

VERSIONS = {"4.2": 42, "5.1": 51}


def write(path, data, writer, is_binary, version):
    writer.SetFileName(str(path))
    writer.SetInputData(data)
    writer.SetFileVersion(VERSIONS[version])
    (writer.SetFileTypeToBinary if is_binary else writer.SetFileTypeToASCII)()
    assert writer.Write() == 1
    reader = vtk.vtkGenericDataObjectReader()
    reader.SetFileName(str(path))
    for kind in ["Scalars", "Vectors", "Fields"]:
        getattr(reader, f"ReadAll{kind}On")()
    reader.Update()
    return reader.GetOutput()


def arrays(data):
    return {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())}


def read_back(grid, cells):
    time = grid.GetFieldData().GetArray("TimeValue")
    points = vtk_to_numpy(grid.GetPoints().GetData())
    time = None if time is None else time.GetValue(0)
    return Grid(points, cells, arrays(grid.GetPointData()), arrays(grid.GetCellData()), time).expected()


def with_values(data):
    """Gives the points of a grid values, and the cells."""
    values = np.sqrt(np.arange(data.GetNumberOfPoints())).astype(np.float32)
    data.GetPointData().SetScalars(named(values, "T"))
    data.GetCellData().AddArray(named(np.arange(data.GetNumberOfCells(), dtype=np.int32), "cell number"))
    return data


def image():
    data = vtk.vtkImageData()
    data.SetExtent(-2, 1, 3, 5, 0, 2)
    data.SetSpacing(0.1, 0.3, 1 / 3)
    data.SetOrigin(0.7, 1e-3, -5)
    return data


def structured():
    data = vtk.vtkStructuredGrid()
    data.SetDimensions(4, 3, 3)
    index = np.array([[i, j, k] for k in range(3) for j in range(3) for i in range(4)], dtype=np.float64)
    points = vtk.vtkPoints()
    points.SetData(named(index + 0.1 * np.random.default_rng(4).random(index.shape), "Points"))
    data.SetPoints(points)
    return data


def rectilinear():
    data = vtk.vtkRectilinearGrid()
    data.SetDimensions(4, 3, 3)
    data.SetXCoordinates(named(np.array([0, 0.1, 0.5, 2], dtype=np.float32), "x"))
    data.SetYCoordinates(named(np.array([-1 / 3, 0.25, 7]), "y"))
    data.SetZCoordinates(named(np.array([0, 2, 5], dtype=np.int32), "z"))
    return data


def polyhedra():
    data = vtk.vtkUnstructuredGrid()
    points = vtk.vtkPoints()
    for point in [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)]:
        points.InsertNextPoint(point)
    data.SetPoints(points)
    faces = vtk.vtkIdList()
    for number in [4, 3, 1, 2, 3, 3, 1, 2, 4, 3, 2, 3, 4, 3, 1, 3, 4]:
        faces.InsertNextId(number)
    data.InsertNextCell(vtk.VTK_POLYHEDRON, faces)
    data.InsertNextCell(vtk.VTK_TETRA, 4, [0, 1, 2, 3])
    return data


def main(folder):
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.vtk"):
        old.unlink()
    combinations = [("text", False), ("binary", True)]
    grids, others = {}, {}
    for name, grid in [("main", main_grid()), ("types", types_grid()), ("mixed", mixed_grid())]:
        for encoding, is_binary in combinations:
            for version in VERSIONS:
                data = grid.vtk()
                if name == "main":
                    data.GetPointData().SetActiveScalars("T")
                    data.GetPointData().SetActiveVectors("velocity")
                file = f"{name}_{encoding}_{version.replace('.', '')}.vtk"
                read = write(folder / file, data, vtk.vtkUnstructuredGridWriter(), is_binary, version)
                grids[file] = read_back(read, grid.cells)
    for name, data, writer in [
        ("points", image(), vtk.vtkStructuredPointsWriter()),
        ("structured", structured(), vtk.vtkStructuredGridWriter()),
        ("rectilinear", rectilinear(), vtk.vtkRectilinearGridWriter()),
        ("polyhedra", polyhedra(), vtk.vtkUnstructuredGridWriter()),
    ]:
        if name == "points":
            writer.WriteExtentOn()
        for encoding, is_binary in combinations:
            read = write(folder / f"{name}_{encoding}.vtk", with_values(data), writer, is_binary, "5.1")
            points = np.array([read.GetPoint(i) for i in range(read.GetNumberOfPoints())])
            others[f"{name}_{encoding}.vtk"] = {
                "points": bits(points, np.uint64),
                "cells": read.GetNumberOfCells(),
                "values": bits(vtk_to_numpy(read.GetPointData().GetArray("T")), np.uint32),
            }
    expected = {"vtk": vtk.vtkVersion().GetVTKVersion(), "grids": grids, "others": others}
    (folder / "expected.json").write_text(json.dumps(expected, separators=(",", ":")) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "tests/data/vtk"))
