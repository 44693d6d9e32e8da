"""The parts of must_show.py about what people bring: every model of a folder, and models of very many parts."""
import measure
import scale_parts

SHOWN_FRAMES = 6
ASSEMBLIES = ("isosurface_10m", "clinic", "plant_10m")


def drawn_of(frames):
    return {name: measure.spread([frame[name] for frame in frames]) for name in ("triangles", "draws")}


def look_at(bench, model, frames, supersample):
    """An orbit beside the same of the input, as compare sees it, and a sheet for people."""
    sheet = bench.scratch / "sheets" / f"{model}_x{supersample}.png"
    compared, stats, _ = bench.compare_pair(model, "orbit", frames, ("--depth", "--supersample", supersample), (), sheet)
    return compared, drawn_of(stats)


def show(bench, model):
    settings = {"frames": min(SHOWN_FRAMES, bench.options.frames), "size": bench.options.size}
    if bench.kept("model", model, settings):
        return
    _, built = scale_parts.build_once(bench, model)
    verified = bench.program("verify", bench.container_of(model), "--against", *bench.inputs_of(model), "--memory", "1G",
                             "--json", allowed=(0, 1))
    compared, drawn = look_at(bench, model, settings["frames"], 1)
    filtered, _ = look_at(bench, model, settings["frames"], 4)
    bench.log.add("model", model, settings, files=len(bench.inputs_of(model)), verified=verified.json(), holds=verified.status == 0,
                  said=verified.errors, compare=compared, filtered=filtered, drawn=drawn, **built)


def part_models(bench, model):
    for name in [model] if model else bench.names_of_data():
        show(bench, name)


def part_assemblies(bench, models):
    """Interleaved builds, as part shapes does, and what a frame of an orbit draws at one pixel."""
    settings = {"memory": scale_parts.MEMORY, "runs": bench.options.runs, "models": list(models), "size": bench.options.size,
                "frames": bench.options.frames}
    if all([bench.kept("assembly", model, settings) for model in models]):
        return
    runs = scale_parts.build_in_turn(bench, models, settings["runs"])
    for model in models:
        stats = bench.scratch / "assembly.jsonl"
        bench.program("render", bench.container_of(model), "--path", "orbit", "--frames", settings["frames"], "--size",
                      settings["size"], "--error", 1, "--backend", "null", "--stats", stats)
        bench.log.add("assembly", model, settings, drawn=drawn_of(measure.read_lines(stats)),
                      **scale_parts.gathered(runs[model]))
    bench.forget_scenes(models)


PARTS = {"models": (part_models, ("",)), "assemblies": (part_assemblies, (ASSEMBLIES,))}
