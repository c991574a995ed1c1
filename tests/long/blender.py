"""Loads the assets of the conformance fixture in Blender: the profile quantized shows the shapes of the float asset.

    asset_fixture FOLDER
    blender -b --python-exit-code 1 --python tests/long/blender.py -- FOLDER

Every vertex of NAME.quantized.glb must be, on every shape key, within position_error of NAME.quantized.json of one vertex
of NAME.glb.
"""
import json
import pathlib
import sys

import bpy
import numpy

numpy.bool = bool  # Blender 3.4 uses a name that numpy 1.24 has dropped


def shapes_of(path):
    """For each mesh: names of its shape keys, and an array of keys × vertices × 3 in the world."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(path))
    found = []
    for item in bpy.data.objects:
        if item.type == "MESH":
            blocks = item.data.shape_keys.key_blocks
            found.append(([block.name for block in blocks],
                          numpy.array([[item.matrix_world @ point.co for point in block.data] for block in blocks])))
    return found


def compare(folder, name):
    bound = json.loads((folder / f"{name}.quantized.json").read_text())["position_error"]
    wanted, got = shapes_of(folder / f"{name}.glb"), shapes_of(folder / f"{name}.quantized.glb")
    assert len(wanted) == len(got) > 0, name
    for (names, places), (other_names, others) in zip(wanted, got):
        assert names == other_names and places.shape == others.shape, name
        for vertex in range(others.shape[1]):
            far = numpy.linalg.norm(places - others[:, vertex:vertex + 1, :], axis=2).max(axis=0).min()
            assert far <= bound * 1.01, f"{name}: vertex {vertex} is off by {far}, more than {bound}"
    print(f"{name}: {sum(places.shape[1] for _, places in got)} vertices within {bound:.1e}")


def main():
    folder = pathlib.Path(sys.argv[sys.argv.index("--") + 1])
    for name in ("two", "six", "dressed", "rigid", "bare", "painted-adaptive"):
        compare(folder, name)


main()
