#!/usr/bin/env python3
"""Writes the Exodus files of tests/data/exodus: the same series in each format of netCDF, and in two parts.

    python3 tests/interop/write_exodus.py [FOLDER]

Needs numpy and netCDF4. A hexahedron, two tetrahedra on top of it and a quadrilateral in three blocks, two steps;
tests/it/import/exodus.rs knows what is in them.
"""

import sys
from pathlib import Path

import netCDF4
import numpy as np

POINTS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1), (0.5, 0.5, 2)])
BLOCKS = [
    (10, "left", "HEX8", [[1, 2, 3, 4, 5, 6, 7, 8]]),
    (20, "", "SHELL4", [[1, 2, 3, 4]]),
    (30, "top", "tetra", [[5, 6, 7, 9], [5, 7, 8, 9]]),
]
NODES = ["T", "u_x", "u_y", "u_z"]
ELEMENTS = {"p": [1, 3], "q": [3]}


def names(data, name, dimension, texts):
    table = np.array([list(text.ljust(8, "\0")) for text in texts], "S1")
    data.createVariable(name, "S1", (dimension, "len_name"))[:] = table


def write(path, format, real, part=None):
    """The whole, or a part: the numbers of its blocks. Parts list all blocks, and the number of each node."""
    kept = [part is None or i in part for i in range(1, len(BLOCKS) + 1)]
    blocks = [(*block[:3], block[3] if is_kept else []) for block, is_kept in zip(BLOCKS, kept)]
    nodes = sorted({node for block in blocks for element in block[3] for node in element})
    points = POINTS[np.array(nodes) - 1]
    data = netCDF4.Dataset(path, "w", format=format)
    attributes = {"api_version": 5.22, "version": 5.22, "floating_point_word_size": int(real[1]), "file_size": 1}
    for name, value in attributes.items():
        data.setncattr(name, np.float32(value) if isinstance(value, float) else np.int32(value))
    sizes = {"time_step": None, "num_dim": 3, "num_nodes": len(points), "num_el_blk": len(BLOCKS), "len_name": 8}
    sizes |= {"num_nod_var": len(NODES), "num_elem_var": len(ELEMENTS)}
    for name, size in sizes.items():
        data.createDimension(name, size)
    options = {"zlib": True, "fletcher32": True} if format == "NETCDF4" else {}
    times = data.createVariable("time_whole", real, ("time_step",))
    data.createVariable("eb_prop1", "i4", ("num_el_blk",))[:] = [number for number, *_ in BLOCKS]
    names(data, "eb_names", "num_el_blk", [name for _, name, *_ in BLOCKS])
    for axis, name in enumerate("xyz"):
        data.createVariable("coord" + name, real, ("num_nodes",))[:] = points[:, axis]
    if part is not None:
        data.createVariable("node_num_map", "i4", ("num_nodes",))[:] = nodes
    for i, (_, _, kind, elements) in enumerate(blocks, 1):
        if not elements:
            continue
        data.createDimension(f"num_el_in_blk{i}", len(elements))
        data.createDimension(f"num_nod_per_el{i}", len(elements[0]))
        connect = data.createVariable(f"connect{i}", "i4", (f"num_el_in_blk{i}", f"num_nod_per_el{i}"))
        connect.elem_type = kind
        connect[:] = np.searchsorted(nodes, elements) + 1
    names(data, "name_nod_var", "num_nod_var", NODES)
    names(data, "name_elem_var", "num_elem_var", ELEMENTS)
    elements = {name: [block for block in of if kept[block - 1]] for name, of in ELEMENTS.items()}
    table = [[block in of for of in elements.values()] for block in range(1, len(BLOCKS) + 1)]
    data.createVariable("elem_var_tab", "i4", ("num_el_blk", "num_elem_var"))[:] = table
    for n in range(1, len(NODES) + 1):
        values = data.createVariable(f"vals_nod_var{n}", real, ("time_step", "num_nodes"), **options)
        for step in range(2):
            values[step, :] = 100 * step + 10 * n + np.array(nodes) - 1
    for n, of in enumerate(elements.values(), 1):
        for block in of:
            shape = ("time_step", f"num_el_in_blk{block}")
            values = data.createVariable(f"vals_elem_var{n}eb{block}", real, shape, **options)
            for step in range(2):
                values[step, :] = 1000 * n + 100 * step + 10 * block + np.arange(len(BLOCKS[block - 1][3]))
    times[:] = [0.25, 1.5]
    data.close()


def main():
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parents[1] / "data/exodus")
    folder.mkdir(parents=True, exist_ok=True)
    write(folder / "cdf1.e", "NETCDF3_CLASSIC", "f8")
    write(folder / "cdf2.e", "NETCDF3_64BIT_OFFSET", "f4")
    write(folder / "cdf5.e", "NETCDF3_64BIT_DATA", "f8")
    write(folder / "netcdf4.e", "NETCDF4", "f4")
    write(folder / "parts.e.2.0", "NETCDF3_64BIT_OFFSET", "f8", part=[1, 2])
    write(folder / "parts.e.2.1", "NETCDF3_64BIT_OFFSET", "f8", part=[3])


main()
