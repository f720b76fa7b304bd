#!/usr/bin/env python3
"""A tornado whose wind moves, in tetreel and in VTK: as many splats as VTK has arrows, and stream tubes, over the volume of the pressure.

    python3 benches/flow_vtk.py TETREEL [CELLS [ARROWS [FRAMES [SIZE [PICTURES]]]]]

Needs vtk. TETREEL is a release build; PICTURES is a folder for what is drawn. VTK's volume is that of projected tetrahedra, its arrows are
glyphs of vtkArrowSource (6 sides) at vertices by lot, its tubes (6 sides) follow 200 stream lines from the bottom. A frame is: pressure and
wind of the next step, drawn, in memory.
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from vtkmodules.vtkCommonCore import vtkUnsignedCharArray
from vtkmodules.vtkCommonDataModel import vtkPiecewiseFunction
from vtkmodules.vtkFiltersCore import vtkGlyph3D, vtkMaskPoints, vtkTubeFilter
from vtkmodules.vtkFiltersFlowPaths import vtkStreamTracer
from vtkmodules.vtkFiltersSources import vtkArrowSource, vtkPointSource
from vtkmodules.vtkIOImage import vtkPNGWriter
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader
import vtkmodules.vtkRenderingVolumeOpenGL2  # noqa: F401, draws the volume
from vtkmodules.vtkRenderingCore import (
    vtkActor,
    vtkColorTransferFunction,
    vtkPolyDataMapper,
    vtkRenderer,
    vtkRenderWindow,
    vtkVolume,
    vtkWindowToImageFilter,
)

from vtkmodules.vtkRenderingVolume import vtkProjectedTetrahedraMapper

TETREEL = sys.argv[1]
USUAL = ((2, 100_000), (3, 20_000), (4, 5), (5, 512))
CELLS, ARROWS, FRAMES, SIZE = (int(sys.argv[i]) if len(sys.argv) > i else usual for i, usual in USUAL)
PICTURES = Path(sys.argv[6]) if len(sys.argv) > 6 else None
STEPS = 8
# The tornado is a box of 10^3; the camera is the same in both.
EYE, FOCAL, ANGLE = (0.0, -26.0, 9.0), (0.0, 0.0, 5.0), 30.0
# Pressure up to which something is seen, from its least; opacity there, of a way of 1.
SEEN, OPACITY = 0.5, 0.1


class Vtk:
    """The volume with arrows or tubes, or alone."""

    def __init__(self, steps, kind):
        self.steps, self.grid = steps, steps[0].NewInstance()
        self.grid.ShallowCopy(steps[0])
        low, high = steps[0].GetPointData().GetArray("pressure").GetRange()
        renderer, self.window = vtkRenderer(), vtkRenderWindow()
        renderer.AddVolume(self.volume(low, low + SEEN * (high - low)))
        if kind:
            renderer.AddActor(self.arrows() if kind == "arrows" else self.tubes())
        camera = renderer.GetActiveCamera()
        camera.SetPosition(EYE)
        camera.SetFocalPoint(FOCAL)
        camera.SetViewUp(0, 0, 1)
        camera.SetViewAngle(ANGLE)
        self.window.SetOffScreenRendering(True)
        self.window.SetMultiSamples(0)
        self.window.SetSize(SIZE, SIZE)
        self.window.AddRenderer(renderer)
        renderer.ResetCameraClippingRange()
        self.image = vtkUnsignedCharArray()

    def volume(self, low, high):
        mapper, volume = vtkProjectedTetrahedraMapper(), vtkVolume()
        mapper.SetInputData(self.grid)
        colors, opacity = vtkColorTransferFunction(), vtkPiecewiseFunction()
        colors.AddRGBPoint(low, 0.3, 0.1, 0.5)
        colors.AddRGBPoint(high, 0.9, 0.9, 0.3)
        opacity.AddPoint(low, OPACITY)
        opacity.AddPoint(high, 0.0)
        volume.GetProperty().SetColor(colors)
        volume.GetProperty().SetScalarOpacity(opacity)
        volume.SetMapper(mapper)
        return volume

    def arrows(self):
        mask, arrow, glyph = vtkMaskPoints(), vtkArrowSource(), vtkGlyph3D()
        mask.SetInputData(self.grid)
        mask.SetMaximumNumberOfPoints(ARROWS)
        mask.RandomModeOn()
        mask.SetRandomModeType(2)
        glyph.SetInputConnection(mask.GetOutputPort())
        glyph.SetSourceConnection(arrow.GetOutputPort())
        glyph.SetVectorModeToUseVector()
        glyph.SetScaleModeToDataScalingOff()
        glyph.SetScaleFactor(0.4)
        glyph.SetInputArrayToProcess(1, 0, 0, 0, "velocity")
        return self.actor(glyph)

    def tubes(self):
        seeds, lines, tubes = vtkPointSource(), vtkStreamTracer(), vtkTubeFilter()
        seeds.SetCenter(0, 0, 1)
        seeds.SetRadius(4)
        seeds.SetNumberOfPoints(200)
        lines.SetInputData(self.grid)
        lines.SetSourceConnection(seeds.GetOutputPort())
        lines.SetInputArrayToProcess(0, 0, 0, 0, "velocity")
        lines.SetMaximumPropagation(30)
        tubes.SetInputConnection(lines.GetOutputPort())
        tubes.SetRadius(0.03)
        tubes.SetNumberOfSides(6)
        return self.actor(tubes)

    def actor(self, source):
        mapper, actor = vtkPolyDataMapper(), vtkActor()
        mapper.SetInputConnection(source.GetOutputPort())
        mapper.ScalarVisibilityOff()
        actor.SetMapper(mapper)
        actor.GetProperty().SetColor(1.0, 0.5, 0.1)
        return actor

    def frame(self, step):
        start = time.perf_counter()
        self.grid.ShallowCopy(self.steps[step % STEPS])
        self.window.Render()
        self.window.GetRGBACharPixelData(0, 0, SIZE - 1, SIZE - 1, 0, self.image)
        return 1e3 * (time.perf_counter() - start)

    def save(self, path):
        picture, writer = vtkWindowToImageFilter(), vtkPNGWriter()
        picture.SetInput(self.window)
        writer.SetInputConnection(picture.GetOutputPort())
        writer.SetFileName(str(path))
        writer.Write()


def tetreel(*words):
    return subprocess.run([TETREEL, *map(str, words)], check=True, capture_output=True, text=True).stdout


def read(folder):
    steps = []
    for path in sorted((folder / "t").glob("*.vtu")):
        reader = vtkXMLUnstructuredGridReader()
        reader.SetFileName(str(path))
        reader.Update()
        step = reader.GetOutput()
        step.GetPointData().SetActiveScalars("pressure")
        step.GetPointData().SetActiveVectors("velocity")
        steps.append(step)
    return steps


def main(folder):
    store = folder / "t.zarr"
    tetreel("synth", "tornado", "--cells", CELLS, "--steps", STEPS, "-o", store)
    tetreel("export", store, "-o", folder / "t.pvd")
    steps = read(folder)
    point = lambda at: ",".join(map(str, at))
    look = ["--field", "pressure", "--backend", "cpu", "--size", f"{SIZE}x{SIZE}", "--unit-distance", 1]
    look += ["--camera", f"pos={point(EYE)} focal={point(FOCAL)} up=0,0,1 angle={ANGLE}"]
    look += ["--tf", f"viridis@0:{OPACITY},{SEEN}:0,1:0"]
    flow = [*look, "--flow", "velocity", "--flow-splats", min(ARROWS, steps[0].GetNumberOfPoints()), "--flow-icon", "arrows"]
    peers = {"VTK, volume alone": None, "VTK, arrows": "arrows", "VTK, stream tubes": "tubes"}
    peers = {name: Vtk(steps, kind) for name, kind in peers.items()}
    options = {"tetreel, volume alone": look, "tetreel, flow": flow, "tetreel, flow without volume": [*flow, "--no-volume"]}
    times = {name: [] for name in [*options, *peers]}
    for peer in peers.values():
        peer.frame(0), peer.frame(1)
    for turn in range(3):
        for name, peer in peers.items():
            times[name] += [peer.frame(2 + turn * FRAMES + i) for i in range(FRAMES)]
        for name, words in options.items():
            tetreel("bench", store, *words, "--frames", FRAMES, "--json", folder / "b.json")
            runs = json.loads((folder / "b.json").read_text())["runs"]
            times[name] += [run["ms"]["p50"] for run in runs if run["time_moves"] and not run["camera_moves"]]
    if PICTURES:
        for name, peer in peers.items():
            peer.save(PICTURES / f"{name}.png")
        for name, words in options.items():
            last = (1 + 3 * FRAMES) % STEPS
            tetreel("render", store, "-o", PICTURES / f"{name}.png", "--steps", last, *words)
    cells, vertices = steps[0].GetNumberOfCells(), steps[0].GetNumberOfPoints()
    print(f"{cells} cells, {vertices} vertices, {min(ARROWS, vertices)} arrows, {SIZE} x {SIZE}")
    for name, ms in times.items():
        ms.sort()
        print(f"{name}: {ms[len(ms) // 2]:.1f} ms ({ms[0]:.1f} to {ms[-1]:.1f})")


with tempfile.TemporaryDirectory() as folder:
    main(Path(folder))
