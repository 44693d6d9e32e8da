#!/usr/bin/env python3
"""Measures what docs/benchmarks.md shows: images, claimed errors, build rate, bytes, frame times.

    bench/must_show.py --data DIR [--models a,b] [--parts build,images,...] [--frames N] [--again] [--write-docs]

A model is a file of DIR (NAME.ply, .stl, .obj, .glb, or those with .zst), an archive (NAME.tar or .tar.zst) whose .gltf files
make one model, or isosurface_N, boxes_N, plant_N, chessboard_N or landscape_N (isosurface_10m), which is generated, with
_shuffled behind it in a random order, with _stl, _obj or _placed (glTF with copies) behind that as such a file. --models
replaces each part's own models. Parts:

    build         one build under --memory 1G: counts, bytes per triangle, peak memory, root      (all models)
    images        orbit and fly-through against the input as read: coverage, depth; sheets        (all models)
    psnr          the same paths with --supersample 4                                             (all models)
    verify        verify --against the input                                                      (all models)
    backends      gl45 against gl3 and OpenGL ES on an orbit                           (dragon_scans, isosurface_1m)
    rate          five interleaved pairs of builds on one core and on two                         (isosurface_10m)
    bytes         the same container for --jobs 1, 2, 3 and 8                                     (isosurface_1m)
    sizes         bytes per triangle, as built by default and with --compact; verify of both      (models of several kinds)
    dependencies  with and without: locked vertices per level, triangles drawn at one pixel       (isosurface_10m)
    walk          select_ms and frame_ms of all models on one smooth path                         (isosurface_1m, _10m)
    roots         builds every model of DIR: the root's size                                      (all files)
    models        builds, verifies and draws every model of DIR: a row and a contact sheet each   (all files)
    assemblies    builds of many parts against the first one's rate; what a frame draws of them   (isosurface_10m, clinic, plant_10m)
    scale         builds of one surface of ever more triangles, under --memory 1G           (isosurface_1m to _372m)
    shapes        builds of other kinds of models, against the first one's rate      (isosurface_10m, shuffled, STL, boxes, scans)
    claims        builds with and without --certify: claimed over measured, level by level; CPU time     (isosurface_1m, terrain, scans)
    decode        payloads decoded on one thread, as built by default and with --compact          (models of several kinds)
    kills         a build killed at random moments and resumed, until --kills of them            (isosurface_10m)
    cap           a build under the system's own limit, which ends a program that passes it   (isosurface_10m, plant_1m)
    walk_cold     a walk under --memory 600M, the file cold and warm                   (isosurface_10m, isosurface_372m)
    sampled       builds of sample trees: rate, memory, bytes over Morton order           (isosurface, scans, boxes, chessboard, landscape)
    chessboard    time of a frame against size, splats of 1, 4 and 8 pixels                          (chessboards of 80 K to 320 M)
    large         walks through a landscape of 400 M, one of 2 G placed, and 12,000 scans       (names: MODEL samples, MODEL clusters)
    theorem       sample trees: how many fronts' cells show none of their visible triangles  (chessboard, isosurface, scans, landscape)
    splats        sample trees with splats of 1, 3 and 5 pixels against the input as read        (landscape_2m_obj, dragon_scans, landscape_20m_placed)
    remote        walks over six links against the file: first and final image, missing nodes, frame times    (isosurface_1m, landscape_20m_placed)
    remote_faults   a server that is killed, fails, truncates, stalls, sends wrong bytes, gets another file     (the same)
    remote_clients  --clients of stroll serve at once                                                         (isosurface_1m)

The largest scene takes 9 GB of --scratch, its build 30 GB more. Parts scale, shapes and walk_cold delete the scenes that
they have made (--keep leaves them).

Each record goes at once to --log (JSON lines). What is there of the same program with the same settings is kept, so a
run that was stopped goes on; --again measures anew. --write-docs rewrites the tables of docs/benchmarks.md from the log,
the rows of bench/results.csv and bench/errors.csv, so that parts may be measured one after another."""
import argparse
import math
import pathlib
import re
import shutil
import sys
import time

import cameras
import counts
import file_parts
import measure
import promise_parts
import remote_parts
import sample_parts
import scale_parts
import scene_parts
import sheets
import tables

ROOT = pathlib.Path(__file__).resolve().parent.parent
MODELS = ("terrain_n49e011", "dragon_scans", "iso_engine", "motorBike", "turbineblade", "isosurface_10m")
PATHS = ("orbit", "flythrough")
SUFFIXES = (".ply", ".stl", ".obj", ".glb")
ARCHIVES = (".tar", ".tar.zst")
SCENE = re.compile(r"(isosurface|boxes|plant|chessboard|landscape)_(\d+)([kmg]?)(_shuffled)?(_stl|_placed|_obj)?")
ARRAY = re.compile(r"(\w+)_x(\d+)")  # so many copies of a model
BACKEND_FRAMES = 8
ROOMY = ("--memory", "4G", "--gpu-memory", "4G")  # images are of one pixel, whatever that takes
WALK_FRAMES_A_FRAME = 5  # 300 where the others have 60: a smooth path


class Bench:
    def __init__(self, options):
        self.options = options
        self.root, self.stroll = ROOT, options.stroll.resolve()
        self.data, self.scratch = options.data, options.scratch
        self.log = measure.Log(options.log, measure.machine(ROOT, self.stroll))

    def program(self, *words, **settings):
        return measure.run([self.stroll, *words, "--quiet"], **settings)

    def kept(self, name, model, settings):
        """True where this need not be measured again."""
        kept = not self.options.again and self.log.has(name, model, settings)
        print(f"must_show: {name} {model}{': kept' if kept else ''}", flush=True)
        return kept

    def inputs_of(self, model):
        """The model's files, generated or unpacked where they must be."""
        path, array = self.scene_path(model), ARRAY.fullmatch(model)
        if array and not self.is_fresh(path):
            self.program("scene", "array", "--of", self.inputs_of(array[1])[0], "--copies", array[2], "--seed", 1, "-o", path)
        elif path and not self.is_fresh(path):
            name, shuffled = SCENE.fullmatch(model).group(1, 4)
            self.program("scene", name, "--triangles", scene_triangles(model), "--seed", 1, "-o", path,
                         *(["--shuffle"] if shuffled else []))
        if path:
            return [path]
        for path in sorted(self.data.rglob(f"{model}.*")):
            name = path.name.removeprefix(model)
            if name in ARCHIVES:
                return self.unpacked_archive(path, self.scratch / model)
            if name in SUFFIXES:
                return [path]
            if name.removesuffix(".zst") in SUFFIXES:
                unpacked = self.scratch / path.with_suffix("").name
                if not unpacked.exists():
                    measure.run(["zstd", "-q", "-d", path, "-o", unpacked])
                return [unpacked]
        raise measure.Failed(f"{self.data} holds no {model} with one of {', '.join(SUFFIXES + ARCHIVES)}")

    def unpacked_archive(self, path, folder):
        if not folder.exists():
            folder.mkdir()
            measure.run(["tar", "-x", *(["--zstd"] if path.suffix == ".zst" else []), "-f", path, "-C", folder])
        return sorted(folder.rglob("*.gltf"))

    def reference_of(self, model):
        """What is drawn as the model itself: its one file as read, or the finest level of what many files became."""
        inputs = self.inputs_of(model)
        return inputs[0] if len(inputs) == 1 else self.container_of(model)

    def names_of_data(self):
        """All that --data holds, each once."""
        names = {path.name: path for path in self.data.rglob("*") if path.is_file()}
        endings = [suffix + packed for suffix in SUFFIXES + (".tar",) for packed in ("", ".zst")]
        return sorted({name.removesuffix(ending) for name, path in names.items() for ending in endings
                       if name.endswith(ending) and not name.startswith("nasty")
                       and "nasty" not in path.relative_to(self.data).parts})

    def triangles_of(self, model):
        """As asked for, of a scene; 0 of a file."""
        return scene_triangles(model)

    def scene_path(self, model):
        """None where the model is no scene."""
        scene, array = SCENE.fullmatch(model), ARRAY.fullmatch(model)
        if not scene and not array:
            return None
        placed = array or scene[5] == "_placed" or scene[1] == "plant"
        return self.scratch / f"{model}.{'gltf' if placed else (scene[5] or '_ply')[1:]}"

    def forget_scenes(self, models):
        """Those that anybody can generate again."""
        for model in () if self.options.keep else models:
            if self.scene_path(model):
                self.scene_path(model).unlink(missing_ok=True)
                for beside in self.scratch.glob(f"{model}*.bin"):
                    beside.unlink()

    def is_fresh(self, path):
        """Made by the program as it is now."""
        return path.exists() and path.stat().st_mtime > self.stroll.stat().st_mtime

    def container_path(self, model, *options):
        return self.scratch / f"{model}{''.join(options)}.stroll"

    def container_of(self, model, *options):
        path = self.container_path(model, *options)
        if not self.is_fresh(path):
            self.program("build", *self.inputs_of(model), "-o", path, "--memory", "1G", *options)
        return path

    def render(self, model_file, target, path, *options):
        """Settled images of a path, named or from a file, in the folder `target`. Returns frames' statistics and seconds."""
        shutil.rmtree(target, ignore_errors=True)
        stats = target.with_suffix(".jsonl")
        outcome = self.program("render", model_file, "--path", path, "--seed", 1, "--size", self.options.size, "--error", 1,
                               *ROOMY, "-o", target, "--stats", stats, *options)
        return measure.read_lines(stats), outcome.seconds

    def compare_pair(self, model, path, frames, options, limits, sheet=None):
        """Container against the input as read, with the input's cameras: paths made from both differ by a lattice step."""
        reference, ours = self.scratch / f"{model}_{path}_reference", self.scratch / f"{model}_{path}"
        _, reference_seconds = self.render(self.reference_of(model), reference, path, "--frames", frames, "--full", *options)
        stats, seconds = self.render(self.container_of(model), ours, reference / "path.json", *options)
        outcome = self.program("compare", reference, ours, "--error", 1, "--json", *limits, allowed=(0, 1))
        compared = outcome.json()
        if sheet and frames > 1:
            sheet.parent.mkdir(exist_ok=True)
            sheets.side_by_side(reference / "contact.png", ours / "contact.png", frames, sheet)
        self.drop(reference, ours)
        return compared, stats, {"seconds": seconds, "reference_seconds": reference_seconds, "said": outcome.errors}

    def write_spiral(self, path, model, frames):
        write_spiral(path, self.program("info", self.container_of(model), "--json").json()["bounds"], frames)

    def drop(self, *folders):
        for folder in () if self.options.keep else folders:
            shutil.rmtree(folder)


def scene_triangles(model):
    """How many triangles a scene such as isosurface_N has; 0 = it is none."""
    match = SCENE.fullmatch(model)
    return int(match[2]) * {"": 1, "k": 10**3, "m": 10**6, "g": 10**9}[match[3]] if match else 0


def part_build(bench, model):
    if bench.kept("build", model, {}):
        return
    sources, container = bench.inputs_of(model), bench.scratch / f"{model}.stroll"
    outcome = bench.program("build", *sources, "-o", container, "--memory", "1G", "--json")
    report = outcome.json()
    bench.log.add("build", model, {}, report=report, seconds=outcome.seconds, bytes_in=sum(source.stat().st_size for source in sources),
                  system_peak_rss_bytes=outcome.peak_rss_bytes,
                  bytes_per_triangle=report["bytes_out"] / max(1, report["triangles_in"]))


def part_images(bench, model):
    settings = {"frames": bench.options.frames, "size": bench.options.size}
    for path in PATHS:
        if bench.kept(f"images_{path}", model, settings):
            continue
        sheet = bench.scratch / "sheets" / f"{model}_{path}.png"
        compared, stats, times = bench.compare_pair(model, path, settings["frames"], ("--depth",), ("--psnr", 0), sheet)
        covered = [frame["triangles"] / frame["covered_pixels"] for frame in stats if frame["covered_pixels"]]
        claims = [frame["max_error_px"] for frame in stats if frame["max_error_px"] is not None]
        bench.log.add(f"images_{path}", model, settings, compare=compared, max_error_px=max(claims, default=None),
                      unbounded_frames=len(stats) - len(claims),
                      triangles_per_covered_pixel=measure.spread(covered), **times)


def part_psnr(bench, model):
    settings = {"frames": bench.options.psnr_frames or bench.options.frames, "size": bench.options.size}
    for path in PATHS:
        if bench.kept(f"psnr_{path}", model, settings):
            continue
        options = ("--depth", "--supersample", 4)
        compared, _, times = bench.compare_pair(model, path, settings["frames"], options, ())
        bench.log.add(f"psnr_{path}", model, settings, compare=compared, **times)


def part_verify(bench, model):
    if bench.kept("verify", model, {}):
        return
    outcome = bench.program("verify", bench.container_of(model), "--against", *bench.inputs_of(model), "--memory", "1G",
                            "--json", allowed=(0, 1))
    bench.log.add("verify", model, {}, report=outcome.json(), holds=outcome.status == 0, said=outcome.errors,
                  seconds=outcome.seconds, system_peak_rss_bytes=outcome.peak_rss_bytes)


def part_backends(bench, model):
    settings = {"frames": min(BACKEND_FRAMES, bench.options.frames), "size": bench.options.size}
    if bench.kept("backends", model, settings):
        return
    base, container, others = bench.scratch / f"{model}_gl45", bench.container_of(model), {}
    bench.render(container, base, "orbit", "--frames", settings["frames"], "--depth", "--backend", "gl45")
    for backend in ("gl3", "gles"):
        folder = bench.scratch / f"{model}_{backend}"
        bench.render(container, folder, base / "path.json", "--depth", "--backend", backend)
        compared = bench.program("compare", base, folder, "--error", 1, "--json", allowed=(0, 1)).json()
        same = sum(frame.read_bytes() == (folder / frame.name).read_bytes() for frame in base.glob("frame_*.png"))
        others[backend] = {"compare": compared, "same_frames": same}
        bench.drop(folder)
    bench.drop(base)
    bench.log.add("backends", model, settings, others=others)


def part_rate(bench, model):
    settings = {"pairs": bench.options.pairs}
    if bench.kept("rate", model, settings):
        return
    sources, container = bench.inputs_of(model), bench.scratch / f"{model}_rate.stroll"
    pairs = []
    for _ in range(settings["pairs"]):
        rates = []
        for cores in (1, 2):
            container.unlink(missing_ok=True)
            outcome = bench.program("build", *sources, "-o", container, "--memory", "1G", "--jobs", cores, "--json",
                                    cores=cores)
            rates.append(outcome.json()["triangles_in"] / outcome.seconds)
        pairs.append(rates)
    container.unlink(missing_ok=True)
    bench.log.add("rate", model, settings, pairs=pairs, one_core=measure.spread([one for one, _ in pairs]),
                  two_cores=measure.spread([two for _, two in pairs]),
                  speedup=measure.spread([two / one for one, two in pairs]))


def part_bytes(bench, model):
    if bench.kept("bytes", model, {}):
        return
    digests, container = {}, bench.scratch / f"{model}_jobs.stroll"
    for jobs in (1, 2, 3, 8):
        bench.program("build", *bench.inputs_of(model), "-o", container, "--jobs", jobs)
        digests[jobs] = measure.digest(container)
        container.unlink()
    bench.log.add("bytes", model, {}, digests=digests, holds=len(set(digests.values())) == 1)


def size_of(bench, model, *options):
    """One build, and what verify says of it against the input."""
    container = bench.scratch / f"{model}_sizes.stroll"
    report = bench.program("build", *bench.inputs_of(model), "-o", container, "--memory", "1G", "--json", *options).json()
    outcome = bench.program("verify", container, "--against", *bench.inputs_of(model), "--memory", "1G", "--json", allowed=(0, 1))
    verified = outcome.json()
    finest = verified["uniform_cuts"][0]
    container.unlink()
    return {"bytes_per_triangle": report["bytes_out"] / max(1, report["triangles_in"]), "dropped": report["dropped"],
            "step": report["step"], "quantisation_error": report["quantisation_error"], "holds": outcome.status == 0,
            "cracked_cuts": verified["cracked_cuts"], "cuts": verified["cuts"],
            "measured": max(finest["measured_from_input"], finest["measured_to_input"])}


def part_sizes(bench, model):
    if bench.kept("sizes", model, {}):
        return
    bench.log.add("sizes", model, {}, default=size_of(bench, model), compact=size_of(bench, model, "--compact"))


def level_facts(bench, container):
    facts = bench.program("info", container, "--json").json()["trees"][0]
    names = ("level", "nodes", "groups", "base_vertices", "shared_vertices", "locked_share", "boundary_steps",
             "base_triangles")
    return [{name: level[name] for name in names} for level in facts["per_level"]]


def part_dependencies(bench, model):
    """The null renderer counts what would be drawn; only a path along the surface needs one that sees it."""
    settings = {"frames": bench.options.frames, "size": bench.options.size}
    if bench.kept("dependencies", model, settings):
        return
    sides = {"with": bench.container_of(model), "without": bench.container_of(model, "--no-dependencies")}
    figures = {name: {"levels": level_facts(bench, container), "bytes": container.stat().st_size, "triangles": {}}
               for name, container in sides.items()}
    cameras, stats = bench.scratch / f"{model}_path.json", bench.scratch / f"{model}_dependencies.jsonl"
    for path in PATHS:
        bench.program("render", sides["with"], "--path", path, "--frames", settings["frames"], "--seed", 1,
                      "--size", "64x36", "--save-path", cameras)
        for name, container in sides.items():
            bench.program("render", container, "--path", cameras, "--size", settings["size"], "--error", 1,
                          "--backend", "null", "--stats", stats)
            drawn = [frame["triangles"] for frame in measure.read_lines(stats)]
            figures[name]["triangles"][path] = measure.spread(drawn)
    bench.log.add("dependencies", model, settings, **{f"{name}_dependencies": figure for name, figure in figures.items()})


def write_spiral(path, bounds, frames):
    """One and a half turns round the model's centre, from three radii to its middle: smooth, and near the surface."""
    shares = [frame / max(1, frames - 1) for frame in range(frames)]
    cameras.write_turns(path, bounds, [(3 * math.pi * share, 3 - 2.6 * share, (3 - 2.6 * share) * 0.3 * (1 - share)) for share in shares])


def part_walk(bench, models):
    """Three interleaved passes of all models over one path, so that a slow minute of the machine meets each."""
    settings = {"frames": bench.options.frames * WALK_FRAMES_A_FRAME, "size": bench.options.size, "models": list(models)}
    if all([bench.kept("walk", model, settings) for model in models]):
        return
    path, stats = bench.scratch / "spiral.json", bench.scratch / "walk.jsonl"
    bench.write_spiral(path, models[-1], settings["frames"])
    frames = {model: [] for model in models}
    for _ in range(3):
        for model in models:
            bench.program("render", bench.container_of(model), "--path", path, "--size", settings["size"], "--error", 1,
                          "--realtime", "--stats", stats)
            frames[model] += measure.read_lines(stats)
    for model, records in frames.items():
        columns = {name: measure.spread([frame[name] for frame in records])
                   for name in ("frame_ms", "select_ms", "triangles", "missing_nodes")}
        bench.log.add("walk", model, settings, **columns)


def part_roots(bench, _):
    for model in bench.names_of_data():
        if bench.kept("root", model, {}):
            continue
        container = bench.scratch / "roots.stroll"
        outcome = bench.program("build", *bench.inputs_of(model), "-o", container, "--memory", "1G", "--json", allowed=(0, 1))
        report = outcome.json() if outcome.status == 0 else {}
        bench.log.add("root", model, {}, report=report, holds=outcome.status == 0, said=outcome.errors)
        container.unlink(missing_ok=True)


# Each part with the models it has where --models names none.
PARTS = {"build": (part_build, MODELS), "images": (part_images, MODELS), "psnr": (part_psnr, MODELS),
         "verify": (part_verify, MODELS), "backends": (part_backends, ("dragon_scans", "isosurface_1m")),
         "rate": (part_rate, ("isosurface_10m",)), "bytes": (part_bytes, ("isosurface_1m",)),
         "sizes": (part_sizes, ("isosurface_1m", "isosurface_10m", "dragon_scans", "terrain_n49e011", "iso_cthead", "boxes_1m")),
         "dependencies": (part_dependencies, ("isosurface_10m",)),
         "walk": (part_walk, (("isosurface_1m", "isosurface_10m"),)), "roots": (part_roots, ("",)), **scale_parts.PARTS,
         **promise_parts.PARTS, **file_parts.PARTS, **scene_parts.PARTS, **sample_parts.PARTS, **remote_parts.PARTS}


def models_of(part, chosen):
    """A part that compares its models is given all of them at once."""
    own = PARTS[part][1]
    if not chosen or part == "roots":
        return own
    return (tuple(chosen),) if isinstance(own[0], tuple) else chosen


def run_parts(bench, parts, chosen):
    failures = 0
    for part in parts:
        start = time.monotonic()
        for model in models_of(part, chosen):
            try:
                PARTS[part][0](bench, model)
            except (measure.Failed, sheets.Bad, OSError) as failure:
                failures += 1
                print(f"must_show: {part} {model}: {failure}", file=sys.stderr, flush=True)
        print(f"must_show: {part} took {time.monotonic() - start:.0f} s", flush=True)
    return failures


def put_counts(bench, table):
    """What no clock changes, of the program as it is."""
    for (name, model), record in bench.log.latest().items():
        if name in ("build", "root", "scale", "shapes") and record["report"] and bench.log.is_current(record):
            scene = SCENE.fullmatch(model)
            is_plain = scene and not scene[4] and not scene[5]
            key = (scene[1], scene_triangles(model), 1) if is_plain else (model, "", "")
            counts.put_row(counts.row_of(*key, record["report"]), table)


def words_of(text):
    return [word for word in text.split(",") if word]


def parse_options():
    parser = argparse.ArgumentParser(description="Measures what docs/benchmarks.md shows.")
    parser.add_argument("--data", type=pathlib.Path, required=True, help="folder of models")
    parser.add_argument("--stroll", type=pathlib.Path, default=ROOT / "build" / "stroll", help="the program")
    parser.add_argument("--scratch", type=pathlib.Path, default=ROOT / "build" / "bench", help="folder for what is made")
    parser.add_argument("--log", type=pathlib.Path, default=ROOT / "build" / "bench" / "must_show.jsonl")
    parser.add_argument("--models", default="", help="instead of each part's own, with commas between")
    parser.add_argument("--parts", default=",".join(PARTS), help="with commas between; default: all")
    parser.add_argument("--frames", type=int, default=60, help="of each path (60); the walk has five times as many")
    parser.add_argument("--psnr-frames", type=int, default=0, help="of each path of part psnr (as --frames)")
    parser.add_argument("--size", default="1280x720", help="of images (1280x720)")
    parser.add_argument("--pairs", type=int, default=5, help="of builds in part rate (5)")
    parser.add_argument("--runs", type=int, default=3,
                        help="builds of each model in parts scale, shapes and claims, one of what is over 20 M triangles; rounds of part remote (3)")
    parser.add_argument("--kills", type=int, default=50, help="of builds in part kills (50)")
    parser.add_argument("--theorem-pairs", type=int, default=1_000_000, help="of cells and eyes in part theorem (1,000,000)")
    parser.add_argument("--clients", type=int, default=200, help="at once in part remote_clients (200)")
    parser.add_argument("--again", action="store_true", help="measure what the log has already")
    parser.add_argument("--keep", action="store_true", help="keep the frames, and the scenes that parts delete")
    parser.add_argument("--write-docs", action="store_true", help="put the figures of the log into the tables, the counts and the errors")
    parser.add_argument("--docs", type=pathlib.Path, default=ROOT / "docs" / "benchmarks.md")
    parser.add_argument("--counts", type=pathlib.Path, default=counts.TABLE)
    parser.add_argument("--errors", type=pathlib.Path, default=ROOT / "bench" / "errors.csv")
    options = parser.parse_args()
    options.parts = words_of(options.parts)
    for part in options.parts:
        if part not in PARTS:
            parser.error(f"there is no part {part}; they are {', '.join(PARTS)}")
    if not options.data.is_dir():
        parser.error(f"--data {options.data} is no folder")
    if not options.stroll.is_file():
        parser.error(f"--stroll {options.stroll} is no program")
    return options


def main():
    options = parse_options()
    options.scratch.mkdir(parents=True, exist_ok=True)
    bench = Bench(options)
    failures = run_parts(bench, options.parts, words_of(options.models))
    print(tables.markdown(bench.log.latest()))
    if options.write_docs:
        tables.merge_docs(options.docs, bench.log.latest())
        put_counts(bench, options.counts)
        tables.write_errors(options.errors, bench.log.latest())
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
