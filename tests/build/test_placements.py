#!/usr/bin/env python3
"""Models whose parts are used again and again: trees and placements instead of copies. The container of one equals that of its
expansion, whose uses have meshes of their own."""
import json
import math
import os
import sys

from building import build, check_result, must, run, run_tests

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "readers"))
import gltf_writer as w  # noqa: E402

BALL = 40 * 60 * 2


def ball(model, rings=40, sectors=60):
    """Accessors of a bumpy closed ball of 2 rings sectors triangles, less those at the poles."""
    points = [((1 + 0.1 * math.sin(5 * f) * math.sin(3 * t)) * math.sin(t) * math.cos(f), math.sin(t) * math.sin(f), 1.5 * math.cos(t))
              for i in range(rings + 1) for j in range(sectors)
              for t, f in [(math.pi * i / rings, 2 * math.pi * j / sectors)]]
    faces = [i * sectors + c for i in range(rings) for j in range(sectors)
             for c in (j, j + sectors, (j + 1) % sectors, (j + 1) % sectors, j + sectors, (j + 1) % sectors + sectors)]
    return {"attributes": {"POSITION": model.accessor(points, w.FLOAT)}, "indices": model.accessor(faces, w.U32), "material": 0}


def assembly(path, is_shared, shift=0.0):
    """Balls under nodes that turn, mirror, nest and instance, and a plate that is there once."""
    model = w.Model()
    model.add("materials", {"name": "red", "pbrMetallicRoughness": {"baseColorFactor": [0.7, 0.1, 0.1, 1]}})
    primitive = ball(model)
    meshes = [model.mesh(primitive, name="ball")]

    def mesh():
        if not is_shared and model.json.get("nodes"):
            meshes.append(model.mesh(dict(primitive)))
        return meshes[-1]

    plate = [(x, y, -2 + math.sin(x) / 4) for y in range(-9, 10) for x in range(-9, 10)]
    faces = [y * 19 + x + c for y in range(18) for x in range(18) for c in (0, 1, 19, 1, 20, 19)]
    roots = [model.node(mesh=model.mesh({"attributes": {"POSITION": model.accessor(plate, w.FLOAT)},
                                         "indices": model.accessor(faces, w.U32)}), name="plate")]
    for i in range(12):
        child = model.node(mesh=mesh(), translation=[0, 0, 2.5], scale=[0.5, 0.5, 0.5])
        mirror = -1 if i % 3 == 0 else 1
        roots.append(model.node(mesh=mesh(), translation=[i % 4 * 4 - 6 + shift, i // 4 * 5 - 5, 0], scale=[mirror, 1, 1],
                                rotation=[0, 0, math.sin(i), math.cos(i)], children=[child]))
    moves = [(i % 5 * 3 - 6, i // 5 * 3 - 6, 6) for i in range(25)]
    if is_shared:
        attributes = {"TRANSLATION": model.accessor(moves, w.FLOAT)}
        roots.append(model.node(mesh=mesh(), extensions={"EXT_mesh_gpu_instancing": {"attributes": attributes}}))
    else:
        roots += [model.node(mesh=mesh(), translation=list(move)) for move in moves]
    model.json["extensionsUsed"] = ["EXT_mesh_gpu_instancing"]
    model.scene(*roots)
    model.glb(path)


def check_images(reference, folder):
    """Coverage is exact; of depth only little differs, at silhouettes (as it does for the expansion)."""
    found = json.loads(run("compare", reference, folder, "--json").output)
    assert (found["uncovered_pixels"], found["overcovered_pixels"]) == (0, 0), found
    assert found["depth_within"] > 0.997 and found["psnr_median_db"] > 38, found


def assert_flawed(done, part):
    assert done.code == 1 and part in done.error and "NOT good" in done.output, done


def a_model_and_its_expansion_look_the_same(folder):
    assembly(f"{folder}/shared.glb", True)
    assembly(f"{folder}/whole.glb", False)
    shared = build(f"{folder}/shared.glb", f"{folder}/shared.stroll")
    whole = build(f"{folder}/whole.glb", f"{folder}/whole.stroll")
    check_result(shared)
    assert (shared["trees"], shared["placements"], whole["trees"], whole["placements"]) == (2, 50, 1, 1), (shared, whole)
    assert shared["triangles_in"] == 648 + BALL and whole["triangles_in"] == 648 + 49 * BALL, (shared, whole)
    # Triangles at the poles have no area; they lose it on either lattice.
    assert shared["triangles_placed"] == whole["triangles_leaf"], (shared, whole)
    must("verify", f"{folder}/shared.stroll", "--against", f"{folder}/shared.glb")
    info = json.loads(must("info", f"{folder}/shared.stroll", "--json").output)
    views = ("--size", "320x240", "--depth", "--supersample", "4", "--quiet")
    must("render", f"{folder}/whole.stroll", "--path", "orbit", "--frames", "3", "-o", f"{folder}/whole", *views)
    again = ("--path", f"{folder}/whole/path.json", *views)
    must("render", f"{folder}/shared.glb", "--full", "-o", f"{folder}/full", *again)
    for backend in ("gl45", "gl3"):
        must("render", f"{folder}/shared.stroll", "-o", f"{folder}/{backend}", "--backend", backend, "--stats", f"{folder}/{backend}.jsonl",
             *again)
        for reference in ("full", "whole"):
            check_images(f"{folder}/{reference}", f"{folder}/{backend}")
        frames = [json.loads(line) for line in open(f"{folder}/{backend}.jsonl", encoding="utf-8")]
        assert all(frame["nodes"] + frame["nodes_culled"] >= 40 for frame in frames), frames
        # 49 balls are uploaded once, not 49 times: 24 bytes a vertex and its share of indices.
        assert sum(frame["uploaded_bytes"] for frame in frames) < 3 * 60 * shared["vertices"], frames
    must("render", f"{folder}/shared.stroll", "--backend", "null", "--stats", f"{folder}/null.jsonl", "--path",
         f"{folder}/whole/path.json", "--quiet")
    assert (info["placements"], info["triangles_placed"]) == (50, shared["triangles_placed"]), info


def bytes_do_not_depend_on_threads(folder):
    assembly(f"{folder}/a.glb", True)
    for structure in ("clusters", "samples"):
        made = []
        for jobs in ("1", "2", "8"):
            result = build(f"{folder}/a.glb", f"{folder}/{jobs}.stroll", "--structure", structure, "--jobs", jobs)
            assert result["trees"] == 2, result
            made.append(open(f"{folder}/{jobs}.stroll", "rb").read())
        assert made[0] == made[1] == made[2]
        must("verify", f"{folder}/1.stroll", "--against", f"{folder}/a.glb")


def other_placements_are_found_out(folder):
    assembly(f"{folder}/a.glb", True)
    assembly(f"{folder}/moved.glb", True, shift=1e-6)
    assembly(f"{folder}/whole.glb", False)
    build(f"{folder}/a.glb", f"{folder}/a.stroll")
    build(f"{folder}/whole.glb", f"{folder}/whole.stroll")
    assert_flawed(run("verify", f"{folder}/a.stroll", "--against", f"{folder}/moved.glb"), "placements are not those of the input")
    assert_flawed(run("verify", f"{folder}/whole.stroll", "--against", f"{folder}/a.glb"), "the input makes 2 trees, the container has 1")
    assert_flawed(run("verify", f"{folder}/a.stroll", "--against", f"{folder}/whole.glb"), "the input makes 1 trees, the container has 2")


def several_inputs_share_what_each_uses_often(folder):
    assembly(f"{folder}/a.glb", True)
    assembly(f"{folder}/b.glb", True, shift=0.5)
    done = must("build", f"{folder}/a.glb", f"{folder}/b.glb", "-o", f"{folder}/both.stroll", "--json")
    result = json.loads(done.output)
    assert (result["trees"], result["placements"], result["parts"]) == (3, 99, 54), result
    must("verify", f"{folder}/both.stroll", "--against", f"{folder}/a.glb", f"{folder}/b.glb")


def a_piece_without_area_is_counted_and_not_placed(folder):
    model = w.Model()
    points = [(1, 2, 3)] * 400
    flat = model.mesh({"attributes": {"POSITION": model.accessor(points, w.FLOAT)},
                       "indices": model.accessor([i % 400 for i in range(900)], w.U32)})
    good = model.mesh(ball(model))
    model.add("materials", {})
    model.scene(*[model.node(mesh=mesh, translation=[i, 0, 0]) for mesh in (flat, good) for i in range(20)])
    model.glb(f"{folder}/a.glb")
    result = build(f"{folder}/a.glb", f"{folder}/a.stroll")
    assert (result["trees"], result["placements"], result["triangles_in"]) == (2, 20, 300 + BALL), result
    must("verify", f"{folder}/a.stroll", "--against", f"{folder}/a.glb")
    must("render", f"{folder}/a.stroll", "-o", f"{folder}/a.png", "--size", "64x64", "--quiet")


def a_grid_is_told_in_the_coordinates_of_the_model(folder):
    model = w.Model()
    mesh = model.mesh(ball(model))
    model.add("materials", {})
    model.scene(*[model.node(mesh=mesh, translation=[10 * i, 0, 0], scale=[0.01] * 3) for i in range(3)])
    model.glb(f"{folder}/a.glb")
    result = build(f"{folder}/a.glb", f"{folder}/a.stroll", "--grid", "0.0001")
    assert 0.00002 < result["step"] <= 0.0001 and result["quantisation_error"] < 0.0001, result
    must("verify", f"{folder}/a.stroll", "--against", f"{folder}/a.glb")


run_tests(a_model_and_its_expansion_look_the_same, bytes_do_not_depend_on_threads, other_placements_are_found_out,
          several_inputs_share_what_each_uses_often, a_piece_without_area_is_counted_and_not_placed,
          a_grid_is_told_in_the_coordinates_of_the_model)
