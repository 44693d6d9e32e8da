#!/usr/bin/env python3
"""stroll info and stroll extract on the committed containers: facts, uniform cuts as PLY, sentences."""
import json
import math
import os
import struct
import subprocess
import sys
import tempfile

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "readers"))
import gltf_writer as w  # noqa: E402

STROLL = sys.argv[1]
GOLDEN = os.path.join(os.environ.get("STRL_TEST_ROOT", "."), "tests/container/golden")
MODEL = os.path.join(GOLDEN, "v1-treelets.stroll")


def run(*words, status=0):
    done = subprocess.run([STROLL, *words], capture_output=True, text=True, timeout=60)
    assert done.returncode == status, (words, done.returncode, done.stderr)
    return done.stdout if status == 0 else done.stderr


def read_ply(path):
    data = open(path, "rb").read()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    lines = data[:end].decode().split("\n")
    count = {words[1]: int(words[2]) for words in map(str.split, lines) if words[:1] == ["element"]}
    sizes = {"float": "f", "double": "d", "uchar": "B"}
    layout = "<" + "".join(sizes[w[1]] for w in map(str.split, lines) if w[:1] == ["property"] and w[1] != "list")
    step = struct.calcsize(layout)
    vertices = [struct.unpack_from(layout, data, end + step * i) for i in range(count["vertex"])]
    at = end + step * count["vertex"]
    assert len(data) == at + 13 * count["face"]
    faces = [struct.unpack_from("<B3I", data, at + 13 * i) for i in range(count["face"])]
    assert all(face[0] == 3 and max(face[1:]) < count["vertex"] for face in faces)
    return vertices, [face[1:] for face in faces], layout


def info_states_what_was_committed():
    expected = json.load(open(os.path.join(GOLDEN, "expected.json")))["v1-treelets.stroll"]
    found = json.loads(run("info", MODEL, "--json"))
    for name in ("version", "model_id", "unit", "has_colour", "parts", "materials", "placements", "bounds"):
        assert found[name] == expected[name], name
    assert found["bytes"] == expected["file_bytes"] == os.path.getsize(MODEL)
    assert found["dropped"]["degenerate"] == 3 and found["closed"] is True and found["up"] == "z"
    tree = found["trees"][0]
    for name in ("nodes", "levels", "groups", "triangles", "vertices", "root_triangles", "step"):
        assert tree[name] == expected[name], name
    levels = tree["per_level"]
    assert [level["level"] for level in levels] == list(range(tree["levels"]))[::-1]
    assert sum(level["nodes"] for level in levels) == tree["nodes"]
    assert levels[-1]["triangles"] == tree["triangles"]
    assert abs(found["bytes_per_triangle"] - found["bytes"] / tree["triangles"]) < 1e-9
    for level in levels:
        assert sum(level["rungs"].values()) == level["nodes"]
        assert 0 <= level["geometric_min"] <= level["geometric_max"]
    assert all(a["geometric_max"] > b["geometric_max"] for a, b in zip(levels, levels[1:]))
    text = run("info", MODEL)
    assert "136 nodes, 7 levels" in text and "lattice step 0.25" in text


def a_cut_at_zero_is_all_leaves_and_a_wide_one_the_root(folder):
    expected = json.load(open(os.path.join(GOLDEN, "expected.json")))["v1-treelets.stroll"]
    out = os.path.join(folder, "cut.ply")
    counts = []
    for error in ("0", "0.5", "1", "2", "1000"):
        run("extract", MODEL, "--error", error, "-o", out)
        vertices, faces, layout = read_ply(out)
        counts.append(len(faces))
        low, high = expected["bounds"][:3], expected["bounds"][3:]
        for vertex in vertices:
            assert abs(sum(n * n for n in vertex[3:6]) - 1) < 1e-5
            if error == "0":
                assert all(low[k] <= vertex[k] <= high[k] for k in range(3)), vertex
        # The fixture lies 2^40 cells away: float would not tell its cells apart.
        assert layout == "<dddfffBBBB"
        for face in faces:
            assert len({vertices[corner][:3] for corner in face}) == 3
    assert counts[0] == expected["triangles"]
    assert counts[-1] == 1
    assert counts == sorted(counts, reverse=True) and counts[2] < counts[0]
    assert os.listdir(folder) == ["cut.ply"]


def equal_cuts_are_equal_bytes(folder):
    paths = [os.path.join(folder, name) for name in ("a.ply", "b.ply")]
    for path in paths:
        run("extract", MODEL, "--error", "0.7", "-o", path)
    assert open(paths[0], "rb").read() == open(paths[1], "rb").read()


def what_cannot_be_is_one_sentence(folder):
    out = os.path.join(folder, "none.ply")
    bad = os.path.join(GOLDEN, "bad-payload-version.stroll")
    sentence = run("extract", bad, "--error", "1000", "-o", out, status=1)
    assert sentence.count("\n") == 1 and "bad-payload-version.stroll: page at byte 4096" in sentence
    assert not os.path.exists(out) and os.listdir(folder) == []
    copy = os.path.join(folder, "model.stroll")
    before = open(MODEL, "rb").read()
    open(copy, "wb").write(before)
    assert "is the model itself" in run("extract", copy, "--error", "0", "-o", copy, status=1)
    assert open(copy, "rb").read() == before
    run("extract", MODEL, "-o", out, status=2)
    run("extract", MODEL, "--error", "-1", "-o", out, status=2)
    assert "expected 12345678 from its header" in run("info", os.path.join(GOLDEN, "bad-file-bytes.stroll"), status=1)
    assert "cannot open" in run("info", os.path.join(folder, "absent"), status=1)


def small_copies_keep_their_vertices(folder):
    """A lattice that is fine for the world as a mesh is can be too fine for floats where the mesh is placed a thousandth as large."""
    model = w.Model()
    points = [(math.sin(a) * math.cos(b), math.sin(a) * math.sin(b), math.cos(a))
              for i in range(13) for j in range(24) for a, b in [(math.pi * (i + 0.5) / 13, 2 * math.pi * j / 24)]]
    faces = [24 * i + c for i in range(12) for j in range(24)
             for c in (j, j + 24, (j + 1) % 24, (j + 1) % 24, j + 24, (j + 1) % 24 + 24)]
    mesh = model.mesh({"attributes": {"POSITION": model.accessor(points, w.FLOAT)}, "indices": model.accessor(faces, w.U32)})
    model.scene(*[model.node(mesh=mesh, translation=[k / 8, 0, 0], scale=[1e-3] * 3) for k in range(24)])
    glb, built, out = (os.path.join(folder, name) for name in ("small.glb", "small.stroll", "small.ply"))
    model.glb(glb)
    run("build", glb, "-o", built, "--quiet")
    assert json.loads(run("info", built, "--json"))["placements"] == 24
    run("extract", built, "--error", "0", "-o", out)
    assert read_ply(out)[2].startswith("<dddfff"), read_ply(out)[2]


def a_full_disk_leaves_no_file(folder):
    """The file size limit stands for the disk: the write fails with EFBIG."""
    out = os.path.join(folder, "cut.ply")
    limited = f"trap '' XFSZ; ulimit -f 8; exec '{STROLL}' extract '{MODEL}' --error 0 -o '{out}'"
    done = subprocess.run(["bash", "-c", limited], capture_output=True, text=True, timeout=60)
    assert done.returncode == 1 and "cut.ply" in done.stderr, done.stderr
    assert os.listdir(folder) == []


info_states_what_was_committed()
for test in (a_cut_at_zero_is_all_leaves_and_a_wide_one_the_root, equal_cuts_are_equal_bytes,
             what_cannot_be_is_one_sentence, small_copies_keep_their_vertices, a_full_disk_leaves_no_file):
    with tempfile.TemporaryDirectory() as scratch:
        test(scratch)
        print(test.__name__, "ok")
