"""Compares exported surfaces with those of VTK on the exported mesh of the same step.

usage: read_surfaces.py GRID.vtu SURFACE.vtp|.ply [--perturb move|flip|drop|value] iso FIELD VALUE...
       read_surfaces.py GRID.vtu SURFACE.vtp|.ply [--perturb ...] slice X,Y,Z X,Y,Z

The surface must have the area, the oriented volume and the bounds of that of VTK; its points must be where VTK has points; it must end at the
boundary of the mesh only; and its fields must be those of VTK. --perturb spoils what was read, to show that the comparison notices it.
"""

import sys

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy


def read(reader, name):
    reader.SetFileName(name)
    reader.Update()
    return reader.GetOutput()


def triangles_of(data):
    cells = vtk_to_numpy(data.GetPolys().GetData()).reshape(-1, 4)
    assert (cells[:, 0] == 3).all()
    return cells[:, 1:].copy()


def points_of(data):
    return vtk_to_numpy(data.GetPoints().GetData()).astype(np.float64)


def arrays_of(attributes):
    return {attributes.GetArrayName(i): vtk_to_numpy(attributes.GetArray(i)) for i in range(attributes.GetNumberOfArrays())}


def measures(points, triangles):
    """Areas, their sum as vectors, and the oriented volume between the triangles and the origin."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    normals = 0.5 * np.cross(b - a, c - a)
    return np.linalg.norm(normals, axis=1), normals.sum(axis=0), np.einsum("ij,ij->", a, normals) / 3


def locator(data):
    found = vtk.vtkStaticPointLocator()
    found.SetDataSet(data)
    found.BuildLocator()
    return found


def check_closed(grid, points, triangles, near):
    """Each edge has two triangles in opposite directions, unless it lies on the boundary of the mesh."""
    surface = vtk.vtkDataSetSurfaceFilter()
    surface.SetInputData(grid)
    surface.Update()
    boundary = vtk.vtkStaticCellLocator()
    boundary.SetDataSet(surface.GetOutput())
    boundary.BuildLocator()
    directed = {}
    for a, b, c in triangles.tolist():
        for edge in ((a, b), (b, c), (c, a)):
            directed[edge] = directed.get(edge, 0) + 1
    open_edges = [edge for edge, count in directed.items() if count != directed.get(edge[::-1], 0)]
    cell, part, squared = vtk.reference(0), vtk.reference(0), vtk.reference(0.0)
    closest = [0.0] * 3
    for edge in open_edges:
        for point in (points[edge[0]], points[edge[1]], points[list(edge)].mean(axis=0)):
            boundary.FindClosestPoint(point, closest, cell, part, squared)
            assert squared.get() <= near**2, f"a hole at {point}"
    assert max(directed.values()) == 1, "an edge has more than two triangles"
    return len(open_edges)


def perturb(kind, points, triangles, fields, near):
    if kind == "move":
        points[len(points) // 2] += 3 * near
    elif kind == "flip":
        triangles[0] = triangles[0, ::-1]
    elif kind == "drop":
        triangles = triangles[np.arange(len(triangles)) != len(triangles) // 2]
    elif kind == "value":
        for values in fields.values():
            values += 0.001 * (1 + abs(values).max())
    return triangles


def expected_surface(grid, kind, rest):
    """What VTK makes of the mesh."""
    if kind == "iso":
        made = vtk.vtkContourFilter()
        made.SetInputArrayToProcess(0, 0, 0, vtk.vtkDataObject.FIELD_ASSOCIATION_POINTS, rest[0])
        for i, value in enumerate(rest[1:]):
            made.SetValue(i, float(value))
        made.ComputeNormalsOff()
        made.ComputeScalarsOn()
    else:
        plane = vtk.vtkPlane()
        plane.SetOrigin([float(x) for x in rest[0].split(",")])
        plane.SetNormal([float(x) for x in rest[1].split(",")])
        made = vtk.vtkCutter()
        made.SetCutFunction(plane)
        made.GenerateTrianglesOn()
    made.SetInputData(grid)
    made.SetOutputPointsPrecision(vtk.vtkAlgorithm.DOUBLE_PRECISION)
    made.Update()
    return made.GetOutput()


def main(grid_name, name, *rest):
    spoiled = None
    if rest[0] == "--perturb":
        spoiled, rest = rest[1], rest[2:]
    kind, rest = rest[0], rest[1:]
    grid = read(vtk.vtkXMLUnstructuredGridReader(), grid_name)
    is_vtp = name.endswith(".vtp")
    surface = read(vtk.vtkXMLPolyDataReader() if is_vtp else vtk.vtkPLYReader(), name)
    expected = expected_surface(grid, kind, rest)
    near = 1e-5 * np.ptp(points_of(grid), axis=0).max()

    points, triangles = points_of(surface), triangles_of(surface)
    fields = arrays_of(surface.GetPointData()) if is_vtp else {}
    triangles = perturb(spoiled, points, triangles, fields, near)
    areas, vector, volume = measures(points, triangles)
    areas_vtk, vector_vtk, volume_vtk = measures(points_of(expected), triangles_of(expected))
    assert len(triangles) > 100 and areas.min() > 0
    assert abs(areas.sum() / areas_vtk.sum() - 1) <= 1e-4, f"area {areas.sum()} instead of {areas_vtk.sum()}"
    size = areas_vtk.sum()
    assert np.abs(vector - vector_vtk).max() <= 1e-4 * size, f"vector area {vector} instead of {vector_vtk}"
    reach = np.abs(points_of(grid)).max()
    assert abs(volume - volume_vtk) <= 1e-4 * size * reach, f"volume {volume} instead of {volume_vtk}"
    for bound in (np.min, np.max):
        assert np.abs(bound(points, axis=0) - bound(points_of(expected), axis=0)).max() <= near

    # VTK's points are crossings of edges, each once.
    found = locator(expected)
    nearest = np.array([found.FindClosestPoint(point) for point in points])
    far = np.linalg.norm(points_of(expected)[nearest] - points, axis=1).max()
    assert far <= near, f"a point is {far} from where VTK has one"
    open_edges = check_closed(grid, points, triangles, near)

    if is_vtp:
        theirs = arrays_of(expected.GetPointData())
        wanted = [rest[0]] if kind == "iso" else list(arrays_of(grid.GetPointData()))
        assert sorted(fields) == sorted(wanted), list(fields)
        for key, values in fields.items():
            assert values.dtype == np.float32
            off = np.abs(values - theirs[key][nearest]).max()
            assert off <= 1e-4 * (np.abs(theirs[key]).max() + 1e-30), f"{key} is off by {off}"
        time = arrays_of(surface.GetFieldData())["TimeValue"]
        assert time == arrays_of(grid.GetFieldData())["TimeValue"]
        cells = arrays_of(surface.GetCellData())
        if kind == "iso":
            values = cells["isovalue"]
            assert values.dtype == np.float64 and set(values) == {float(v) for v in rest[1:]}, set(values)
        else:
            assert not cells
    print(f"ok {len(points)} points {len(triangles)} triangles {open_edges} open edges, off by {far:.1e}")


main(*sys.argv[1:])
