#!/usr/bin/env python3
"""Measures what docs/benchmarks.md shows: images, claimed errors, build rate, bytes, frame times.

    bench/must_show.py --data DIR [--stroll build/stroll] [--models a,b] [--parts build,images,...] [--write-docs]

DIR holds the models (NAME.ply, .stl, .obj, or those with .zst); isosurfaces are generated. Parts:

    build    one build under --memory 1G: counts, bytes per triangle, peak memory, root      (all models)
    images   orbit and fly-through against the input as read: coverage, depth, PSNR          (all models)
    verify   verify --against the input                                                     (all models)
    rate     five interleaved pairs of builds on one core and on two                        (isosurface_10m)
    bytes    the same container for --jobs 1, 2, 3 and 8                                     (isosurface_1m)
    walk     select_ms and frame_ms on one smooth path through 1 M and 10 M triangles        (isosurface_1m, _10m)
    roots    builds every PLY, STL and OBJ file of DIR: the root's size                      (all files)

Each record goes at once to --log (JSON lines); --write-docs rewrites the tables of docs/benchmarks.md from the log, so that
parts may be measured one after another. `build` also writes the model's row of bench/results.csv."""
import argparse
import hashlib
import json
import math
import pathlib
import shutil
import sys

import counts
import measure
import tables

ROOT = pathlib.Path(__file__).resolve().parent.parent
FILE_MODELS = ("terrain_n49e011", "dragon_scans", "iso_engine", "motorBike", "turbineblade")
SCENE_MODELS = {"isosurface_1m": 1_000_000, "isosurface_10m": 10_000_000}
MODELS = FILE_MODELS + tuple(SCENE_MODELS)
PARTS = ("build", "images", "verify", "rate", "bytes", "walk", "roots")
SUFFIXES = (".ply", ".stl", ".obj")
SIZE = "1280x720"
PAIRS = 5


class Bench:
    def __init__(self, options):
        self.stroll = options.stroll.resolve()
        self.data, self.scratch, self.frames = options.data, options.scratch, options.frames
        self.keep = options.keep
        self.log = measure.Log(options.log, measure.machine(ROOT))

    def program(self, *words, **settings):
        return measure.run([self.stroll, *words, "--quiet"], **settings)

    def input_of(self, model):
        """The model's file, generated or unpacked where it must be."""
        if model in SCENE_MODELS:
            path = self.scratch / f"{model}.ply"
            if not self.is_fresh(path):
                partial = path.with_suffix(".part.ply")
                self.program("scene", "isosurface", "--triangles", SCENE_MODELS[model], "--seed", 1, "-o", partial)
                partial.rename(path)
            return path
        for path in sorted(self.data.rglob(f"{model}.*")):
            if path.suffix in SUFFIXES:
                return path
            if path.suffix == ".zst" and path.with_suffix("").suffix in SUFFIXES:
                unpacked = self.scratch / path.with_suffix("").name
                if not unpacked.exists():
                    measure.run(["zstd", "-q", "-d", path, "-o", unpacked])
                return unpacked
        raise measure.Failed(f"{self.data} holds no {model}.ply, .stl or .obj")

    def is_fresh(self, path):
        """Made by the program as it is now."""
        return path.exists() and path.stat().st_mtime > self.stroll.stat().st_mtime

    def container_of(self, model):
        path = self.scratch / f"{model}.stroll"
        if not self.is_fresh(path):
            self.program("build", self.input_of(model), "-o", path, "--memory", "1G")
        return path


def part_build(bench, model):
    source, container = bench.input_of(model), bench.scratch / f"{model}.stroll"
    outcome = bench.program("build", source, "-o", container, "--memory", "1G", "--json")
    report = outcome.json()
    bench.log.add("build", model, report=report, seconds=outcome.seconds, system_peak_rss_bytes=outcome.peak_rss_bytes,
                  bytes_per_triangle=report["bytes_out"] / max(1, report["triangles_in"]),
                  bytes_in=source.stat().st_size)
    scene = model in SCENE_MODELS
    counts.put_row(counts.row_of("isosurface" if scene else model, SCENE_MODELS.get(model, ""), 1 if scene else "",
                                 report))


def render(bench, target, model_file, path, *extra):
    """Renders a path into the folder `target` and returns the statistics of its frames."""
    shutil.rmtree(target, ignore_errors=True)
    stats = target.with_suffix(".jsonl")
    outcome = bench.program("render", model_file, "--path", path, "--frames", bench.frames, "--seed", 1, "--size", SIZE,
                            "--error", 1, "-o", target, "--stats", stats, *extra)
    return measure.read_stats(stats), outcome.seconds


def compare_pair(bench, model, path, name, *extra):
    """Container against the input as read; keeps the two contact sheets and drops the frames."""
    ours, reference = bench.scratch / f"{model}_{path}_{name}", bench.scratch / f"{model}_{path}_{name}_reference"
    stats, seconds = render(bench, ours, bench.container_of(model), path, *extra)
    _, reference_seconds = render(bench, reference, bench.input_of(model), path, "--full", *extra)
    outcome = bench.program("compare", ours, reference, "--error", 1, "--json", allowed=(0, 1))
    for folder in (ours, reference):
        sheet = folder / "contact.png"
        if sheet.exists():
            shutil.copyfile(sheet, folder.with_suffix(".png"))
        if not bench.keep:
            shutil.rmtree(folder)
    return {"compare": outcome.json(), "holds": outcome.status == 0, "said": outcome.errors, "stats": stats,
            "seconds": seconds, "reference_seconds": reference_seconds}


def part_images(bench, model):
    for path in ("orbit", "flythrough"):
        plain = compare_pair(bench, model, path, "plain", "--depth")
        stats = plain.pop("stats")
        covered = [frame["triangles"] / frame["covered_pixels"] for frame in stats if frame["covered_pixels"]]
        bench.log.add(f"images_{path}", model, triangles_per_covered_pixel=measure.spread(covered),
                      max_error_px=max(frame["max_error_px"] for frame in stats), **plain)
        filtered = compare_pair(bench, model, path, "x4", "--supersample", 4)
        filtered.pop("stats")
        bench.log.add(f"psnr_{path}", model, **filtered)


def part_verify(bench, model):
    outcome = bench.program("verify", bench.container_of(model), "--against", bench.input_of(model), "--memory", "1G",
                            "--json", allowed=(0, 1))
    bench.log.add("verify", model, report=outcome.json(), holds=outcome.status == 0, said=outcome.errors,
                  seconds=outcome.seconds, system_peak_rss_bytes=outcome.peak_rss_bytes)


def part_rate(bench, model):
    source, container = bench.input_of(model), bench.scratch / f"{model}_rate.stroll"
    pairs = []
    for _ in range(PAIRS):
        rates = []
        for cores in (1, 2):
            container.unlink(missing_ok=True)
            outcome = bench.program("build", source, "-o", container, "--memory", "1G", "--jobs", cores, "--json",
                                    cores=cores)
            rates.append(outcome.json()["triangles_in"] / outcome.seconds)
        pairs.append(rates)
    container.unlink(missing_ok=True)
    bench.log.add("rate", model, pairs=pairs, one_core=measure.spread([one for one, _ in pairs]),
                  two_cores=measure.spread([two for _, two in pairs]),
                  speedup=measure.spread([two / one for one, two in pairs]))


def part_bytes(bench, model):
    digests = {}
    for jobs in (1, 2, 3, 8):
        container = bench.scratch / f"{model}_jobs.stroll"
        bench.program("build", bench.input_of(model), "-o", container, "--jobs", jobs)
        digests[jobs] = hashlib.sha256(container.read_bytes()).hexdigest()
        container.unlink()
    bench.log.add("bytes", model, digests=digests, holds=len(set(digests.values())) == 1)


def write_spiral(path, bounds, frames):
    """One and a half turns round the model's centre, from three radii to its middle: smooth, and near the surface."""
    low, high = bounds[:3], bounds[3:]
    centre = [(a + b) / 2 for a, b in zip(low, high)]
    radius = math.dist(low, high) / 2
    places = []
    for frame in range(frames):
        share = frame / max(1, frames - 1)
        angle, distance = 3 * math.pi * share, radius * (3 - 2.6 * share)
        eye = [centre[0] + distance * math.cos(angle), centre[1] + distance * math.sin(angle),
               centre[2] + distance * 0.3 * (1 - share)]
        places.append({"eye": eye, "target": centre, "up": [0, 0, 1]})
    path.write_text(json.dumps({"fov_y_deg": 60, "frames": places}), encoding="utf-8")


def part_walk(bench, _):
    """Three interleaved passes of both models over one path, so that a slow minute of the machine meets both."""
    path = bench.scratch / "spiral.json"
    bounds = bench.program("info", bench.container_of("isosurface_10m"), "--json").json()["bounds"]
    write_spiral(path, tables.flat(bounds), bench.frames * 5)
    frames = {model: [] for model in SCENE_MODELS}
    for _ in range(3):
        for model in SCENE_MODELS:
            stats_file = bench.scratch / f"{model}_walk.jsonl"
            target = bench.scratch / f"{model}_walk"
            bench.program("render", bench.container_of(model), "--path", path, "--size", SIZE, "--error", 1,
                          "--realtime", "--stats", stats_file, "-o", target)
            frames[model] += measure.read_stats(stats_file)
            shutil.rmtree(target, ignore_errors=True)
    medians = {}
    for model, records in frames.items():
        columns = {name: measure.spread([frame[name] for frame in records])
                   for name in ("frame_ms", "select_ms", "triangles", "missing_nodes")}
        medians[model] = columns["frame_ms"]["median"]
        bench.log.add("walk", model, **columns)
    bench.log.add("growth", "isosurface", frame_ms_ratio=medians["isosurface_10m"] / medians["isosurface_1m"])


def part_roots(bench, _):
    for source in sorted(path for path in bench.data.iterdir() if path.suffix in SUFFIXES):
        container = bench.scratch / "roots.stroll"
        outcome = bench.program("build", source, "-o", container, "--memory", "1G", "--json", allowed=(0, 1))
        report = outcome.json() if outcome.status == 0 else {}
        bench.log.add("root", source.stem, report=report, holds=outcome.status == 0, said=outcome.errors)
        container.unlink(missing_ok=True)
        if report:
            counts.put_row(counts.row_of(source.stem, "", "", report))


MODELS_OF_PART = {"rate": ("isosurface_10m",), "bytes": ("isosurface_1m",), "walk": ("",), "roots": ("",)}


def run_parts(bench, parts, models):
    failures = 0
    for part in parts:
        wanted = MODELS_OF_PART.get(part) or models
        for model in wanted:
            print(f"must_show: {part} {model}".rstrip(), flush=True)
            try:
                globals()[f"part_{part}"](bench, model)
            except (measure.Failed, counts.Failed) as failure:
                failures += 1
                print(f"must_show: {part} {model}: {failure}", file=sys.stderr, flush=True)
    return failures


def words_of(text, legal, parser, what):
    words = tuple(word for word in text.split(",") if word)
    for word in words:
        if word not in legal:
            parser.error(f"there is no {what} {word}; they are {', '.join(legal)}")
    return words


def main():
    parser = argparse.ArgumentParser(description="Measures what docs/benchmarks.md shows.")
    parser.add_argument("--data", type=pathlib.Path, required=True, help="folder of models")
    parser.add_argument("--stroll", type=pathlib.Path, default=ROOT / "build" / "stroll", help="the program")
    parser.add_argument("--scratch", type=pathlib.Path, default=ROOT / "build" / "bench", help="folder for what is made")
    parser.add_argument("--log", type=pathlib.Path, default=ROOT / "build" / "bench" / "must_show.jsonl")
    parser.add_argument("--models", default=",".join(MODELS))
    parser.add_argument("--parts", default=",".join(PARTS))
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--keep", action="store_true", help="keep the frames")
    parser.add_argument("--write-docs", action="store_true", help="rewrite the tables of docs/benchmarks.md")
    options = parser.parse_args()
    parts = words_of(options.parts, PARTS, parser, "part")
    models = words_of(options.models, MODELS, parser, "model")
    options.scratch.mkdir(parents=True, exist_ok=True)
    bench = Bench(options)
    failures = run_parts(bench, parts, models)
    text = tables.markdown(bench.log.latest())
    print(text)
    if options.write_docs:
        tables.write_docs(ROOT / "docs" / "benchmarks.md", text)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
