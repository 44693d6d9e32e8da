"""What the builder's scripts share: running stroll as a child whose memory the system counts, and data that may be
absent."""
import glob
import json
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import threading
import time
import traceback

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "support"))
import sanitized

STROLL = os.path.abspath(sys.argv[1]) if len(sys.argv) > 1 else None
MIB = 1 << 20
SKIP = 77


def skip(why):
    print(f"skipped: {why}")
    sys.exit(SKIP)


def sanitizers():
    return sanitized.sanitizers(STROLL)


class Done:
    def __init__(self, words, code, output, error, peak_bytes, seconds):
        self.words, self.code, self.output, self.error = words, code, output, error
        self.peak_bytes, self.seconds = peak_bytes, seconds

    def __repr__(self):
        return (f"{' '.join(self.words)}\n  exit {self.code} after {self.seconds:.1f} s, "
                f"{self.peak_bytes / MIB:.0f} MiB\n  {self.error}")


def run(*words, timeout=1200, prefix=()):
    """Runs to the end. peak_bytes: the operating system's peak resident set of this child alone."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        start = time.monotonic()
        child = subprocess.Popen([*prefix, STROLL, *words], stdout=out, stderr=err)
        alarm = threading.Timer(timeout, child.kill)
        alarm.start()
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        seconds = time.monotonic() - start
        alarm.cancel()
        out.seek(0)
        err.seek(0)
        done = Done(words, child.returncode, out.read().decode(errors="replace"), err.read().decode(errors="replace"),
                    usage.ru_maxrss * 1024, seconds)
        assert seconds < timeout, f"took too long: {done}"
        return done


def must(*words, **options):
    done = run(*words, **options)
    assert done.code == 0, done
    return done


def build(source, output, *more, **options):
    return json.loads(must("build", source, "-o", output, "--json", *more, **options).output)


def check_result(result, most_root=16384):
    dropped = result["dropped"]["nonfinite"] + result["dropped"]["degenerate"]
    assert result["triangles_in"] == result["triangles_leaf"] + dropped, result
    assert 0 < result["root_triangles"] <= most_root, result


def assert_refused(done, *parts):
    """Exit 1 and one sentence on standard error that holds all the parts."""
    assert done.code == 1, done
    lines = done.error.strip("\n").split("\n")
    assert len(lines) == 1 and len(lines[0]) > 20, done
    assert done.output == "", done
    for part in parts:
        assert part in done.error, (part, done)


def write_grid_obj(path, side):
    """A wavy square; two triangles a cell."""
    with open(path, "w") as file:
        for y in range(side + 1):
            for x in range(side + 1):
                file.write(f"v {x} {y} {((x * 7 + y * 3) % 11) * 0.1}\n")
        for y in range(side):
            for x in range(side):
                a = y * (side + 1) + x + 1
                file.write(f"f {a} {a + 1} {a + side + 2}\nf {a} {a + side + 2} {a + side + 1}\n")


def write_box_stl(path):
    """One tetrahedron, binary."""
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    faces = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]
    with open(path, "wb") as file:
        file.write(b"box".ljust(80) + struct.pack("<I", len(faces)))
        for face in faces:
            file.write(struct.pack("<3f", 0, 0, 0) + b"".join(struct.pack("<3f", *corners[c]) for c in face) + b"\0\0")


def data_folder():
    """The data that is not part of the repository, or the end of the test."""
    root = os.environ.get("STRL_TEST_ROOT", ".")
    folder = os.environ.get("STRL_DATA") or os.path.join(root, "..", "shared", "data")
    if not os.path.isdir(folder):
        skip(f"there is no data folder {folder} (set STRL_DATA)")
    return folder


def unpack(archive, into):
    """A .zst file or .tar.zst archive by the zstd command. Returns the file or the folder."""
    if not shutil.which("zstd"):
        skip("there is no zstd command to unpack the data with")
    if archive.endswith(".tar.zst"):
        with subprocess.Popen(["zstd", "-dc", archive], stdout=subprocess.PIPE) as zstd:
            subprocess.run(["tar", "xf", "-", "-C", into, "--no-same-owner"], stdin=zstd.stdout, check=True)
        return into
    target = os.path.join(into, os.path.basename(archive)[:-len(".zst")])
    subprocess.run(["zstd", "-dqf", archive, "-o", target], check=True)
    return target


def models(folder, endings):
    """Paths below folder that end like models, packed or not."""
    found = []
    for path in sorted(glob.glob(os.path.join(folder, "**", "*"), recursive=True)):
        name = path[:-len(".zst")] if path.endswith(".zst") else path
        if os.path.isfile(path) and name.lower().endswith(tuple(endings)):
            found.append(path)
    return found


class NotHere(Exception):
    """Raised by a test, or a part of one, that this machine does not allow: it counts as skipped, with its reason."""


def run_tests(*tests):
    """Each in a folder of its own, which it must leave without scratch; all run, whatever became of those before."""
    failed = 0
    for test in tests:
        with tempfile.TemporaryDirectory(prefix="stroll-build-") as folder:
            try:
                test(folder)
                print(f"[       OK ] {test.__name__}", flush=True)
            except NotHere as reason:
                print(f"[  SKIPPED ] {test.__name__}\n{reason}", flush=True)
            except Exception:  # the others are run too
                failed += 1
                print(f"[  FAILED  ] {test.__name__}\n{traceback.format_exc()}", flush=True)
    sys.exit(1 if failed else 0)
