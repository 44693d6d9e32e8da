"""The parts of must_show.py about what people bring: every model of a folder, and models of very many parts."""
import measure
import scale_parts
import sheets

SHOWN_FRAMES = 6
ASSEMBLIES = ("isosurface_10m", "clinic", "plant_10m")


def render(bench, model_file, target, path, *options):
    stats = target.with_suffix(".jsonl")
    bench.program("render", model_file, "--path", path, "--size", bench.options.size, "--error", 1, "-o", target, "--stats", stats,
                  "--depth", *options)
    return measure.read_lines(stats)


def look_at(bench, model, supersample):
    """An orbit of the container beside the same of the input, as compare sees it, and a sheet for people."""
    folders = [bench.scratch / f"{model}_{side}" for side in ("reference", "ours")]
    options, shown = ("--supersample", supersample), min(SHOWN_FRAMES, bench.options.frames)
    render(bench, bench.reference_of(model), folders[0], "orbit", "--frames", shown, "--full", *options)
    frames = render(bench, bench.container_of(model), folders[1], folders[0] / "path.json", *options)
    compared = bench.program("compare", *folders, "--error", 1, "--json", allowed=(0, 1)).json()
    sheet = bench.scratch / "sheets" / f"{model}_x{supersample}.png"
    sheet.parent.mkdir(exist_ok=True)
    if shown > 1:
        sheets.side_by_side(*(folder / "contact.png" for folder in folders), shown, sheet)
    bench.drop(*folders)
    return compared, {name: measure.spread([frame[name] for frame in frames]) for name in ("triangles", "draws")}


def show(bench, model):
    settings = {"frames": min(SHOWN_FRAMES, bench.options.frames), "size": bench.options.size}
    if bench.kept("model", model, settings):
        return
    _, built = scale_parts.build_once(bench, model)
    verified = bench.program("verify", bench.container_of(model), "--against", *bench.inputs_of(model), "--memory", "1G",
                             "--json", allowed=(0, 1))
    compared, drawn = look_at(bench, model, 1)
    filtered, _ = look_at(bench, model, 4)
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
    runs = {model: [] for model in models}
    for _ in range(settings["runs"]):
        for model in models:
            runs[model].append(scale_parts.build_once(bench, model)[1])
    for model in models:
        stats = bench.scratch / "assembly.jsonl"
        bench.program("render", bench.container_of(model), "--path", "orbit", "--frames", settings["frames"], "--size",
                      settings["size"], "--error", 1, "--backend", "null", "--stats", stats)
        frames = measure.read_lines(stats)
        drawn = {name: measure.spread([frame[name] for frame in frames]) for name in ("triangles", "draws")}
        bench.log.add("assembly", model, settings, drawn=drawn, **scale_parts.gathered(runs[model]))
    bench.forget_scenes(models)


PARTS = {"models": (part_models, ("",)), "assemblies": (part_assemblies, (ASSEMBLIES,))}
