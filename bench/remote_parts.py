"""The parts of must_show.py about models behind an address: walks over links, faults of the server, and very many clients.

What serves has the last processor for itself and what walks has the others, where there are two: so the walk that reads the
file and those that read the network have the same processors."""
import math
import os
import shutil
import sys
import threading
import time

import cameras
import crowd
import measure
import serving

sys.path.append(str(serving.ROOT / "tests" / "support"))
from shaped_server import ShapedServer

STRUCTURES = ("clusters", "samples")
MODELS = ("isosurface_1m", "landscape_20m_placed")
LINKS = tuple((megabits, latency_ms) for latency_ms in (5, 80) for megabits in (500, 50, 5))
WALK_FRAMES_A_FRAME = 5
FINAL_FRAMES = 3

FAULTS = ("none", "killed", "500", "cut", "stall", "wrong", "swapped")
FAULT_LINK = (5, 80)
FAULT_FPS, FAULT_FRAMES_A_FRAME = 4, 2  # half a minute at a rate that software keeps
# Of the walk's time: the camera moves, the fault begins after so much of it and lasts so long.
MOVING, BEGIN, LASTING = 0.2, 0.04, 0.15

CROWD_CONNECTIONS = 8  # a walk has six


class Site:
    """A folder that stroll serve serves, and the shaping proxy before it."""

    def __init__(self, bench, name):
        self.folder = bench.scratch / name
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir()
        self.walkers, self.servers = serving.processors()
        self.serve = serving.Serve(bench.stroll, self.folder, self.servers)
        self.proxy = ShapedServer(upstream=self.serve.port)

    def __enter__(self):
        with serving.on_processors(self.servers):
            self.serve.start()
            self.proxy.upstream = self.serve.port
            self.proxy.restart()
        return self

    def __exit__(self, *_):
        self.proxy.kill()
        self.serve.kill()
        shutil.rmtree(self.folder)

    def put(self, container, name):
        """As a build does: whole, by a rename."""
        shutil.copy(container, self.folder / f"{name}.part")
        os.replace(self.folder / f"{name}.part", self.folder / name)
        return self.proxy.url(name)

    def shape(self, link):
        self.proxy.bits_per_second, self.proxy.latency = (link[0] * 1e6, link[1] * 1e-3) if link else (0, 0)


def container_of(bench, model, structure):
    return bench.container_of(model, *(() if structure == "clusters" else ("--structure", structure)))


def walk_lines(bench, place, site, *options):
    """Of a walk that knows nothing yet: with a cache, as anybody's, that is empty. Only where images are wanted for files they
    are drawn: `options` tell."""
    cache, stats = bench.scratch / "remote_cache", bench.scratch / "remote.jsonl"
    shutil.rmtree(cache, ignore_errors=True)
    start = time.monotonic()
    bench.program("render", place, "--error", 1, "--stats", stats, "--cache", cache, *options, cores=site.walkers)
    shutil.rmtree(cache, ignore_errors=True)
    return measure.read_lines(stats), start


def images_of(folder):
    return [path.read_bytes() for path in sorted(folder.glob("frame_*.png"))]


# ---- links
def link_once(bench, place, site, path, images):
    """The first image, the final one, and a walk; each anew."""
    size = ("--size", bench.options.size)
    first, _ = walk_lines(bench, place, site, *size, "--realtime", "--path", "orbit", "--frames", 1, "-o", images)
    shutil.rmtree(images)
    final, _ = walk_lines(bench, place, site, *size, "--path", "orbit", "--frames", FINAL_FRAMES, "-o", images)
    walk, _ = walk_lines(bench, place, site, *size, "--realtime", "--path", path, "--backend", "null")
    return {"first_s": first[0]["elapsed_ms"] * 1e-3, "final_s": final[0]["elapsed_ms"] * 1e-3,
            "first_covers": first[0]["covered_pixels"] / max(1, final[0]["covered_pixels"]),
            "final_bytes": final[0]["network"]["bytes"] if "network" in final[0] else final[0]["bytes_read"],
            "images": images_of(images), "walk": walk}


def link_figures(runs, reference):
    frames = [frame for run in runs for frame in run["walk"]]
    networks = [run["walk"][-1].get("network", {}) for run in runs]
    return {**{name: measure.spread([run[name] for run in runs]) for name in ("first_s", "first_covers", "final_s", "final_bytes")},
            **{name: measure.spread([frame[name] for frame in frames]) for name in ("frame_ms", "select_ms")},
            "missing_frames": sum(frame["missing_nodes"] > 0 for frame in frames) / len(runs),
            "walk_frames": len(frames) / len(runs), "walk_bytes": measure.spread([network.get("bytes", 0) for network in networks]),
            "failures": sum(network.get("failures", 0) for network in networks), "faults": max(frame["faults"] for frame in frames),
            "same": all(run["images"] == reference for run in runs)}


def links_of(bench, model, structure, runs):
    """All links in turn, and again, so that a slow minute of the machine meets each."""
    container, path = container_of(bench, model, structure), bench.scratch / "remote_path.json"
    bench.write_spiral(path, model, bench.options.frames * WALK_FRAMES_A_FRAME)
    images, taken = bench.scratch / "remote_images", {link: [] for link in (None, *LINKS)}
    with Site(bench, "remote") as site:
        url = site.put(container, "model.stroll")
        for _ in range(runs):
            for link, figures in taken.items():
                site.shape(link)
                shutil.rmtree(images, ignore_errors=True)
                figures.append(link_once(bench, url if link else container, site, path, images))
    bench.drop(images)
    reference = taken[None][0]["images"]
    return [{"link": link, **link_figures(figures, reference)} for link, figures in taken.items()]


def part_remote(bench, model):
    settings = {"frames": bench.options.frames * WALK_FRAMES_A_FRAME, "size": bench.options.size, "runs": bench.options.runs}
    if bench.kept("remote", model, settings):
        return
    bench.log.add("remote", model, settings, processors=serving.processors()[0],
                  **{structure: links_of(bench, model, structure, settings["runs"]) for structure in STRUCTURES})


# ---- faults
def write_arc(bench, path, container, frames):
    """A quarter of a turn at 1.5 radii, then standing still."""
    bounds = bench.program("info", container, "--json").json()["bounds"]
    cameras.write_turns(path, bounds, [(math.pi / 2 * min(1, frame / (MOVING * frames)), 1.5, 0.4) for frame in range(frames)])


class Accident(threading.Thread):
    """What goes wrong some time after the first image, by the monotonic clock: from `begin` to `end`."""

    def __init__(self, site, fault, other, images, after_s, lasting_s):
        super().__init__(daemon=True)
        self.site, self.fault, self.other, self.images, self.after_s, self.lasting_s = site, fault, other, images, after_s, lasting_s
        self.over, self.begin, self.end = threading.Event(), None, None

    def run(self):
        while not any(self.images.glob("*")) and not self.over.wait(0.005):
            pass
        self.over.wait(self.after_s)
        with serving.on_processors(self.site.servers):
            self.begin = time.monotonic()
            self.happen()
            self.over.wait(self.lasting_s)
            self.pass_by()
            self.end = time.monotonic()

    def happen(self):
        proxy = self.site.proxy
        if self.fault == "killed":
            proxy.kill()  # what it has of answers already would come whole
            self.site.serve.kill()
        elif self.fault == "swapped":
            self.site.put(self.other, "model.stroll")
        elif self.fault != "none":
            proxy.fault = lambda number, path: self.fault

    def pass_by(self):
        self.site.proxy.fault = None
        if self.fault == "killed":
            self.site.serve.start()
            self.site.proxy.restart()


def fault_figures(lines, start, accident, covered):
    """times: of the frames' finished pixels."""
    times = [start + line["elapsed_ms"] * 1e-3 for line in lines]
    lacking = [at for at, line in enumerate(lines) if line["missing_nodes"] > 0 and times[at] > accident.begin]
    whole_at = lacking[-1] + 1 if lacking else 0
    healed = whole_at < len(lines)
    until = max(times[whole_at], accident.end) if healed else times[-1]
    meanwhile = [at for at, moment in enumerate(times) if accident.begin < moment <= until]
    return {"frames": len(meanwhile), "missing_frames": sum(lines[at]["missing_nodes"] > 0 for at in meanwhile),
            "covered_least": min((lines[at]["covered_pixels"] / max(1, covered[at]) for at in meanwhile), default=1.0),
            "frame_gap_s": max((later - now for now, later in zip(times, times[1:])), default=0), "healed": healed,
            "healed_s": max(0.0, until - accident.end) if healed else None, "lasted_s": accident.end - accident.begin,
            "said": lines[-1]["last_fault"].split(": ", 1)[-1], "faults": lines[-1]["faults"], "network": lines[-1]["network"]}


def small(size):
    """A quarter as wide and high: a few pictures a second, in software too."""
    return "x".join(str(max(16, int(word) // 4)) for word in size.split("x"))


def faults_of(bench, model, structure):
    container = container_of(bench, model, structure)
    other = container_of(bench, model, next(name for name in STRUCTURES if name != structure))
    frames = bench.options.frames * FAULT_FRAMES_A_FRAME
    images, path = bench.scratch / "remote_images", bench.scratch / "remote_path.json"
    write_arc(bench, path, container, frames)
    options, seconds = ("--size", small(bench.options.size), "--path", path, "-o", images), frames / FAULT_FPS
    rows = []
    for fault in FAULTS:
        with Site(bench, "remote") as site:
            shutil.rmtree(images, ignore_errors=True)
            if not rows:
                local, _ = walk_lines(bench, container, site, *options)
                reference, covered = images_of(images)[-1], [line["covered_pixels"] for line in local]
                shutil.rmtree(images)
            url = site.put(container, "model.stroll")
            site.shape(FAULT_LINK)
            accident = Accident(site, fault, other, images, BEGIN * seconds, LASTING * seconds)
            accident.start()
            try:
                lines, start = walk_lines(bench, url, site, "--realtime", FAULT_FPS, *options)
            finally:
                accident.over.set()
                accident.join()
            rows.append({"fault": fault, "same": images_of(images)[-1] == reference,
                         **fault_figures(lines, start, accident, covered)})
    bench.drop(images)
    return rows


def part_remote_faults(bench, model):
    settings = {"frames": bench.options.frames * FAULT_FRAMES_A_FRAME, "size": small(bench.options.size), "link": list(FAULT_LINK)}
    if bench.kept("remote_faults", model, settings):
        return
    bench.log.add("remote_faults", model, settings, **{structure: faults_of(bench, model, structure) for structure in STRUCTURES})


# ---- very many clients
def asked_by_a_walk(bench, site, url):
    """The ranges of one settled image, in the order in which a walk asks for them."""
    site.proxy.asked.clear()
    walk_lines(bench, url, site, "--size", bench.options.size, "--path", "orbit", "--frames", 1, "--backend", "null")
    return [(first, last) for _, first, last in site.proxy.asked]


def replayed(bench, container):
    with Site(bench, "remote") as site:
        ranges = asked_by_a_walk(bench, site, site.put(container, "model.stroll"))
    with Site(bench, "remote") as site:  # whose memory nobody has used yet
        site.put(container, "model.stroll")
        with serving.on_processors(serving.of_walks()):
            figures = crowd.replay(site.serve.port, "/model.stroll", ranges, container.read_bytes(), bench.options.clients)
        return {**figures, "peak_bytes": site.serve.peak_bytes()}


def programs(bench, container):
    count = bench.options.clients
    with Site(bench, "remote") as site:
        site.put(container, "model.stroll")
        site.serve.kill()  # all programs have one address: its limits are those of one
        site.serve.start("--rate", 0, "--connections", CROWD_CONNECTIONS * count)
        command = [bench.stroll, "render", f"http://127.0.0.1:{site.serve.port}/model.stroll", "--no-cache", "--size",
                   small(bench.options.size), "--path", "orbit", "--frames", 1, "--backend", "null", "--quiet", "--stats"]
        with serving.on_processors(serving.of_walks()):
            figures = crowd.programs(command, bench.scratch / "remote_crowd", count)
        return {**figures, **site.serve.logged(), "peak_bytes": site.serve.peak_bytes()}


def part_remote_clients(bench, model):
    settings = {"clients": bench.options.clients, "size": bench.options.size}
    if bench.kept("remote_clients", model, settings):
        return
    bench.log.add("remote_clients", model, settings,
                  **{structure: {"replayed": replayed(bench, container_of(bench, model, structure)),
                                 "programs": programs(bench, container_of(bench, model, structure))} for structure in STRUCTURES})


PARTS = {"remote": (part_remote, MODELS), "remote_faults": (part_remote_faults, MODELS),
         "remote_clients": (part_remote_clients, ("isosurface_1m",))}
