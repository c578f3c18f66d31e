#!/usr/bin/env python3
"""Extractors that Python packages offer, judged like those that are crates.

`pip install vtk scikit-image PyMCubes`, then run this. The bench `soundness` writes its fields, everyone here meshes
them as they come, at 0, and the bench judges all meshes (positions as `f32`) and prints its tables; with
`MARCHLESS_RECORD=1` it also writes them down. Each field is meshed in a process of its own, so that a crash counts as
no mesh and nothing more.
"""

import multiprocessing
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

import mcubes
import numpy
import skimage.measure
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

ROOT = Path(__file__).resolve().parents[2]
BENCH = ["cargo", "bench", "--package", "marchless_benches", "--bench", "soundness", "--"]


def main():
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([*BENCH, "--write", folder], cwd=ROOT, check=True)
        for name, extract in EXTRACTORS.items():
            meshes = Path(folder, "meshes", name)
            meshes.mkdir(parents=True)
            for field in sorted(Path(folder, "fields").iterdir()):
                process = multiprocessing.Process(target=mesh, args=[extract, field, meshes / f"{field.stem}.mesh"])
                process.start()
                process.join()
            print(f"{name}: {len(list(meshes.iterdir()))} meshes", file=sys.stderr)
        subprocess.run([*BENCH, "--judge", folder], cwd=ROOT, check=True)


def mesh(extract, field, path):
    """Writes a field's mesh, if there is one; `field` is `[z][y][x]`, the mesh in any order of axes."""
    samples = numpy.fromfile(field, dtype="<f4")
    size = round(samples.size ** (1 / 3))
    try:
        positions, triangles = extract(samples.reshape(size, size, size))
    except (RuntimeError, ValueError):
        return
    with path.open("wb") as file:
        numpy.array([len(positions)], dtype="<u4").tofile(file)
        numpy.asarray(positions, dtype="<f4").tofile(file)
        numpy.asarray(triangles, dtype="<u4").tofile(file)


def vtk_filter(make):
    def extract(field):
        image = vtk.vtkImageData()
        image.SetDimensions(field.shape[::-1])
        image.GetPointData().SetScalars(numpy_to_vtk(field.ravel(), deep=True))
        surface = make()
        surface.SetInputData(image)
        surface.SetValue(0, 0.0)
        surface.ComputeNormalsOff()
        surface.Update()
        mesh = surface.GetOutput()
        if mesh.GetNumberOfPoints() == 0:
            raise ValueError("no mesh")
        positions = vtk_to_numpy(mesh.GetPoints().GetData())
        return positions, vtk_to_numpy(mesh.GetPolys().GetConnectivityArray())

    return extract


def scikit_image(method):
    def extract(field):
        return skimage.measure.marching_cubes(field, 0.0, gradient_direction="ascent", method=method)[:2]

    return extract


EXTRACTORS = {
    f"VTK {version('vtk')}, `vtkFlyingEdges3D`": vtk_filter(vtk.vtkFlyingEdges3D),
    f"VTK {version('vtk')}, `vtkMarchingCubes`": vtk_filter(vtk.vtkMarchingCubes),
    f"VTK {version('vtk')}, `vtkSynchronizedTemplates3D`": vtk_filter(vtk.vtkSynchronizedTemplates3D),
    f"scikit-image {version('scikit-image')}, Lewiner": scikit_image("lewiner"),
    f"scikit-image {version('scikit-image')}, Lorensen": scikit_image("lorensen"),
    f"PyMCubes {version('PyMCubes')}": lambda field: mcubes.marching_cubes(field, 0.0),
}


if __name__ == "__main__":
    main()
