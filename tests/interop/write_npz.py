#!/usr/bin/env python3
"""Writes the .npz files of tests/data/npz with NumPy.

    python3 tests/interop/write_npz.py [FOLDER]

Points are those of a cube; cloud.npz has them without cells, with radii, filled.npz with volumes as well. T of point i at step s is i + 100 s, U has i, 0 and s, and c of cell i is i + 10 s.
"""

import sys
from pathlib import Path

import numpy as np

FOLDER = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parents[1] / "data/npz")
FOLDER.mkdir(parents=True, exist_ok=True)
points = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
cells = np.array([[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7]])
steps, i = np.arange(3)[:, None], np.arange(8)[None, :]
fields = dict(T=i + 100.0 * steps, c=(i[:, :3] + 10 * steps).astype(">i2"), cell_on=(i[:, :3] + steps) % 2 == 0)
fields["U"] = np.stack([i + 0 * steps, 0 * i * steps, 0 * i + steps], 2).astype("f4")
series = dict(points=points, cells=cells, time=[0.25, 0.5, 2.0], **fields)
np.savez(FOLDER / "stored.npz", **series)
np.savez_compressed(FOLDER / "deflated.npz", **series)
lists = dict(types=np.array([12, 10], "u1"), offsets=[0, 8, 12], connectivity=[0, 1, 3, 2, 4, 5, 7, 6, 0, 1, 3, 7])
np.savez(FOLDER / "lists.npz", points=points.astype("f4"), **lists, T=np.arange(8.0), c=np.arange(2))
cloud = dict(points=points, radius=0.1 * (1 + np.arange(8)), time=[0.0, 1.0], T=i + 100.0 * steps[:2])
np.savez(FOLDER / "cloud.npz", **cloud)
np.savez_compressed(FOLDER / "filled.npz", **cloud, volume=0.5 * np.arange(8))
