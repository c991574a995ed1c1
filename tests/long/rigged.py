"""Loads FOLDER/rigged.glb in Blender and compares the evaluated vertices of each pose of FOLDER/poses.json; draws them.

    blender -b --python-exit-code 1 --python tests/long/rigged.py -- FOLDER

A pose has a time of the animation "wave", weights of the shape keys, and the points where the vertices belong.
"""
import json
import math
import pathlib
import sys

import bpy
import mathutils
import numpy

numpy.bool = bool  # Blender 3.4 uses a name that numpy 1.24 has dropped

OFF = 2e-5
MIDDLE, EYE = (0, 0, 1), (2, -6, 2)  # Blender's z is up


def stage():
    """A camera like that of the other programs, a sun and a white world."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 32
    scene.cycles.use_denoising = False
    scene.render.resolution_x = scene.render.resolution_y = 300
    scene.view_settings.view_transform = "Standard"
    scene.render.film_transparent = True
    scene.world = bpy.data.worlds.new("white")
    scene.world.color = (1, 1, 1)
    camera = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 3
    camera.location = EYE
    camera.rotation_euler = (mathutils.Vector(MIDDLE) - mathutils.Vector(EYE)).to_track_quat("-Z", "Y").to_euler()
    scene.collection.objects.link(camera)
    scene.camera = camera
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy = 2
    sun.rotation_euler = (math.radians(40), 0, math.radians(30))
    scene.collection.objects.link(sun)


def take(rig, body, action, time, weights):
    for track in rig.animation_data.nla_tracks:
        track.mute = True
    rig.animation_data.action = action
    keys = body.data.shape_keys
    keys.animation_data_clear()
    assert [block.name for block in keys.key_blocks][1:] == ["smile", "pear", "flat"]
    for block, weight in zip(keys.key_blocks[1:], weights):
        block.value = weight
    scene = bpy.context.scene
    scene.frame_set(int(round(time * scene.render.fps)))
    graph = bpy.context.evaluated_depsgraph_get()
    mesh = body.evaluated_get(graph).to_mesh()
    return numpy.array([body.matrix_world @ vertex.co for vertex in mesh.vertices])


def farthest(points, others):
    return max(numpy.linalg.norm(others - point, axis=1).min() for point in points)


def main():
    folder = pathlib.Path(sys.argv[sys.argv.index("--") + 1])
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(folder / "rigged.glb"))
    rig = next(item for item in bpy.data.objects if item.type == "ARMATURE")
    body = next(item for item in bpy.data.objects if item.type == "MESH" and item.data.shape_keys)
    assert len(rig.data.bones) == 20
    assert len(body.data.materials) == 2 and len(body.data.uv_layers) == 2
    action = next(item for item in bpy.data.actions if item.name.startswith("wave") and item.fcurves[0].data_path.startswith("pose"))
    stage()
    for i, pose in enumerate(json.loads((folder / "poses.json").read_text())):
        got = take(rig, body, action, pose["time"], pose["weights"])
        wanted = numpy.array([(x, -z, y) for x, y, z in pose["points"]])
        assert len(got) == len(wanted), f"{len(got)} vertices, not {len(wanted)}"
        off = max(farthest(got, wanted), farthest(wanted, got))
        assert off < OFF, f"{pose['name']}: a vertex is off by {off}"
        print(f"pose {i}: {len(got)} vertices within {off:.1e}")
        bpy.context.scene.render.filepath = str(folder / f"{i}.png")
        bpy.ops.render.render(write_still=True)


main()
