#!/usr/bin/env python3
"""`stroll view` in a virtual display: it opens, obeys mouse and keys, saves what it shows, and quits.

    test_view_window.py STROLL        exit 77 (skipped) where Xvfb or xdotool is missing
"""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "support"))
from view_window import PATIENCE_S, Display, Viewer, colourful_share, differing_share, pixels

SKIPPED = 77
SIZE = (480, 320)


def check_window(stroll, display, model, folder, *options):
    folder.mkdir()
    viewer = Viewer(stroll, display, model, folder, *options, size=SIZE)
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
        viewer.end()


def check_frames(stroll, display, model, samples):
    """A window that closes by itself: for scripts."""
    def view(*options, model=model):
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
    # the last frame's triangles: splats stand for those of cells of so many pixels
    few, many = (view("--frames", "200", "--splat", splat, model=samples).stdout.splitlines()[1] for splat in ("64", "1"))
    few, many = (int(line.split(": ")[1].split()[0]) for line in (few, many))
    assert 0 < few < many / 2, (few, many)
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
        scene, model, samples = folder / "scene.ply", folder / "scene.stroll", folder / "samples.stroll"
        subprocess.run([stroll, "scene", "isosurface", "--triangles", "40K", "--seed", "2", "-o", scene, "--quiet"],
                       check=True)
        subprocess.run([stroll, "build", scene, "-o", model, "--quiet"], check=True, stdout=subprocess.DEVNULL)
        subprocess.run([stroll, "build", scene, "-o", samples, "--structure", "samples", "--quiet"], check=True, stdout=subprocess.DEVNULL)
        check_refusals(stroll, scene, model)
        if missing:
            print("skipped: there is no " + " and no ".join(missing))
            return SKIPPED
        with Display() as display:
            check_frames(stroll, display, model, samples)
            check_window(stroll, display, model, folder / "auto")
            check_window(stroll, display, model, folder / "gl3", "--backend", "gl3", "--error", "2")
    print("view: window, mouse, keys and pictures work")
    return 0


if __name__ == "__main__":
    sys.exit(main())
