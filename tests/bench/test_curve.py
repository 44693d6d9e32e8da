#!/usr/bin/env python3
"""The measure of bench/curve.py is right, the peer's cuts have no cracks, and the whole command makes its tables.

usage: test_curve.py PROGRAM, with peer_dag and surface_distance beside it. Nothing here depends on how fast anything is."""
import collections
import csv
import json
import math
import os
import pathlib
import struct
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(os.environ.get("STRL_TEST_ROOT", pathlib.Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(ROOT / "bench"))
sys.dont_write_bytecode = True
import curve
import curve_plot

MODEL = "isosurface_20k"
ERRORS = (0, 0.002, 0.005, 0.01, 0.02, 0.05, 1)  # model units; the scene is a unit cube


def write_ply(path, vertices, triangles):
    head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\nproperty double x\nproperty double y\n"
            f"property double z\nelement face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n")
    path.write_bytes(head.encode() + b"".join(struct.pack("<3d", *vertex) for vertex in vertices)
                     + b"".join(struct.pack("<B3i", 3, *triangle) for triangle in triangles))


def read_ply(path):
    """Triangles as triples of places, where the first three properties of a vertex are float x, y, z."""
    head, body = path.read_bytes().split(b"end_header\n", 1)
    words = head.decode().split()
    vertex_count, face_count = (int(words[words.index(name) + 1]) for name in ("vertex", "face"))
    row = 4 * head.count(b"property float")
    places = [struct.unpack_from("<3f", body, row * i) for i in range(vertex_count)]
    faces = (struct.unpack_from("<3I", body, row * vertex_count + 13 * i + 1) for i in range(face_count))
    return [tuple(places[corner] for corner in face) for face in faces]


def rim(triangles):
    """Places on edges that have a triangle on one side only."""
    sides = collections.Counter((face[i], face[(i + 1) % 3]) for face in triangles for i in range(3))
    return {place for (a, b), count in sides.items() if sides[b, a] != count for place in (a, b)}


class Test:
    def __init__(self, program, folder):
        self.program, self.folder, self.failures = program, folder, 0
        self.measurer, self.peer = program.parent / "surface_distance", program.parent / "peer_dag"

    def check(self, claim, holds, detail=""):
        print("%s %s" % ("ok  " if holds else "FAIL", claim))
        if not holds:
            self.failures += 1
            print("     " + str(detail))

    def run(self, *command):
        return subprocess.run([str(word) for word in command], capture_output=True, text=True)

    def measured(self, *words):
        result = self.run(self.measurer, *words)
        return [json.loads(line) for line in result.stdout.splitlines()], result

    def test_measure(self):
        square, faces = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 3)]
        paths = [self.folder / f"{name}.ply" for name in ("square", "shifted", "half")]
        write_ply(paths[0], square, faces)
        write_ply(paths[1], [(x, y, 0.25) for x, y, _ in square], faces)
        write_ply(paths[2], [(x / 2, y, 0) for x, y, _ in square], faces)
        (same, shifted, half), _ = self.measured("--samples", 20000, paths[0], *paths)
        self.check("a surface is not away from itself", same["max"] < 1e-15, same)
        self.check("a shifted one is away by the shift", abs(shifted["max"] - 0.25) < 1e-12 and
                   abs(shifted["rms"] - 0.25) < 1e-12 and abs(shifted["diagonal"] - 2**0.5) < 1e-6, shifted)
        # half of the square is 0 away, the other half x in 0 to 0.5: mean square 1/24
        self.check("what is missing counts from the whole to the part alone", half["max_forward"] == 0.5 and
                   half["max_backward"] < 1e-15 and abs(half["rms_forward"] - (1 / 24)**0.5) < 2e-3, half)
        paths[1].write_bytes(paths[1].read_bytes()[:-5])
        self.check("a file that is cut short is refused", self.measured(*paths)[1].returncode == 1)

    def test_peer(self):
        scene = self.folder / "scene.ply"
        self.run(self.program, "scene", "isosurface", "--triangles", 3000, "--seed", 1, "-o", scene, "--quiet")
        result = self.run(self.peer, scene, self.folder / "cut", *ERRORS)
        facts, *cuts = [json.loads(line) for line in result.stdout.splitlines() if line.startswith("{")]
        self.check("there are several levels", facts["levels"] > 2 and facts["clusters"] > 20, facts)
        counts = [cut["triangles"] for cut in cuts]
        self.check("cuts get coarser with the error", len(cuts) == len(ERRORS) and counts[0] == facts["triangles_in"] and
                   counts == sorted(counts, reverse=True) and counts[-1] < counts[0] / 8, counts)
        self.check("no cluster is drawn above the error", all(cut["claimed"] <= cut["error"] for cut in cuts), cuts)
        allowed = rim(read_ply(scene))
        cracks = [len(rim(read_ply(pathlib.Path(cut["file"]))) - allowed) for cut in cuts]
        self.check("no cut has an open edge that the input has not", not any(cracks), cracks)

    def test_interpolation(self):
        # triangles = 100 / error: a straight line in logarithms
        line = [{"triangles": count, "rms": 100 / count, "max": 200 / count} for count in (1000, 10000, 100000)]
        self.check("between cuts the line is straight in logarithms",
                   math.isclose(curve_plot.triangles_at(line, "rms", 0.02), 5000) and
                   math.isclose(curve_plot.triangles_at(line, "max", 0.004), 50000))
        self.check("outside of the cuts nothing is told", curve_plot.triangles_at(line, "rms", 0.2) is None and
                   curve_plot.triangles_at(line, "rms", 1e-4) is None)

    def test_command(self):
        docs, images, table = self.folder / "docs.md", self.folder / "images", self.folder / "curve.csv"
        docs.write_text(f"before\n{curve.BEGIN}\nSTALE\n{curve.END}\nafter\n")
        command = [sys.executable, "-B", ROOT / "bench" / "curve.py", "--data", self.folder, "--stroll", self.program,
                   "--peers", self.peer, "--measurer", self.measurer, "--scratch", self.folder / "scratch", "--log",
                   self.folder / "log.jsonl", "--docs", docs, "--images", images, "--csv", table, "--samples", 2000,
                   "--models", f"{MODEL},missing", "--write-docs"]
        result, text = self.run(*command), docs.read_text()
        self.check("a model is measured, one that is not there is skipped", result.returncode == 0 and
                   "Skipped, its data was not there: missing" in text, result.stderr)
        self.check("the table has figures and no hole", f"| {MODEL} | rms | " in text and "None" not in text and
                   "STALE" not in text and text.startswith("before\n") and text.endswith("after\n"), text)
        with open(table, newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        programs = {row["program"] for row in rows}
        self.check("the cuts lie beside", len(rows) > 8 and all(0 < float(row["rms"]) <= float(row["max"]) for row in rows), rows)
        self.check("both ways to build and the peer are there",
                   {"stroll", "stroll --certify"} < programs and any("cluster DAG" in name for name in programs), programs)
        picture = (images / f"curve_{MODEL}.svg").read_text()
        self.check("the picture has two lines a program", picture.count("<polyline") == 2 * len(programs), picture)
        again = self.run(*command)
        self.check("what is there is kept", again.stdout.count(": kept") == len(programs) and docs.read_text() == text, again.stdout)


def main():
    program = pathlib.Path(os.path.abspath(sys.argv[1]))
    if not (program.parent / "peer_dag").exists():
        print("there is no peer_dag: it is built where libmeshoptimizer is installed")
        return 77
    with tempfile.TemporaryDirectory() as folder:
        test = Test(program, pathlib.Path(folder))
        for part in (test.test_measure, test.test_peer, test.test_interpolation, test.test_command):
            part()
        return 1 if test.failures else 0


if __name__ == "__main__":
    sys.exit(main())
