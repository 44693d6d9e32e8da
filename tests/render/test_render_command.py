#!/usr/bin/env python3
"""stroll render on small models: files written, paths that repeat, backends that agree, a container that looks like its input.

usage: test_render_command.py PROGRAM"""
import json
import math
import os
import struct
import subprocess
import sys
import tempfile

SIDE = 60


def height(x, y):
    return 0.15 * math.sin(0.3 * x) * math.cos(0.23 * y)


def write_bumps(path):
    """A bumpy square, z up, without normals, blue on one half."""
    with open(path, "w") as file:
        count, quads = (SIDE + 1) ** 2, SIDE * SIDE
        file.write("ply\nformat ascii 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z\n"
                   "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face %d\n"
                   "property list uchar int vertex_indices\nend_header\n" % (count, quads))
        for y in range(SIDE + 1):
            for x in range(SIDE + 1):
                colour = "60 90 220" if x < SIDE / 2 else "230 220 200"
                file.write("%g %g %g %s\n" % (x * 0.1, y * 0.1, height(x, y), colour))
        for y in range(SIDE):
            for x in range(SIDE):
                a = y * (SIDE + 1) + x
                file.write("4 %d %d %d %d\n" % (a, a + 1, a + SIDE + 2, a + SIDE + 1))


def read_pfm(path):
    with open(path, "rb") as file:
        assert file.readline() == b"Pf\n"
        width, height_px = map(int, file.readline().split())
        assert file.readline() == b"-1.0\n"
        values = struct.unpack("<%df" % (width * height_px), file.read())
    return [values[(height_px - 1 - y) * width:(height_px - y) * width] for y in range(height_px)]


class Test:
    def __init__(self, program, root):
        self.program, self.root, self.failures = program, root, 0
        self.model = root + "/bumps.ply"
        write_bumps(self.model)

    def run(self, *words):
        return subprocess.run([self.program, *words], capture_output=True, text=True)

    def render_any(self, model, out, *options):
        return self.run("render", model, "--size", "160x120", "-o", self.root + "/" + out, *options)

    def render(self, model, out, *options):
        result = self.render_any(model, out, *options)
        if result.returncode:
            self.check("render %s %s" % (os.path.basename(model), " ".join(options)), False, result.stderr)
        return result

    def compare(self, a, b):
        result = self.run("compare", self.root + "/" + a, self.root + "/" + b, "--json")
        return json.loads(result.stdout) if result.stdout else {"holds": False, "error": result.stderr}

    def check(self, claim, holds, detail=""):
        print("%s %s" % ("ok  " if holds else "FAIL", claim))
        if not holds:
            self.failures += 1
            print("     " + str(detail))

    def path_of(self, out):
        with open(self.root + "/" + out + "/path.json") as file:
            return json.load(file)

    def test_files(self):
        stats = self.root + "/stats.jsonl"
        self.render(self.model, "orbit", "--full", "--path", "orbit", "--frames", "4", "--depth", "--stats", stats)
        names = set(os.listdir(self.root + "/orbit"))
        wanted = {"frame_%05d.%s" % (f, e) for f in range(4) for e in ("png", "pfm")} | {"contact.png", "path.json"}
        self.check("a path writes images, depth, sheet and cameras", names == wanted, names ^ wanted)
        path = self.path_of("orbit")
        diagonal = math.sqrt(36 + 36 + (2 * 0.15) ** 2)
        for frame in path["frames"]:
            distance = math.dist(frame["eye"], frame["target"])
            self.check("the orbit's distance is two radii", abs(distance / diagonal - 1) < 0.01, (distance, diagonal))
            rise = (frame["eye"][2] - frame["target"][2]) / distance
            self.check("the orbit's elevation is 20 degrees", abs(rise - math.sin(math.radians(20))) < 1e-9, rise)
        with open(stats) as file:
            lines = [json.loads(line) for line in file]
        needed = ("frame elapsed_ms frame_ms select_ms cull_ms draw_ms triangles splats nodes nodes_culled nodes_backfacing draws requests bytes_read "
                  "resident_bytes gpu_bytes covered_pixels max_error_px missing_nodes disk_waits").split()
        self.check("statistics have a line a frame with every field", len(lines) == 4 and all(n in l for l in lines for n in needed), lines)
        elapsed = [0] + [l["elapsed_ms"] for l in lines]
        self.check("the time since the begin grows by each frame's", all(now - before >= line["frame_ms"] for before, now, line
                                                                         in zip(elapsed, elapsed[1:], lines)), lines)
        self.check("all triangles are drawn", all(l["triangles"] == 2 * SIDE * SIDE for l in lines), lines)
        depth = read_pfm(self.root + "/orbit/frame_00000.pfm")
        covered = sum(v < float("inf") for row in depth for v in row)
        self.check("covered pixels are those with depth", covered == lines[0]["covered_pixels"] and covered > 2000, covered)
        self.check("the middle is as far as the orbit", abs(depth[60][80] - diagonal) < 0.3, depth[60][80])

    def test_repeat(self):
        for name in ("orbit", "flythrough", "walk"):
            self.render(self.model, "first", "--full", "--path", name, "--frames", "5", "--seed", "7", "--depth", "--backend", "gl45")
            self.render(self.model, "again", "--full", "--path", name, "--frames", "5", "--seed", "7", "--depth", "--backend", "gl45")
            self.check("%s repeats" % name, self.path_of("first") == self.path_of("again"))
            self.render(self.model, "loaded", "--full", "--path", self.root + "/first/path.json", "--depth", "--backend", "gl3")
            answer = self.compare("first", "loaded")
            self.check("%s loaded and drawn by gl3 is the same" % name, answer.get("psnr_min_db", 0) > 60 and
                       answer["depth_within"] == 1 and answer["holds"], answer)
        ground = [height(f["eye"][0] * 10, f["eye"][1] * 10) for f in self.path_of("first")["frames"]]
        above = [f["eye"][2] - g for f, g in zip(self.path_of("first")["frames"], ground)]
        radius = math.sqrt(36 + 36 + 0.09) / 2
        self.check("a walker's eye is R/50 above the ground", all(abs(a - radius / 50) < 0.04 for a in above), above)

    def test_container(self):
        container = self.root + "/bumps.stroll"
        built = self.run("build", self.model, "-o", container, "--quiet")
        self.check("the model builds", built.returncode == 0, built.stderr)
        self.render(self.model, "input", "--full", "--path", "flythrough", "--frames", "6", "--depth", "--supersample", "4")
        path = self.root + "/input/path.json"
        self.render(container, "full", "--full", "--path", path, "--depth", "--supersample", "4")
        answer = self.compare("input", "full")
        self.check("a container's finest level looks like its input", answer["holds"] and answer["psnr_median_db"] > 40, answer)
        stats = self.root + "/walk.jsonl"
        self.render(container, "settled", "--path", path, "--depth", "--supersample", "4", "--stats", stats)
        answer = self.compare("input", "settled")
        self.check("a settled walk keeps one pixel", answer["holds"], answer)
        with open(stats) as file:
            lines = [json.loads(line) for line in file]
        self.check("a settled walk misses nothing", all(l["missing_nodes"] == 0 and l["faults"] == 0 for l in lines), lines)
        realtime = self.run("render", container, "--realtime", "200", "--path", path, "--stats", stats, "--backend", "null")
        self.check("a realtime walk never waits for its front", realtime.returncode == 0 and
                   all(json.loads(line)["fronts"] == 1 for line in open(stats)), realtime.stderr)

    def test_damage(self):
        """Where it is seen the images are written, and it is a failure that --quiet does not silence; elsewhere nobody speaks of it."""
        scene, model, stats = (self.root + "/" + name for name in ("plant.ply", "plant.stroll", "damage.jsonl"))
        self.run("scene", "plant", "--triangles", "60K", "-o", scene, "--quiet")
        self.run("build", scene, "-o", model, "--structure", "samples", "--quiet")
        with open(model, "r+b") as file:
            middle = os.path.getsize(model) // 2
            file.seek(middle)
            byte = file.read(1)[0]
            file.seek(middle)
            file.write(bytes([byte ^ 1]))
        for camera, status in (("eye 9 -7 6 target 0 0 4 up 0 0 1 fov 90", 1), ("eye 9 -7 6 target 99 -77 66 up 0 0 1 fov 40", 0)):
            for words, lines in (((), status), (("--quiet",), status), (("--realtime", "1000"), None)):
                result = self.render_any(model, "damage.png", "--error", "1e-6", "--camera", camera, "--stats", stats, *words)
                with open(stats) as file:
                    missing = json.loads(file.read())["missing_nodes"]
                os.remove(stats)
                self.check("damage is told where it is seen", result.returncode == (status if lines is not None else 0) and
                           (lines is None or result.stderr.count("\n") == lines and (missing > 0) == bool(status)) and
                           ("coarser than asked for" in result.stderr) == bool(lines) and os.path.exists(self.root + "/damage.png"),
                           (camera, words, result, missing))
                os.remove(self.root + "/damage.png")

    def test_usage(self):
        for words, status, sentence in (
                ((self.model, "--path", "orbit"), 2, "nothing to write"),
                ((self.model, "--path", "orbit", "--camera", "fov 3", "-o", "x"), 2, "exclude each other"),
                ((self.model, "--backend", "null", "--path", "walk", "--stats", "x"), 2, "null backend"),
                ((self.model, "-o", self.root + "/x.png"), 1, "is not a container"),
                ((self.model, "--full", "--path", "orbit", "-o", self.root + "/x.png"), 1, "need a folder"),
                ((self.model, "--full", "--camera", "eye 1 2 nose", "-o", self.root + "/x.png"), 2, "expected a number"),
                ((self.model, "--full", "--camera", "eye 1 1 1 target 1 1 1", "-o", self.root + "/x.png"), 2, "same point"),
                ((self.model, "--full", "--path", self.model, "-o", self.root + "/x"), 1, "path file"),
                ((self.root + "/none.ply", "--full", "-o", self.root + "/x.png"), 1, "none.ply")):
            result = self.run("render", *words)
            self.check("refused: " + sentence, result.returncode == status and sentence in result.stderr and
                       result.stderr.count("\n") <= 2, (result.returncode, result.stderr))
        camera = "eye 3 3 9 target 3 3 0 up 0 1 0 fov 60"
        result = self.run("render", self.model, "--full", "--camera", camera, "--size", "64x64", "--depth", "-o", self.root + "/one.png")
        depth = read_pfm(self.root + "/one.pfm") if result.returncode == 0 else [[0] * 64] * 64
        self.check("one camera writes one image and its depth", os.path.exists(self.root + "/one.png") and
                   abs(depth[32][32] - 9) < 0.16, result.stderr)


def main():
    with tempfile.TemporaryDirectory() as root:
        test = Test(os.path.abspath(sys.argv[1]), root)
        for part in (test.test_files, test.test_repeat, test.test_container, test.test_damage, test.test_usage):
            part()
        return 1 if test.failures else 0


if __name__ == "__main__":
    sys.exit(main())
