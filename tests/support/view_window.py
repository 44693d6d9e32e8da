"""A window of `stroll view` in a virtual display, driven as a hand would, for tests."""
import json
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from png import read_png

PATIENCE_S = 240  # a sanitized build on a busy machine


def pixels(rows):
    return [bytes(row[i:i + 3]) for row in rows for i in range(0, len(row), 3)]


def differing_share(a, b):
    return sum(p != q for p, q in zip(pixels(a), pixels(b))) / (len(a) * len(a[0]) / 3)


def colourful_share(rows):
    return sum(max(p) - min(p) > 60 for p in pixels(rows)) / (len(rows) * len(rows[0]) / 3)


class Display:
    """An X server of its own, with settings and cache of its own. screen: its size."""

    def __init__(self, screen=(800, 600)):
        self.screen = screen

    def __enter__(self):
        self.folder = tempfile.TemporaryDirectory()
        reading, writing = os.pipe()
        self.server = subprocess.Popen(["Xvfb", "-displayfd", str(writing), "-screen", "0",
                                        f"{self.screen[0]}x{self.screen[1]}x24", "-fbdir", self.folder.name,
                                        "-nolisten", "tcp", "-noreset"], pass_fds=[writing],
                                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(writing)
        with os.fdopen(reading) as answer:
            number = answer.readline().strip()
        assert number, "Xvfb did not start"
        self.environment = {**os.environ, "DISPLAY": f":{number}",
                            "XDG_CONFIG_HOME": self.folder.name + "/config",
                            "XDG_CACHE_HOME": self.folder.name + "/cache"}
        self.environment.pop("WAYLAND_DISPLAY", None)
        # A GL driver that is unloaded leaves memory behind that LeakSanitizer takes for lost; ours shows by its names.
        self.environment["LSAN_OPTIONS"] = "exitcode=0"
        return self

    def __exit__(self, *_):
        self.server.terminate()
        self.server.wait()
        self.folder.cleanup()

    def shoot(self, left, top, right, bottom):
        """What the screen shows there, panels included: rows of RGB8 bytes."""
        data = (pathlib.Path(self.folder.name) / "Xvfb_screen0").read_bytes()
        fields = struct.unpack(">25I", data[:100])
        head, stride, colours = fields[0], fields[12], fields[19]
        start, rows = head + 12 * colours, []
        for y in range(top, bottom):
            row = data[start + y * stride + 4 * left:start + y * stride + 4 * right]
            rgb = bytearray(3 * (right - left))
            rgb[0::3], rgb[1::3], rgb[2::3] = row[2::4], row[1::4], row[0::4]
            rows.append(rgb)
        return rows


class Viewer:
    """A running window, driven as a hand would. What it writes to its log tells what has happened."""

    def __init__(self, stroll, display, model, folder, *options, size):
        self.environment, self.folder, self.size = display.environment, folder, size
        self.log_path, self.events_seen = folder / "log.jsonl", 0
        self.errors = tempfile.TemporaryFile(mode="w+")
        self.process = subprocess.Popen([stroll, "view", model, "--size", f"{size[0]}x{size[1]}", "--screenshots",
                                         folder, "--log", self.log_path, *options],
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
            time.sleep(0.02)
        raise AssertionError(f"no {what} in {PATIENCE_S} s: {self.complaint()} {self.events()[-5:]}")

    def complaint(self):
        self.errors.seek(0)
        return self.errors.read()

    # ---- the log

    def events(self):
        text = self.log_path.read_text() if self.log_path.exists() else ""
        return [json.loads(line) for line in text[:text.rfind("\n") + 1].splitlines()]

    def event(self, kind, **facts):
        """The first event of the kind, with these facts, after the last one asked for. Waits for it."""
        def find():
            all_events = self.events()
            for at in range(self.events_seen, len(all_events)):
                found = all_events[at]
                if found["event"] == kind and all(found.get(name) == value for name, value in facts.items()):
                    self.events_seen = at + 1
                    return found
            return None
        return self.wait_for(find, f"event {kind} {facts}")

    def event_before(self, kind):
        """The newest event of the kind."""
        return next(event for event in reversed(self.events()) if event["event"] == kind)

    def rest(self):
        """Waits until nothing moves and everything has arrived."""
        return self.event("rest")

    # ---- the hand

    def key(self, *keys):
        self.tool("key", "--delay", "20", *keys)

    def point(self, x, y):
        """Waits until the cursor's place, and so everything that was done before, has been seen and nothing moves."""
        self.events_seen = len(self.events())
        self.tool("mousemove", str(x + 1), str(y), "mousemove", str(x), str(y))  # it may be there already
        self.event("rest", cursor=[float(x), float(y)])  # and the panels know whether it is over them

    def click(self, x, y):
        """A click on the model. Returns what it picked."""
        self.point(x, y)
        self.tool("click", "1")
        return self.event("pick")

    def press(self, x, y):
        """A click on a panel."""
        self.point(x, y)
        self.tool("click", "1")
        self.rest()  # the panel has seen the button go down and up where it is

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

    def end(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
