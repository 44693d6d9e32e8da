"""The parts of must_show.py about what is promised: claims of every level, builds that are killed, payloads that decode."""
import json
import sys

import measure

CLAIMED = ("isosurface_1m", "terrain_n49e011", "dragon_scans")
DECODED = ("isosurface_10m", "terrain_n49e011", "dragon_scans", "motorBike")
SIDES = {"default": (), "certified": ("--certify",)}


def part_claims(bench, model):
    """Builds without and with --certify in turn, then what verify says of the last of each, level by level."""
    settings = {"runs": bench.options.runs}
    if bench.kept("claims", model, settings):
        return
    sources, reports, cpu = bench.inputs_of(model), {}, {side: [] for side in SIDES}
    containers = {side: bench.scratch / f"{model}_{side}.stroll" for side in SIDES}
    for _ in range(settings["runs"]):
        for side, options in SIDES.items():
            outcome = bench.program("build", *sources, "-o", containers[side], "--memory", "1G", "--json", *options)
            reports[side] = outcome.json()
            cpu[side].append(outcome.cpu_seconds)
    record = {}
    for side, container in containers.items():
        outcome = bench.program("verify", container, "--against", *sources, "--memory", "1G", "--json", allowed=(0, 1))
        levels = outcome.json()["levels"]
        record[side] = {"report": reports[side], "cpu_seconds": measure.spread(cpu[side]), "holds": outcome.status == 0,
                        "levels": [level["claimed_over_measured"] for level in levels]}
        container.unlink()
    bench.log.add("claims", model, settings, **record)


def part_decode(bench, model):
    """By the program bench_streams, which lies beside stroll where all was built."""
    streams = bench.stroll.parent / "bench_streams"
    if bench.kept("decode", model, {}):
        return
    if not streams.is_file():
        raise measure.Failed(f"there is no {streams}: cmake --build makes it")
    sides = {}
    for side, options in (("default", ()), ("compact", ("--compact",))):
        sides[side] = measure.run([streams, bench.container_of(model, *options)]).json()
    bench.log.add("decode", model, {}, **sides)


def part_kills(bench, model):
    settings = {"kills": bench.options.kills}
    if bench.kept("kills", model, settings):
        return
    folder = bench.scratch / "kills"
    command = [sys.executable, "-B", bench.root / "bench" / "kill_resume.py", bench.stroll, "--scratch", folder, "--triangles",
               bench.triangles_of(model), "--kills", settings["kills"]]
    outcome = measure.run(command)
    bench.drop(folder)
    bench.log.add("kills", model, settings, **json.loads(outcome.output.strip().split("\n")[-1]))


PARTS = {"claims": (part_claims, CLAIMED), "decode": (part_decode, DECODED), "kills": (part_kills, ("isosurface_10m",))}
