#!/usr/bin/env python3
"""docs/guide/: the text shows the code that is built, and the programs do what it says. The picture of draw_gl.c
covers the same pixels as our own renderer's from the same place.

usage: test_guide.py PROGRAM      in the folder of the build
       test_guide.py --write      brings the text's blocks up to date with the files"""
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "support"))
from png import read_png

GUIDE = pathlib.Path(__file__).resolve().parents[2] / "docs/guide"
BLOCK = re.compile(r"^<!-- (\w+\.[ch]): (\w+) -->\n```c\n(.*?)```$", re.M | re.S)
SIZE = "1280x720"
PACK_HEAD = 100


def regions_of(path):
    return dict(re.findall(r"/\* begin: (\w+) \*/\n(.*?)/\* end: \1 \*/\n", path.read_text(), re.S))


def covered(rows):
    """Which pixels are not the background, which the image's corner is of."""
    ground = rows[0][:3]
    return [[row[x:x + 3] != ground for x in range(0, len(row), 3)] for row in rows]


class Test:
    def __init__(self, program, folder):
        self.program, self.folder, self.failures = program, folder, 0
        self.built = program.parent
        self.mesh, self.model = folder / "mesh.ply", folder / "model.stroll"

    def check(self, claim, good, detail=""):
        print(f"{'ok    ' if good else 'FAILED'} {claim}{'' if good else ': ' + str(detail)}", flush=True)
        self.failures += not good

    def run(self, name, *words):
        result = subprocess.run([str(self.built / name), *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                text=True)
        self.check(f"{name} succeeds", result.returncode == 0, result.stderr + result.stdout)
        return result.stdout

    # ---- the text

    def blocks_are_the_code(self):
        text = (GUIDE / "embedding.md").read_text()
        shown = BLOCK.findall(text)
        self.check("each block of C names its file", len(shown) == text.count("```c\n"), text.count("```c\n"))
        for file, name, code in shown:
            self.check(f"the text's {file}: {name} is the file's", regions_of(GUIDE / file).get(name) == code)
        for path in sorted(GUIDE.glob("*.[ch]")):
            names = [name for file, name, _ in shown if file == path.name]
            self.check(f"all of {path.name} is shown, once, in its order", names == list(regions_of(path)), names)
            self.check(f"{path.name} marks regions alone", path.read_text().count("begin: ") == len(names))

    # ---- the programs

    def makes_a_model(self):
        self.run("stroll", "scene", "isosurface", "-n", "60K", "-o", self.mesh, "--quiet")
        self.run("stroll", "build", self.mesh, "-o", self.model, "--quiet")
        self.info = json.loads(self.run("stroll", "info", "--json", self.model))

    def first_walk_walks(self):
        out = self.run("guide_first_walk", self.model)
        facts = f"{self.info['triangles']} triangles, 1 parts, unit unknown, z is up\n"
        self.check("facts are the container's", out.startswith(facts), out)
        frames = re.findall(r"^frame \d: [1-9]\d* nodes, [1-9]\d* triangles", out, re.M)
        self.check("ten frames draw something", len(frames) == 10, out)
        errors = [float(e) for e in re.findall(r"wrong by at most ([\d.]+) pixels, part", out)]
        self.check("a settled front keeps the pixel error", errors and max(errors) <= 1, out)

    def an_empty_model_is_walked_too(self):
        lines, empty = self.folder / "lines.obj", self.folder / "lines.stroll"
        lines.write_text("v 0 0 0\nv 1 0 0\nl 1 2\n")
        self.run("stroll", "build", lines, "-o", empty, "--quiet")
        out = self.run("guide_first_walk", empty)
        frames = re.findall(r"^frame \d: \d nodes, 0 triangles, 0 nodes still", out, re.M)
        self.check("a model without a triangle has ten frames without one, and no corner", len(frames) == 10 and
                   "of level" not in out, out)

    def own_source_keeps_its_budget(self):
        pack = self.folder / "pack.bin"
        pack.write_bytes(bytes(PACK_HEAD) + self.model.read_bytes())
        out = self.run("guide_own_source", pack, PACK_HEAD)
        line = r"^budget (\d+) KiB: holds (\d+) KiB, (\d+) triangles; wanted 0.5 pixels, allowed ([\d.]+)$"
        lines = [tuple(map(float, words)) for words in re.findall(line, out, re.M)]
        self.check("three budgets are tried", len(lines) == 3, out)
        self.check("no budget is passed", all(held <= budget for budget, held, _, _ in lines), out)
        self.check("a smaller budget is a coarser image", sorted(lines, key=lambda line: line[3]) == lines and
                   lines[0][3] == 0.5 < lines[-1][3], out)

    def errors_are_sentences(self):
        out = self.run("guide_errors", self.model)
        text = (GUIDE / "embedding.md").read_text()
        said = out.replace(str(self.built / "guide_errors"), "./errors")
        self.check("the errors are those of the text", f"```\n{said}```\n" in text, said)

    def builder_builds(self):
        again = self.folder / "again.stroll"
        out = self.run("guide_build_model", again, self.mesh)
        self.check("progress reaches the end", "100% write\n" in out, out)
        self.check("no triangle is lost", f"{self.info['triangles']} in the finest level" in out, out)
        self.run("stroll", "verify", again, "--quiet")

    def camera(self, turn):
        bounds, up = self.info["bounds"], "xyz".index(self.info["up"])
        target = [(bounds[i] + bounds[i + 3]) / 2 for i in range(3)]
        radius = math.dist(bounds[:3], bounds[3:]) / 2
        eye = list(target)
        eye[(up + 1) % 3] += 1.6 * radius * math.cos(turn)
        eye[(up + 2) % 3] += 1.6 * radius * math.sin(turn)
        eye[up] += 0.7 * radius
        words = [*eye, "target", *target, "up", *(int(i == up) for i in range(3)), "fov", 60]
        return "eye " + " ".join(repr(word) if isinstance(word, float) else str(word) for word in words)

    def has_no_gl(self, picture):
        tried = subprocess.run([str(self.built / "guide_draw_gl"), str(self.model), str(picture)], stdout=subprocess.DEVNULL,
                               stderr=subprocess.PIPE, text=True)
        return tried.returncode == 1 and "this system has no OpenGL" in tried.stderr

    def picture_covers_what_ours_does(self):
        ours, theirs = self.folder / "ours.png", self.folder / "theirs.png"
        if self.has_no_gl(theirs):
            print("not looked at: this system has no OpenGL without a window, so there is no picture")
            return
        out = self.run("guide_draw_gl", self.model, theirs)
        self.check("the picture keeps the pixel error", float(re.search(r"at most ([\d.]+) pixels", out)[1]) <= 1, out)
        self.run("stroll", "render", self.model, "--camera", self.camera(0.5), "--size", SIZE, "-o", ours, "--quiet")
        rows = zip(covered(read_png(ours)), covered(read_png(theirs)))
        pairs = [pair for row_a, row_b in rows for pair in zip(row_a, row_b)]
        both, either = sum(a and b for a, b in pairs), sum(a or b for a, b in pairs)
        self.check("the model fills a part of the picture", both > 100000, both)
        self.check("the same pixels are covered as by our renderer", either - both <= both / 1000, (both, either))

    def all(self):
        self.blocks_are_the_code()
        self.makes_a_model()
        self.first_walk_walks()
        self.an_empty_model_is_walked_too()
        self.own_source_keeps_its_budget()
        self.errors_are_sentences()
        self.builder_builds()
        self.picture_covers_what_ours_does()


def write_blocks():
    path = GUIDE / "embedding.md"
    path.write_text(BLOCK.sub(lambda found: found[0].replace(found[3], regions_of(GUIDE / found[1])[found[2]]),
                              path.read_text()))
    return 0


def main():
    if sys.argv[1] == "--write":
        return write_blocks()
    program = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory(prefix="stroll-guide-") as folder:
        test = Test(program, pathlib.Path(folder))
        test.all()
    return 1 if test.failures else 0


if __name__ == "__main__":
    sys.exit(main())
