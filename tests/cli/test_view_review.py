#!/usr/bin/env python3
"""A session of reviewing in a window of `stroll view`, with keys and mouse in a virtual display: picks against what
arithmetic says lies under the pixel, distances, hiding, sections, bookmarks, a path recorded and replayed, walking,
dropped files, and what is remembered.

    test_view_review.py STROLL [PICTURES]      exit 77 (skipped) where Xvfb or xdotool is missing; PICTURES: a folder
                                               for pictures of the window
"""
import json
import math
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "support"))
from png import write_png
from view_window import Display, Viewer, differing_share, pixels
from x11_drop import X11

SKIPPED = 77
SIZE = (1280, 800)
EAST, NORTH, HEIGHT = 500000.25, 5400000.5, 312.0  # coordinates as surveyors have them
UP = (0, 0, 1)
BETWEEN, PARK = (310, 140, 970, 730), (320, 790)  # of the window: without panels and messages; for the cursor
BACKGROUND = (30, 33, 38)


# ---- the model: boxes with names


def make_boxes():
    """name -> (material, low corner, high corner)"""
    boxes = {"site/ground": ("grass", (-20, -15, -1), (20, 15, 0)),
             "site/house/walls": ("brick", (-4, -3, 0), (4, 3, 5)),
             "site/house/roof": ("tile", (-5, -4, 5), (5, 4, 6.5)),
             "site/house/chimney": ("brick", (1, -2, 6.5), (2, -1, 8.5)),
             "site/house/upper floor": ("wood", (-3.8, -2.8, 2.4), (3.8, 2.8, 2.6)),
             "site/house/rooms/table": ("wood", (0.5, -1.5, 2.6), (2.5, 0.5, 3.4)),
             "site/house/rooms/bed": ("linen", (-3, 0.6, 2.6), (-1, 2.6, 3.1)),
             "site/house/rooms/wall": ("plaster", (-0.4, -2.8, 2.6), (-0.2, 2.8, 4.9)),
             "site/house/rooms/wardrobe": ("wood", (-3.7, -2.7, 2.6), (-1.2, -2, 4.6))}
    for tree in range(12):
        x, y = -16 + tree % 4 * 10, (-12, -8.5, 10)[tree // 4]
        boxes[f"site/trees/tree {tree:02d}"] = ("leaf", (x, y, 0), (x + 2, y + 2, 3 + tree % 5))
    return {name: (material, tuple(a + b for a, b in zip(low, (EAST, NORTH, HEIGHT))),
                   tuple(a + b for a, b in zip(high, (EAST, NORTH, HEIGHT))))
            for name, (material, low, high) in boxes.items()}


COLOURS = {"grass": (0.2, 0.45, 0.15), "brick": (0.55, 0.22, 0.15), "tile": (0.3, 0.3, 0.38), "leaf": (0.1, 0.35, 0.1),
           "wood": (0.45, 0.3, 0.15), "linen": (0.7, 0.7, 0.8), "plaster": (0.75, 0.72, 0.65)}
CORNERS = [(1, 3, 4, 2), (5, 6, 8, 7), (1, 2, 6, 5), (3, 7, 8, 4), (1, 5, 7, 3), (2, 4, 8, 6)]


def write_obj(path, boxes):
    lines, first = [f"mtllib {path.stem}.mtl"], 0
    for name, (material, low, high) in boxes.items():
        lines += [f"o {name}", f"usemtl {material}"]
        lines += [f"v {x!r} {y!r} {z!r}" for z in (low[2], high[2]) for y in (low[1], high[1])
                  for x in (low[0], high[0])]
        lines += ["f " + " ".join(str(first + c) for c in face) for face in CORNERS]
        first += 8
    path.write_text("\n".join(lines) + "\n")
    path.with_suffix(".mtl").write_text("".join(f"newmtl {name}\nKd {r} {g} {b}\n"
                                                for name, (r, g, b) in COLOURS.items()))


# ---- what lies under a pixel, told apart from the viewer's code


def add(a, b, scale=1.0):
    return tuple(x + scale * y for x, y in zip(a, b))


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def unit(a):
    return tuple(x / math.sqrt(dot(a, a)) for x in a)


class Home:
    """The camera that looks at the whole model: from +x, 20 degrees down, at twice the radius."""

    def __init__(self, boxes):
        low = [min(box[1][i] for box in boxes.values()) for i in range(3)]
        high = [max(box[2][i] for box in boxes.values()) for i in range(3)]
        self.centre = tuple((a + b) / 2 for a, b in zip(low, high))
        self.radius = math.dist(low, high) / 2
        down = math.radians(20)
        self.forward = (-math.cos(down), 0, -math.sin(down))
        self.eye = add(self.centre, self.forward, -2 * self.radius)
        self.right = unit(cross(self.forward, UP))
        self.up = cross(self.right, self.forward)

    def ray(self, x, y, orthographic=False):
        tangent = math.tan(math.radians(30))
        up = (1 - 2 * y / SIZE[1]) * tangent
        right = (2 * x / SIZE[0] - 1) * tangent * SIZE[0] / SIZE[1]
        if orthographic:
            height = 2 * self.radius
            start = add(add(self.eye, self.right, right * height), self.up, up * height)
            return add(start, self.forward, -2 * self.radius), self.forward
        return self.eye, unit(add(add(self.forward, self.right, right), self.up, up))


def hit(boxes, ray, hidden=(), highest=math.inf):
    """The nearest point of a box's surface on the ray, not above `highest`: (name, point), or None."""
    start, way = ray
    found = []
    for name, (_, low, high) in boxes.items():
        enter, leave = -math.inf, math.inf
        for i in range(3):
            if abs(way[i]) < 1e-12:
                if not low[i] <= start[i] <= high[i]:
                    enter, leave = 1, 0
                continue
            a, b = (low[i] - start[i]) / way[i], (high[i] - start[i]) / way[i]
            enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
        if name not in hidden and enter <= leave:
            found += [(t, name) for t in (enter, leave) if t > 0 and start[2] + t * way[2] <= highest]
    return (min(found)[1], add(start, way, min(found)[0])) if found else None


# ---- the session


class Session:
    def __init__(self, viewer, display, boxes, stroll):
        self.viewer, self.display, self.boxes, self.home = viewer, display, boxes, Home(boxes)
        self.stroll = stroll
        self.views = 0

    def view(self):
        """What the window shows between its panels once nothing moves."""
        self.views += 1  # each time elsewhere, so that no older rest is taken for this one
        self.viewer.point(PARK[0] + 4 * (self.views % 8), PARK[1])
        return self.display.shoot(*BETWEEN)

    def erase(self):
        """What is typed. Keys are held, because slow frames see only what is down."""
        for keys in (("ctrl", "a"), ("BackSpace",)):
            self.viewer.tool(*(word for key in keys for word in ("keydown", key)))
            time.sleep(1)  # held, the keys repeat: there is no rest
            self.viewer.tool(*(word for key in keys for word in ("keyup", key)))
            self.view()

    def check_pick(self, x, y, orthographic=False, **which):
        """Clicks and compares; the pixel's middle is where the ray goes."""
        found = self.viewer.click(x, y)
        expected = hit(self.boxes, self.home.ray(x, y, orthographic), **which)
        assert (expected is None) == ("part" not in found), f"pixel {x} {y}: {found}, expected {expected}"
        if expected is None:
            return found
        name, point = expected
        # the cursor is at the pixel's corner or its middle: half a pixel either way
        slack = found["error"] + 2 * 2 * self.home.radius * math.tan(math.radians(30)) / SIZE[1]
        assert found["part"] == name, f"pixel {x} {y}: {found}, expected {name}"
        assert found["material"] == self.boxes[name][0], found
        assert math.dist(found["point"], point) < 4 * slack, f"pixel {x} {y}: {found}, expected {point}"
        return found


def check_rest(session):
    """Nothing is drawn while nothing moves."""
    viewer = session.viewer
    viewer.point(*PARK)
    time.sleep(1)  # the panels say once that nothing moves
    viewer.point(PARK[0] + 4, PARK[1])
    before = viewer.events()[viewer.events_seen - 1]["frames"]
    time.sleep(5)  # the visitor reads; one frame each half second would be ten
    viewer.point(*PARK)
    frames = viewer.events()[viewer.events_seen - 1]["frames"] - before
    assert frames < 9, f"{frames} frames in five seconds of rest and one move of the cursor"


def check_resize(session):
    """Panels come back to their places after the window was too small for them."""
    viewer = session.viewer
    def edge():
        row = session.display.shoot(0, 60, 600, 61)[0]
        return max(x for x in range(600) if row[3 * x:3 * x + 3] != bytearray(BACKGROUND))

    viewer.point(*PARK)
    wide = edge()
    assert 290 < wide < 310, wide
    viewer.tool("windowsize", "--sync", viewer.window, "2", "2")
    viewer.rest()
    viewer.tool("windowsize", "--sync", viewer.window, *map(str, SIZE))
    viewer.rest()
    viewer.point(PARK[0] + 4, PARK[1])
    assert edge() == wide, f"the panel reaches to {wide}, and to {edge()} after the window was small"


def check_picks(session):
    seen = {}
    for x, y in [(640, 390), (660, 440), (620, 362), (780, 370), (440, 460), (640, 560), (800, 530), (540, 500)]:
        found = session.check_pick(x, y)
        if "part" in found:
            seen.setdefault(found["part"], found)
            name = found["part"]
            # one coordinate is exactly that of the box's face, however far from the origin
            faces = [abs(found["point"][i] - corner[i]) for corner in session.boxes[name][1:] for i in range(3)]
            assert min(faces) <= found["error"] + 1e-6, f"{found} lies on no face of its box"
    assert len(seen) >= 6, f"only {list(seen)} were picked"
    a, b = session.check_pick(640, 440), session.check_pick(640, 390)
    assert abs(b["distance"] - math.dist(a["point"], b["point"])) < 1e-6, (a, b)
    assert all(abs(b["difference"][i] - (b["point"][i] - a["point"][i])) < 1e-6 for i in range(3)), (a, b)
    assert "part" not in session.check_pick(640, 200), "the sky was picked"


def check_parts(session):
    viewer = session.viewer
    front = session.check_pick(640, 440)["part"]
    viewer.key("Delete")
    assert viewer.event("hidden")["count"] == 1
    session.check_pick(646, 445, hidden=[front])
    viewer.key("u")
    assert viewer.event("hidden")["count"] == 0
    roof = session.check_pick(640, 390)["part"]
    viewer.key("i")
    assert viewer.event("hidden")["count"] == len(session.boxes) - 1
    session.check_pick(650, 396, hidden=[name for name in session.boxes if name != roof])
    viewer.key("u")
    assert viewer.event("hidden")["count"] == 0


def check_list(session):
    """Finds a part by typing, and looks at it from the list."""
    viewer = session.viewer
    viewer.key("r")  # the picks so far have marks
    whole = session.view()
    viewer.key("t")
    viewer.press(1100, 50)  # the search field
    viewer.tool("type", "CHIMNEY")
    session.view()
    viewer.press(1120, 189)  # below site and house
    viewer.point(1120, 189)
    viewer.tool("click", "3")  # its menu, which Escape closes, and not the window
    viewer.rest()
    viewer.key("Escape")
    viewer.rest()
    viewer.key("i")
    assert viewer.event("hidden")["count"] == len(session.boxes) - 1
    viewer.key("v")
    eye = viewer.event("arrived")["eye"]
    _, low, high = session.boxes["site/house/chimney"]
    assert math.dist(eye, [(a + b) / 2 for a, b in zip(low, high)]) < 4 * math.dist(low, high), eye
    viewer.point(998, 137)  # the box before the whole site, of which something is shown
    viewer.tool("click", "1")
    assert viewer.event("hidden")["count"] == len(session.boxes)
    viewer.key("u")
    viewer.event("hidden", count=0)
    viewer.press(1100, 50)
    session.erase()
    viewer.tool("type", "tree")
    session.view()
    trees = sum("tree" in name for name in session.boxes)
    viewer.press(1130, 74)  # hides what is found
    assert viewer.event_before("hidden")["count"] == trees
    viewer.press(1176, 74)  # and leaves it alone
    assert viewer.event_before("hidden")["count"] == len(session.boxes) - trees
    viewer.press(1100, 50)
    session.erase()
    viewer.press(640, 760)
    viewer.key("r", "f")
    here = session.view()
    viewer.press(1100, 50)
    viewer.tool("type", "wow")  # a key that flies
    session.view()
    viewer.key("ctrl+a", "BackSpace")
    viewer.tool("mousemove", "640", "200", "sleep", "0.2", "click", "1")
    viewer.event("pick")
    assert session.view() == here, "what is typed moves the camera"
    viewer.key("t", "r")
    assert differing_share(whole, session.view()) < 1e-4, "the list leaves something behind"
    session.check_pick(640, 390)
    viewer.key("t")
    viewer.press(1120, 192)  # the list is open at the roof: the chimney stands before it
    viewer.key("i")
    assert viewer.event("hidden")["count"] == len(session.boxes) - 1, "the list does not show what is selected"
    viewer.key("t", "r")


def check_section(session):
    viewer = session.viewer
    whole = session.view()
    viewer.key("k")
    section = viewer.event("section", on=True)
    low, high = session.home.centre[2] - HEIGHT, section["offset"] - HEIGHT
    assert section["normal"] == [0, 0, 1] and abs(low - high) < 1e-4, section
    for x, y in [(640, 390), (640, 440), (600, 430)]:
        session.check_pick(x, y, highest=section["offset"])
    viewer.key("period", "period", "period")
    for _ in range(3):
        moved = viewer.event("section")
    assert moved["offset"] > section["offset"] + 0.1, moved
    session.check_pick(650, 410, highest=moved["offset"])
    assert differing_share(whole, session.view()) > 0.005, "the section cuts nothing"
    viewer.key("k")
    viewer.event("section", on=False)
    found = session.check_pick(640, 560)
    viewer.key("j")
    along = viewer.event("section", on=True)
    assert all(abs(a - b) < 1e-9 for a, b in zip(along["normal"], found["normal"])), (along, found)
    assert abs(dot(along["normal"], found["point"]) - along["offset"]) < 1e-6, (along, found)
    viewer.key("k", "r")
    viewer.event("section", on=False)
    viewer.rest()


def check_bookmarks(session):
    viewer = session.viewer
    first = session.view()
    viewer.key("b")
    viewer.drag(1, 700, 600, 780, 560)
    assert differing_share(first, session.view()) > 0.02
    viewer.key("n")
    viewer.event("arrived")
    assert session.view() == first, "a bookmark leads elsewhere"
    viewer.key("5")
    session.check_pick(640, 400, orthographic=True)
    session.check_pick(600, 560, orthographic=True)
    assert differing_share(first, session.view()) > 0.005, "orthographic looks like perspective"
    viewer.key("n")
    viewer.event("arrived")
    viewer.key("BackSpace")
    session.check_pick(640, 200)  # nothing: the selection goes, too
    assert session.view() == first, "a bookmark forgets its projection"


def check_recording_goes_on(session):
    """Other ways to move the camera belong to the path, and a reset saves it."""
    viewer = session.viewer
    for last in ("m", "r"):
        viewer.drag(1, 700, 600, 760, 580)
        viewer.rest()
        viewer.key("m")
        viewer.event("said")
        viewer.key("h")
        viewer.event("arrived")
        viewer.key(last)
        path = viewer.event("path")
        assert path["frames"] > 10, f"{path}: half a second is fifteen cameras"
        pathlib.Path(path["file"]).unlink()


def check_path(session, stroll, container):
    viewer = session.viewer
    viewer.key("m")
    viewer.event("said")
    viewer.drag(1, 700, 600, 760, 580)
    viewer.drag(1, 700, 600, 720, 570)
    viewer.key("m")
    path = viewer.event("path")
    assert path["frames"] > 3, path
    there = session.view()
    viewer.key("h")
    viewer.event("arrived")
    assert differing_share(there, session.view()) > 0.02
    viewer.key("space")
    viewer.event("replay", begins=True)
    viewer.event("replay", begins=False)
    assert differing_share(there, session.view()) < 0.002, "a replay ends elsewhere than the path"
    frames = json.loads(pathlib.Path(path["file"]).read_text())["frames"]
    assert len(frames) == path["frames"] and math.dist(frames[0]["eye"], session.home.eye) < 1e-3
    check_recording_goes_on(session)
    # what was recorded in the window is what `render` reads
    shot = viewer.folder / "rendered.png"
    last = viewer.folder / "last.json"
    last.write_text(json.dumps({"fov_y_deg": 60, "frames": frames[-1:]}))
    subprocess.run([stroll, "render", container, "--path", last, "--size", f"{SIZE[0]}x{SIZE[1]}", "-o", shot,
                    "--quiet"], check=True)
    assert shot.exists()
    shot.unlink() # folders of pictures are counted
    viewer.key("h")
    viewer.event("arrived")


def check_walk(session):
    viewer = session.viewer
    session.check_pick(560, 560)
    spot = viewer.events()[viewer.events_seen - 1]["point"]
    viewer.key("g")
    eye = viewer.event("arrived")["eye"]
    assert math.dist(eye[:2], spot[:2]) < 1e-6 and abs(eye[2] - HEIGHT - 1.7) < 1e-3, f"{eye} at {spot}"
    viewer.rest()
    before = session.view()
    viewer.tool("keydown", "w")
    time.sleep(0.3)  # how long it is held
    viewer.tool("keyup", "w")
    assert differing_share(before, session.view()) > 0.005, "walking leads nowhere"
    viewer.key("r")
    viewer.rest()


def check_look(session):
    viewer = session.viewer
    found = session.check_pick(640, 390)
    viewer.key("v")
    eye = viewer.event("arrived")["eye"]
    _, low, high = session.boxes[found["part"]]
    middle = [(a + b) / 2 for a, b in zip(low, high)]
    assert math.dist(eye, middle) < 4 * math.dist(low, high), f"{eye} is not near {middle}"
    viewer.key("h")
    viewer.event("arrived")
    viewer.rest()
    viewer.point(648, 394)
    viewer.tool("click", "--repeat", "2", "--delay", "40", "1")
    assert math.dist(viewer.event("arrived")["eye"], eye) < 1e-3, "a double click looks elsewhere than V"
    viewer.key("r")
    viewer.rest()


def check_drop(session, display, folder):
    viewer = session.viewer
    mesh, broken = folder / "dropped tower.obj", folder / f"{'a long name for something ' * 6}broken.ply"
    write_obj(mesh, {"tower": ("brick", (0, 0, 0), (4, 4, 30)), "flag": ("leaf", (1, 1, 30), (2, 2, 33))})
    broken.write_text("ply\nformat ascii 1.0\nelement vertex many\n")
    with X11(display.environment["DISPLAY"]) as hand:
        hand.drop(int(viewer.window), 600, 400, broken)
        viewer.event("build")
        assert "broken.ply" in viewer.event("said")["text"]
        viewer.point(*PARK)
        beyond = display.shoot(SIZE[0] - 100, SIZE[1] - 30, SIZE[0], SIZE[1] - 10)
        assert set(pixels(beyond)) == {bytes(BACKGROUND)}, "a long sentence is not broken into lines"
        assert session.check_pick(640, 420), "the model is gone after a file that could not be built"
        hand.drop(int(viewer.window), 600, 400, mesh)
        opened = viewer.event("opened")
        assert opened["file"] == f"{mesh}.stroll" and opened["parts"] == 2 and opened["triangles"] == 24, opened
        viewer.rest()
        assert viewer.click(640, 400)["part"] == "tower"
        hand.drop(int(viewer.window), 600, 400, f"{mesh}.stroll")
        assert viewer.event("opened")["parts"] == 2
        check_build_again(session, hand, mesh)
        check_cancel(session, hand, folder)


def check_build_again(session, hand, mesh):
    """A file that the mesh names is another: the container is opened all the same, which is said, and can be built again."""
    viewer = session.viewer
    mesh.with_suffix(".mtl").unlink()
    hand.drop(int(viewer.window), 600, 400, mesh)
    assert viewer.event("opened")["parts"] == 2
    assert "build again" in viewer.event("said")["text"]
    viewer.rest()
    viewer.point(66, 82)
    viewer.tool("click", "1")
    viewer.event("opened")
    text = viewer.event("said")["text"]
    assert "warning" in text and "dropped tower.mtl" in text, text


def check_cancel(session, hand, folder):
    """Esc ends a build, and not the window."""
    viewer, mesh = session.viewer, folder / "large.ply"
    subprocess.run([session.stroll, "scene", "isosurface", "--triangles", "2M", "-o", mesh, "--quiet"], check=True)
    hand.drop(int(viewer.window), 600, 400, mesh)
    time.sleep(0.3)
    viewer.key("Escape")
    assert viewer.event("said")["text"] == "cancelled"
    viewer.rest()
    assert not mesh.with_name(mesh.name + ".stroll").exists()


def check_memory(stroll, display, container, folder):
    """A second window knows what the first one was left with."""
    folder.mkdir()
    viewer = Viewer(stroll, display, container, folder, size=SIZE)
    try:
        viewer.event("opened")
        viewer.rest()
        viewer.key("n")
        assert viewer.event("said")["text"] == "view 1", "the bookmark is forgotten"
        viewer.quit()
    finally:
        viewer.end()


def count_bookmarks(display):
    text = (pathlib.Path(display.environment["XDG_CONFIG_HOME"]) / "stroll/viewer.json").read_text()
    return sum(len(some) for some in json.loads(text)["bookmarks"].values())


def check_two_windows(stroll, display, container, folder):
    """Of the same model: what one has marked the other neither forgets nor brings back."""
    viewers = []
    before = count_bookmarks(display)
    try:
        for name in ("first", "second"):
            (folder / name).mkdir(parents=True)
            viewers.append(Viewer(stroll, display, container, folder / name, size=SIZE))
            viewers[-1].event("opened")
            viewers[-1].rest()
        for step, viewer in enumerate(reversed(viewers)):
            viewer.tool("windowfocus", "--sync", viewer.window)
            viewer.key("b")
            viewer.event("said")
            assert count_bookmarks(display) == before + step + 1
        for viewer in viewers:
            viewer.tool("windowfocus", "--sync", viewer.window)
            viewer.quit()
        assert count_bookmarks(display) == before + 2, "a bookmark is lost"
    finally:
        for viewer in viewers:
            viewer.end()


def newest_bookmark(display):
    """The eye of it; of the model that was written last."""
    text = (pathlib.Path(display.environment["XDG_CONFIG_HOME"]) / "stroll/viewer.json").read_text()
    return list(json.loads(text)["bookmarks"].values())[-1][-1]["eye"]


def check_roof(stroll, display, folder):
    """Who walks off the floor under a roof stays below it."""
    folder.mkdir()
    mesh, container = folder / "porch.obj", folder / "porch.stroll"
    write_obj(mesh, {"floor": ("wood", (0, -5, -0.2), (10, 5, 0)), "roof": ("tile", (-10, -5, 2.5), (-0.5, 5, 2.7))})
    subprocess.run([stroll, "build", mesh, "-o", container, "--up", "z", "--unit", "m", "--quiet"], check=True,
                   stdout=subprocess.DEVNULL)
    viewer = Viewer(stroll, display, container, folder, size=SIZE)
    try:
        viewer.event("opened")
        viewer.rest()
        assert viewer.click(640, 440)["part"] == "floor"
        viewer.key("g")
        start = viewer.event("arrived")["eye"]
        assert abs(start[2] - 1.7) < 1e-3 and start[0] < 8, start
        eye = start
        while eye[0] > -1:  # a slow machine makes small steps
            viewer.tool("keydown", "w")
            time.sleep(1)
            viewer.tool("keyup", "w")
            viewer.key("b")
            viewer.event("said")
            viewer.rest()  # it is written by then
            eye = newest_bookmark(display)
        assert eye[0] > -10 and abs(eye[2] - 1.7) < 0.01, f"{eye}: the walker was lifted onto the roof"
        viewer.quit()
    finally:
        viewer.end()


def check_replaced(stroll, display, container, folder):
    """A new budget opens the file anew: another model that is there by now does not get the names of the first."""
    folder.mkdir()
    mesh, other, mine = folder / "other.obj", folder / "other.stroll", folder / "mine.stroll"
    write_obj(mesh, {"cube": ("wood", (0, 0, 0), (1, 1, 1))})
    subprocess.run([stroll, "build", mesh, "-o", other, "--quiet"], check=True, stdout=subprocess.DEVNULL)
    shutil.copy(container, mine)
    viewer = Viewer(stroll, display, mine, folder, size=SIZE)
    try:
        viewer.event("opened")
        viewer.rest()
        other.replace(mine)
        viewer.press(100, 340)  # budgets
        viewer.point(150, 363)
        viewer.tool("mousedown", "1", "mousemove", "200", "363", "mouseup", "1")
        assert "another model" in viewer.event("said")["text"]
        assert viewer.click(640, 440)["part"] == "site/house/walls"
        viewer.quit()
    finally:
        viewer.end()


def check_scale(stroll, display, container, folder):
    """Where the desktop wants text twice as large, the panel is twice as wide."""
    def colour_beside_panel():
        viewer = Viewer(stroll, display, container, folder, "--frames", "100000", size=SIZE)
        try:
            viewer.event("opened")
            return viewer.wait_for(lambda: find_panel(display), "a panel")
        finally:
            viewer.end()

    def find_panel(screen):
        row = screen.shoot(0, 60, 900, 61)[0]
        other = [x for x in range(900) if row[3 * x:3 * x + 3] != bytearray(BACKGROUND)]
        return max(other, default=0) if row[-3:] == bytearray(BACKGROUND) else 0

    folder.mkdir()
    plain = colour_beside_panel()
    with X11(display.environment["DISPLAY"]) as hand:
        hand.set_text_scale(2)
        large = colour_beside_panel()
        hand.set_text_scale(1)
    assert 1.8 < large / plain < 2.2, f"the panel reaches to {plain}, and to {large} where text is twice as large"


def take_pictures(session, pictures):
    """For people and docs/viewer.md: a pick with distance and the parts, and a section."""
    viewer = session.viewer

    def take(name):
        viewer.point(960, 700)
        write_png(pictures / f"{name}.png", session.display.shoot(0, 0, *SIZE))

    session.check_pick(640, 390)
    viewer.key("v")
    viewer.event("arrived")
    viewer.drag(1, 700, 600, 860, 640)
    viewer.drag(3, 640, 500, 640, 420)
    viewer.key("BackSpace", "t")
    viewer.click(610, 330)
    viewer.click(500, 480)
    take("viewer_pick")
    viewer.key("BackSpace")
    viewer.click(700, 60)
    viewer.key("k", *["comma"] * 4)
    take("viewer_section")
    viewer.key("F1")
    take("viewer_help")
    viewer.key("F1", "t", "r")
    viewer.rest()


def run_drawing(stroll, display, container, boxes, folder, *options):
    """What another renderer has a part in: picks on what it shows, hidden and marked parts, sections, looks."""
    folder.mkdir()
    viewer = Viewer(stroll, display, container, folder, *options, size=SIZE)
    session = Session(viewer, display, boxes, stroll)
    try:
        viewer.event("opened")
        viewer.rest()
        check_picks(session)
        check_parts(session)
        check_section(session)
        check_look(session)
        viewer.quit()
    finally:
        viewer.end()


def run_session(stroll, display, container, boxes, folder, pictures, *options):
    folder.mkdir()
    viewer = Viewer(stroll, display, container, folder, *options, size=SIZE)
    session = Session(viewer, display, boxes, stroll)

    try:
        opened = viewer.event("opened")
        assert opened["parts"] == len(boxes) and opened["triangles"] == 12 * len(boxes), opened
        viewer.rest()
        check_rest(session)
        check_resize(session)
        check_picks(session)
        check_parts(session)
        check_list(session)
        check_section(session)
        check_bookmarks(session)
        check_path(session, stroll, container)
        check_look(session)
        check_walk(session)
        if pictures:
            take_pictures(session, pictures)
        check_drop(session, display, folder)
        viewer.quit()
    finally:
        viewer.end()


def main():
    stroll = str(pathlib.Path(sys.argv[1]).resolve())
    pictures = pathlib.Path(sys.argv[2]) if len(sys.argv) > 2 else None
    missing = [tool for tool in ("Xvfb", "xdotool") if not shutil.which(tool)]
    if missing:
        print("skipped: there is no " + " and no ".join(missing))
        return SKIPPED
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        mesh, container, boxes = folder / "site.obj", folder / "site.stroll", make_boxes()
        write_obj(mesh, boxes)
        subprocess.run([stroll, "build", mesh, "-o", container, "--up", "z", "--unit", "m", "--quiet"], check=True,
                       stdout=subprocess.DEVNULL)
        with Display((SIZE[0] + 40, SIZE[1] + 40)) as display:
            run_session(stroll, display, container, boxes, folder / "auto", pictures)
            check_memory(stroll, display, container, folder / "again")
            check_two_windows(stroll, display, container, folder / "two")
            check_roof(stroll, display, folder / "roof")
            check_replaced(stroll, display, container, folder / "replaced")
            check_scale(stroll, display, container, folder / "scale")
        with Display((SIZE[0] + 40, SIZE[1] + 40)) as display:
            run_drawing(stroll, display, container, boxes, folder / "gl3", "--backend", "gl3")
    print("view: picks, parts, sections, bookmarks, paths, walking, dropped files and settings work")
    return 0


if __name__ == "__main__":
    sys.exit(main())
