#!/usr/bin/env python3
"""Foreign formats through the program: built where the importer is there and lives; else one sentence, exit status 1, and
nothing left: no output, no scratch, no process.

usage: test_import.py PROGRAM"""
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "build"))
sys.dont_write_bytecode = True
from building import MIB, sanitizers

BOX = ("OFF\n8 6 0\n0 0 0\n2 0 0\n2 1 0\n0 1 0\n0 0 1\n2 0 1\n2 1 1\n0 1 1\n4 0 3 2 1\n4 4 5 6 7\n4 0 1 5 4\n4 1 2 6 5\n"
       "4 2 3 7 6\n4 3 0 4 7\n")


def child_of(parent):
    """The process of that parent which has become the script's last command; None = none yet."""
    for name in os.listdir("/proc"):
        try:
            words = pathlib.Path("/proc", name, "stat").read_text().rsplit(")", 1)
        except (OSError, ValueError):
            continue
        if len(words) == 2 and int(words[1].split()[1]) == parent and words[0].endswith("(sleep"):
            return int(name)
    return None


class Test:
    def __init__(self, program, folder):
        self.program, self.folder, self.failures = program, folder, 0
        self.box, self.out = folder / "box.off", folder / "box.stroll"
        self.box.write_text(BOX)
        self.importer = pathlib.Path(program).parent / "stroll-import"
        # A stroll that has no importer beside it.
        (folder / "bare").mkdir()
        self.bare = shutil.copy(program, folder / "bare" / "stroll")

    def check(self, claim, holds, detail=""):
        print("%s %s" % ("ok  " if holds else "FAIL", claim))
        if not holds:
            self.failures += 1
            print("     " + str(detail))

    def run(self, *words, program=None, importer=None):
        environment = dict(os.environ)
        environment.pop("STROLL_IMPORT", None)
        if importer:
            environment["STROLL_IMPORT"] = str(importer)
        command = [str(word) for word in (program or self.program, *words)]
        return subprocess.run(command, capture_output=True, text=True, cwd=self.folder, env=environment, timeout=300)

    def test_scratch(self, size=260):
        """The spool is gone before the later stages want their scratch."""
        points = [f"{i % size} {i // size} {i * i % 7 / 8}" for i in range(size * size)]
        faces = [corners for y in range(size - 1) for x in range(size - 1) for at in [y * size + x]
                 for corners in ((at, at + 1, at + size), (at + 1, at + size + 1, at + size))]
        off, obj = self.folder / "sheet.off", self.folder / "sheet.obj"
        off.write_text(f"OFF\n{len(points)} {len(faces)} 0\n" + "\n".join(points) + "\n" +
                       "".join("3 %d %d %d\n" % face for face in faces))
        obj.write_text("".join(f"v {point}\n" for point in points) +
                       "".join("f %d %d %d\n" % tuple(corner + 1 for corner in face) for face in faces))
        taken = {}
        for path in (off, obj):
            done = self.run("build", path, "-o", self.out, "--json", "--quiet")
            taken[path] = json.loads(done.stdout)["scratch_bytes"] / len(faces)
            self.out.unlink()
        self.check("a spool adds less to the scratch taken at once than it holds",
                   taken[obj] < taken[off] < taken[obj] + 10, taken)

    def script(self, lines):
        path = self.folder / "importer"
        path.write_text("#!/bin/sh\n" + lines + "\n")
        path.chmod(0o755)
        return path

    def nothing_left(self):
        names = sorted(path.name for path in self.folder.iterdir())
        return not [name for name in names if ".stroll" in name or name.endswith(".spill")], names

    def refused(self, claim, sentence, result):
        clean, names = self.nothing_left()
        self.check(claim, result.returncode == 1 and sentence in result.stderr and "box.off" in result.stderr and
                   result.stderr.count("\n") == 1 and clean, (result.returncode, result.stderr, names))

    def test_missing(self):
        result = self.run("build", self.box, "-o", self.out, program=self.bare)
        self.refused("without an importer the places are told", "read by the program stroll-import, which is neither in "
                     + str(self.folder / "bare"), result)
        self.check("and the package", "libassimp-dev" in result.stderr and "STROLL_IMPORT" in result.stderr, result.stderr)
        self.refused("a named importer must be there", "cannot run /nonexistent",
                     self.run("build", self.box, "-o", self.out, importer="/nonexistent"))
        self.refused("the same of render", "stroll-import",
                     self.run("render", self.box, "--full", "-o", "x.png", program=self.bare))

    def test_deaths(self):
        for name, lines, sentence in (("dies", "kill -SEGV $$", "signal 11 (Segmentation fault)"),
                                      ("fails", "echo no luck >&2; exit 5", "status 5: no luck"),
                                      ("floods", "exec cat /dev/zero", "is broken"),
                                      ("says nothing", "exit 0", "is broken")):
            self.refused("an importer that " + name, sentence,
                         self.run("build", self.box, "-o", self.out, importer=self.script(lines)))

    def hanging(self):
        """A build whose importer hangs, and the importer's id."""
        importer = self.script("echo $$ >&2; exec sleep 1000")
        # The importer may write no file, so it is found by its parent.
        environment = dict(os.environ, STROLL_IMPORT=str(importer))
        build = subprocess.Popen([self.program, "build", self.box, "-o", self.out], stderr=subprocess.PIPE, text=True,
                                 env=environment)
        for _ in range(400):
            found = child_of(build.pid)
            if found:
                return build, found
            time.sleep(0.05)
        raise AssertionError("the importer was not run")

    def is_gone(self, process):
        for _ in range(200):
            if not os.path.exists("/proc/%d" % process):
                return True
            time.sleep(0.05)
        return False

    def test_interrupts(self):
        build, importer = self.hanging()
        build.send_signal(signal.SIGTERM)
        error = build.communicate(timeout=60)[1]
        clean, names = self.nothing_left()
        self.check("a build is interrupted while it imports", build.returncode == 1 and "interrupted" in error and
                   clean and self.is_gone(importer), (build.returncode, error, names))
        build, importer = self.hanging()
        build.kill()
        build.communicate(timeout=60)
        self.check("an importer does not outlive a build that is killed", self.is_gone(importer), importer)
        shutil.rmtree(str(self.out) + ".tmp")

    def test_built(self):
        result = self.run("build", self.box, "-o", self.out, "--json")
        built = json.loads(result.stdout) if result.returncode == 0 else {}
        self.check("a box is built", built.get("triangles_leaf") == 12, result)
        against = self.run("verify", self.out, "--against", self.box)
        self.check("and verified against the file", against.returncode == 0, against)
        moved = self.run("build", self.box, "-o", self.out, "--json", program=self.bare, importer=self.importer)
        self.check("STROLL_IMPORT names the importer", moved.returncode == 0, moved)
        self.out.unlink()
        drawn = self.run("render", self.box, "--full", "--backend", "null", "--camera",
                         "eye 5 5 5 target 1 0.5 0.5 up 0 0 1", "--stats", "s.jsonl")
        self.check("and drawn as read", drawn.returncode == 0, drawn)
        told = self.run("build", self.box, self.folder / "box.off", "-o", self.folder / "box.off")
        self.check("the output is not the input", told.returncode == 1, told)

    def grid(self, side):
        path = self.folder / "grid.off"
        with open(path, "w") as file:
            file.write("OFF\n%d %d 0\n" % (side * side, (side - 1) ** 2))
            file.writelines("%d %d %d\n" % (i % side, i // side, i * i % 7) for i in range(side * side))
            for y in range(side - 1):
                file.writelines("4 %d %d %d %d\n" % (a, a + 1, a + side + 1, a + side)
                                for a in range(y * side, y * side + side - 1))
        return path

    def test_memory(self):
        """The operating system's peak, importer included, stays under --memory."""
        grid = self.grid(700)
        command = [self.program, "build", grid, "-o", self.out, "--json", "--memory", "400M"]
        build = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        output = build.stdout.read()
        error = build.stderr.read()
        _, status, usage = os.wait4(build.pid, 0)
        built = json.loads(output) if os.WIFEXITED(status) and os.WEXITSTATUS(status) == 0 else {}
        self.check("a grid is built within its memory", built.get("triangles_in") == 2 * 699 ** 2 and
                   usage.ru_maxrss * 1024 <= built["peak_rss_bytes"] < 400 * MIB, (error, usage.ru_maxrss, built))
        self.out.unlink()
        result = self.run("build", grid, "-o", self.out, "--memory", "64M")
        clean, names = self.nothing_left()
        self.check("too little memory is one sentence", result.returncode == 1 and "of memory" in result.stderr and
                   "give more by --memory" in result.stderr and result.stderr.count("\n") == 1 and clean, (result, names))


def main():
    program = os.path.abspath(sys.argv[1])
    with tempfile.TemporaryDirectory() as folder:
        test = Test(program, pathlib.Path(folder))
        test.test_missing()
        test.test_deaths()
        test.test_interrupts()
        if test.importer.exists():
            test.test_built()
            if not sanitizers():
                test.test_memory()
                test.test_scratch()
        else:
            print("skipped: stroll-import was not built, libassimp-dev is missing")
        if test.failures:
            return 1
        return 0 if test.importer.exists() else 77


if __name__ == "__main__":
    sys.exit(main())
