#!/usr/bin/env python3
"""The scene `plant`, read back by a glTF reader of these few lines: the file is sound, its parts are closed and face
outward, sizes are spread as a power plant's, and OBJ and PLY hold the same triangles in the same places.

usage: test_plant_files.py PROGRAM"""
import collections
import json
import os
import resource
import shutil
import struct
import subprocess
import sys
import tempfile
import urllib.parse

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "support"))
import sanitized

STROLL = os.path.abspath(sys.argv[1])
MIB = 1 << 20
TRIANGLES = 2000000
SAMPLES = 10  # parts of each kind that are checked triangle by triangle
if sanitized.sanitizers(STROLL):
    print("skipped: test_plant writes the same files, and bytes are the same without sanitizers")
    sys.exit(77)


def write(folder, name, *words):
    path = os.path.join(folder, name)
    done = subprocess.run([STROLL, "scene", "plant", "--seed", "1", "-o", path, "--quiet", *words], capture_output=True,
                          text=True)
    assert done.returncode == 0 and not done.stdout and not done.stderr, done
    return path


# ---- glTF ----
class Model:
    """A .gltf with its buffers; parts in the order of their meshes."""

    def __init__(self, path):
        with open(path, encoding="utf-8") as file:
            self.json = json.load(file)
        self.buffers = []
        for buffer in self.json["buffers"]:
            with open(os.path.join(os.path.dirname(path), urllib.parse.unquote(buffer["uri"])), "rb") as file:
                self.buffers.append(file.read())
            assert len(self.buffers[-1]) == buffer["byteLength"]
        self.parts = []
        roots = self.json["scenes"][self.json["scene"]]["nodes"]
        assert len(roots) == 1
        self.visits = collections.Counter()
        self.visit(roots[0], [], IDENTITY)

    def visit(self, index, names, world):
        node = self.json["nodes"][index]
        self.visits[index] += 1
        world = multiply(world, local_matrix(node))
        names = names + [node["name"]]
        if "mesh" in node:
            assert "children" not in node
            self.parts.append(Part(self, node, "/".join(names[1:]), world))
        else:
            assert node["children"]
        for child in node.get("children", []):
            self.visit(child, names, world)

    def accessor(self, index):
        """The accessor, its view, and where its first byte is in the buffer."""
        accessor = self.json["accessors"][index]
        view = self.json["bufferViews"][accessor["bufferView"]]
        return accessor, view, view["byteOffset"] + accessor["byteOffset"]


class Part:
    def __init__(self, model, node, name, world):
        self.model, self.name, self.world, self.mesh = model, name, world, node["mesh"]
        [self.primitive] = model.json["meshes"][node["mesh"]]["primitives"]
        self.kind = node["name"].rsplit("-", 1)[0]
        self.triangles = model.json["accessors"][self.primitive["indices"]]["count"] // 3
        self.vertex_count = model.json["accessors"][self.primitive["attributes"]["POSITION"]]["count"]

    def vertices(self):
        accessor, view, start = self.model.accessor(self.primitive["attributes"]["POSITION"])
        data = self.model.buffers[view["buffer"]][start:start + 24 * accessor["count"]]
        return list(struct.iter_unpack("<6f", data))

    def indices(self):
        accessor, view, start = self.model.accessor(self.primitive["indices"])
        form = {5123: "H", 5125: "I"}[accessor["componentType"]]
        return struct.unpack_from(f"<{accessor['count']}{form}", self.model.buffers[view["buffer"]], start)


IDENTITY = [[float(i == k) for k in range(4)] for i in range(4)]


def multiply(a, b):
    return [[sum(a[i][j] * b[j][k] for j in range(4)) for k in range(4)] for i in range(4)]


def local_matrix(node):
    if "matrix" in node:
        assert not {"translation", "rotation", "scale"} & node.keys()
        return [[node["matrix"][4 * column + row] for column in range(4)] for row in range(4)]
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    assert abs(x * x + y * y + z * z + w * w - 1) < 1e-6
    turn = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
    scale, move = node.get("scale", (1, 1, 1)), node.get("translation", (0, 0, 0))
    rows = [[turn[i][k] * scale[k] for k in range(3)] + [move[i]] for i in range(3)]
    return rows + [[0, 0, 0, 1]]


def apply(matrix, point):
    return [sum(matrix[i][k] * point[k] for k in range(3)) + matrix[i][3] for i in range(3)]


def determinant(m):
    return sum(m[0][i] * (m[1][(i + 1) % 3] * m[2][(i + 2) % 3] - m[1][(i + 2) % 3] * m[2][(i + 1) % 3])
               for i in range(3))


def samples(model):
    """Some parts of each kind, the largest of all among them."""
    seen = collections.Counter()
    largest = max(model.parts, key=lambda part: part.triangles)
    for part in model.parts:
        seen[part.kind] += 1
        if seen[part.kind] <= SAMPLES or part is largest:
            yield part


# ---- checks ----
def the_file_is_sound(model):
    data = model.json
    assert data["asset"]["version"] == "2.0"
    assert all(model.visits[i] == 1 for i in range(len(data["nodes"]))), "a node is not visited once"
    assert sorted(part.mesh for part in model.parts) == list(range(len(data["meshes"])))
    for view in data["bufferViews"]:
        assert view["byteLength"] > 0 and view["byteOffset"] % 4 == 0
        assert view["byteOffset"] + view["byteLength"] <= data["buffers"][view["buffer"]]["byteLength"]
    used = collections.Counter()
    for part in model.parts:
        attributes = part.primitive["attributes"]
        used.update([attributes["POSITION"], attributes["NORMAL"], part.primitive["indices"]])
        assert 0 <= part.primitive["material"] < len(data["materials"])
    assert used == collections.Counter(range(len(data["accessors"]))), "an accessor is not used once"
    for index, accessor in enumerate(data["accessors"]):
        _, view, start = model.accessor(index)
        size = {5126: 12, 5123: 2, 5125: 4}[accessor["componentType"]]
        stride = view.get("byteStride", size)
        assert start % min(size, 4) == 0
        assert accessor["byteOffset"] + stride * (accessor["count"] - 1) + size <= view["byteLength"]
    names = [part.name for part in model.parts]
    assert len(set(names)) == len(names)
    assert all(name.count("/") == 2 and name.startswith("UNIT-") for name in names), names[:3]
    assert any(name.split("/")[1].startswith("LINE-") and "/ELBOW-" in name for name in names)


def sizes_are_those_of_a_power_plant(model):
    sizes = sorted(part.triangles for part in model.parts)
    total = sum(sizes)
    assert total == sum(sizes) and TRIANGLES - 12 < total <= TRIANGLES, total
    assert sizes[0] == 12 and 10000 < sizes[-1] <= 100000, (sizes[0], sizes[-1])
    assert 20 <= sizes[len(sizes) // 2] <= 80, sizes[len(sizes) // 2]
    decades = [sum(low <= size < 10 * low for size in sizes) for low in (10, 100, 1000, 10000)]
    shares = [sum(size for size in sizes if low <= size < 10 * low) / total for low in (10, 100, 1000, 10000)]
    print(f"{len(sizes)} parts by size: {decades}, shares of triangles: {[round(share, 3) for share in shares]}")
    assert decades == sorted(decades, reverse=True) and decades[3] >= 20, decades
    assert 0.55 < decades[0] / len(sizes) < 0.9 and decades[3] < 0.01 * len(sizes), decades
    assert 0.2 < shares[3] < 0.6 and all(share > 0.03 for share in shares), shares
    assert 100 <= total / len(sizes) <= 500, total / len(sizes)
    kinds = collections.Counter(part.kind for part in model.parts)
    wanted = ("PIPE ELBOW FLANGE VALVE BOLTS ANCHOR GRATING TRAY CABLES BEAM HANDRAIL TREADS LADDER SHELL STEAM-DRUM "
              "TUBE-WALL FIN-TUBES MOTOR GLASS").split()
    assert all(kinds[kind] > 0 for kind in wanted), [kind for kind in wanted if not kinds[kind]]


def transforms_are_of_every_kind(model):
    nodes = model.json["nodes"]
    assert all(any(key in node for node in nodes) for key in ("matrix", "translation", "rotation", "scale"))
    assert any(node.get("scale") == [0.001, 0.001, 0.001] for node in nodes)
    signs = {determinant(part.world) < 0 for part in model.parts}
    assert signs == {False, True}, "expected mirrored units and others"
    kinds = {model.json["accessors"][part.primitive["indices"]]["componentType"] for part in model.parts}
    assert kinds == {5123, 5125}, kinds
    alphas = [material["pbrMetallicRoughness"]["baseColorFactor"][3] for material in model.json["materials"]]
    assert min(alphas) < 1 == max(alphas)


def parts_are_closed_and_face_outward(model):
    for part in samples(model):
        vertices, indices = part.vertices(), part.indices()
        edges, volume, origin = collections.Counter(), 0.0, vertices[0]
        for at in range(0, len(indices), 3):
            p = [vertices[i][:3] for i in indices[at:at + 3]]
            u, v = ([p[i][k] - p[0][k] for k in range(3)] for i in (1, 2))
            across = [u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3] for k in range(3)]
            length = sum(value * value for value in across) ** 0.5
            assert length > 0, (part.name, p)
            volume += sum(across[k] * (p[0][k] - origin[k]) for k in range(3))
            for i in indices[at:at + 3]:
                assert sum(across[k] * vertices[i][3 + k] for k in range(3)) > 0.3 * length, (part.name, "normal")
            for k in range(3):
                edges[p[k], p[(k + 1) % 3]] += 1
        assert all(edges[b, a] == count for (a, b), count in edges.items()), (part.name, "is open")
        assert volume > 0, (part.name, volume)
        accessor = model.json["accessors"][part.primitive["attributes"]["POSITION"]]
        as_float = lambda values: list(struct.unpack("<3f", struct.pack("<3f", *values)))
        assert as_float(accessor["min"]) == [min(v[k] for v in vertices) for k in range(3)], part.name
        assert as_float(accessor["max"]) == [max(v[k] for v in vertices) for k in range(3)], part.name
        assert all(abs(sum(n * n for n in v[3:]) - 1) < 1e-5 for v in vertices), part.name


def ply_has_the_same_places(model, path):
    """The vertices of PLY lie part by part, z up; glTF's are turned to y up."""
    with open(path, "rb") as file:
        data = file.read()
    header = data[:512].decode()
    vertices, faces = (int(header.split(word)[1].split()[0]) for word in ("element vertex", "element face"))
    assert faces == sum(part.triangles for part in model.parts)
    assert vertices == sum(part.vertex_count for part in model.parts)
    first, face = 0, 512 + 24 * vertices
    chosen = {id(part) for part in samples(model)}
    for part in model.parts:
        if id(part) in chosen:
            own = part.vertices()
            for i in {0, len(own) // 3, len(own) - 1}:
                x, y, z = struct.unpack_from("<3f", data, 512 + 24 * (first + i))
                found = apply(part.world, own[i])
                assert all(abs(a - b) < 2e-4 for a, b in zip(found, (x, z, -y))), (part.name, found, (x, z, -y))
            corners = struct.unpack_from("<3i", data, face + 1)
            turned = [first + i for i in part.indices()[:3]]
            if determinant(part.world) < 0:
                turned[1:] = turned[:0:-1]
            assert list(corners) == turned, (part.name, corners, turned)
        first += part.vertex_count
        face += 13 * part.triangles


def obj_has_the_same_parts(model, path):
    expected = {part.name: part for part in model.parts}
    materials, found, vertices, name = set(), {}, {}, None
    with open(path, encoding="utf-8") as file:
        for line in file:
            if line[0] == "o":
                name = line[2:].strip()
                found[name] = 0
            elif line[0] == "f":
                found[name] += 1
            elif line[:2] == "v " and name not in vertices:
                vertices[name] = [float(word) for word in line.split()[1:]]
            elif line.startswith("usemtl"):
                materials.add(line.split()[1])
    assert found == {name: part.triangles for name, part in expected.items()}
    for part in samples(model):
        place = apply(part.world, part.vertices()[0])
        assert all(abs(a - b) < 2e-4 for a, b in zip(place, vertices[part.name])), part.name
    with open(path[:-4] + ".mtl", encoding="utf-8") as file:
        defined = {line.split()[1] for line in file if line.startswith("newmtl")}
    assert materials <= defined, materials - defined


def assimp_agrees(model, path):
    if not shutil.which("assimp"):
        print("assimp is not installed: no second opinion")
        return
    done = subprocess.run(["assimp", "info", path, "--raw"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    counts = {}
    for line in done.stdout.splitlines():
        if ":" in line:  # a list of them may follow under the same word
            name, value = line.split(":")[:2]
            counts.setdefault(name.strip(), value.split())
    assert int(counts["Faces"][0]) == sum(part.triangles for part in model.parts), counts
    assert int(counts["Meshes"][0]) == len(model.parts), counts


def memory_stays_the_same(folder):
    """Of a process that writes much more than it may hold."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    write(folder, "large.gltf", "-n", "6M")
    after = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    assert max(before, after) < 64 * 1024, after


def main():
    with tempfile.TemporaryDirectory() as folder:
        memory_stays_the_same(folder)
        path = write(folder, "plant.gltf", "-n", str(TRIANGLES))
        model = Model(path)
        the_file_is_sound(model)
        sizes_are_those_of_a_power_plant(model)
        transforms_are_of_every_kind(model)
        parts_are_closed_and_face_outward(model)
        ply_has_the_same_places(model, write(folder, "plant.ply", "-n", str(TRIANGLES)))
        obj_has_the_same_parts(model, write(folder, "plant.obj", "-n", str(TRIANGLES)))
        assimp_agrees(model, path)
        bare = Model(write(folder, "bare.gltf", "-n", "20K", "--no-normals"))
        assert all(set(part.primitive["attributes"]) == {"POSITION"} for part in bare.parts)
    print("ok")


main()
