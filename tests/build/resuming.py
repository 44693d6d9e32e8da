"""Builds that are stopped on the way. When to stop them is told by what exists in the scratch folder, or is a share of the
time that one took which nothing stopped; either way a build may be over before it could be stopped."""
import json
import os
import signal
import subprocess
import tempfile
import time

from building import STROLL, must

DEADLINE = 600
COUNTS = ("triangles_in", "triangles_leaf", "dropped", "warnings", "vertices", "parts", "materials", "nodes", "groups",
          "levels", "root_triangles", "bytes_out")


def read(path):
    with open(path, "rb") as file:
        return file.read()


class Reference:
    """An input, and what a build of it gives that nothing stops."""
    made = {}

    def __init__(self, triangles):
        self.folder = tempfile.TemporaryDirectory(prefix="stroll-reference-")
        self.source, out = (os.path.join(self.folder.name, name) for name in ("in.ply", "out.stroll"))
        must("scene", "isosurface", "--triangles", triangles, "-o", self.source, "--quiet")
        done = must("build", self.source, "-o", out, "--json")
        self.result, self.seconds, self.bytes = json.loads(done.output), done.seconds, read(out)
        assert not self.result["resumed"]

    @classmethod
    def of(cls, triangles):
        if triangles not in cls.made:
            cls.made[triangles] = cls(triangles)
        return cls.made[triangles]


class Build:
    """A build that runs, in a process of its own."""

    def __init__(self, *words):
        self.child = subprocess.Popen([STROLL, "build", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def wait_for(self, path):
        """Until the file is there, or the build is over."""
        end = time.monotonic() + DEADLINE
        while self.child.poll() is None and not os.path.exists(path):
            assert time.monotonic() < end, "the build does not go on"
            time.sleep(0.0005)

    def wait(self, seconds):
        """So long, or until the build is over."""
        try:
            self.child.wait(timeout=seconds)
        except subprocess.TimeoutExpired:
            pass

    def stop(self, number):
        """Its standard error, or None where it was over before."""
        self.child.send_signal(number)
        self.output, error = self.child.communicate(timeout=DEADLINE)
        assert self.child.returncode in (0, 1, -number), (self.child.returncode, error)
        return None if self.child.returncode == 0 else error


class Scene:
    """A folder with the input of a reference."""

    def __init__(self, folder, triangles):
        self.reference, self.folder = Reference.of(triangles), folder
        self.source, self.out = os.path.join(folder, "in.ply"), os.path.join(folder, "out.stroll")
        with open(self.source, "wb") as file:
            file.write(read(self.reference.source))

    def words(self, *more):
        return (self.source, "-o", self.out, *more)

    def resume(self, *more):
        """To its end, from stages that are finished."""
        done = must("build", *self.words("--resume", "--json", *more))
        assert json.loads(done.output)["resumed"], done
        self.check(done.output)
        return done

    def check(self, output):
        result = json.loads(output)
        assert read(self.out) == self.reference.bytes
        assert all(result[key] == self.reference.result[key] for key in COUNTS), (result, self.reference.result)
        assert sorted(os.listdir(self.folder)) == ["in.ply", "out.stroll"], os.listdir(self.folder)
        os.remove(self.out)

    def stopped(self, number=signal.SIGKILL, folder=None, more=()):
        """Leaves a build that was stopped after its first level; what it said."""
        scratch = os.path.join(folder or self.folder, "out.stroll.tmp")
        for attempt in range(20):
            build = Build(*self.words(*more))
            build.wait_for(os.path.join(scratch, "nodes-01.spill"))
            said = build.stop(number)
            if said is not None:
                return said
            os.remove(self.out)
        raise AssertionError("no build could be stopped")
