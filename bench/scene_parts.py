"""The parts of must_show.py about sample trees and placements: how fast and how small they are built, and what a frame costs where
a scene grows. Each takes the Bench and a model, or all models at once where they are compared."""
import json

import measure
import scale_parts

SAMPLES = ("--structure", "samples")
MORTON_MOST = 20_000_000  # triangles; the bench program holds them in memory
SPLATS = (1, 4, 8)
LARGE_SPLATS = (1, 5)  # 5: as Klein et al. (2005) draw their largest landscape
CHESSBOARDS = ("chessboard_80k", "chessboard_8m", "chessboard_32m", "chessboard_320m")
SAMPLED = ("isosurface_1m", "isosurface_10m", "dragon_scans", "boxes_1m", "chessboard_8m", "landscape_10m", "landscape_400m")
STRUCTURES = {"samples": SAMPLES, "clusters": ()}
LARGE = ("landscape_400m samples", "landscape_2g_placed samples", "landscape_2g_placed clusters", "dragon_scans_x12000 samples",
         "dragon_scans_x12000 clusters")
ROOMY = ("--memory", "12G", "--gpu-memory", "4G")  # the size of the splats decides, not a budget
COLUMNS = ("frame_ms", "select_ms", "triangles", "splats", "draws", "requests", "missing_nodes")


def morton_bytes(bench, container, report):
    """Of a page of the same triangles in Morton order, in the same codec; None where they are too many for memory."""
    if report["triangles_in"] > MORTON_MOST:
        return None
    program = bench.stroll.parent / "bench_morton"
    return measure.run([program, container]).json()


def part_sampled(bench, model):
    settings = {"memory": scale_parts.MEMORY, "runs": scale_parts.runs_of(bench, bench.triangles_of(model))}
    if bench.kept("sampled", model, settings):
        return
    runs = [scale_parts.build_once(bench, model, options=SAMPLES)[1] for _ in range(settings["runs"])]
    figures = scale_parts.gathered(runs)
    container = bench.container_path(model, *SAMPLES)
    bench.log.add("sampled", model, settings, memory_bytes=scale_parts.MEMORY_BYTES,
                  morton=morton_bytes(bench, container, figures["report"]), **figures)
    bench.forget_scenes([model])


def frames_of(bench, container, path, *options):
    stats = bench.scratch / "scene.jsonl"
    bench.program("render", container, "--path", path, "--seed", 1, "--size", bench.options.size, "--error", 1, "--stats", stats,
                  *options)
    return measure.read_lines(stats)


def columns_of(frames):
    return {name: measure.spread([frame[name] for frame in frames]) for name in COLUMNS}


def twice(bench, container, frames):
    """An orbit, and the same again."""
    path = bench.scratch / "twice.json"
    bench.program("render", container, "--path", "orbit", "--seed", 1, "--size", "64x36", "--frames", frames, "--error", 64, "--backend", "null",
                  "--save-path", path)
    cameras = json.loads(path.read_text(encoding="utf-8"))
    cameras["frames"] *= 2
    path.write_text(json.dumps(cameras), encoding="utf-8")
    return path


def part_chessboard(bench, models):
    """The field of view stays, the fields of the board become smaller. The first turn loads what the second one shows."""
    settings = {"frames": bench.options.frames, "turns": 2, "memory": ROOMY[1], "size": bench.options.size, "models": list(models)}
    if all([bench.kept("chessboard", model, settings) for model in models]):
        return
    for model in models:
        container = bench.container_of(model, *SAMPLES)
        splats, path = {}, twice(bench, container, settings["frames"])
        for splat in SPLATS:
            frames = frames_of(bench, container, path, "--splat", splat, *ROOMY)
            splats[str(splat)] = columns_of(frames[len(frames) // 2:])
        bench.log.add("chessboard", model, settings, splats=splats)
        bench.forget_scenes([model])


def part_large(bench, name):
    """A path over the surface, as a visitor walks it: never waiting for bytes. name: a model and, behind a space, a structure."""
    model, _, structure = name.partition(" ")
    options = STRUCTURES[structure or "samples"]
    splats = LARGE_SPLATS if structure == "samples" else LARGE_SPLATS[:1]
    settings = {"frames": bench.options.frames, "size": bench.options.size, "splats": list(splats)}
    if bench.kept("large", name, settings):
        return
    container = bench.container_of(model, *options)
    facts = bench.program("info", container, "--json").json()
    rows = []
    for splat in splats:
        frames = frames_of(bench, container, "flythrough", "--frames", settings["frames"], "--realtime", "--splat", splat)
        rows.append({"splat": splat, "requests_a_frame": sum(frame["requests"] for frame in frames) / len(frames), **columns_of(frames)})
    bench.log.add("large", name, settings, bytes=container.stat().st_size, stored=facts["triangles"],
                  placed=facts["triangles_placed"], placements=facts["placements"], rows=rows)
    bench.forget_scenes([model])


PARTS = {"sampled": (part_sampled, SAMPLED), "chessboard": (part_chessboard, (CHESSBOARDS,)), "large": (part_large, LARGE)}
