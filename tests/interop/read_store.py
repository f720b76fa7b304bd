"""Opens a store with nothing but zarr and numpy, checks how its arrays fit together, and prints a checksum of a step.

usage: read_store.py STORE.zarr FIELD STEP
"""

import sys
import zlib

import numpy as np
import zarr


def field_group(fields, name):
    """The group of a field, found by the name in its attributes."""
    for folder in fields.attrs["folders"]:
        if fields[folder].attrs["name"] == name:
            return fields[folder]
    raise SystemExit(f"no field {name}")


def check_mesh(mesh):
    points, tets = mesh["points"][:], mesh["tets"][:]
    faces, face_cells, neighbours = mesh["faces"][:], mesh["face_cells"][:], mesh["neighbours"][:]
    vertices, cells = len(points), len(tets)
    assert points.dtype == np.float32 and points.shape == (vertices, 3)
    assert tets.shape == (cells, 4) and tets.max() < vertices
    assert faces.shape == (len(faces), 3) and face_cells.shape == (len(faces), 2)
    assert neighbours.shape == (cells, 4)
    assert mesh["vertex_permutation"].shape == (vertices,)
    assert mesh["cell_permutation"].shape == (cells,)
    if "cell_turned" in mesh:  # only where the import turned some
        turned = mesh["cell_turned"][:]
        assert turned.shape == (cells,) and turned.any() and turned.max() == 1
    # Every tet is positively oriented in world coordinates.
    world = np.array(mesh["points"].attrs["origin"]) + mesh["points"].attrs["scale"] * points.astype(np.float64)
    if "source_points" in mesh:  # only where the rounded points do not give those of the source back
        source = mesh["source_points"][:].astype(np.float64)
        assert source.shape == (vertices, 3)
        half_ulp = mesh["points"].attrs["scale"] * 2.0**-25 + np.abs(world) * 2.0**-52  # of f32 and of the sum above
        assert (np.abs(source - world) <= half_ulp).all() and (source != world).any()
    a, b, c, d = (world[tets[:, i]] for i in range(4))
    assert (np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a)) > 0).all()
    print(f"mesh {cells} cells {vertices} vertices {len(faces)} faces")
    return vertices


def check_field(group, steps, vertices):
    ranges = group["range_per_step"][:]
    assert ranges.shape == (steps, 2)
    mean, variance, count = group["moments"][:]
    assert mean.shape == (vertices,) and (count <= steps).all()
    assert (variance[count > 0] >= 0).all()
    if "histograms" in group:  # only of stores that were imported at once
        check_histograms(group["histograms"], steps, vertices)
    if group.attrs["codec"] == "magnitude":
        assert group.attrs["magnitude_of"]
        return
    if group.attrs["codec"] == "vq":
        check_vq(group, steps, vertices)
        return
    raw = group["raw"]
    assert raw.shape == (steps, vertices) and raw.dtype == np.float32
    for step in range(steps):
        values = raw[step]
        finite = values[np.isfinite(values)]
        expected = [finite.min(), finite.max()] if len(finite) else [np.nan, np.nan]
        np.testing.assert_array_equal(ranges[step], np.array(expected, np.float32))


def check_histograms(group, steps, vertices):
    for name, shape, samples in [
        ("scalar", (256,), steps * vertices),
        ("scalar_gradient", (64, 256), None),  # of cells
        ("cov", (256,), vertices),
        ("scalar_cov", (64, 256), steps * vertices),
    ]:
        counts = group[name]
        assert counts.shape == shape and counts.dtype == np.uint64 and counts.attrs["steps"] == steps
        total = counts[:].sum() + counts.attrs["nonfinite"]
        assert samples is None or total == samples
        for axis in ["x_range", "y_range"]:
            ends = counts.attrs[axis]
            assert ends is None or ends[0] <= ends[1]


def decode_vq(group, step):
    """One step of a field with codec vq."""
    vq, p = group["vq"], group.attrs["codec_parameters"]
    b, j = divmod(step, p["block"])
    difference = vq["cb8"][b, p["group"][j]][vq["i8"][b]] + vq["cb64"][b, j][vq["i64"][b]]
    if p["exponents"]:
        difference *= np.ldexp(np.float32(1), vq["exponent"][b])
    values = vq["mean"][b] + difference
    if p["specials"]:  # NaN and infinities
        start, end = vq["special_start"][b : b + 2]
        for vertex, first, count, bits in vq["special"][start:end]:
            if first <= step < first + count:
                values.view(np.uint32)[vertex] = bits
    return values


def check_vq(group, steps, vertices):
    ranges = group["range_per_step"][:]
    limit = group.attrs["quality"]["max_error"]
    for step in {0, steps // 2, steps - 1}:
        values = decode_vq(group, step)
        assert values.shape == (vertices,) and values.dtype == np.float32
        finite = values[np.isfinite(values)].astype(np.float64)
        # Each end of the decoded range is within the error of that of the source.
        assert len(finite) == 0 or (np.abs([finite.min(), finite.max()] - ranges[step]) <= limit).all()


def decode(group, step):
    return decode_vq(group, step) if group.attrs["codec"] == "vq" else group["raw"][step]


def count_arrays(group):
    return sum(1 if isinstance(node, zarr.Array) else count_arrays(node) for _, node in group.members())


def main(path, name, step):
    root = zarr.open_group(path, mode="r")
    assert root.attrs["tetreel_store"].startswith("1.")
    vertices = check_mesh(root["mesh/0"])
    times = root["time/values"][:]
    assert times.dtype == np.float64 and (np.diff(times) > 0).all()
    assert (root["time/mesh_index"][:] == 0).all()
    for folder in root["fields"].attrs["folders"]:
        check_field(root["fields"][folder], len(times), vertices)
    values = decode(field_group(root["fields"], name), step)
    print(f"{name} step {step} crc32 {zlib.crc32(values.astype('<f4').tobytes()):08x}")
    print(f"ok {count_arrays(root)} arrays")


if __name__ == "__main__":
    if len(sys.argv) != 4:
        raise SystemExit(__doc__)
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
