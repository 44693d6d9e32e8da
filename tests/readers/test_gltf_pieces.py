#!/usr/bin/env python3
"""Meshes that a glTF uses again and again: which become pieces, their triangles, and where they are placed, against a writer that
knows."""
import json
import math
import os
import random
import subprocess

import gltf_writer as w
from gltf_reading import LEAST, PROGRAMS, read, run_tests

HALF = math.sqrt(0.5)


def sheet(side, shift=0.0):
    """2 side^2 triangles; coordinates that floats hold."""
    points = [(x / 8 + shift, y / 8, (x * 7 + y * 3) % 5 / 16) for y in range(side + 1) for x in range(side + 1)]
    faces = [y * (side + 1) + x + c for y in range(side) for x in range(side)
             for c in (0, 1, side + 1, 1, side + 2, side + 1)]
    return points, faces


def pieces_of(path, most=500, memory=LEAST):
    done = subprocess.run([os.path.join(PROGRAMS, "read_mesh"), path, str(memory), os.path.dirname(path), str(most)],
                          capture_output=True, timeout=600)
    return json.loads(done.stdout)


def add_sheet(model, side, shift=0.0, **members):
    points, faces = sheet(side, shift)
    return model.mesh({"attributes": {"POSITION": model.accessor(points, w.FLOAT)}, "indices": model.accessor(faces, w.U32)}, **members)


def check_placements(found, wanted):
    """wanted: pairs of piece and rows."""
    assert found["placement_count"] == len(wanted), (found["placement_count"], len(wanted))
    for (piece, got, _), (wanted_piece, rows) in zip(found["placements"], wanted):
        flat = [x for row in rows for x in row]
        assert piece == wanted_piece and max(abs(a - b) for a, b in zip(got, flat)) < 1e-6, (piece, got, flat)


def meshes_of_many_uses_are_pieces_in_their_own_coordinates(folder):
    model = w.Model()
    once, twice, nested = add_sheet(model, 5), add_sheet(model, 40, 1.0, name="pipe"), add_sheet(model, 50, 2.0)
    turn = (0, 0, HALF, HALF)
    low = model.node(mesh=nested, translation=[0, 0, 3])
    parent = model.node(mesh=twice, translation=[1, 2, 3], rotation=list(turn), children=[low])
    other = model.node(mesh=twice, scale=[-2, 2, 2], children=[model.node(mesh=nested)])
    model.scene(model.node(mesh=once), parent, other)
    model.glb(f"{folder}/a.glb")
    found = pieces_of(f"{folder}/a.glb")
    assert [(p["announced"], p["count"], p["placements"]) for p in found["pieces"]] == [(50, 50, 1), (3200, 3200, 2), (5000, 5000, 2)]
    for piece, (side, shift) in zip(found["pieces"], ((5, 0.0), (40, 1.0), (50, 2.0))):
        assert piece["hash"] == w.position_hash(w.triangles(*sheet(side, shift))), piece
    above, mirror = w.compose((1, 2, 3), turn), w.compose(scale=(-2, 2, 2))
    check_placements(found, [(1, above), (2, w.multiply(above, w.compose((0, 0, 3)))), (1, mirror), (2, mirror)])
    # Placements have the names that copies would have; what is placed has its own beside them.
    assert [name for _, _, name in found["placements"]] == ["pipe", "pipe/node 0", "pipe (node 3)", "pipe/node 2"], found["placements"]
    assert found["hint"] == 50 + 3200 + 5000 and found["parts"][4:6] == ["pipe (mesh 1)", "mesh 2"], found["parts"]
    whole = read(f"{folder}/a.glb")
    assert whole["count"] == 50 + 2 * 3200 + 2 * 5000, whole["count"]


def the_rule_leaves_small_and_rare_meshes_with_the_rest(folder):
    model = w.Model()
    tiny, rare, enough = add_sheet(model, 11), add_sheet(model, 31), add_sheet(model, 32)  # 242, 1922, 2048 triangles
    nodes = [model.node(mesh=tiny, translation=[i, 0, 0]) for i in range(100)]
    nodes += [model.node(mesh=mesh, translation=[i, 5, 0]) for mesh in (rare, enough) for i in range(2)]
    model.scene(*nodes)
    model.glb(f"{folder}/a.glb")
    found = pieces_of(f"{folder}/a.glb")
    assert [(p["count"], p["placements"]) for p in found["pieces"]] == [(24200 + 3844, 1), (2048, 2)], found["pieces"]


def the_largest_savings_are_pieces_where_there_are_too_many(folder):
    model = w.Model()
    sides = [45, 60, 50, 70, 55]
    nodes = [model.node(mesh=mesh, translation=[i, 0, 0]) for mesh in [add_sheet(model, side) for side in sides] for i in range(2)]
    model.scene(*nodes)
    model.glb(f"{folder}/a.glb")
    found = pieces_of(f"{folder}/a.glb", 2)
    assert [(p["count"], p["placements"]) for p in found["pieces"][1:]] == [(7200, 2), (9800, 2)], found["pieces"]
    assert found["pieces"][0]["count"] == 2 * 2 * (45 * 45 + 50 * 50 + 55 * 55)
    assert len(pieces_of(f"{folder}/a.glb", 0)["pieces"]) == 1


def instances_are_placed_one_by_one_and_none_is_kept(folder):
    dice = random.Random(3)
    count = 1000  # more than are read at once
    moves = [tuple(dice.randint(-64, 64) / 8 for _ in range(3)) for _ in range(count)]
    turns = [dice.choice([(0, 0, 0, 1), (HALF, 0, 0, HALF), (0, -HALF, 0, HALF), (0.5, 0.5, 0.5, 0.5)]) for _ in range(count)]
    scales = [dice.choice([(1, 1, 1), (2, 2, 2), (-1, 1, 1), (0.5, 1, 2)]) for _ in range(count)]
    model = w.Model()
    mesh = add_sheet(model, 20)
    attributes = {"TRANSLATION": model.accessor(moves, w.FLOAT), "ROTATION": model.accessor(turns, w.FLOAT),
                  "SCALE": model.accessor(scales, w.FLOAT)}
    model.json["extensionsUsed"] = ["EXT_mesh_gpu_instancing"]
    model.scene(model.node(mesh=mesh, scale=[2, 2, 2], extensions={"EXT_mesh_gpu_instancing": {"attributes": attributes}}))
    model.glb(f"{folder}/a.glb")
    found = pieces_of(f"{folder}/a.glb")
    assert found["pieces"][0]["empty"] and found["pieces"][0]["count"] == 0, found["pieces"]
    outer = w.compose(scale=(2, 2, 2))
    check_placements(found, [(1, w.multiply(outer, w.compose(*one))) for one in zip(moves, turns, scales)])


def lines_and_points_are_counted_where_they_are(folder):
    model = w.Model()
    points, faces = sheet(40)
    position = model.accessor(points, w.FLOAT)
    mesh = model.mesh({"attributes": {"POSITION": position}, "indices": model.accessor(faces, w.U32)},
                      {"attributes": {"POSITION": position}, "mode": 1})
    cloud = model.mesh({"attributes": {"POSITION": position}, "mode": 0})
    model.scene(*[model.node(mesh=mesh) for _ in range(3)], model.node(mesh=cloud))
    model.glb(f"{folder}/a.glb")
    found = pieces_of(f"{folder}/a.glb")
    assert [(p["count"], p["lines"], p["points"], p["empty"]) for p in found["pieces"]] == \
        [(0, 0, len(points), False), (3200, len(points) // 2, 0, False)], found["pieces"]


def placements_that_are_not_finite_are_counted_as_triangles(folder):
    model = w.Model()
    mesh = add_sheet(model, 40)
    moves = [(0, 0, 0), (float("inf"), 0, 0), (1, 0, 0), (0, float("nan"), 0)]
    model.json["extensionsUsed"] = ["EXT_mesh_gpu_instancing"]
    model.scene(model.node(mesh=mesh, extensions={"EXT_mesh_gpu_instancing": {"attributes": {
        "TRANSLATION": model.accessor(moves, w.FLOAT)}}}))
    model.glb(f"{folder}/a.glb")
    found = pieces_of(f"{folder}/a.glb")
    assert found["placement_count"] == 2 and found["placement_nonfinite"] == 2 * 3200, found["placement_nonfinite"]


run_tests([meshes_of_many_uses_are_pieces_in_their_own_coordinates, the_rule_leaves_small_and_rare_meshes_with_the_rest,
           the_largest_savings_are_pieces_where_there_are_too_many, instances_are_placed_one_by_one_and_none_is_kept,
           lines_and_points_are_counted_where_they_are, placements_that_are_not_finite_are_counted_as_triangles])
