#!/usr/bin/env python3
"""Models behind an address: render, info and extract give what they give of the file, whatever the link and the server do;
what was read is kept; what has changed is recognised.

usage: test_remote.py PROGRAM"""
import filecmp
import json
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time

ROOT = pathlib.Path(os.environ.get("STRL_TEST_ROOT", pathlib.Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(ROOT / "tests/support"))
sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "tests/readers"))
import gltf_writer
from shaped_server import ShapedServer

CAMERAS = ("--path", "orbit", "--frames", "3", "--size", "480x270")
CHANGED = "the model has changed since it was opened: open it again"


class Test:
    def __init__(self, program, folder):
        self.program, self.folder, self.failures, self.runs = program, folder, 0, 0
        self.web = folder / "web"
        self.web.mkdir()
        self.model, self.other = self.web / "model.stroll", self.web / "other.stroll"
        for path, seed in ((self.model, 1), (self.other, 2)):
            scene = folder / "scene.ply"
            self.must("scene", "isosurface", "--triangles", "400K", "--seed", seed, "-o", scene)
            self.must("build", scene, "-o", path)
        self.local = self.render(self.model)[0]
        self.local_other = self.render(self.other)[0]

    def run(self, *words):
        command = [str(word) for word in (self.program, *words)]
        environment = {**os.environ, "XDG_CACHE_HOME": str(self.folder / "home-cache"), "no_proxy": "127.0.0.1"}
        return subprocess.run(command, capture_output=True, text=True, cwd=self.folder, env=environment, timeout=300)

    def must(self, *words):
        result = self.run(*words)
        if result.returncode:
            sys.exit(f"{words}: {result.stderr}")
        return result

    def render(self, model, *words):
        """The folder of images, the lines of --stats, the result."""
        self.runs += 1
        out, stats = self.folder / f"out{self.runs}", self.folder / f"out{self.runs}.jsonl"
        result = self.run("render", model, *CAMERAS, "-o", out, "--stats", stats, *words)
        lines = [json.loads(line) for line in stats.read_text().split("\n") if line] if stats.exists() else []
        return out, lines, result

    def check(self, claim, holds, detail=""):
        print("%s %s" % ("ok  " if holds else "FAIL", claim))
        if not holds:
            self.failures += 1
            print("     " + str(detail))

    def same(self, claim, out, local, result):
        names = sorted(path.name for path in local.glob("*.png"))
        _, differ, missing = filecmp.cmpfiles(local, out, names, shallow=False)
        self.check(claim, result.returncode == 0 and not differ and not missing and len(names) == 4,
                   (result.returncode, result.stderr, differ, missing))

    def refused(self, sentence, *words):
        result = self.run(*words)
        self.check("refused: " + sentence, result.returncode == 1 and sentence in result.stderr and
                   result.stderr.count("\n") == 1, (words, result.returncode, result.stderr))

    # ---- what it gives

    def test_images_equal_those_of_the_file(self, server):
        shutil.rmtree(self.folder / "home-cache", ignore_errors=True)
        for claim, bits, latency in (("on a fast link", 0, 0), ("on a slow one", 20e6, 0.02)):
            server.bits_per_second, server.latency = bits, latency
            out, lines, result = self.render(server.url("model.stroll"), "--no-cache")
            self.same(f"images equal those of the file {claim}", out, self.local, result)
            network = lines[-1]["network"]
            self.check(f"--stats tells of the network {claim}", network["bytes"] > 0 and network["requests"] > 0 and
                       network["failures"] == 0 and network["latency_ms"] >= 1000 * latency and
                       network["bytes_per_second"] > 0 and network["cache_hits"] == 0, network)
            if bits:
                self.check("no more bandwidth is measured than there is", network["bytes_per_second"] < 1.3 * bits / 8, network)
        server.bits_per_second = server.latency = 0
        self.check("no cache was made", not (self.folder / "home-cache/stroll").exists())
        self.check("of a file --stats has no network", "network" not in self.render(self.model)[1][-1])
        for words in ((), ("--full",)):
            local, remote = self.render(self.model, *words)[0], self.render(server.url("model.stroll"), *words)
            self.same(f"the same with {words or 'a cache'}", remote[0], local, remote[2])

    def test_opening_waits_for_little(self, server):
        before = len(server.asked)
        server.latency = 0.05
        result = self.run("render", server.url("model.stroll"), "--realtime", "1000", "--path", "orbit", "--frames", "1",
                          "--size", "480x270", "-o", "first.png", "--stats", "first.jsonl", "--no-cache")
        server.latency = 0
        line = json.loads((self.folder / "first.jsonl").read_text())
        asked = server.asked[before:]
        self.check("the first image has the root and waits for no more", result.returncode == 0 and
                   line["covered_pixels"] > 1000 and line["missing_nodes"] > 0 and line["bytes_read"] == 0,
                   (result.stderr, line))
        opening = [(first, last) for _, first, last in asked[:3]]
        self.check("the header, the end of the file, the root's page", opening[0] == (0, 4095) and
                   sum(last + 1 - first for first, last in opening) < 400000, opening)

    def test_many_trees_are_opened_together(self, server):
        """Meshes of two uses each. One after the other their records and roots took two round trips a tree."""
        trees, model, roots, side = 150, gltf_writer.Model(), [], 48
        for tree in range(trees):
            points = [(x, y, math.sin(x + tree) + math.cos(y)) for y in range(side) for x in range(side)]
            faces = [y * side + x + corner for y in range(side - 1) for x in range(side - 1)
                     for corner in (0, 1, side, 1, side + 1, side)]
            mesh = model.mesh({"attributes": {"POSITION": model.accessor(points, gltf_writer.FLOAT)},
                               "indices": model.accessor(faces, gltf_writer.U32)})
            roots += [model.node(mesh=mesh, translation=[tree % 15 * 60, tree // 15 * 60, 60 * use]) for use in range(2)]
        model.scene(*roots)
        model.glb(self.folder / "trees.glb")
        path = self.web / "trees.stroll"
        self.must("build", self.folder / "trees.glb", "-o", path)
        self.check("there are many trees", len(json.loads(self.must("info", path, "--json").stdout)["trees"]) == trees)
        local = self.render(path)[0]
        server.latency = 0.08
        server.asked.clear()
        out, lines, result = self.render(server.url("trees.stroll"), "--no-cache")
        server.latency = 0
        self.same("images of many trees are the same", out, local, result)
        self.check("a few requests open them", len(server.asked) < trees / 3, len(server.asked))

    def test_info_and_extract(self, server):
        url = server.url("model.stroll")
        self.check("info is the same", self.run("info", url, "--json").stdout == self.run("info", self.model, "--json").stdout)
        for model, name in ((self.model, "local.ply"), (url, "remote.ply")):
            self.must("extract", model, "--error", "0.01", "-o", name)
        self.check("extract is the same", filecmp.cmp(self.folder / "local.ply", self.folder / "remote.ply", shallow=False))

    # ---- faults

    def test_a_path_over_what_cannot_be_read(self, server):
        server.asked.clear()
        server.fault = lambda number, path: "500" if number > 6 else None
        stats = self.folder / "along.jsonl"
        result = self.run("render", server.url("model.stroll"), "--no-cache", "--path", "walk", "--frames", "2", "--size", "64x36",
                          "--stats", stats)
        server.fault = None
        self.check("no path leads over a surface that is not there", result.returncode == 1 and not stats.exists() and
                   "nodes of the surface that --path walk goes along could not be read" in result.stderr and
                   result.stderr.count("\n") == 1, (result.returncode, result.stderr, len(server.asked)))

    def test_faults_heal(self, server):
        for fault in ("500", "cut", "wrong", "shifted"):
            server.fault = lambda number, path, fault=fault: fault if number % 5 == 3 else None
            server.asked.clear()
            out, lines, result = self.render(server.url("model.stroll"), "--no-cache")
            self.same(f"now and then {fault}: the images are whole", out, self.local, result)
            self.check(f"{fault}: it was noticed", lines[-1]["network"]["retries"] + lines[-1]["faults"] > 0, lines[-1])
            self.check(f"{fault}: nothing is said of what healed", not result.stderr, result.stderr)
        server.fault = None

    def test_what_comes_wrong_again_heals(self, server):
        server.asked.clear()
        self.render(server.url("model.stroll"), "--no-cache")
        at, times = server.asked[len(server.asked) // 2][1], []

        def wrong_at_first(number, path):
            _, first, last = server.asked[number]
            if last is None or not first <= at <= last:
                return None
            times.append(number)
            return "wrong" if len(times) <= 5 else None

        server.fault = wrong_at_first
        server.asked.clear()
        out, lines, result = self.render(server.url("model.stroll"), "--no-cache")
        server.fault = None
        self.check("one page comes wrong five times in a row", len(times) >= 6, times)
        self.same("five times wrong: the images are whole", out, self.local, result)
        self.check("five times wrong: nothing is said of what healed", not result.stderr, result.stderr)

    def test_wrong_bytes_are_not_kept(self, server):
        cache = self.folder / "wrong-cache"
        server.fault = lambda number, path: "wrong" if number % 4 == 3 else None
        server.asked.clear()
        self.render(server.url("model.stroll"), "--cache", cache)
        server.fault = None
        out, lines, result = self.render(server.url("model.stroll"), "--cache", cache)
        self.same("wrong bytes do not come out of the cache", out, self.local, result)
        self.check("and without a fault", lines[-1]["faults"] == 0, lines[-1])

    def test_opening_asks_again_for_wrong_bytes(self, server):
        def wrong(when):
            server.fault = lambda number, path: "wrong" if when(number) else None
            server.asked.clear()
        for words in ((), ("--full",)):
            wrong(lambda number: number % 2 == 0 and number < 10)
            out, _, result = self.render(server.url("model.stroll"), "--no-cache", *words)
            self.same(f"at first every other answer is wrong: it opens all the same {words}", out, self.render(self.model, *words)[0], result)
        wrong(lambda number: number < 4)
        result = self.run("info", server.url("model.stroll"), "--no-cache")
        self.check("the first four are: so does it", result.returncode == 0, result.stderr)
        wrong(lambda number: number > 0)
        self.refused("checksum is", "info", server.url("model.stroll"), "--no-cache")
        self.check("and gives up after some times", 4 < len(server.asked) < 12, server.asked)
        server.fault = None

    def test_restart(self, server):
        """The server dies when some of it has been read, and comes back half a second later."""
        server.bits_per_second = 20e6
        server.asked.clear()

        def accident():
            while len(server.asked) < 8:
                time.sleep(0.002)
            server.kill()
            time.sleep(0.5)
            server.restart()
        thread = threading.Thread(target=accident)
        thread.start()
        out, lines, result = self.render(server.url("model.stroll"), "--no-cache")
        thread.join()
        server.bits_per_second = 0
        self.same("killed and restarted: the images are whole", out, self.local, result)

    def test_swap(self, server):
        live = self.web / "live.stroll"
        shutil.copy(self.model, live)
        server.asked.clear()

        def swap(number, path):
            if number == 3:  # all that opening waits for has come
                shutil.copy(self.other, self.web / "new")
                os.replace(self.web / "new", live)
        server.fault = swap
        secret = server.url("live.stroll?signature=s3cret").replace("://", "://who:pa55@")
        out, lines, result = self.render(secret, "--no-cache", "--quiet")
        server.fault = None
        self.check("nothing of an address that may be a secret is said",
                   "live.stroll" in result.stderr and not re.search("who|pa55|s3cret", result.stderr), result.stderr)
        self.check("a swap under way is said, whether or not to be quiet, and is a failure", result.returncode == 1 and
                   "3 of 3 frames are coarser" in result.stderr and CHANGED in result.stderr and result.stderr.count("\n") == 1 and
                   CHANGED in lines[-1]["last_fault"], (result.returncode, result.stderr))
        self.check("its images are written", len(list(out.glob("*.png"))) == 4)
        self.check("what there is, is drawn", all(line["covered_pixels"] > 1000 for line in lines), lines)
        self.check("nobody goes on asking", len(server.asked) < 40, len(server.asked))
        out, lines, result = self.render(server.url("live.stroll"), "--no-cache")
        self.same("opened again, it is the new model", out, self.local_other, result)

    def test_refusals(self, server):
        url = server.url("model.stroll")
        server.fault = lambda number, path: "whole"
        self.refused("the server does not answer byte ranges", "info", url)
        server.fault = lambda number, path: "500"
        self.refused("the server failed (500)", "info", url)
        server.fault = None
        self.refused("there is nothing at this address (404)", "info", server.url("none.stroll"))
        for words in (("verify", url), ("verify", self.model, "--against", "https://who:pa55@host/x.ply?s3cret"),
                      ("build", "https://who:pa55@host/x.ply?s3cret", "-o", "x.stroll")):
            self.refused(f"stroll: {words[0]} reads files, not addresses: save what is there as one first", *words)
        self.refused("redirected too often", "render", server.url("loop"), "-o", "x.png")
        self.refused("models are read from files, http:// and https:// alone", "info", "ftp://host/x")
        self.refused("the server cannot be reached", "render", "http://127.0.0.1:1/x", "-o", "x.png")
        (self.web / "text").write_text("no container\n" * 1000)
        self.refused("127.0.0.1", "info", server.url("text"))
        self.refused("cannot create folder", "info", url, "--cache", self.model / "below")
        out, _, result = self.render(server.url("redirect?model.stroll"))
        self.same("a redirect is followed", out, self.local, result)

    def test_a_server_that_does_not_prove_who_it_is(self, server):
        pair = self.folder / "certificate", self.folder / "key"
        if not shutil.which("openssl"):
            print("not looked at: certificates (there is no openssl)")
            return
        subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=127.0.0.1",
                        "-addext", "subjectAltName=IP:127.0.0.1", "-out", pair[0], "-keyout", pair[1]], check=True,
                       stderr=subprocess.DEVNULL)
        with ShapedServer(self.web, pair) as secure:
            self.refused("the server does not prove who it is", "info", secure.url("model.stroll"))
            self.check("nothing was asked of it", not secure.asked)

    # ---- the cache

    def test_cache(self, server):
        url, cache = server.url("model.stroll"), self.folder / "cache"
        for run in range(2):
            server.asked.clear()
            out, lines, result = self.render(url, "--cache", cache)
            self.same("with a cache, run %d" % run, out, self.local, result)
        self.check("a second run reads nothing but the header", [(first, last) for _, first, last in server.asked] == [(0, 4095)],
                   server.asked)
        self.check("and says so", lines[-1]["network"]["cache_hits"] > 5 and lines[-1]["network"]["bytes"] == 4096,
                   lines[-1]["network"])
        (cache / "notes.txt").write_text("not ours")
        for path in sorted(cache.glob("*.page"))[::2]:
            path.write_bytes(path.read_bytes()[:-1])
        out, _, result = self.render(url, "--cache", cache)
        self.same("truncated entries heal", out, self.local, result)
        shutil.copy(self.other, self.web / "replaced.stroll")
        out, _, result = self.render(server.url("replaced.stroll"), "--cache", cache)
        self.same("another model is not mixed up with it", out, self.local_other, result)
        out, _, result = self.render(url, "--cache", cache, "--cache-size", "1M")
        self.same("with a small cap", out, self.local, result)
        held = sum(path.stat().st_size for path in cache.glob("*.page"))
        self.check("the cap holds", 0 < held <= 1 << 20, held)
        self.check("what is not ours stays", (cache / "notes.txt").read_text() == "not ours")

    def test_default_cache(self, server):
        shutil.rmtree(self.folder / "home-cache", ignore_errors=True)
        self.must("info", server.url("model.stroll"))
        self.check("the default cache is XDG's", list((self.folder / "home-cache/stroll").glob("stroll-*.page")))

    def test_a_walk_on_a_slow_link(self, server):
        """What comes is what is wanted now: a path in real time has every image, and ends nearly whole."""
        server.bits_per_second, server.latency = 5e6, 0.08
        result = self.run("render", server.url("model.stroll"), "--realtime", "20", "--path", "orbit", "--frames", "60",
                          "--size", "480x270", "-o", "walk", "--stats", "walk.jsonl", "--no-cache")
        server.bits_per_second = server.latency = 0
        lines = [json.loads(line) for line in (self.folder / "walk.jsonl").read_text().split("\n") if line]
        self.check("no image has a hole", result.returncode == 0 and len(lines) == 60 and
                   all(line["covered_pixels"] > 1000 for line in lines), result.stderr)
        self.check("no more is asked for than can come",
                   lines[-1]["network"]["bytes"] < 1.5 * 5e6 / 8 * 10 and lines[-1]["network"]["failures"] == 0, lines[-1])

    def all(self):
        with ShapedServer(self.web) as server:
            for name in sorted(dir(self)):
                if name.startswith("test_"):
                    getattr(self, name)(server)


def main():
    with tempfile.TemporaryDirectory(prefix="stroll-remote-") as folder:
        test = Test(os.path.abspath(sys.argv[1]), pathlib.Path(folder))
        test.all()
    return 1 if test.failures else 0


if __name__ == "__main__":
    sys.exit(main())
