"""The parts of must_show.py about sample trees: Theorem 1 by a checker of its own (bench/theorem.c), and splats beside the input."""
import math

import cameras
import measure
import sheets

STRUCTURE = ("--structure", "samples")

THEOREM_MODELS = ("chessboard_1m", "isosurface_1m", "dragon_scans", "landscape_2m")
PROBABILITIES = ("0.999999", "0.99", "0.9", "0.5")  # the first is the default of --probability
FEWER = 10  # pairs at the others: what they allow shows in fewer
CONFIDENCE = 0.95

SPLAT_MODELS = ("landscape_2m_obj", "dragon_scans", "landscape_20m_placed")  # a PLY file has no colours of materials
SPLAT_FRAMES = 8
SPLATS = (1, 3, 5)
PATHS = ("orbit", "far orbit", "flythrough")
FAR_RADII = 6  # of the far orbit, from the middle of the model's box


# ---- Theorem 1

def beta_fraction(a, b, x):
    """The continued fraction of the incomplete beta function, by Lentz's method."""
    tiny = 1e-300
    c, d = 1.0, 1 / max(tiny, 1 - (a + b) * x / (a + 1))
    value = d
    for m in range(1, 1000):
        for factor in (m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m)),
                       -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))):
            d = 1 / ((1 + factor * d) or tiny)
            c = (1 + factor / c) or tiny
            value *= c * d
        if abs(c * d - 1) < 1e-12:
            break
    return value


def beta(a, b, x):
    """The regularised incomplete beta function."""
    if x <= 0 or x >= 1:
        return float(x >= 1)
    front = math.exp(math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b) + a * math.log(x) + b * math.log1p(-x))
    if x < (a + 1) / (a + b + 2):
        return front * beta_fraction(a, b, x) / a
    return 1 - front * beta_fraction(b, a, 1 - x) / b


def solve(function, wanted):
    """Where a growing function of [0, 1] is as wanted."""
    low, high = 0.0, 1.0
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if function(middle) < wanted else (low, middle)
    return (low + high) / 2


def share_bounds(failures, trials):
    """The interval of Clopper and Pearson for the share that fails; none for no trials."""
    if not trials:
        return None
    tail = (1 - CONFIDENCE) / 2
    return [solve(lambda x: beta(failures, trials - failures + 1, x), tail) if failures else 0.0,
            solve(lambda x: beta(failures + 1, trials - failures, x), 1 - tail) if failures < trials else 1.0]


def check_theorem(bench, model, probability, pairs):
    """One tree, built with this probability, and what the checker says of it."""
    default = probability == PROBABILITIES[0]
    container = bench.container_of(model, *STRUCTURE, *(() if default else ("--probability", probability)))
    outcome = measure.run([bench.stroll.parent / "theorem", container, "--pairs", pairs, "--probability", probability])
    said = outcome.json()
    if not default:
        container.unlink()
    if not said["candidates"]:
        raise measure.Failed(f"no cell of {model} leaves anything to those below it")
    hidden, broken = (share_bounds(said[failed], said[of]) for failed, of in (("hidden", "pairs"), ("broken", "premise")))
    return {**said, "asked": probability, "hidden_bounds": hidden, "broken_bounds": broken, "seconds": outcome.seconds,
            "holds": not broken or broken[0] <= 1 - said["probability"],
            "holds_of_all": hidden[0] <= 1 - said["probability"]}


def part_theorem(bench, model):
    """By the program theorem, which lies beside stroll where all was built."""
    settings = {"pairs": bench.options.theorem_pairs, "probabilities": list(PROBABILITIES)}
    if bench.kept("theorem", model, settings):
        return
    if not (bench.stroll.parent / "theorem").is_file():
        raise measure.Failed(f"there is no {bench.stroll.parent / 'theorem'}: cmake --build makes it")
    rows = [check_theorem(bench, model, probability, settings["pairs"] if probability == PROBABILITIES[0]
                          else max(1, settings["pairs"] // FEWER)) for probability in PROBABILITIES]
    bench.log.add("theorem", model, settings, rows=rows)


# ---- splats

def against(bench, model, reference, ours, size, *options):
    """What ours shows beside the reference, with its cameras."""
    stats, seconds = bench.render(bench.container_of(model, *STRUCTURE), ours, reference / "path.json", "--splat", size, "--depth", *options)
    return bench.program("compare", reference, ours, "--error", size, "--psnr", 0, "--json", allowed=(0, 1)).json(), stats, seconds


def write_far_orbit(bench, model, frames, path):
    """A turn about the model from where it is a small part of the image, and its triangles smaller than a pixel."""
    bounds = bench.program("info", bench.container_of(model, *STRUCTURE), "--json").json()["bounds"]
    cameras.write_turns(path, bounds, [(2 * math.pi * frame / frames, FAR_RADII, FAR_RADII / 2) for frame in range(frames)])


def compare_splats(bench, model, path, frames):
    """All sizes of splats beside one render of the input's own triangles, with one sample a pixel and with 4 x 4."""
    name = f"{model}_{path}".replace(" ", "_")
    reference, smooth, ours = (bench.scratch / f"{name}_{kind}" for kind in ("full", "smooth", "splats"))
    path_options, rows = (path, "--frames", frames), []
    if path == "far orbit":
        path_options = (bench.scratch / "far_orbit.json",)
        write_far_orbit(bench, model, frames, *path_options)
    bench.render(bench.reference_of(model), reference, *path_options, "--full", "--depth")
    bench.render(bench.reference_of(model), smooth, reference / "path.json", "--full", "--depth", "--supersample", 4)
    for size in SPLATS:
        compared, stats, seconds = against(bench, model, reference, ours, size)
        if frames > 1:
            sheet = bench.scratch / "sheets" / f"{name}_splat{size}.png"
            sheet.parent.mkdir(exist_ok=True)
            sheets.side_by_side(reference / "contact.png", ours / "contact.png", frames, sheet)
        bench.drop(ours)
        smoothly, _, _ = against(bench, model, smooth, ours, size, "--supersample", 4)
        rows.append({"path": path, "splat": size, "compare": compared, "smooth": smoothly, "seconds": seconds,
                     **{name: measure.spread([frame[name] for frame in stats]) for name in ("triangles", "splats")}})
        bench.drop(ours)
    bench.drop(reference)
    bench.drop(smooth)
    return rows


def part_splats(bench, model):
    settings = {"frames": min(SPLAT_FRAMES, bench.options.frames), "size": bench.options.size, "splats": list(SPLATS), "smooth": True}
    if bench.kept("splats", model, settings):
        return
    bench.log.add("splats", model, settings,
                  rows=[row for path in PATHS for row in compare_splats(bench, model, path, settings["frames"])])


PARTS = {"theorem": (part_theorem, THEOREM_MODELS), "splats": (part_splats, SPLAT_MODELS)}
