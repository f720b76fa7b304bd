#!/usr/bin/env python3
"""Writes the VTKHDF files of tests/data/vtkhdf with h5py, and checks that vtkHDFReader finds in them what the tests expect.

    python3 tests/interop/write_vtkhdf.py [FOLDER]

Needs numpy, h5py and vtk. Points are those of a cube, and of one beside it; value T of point i is i + 100 * step, c of cell i is
i + 10 * step. cloud.vtkhdf has the cube's points as vertices alone, the radius of point i is 0.1 * (1 + i).
"""

import sys
from pathlib import Path

import h5py
import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkIOHDF import vtkHDFReader

FOLDER = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parents[1] / "data/vtkhdf")
TIMES = [0.25, 0.5, 2.0]
CUBE = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
FACES = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]


def root(file, kind, group="VTKHDF", index=None):
    made = file.create_group(group)
    made.attrs["Version"] = (2, 5)
    made.attrs.create("Type", kind.encode(), dtype=h5py.string_dtype("ascii", len(kind)))
    if index is not None:
        made.attrs["Index"] = index
    return made


def grid(group, parts, points="<f8", index="<i8"):
    """Parts are lists of points, and of cells: type and corners."""
    put = lambda name, data, kind: group.create_dataset(name, data=np.array(data, kind))
    put("NumberOfPoints", [len(p) for p, _ in parts], index)
    put("NumberOfCells", [len(c) for _, c in parts], index)
    put("NumberOfConnectivityIds", [sum(len(v) for _, v in c) for _, c in parts], index)
    put("Points", np.concatenate([p for p, _ in parts]), points)
    put("Types", [t for _, c in parts for t, _ in c], "u1")
    put("Connectivity", [i for _, c in parts for _, v in c for i in v], index)
    put("Offsets", np.concatenate([np.cumsum([0] + [len(v) for _, v in c]) for _, c in parts]), index)


TETS = [(10, [0, 1, 3, 7]), (10, [0, 3, 2, 7]), (5, [0, 1, 2]), (10, [0, 2, 6, 7])]
HEXAHEDRON = [(12, [0, 1, 3, 2, 4, 5, 7, 6])]
PARTS = [(CUBE, TETS), (CUBE + [2, 0, 0], HEXAHEDRON)]


def values(group, points, cells, steps, **options):
    t = np.concatenate([np.arange(points) + 100.0 * step for step in range(steps)])
    c = np.concatenate([np.arange(cells) + 10 * step for step in range(steps)])
    group.create_dataset("PointData/T", data=t, **options)
    group.create_dataset("CellData/c", data=c.astype(">i4"))


def steps(group, points, cells):
    made = group.create_group("Steps")
    made.attrs["NSteps"] = len(TIMES)
    made["Values"] = np.array(TIMES, "<f4")
    zeros = np.zeros(len(TIMES), "i8")
    for name in ("PartOffsets", "PointOffsets"):
        made[name] = zeros
    made["CellOffsets"] = made["ConnectivityIdOffsets"] = zeros[:, None]
    made["NumberOfParts"] = zeros + len(group["NumberOfPoints"])
    made["PointDataOffsets/T"] = np.arange(len(TIMES) + 1) * points
    made["CellDataOffsets/c"] = np.arange(len(TIMES)) * cells
    return made


def write():
    create = lambda name: h5py.File(FOLDER / name, "w", libver=("v110", "v110"))
    with create("steps.vtkhdf") as file:
        group = root(file, "UnstructuredGrid")
        grid(group, PARTS, points="<f4", index="<i4")
        values(group, 16, 5, 3, chunks=(7,), compression="gzip", shuffle=True)
        group["PointData/still"] = np.stack([np.arange(16), -np.arange(16)], 1).astype("i2")
        group["PointData/names"] = np.array([b"a"] * 16)
        steps(group, 16, 5)
    with create("single.hdf") as file:
        group = root(file, "UnstructuredGrid")
        grid(group, PARTS[1:])
        values(group, 8, 1, 1)
        group["FieldData/TimeValue"] = [7.5]
        group["CellData/is_solid"] = np.array([True])
        group["PointData/T"].attrs["Units"] = "°C"
    with create("moving.vtkhdf") as file:
        group = root(file, "UnstructuredGrid")
        grid(group, [PARTS[1], (CUBE * 2, HEXAHEDRON)])
        values(group, 8, 1, 3)
        made = steps(group, 8, 1)
        for name, data in dict(PartOffsets=[0, 0, 1], PointOffsets=[0, 0, 8], NumberOfParts=[1, 1, 1]).items():
            made[name][:] = data
        made["CellOffsets"][:] = [[0], [0], [1]]
        made["ConnectivityIdOffsets"][:] = [[0], [0], [8]]
    with create("cloud.vtkhdf") as file:
        group = root(file, "UnstructuredGrid")
        grid(group, [(CUBE, [(1, [i]) for i in range(4)] + [(2, range(4, 8))])])
        values(group, 8, 5, 3)
        steps(group, 8, 5)
        group["PointData/radius"] = 0.1 * (1 + np.arange(8))
    with create("polyhedron.vtkhdf") as file:
        group = root(file, "UnstructuredGrid")
        grid(group, [(CUBE, [(42, range(8)), (10, [0, 1, 3, 7])])])
        values(group, 8, 2, 1)
        ids = dict(NumberOfFaces=[6], NumberOfFaceConnectivityIds=[24], NumberOfPolyhedronToFaceIds=[6])
        ids |= dict(FaceConnectivity=np.ravel(FACES), FaceOffsets=np.arange(7) * 4)
        ids |= dict(PolyhedronToFaces=np.arange(6), PolyhedronOffsets=[0, 6, 6])
        for name, data in ids.items():
            group[name] = np.array(data, "i8")
    with create("blocks.vtkhdf") as file:
        group = root(file, "PartitionedDataSetCollection")
        for name, index, part in (("b", 0, PARTS[0]), ("a", 1, PARTS[1])):
            block = root(group, "UnstructuredGrid", name, index)
            grid(block, [part])
            values(block, 8, len(part[1]), 1)
            group[f"Assembly/{name}"] = h5py.SoftLink(f"/VTKHDF/{name}")
        root(group, "PolyData", "surface", 2)
    with create("image.vtkhdf") as file:
        group = root(file, "ImageData")
        attributes = dict(WholeExtent=[-1, 2, 0, 2, 3, 4], Origin=[0.1, 0, 0], Spacing=[0.5, 0.25, 1], Direction=[0, 1, 0, -1, 0, 0, 0, 0, 1])
        for name, data in attributes.items():
            group.attrs[name] = data
        t = np.arange(24.0).reshape(1, 2, 3, 4) + 100 * np.arange(3).reshape(3, 1, 1, 1)
        group.create_dataset("PointData/T", data=t)
        group.create_dataset("CellData/c", data=np.arange(6.0).reshape(1, 2, 3))
        made = group.create_group("Steps")
        made.attrs["NSteps"] = 3
        made["Values"] = TIMES
        made["PointDataOffsets/T"] = [0, 1, 2]
    for name, kind in (("surface.vtkhdf", "PolyData"), ("amr.vtkhdf", "OverlappingAMR")):
        with create(name) as file:
            root(file, kind)
    with create("other.hdf") as file:
        file["a"] = [1.0]


def leaves(data):
    if data.IsA("vtkDataSet"):
        return [] if data.IsA("vtkPolyData") else [data]
    count = data.GetNumberOfPartitions if data.IsA("vtkPartitionedDataSet") else data.GetNumberOfPartitionedDataSets
    part = data.GetPartitionAsDataObject if data.IsA("vtkPartitionedDataSet") else data.GetPartitionedDataSet
    return [leaf for i in range(count()) for leaf in leaves(part(i))]


def check():
    for name in ("steps.vtkhdf", "polyhedron.vtkhdf", "image.vtkhdf", "cloud.vtkhdf"):
        reader = vtkHDFReader()
        reader.SetFileName(str(FOLDER / name))
        # VTK has no arrays of text on points.
        reader.UpdateInformation()
        reader.GetPointDataArraySelection().DisableArray("names")
        key = vtkStreamingDemandDrivenPipeline.TIME_STEPS()
        times = reader.GetOutputInformation(0).Get(key) or (0.0,)
        assert list(times) == (TIMES if len(times) > 1 else [0.0]), times
        for step, time in enumerate(times):
            reader.UpdateTimeStep(time)
            parts = leaves(reader.GetOutputDataObject(0))
            t = np.concatenate([vtk_to_numpy(part.GetPointData().GetArray("T")) for part in parts])
            assert np.array_equal(t, np.arange(len(t)) + 100 * step), (name, step)
        print(name, len(times), "steps", len(t), "points", [part.GetPoint(1) for part in parts])


FOLDER.mkdir(parents=True, exist_ok=True)
write()
check()
