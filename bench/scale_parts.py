"""The parts of must_show.py about models far larger than memory. Each takes the Bench and a model, or all models at once
where they are compared."""
import resource

import measure

MEMORY = "1G"
MEMORY_BYTES = 2**30
ONE_RUN_FROM = 20_000_000  # triangles

SIZES = tuple(f"isosurface_{size}m" for size in (1, 10, 100, 372))
SHAPES = ("isosurface_10m", "isosurface_10m_shuffled", "isosurface_10m_stl", "boxes_1m", "boxes_12m", "terrain_n49e011",
          "dragon_scans")

# A limit on what a process may map holds for libraries and for what is reserved and never touched, too.
ADDRESS_MARGIN_BYTES = 512 * 2**20
CAPS = (("64M", 64 * 2**20), (MEMORY, MEMORY_BYTES))

WALK_MEMORY, WALK_MEMORY_BYTES = "600M", 600 * 2**20
WALK_GPU_MEMORY, WALK_GPU_MEMORY_BYTES = "512M", 512 * 2**20
WALK_FRAMES_A_FRAME = 5


def build_once(bench, model, memory=MEMORY, options=(), **settings):
    """One build by the clock and by the system's account; the container stays."""
    sources, container = bench.inputs_of(model), bench.container_path(model, *options)
    container.unlink(missing_ok=True)
    with measure.DiskWatch(f"{container}.tmp") as disk:
        outcome = bench.program("build", *sources, "-o", container, "--memory", memory, "--json", *options, **settings)
    if outcome.status != 0:
        return outcome, None
    report = outcome.json()
    return outcome, {"report": report, "seconds": outcome.seconds, "cpu_seconds": outcome.cpu_seconds,
                     "system_peak_rss_bytes": outcome.peak_rss_bytes,
                     "scratch_bytes": max(disk.most_bytes, report["scratch_bytes"])}


def gathered(runs):
    """Several builds of one model: the spread of times, the most of all else."""
    report = runs[-1]["report"]
    if any(run["report"]["bytes_out"] != report["bytes_out"] for run in runs):
        raise measure.Failed("two builds of one model differ in size")
    return {"report": report, **{name: measure.spread([run[name] for run in runs]) for name in ("seconds", "cpu_seconds")},
            **{name: max(run[name] for run in runs) for name in ("system_peak_rss_bytes", "scratch_bytes")},
            "bytes_per_triangle": report["bytes_out"] / max(1, report["triangles_in"])}


def part_scale(bench, model):
    settings = {"memory": MEMORY, "runs": runs_of(bench, bench.triangles_of(model))}
    if bench.kept("scale", model, settings):
        return
    runs = [build_once(bench, model)[1] for _ in range(settings["runs"])]
    bench.log.add("scale", model, settings, memory_bytes=MEMORY_BYTES, **gathered(runs))
    bench.forget_scenes([model])


def runs_of(bench, triangles):
    return bench.options.runs if triangles < ONE_RUN_FROM else 1


def build_in_turn(bench, models, count):
    """Interleaved, so that a slow minute of the machine meets each model."""
    runs = {model: [] for model in models}
    for _ in range(count):
        for model in models:
            runs[model].append(build_once(bench, model)[1])
    return runs


def part_shapes(bench, models):
    settings = {"memory": MEMORY, "runs": bench.options.runs, "models": list(models)}
    if all([bench.kept("shapes", model, settings) for model in models]):
        return
    runs = build_in_turn(bench, models, settings["runs"])
    for model in models:
        bench.log.add("shapes", model, settings, memory_bytes=MEMORY_BYTES, **gathered(runs[model]))
    bench.forget_scenes(models)


def part_cap(bench, model):
    """The system refuses memory past the limit, and a program that is refused memory ends."""
    settings = {"caps": [word for word, _ in CAPS]}
    if bench.kept("cap", model, settings):
        return
    rows = []
    for word, limit_bytes in CAPS:
        limits = {resource.RLIMIT_DATA: limit_bytes, resource.RLIMIT_AS: limit_bytes + ADDRESS_MARGIN_BYTES}
        outcome, run = build_once(bench, model, word, limits=limits, allowed=None)
        rows.append({"memory": word, "data_limit_bytes": limit_bytes, "holds": outcome.status == 0,
                     "address_limit_bytes": limits[resource.RLIMIT_AS], "said": outcome.errors, **(run or {})})
    # Without this one would not know that the limit bites.
    bitten, _ = build_once(bench, model, CAPS[0][0], limits={resource.RLIMIT_DATA: rows[0].get("system_peak_rss_bytes",
                           CAPS[0][1]) // 4}, allowed=None)
    bench.log.add("cap", model, settings, rows=rows, quarter_status=bitten.status)
    bench.forget_scenes([model])


def walk_once(bench, model, path):
    stats = bench.scratch / "walk_cold.jsonl"
    outcome = bench.program("render", bench.container_of(model), "--path", path, "--size", bench.options.size, "--error", 1,
                            "--realtime", "--memory", WALK_MEMORY, "--gpu-memory", WALK_GPU_MEMORY, "--stats", stats)
    frames = measure.read_lines(stats)
    return {**{name: measure.spread([frame[name] for frame in frames])
               for name in ("frame_ms", "select_ms", "triangles", "missing_nodes", "resident_bytes", "gpu_bytes")},
            "frames_over_budget": sum(frame["resident_bytes"] > WALK_MEMORY_BYTES or
                                      frame["gpu_bytes"] > WALK_GPU_MEMORY_BYTES for frame in frames),
            "frames_waiting_for_disk": sum(frame["disk_waits"] > 0 for frame in frames),
            "faults": frames[-1]["faults"], "disk_read_bytes": outcome.disk_read_bytes,
            "system_peak_rss_bytes": outcome.peak_rss_bytes, "seconds": outcome.seconds}


def part_walk_cold(bench, models):
    """Each model twice on one path: after the system has forgotten the file, and again."""
    settings = {"frames": bench.options.frames * WALK_FRAMES_A_FRAME, "size": bench.options.size, "models": list(models),
                "memory": WALK_MEMORY, "gpu_memory": WALK_GPU_MEMORY}
    if all([bench.kept("walk_cold", model, settings) for model in models]):
        return
    path = bench.scratch / "walk_cold.json"
    for model in models:
        bench.container_of(model)
        bench.forget_scenes([model])
    bench.write_spiral(path, models[-1], 2)
    walk_once(bench, models[0], path)  # the program and its driver are no part of the model
    bench.write_spiral(path, models[-1], settings["frames"])
    for model in models:
        measure.forget_pages(bench.container_of(model))
        bench.log.add("walk_cold", model, settings, cold=walk_once(bench, model, path), warm=walk_once(bench, model, path))


PARTS = {"scale": (part_scale, SIZES), "shapes": (part_shapes, (SHAPES,)), "cap": (part_cap, ("isosurface_10m", "plant_1m")),
         "walk_cold": (part_walk_cold, (("isosurface_10m", "isosurface_372m"),))}
