#!/usr/bin/env python3
"""A cloud of balls whose scalars move, in tetreel and in VTK's point Gaussian mapper: time of a frame, and error against an exact sum.

    python3 benches/points_vtk.py TETREEL [POINTS [FRAMES [SIZE]]]

Needs numpy and vtk. TETREEL is a release build. The mapper draws the balls by a shader of their chords, in place of its Gaussians: as
VTK is set (weighted averages, whatever the order), blended in the order of the file, and blended after the script has sorted the points
from back to front, once: the camera stands still. A frame is: the scalars of the next step, drawn, in memory. The exact sum is in
float64, over all balls that a ray meets, cut where they overlap: emission and extinction are those of the balls at each point. Errors are
over 400 pixels and the four channels, premultiplied. VTK blends in 8 bits.
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkPoints, vtkUnsignedCharArray
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkIOImage import vtkPNGReader
from vtkmodules.vtkRenderingCore import vtkActor, vtkColorTransferFunction, vtkRenderer, vtkRenderWindow
from vtkmodules.vtkRenderingOpenGL2 import vtkOpenGLPointGaussianMapper

TETREEL = sys.argv[1]
POINTS, FRAMES, SIZE = (int(sys.argv[i]) if len(sys.argv) > i else usual for i, usual in ((2, 1_000_000), (3, 15), (4, 512)))
STEPS = 8
# Balls are three pixels wide in the usual image; their volumes add up to half of the cube.
RADIUS, TAU = 0.01 * (1e6 / POINTS) ** (1 / 3), 2.0
EYE, ANGLE = np.array([0.0, 0.0, 6.0]), 30.0
LAST = (2 + 3 * FRAMES) % STEPS


def cloud():
    random = np.random.default_rng(1)
    points = random.uniform(-1, 1, (POINTS, 3)).astype("f4")
    x, y, z = points.T.astype("f8")
    moving = lambda t: 0.5 + 0.5 * np.sin(5 * x + 3 * z + t) * np.cos(4 * y - 0.5 * t)
    return points, np.stack([moving(0.7 * step) for step in range(STEPS)]).astype("f4")


def exact(points, scalars, pixels):
    """Premultiplied colour, which is the scalar in all channels, and opacity of pixels (column, row from the top)."""
    out = []
    for column, row in pixels:
        across = np.array([column + 0.5 - SIZE / 2, SIZE / 2 - row - 0.5]) / (SIZE / 2) * np.tan(np.radians(ANGLE / 2))
        ray = np.array([*across, -1.0]) / np.hypot(1, np.hypot(*across))
        to = points.astype("f8") - EYE
        middle = to @ ray
        square = RADIUS**2 - ((to - middle[:, None] * ray) ** 2).sum(1)
        hit = np.flatnonzero(square > 0)
        half = np.sqrt(square[hit])
        ends = np.concatenate([middle[hit] - half, middle[hit] + half])
        order = np.argsort(ends)
        sign = np.repeat([1.0, -1.0], len(hit))[order]
        inside = np.cumsum(sign)[:-1]
        light = np.cumsum(sign * np.tile(scalars[hit].astype("f8"), 2)[order])[:-1]
        depth = TAU * inside * np.diff(ends[order])
        before = np.exp(-np.concatenate([[0], np.cumsum(depth)]))
        color = np.sum(before[:-1] * -np.expm1(-depth) * light / np.maximum(inside, 1)) if len(hit) else 0.0
        out.append([color] * 3 + [1 - before[-1]])
    return np.array(out)


class Vtk:
    """The mapper; `blended` in the order of the points."""

    def __init__(self, points, scalars, blended):
        self.steps = [numpy_to_vtk(step, deep=True) for step in scalars]
        self.data, places = vtkPolyData(), vtkPoints()
        places.SetData(numpy_to_vtk(points, deep=True))
        self.data.SetPoints(places)
        self.data.GetPointData().SetScalars(self.steps[0])
        colors = vtkColorTransferFunction()
        colors.AddRGBPoint(0, 0, 0, 0)
        colors.AddRGBPoint(1, 1, 1, 1)
        mapper = vtkOpenGLPointGaussianMapper()
        mapper.SetInputData(self.data)
        mapper.SetLookupTable(colors)
        mapper.EmissiveOff()
        mapper.SetScaleFactor(RADIUS)
        mapper.SetBoundScale(1.0)
        mapper.SetSplatShaderCode(
            "//VTK::Color::Impl\nfloat d2 = dot(offsetVCVSOutput.xy, offsetVCVSOutput.xy);\nif (d2 > 1.0) { discard; }\n"
            f"opacity = 1.0 - exp(-{2 * TAU * RADIUS!r} * sqrt(1.0 - d2));\n"
        )
        actor, renderer, self.window = vtkActor(), vtkRenderer(), vtkRenderWindow()
        actor.SetMapper(mapper)
        actor.ForceTranslucentOn()
        actor.GetProperty().LightingOff()
        renderer.AddActor(actor)
        renderer.SetUseOIT(not blended)
        camera = renderer.GetActiveCamera()
        camera.SetPosition(EYE)
        camera.SetFocalPoint(0, 0, 0)
        camera.SetViewAngle(ANGLE)
        camera.SetClippingRange(1, 20)
        self.window.SetOffScreenRendering(True)
        self.window.SetMultiSamples(0)
        self.window.SetAlphaBitPlanes(1)
        self.window.SetSize(SIZE, SIZE)
        self.window.AddRenderer(renderer)
        renderer.SetBackgroundAlpha(0)
        self.image = vtkUnsignedCharArray()

    def frame(self, step):
        start = time.perf_counter()
        self.data.GetPointData().SetScalars(self.steps[step % STEPS])
        self.data.Modified()
        self.window.Render()
        self.window.GetRGBACharPixelData(0, 0, SIZE - 1, SIZE - 1, 0, self.image)
        return 1e3 * (time.perf_counter() - start)

    def pixels(self):
        return vtk_to_numpy(self.image).reshape(SIZE, SIZE, 4)[::-1] / 255.0


def tetreel(*words):
    return subprocess.run([TETREEL, *map(str, words)], check=True, capture_output=True, text=True).stdout


def main(folder):
    points, scalars = cloud()
    np.savez(folder / "c.npz", points=points, time=np.arange(STEPS, dtype=float), s=scalars, radius=np.full(POINTS, RADIUS))
    tetreel("import", folder / "c.npz", "-o", folder / "c.zarr", "--field", "s")
    look = ["--tf", "gray@0:1,1:1", "--range", "0,1", "--opacity-kind", "extinction", "--unit-distance", 1 / TAU]
    look += ["--camera", f"pos=0,0,{EYE[2]} focal=0,0,0 up=0,1,0 angle={ANGLE}", "--backend", "cpu", "--size", f"{SIZE}x{SIZE}"]
    back = np.argsort(points[:, 2])
    peers = {
        "VTK as it comes": Vtk(points, scalars, False),
        "VTK, blended in the order of the file": Vtk(points, scalars, True),
        "VTK, blended, sorted once": Vtk(points[back], scalars[:, back], True),
    }
    times = {name: [] for name in ["tetreel", *peers]}
    for peer in peers.values():
        peer.frame(0), peer.frame(1)
    for turn in range(3):
        for name, peer in peers.items():
            times[name] += [peer.frame(2 + turn * FRAMES + i) for i in range(FRAMES)]
        tetreel("bench", folder / "c.zarr", *look, "--frames", FRAMES, "--json", folder / "b.json")
        runs = json.loads((folder / "b.json").read_text())["runs"]
        times["tetreel"] += [run["ms"]["p50"] for run in runs if run["time_moves"] and not run["camera_moves"]]
    [peer.frame(LAST) for peer in peers.values()]
    tetreel("render", folder / "c.zarr", "-o", folder / "f.png", "--steps", LAST, "--bit-depth", 16, *look)
    reader = vtkPNGReader()
    reader.SetFileName(str(folder / "f.png"))
    reader.Update()
    of_tetreel = vtk_to_numpy(reader.GetOutput().GetPointData().GetScalars()).reshape(SIZE, SIZE, -1)[::-1] / 65535.0
    pixels = [(SIZE // 4 + i * 73 % (SIZE // 2), SIZE // 4 + i * 151 % (SIZE // 2)) for i in range(400)]
    truth = exact(points, scalars[LAST], pixels)
    print(f"{POINTS} points, {SIZE} x {SIZE}, opacity {truth[:, 3].mean():.3f} in the mean")
    for name, ms in times.items():
        image = of_tetreel if name == "tetreel" else peers[name].pixels()
        of = np.array([image[row, column] for column, row in pixels])
        if name == "tetreel":
            of[:, :3] *= of[:, 3:]
        off = of - truth
        error = f"RMSE {np.sqrt((off**2).mean()):.1e}, max {abs(off).max():.1e}"
        print(f"{name}: {np.median(ms):.1f} ms ({min(ms):.1f} to {max(ms):.1f}), {error}")


with tempfile.TemporaryDirectory() as folder:
    main(Path(folder))
