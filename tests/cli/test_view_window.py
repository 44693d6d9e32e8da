#!/usr/bin/env python3
"""`stroll view` in a virtual display: it opens, obeys mouse and keys, saves what it shows, and quits.

    test_view_window.py STROLL        exit 77 (skipped) where Xvfb or xdotool is missing
"""
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import time
import zlib

SKIPPED = 77
PATIENCE_S = 240  # a sanitized build on a busy machine
SIZE = (480, 320)


def read_png(path):
    """Rows of RGB8 bytes of a PNG as the viewer writes it: eight bits, three channels, not interlaced."""
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n", f"{path} is no PNG"
    at, packed, width, height = 8, b"", 0, 0
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + length]
        if kind == b"IHDR":
            width, height, depth, colour, _, _, interlaced = struct.unpack(">IIBBBBB", body)
            assert (depth, colour, interlaced) == (8, 2, 0), f"{path} has an unexpected layout"
        elif kind == b"IDAT":
            packed += body
        at += 12 + length
    raw, rows, previous = zlib.decompress(packed), [], bytearray(3 * width)
    for y in range(height):
        start = y * (3 * width + 1)
        previous = unfilter(raw[start], bytearray(raw[start + 1:start + 1 + 3 * width]), previous)
        rows.append(previous)
    return rows


def unfilter(kind, row, above):
    for i in range(len(row)):
        left, up, corner = (row[i - 3], above[i], above[i - 3]) if i >= 3 else (0, above[i], 0)
        if kind == 1:
            guess = left
        elif kind == 2:
            guess = up
        elif kind == 3:
            guess = (left + up) // 2
        elif kind == 4:
            guess = min((abs(up - corner), 0, left), (abs(left - corner), 1, up),
                        (abs(left + up - 2 * corner), 2, corner))[2]
        else:
            guess = 0
        row[i] = (row[i] + guess) & 255
    return row


def pixels(rows):
    return [bytes(row[i:i + 3]) for row in rows for i in range(0, len(row), 3)]


def differing_share(a, b):
    return sum(p != q for p, q in zip(pixels(a), pixels(b))) / (SIZE[0] * SIZE[1])


def colourful_share(rows):
    return sum(max(p) - min(p) > 60 for p in pixels(rows)) / (SIZE[0] * SIZE[1])


class Display:
    def __enter__(self):
        reading, writing = os.pipe()
        self.server = subprocess.Popen(["Xvfb", "-displayfd", str(writing), "-screen", "0", "800x600x24", "-nolisten",
                                        "tcp", "-noreset"], pass_fds=[writing],
                                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(writing)
        with os.fdopen(reading) as answer:
            number = answer.readline().strip()
        assert number, "Xvfb did not start"
        self.environment = {**os.environ, "DISPLAY": f":{number}"}
        self.environment.pop("WAYLAND_DISPLAY", None)
        # A GL driver that is unloaded leaves memory behind that LeakSanitizer takes for lost; ours shows by its names.
        self.environment["LSAN_OPTIONS"] = "exitcode=0"
        return self

    def __exit__(self, *_):
        self.server.terminate()
        self.server.wait()


class Viewer:
    """A running window, driven as a hand would."""

    def __init__(self, stroll, display, model, folder, *options):
        self.environment, self.folder = display.environment, folder
        self.errors = tempfile.TemporaryFile(mode="w+")
        self.process = subprocess.Popen([stroll, "view", model, "--size", f"{SIZE[0]}x{SIZE[1]}", "--screenshots",
                                         folder, *options],
                                        env=display.environment, stderr=self.errors)
        window = self.wait_for(lambda: self.tool("search", "--onlyvisible", "--pid", str(self.process.pid)), "a window")
        self.window = window.split()[0]
        self.tool("windowmove", self.window, "0", "0")
        self.tool("windowfocus", self.window)

    def tool(self, *words):
        return subprocess.run(["xdotool", *words], env=self.environment, text=True, stdout=subprocess.PIPE,
                              stderr=subprocess.DEVNULL).stdout

    def wait_for(self, answer, what):
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            assert self.process.poll() is None, f"the viewer ended with {self.process.returncode}: {self.complaint()}"
            found = answer()
            if found:
                return found
            time.sleep(0.05)
        raise AssertionError(f"no {what} in {PATIENCE_S} s: {self.complaint()}")

    def complaint(self):
        self.errors.seek(0)
        return self.errors.read()

    def key(self, *keys):
        self.tool("key", "--delay", "20", *keys)

    def drag(self, button, from_x, from_y, to_x, to_y):
        self.tool("mousemove", str(from_x), str(from_y))
        time.sleep(0.3)  # the panel sees in its next frame that the cursor is not over it
        self.tool("mousedown", str(button), "mousemove", str(to_x), str(to_y), "mouseup", str(button))

    def shoot(self, *keys_before):
        path = self.folder / f"stroll_{len(list(self.folder.glob('*.png'))):05d}.png"
        self.tool("key", "--delay", "0", *keys_before, "p")
        self.wait_for(lambda: path.exists() and path.read_bytes()[-8:-4] == b"IEND", f"picture {path.name}")
        return read_png(path)

    def settled(self):
        """The picture once it no longer changes: everything that it needs has arrived."""
        last = self.shoot()
        for _ in range(60):
            time.sleep(0.2)
            now = self.shoot()
            if now == last:
                return now
            last = now
        raise AssertionError("the picture never settles")

    def quit(self):
        self.key("Escape")
        status = self.process.wait(PATIENCE_S)
        assert status == 0, f"the viewer ended with {status}: {self.complaint()}"
        assert "strl_" not in self.complaint(), f"the viewer leaks: {self.complaint()}"


def check_window(stroll, display, model, folder, *options):
    folder.mkdir()
    viewer = Viewer(stroll, display, model, folder, *options)
    try:
        home = viewer.settled()
        assert len(home) == SIZE[1] and len(home[0]) == 3 * SIZE[0]
        assert len(set(pixels(home))) > 16, "the picture has next to one colour"
        assert colourful_share(home) < 0.01, "a white model is not white"

        viewer.key("1")
        clusters = viewer.settled()
        assert colourful_share(clusters) > 0.05, "colours by cluster do not show"
        viewer.key("1")
        assert viewer.settled() == home, "the same key does not switch its colours off"

        viewer.drag(1, 400, 200, 430, 160)
        turned = viewer.settled()
        assert differing_share(home, turned) > 0.02, "a left drag does not turn the view"
        viewer.key("x")
        assert differing_share(turned, viewer.settled()) > 0.02, "wireframe looks like the surface"
        viewer.key("f", "h")
        viewer.tool("keydown", "w")
        time.sleep(0.5)
        viewer.tool("keyup", "w")
        viewer.key("x")
        assert differing_share(home, viewer.settled()) > 0.02, "flying forward leads nowhere"

        viewer.key("r", "F1", "c")
        assert viewer.settled() == home, "reset does not bring the first picture back"
        viewer.tool("windowsize", "--sync", viewer.window, "200", "150")
        viewer.tool("windowsize", "--sync", viewer.window, str(SIZE[0]), str(SIZE[1]))
        viewer.shoot("r")  # both keys may reach one frame, and the picture must not be lost to the reset
        assert viewer.settled() == home, "the picture differs after the window was resized and set back"
        viewer.quit()
    finally:
        if viewer.process.poll() is None:
            viewer.process.kill()
            viewer.process.wait()


def check_frames(stroll, display, model):
    """A window that closes by itself: for scripts."""
    def view(*options):
        done = subprocess.run([stroll, "view", model, "--size", f"{SIZE[0]}x{SIZE[1]}", *options],
                              env=display.environment, text=True, stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, timeout=PATIENCE_S)
        assert done.returncode == 0, f"view {options} ended with {done.returncode}: {done.stderr}"
        return done

    done = view("--frames", "40", "--error", "0.05")
    lines = done.stdout.splitlines()
    assert len(lines) == 2 and lines[0].startswith("40 frames: mean ") and " triangles, " in lines[1], done.stdout
    assert "--memory" not in done.stderr, done.stderr
    assert view("--frames", "1", "--quiet").stdout == ""
    tight = view("--frames", "200", "--error", "0.01", "--memory", "1M")
    assert "--memory 1M holds too little for a pixel error of 0.01: " in tight.stderr, tight.stderr
    silent = view("--frames", "200", "--error", "0.01", "--memory", "1M", "--quiet")
    # a sanitizer may tell of what the driver never gives back
    assert silent.stdout == "" and "stroll view" not in silent.stderr and "--memory" not in silent.stderr, silent


def check_refusals(stroll, scene, model):
    without = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    refusals = [([model], without, "no window"), ([scene], without, "build"),
                ([scene.with_name("none.stroll")], without, "none.stroll")]
    for words, environment, expected in refusals:
        done = subprocess.run([stroll, "view", *words], env=environment, text=True, stderr=subprocess.PIPE)
        assert done.returncode == 1, f"view {words} ended with {done.returncode}"
        assert expected in done.stderr and done.stderr.count("\n") == 1, f"view {words} says: {done.stderr}"
    assert subprocess.run([stroll, "view"], stderr=subprocess.DEVNULL).returncode == 2


def main():
    stroll = str(pathlib.Path(sys.argv[1]).resolve())
    missing = [tool for tool in ("Xvfb", "xdotool") if not shutil.which(tool)]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        scene, model = folder / "scene.ply", folder / "scene.stroll"
        subprocess.run([stroll, "scene", "isosurface", "--triangles", "40K", "--seed", "2", "-o", scene, "--quiet"],
                       check=True)
        subprocess.run([stroll, "build", scene, "-o", model, "--quiet"], check=True, stdout=subprocess.DEVNULL)
        check_refusals(stroll, scene, model)
        if missing:
            print("skipped: there is no " + " and no ".join(missing))
            return SKIPPED
        with Display() as display:
            check_frames(stroll, display, model)
            check_window(stroll, display, model, folder / "auto")
            check_window(stroll, display, model, folder / "gl3", "--backend", "gl3", "--error", "2")
    print("view: window, mouse, keys and pictures work")
    return 0


if __name__ == "__main__":
    sys.exit(main())
