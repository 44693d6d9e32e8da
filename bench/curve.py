#!/usr/bin/env python3
"""Draws error against triangles of whole-model cuts: Stroll's, and those of a cluster hierarchy as Nanite has it.

    bench/curve.py --data DIR [--models a,b] [--peers FILE,FILE] [--errors LIST] [--samples N] [--again] [--write-docs]

Each model (as bench/must_show.py has them: a file of DIR, or isosurface_N, which is generated) is built by default, by
`build --certify` where the program has that, and by each peer (bench/peer_dag.c; one that is linked to another version of
its library makes another curve). Each is cut at the same list of claimed errors, and what the cuts are really apart from
the input is measured by bench/surface_distance.c, which shares code with none of them. A model that is not there is
skipped, and said so.

Each curve goes at once to --log (JSON lines) and is not taken again while program and settings are the same (--again
does). --write-docs rewrites docs/images/curve_MODEL.svg, bench/curve.csv and the tables of docs/benchmarks.md."""
import argparse
import csv
import json
import pathlib
import statistics
import sys

import curve_plot
import measure
import must_show
import tables

ROOT = must_show.ROOT
MODELS = ("isosurface_1m", "terrain_n49e011", "dragon_scans")
ERRORS = tuple(1e-6 * 2**(step / 2) for step in range(36))  # of the diagonal
# Cuts of more triangles are not drawn instead of the input, and of fewer they are hardly the model: shares of the input's.
MOST, LEAST = 0.85, 1 / 2000
BEGIN, END = "<!-- curve: begin -->", "<!-- curve: end -->"
COLUMNS = ("model", "program", "asked", "triangles", "rms", "max")
MEASURES = ("rms", "max")


def triangles_of(path):
    """What the header of a PLY file says."""
    with open(path, "rb") as file:
        for line in file:
            if line.startswith(b"element face "):
                return int(line.split()[2])
            if line.startswith(b"end_header"):
                break
    raise measure.Failed(f"{path} has no faces")


def json_lines(text):
    """METIS may complain on the same stream."""
    return [json.loads(line) for line in text.splitlines() if line.startswith("{")]


class Curves:
    def __init__(self, options):
        self.options, self.bench = options, must_show.Bench(options)
        self.settings = {"errors": list(options.errors), "samples": options.samples}

    def diagonal(self, container):
        bounds = self.bench.program("info", container, "--json").json()["bounds"]
        return sum((high - low)**2 for low, high in zip(bounds[:3], bounds[3:]))**0.5

    def measured(self, source, files):
        """One dict a file, lengths as shares of the diagonal."""
        outcome = measure.run([self.options.measurer, "--samples", self.options.samples, source, *files])
        return [{"triangles": cut["triangles"], **{name: cut[name] / cut["diagonal"] for name in MEASURES}}
                for cut in json_lines(outcome.output)]

    def worth(self, files, source):
        """Asked error -> cut, without what neighbours have already and what is too fine or too coarse to be drawn."""
        input_triangles, before, kept = triangles_of(source), None, {}
        for error, file in zip(self.options.errors, files):
            triangles = triangles_of(file)
            if LEAST * input_triangles <= triangles <= MOST * input_triangles and triangles != before:
                kept[error] = file
            before = triangles
        return kept

    def add(self, name, model, settings, files, **facts):
        """Measures one curve's cuts, logs them and deletes them."""
        source = self.bench.inputs_of(model)[0]
        kept = self.worth(files, source)
        if not kept:
            raise measure.Failed(f"no cut of {name} is worth measuring: --errors are too small or too large")
        cuts = [{"asked": error, **cut} for error, cut in zip(kept, self.measured(source, kept.values()))]
        self.bench.log.add(f"curve {name}", model, settings, name=name, cuts=cuts, **facts)
        for file in files:
            file.unlink()

    def take_own(self, name, model, *build_options):
        if self.bench.kept(f"curve {name}", model, self.settings):
            return
        container = self.bench.container_of(model, *build_options)
        diagonal, files = self.diagonal(container), []
        for i, error in enumerate(self.options.errors):
            files.append(self.options.scratch / f"{model}_cut_{i}.ply")
            self.bench.program("extract", container, "--error", repr(error * diagonal), "-o", files[-1])
        self.add(name, model, self.settings, files)

    def take_peer(self, peer, model):
        """Kept whatever became of Stroll since: the peer does not know it."""
        settings = {**self.settings, "peer": measure.digest(peer)[:12]}
        kept = [record for (_, of), record in self.bench.log.latest().items() if of == model and record["settings"] == settings]
        print(f"curve: {peer} {model}{': kept' if kept else ''}", flush=True)
        if kept and not self.options.again:
            return
        diagonal = self.diagonal(self.bench.container_of(model))
        outcome = measure.run([peer, self.bench.inputs_of(model)[0], self.options.scratch / f"{model}_peer",
                               *(repr(error * diagonal) for error in self.options.errors)])
        facts, *cuts = json_lines(outcome.output)
        version = f"{facts['library'] // 1000}.{facts['library'] % 1000 // 10}"
        self.add(f"cluster DAG, meshoptimizer {version}", model, settings, [pathlib.Path(cut["file"]) for cut in cuts],
                 hierarchy=facts)

    def take(self, model):
        self.take_own("stroll", model)
        if "--certify" in self.bench.program("build", "--help").output:
            self.take_own("stroll --certify", model, "--certify")
        for peer in self.options.peers:
            self.take_peer(peer, model)


def curves_of(records, model):
    """name -> cuts, Stroll's first."""
    found = {record["name"]: record["cuts"] for (name, of), record in sorted(records.items())
             if name.startswith("curve ") and of == model}
    return dict(sorted(found.items(), key=lambda item: (not item[0].startswith("stroll"), item[0])))


def ratio_rows(model, curves):
    """At errors that all curves have: triangles of each, and Stroll's over each peer's."""
    own, others = next(iter(curves)), [name for name in curves if not name.startswith("stroll")]
    for name in MEASURES:
        ratios = {other: [] for other in others}
        for error in curve_plot.round_errors(list(curves.values()), name):
            needed = {of: curve_plot.triangles_at(curve, name, error) for of, curve in curves.items()}
            for other in others:
                ratios[other].append(needed[own] / needed[other])
            yield (model, name, f"{error:.1e}", *(tables.number(int(needed[of])) for of in curves),
                   *(tables.number(ratios[other][-1]) for other in others))
        if all(ratios.values()):
            yield (model, name, "median", *("" for _ in curves),
                   *(tables.number(statistics.median(ratios[other])) for other in others))


def model_lines(model, curves, image):
    others = [name for name in curves if not name.startswith("stroll")]
    header = ("model", "measure", "error / diagonal", *curves, *(f"stroll over {name}" for name in others))
    rows = list(ratio_rows(model, curves))
    lines = [f"![Error against triangles, {model}]({image})", ""]
    if rows:
        lines += ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
        lines += ["| " + " | ".join(row) + " |" for row in rows] + [""]
    return lines


def markdown(records, skipped, images):
    """images: folder of the pictures as the document names it."""
    own = {key: record for key, record in records.items() if key[0].startswith("curve ")}
    places = tables.places_of(own, [name for name, _ in own])
    names = tables.machine_names(list(dict.fromkeys(machine for _, machine in places)))
    lines = tables.machine_lines(names)
    lines += [f"`bench/curve.py --data DIR`, {tables.origin_text(places, names)}", ""]
    for model in dict.fromkeys(model for _, model in own):
        lines += model_lines(model, curves_of(own, model), f"{images}/curve_{model}.svg")
    lines += [text for model in skipped for text in (f"Skipped, its data was not there: {model}.", "")]
    return "\n".join(lines).rstrip() + "\n"


def write_csv(path, records):
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for (name, model), record in sorted(records.items(), key=lambda item: (item[0][1], item[0][0])):
            if name.startswith("curve "):
                writer.writerows((model, record["name"], f"{cut['asked']:.4g}", cut["triangles"], f"{cut['rms']:.4g}",
                                  f"{cut['max']:.4g}") for cut in record["cuts"])


def write_results(options, records, text):
    options.images.mkdir(parents=True, exist_ok=True)
    for model in {model for name, model in records if name.startswith("curve ")}:
        picture = curve_plot.draw(f"{model}: whole-model cuts", curves_of(records, model))
        (options.images / f"curve_{model}.svg").write_text(picture, encoding="utf-8")
    write_csv(options.csv, records)
    tables.write_docs(options.docs, text, (BEGIN, END))


def parse_options():
    parser = argparse.ArgumentParser(description="Draws error against triangles of whole-model cuts.")
    build = ROOT / "build"
    parser.add_argument("--data", type=pathlib.Path, required=True, help="folder of models")
    parser.add_argument("--stroll", type=pathlib.Path, default=build / "stroll", help="the program")
    parser.add_argument("--peers", default=str(build / "peer_dag"), help="programs of bench/peer_dag.c, with commas between")
    parser.add_argument("--measurer", type=pathlib.Path, default=build / "surface_distance")
    parser.add_argument("--scratch", type=pathlib.Path, default=build / "bench", help="folder for what is made")
    parser.add_argument("--log", type=pathlib.Path, default=build / "bench" / "curve.jsonl")
    parser.add_argument("--models", default=",".join(MODELS), help="with commas between")
    parser.add_argument("--errors", default=",".join(map(str, ERRORS)), help="claimed ones, of the diagonal, ascending")
    parser.add_argument("--samples", type=int, default=1_000_000, help="on each surface, beside all vertices (1000000)")
    parser.add_argument("--again", action="store_true", help="measure what the log has already")
    parser.add_argument("--write-docs", action="store_true", help="rewrite pictures, CSV and tables from the log")
    parser.add_argument("--docs", type=pathlib.Path, default=ROOT / "docs" / "benchmarks.md")
    parser.add_argument("--images", type=pathlib.Path, default=ROOT / "docs" / "images")
    parser.add_argument("--csv", type=pathlib.Path, default=ROOT / "bench" / "curve.csv")
    options = parser.parse_args()
    options.errors = sorted(float(word) for word in must_show.words_of(options.errors))
    options.peers = [pathlib.Path(word).resolve() for word in must_show.words_of(options.peers)]
    options.keep = False
    for program in (options.stroll, options.measurer, *options.peers):
        if not program.is_file():
            parser.error(f"{program} is no program; peer_dag is built where libmeshoptimizer is installed")
    return options


def main():
    options = parse_options()
    options.scratch.mkdir(parents=True, exist_ok=True)
    curves, skipped, failures = Curves(options), [], 0
    for model in must_show.words_of(options.models):
        try:
            curves.bench.inputs_of(model)
        except measure.Failed as absent:
            print(f"curve: {model} is skipped: {absent}", file=sys.stderr)
            skipped.append(model)
            continue
        try:
            curves.take(model)
        except (measure.Failed, OSError) as failure:
            failures += 1
            print(f"curve: {model}: {failure}", file=sys.stderr)
    records = curves.bench.log.latest()
    text = markdown(records, skipped, "images")
    print(text)
    if options.write_docs:
        write_results(options, records, text)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
