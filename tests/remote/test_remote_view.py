#!/usr/bin/env python3
"""`stroll view` of an address, in a virtual display: the window comes with the root alone, and shows in the end what it shows
of the file; it stays when the server goes, and heals when it comes back.

    test_remote_view.py STROLL        exit 77 (skipped) where Xvfb or xdotool is missing
"""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(os.environ.get("STRL_TEST_ROOT", pathlib.Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(ROOT / "tests/support"))
sys.dont_write_bytecode = True
from shaped_server import ShapedServer
from view_window import Display, Viewer

SIZE = (480, 320)


def picture(stroll, display, model, folder, *options):
    folder.mkdir()
    viewer = Viewer(stroll, display, model, folder, "--error", "0.5", *options, size=SIZE)
    try:
        viewer.rest()
        shown = viewer.settled()
        viewer.quit()
        return shown
    finally:
        viewer.end()


def outlives_its_server(stroll, display, server, model, folder, expected):
    folder.mkdir()
    server.fault = lambda number, path: "500" if number > 3 else None
    server.asked.clear()
    viewer = Viewer(stroll, display, model, folder, "--error", "0.5", "--no-cache", size=SIZE)
    try:
        coarse = viewer.shoot()
        assert coarse != expected, "more than the root was there"
        server.fault = None
        viewer.rest()
        assert viewer.settled() == expected, "the picture does not heal"
        viewer.quit()
    finally:
        viewer.end()


def main():
    stroll = str(pathlib.Path(sys.argv[1]).resolve())
    missing = [tool for tool in ("Xvfb", "xdotool") if not shutil.which(tool)]
    if missing:
        print("skipped: there is no " + " and no ".join(missing))
        return 77
    with tempfile.TemporaryDirectory() as name, ShapedServer(name) as server, Display() as display:
        folder = pathlib.Path(name)
        scene, model = folder / "scene.ply", folder / "scene.stroll"
        subprocess.run([stroll, "scene", "isosurface", "--triangles", "200K", "-o", scene, "--quiet"], check=True)
        subprocess.run([stroll, "build", scene, "-o", model, "--quiet"], check=True, stdout=subprocess.DEVNULL)
        expected = picture(stroll, display, model, folder / "local")
        server.latency = 0.02
        url, cache = server.url("scene.stroll"), folder / "cache"
        assert picture(stroll, display, url, folder / "remote", "--cache", cache) == expected, "another picture"
        server.asked.clear()
        assert picture(stroll, display, url, folder / "again", "--cache", cache) == expected, "another from the cache"
        assert len(server.asked) == 1, f"more than the header was read: {server.asked}"
        outlives_its_server(stroll, display, server, url, folder / "fault", expected)
    print("view: an address is shown as its file is")
    return 0


if __name__ == "__main__":
    sys.exit(main())
