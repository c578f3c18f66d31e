#!/usr/bin/env python3
"""Marchless beside VTK's vtkFlyingEdges3D, in one run on the same arrays: `pip install vtk numpy`, then run this.

Both mesh all samples of the same unpadded `f32` volume on one thread, with normals, shared points and no gradients or
scalars; both take one-sided gradients at the border. VTK's filter allocates its output anew in every run, as it always
does; ours reuses its buffers. The least time of each counts for the ratio, since what else a machine does only adds.
"""

import argparse
import os
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import numpy
import vtk
from vtk.util.numpy_support import numpy_to_vtk

FIELDS = ["sphere", "terrain", "caves", "white-noise"]
ROOT = Path(__file__).resolve().parents[2]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sizes", metavar="SIZE", type=int, nargs="*", default=[64, 128, 256], help="samples per axis")
    sizes = parser.parse_args().sizes
    fields = build()
    vtk.vtkSMPTools.SetBackend("Sequential")
    vtk.vtkSMPTools.Initialize(1)
    version, backend = vtk.vtkVersion().GetVTKVersion(), vtk.vtkSMPTools.GetBackend()
    print(f"VTK {version}, {backend} backend; least (median) of the runs\n")
    print("| field       | samples | triangles | marchless              | VTK                    | ratio |")
    print("|-------------|---------|-----------|------------------------|------------------------|-------|")
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([fields, "export", folder, *map(str, sizes)], check=True)
        for field in FIELDS:
            for size in sizes:
                path = Path(folder, f"{field}-{size}.f32")
                # White noise at 256³ takes VTK seconds.
                runs = max(5, 64**3 * 50 // size**3)
                ours = marchless(fields, path, size, runs)
                theirs = flying_edges(path, size, runs)
                row = f"| {field:11} | {f'{size}³':7} | {ours['triangles']:9} "
                row += f"| {shown(ours):22} | {shown(theirs):22} | {theirs['least'] / ours['least']:5.1f} |"
                print(row, flush=True)
                if ours["vertices"] != theirs["vertices"]:
                    print(f"  VTK has {theirs['vertices']} vertices, we have {ours['vertices']}")


def build():
    """Builds the program that exports the fields and times ours; its path."""
    command = ["cargo", "build", "--release", "--quiet", "--package", "marchless_benches", "--bin", "fields"]
    subprocess.run(command, cwd=ROOT, check=True)
    return Path(ROOT, os.environ.get("CARGO_TARGET_DIR", "target"), "release", "fields")


def marchless(fields, path, size, runs):
    command = [fields, "time", path, str(size), str(runs)]
    answer = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
    return {
        "least": float(answer[0]),
        "median": float(answer[1]),
        "vertices": int(answer[2]),
        "triangles": int(answer[3]),
    }


def flying_edges(path, size, runs):
    samples = numpy.fromfile(path, dtype="<f4")
    image = vtk.vtkImageData()
    image.SetDimensions(size, size, size)
    image.GetPointData().SetScalars(numpy_to_vtk(samples, deep=False))
    surface = vtk.vtkFlyingEdges3D()
    surface.SetInputData(image)
    surface.SetValue(0, 0.0)
    surface.ComputeNormalsOn()
    surface.ComputeGradientsOff()
    surface.ComputeScalarsOff()
    surface.InterpolateAttributesOff()
    surface.Update()
    times = []
    for _ in range(runs):
        surface.Modified()
        start = time.perf_counter()
        surface.Update()
        times.append(time.perf_counter() - start)
    mesh = surface.GetOutput()
    return {"least": min(times), "median": statistics.median(times), "vertices": mesh.GetNumberOfPoints()}


def shown(times):
    return f"{times['least'] * 1e3:.3f} ({times['median'] * 1e3:.3f}) ms"


if __name__ == "__main__":
    main()
