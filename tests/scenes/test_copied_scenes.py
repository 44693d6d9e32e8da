#!/usr/bin/env python3
"""Scenes with copies, read back by a glTF reader of these few lines: how much there is, where it is, and that formats without
copies have them written out.

usage: test_copied_scenes.py PROGRAM"""
import json
import math
import os
import struct
import subprocess
import sys
import tempfile

STROLL = os.path.abspath(sys.argv[1])


def scene(*words):
    done = subprocess.run([STROLL, "scene", *words], capture_output=True, text=True)
    assert done.returncode == 0 and not done.stderr, done
    return done.stdout


class Model:
    def __init__(self, path):
        with open(path, encoding="utf-8") as file:
            self.json = json.load(file)
        self.buffers = []
        for buffer in self.json["buffers"]:
            with open(os.path.join(os.path.dirname(path), buffer["uri"]), "rb") as file:
                self.buffers.append(file.read())
            assert len(self.buffers[-1]) == buffer["byteLength"]

    def rows(self, index):
        accessor = self.json["accessors"][index]
        view = self.json["bufferViews"][accessor["bufferView"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        code, size = {5126: ("f", 4), 5125: ("I", 4), 5123: ("H", 2)}[accessor["componentType"]]
        stride = view.get("byteStride", width * size)
        data = self.buffers[view["buffer"]]
        at = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        assert at + stride * (accessor["count"] - 1) + width * size <= len(data)
        return [struct.unpack_from(f"<{width}{code}", data, at + stride * i) for i in range(accessor["count"])]

    def triangles(self, mesh):
        return sum(self.json["accessors"][p["indices"] if "indices" in p else p["attributes"]["POSITION"]]["count"] // 3
                   for p in self.json["meshes"][mesh]["primitives"])

    def uses(self):
        """Pairs of node and number of copies."""
        for node in self.json["nodes"]:
            if "mesh" in node:
                attributes = node.get("extensions", {}).get("EXT_mesh_gpu_instancing", {}).get("attributes", {})
                yield node, attributes, self.json["accessors"][attributes["TRANSLATION"]]["count"] if attributes else 1


def a_landscape_is_a_forest_of_copies(folder):
    for triangles, seed in ((500000, 0), (3000000, 7)):
        told = scene("landscape", "-n", str(triangles), "--seed", str(seed), "-o", f"{folder}/l.gltf")
        model = Model(f"{folder}/l.gltf")
        expanded = sum(model.triangles(node["mesh"]) * count for node, _, count in model.uses())
        assert abs(expanded / triangles - 1) < 0.05 and f": {expanded} triangles" in told, (expanded, told)
        trees = {node["name"]: count for node, _, count in model.uses() if node["name"] in ("OAK", "BEECH", "BIRCH", "MAPLE", "BUSH")}
        assert len(trees) >= 3 and sum(trees.values()) * 7000 > 0.4 * triangles, trees
        copied = {node["mesh"] for node, attributes, _ in model.uses() if attributes}
        assert all(model.triangles(mesh) >= 256 for mesh in copied), [model.triangles(mesh) for mesh in copied]
        assert len(copied) == len({node["name"] for node, attributes, _ in model.uses() if attributes}) + len(trees)
        for node, attributes, count in model.uses():
            if attributes:
                turns, scales = model.rows(attributes["ROTATION"]), model.rows(attributes["SCALE"])
                assert len(turns) == len(scales) == count
                assert all(abs(sum(x * x for x in turn) - 1) < 1e-5 for turn in turns) and all(0.6 < s[0] < 1.4 for s in scales)
        ground = sum(model.triangles(node["mesh"]) for node, attributes, _ in model.uses() if not attributes)
        assert 0.05 < ground / triangles < 0.07, ground


def a_landscape_is_the_same_for_the_same_seed_and_written_out_elsewhere(folder):
    for name in ("a", "b"):
        scene("landscape", "-n", "600K", "--seed", "3", "-o", f"{folder}/{name}.gltf")
    same = [open(f"{folder}/{name}_000.bin", "rb").read() for name in "ab"]
    assert same[0] == same[1]
    told = scene("landscape", "-n", "600K", "--seed", "3", "-o", f"{folder}/a.ply")
    model = Model(f"{folder}/a.gltf")
    expanded = sum(model.triangles(node["mesh"]) * count for node, _, count in model.uses())
    with open(f"{folder}/a.ply", "rb") as file:
        head = file.read(600)
    assert f"element face {expanded}\n".encode() in head and f": {expanded} triangles" in told, (expanded, told)


def an_array_has_one_mesh_and_its_copies_do_not_touch(folder):
    scene("boxes", "-n", "1200", "-o", f"{folder}/one.ply", "--quiet")
    told = scene("array", "--of", f"{folder}/one.ply", "--copies", "1000", "-o", f"{folder}/many.gltf")
    assert ": 1200000 triangles" in told, told
    model = Model(f"{folder}/many.gltf")
    [(node, attributes, count)] = model.uses()
    assert count == 1000 and len(model.json["meshes"]) == 1 and model.triangles(node["mesh"]) == 1200
    points = model.rows(model.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"])
    sizes = [max(p[k] for p in points) - min(p[k] for p in points) for k in range(3)]
    middle = [(max(p[k] for p in points) + min(p[k] for p in points)) / 2 for k in range(3)]
    centres = set()
    for move, turn in zip(model.rows(attributes["TRANSLATION"]), model.rows(attributes["ROTATION"])):
        assert move[2] == 0 and turn[0] == turn[1] == 0 and abs(turn[2] ** 2 + turn[3] ** 2 - 1) < 1e-6  # PLY has z up
        cosine, sine = turn[3] ** 2 - turn[2] ** 2, 2 * turn[2] * turn[3]
        centres.add((round((move[0] + cosine * middle[0] - sine * middle[1]) / max(sizes[:2]), 2),
                     round((move[1] + sine * middle[0] + cosine * middle[1]) / max(sizes[:2]), 2)))
    assert len(centres) == 1000
    first = min(centres)
    assert all(abs((a - b) / 1.25 - round((a - b) / 1.25)) < 0.02 for centre in centres for a, b in zip(centre, first)), first


def an_array_of_any_model_keeps_its_colours(folder):
    scene("chessboard", "-n", "800", "-o", f"{folder}/board.ply", "--quiet")
    scene("array", "--of", f"{folder}/board.ply", "--copies", "4", "-o", f"{folder}/boards.gltf", "--quiet")
    scene("array", "--of", f"{folder}/boards.gltf", "--copies", "9", "-o", f"{folder}/again.gltf", "--quiet")
    model = Model(f"{folder}/again.gltf")
    [(node, _, count)] = model.uses()
    assert count == 9 and model.triangles(node["mesh"]) == 3200
    colours = model.rows(model.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"])
    assert sorted(set(colours)) == [(0, 0, 0, 65535), (65535,) * 4], set(colours)
    assert colours.count((0, 0, 0, 65535)) == len(colours) / 2


def a_chessboard_is_half_black(folder):
    for triangles in (2, 100, 80000):
        scene("chessboard", "-n", str(triangles), "-o", f"{folder}/board.ply", "--quiet")
        with open(f"{folder}/board.ply", "rb") as file:
            data = file.read()
        head, body = data.split(b"end_header\n", 1)
        vertices = int(head.split(b"element vertex ")[1].split()[0])
        faces = int(head.split(b"element face ")[1].split()[0])
        assert abs(faces - triangles) <= 2 * math.sqrt(triangles) and vertices == 2 * faces, (faces, vertices)
        records = [struct.unpack_from("<3f3B", body, 15 * i) for i in range(vertices)]
        assert all(0 <= x <= 1 and 0 <= y <= 1 and z == 0 and (r, g, b) in ((0, 0, 0), (255, 255, 255)) for x, y, z, r, g, b in records)
        assert max(r[0] for r in records) == max(r[1] for r in records) == 1
        area = 0
        for i in range(faces):
            a, b, c = struct.unpack_from("<3I", body, 15 * vertices + 13 * i + 1)
            area += (-1 if records[a][3] else 1) * ((records[b][0] - records[a][0]) * (records[c][1] - records[a][1]) -
                                                    (records[b][1] - records[a][1]) * (records[c][0] - records[a][0])) / 2
        assert abs(area) <= 2 / math.sqrt(triangles), area


def a_chessboard_of_copies_is_the_same_board(folder):
    """Each field of the other formats is there once, in its place and colour."""
    for triangles, least_copies in ((2, 1), (800, 1), (60000, 2)):
        scene("chessboard", "-n", str(triangles), "-o", f"{folder}/board.ply", "--quiet")
        told = scene("chessboard", "-n", str(triangles), "-o", f"{folder}/board.gltf")
        with open(f"{folder}/board.ply", "rb") as file:
            head, body = file.read().split(b"end_header\n", 1)
        faces = int(head.split(b"element face ")[1].split()[0])
        model = Model(f"{folder}/board.gltf")
        assert f": {faces} triangles" in told and faces == sum(model.triangles(n["mesh"]) * count for n, _, count in model.uses()), told
        [fields] = [node for node in model.json["nodes"] if node["name"] == "FIELDS"]
        wanted = sorted(struct.unpack_from("<3f3B", body, 15 * i)[:4] for i in range(2 * faces))
        found, most = [], 0
        for node, attributes, count in model.uses():
            primitive = model.json["meshes"][node["mesh"]]["primitives"][0]
            shade = 255 * model.json["materials"][primitive["material"]]["pbrMetallicRoughness"]["baseColorFactor"][0]
            points = model.rows(primitive["attributes"]["POSITION"])
            most = max(most, count)
            for move in model.rows(attributes["TRANSLATION"]):
                found += [tuple((p[k] + move[k]) * fields.get("scale", [1] * 3)[k] for k in range(3)) + (shade,) for p in points]
        assert most >= least_copies and len(found) == len(wanted)
        assert len(model.json["meshes"]) <= 8, "tiles of one shape are one mesh"
        found.sort(key=lambda p: (round(p[0], 6), round(p[1], 6), p[3]))
        wanted.sort(key=lambda p: (round(p[0], 6), round(p[1], 6), p[3]))
        assert all(abs(a - b) < 1e-6 for p, q in zip(found, wanted) for a, b in zip(p, q))


def what_does_not_fit_is_refused(folder):
    scene("boxes", "-n", "12", "-o", f"{folder}/one.ply", "--quiet")
    for words, part in ((("array", "-o", f"{folder}/a.gltf"), "needs --of FILE"),
                        (("boxes", "--of", f"{folder}/one.ply", "-o", f"{folder}/a.ply"), "takes no --of"),
                        (("array", "--of", f"{folder}/one.ply", "-o", f"{folder}/a.ply"), "ends in .gltf"),
                        (("array", "--of", f"{folder}/none.ply", "-o", f"{folder}/a.gltf"), "none.ply")):
        done = subprocess.run([STROLL, "scene", *words], capture_output=True, text=True)
        assert done.returncode in (1, 2) and part in done.stderr, done
    assert sorted(os.listdir(folder)) == ["one.ply"], os.listdir(folder)
    scene("boxes", "-n", "1200", "-o", f"{folder}/one.ply", "--quiet")
    scene("array", "--of", f"{folder}/one.ply", "--copies", "1000", "-o", f"{folder}/many.gltf", "--quiet")
    done = subprocess.run([STROLL, "scene", "array", "--of", f"{folder}/many.gltf", "-o", f"{folder}/more.gltf"], capture_output=True, text=True)
    assert done.returncode == 1 and "1200 triangles" in done.stderr and "1200000" in done.stderr and done.stderr.count("\n") == 1, done
    assert not [name for name in os.listdir(folder) if name.startswith("more")]


failed = 0
for test in (a_landscape_is_a_forest_of_copies, a_landscape_is_the_same_for_the_same_seed_and_written_out_elsewhere,
             an_array_has_one_mesh_and_its_copies_do_not_touch, an_array_of_any_model_keeps_its_colours, a_chessboard_is_half_black,
             a_chessboard_of_copies_is_the_same_board,
             what_does_not_fit_is_refused):
    with tempfile.TemporaryDirectory() as made:
        try:
            test(made)
            print("ok", test.__name__)
        except Exception as problem:  # noqa: BLE001: each test is told
            import traceback
            traceback.print_exc()
            print("FAILED", test.__name__, problem)
            failed += 1
sys.exit(1 if failed else 0)
