#!/usr/bin/env python3
"""What the program says: wrong lines are refused with the fact that is wrong, and what an image lacks is said.

usage: test_sentences.py PROGRAM"""
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(os.environ.get("STRL_TEST_ROOT", pathlib.Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(ROOT / "bench"))
sys.dont_write_bytecode = True
import sheets


class Test:
    def __init__(self, program, folder):
        self.program, self.folder, self.failures = program, folder, 0
        self.scene, self.model = folder / "scene.ply", folder / "scene.stroll"
        self.run("scene", "isosurface", "--triangles", "100K", "-o", self.scene)
        self.built = self.run("build", self.scene, "-o", self.model, "--unit", "mm")

    def run(self, *words):
        command = [str(word) for word in (self.program, *words)]
        return subprocess.run(command, capture_output=True, text=True, cwd=self.folder)

    def check(self, claim, holds, detail=""):
        print("%s %s" % ("ok  " if holds else "FAIL", claim))
        if not holds:
            self.failures += 1
            print("     " + str(detail))

    def refused(self, status, sentence, *words):
        result = self.run(*words)
        self.check("refused: " + sentence, result.returncode == status and sentence in result.stderr and
                   result.stderr.count("\n") == 1, (words, result.returncode, result.stderr))

    def test_bounds(self):
        self.refused(2, "--memory lies between 64M and 1024T, found 1M", "build", self.scene, "-o", "x",
                     "--memory", "1M")
        self.refused(2, "--memory lies between 1M and 1024T, found 64K", "render", self.model, "-o", "x",
                     "--memory", "64K")
        self.refused(2, "--gpu-memory lies between 4M and", "render", self.model, "-o", "x", "--gpu-memory", "1K")
        self.refused(2, "--frames lies between 1 and 1M, found 2M", "render", self.model, "-o", "x", "--frames", "2M")
        self.refused(2, "--error lies between 1e-06 and 1000000, found 0", "view", self.model, "--error", "0")

    def test_units(self):
        self.check("the unit is stored", json.loads(self.run("info", self.model, "--json").stdout)["unit"] == "mm")
        for unit in ("foo", "", "m\tm", "m" * 99):
            self.refused(2, "--unit is one of um|mm|cm|dm|m|km|in|ft|yd|mi, not", "build", self.scene, "-o", "x",
                         "--unit", unit)
        self.check("nothing was built", not (self.folder / "x").exists())

    def test_up(self):
        (self.folder / "one.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        for words, axis in ((("one.obj",), "y"), (("one.obj", "--up", "z"), "z"), ((self.scene, ), "z"),
                            ((self.scene, "--up", "y"), "y")):
            self.run("build", *words, "-o", "up.stroll")
            up = json.loads(self.run("info", "up.stroll", "--json").stdout)["up"]
            self.check("up is %s" % axis, up == axis, (words, up))

    def test_cameras(self):
        for spec, sentence in (
                ("eye 1 1 1 target 1 1 1", "camera: eye and target are the same point"),
                ("up 0 0 0", "camera: up is zero"),
                ("eye 0 0 5 target 0 0 0 up 0 0 1", "camera: up is along the line from eye to target"),
                ("fov 0", "camera: fov is not between 0 and 180 degrees"), ("fov 180", "camera: fov is not between"),
                ("eye 1 2 nose", 'camera: expected a number after "eye", found "nose"')):
            self.refused(2, sentence, "render", self.model, "--camera", spec, "-o", "x.png")
        good = ("--camera", "eye 0.5 0.5 3 target 0.5 0.5 0 up 0 1 0")
        for camera in ((), good):
            for sentence, *words in (("is not a container", self.scene, "-o", "x.png"),
                                     ("images go to NAME.png", self.model, "-o", "x.jpg"),
                                     ("is a folder", self.model, "--stats", self.folder)):
                self.refused(1, sentence, "render", *words, *camera)

    def test_paths(self):
        cameras = self.folder / "cameras.json"
        self.run("render", self.model, "--path", "orbit", "--frames", "2", "--save-path", cameras, "--stats", "s",
                 "--backend", "null")
        self.refused(1, "--path is orbit, walk, flythrough or a path file: cannot open the path file orbits: "
                     "No such file", "render", self.model, "--path", "orbits", "-o", "x")
        self.refused(2, "a path file has its own", "render", self.model, "--path", cameras, "--frames", "3", "-o", "x")
        self.refused(2, "there is no such path here", "render", self.model, "--frames", "3", "-o", "x")
        wrong = json.loads(cameras.read_text())
        wrong["frames"][1]["up"] = [0, 0, 0]
        cameras.write_text(json.dumps(wrong))
        self.refused(1, "cameras.json: frame 1: up is zero", "render", self.model, "--path", cameras, "-o", "x")
        self.refused(1, "missing is no folder of images that `stroll render` wrote: cannot open the path file "
                     "missing/path.json: No such file", "compare", "missing", "other")

    def test_render(self):
        self.refused(2, "the null backend draws no image for -o x.png", "render", self.model, "--backend", "null",
                     "-o", "x.png")
        broken = bytearray(self.model.read_bytes())
        broken[5000] ^= 1
        (self.folder / "broken.stroll").write_bytes(broken)
        self.refused(1, "broken.stroll: page at byte 4096: checksum", "render", "broken.stroll", "-o", "x.png")

    def test_missing_word(self):
        self.refused(2, "MODEL is missing: --against takes all words that follow it, so MODEL goes before it or "
                     "after --", "verify", "--against", self.scene, self.model)

    def test_coarse(self):
        """A budget that is too small is said, with the largest error and the option."""
        render = ("render", self.model, "--size", "640x360", "--backend", "null", "--stats", self.folder / "s.jsonl")
        result = self.run(*render, "--memory", "1M")
        drawn = json.loads((self.folder / "s.jsonl").read_text())["max_error_px"]
        said = re.fullmatch(r"stroll: --memory 1M holds too little for a pixel error of 1: 1 of 1 frame is coarser, "
                            r"with errors up to ([0-9.]+) pixels\n", result.stderr)
        self.check("too little memory is said with the error that it costs", result.returncode == 0 and drawn > 1 and
                   said and abs(float(said[1]) / drawn - 1) < 0.01, (result, drawn))
        result = self.run(*render, "--memory", "1M", "--quiet")
        told = json.loads((self.folder / "s.jsonl").read_text())
        self.check("--quiet leaves it to the statistics", result.returncode == 0 and result.stderr == "" and
                   told["allowed_error_px"] > 1 and told["max_error_px"] == drawn, (result, told))
        result = self.run(*render)
        self.check("enough memory is not", result.returncode == 0 and result.stderr == "", result)
        result = self.run(*render, "--memory", "1M", "--error", "1000")
        self.check("nor is an error that the budget allows", result.returncode == 0 and result.stderr == "", result)
        result = self.run(*render, "--memory", "1M", "--path", "orbit", "--frames", "3", "--error", "0.5")
        self.check("frames are counted", "a pixel error of 0.5: 3 of 3 frames are coarser" in result.stderr and
                   result.stderr.count("\n") == 1, result.stderr)
        centre = "eye 0.5 0.5 0.25 target 1 0.5 0.25 up 0 0 1"
        result = self.run(*render, "--camera", centre)
        drawn = json.loads((self.folder / "s.jsonl").read_text())["max_error_px"]
        self.check("the eye inside a node's box is no lack of memory", drawn is None and result.stderr == "",
                   (drawn, result.stderr))

    def test_sheet(self):
        """Three frames in a sheet of two by two."""
        self.run("render", self.model, "--path", "orbit", "--frames", "3", "--size", "64x48", "-o", "sheet")
        rows = sheets.read_png(self.folder / "sheet" / "contact.png")
        empty = {bytes(row[i:i + 3]) for row in rows[48:] for i in range(3 * 64, 3 * 128, 3)}
        background = bytes(sheets.read_png(self.folder / "sheet" / "frame_00000.png")[0][:3])
        self.check("the sheet's empty cell is background", len(rows) == 96 and empty == {background},
                   (len(rows), empty, background))

    def test_counts(self):
        one = self.folder / "one.stl"
        one.write_text("solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n"
                       "endfacet\nendsolid\n")
        built = self.run("build", one, "-o", "one.stroll")
        self.check("one node is on one level", "1 triangle in 1 node on 1 level," in built.stdout, built.stdout)
        rate = re.search(r", [1-9][0-9.]*( [KM])? triangles a second \([1-9]", built.stdout)
        self.check("a slow rate is no zero", rate, built.stdout)
        told = self.run("info", "one.stroll").stdout
        self.check("one part is one part", "1 part, 1 material, 1 placement\n" in told and
                   "1 node, 1 level, 1 group, 1 page" in told, told)

    def test_order(self):
        """Through one pipe the report stands before the sentence about it."""
        for name, *colours in (("a",), ("b", "--debug", "cluster")):
            self.run("render", self.model, "--camera", "eye 0.5 0.5 3 target 0.5 0.5 0 up 0 1 0", "--size", "64x48",
                     "--depth", "-o", name, *colours)
        command = [str(self.program), "compare", "a", "b"]
        result = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=self.folder)
        lines = result.stdout.splitlines()
        self.check("the report comes before its verdict", result.returncode == 1 and lines[0] == "1 frame" and
                   lines[-1].startswith("stroll: colour"), result.stdout)

    def test_help(self):
        commands = self.run("--help").stdout.split("commands:\n")[1].split("\n\n")[0].splitlines()
        verbs = [line.split()[1] for line in commands]
        self.check("every command's verb has the same form", len(verbs) >= 9 and
                   not any(verb.endswith("s") for verb in verbs), verbs)
        for command in ("build", "render", "view"):
            told = self.run(command, "--help").stdout
            self.check("the help of %s says what --quiet silences" % command,
                       "say nothing but errors" in told)
        told = self.run("render", "--help").stdout
        self.check("the help says when max_error_px is null", "null where the eye is inside a node's box" in told)


def main():
    program = os.path.abspath(sys.argv[1])
    with tempfile.TemporaryDirectory() as folder:
        test = Test(program, pathlib.Path(folder))
        for name in dir(test):
            if name.startswith("test_"):
                getattr(test, name)()
        return 1 if test.failures else 0


if __name__ == "__main__":
    sys.exit(main())
