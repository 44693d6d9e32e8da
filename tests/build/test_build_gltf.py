#!/usr/bin/env python3
"""glTF through the whole builder: what its scene graph says arrives in the container, and is verified against it."""
import json
import os
import sys
import time

from building import assert_refused, build, check_result, must, run, run_tests, write_grid_obj

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "readers"))
import gltf_writer as w  # noqa: E402


def sheet(side, places, **primitive):
    """A bumpy square of 2 side^2 triangles at each of the places."""
    points = [(x / 8, (x * 7 + y * 3) % 5 / 16, y / 8) for y in range(side + 1) for x in range(side + 1)]
    corners = [y * (side + 1) + x + c for y in range(side) for x in range(side)
               for c in (0, side + 1, 1, 1, side + 1, side + 2)]
    model = w.Model()
    mesh = model.mesh({"attributes": {"POSITION": model.accessor(points, w.FLOAT)},
                       "indices": model.accessor(corners, w.U32), **primitive})
    model.scene(*[model.node(mesh=mesh, name=f"sheet {i}", translation=place) for i, place in enumerate(places)])
    return model


def placements_are_built_and_verified(folder):
    model = sheet(30, [(10 * i, 0, i) for i in range(9)], material=0)
    model.add("materials", {"name": "red", "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}})
    model.glb(f"{folder}/sheets.glb")
    result = build(f"{folder}/sheets.glb", f"{folder}/sheets.stroll")
    check_result(result)
    assert (result["triangles_in"], result["parts"], result["materials"]) == (1800, 10, 1), result
    assert (result["trees"], result["placements"], result["triangles_placed"]) == (1, 9, 9 * 1800), result
    must("verify", f"{folder}/sheets.stroll", "--against", f"{folder}/sheets.glb")
    info = json.loads(must("info", f"{folder}/sheets.stroll", "--json").output)
    assert (info["unit"], info["up"]) == ("m", "y"), info
    build(f"{folder}/sheets.glb", f"{folder}/sheets.stroll", "--unit", "in", "--up", "z")
    info = json.loads(must("info", f"{folder}/sheets.stroll", "--json").output)
    assert (info["unit"], info["up"]) == ("in", "z"), info


def containers_of_the_same_model_are_the_same_for_any_number_of_threads(folder):
    sheet(40, [(10 * i, 0, 0) for i in range(9)]).gltf(f"{folder}/sheets.gltf", [("a.bin", "a.bin")])
    for jobs in ("1", "2", "8"):
        build(f"{folder}/sheets.gltf", f"{folder}/{jobs}.stroll", "--jobs", jobs)
    first = open(f"{folder}/1.stroll", "rb").read()
    assert all(open(f"{folder}/{jobs}.stroll", "rb").read() == first for jobs in "28")


def inputs_that_disagree_about_the_unit_are_refused(folder):
    sheet(4, [(0, 0, 0)]).glb(f"{folder}/a.glb")
    write_grid_obj(f"{folder}/b.obj", 4)
    words = ("build", f"{folder}/a.glb", f"{folder}/b.obj", "-o", f"{folder}/out.stroll")
    assert_refused(run(*words), "a.glb", "b.obj", "disagree about the unit (m and unknown): say --unit")
    must(*words, "--unit", "m")


def an_expansion_that_no_disk_holds_is_refused_before_it_is_read(folder):
    model = w.Model()
    zeros = model.add("accessors", {"componentType": w.FLOAT, "type": "VEC3", "count": 4294967295})
    mesh = model.mesh(*[{"attributes": {"POSITION": zeros}}] * 100)
    model.scene(*[model.node(mesh=mesh) for _ in range(1000)])
    model.glb(f"{folder}/zeros.glb")
    begun = time.monotonic()
    assert_refused(run("build", f"{folder}/zeros.glb", "-o", f"{folder}/out.stroll", timeout=60),
                   "the scratch of 143165576500 triangles", "--scratch")
    assert time.monotonic() - begun < 30 and os.listdir(folder) == ["zeros.glb"], os.listdir(folder)


run_tests(placements_are_built_and_verified, containers_of_the_same_model_are_the_same_for_any_number_of_threads,
          inputs_that_disagree_about_the_unit_are_refused, an_expansion_that_no_disk_holds_is_refused_before_it_is_read)
