#!/usr/bin/env python3
"""Writes the XDMF files of tests/data/xdmf, and what must be found in them (expected.json).

    python3 tests/interop/write_xdmf.py [FOLDER]

Needs numpy, h5py and meshio. One small series (two cubes of six tetrahedra each, three steps) in the dialects of
several writers, each with its own way to refer to a mesh, and HDF5 in several layouts.
"""

import json
import sys
from pathlib import Path

import h5py
import meshio
import numpy as np

TIMES = [0.1, 0.25, 1e3 / 3]
TETS = np.array([[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]])


def mesh():
    cube = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    points = np.concatenate([cube, cube + [2.5, 0, 0]]) / 3
    return points, np.concatenate([TETS, TETS + 8])


def fields(step):
    """T: a scalar with specials; U: a vector; region: integers of cells."""
    points, tets = mesh()
    t = np.sin(points.sum(axis=1) * (1 + step)) * 10.0**step
    t[3], t[5] = np.nan, np.inf
    u = np.cos(points * (2 + step))
    return t, u, np.arange(len(tets)) % 3 + step


def h5(path, layout, dtype="<f8", index="<i8"):
    """All arrays of the series, one data set a step."""
    options = {
        "contiguous": {},
        "gzip": dict(compression="gzip", shuffle=True, chunks=True),
        "gzip_plain": dict(compression="gzip", chunks=True, fletcher32=True),
        "latest": dict(compression="gzip", shuffle=True, chunks=True),
    }[layout]
    points, tets = mesh()
    with h5py.File(path, "w", libver="latest" if layout == "latest" else "earliest") as file:
        put = lambda name, data, kind: file.create_dataset(name, data=data.astype(kind), **options)
        put("mesh/points", points, dtype)
        put("mesh/cells", tets, index)
        for step in range(len(TIMES)):
            t, u, region = fields(step)
            put(f"T/{step}", t, dtype)
            put(f"U/{step}", u, dtype)
            put(f"region/{step}", region, "i1")
        # One data set for all steps, for hyperslabs.
        file.create_dataset("all/T", data=np.stack([fields(s)[0] for s in range(len(TIMES))]).astype(dtype))
        file["text"] = np.array([b"a", b"bc"])


def item(dims, text, kind="Float", precision=8, form="HDF", extra=""):
    dims = " ".join(map(str, dims))
    return f'<DataItem Dimensions="{dims}" NumberType="{kind}" Precision="{precision}" Format="{form}"{extra}>{text}</DataItem>'


def series(name, header="<Xdmf Version=\"3.0\">", mesh_once=False, precision=8):
    """Explicit mesh in each step, or a reference to that of the first."""
    cells = item([12, 4], f"{name}.h5:/mesh/cells", "Int", precision)
    points = item([16, 3], f"{name}.h5:/mesh/points", precision=precision)
    grids = []
    for step, time in enumerate(TIMES):
        if step and mesh_once:
            base = '/Xdmf/Domain/Grid[1]/Grid[@Name="step 0"]'
            m = f'<Topology Reference="XML">{base}/Topology</Topology><Geometry Reference="XML">\n {base}/Geometry[1]\n</Geometry>'
        else:
            m = f'<Topology TopologyType="Tetrahedron" NumberOfElements="12">{cells}</Topology><Geometry GeometryType="XYZ">{points}</Geometry>'
        a = f'<Attribute Name="T" AttributeType="Scalar" Center="Node">{item([16], f"{name}.h5:/T/{step}", precision=precision)}</Attribute>'
        a += f'<Attribute Name="U" AttributeType="Vector" Center="Node">{item([16, 3], f"{name}.h5:/U/{step}", precision=precision)}</Attribute>'
        a += f'<Attribute Name="region" Center="Cell">{item([12], f"{name}.h5:/region/{step}", "Char", 1)}</Attribute>'
        grids.append(f'<Grid Name="step {step}" GridType="Uniform"><Time Value="{time!r}"/>{m}{a}</Grid>\n')
    body = "".join(grids)
    return f'<?xml version="1.0" ?>\n{header}<Domain><Grid Name="s" GridType="Collection" CollectionType="Temporal">\n{body}</Grid></Domain></Xdmf>\n'


def dolfin(name):
    """As dolfin 2019 writes: xi:include with an xpointer, no number types, columns of one."""
    xi = 'xpointer(//Grid[@Name=&quot;TimeSeries&quot;]/Grid[1]/*[self::Topology or self::Geometry])'
    grids = []
    for step, time in enumerate(TIMES):
        if step == 0:
            m = f'<Topology NumberOfElements="12" TopologyType="Tetrahedron" NodesPerElement="4"><DataItem Dimensions="12 4" NumberType="UInt" Format="HDF">{name}.h5:/mesh/cells</DataItem></Topology><Geometry GeometryType="XYZ"><DataItem Dimensions="16 3" Format="HDF">{name}.h5:/mesh/points</DataItem></Geometry>'
        else:
            m = f'<xi:include xpointer="{xi}" />'
        a = f'<Attribute Name="T" AttributeType="Scalar" Center="Node"><DataItem Dimensions="16 1" Format="HDF">{name}.h5:/T/{step}</DataItem></Attribute>'
        a += f'<Attribute ItemType="FiniteElementFunction" ElementFamily="CG" Name="c" Center="Other" AttributeType="Scalar"><DataItem Dimensions="12 1" Format="HDF">{name}.h5:/T/{step}</DataItem></Attribute>'
        grids.append(f'<Grid Name="mesh" GridType="Uniform">{m}<Time Value="{time!r}" />{a}</Grid>\n')
    return f'<?xml version="1.0"?>\n<!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" []>\n<Xdmf Version="3.0" xmlns:xi="http://www.w3.org/2001/XInclude">\n<Domain><Grid Name="TimeSeries" GridType="Collection" CollectionType="Temporal">\n{"".join(grids)}</Grid></Domain></Xdmf>\n'


def dolfinx(name):
    """As dolfinx writes: the mesh as a grid of its own, a temporal collection for each function."""
    xi = "xpointer(/Xdmf/Domain/Grid[@GridType='Uniform'][1]/*[self::Topology or self::Geometry])"
    m = f'<Grid Name="mesh" GridType="Uniform"><Topology TopologyType="Tetrahedron" NumberOfElements="12" NodesPerElement="4"><DataItem Dimensions="12 4" NumberType="Int" Format="HDF">{name}.h5:/mesh/cells</DataItem></Topology><Geometry GeometryType="XYZ"><DataItem Dimensions="16 3" Format="HDF">{name}.h5:/mesh/points</DataItem></Geometry></Grid>\n'
    for field, dims, kind in [("T", "16 1", "Scalar"), ("U", "16 3", "Vector")]:
        grids = "".join(
            f'<Grid Name="{field}" GridType="Uniform"><xi:include xpointer="{xi}" /><Time Value="{time!r}" /><Attribute Name="{field}" AttributeType="{kind}" Center="Node"><DataItem Dimensions="{dims}" Format="HDF">{name}.h5:/{field}/{step}</DataItem></Attribute></Grid>\n'
            for step, time in enumerate(TIMES)
        )
        m += f'<Grid Name="{field}" GridType="Collection" CollectionType="Temporal">\n{grids}</Grid>\n'
    return f'<?xml version="1.0"?>\n<Xdmf Version="3.0" xmlns:xi="https://www.w3.org/2001/XInclude"><Domain>{m}</Domain></Xdmf>\n'


def dofs_of(degree, components, seed):
    """Dofs of each cell of functions CG, or DG of degree 0, numbered at random: component by component, corners first, then edges.
    Also the dof of each vertex (or cell) and component."""
    points, tets = mesh()
    if degree == 0:
        entities = [[i] for i in range(len(tets))]
    else:
        pairs = [(2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1)][: 6 * (degree - 1)]
        edges = sorted({tuple(sorted((c[a], c[b]))) for c in tets.tolist() for a, b in pairs})
        number = {edge: len(points) + i for i, edge in enumerate(edges)}
        entities = [[*c, *(number[tuple(sorted((c[a], c[b])))] for a, b in pairs)] for c in tets.tolist()]
    count = max(map(max, entities)) + 1
    numbering = np.random.default_rng(seed).permutation(count * components).reshape(count, components)
    rows = [[numbering[e, k] for k in range(components) for e in row] for row in entities]
    return np.array(rows), numbering


def checkpoint(name, functions, form="HDF"):
    """As dolfin's write_checkpoint: a temporal collection for each function, each step with its mesh, dofs and coefficients."""
    points, tets = mesh()
    file = h5py.File(FOLDER / f"{name}.h5", "w") if form == "HDF" else None

    def data(path, array, kind):
        dims = " ".join(map(str, array.shape))
        if file is None:
            text = "\n".join(" ".join(map(repr, row)) for row in array.tolist())
            return f'<DataItem Dimensions="{dims}" NumberType="{kind}" Precision="8" Format="XML">{text}</DataItem>'
        file[path] = array
        units = {"T/T_0/vector": "K", "T/T_1/vector": "F", "U/U_0/vector": np.bytes_(b" m/s \0"), "region/region_0/vector": "x" * 65}
        if path in units:
            file[path].attrs["units"] = units[path]
        return f'<DataItem Dimensions="{dims}" NumberType="{kind}" Format="HDF">{name}.h5:/{path}</DataItem>'

    collections = ""
    for field, family, degree, kind in functions:
        grids = ""
        for step, time in enumerate(TIMES):
            values = np.asarray(dict(zip(["T", "U", "region"], fields(step)))[field], float)
            values = values.reshape(len(values), -1)
            rows, numbering = dofs_of(degree, values.shape[1], step)
            vector = np.full(numbering.size, -1e9)
            vector[numbering[: len(values)]] = values
            path = f"{field}/{field}_{step}"
            starts = np.arange(len(tets) + 1) * rows.shape[1]
            # As on several processes: the numbers of cells in memory are others than their places.
            numbers = np.random.default_rng(7).permutation(len(tets))
            column = lambda a: np.asarray(a).reshape(-1, 1)
            grids += (
                f'<Grid Name="{field}_{step}" GridType="Uniform"><Topology NumberOfElements="12" TopologyType="Tetrahedron" NodesPerElement="4">'
                f'{data(f"{path}/mesh/topology", tets, "UInt")}</Topology><Geometry GeometryType="XYZ">{data(f"{path}/mesh/geometry", points, "Float")}</Geometry>'
                f'<Time Value="{time!r}" /><Attribute ItemType="FiniteElementFunction" ElementFamily="{family}" ElementDegree="{degree}" '
                f'ElementCell="tetrahedron" Name="{field}" Center="Other" AttributeType="{kind}">{data(f"{path}/cell_dofs", column(rows), "Int")}'
                f'{data(f"{path}/vector", column(vector), "Float")}{data(f"{path}/x_cell_dofs", column(starts), "Int")}'
                f'{data(f"{path}/cells", column(numbers), "Int")}</Attribute></Grid>\n'
            )
        collections += f'<Grid GridType="Collection" CollectionType="Temporal" Name="{field}">\n{grids}</Grid>\n'
    if file:
        file.close()
    return f'<?xml version="1.0"?>\n<Xdmf Version="3.0"><Domain>{collections}</Domain></Xdmf>\n'


def version2(name):
    """Version 2: one data set for all steps with hyperslabs, times of the collection, big-endian binary coordinates,
    corners counted from 1, a shared DataItem by path."""
    points, tets = mesh()
    (FOLDER / f"{name}.bin").write_bytes(b"head" + points.astype(">f8").tobytes())
    corners = " ".join(map(str, (tets + 1).ravel()))
    shared = item([12, 4], corners, "Int", 4, "XML").replace("<DataItem", '<DataItem Name="corners"')
    times = item([3], " ".join(map(repr, TIMES)), form="XML")
    coordinates = item([16, 3], f"{name}.bin", form="Binary", extra=' Endian="Big" Seek="4"')
    grids = []
    for step in range(len(TIMES)):
        slab = f'<DataItem ItemType="HyperSlab" Dimensions="16"><DataItem Dimensions="3 2" Format="XML">{step} 0  1 1  1 16</DataItem>{item([3, 16], f"{name}.h5:/all/T")}</DataItem>'
        grids.append(
            f'<Grid><Topology Type="Tetrahedron" NumberOfElements="12" BaseOffset="1"><DataItem Reference="/Xdmf/Domain/DataItem[@Name=\'corners\']"/></Topology>'
            f'<Geometry Type="XYZ">{coordinates}</Geometry>'
            f'<Attribute Name="T">{slab}</Attribute></Grid>\n'
        )
    return f'<?xml version="1.0" ?>\n<Xdmf Version="2.0"><Domain>{shared}<Grid GridType="Collection" CollectionType="Temporal"><Time TimeType="List">{times}</Time>\n{"".join(grids)}</Grid></Domain></Xdmf>\n'


def spatial(name):
    """Each cube is a piece of a spatial collection; mixed cells in the first, x, y and z apart in the second."""
    points, tets = mesh()
    words = lambda a: " ".join(map(repr, np.asarray(a).ravel().tolist()))
    grids = []
    for step, time in enumerate(TIMES):
        t, u, _ = fields(step)
        pieces = []
        for half in (0, 1):
            p, own = points[half * 8 : half * 8 + 8], slice(half * 8, half * 8 + 8)
            if half == 0:
                mixed = np.concatenate([[4, 0, 1, 2]] + [[6, *c] for c in TETS] + [[2, 2, 0, 1]])
                m = f'<Topology TopologyType="Mixed" NumberOfElements="8">{item([len(mixed)], words(mixed), "UChar", 1, "XML")}</Topology><Geometry>{item([8, 3], words(p), form="XML")}</Geometry>'
                cells = 8
            else:
                m = f'<Topology TopologyType="Tet">{item([6, 4], words(TETS), "UShort", 2, "XML")}</Topology><Geometry GeometryType="X_Y_Z">{"".join(item([8], words(p[:, k]), form="XML") for k in range(3))}</Geometry>'
                cells = 6
            a = f'<Attribute Name="T">{item([8], words(t[own]), form="XML")}</Attribute>'
            a += f'<Attribute Name="number" Center="Cell">{item([cells], words(np.arange(cells)), "Int", 4, "XML")}</Attribute>'
            pieces.append(f'<Grid Name="piece {half}">{m}{a}</Grid>')
        grids.append(f'<Grid GridType="Collection" CollectionType="Spatial"><Time Value="{time!r}"/>{"".join(pieces)}</Grid>\n')
    return f'<Xdmf><Domain><Grid GridType="Collection" CollectionType="Temporal">{"".join(grids)}</Grid></Domain></Xdmf>\n'


def by_meshio(name, form):
    points, tets = mesh()
    with meshio.xdmf.TimeSeriesWriter(f"{name}.xdmf", data_format=form) as writer:
        writer.write_points_cells(points, [("tetra", tets)])
        for step, time in enumerate(TIMES):
            t, u, region = fields(step)
            writer.write_data(time, point_data={"T": t, "U": u}, cell_data={"region": [region]})


def bits(values, dtype):
    """As f32, by way of the type in the file."""
    single = np.asarray(values).astype(dtype).astype("<f4").ravel()
    return single.view("<u4").tolist()


def main():
    import os

    FOLDER.mkdir(parents=True, exist_ok=True)
    for old in [*FOLDER.glob("*.xdmf"), *FOLDER.glob("*.h5"), *FOLDER.glob("*.bin")]:
        old.unlink()
    files = {}

    def add(name, text, what, dtype="<f8"):
        (FOLDER / f"{name}.xdmf").write_text(text)
        files[name] = {"fields": what, "f32": dtype.endswith("f4")}

    everything = ["T", "U", "region"]
    for name, layout, dtype, index in [
        ("contiguous_f64", "contiguous", "<f8", "<i8"),
        ("gzip_f32", "gzip", "<f4", "<i4"),
        ("plain_be", "gzip_plain", ">f8", ">i4"),
        ("latest_f32", "latest", "<f4", "<u4"),
    ]:
        h5(FOLDER / f"{name}.h5", layout, dtype, index)
        add(name, series(name, mesh_once=layout == "gzip"), everything, dtype)
    for name, text, what in [("dolfin", dolfin, ["T"]), ("dolfinx", dolfinx, ["T", "U"]), ("version2", version2, ["T"])]:
        h5(FOLDER / f"{name}.h5", "contiguous")
        add(name, text(name), what)
    add("spatial", spatial("spatial"), ["T"])
    functions = [("T", "CG", 1, "Scalar"), ("U", "CG", 1, "Vector"), ("region", "DG", 0, "Scalar")]
    add("checkpoint", checkpoint("checkpoint", functions), everything)
    add("checkpoint_xml", checkpoint("checkpoint_xml", [("U", "CG", 2, "Vector")], "XML"), ["U"])
    os.chdir(FOLDER)
    for form in ["HDF", "XML", "Binary"]:
        name = f"meshio_{form.lower()}"
        by_meshio(name, form)
        files[name] = {"fields": everything, "f32": False}

    points, tets = mesh()
    steps = [dict(zip(everything, fields(step))) for step in range(len(TIMES))]
    values = lambda dtype: {f: [bits(s[f], "i1" if f == "region" else dtype) for s in steps] for f in everything}
    expected = {
        "h5py": h5py.__version__,
        "meshio": meshio.__version__,
        "times": np.array(TIMES).view("u8").tolist(),
        "points": {"f64": points.ravel().view("u8").tolist(), "f32": points.ravel().astype("f4").astype("f8").view("u8").tolist()},
        "tets": tets.tolist(),
        "values": {"f64": values("<f8"), "f32": values("<f4")},
        "files": files,
    }
    Path("expected.json").write_text(json.dumps(expected, separators=(",", ":")) + "\n")


FOLDER = Path(sys.argv[1] if len(sys.argv) > 1 else "tests/data/xdmf").resolve()
if __name__ == "__main__":
    main()
