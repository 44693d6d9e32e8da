"""From the records of must_show.py to the Markdown tables of docs/benchmarks.md, and to bench/errors.csv.

What a log does not have stays in the document: figures that took hours outlive the folder in which they were measured."""
import csv
import dataclasses
import itertools
import re

BEGIN, END = "<!-- measured: begin -->", "<!-- measured: end -->"
PATHS = ("orbit", "flythrough")
# What a part's records are called where it is not as the part.
MEASURES = {"images": ("images_orbit", "images_flythrough"), "psnr": ("psnr_orbit", "psnr_flythrough"), "roots": ("root",), "models": ("model",),
            "assemblies": ("assembly",)}
MOST_ROOT_TRIANGLES = 16384


def number(value, digits=2):
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "NO"
    if isinstance(value, int):
        return f"{value:,}"
    return f"{value:,.{digits}f}"


def percent(value, digits=3):
    return "-" if value is None else f"{100 * value:.{digits}f} %"


def mebibytes(value):
    return f"{value / 2**20:,.0f} MiB"


def records_of(records, measure):
    return [record for (name, _), record in sorted(records.items()) if name == measure]


def build_rows(records):
    for record in records_of(records, "build"):
        report = record["report"]
        dropped = sum(report["dropped"][kind] for kind in ("nonfinite", "degenerate"))
        yield (record["model"], number(report["triangles_in"]), number(dropped), number(report["nodes"]), report["levels"],
               number(report["root_triangles"]), number(record["bytes_per_triangle"]),
               mebibytes(record["system_peak_rss_bytes"]), number(record["seconds"], 1))


def image_rows(records):
    for path in PATHS:
        for record in records_of(records, f"images_{path}"):
            compare, covered = record["compare"], record["triangles_per_covered_pixel"]
            claim = number(record["max_error_px"])
            if record["unbounded_frames"]:
                claim += f" (eye within a node's box: {record['unbounded_frames']} frames)"
            yield (record["model"], path, compare["frames"], number(compare["uncovered_pixels"]),
                   number(compare["overcovered_pixels"]), percent(compare["depth_within"]), number(covered.get("median")),
                   number(covered.get("max")), claim, number(compare["holds"]))


def psnr_rows(records):
    for path in PATHS:
        for record in records_of(records, f"psnr_{path}"):
            compare = record["compare"]
            yield (record["model"], path, compare["frames"], number(compare["psnr_median_db"]), number(compare["psnr_min_db"]),
                   number(compare["psnr_median_db"] >= compare["least_psnr_db"]))


def verify_rows(records):
    for record in records_of(records, "verify"):
        report = record["report"]
        yield (record["model"], number(record["holds"]), number(report.get("claimed_over_measured_median")),
               number(report.get("claimed_over_measured_least")), f"{report['cracked_cuts']} of {report['cuts']}",
               number(report["open_edges"]), number(report["clustered_nodes"]), mebibytes(record["system_peak_rss_bytes"]),
               number(record["seconds"], 1))


SIZE_LIMITS = {"default": 11, "compact": 4}  # bytes a triangle at most


def size_rows(records):
    for record in records_of(records, "sizes"):
        for name, options in (("default", ""), ("compact", " `--compact`")):
            side, limit = record[name], SIZE_LIMITS[name]
            yield (record["model"] + options, number(side["bytes_per_triangle"]),
                   f"{number(side['bytes_per_triangle'] <= limit)} ({limit:g})", number(side["dropped"]["degenerate"]),
                   f"{side['step']:.3g}", f"{side['quantisation_error']:.3g}", f"{side['measured']:.3g}",
                   number(side["holds"]), f"{side['cracked_cuts']} of {side['cuts']}")


def backend_rows(records):
    for record in records_of(records, "backends"):
        for backend, other in record["others"].items():
            compare = other["compare"]
            yield (record["model"], f"gl45, {backend}", f"{other['same_frames']} of {compare['frames']}",
                   number(compare["uncovered_pixels"] + compare["overcovered_pixels"]), percent(compare["depth_within"]),
                   number(compare["psnr_min_db"]))


def rate_rows(records):
    for record in records_of(records, "rate"):
        for name, label, scale in (("one_core", "one core, M triangles/s", 1e-6),
                                   ("two_cores", "two cores, M triangles/s", 1e-6), ("speedup", "two over one", 1)):
            figures = record[name]
            yield (record["model"], label, figures["count"], number(figures["max"] * scale, 3),
                   number(figures["median"] * scale, 3), number(figures["min"] * scale, 3))


def dependency_rows(records):
    for record in records_of(records, "dependencies"):
        for level, plain in zip(record["with_dependencies"]["levels"], record["without_dependencies"]["levels"]):
            yield (record["model"], level["level"], number(level["nodes"]), number(level["groups"]),
                   percent(level["locked_share"], 2), percent(plain["locked_share"], 2), number(level["boundary_steps"]),
                   number(level["base_triangles"]), number(plain["base_triangles"]))


def drawn_rows(records):
    for record in records_of(records, "dependencies"):
        for path in PATHS:
            sides = [record[f"{side}_dependencies"]["triangles"][path]["median"] for side in ("with", "without")]
            yield (record["model"], path, number(int(sides[0])), number(int(sides[1])), number(sides[1] / max(1, sides[0])))


def walk_rows(records):
    for record in records_of(records, "walk"):
        for name in ("select_ms", "frame_ms", "triangles", "missing_nodes"):
            figures, digits = record[name], 3 if name.endswith("_ms") else 0
            yield (record["model"], name, *(number(float(figures[column]), digits) for column in ("median", "q1", "q3", "p99")))


def share_text(bounds):
    return "-" if bounds is None else f"{bounds[0]:.2g} to {bounds[1]:.2g}"


def theorem_rows(records):
    for record in records_of(records, "theorem"):
        for row in record["rows"]:
            yield (record["model"], row["asked"], number(row["candidates"]),
                   f"{number(row['triangles_median'])}, {number(row['triangles_most'])}", number(row["pairs"]),
                   number(row["hidden"]), share_text(row["hidden_bounds"]), number(row["holds_of_all"]), number(row["premise"]),
                   number(row["broken"]), share_text(row["broken_bounds"]), number(row["holds"]), number(row["failing_cells"]))


def unsampled_rows(records):
    for record in records_of(records, "theorem"):
        row = record["rows"][0]
        yield (record["model"], number(row["pairs"]), percent(row["unsampled"] / row["pairs"]),
               percent(row["above_unsampled"] / row["pairs"]))


def splat_rows(records):
    for record in records_of(records, "splats"):
        for row in record["rows"]:
            if "smooth" not in row:  # of an older commit
                continue
            compare = row["compare"]
            either = max(1, compare["covered_in_either"])
            yield (record["model"], row["path"], row["splat"], compare["frames"], percent(compare["differing_pixels"] / either, 2),
                   percent(compare["visibly_differing_pixels"] / either, 2), number(compare["psnr_median_db"]),
                   number(compare["psnr_min_db"]), number(row["smooth"]["psnr_median_db"]), number(compare["uncovered_pixels"]), number(compare["overcovered_pixels"]),
                   percent(compare["depth_within"], 2), number(int(row["triangles"]["median"])), number(int(row["splats"]["median"])))


def root_rows(records):
    for record in records_of(records, "root"):
        report, root = record["report"], record["report"].get("root_triangles")
        yield (record["model"], number(report.get("triangles_in")), number(root),
               number(root <= MOST_ROOT_TRIANGLES) if record["holds"] else record["said"])


def least_to_most(figures, digits=1):
    least, most = (number(figures[name], digits) for name in ("min", "max"))
    return number(figures["median"], digits) + (f" ({least} to {most})" if figures["count"] > 1 else "")


def rate_of(record, name):
    """Million triangles a second."""
    return record["report"]["triangles_in"] / record[name]["median"] * 1e-6


def scale_rows(records):
    for record in sorted(records_of(records, "scale"), key=lambda record: record["report"]["triangles_in"]):
        triangles = record["report"]["triangles_in"]
        yield (record["model"], number(triangles), least_to_most(record["seconds"]), least_to_most(record["cpu_seconds"]),
               number(rate_of(record, "seconds"), 3), number(rate_of(record, "cpu_seconds"), 3),
               mebibytes(record["system_peak_rss_bytes"]), number(record["system_peak_rss_bytes"] <= record["memory_bytes"]),
               mebibytes(record["scratch_bytes"]), number(record["scratch_bytes"] / triangles, 1),
               number(record["bytes_per_triangle"]))


def shape_limit(model):
    return 2.0 if model.endswith(("_shuffled", "_stl")) else 1.5


def shape_rows(records):
    of = {record["model"]: record for record in records_of(records, "shapes")}
    for model in next(iter(of.values()))["settings"]["models"] if of else ():
        record, base = of.get(model), of.get(next(iter(of.values()))["settings"]["models"][0])
        if not record or not base:
            continue
        ratios = [rate_of(base, name) / rate_of(record, name) for name in ("seconds", "cpu_seconds")]
        yield (model, number(record["report"]["triangles_in"]), least_to_most(record["seconds"]),
               least_to_most(record["cpu_seconds"]), number(rate_of(record, "cpu_seconds"), 3),
               number(ratios[0]), number(ratios[1]), number(max(ratios) <= shape_limit(model)) + f" ({shape_limit(model)})",
               mebibytes(record["system_peak_rss_bytes"]), number(record["scratch_bytes"] / record["report"]["triangles_in"], 1),
               number(record["bytes_per_triangle"]))


def stage_rows(records):
    """Where a build's time goes, and how many cores work in each stage."""
    for record in sorted(records_of(records, "scale"), key=lambda record: record["report"]["triangles_in"]):
        stages = record["report"].get("stages", {})
        whole = sum(stage["cpu_seconds"] for stage in stages.values())
        for name, stage in stages.items():
            yield (record["model"], name, number(stage["seconds"], 2), number(stage["cpu_seconds"], 2),
                   percent(stage["cpu_seconds"] / whole, 1), number(stage["cpu_seconds"] / max(1e-9, stage["seconds"])))


# Of the largest claim of a level over the largest distance measured there.
LEVEL_LIMITS = {"default": {"": 4}, "certified": {"isosurface": 2, "": 3}}


def level_limit(side, model):
    return next(limit for start, limit in LEVEL_LIMITS[side].items() if model.startswith(start))


def claim_rows(records):
    for record in records_of(records, "claims"):
        for side, options in (("default", ""), ("certified", ", `--certify`")):
            figures, limit = record[side], level_limit(side, record["model"])
            worst = max(figures["levels"])
            yield (record["model"] + options, " ".join(number(level) for level in figures["levels"]), number(worst),
                   f"{number(worst <= limit)} ({limit})", number(figures["holds"]), least_to_most(figures["cpu_seconds"]),
                   number(rate_of(figures, "cpu_seconds"), 3),
                   number(figures["cpu_seconds"]["median"] / record["default"]["cpu_seconds"]["median"]))


def decode_rows(records):
    for record in records_of(records, "decode"):
        for side, options in (("default", ""), ("compact", " `--compact`")):
            figures = record[side]
            yield (record["model"] + options, number(figures["bytes_per_triangle"]), number(figures["decode_mtri_per_s"], 1),
                   number(figures["decode_slowest"], 1), number(figures["decode_fastest"], 1),
                   number(figures["decode_mtri_per_s"] >= 20))


def kill_rows(records):
    for record in records_of(records, "kills"):
        yield (record["model"], number(record["triangles"]), record["kills"], record["builds"], record["bytes"],
               number(record["seconds_unstopped"], 1), number(record["most_seconds_lost"], 1))


def cap_rows(records):
    for record in records_of(records, "cap"):
        for row in record["rows"]:
            yield (record["model"], row["memory"], mebibytes(row["data_limit_bytes"]), mebibytes(row["address_limit_bytes"]),
                   "yes" if row["holds"] else row["said"], mebibytes(row["system_peak_rss_bytes"]) if row["holds"] else "NO",
                   number(row["seconds"], 1) if row["holds"] else "NO", number(record["quarter_status"] != 0))


def cold_rows(records):
    for record in records_of(records, "walk_cold"):
        for state in ("cold", "warm"):
            walk = record[state]
            yield (record["model"], state, walk["frame_ms"]["count"], number(walk["frame_ms"]["median"], 1),
                   number(walk["frame_ms"]["p99"], 1), number(walk["select_ms"]["median"], 3),
                   number(walk["select_ms"]["p99"], 3), number(int(walk["triangles"]["median"])),
                   number(int(walk["missing_nodes"]["p99"])), mebibytes(walk["resident_bytes"]["max"]),
                   mebibytes(walk["gpu_bytes"]["max"]), walk["frames_over_budget"], walk["frames_waiting_for_disk"],
                   mebibytes(walk["disk_read_bytes"]), mebibytes(walk["system_peak_rss_bytes"]))


def model_rows(records):
    for record in records_of(records, "model"):
        report, compare, filtered = record["report"], record["compare"], record["filtered"]
        dropped = sum(report["dropped"][kind] for kind in ("nonfinite", "degenerate"))
        yield (record["model"], number(report["triangles_in"]), number(dropped), number(report["root_triangles"]),
               number(report["bytes_out"] / max(1, report["triangles_in"])), mebibytes(record["system_peak_rss_bytes"]),
               number(report["triangles_in"] / record["cpu_seconds"] * 1e-6, 3),
               number(record["holds"]) if record["holds"] else record["said"],
               f"{record['verified']['cracked_cuts']} of {record['verified']['cuts']}", number(int(record["drawn"]["triangles"]["median"])),
               number(int(record["drawn"]["draws"]["median"])), number(compare["uncovered_pixels"] + compare["overcovered_pixels"]),
               percent(compare["depth_within"]), number(filtered["psnr_median_db"]), number(filtered["psnr_min_db"]))


ASSEMBLY_LIMIT = 1.5


def assembly_rows(records):
    """Each figure and how many times the first model's it is."""
    rows = records_of(records, "assembly")
    names = rows[0]["settings"]["models"] if rows else ()
    of = {record["model"]: record for record in rows}
    for model in names if names and names[0] in of else ():
        record, base = of.get(model), of[names[0]]
        if not record:
            continue
        triangles, base_triangles = (one["report"]["triangles_in"] for one in (record, base))
        ratios = (rate_of(base, "cpu_seconds") / rate_of(record, "cpu_seconds"),
                  record["bytes_per_triangle"] / base["bytes_per_triangle"],
                  record["system_peak_rss_bytes"] / base["system_peak_rss_bytes"])
        yield (model, number(triangles), number(record["report"]["parts"]), number(record["report"]["root_triangles"]),
               number(record["report"]["root_triangles"] <= MOST_ROOT_TRIANGLES), number(rate_of(record, "cpu_seconds"), 3),
               number(record["bytes_per_triangle"]), mebibytes(record["system_peak_rss_bytes"]),
               *(f"x {number(ratio)}" for ratio in ratios), number(max(ratios) <= ASSEMBLY_LIMIT),
               number(int(record["drawn"]["triangles"]["median"])), number(int(record["drawn"]["draws"]["median"])))


# ---- sample trees and placements

SAMPLED_RATE, SAMPLED_BYTES, OVER_MORTON, CHESSBOARD_GROWTH = 1, 16, 1.1, 1.3


def sampled_rows(records):
    for record in sorted(records_of(records, "sampled"), key=lambda record: record["report"]["triangles_in"]):
        over = record["morton"] and record["morton"]["over"]
        yield (record["model"], number(record["report"]["triangles_in"]), least_to_most(record["seconds"]),
               least_to_most(record["cpu_seconds"]), number(rate_of(record, "cpu_seconds")),
               number(rate_of(record, "cpu_seconds") >= SAMPLED_RATE), mebibytes(record["system_peak_rss_bytes"]),
               number(record["system_peak_rss_bytes"] <= record["memory_bytes"]), number(record["bytes_per_triangle"]),
               number(record["bytes_per_triangle"] <= SAMPLED_BYTES),
               f"x {number(over)}" if over else "not measured", number(over <= OVER_MORTON) if over else "not measured")


def chessboard_rows(records):
    rows = sorted(records_of(records, "chessboard"), key=lambda record: record["settings"]["models"].index(record["model"]))
    for record in rows:
        for splat, columns in record["splats"].items():
            yield (record["model"], splat, number(columns["frame_ms"]["median"], 1), number(columns["frame_ms"]["p99"], 1),
                   number(columns["select_ms"]["median"]), *(number(int(columns[name]["median"])) for name in ("triangles", "splats", "draws")),
                   f"x {number(columns['frame_ms']['median'] / rows[0]['splats'][splat]['frame_ms']['median'])}")


def chessboard_lines(records):
    of = {record["model"]: record["splats"] for record in records_of(records, "chessboard")}
    if of:
        names = next(iter(of.values()))
        for first, last in itertools.product(("chessboard_8m",), ("chessboard_32m", "chessboard_320m")):
            if first not in of or last not in of:
                continue
            growth = {splat: of[last][splat]["frame_ms"]["median"] / of[first][splat]["frame_ms"]["median"] for splat in names}
            yield (f"Time of a frame from {first} to {last}: " + ", ".join(f"x {number(ratio)} at splats of {splat}" for splat, ratio in growth.items())
                   + f" (asked: less than {CHESSBOARD_GROWTH}).")


def large_rows(records):
    for record in sorted(records_of(records, "large"), key=lambda record: (record["placed"], record["model"])):
        for row in record.get("rows", ()):  # an older commit wrote none
            yield (record["model"], number(record["stored"]), number(record["placed"]), number(record["placements"]),
                   mebibytes(record["bytes"]), row["splat"], number(row["frame_ms"]["median"], 1), number(row["frame_ms"]["p99"], 1),
                   number(row["select_ms"]["median"]), *(number(int(row[name]["median"])) for name in ("triangles", "splats", "draws")),
                   number(row["requests_a_frame"], 1), number(int(row["missing_nodes"]["p99"])))


STRUCTURES = ("clusters", "samples")
FRAME_TIME_LIMIT = 1.1


def link_rows(records):
    for record in records_of(records, "remote"):
        for structure in STRUCTURES:
            local = record[structure][0]
            for row in record[structure]:
                over = row["frame_ms"]["p99"] / local["frame_ms"]["p99"]
                yield (f"{record['model']} {structure}", "the file" if row is local else "{:g} Mbit/s, {:g} ms".format(*row["link"]),
                       least_to_most(row["first_s"], 2),
                       percent(row["first_covers"]["min"], 1) if "first_covers" in row else "not drawn", number(row["final_bytes"]["median"] / 2**20, 2), least_to_most(row["final_s"], 2),
                       number(row["same"]), number(row["walk_frames"], 0), number(row["missing_frames"], 0),
                       number(row["select_ms"]["median"], 2), number(row["frame_ms"]["median"], 2), number(row["frame_ms"]["p99"], 2),
                       f"x {number(over)}", "the base" if row is local else number(over <= FRAME_TIME_LIMIT))


FAULT_WORDS = {"none": "nothing happens", "killed": "killed, started again", "500": "answers 500", "cut": "truncates", "stall": "stalls",
               "wrong": "sends wrong bytes", "swapped": "has another file"}


def fault_rows(records):
    for record in records_of(records, "remote_faults"):
        for structure in STRUCTURES:
            for row in record[structure]:
                yield (f"{record['model']} {structure}", FAULT_WORDS[row["fault"]], number(row["lasted_s"], 1), row["frames"],
                       row["missing_frames"], percent(row["covered_least"], 1), number(row["frame_gap_s"], 2),
                       number(row["healed_s"], 1) if row["healed"] else "not", number(row["same"]), row["said"] or "nothing")


CLIENT_WORDS = {"replayed": "a walk's requests, one connection each", "programs": "`stroll render`, settled"}


def client_rows(records):
    for record in records_of(records, "remote_clients"):
        for structure in STRUCTURES:
            for name, words in CLIENT_WORDS.items():
                row = record[structure][name]
                yield (f"{record['model']} {structure}", words, row["clients"], row["served"], number(row["seconds"], 1),
                       number(row["requests"]), row["refused"], mebibytes(row["bytes"]), number(row["request_ms"]["median"], 1),
                       number(row["request_ms"]["p99"], 1), number(row["request_ms"]["max"], 1), mebibytes(row["peak_bytes"]))


def scale_lines(records):
    """How much the largest model costs more than the smallest, and its walk than the smaller one's."""
    sizes = sorted(records_of(records, "scale"), key=lambda record: record["report"]["triangles_in"])
    if len(sizes) > 1:
        growth = rate_of(sizes[0], "cpu_seconds") / rate_of(sizes[-1], "cpu_seconds")
        yield f"CPU time a triangle from {sizes[0]['model']} to {sizes[-1]['model']}: x {number(growth)} (asked: less than 1.5)."
    for record in records_of(records, "walk_cold"):
        first = records.get(("walk_cold", record["settings"]["models"][0]))
        if first and record["model"] == record["settings"]["models"][-1] != first["model"]:
            ratios = ", ".join(f"{name} x {number(record[state][name]['median'] / max(1e-9, first[state][name]['median']))} {state}"
                               for state in ("cold", "warm") for name in ("frame_ms", "triangles"))
            yield f"Frame work from {first['model']} to {record['model']} on one path: {ratios} (asked: at most 1.5)."


def growth_lines(records):
    for record in records_of(records, "walk"):
        first, last = record["settings"]["models"][0], record["settings"]["models"][-1]
        if record["model"] == last and first != last and ("walk", first) in records:
            ratio = record["frame_ms"]["median"] / records["walk", first]["frame_ms"]["median"]
            yield f"`frame_ms` from {first} to {last} on one path: x {number(ratio)}."


def closing_lines(records):
    lines = [*growth_lines(records), *scale_lines(records), *chessboard_lines(records)]
    for record in records_of(records, "bytes"):
        jobs = ", ".join(str(jobs) for jobs in record["digests"])
        lines.append(f"Same bytes for `--jobs` {jobs} ({record['model']}, `--parts bytes`, commit {record['commit']}): "
                     f"{number(record['holds'])}.")
    return lines


def machine_of(record):
    return (f"{record['cpu']}, {record['cores']} cores, {record['memory_gib']} GiB, {record['system']}, "
            f"Linux {record['kernel']}")


@dataclasses.dataclass
class Table:
    part: str
    header: list
    rows: list      # of lists of texts; the first of each is a model
    places: dict    # (commit, machine) -> the models whose figures are from there


@dataclasses.dataclass
class Document:
    tables: dict    # by title
    closing: list   # lines

    def machines(self):
        return list(dict.fromkeys(machine for table in self.tables.values() for _, machine in table.places))


def places_of(records, names):
    """(commit, machine) -> models, of the measures with these names."""
    places = {}
    for (name, model), record in sorted(records.items()):
        if name in names:
            models = places.setdefault((record["commit"], machine_of(record)), [])
            models += [model] if model not in models else []
    return places


def document_of(records):
    """records: as Log.latest gives them, by (measure, model)."""
    tables = {}
    for part, title, header, rows_of in TABLES:
        rows = [[str(cell) for cell in row] for row in rows_of(records)]
        if rows:
            tables[title] = Table(part, list(header), rows, places_of(records, MEASURES.get(part, (part,))))
    return Document(tables, closing_lines(records))


# ---- Markdown

def origin_text(places, names):
    """Of which commit the figures are, and of which machine: "commit a", or "commits a (model, model), b (model)"."""
    texts = {(commit + (f" on {names[machine]}" if names[machine] else "")): models for (commit, machine), models in places.items()}
    if len(texts) == 1:
        return f"commit {next(iter(texts))}"
    return "commits " + ", ".join(f"{place} ({', '.join(models)})" for place, models in texts.items())


def table_lines(title, table, names):
    """The command stands with its table: whoever doubts a figure can take it again."""
    lines = [f"### {title}", "", f"`bench/must_show.py --data DIR --parts {table.part}`, {origin_text(table.places, names)}", "",
             "| " + " | ".join(table.header) + " |", "|" + "---|" * len(table.header)]
    return lines + ["| " + " | ".join(row) + " |" for row in table.rows] + [""]


def machine_names(machines):
    """Where there is but one, it needs none."""
    return {machine: f"machine {number}" if len(machines) > 1 else "" for number, machine in enumerate(machines, 1)}


def machine_lines(names):
    return [text for machine, name in names.items() for text in (f"{name.capitalize() or 'Machine'}: {machine}.", "")]


def text_of(document):
    names = machine_names(document.machines())
    lines = machine_lines(names)
    for title, table in document.tables.items():
        lines += table_lines(title, table, names)
    return "\n".join(lines + [text for line in document.closing for text in (line, "")]).rstrip() + "\n"


def markdown(records):
    return text_of(document_of(records))


def parsed_places(origin, models, machines):
    """The inverse of origin_text; machines: by name."""
    places = {}
    for commit, machine, names in re.findall(r"([^\s,(]+)(?: on (machine \d+))?(?: \(([^)]*)\))?(?:, |$)", origin):
        places[(commit, machines[machine])] = names.split(", ") if names else models
    return places


def parsed(text):
    """The inverse of text_of."""
    machines = {name.lower() if name != "Machine" else "": machine
                for name, machine in re.findall(r"^(Machine(?: \d+)?): (.*)\.$", text, re.MULTILINE)}
    document = Document({}, [])
    for section in re.split(r"^### ", text, flags=re.MULTILINE)[1:]:
        lines = section.splitlines()
        title, (part, origin) = lines[0], re.search(r"--parts (\w+)`, commits? (.*)", section).groups()
        cells = [line[2:-2].split(" | ") for line in lines if line.startswith("| ")]
        models = list(dict.fromkeys(row[0] for row in cells[1:]))
        document.tables[title] = Table(part, cells[0], cells[1:], parsed_places(origin, models, machines))
        last = max(number for number, line in enumerate(lines) if line.startswith("|"))
        document.closing += [line for line in lines[last + 1:] if line]
    return document


def merged_table(old, new):
    """Models that were not measured again keep their rows."""
    again = {row[0] for row in new.rows}
    kept = [row for row in old.rows if row[0] not in again] if old.header == new.header else []
    places = {place: [model for model in models if model in {row[0] for row in kept}] for place, models in old.places.items()}
    for place, models in new.places.items():
        places[place] = places.get(place, []) + models
    return Table(new.part, new.header, kept + new.rows, {place: models for place, models in places.items() if models})


def merged(old, new):
    tables = {}
    titles = [title for _, title, *_ in TABLES]
    for title in titles + [title for title in old.tables if title not in titles]:
        before, now = old.tables.get(title), new.tables.get(title)
        if before or now:
            tables[title] = merged_table(before, now) if before and now else before or now
    subjects = {re.split(r"[:(]", line)[0] for line in new.closing}
    return Document(tables, [line for line in old.closing if re.split(r"[:(]", line)[0] not in subjects] + new.closing)


TABLES = (
    ("build", "Builds", ("model", "triangles in", "dropped", "nodes", "levels", "root triangles", "bytes per triangle",
                         "peak memory", "seconds"), build_rows),
    ("images", "Images at one pixel, against the input as read",
     ("model", "path", "frames", "uncovered", "overcovered", "depth within", "triangles per covered pixel, median", "most",
      "claimed px, largest", "limits hold"), image_rows),
    ("psnr", "PSNR at one pixel, `--supersample 4`", ("model", "path", "frames", "median dB", "least dB", "30 dB"), psnr_rows),
    ("verify", "verify --against", ("model", "holds", "claimed over measured, median", "least", "cracked cuts", "open edges",
                                    "nodes by clustering", "peak memory", "seconds"), verify_rows),
    ("sizes", "Bytes a triangle, all levels, positions and normals",
     ("model", "bytes a triangle", "within (limit)", "without area on the lattice", "lattice step", "moves a point by at most",
      "finest cut, measured", "verify holds", "cracked cuts"), size_rows),
    ("backends", "One picture from every renderer", ("model", "renderers", "frames of the same bytes", "coverage violations",
                                                     "depth within", "PSNR least dB"), backend_rows),
    ("rate", "Build rate, interleaved pairs", ("model", "figure", "pairs", "best", "median", "worst"), rate_rows),
    ("dependencies", "Dependencies: each level with and without",
     ("model", "level", "nodes", "groups", "locked with", "locked without", "boundary steps", "base triangles with",
      "base triangles without"), dependency_rows),
    ("dependencies", "Dependencies: triangles drawn at one pixel, median of the path",
     ("model", "path", "with", "without", "without over with"), drawn_rows),
    ("walk", "A walk on one smooth path", ("model", "figure", "median", "lower quartile", "upper quartile", "p99"), walk_rows),
    ("scale", "Builds of ever larger models, `--memory 1G`",
     ("model", "triangles in", "seconds (least to most)", "CPU seconds", "M triangles/s", "M triangles per CPU second",
      "peak memory", "within 1 GiB", "peak scratch", "scratch bytes per triangle", "bytes per triangle"), scale_rows),
    ("shapes", "Builds of other kinds of models, `--memory 1G`",
     ("model", "triangles in", "seconds (least to most)", "CPU seconds", "M triangles per CPU second",
      "time a triangle over the first model's", "CPU time a triangle over it", "within (limit)", "peak memory",
      "scratch bytes per triangle", "bytes per triangle"), shape_rows),
    ("scale", "Where the time of a build goes",
     ("model", "stage", "seconds", "CPU seconds", "share of CPU time", "cores at work"), stage_rows),
    ("claims", "Claimed over measured, by level",
     ("model", "levels 0, 1, ...", "worst", "within (limit)", "verify holds", "CPU seconds (least to most)",
      "M triangles per CPU second", "over the default's"), claim_rows),
    ("decode", "Decoding, one thread", ("model", "bytes per triangle", "M triangles/s, median", "least", "most",
                                        "at least 20"), decode_rows),
    ("kills", "Killed at random moments and resumed", ("model", "triangles", "kills", "builds", "bytes of the container",
                                                       "seconds, not stopped", "most seconds lost"), kill_rows),
    ("cap", "Builds under the system's own limit",
     ("model", "`--memory`", "RLIMIT_DATA", "RLIMIT_AS", "built", "peak memory", "seconds",
      "a quarter of the memory ends it"), cap_rows),
    ("walk_cold", "A walk under `--memory 600M`, cold and warm",
     ("model", "file", "frames", "frame_ms, median", "p99", "select_ms, median", "p99", "triangles, median",
      "missing nodes, p99", "resident, most", "GPU, most", "frames over a budget", "frames that waited for the disk",
      "read from disk", "peak memory"), cold_rows),
    ("models", "Every model: built, verified, and an orbit at one pixel against the input",
     ("model", "triangles in", "dropped", "root triangles", "bytes per triangle", "peak memory", "M triangles per CPU second",
      "verify holds", "cracked cuts", "triangles a frame", "draws a frame", "coverage violations", "depth within",
      "PSNR, 4 x 4 samples, median dB", "least dB"), model_rows),
    ("assemblies", "Models of many parts",
     ("model", "triangles in", "parts", "root triangles", f"at most {MOST_ROOT_TRIANGLES:,}", "M triangles per CPU second",
      "bytes per triangle", "peak memory", "CPU time a triangle", "bytes", "memory", f"all within {ASSEMBLY_LIMIT}",
      "triangles a frame", "draws a frame"), assembly_rows),
    ("sampled", "Builds of sample trees, `--structure samples --memory 1G`",
     ("model", "triangles in", "seconds (least to most)", "CPU seconds", "M triangles per CPU second", f"at least {SAMPLED_RATE}",
      "peak memory", "within 1 GiB", "bytes per triangle", f"at most {SAMPLED_BYTES}", "over Morton order", f"at most {OVER_MORTON}"), sampled_rows),
    ("chessboard", "The chessboard: time of a frame against size",
     ("model", "splats, px", "frame_ms, median", "p99", "select_ms, median", "triangles", "splats", "draws", "over the smallest"), chessboard_rows),
    ("large", "Walks through large scenes",
     ("model and structure", "triangles stored", "triangles placed", "placements", "container", "splats, px", "frame_ms, median", "p99", "select_ms, median",
      "triangles", "splats", "draws", "pages read a frame", "missing nodes, p99"), large_rows),
    ("theorem", "Sample trees: cells of which no visible triangle is drawn",
     ("model", "p", "cells that can fail", "triangles of one, median, most", "pairs of cell and eye", "fail", "share, 95 %",
      "not above 1 - p", "pairs of the premise", "of these fail", "share, 95 %", "not above 1 - p", "cells that ever fail"),
     theorem_rows),
    ("theorem", "Sample trees: pairs without a drawn triangle in 16 x 16 samples",
     ("model", "pairs of cell and eye", "drawn: the cell's and what is above it", "drawn: what is above it"), unsampled_rows),
    ("splats", "Sample trees with splats, against the input as read",
     ("model", "path", "splat px", "frames", "pixels that differ", "by more than 16 of 255", "PSNR median dB", "least dB",
      "median dB, 4 x 4 samples", "uncovered", "overcovered", "depth within", "triangles a frame", "splats a frame"), splat_rows),
    ("remote", "Walks over links",
     ("model", "link", "first image, s", "it covers, least, of the final one's pixels", "MiB until the final image", "final image, s",
      "final image as of the file", "frames of the walk", "with missing nodes", "select_ms, median", "frame_ms, median", "p99", "over the file's", "at most 10 % more"), link_rows),
    ("remote_faults", "Faults of the server under a walk",
     ("model", "the server", "for, s", "frames until whole", "with missing nodes", "pixels covered, least, of the final front's",
      "longest from frame to frame, s", "whole again after, s", "last image as of the file", "said"), fault_rows),
    ("remote_clients", "Clients of `stroll serve` at once",
     ("model", "a client is", "clients", "served", "seconds", "requests", "refused", "bytes", "ms of a request, median", "p99", "most",
      "server's peak memory"), client_rows),
    ("roots", "Roots", ("file", "triangles in", "root triangles", f"at most {MOST_ROOT_TRIANGLES:,}"), root_rows),
)


ERROR_COLUMNS = ("model", "side", "level", "claimed_over_measured")


def write_errors(path, records):
    """One row a level: what no clock changes of part claims. Models that were not measured again keep their rows."""
    rows = [[record["model"], side, str(level), f"{ratio:.4g}"] for record in records_of(records, "claims")
            for side in ("default", "certified") for level, ratio in enumerate(record[side]["levels"])]
    again, kept = {row[0] for row in rows}, []
    if path.exists():
        with open(path, newline="", encoding="utf-8") as file:
            kept = [row for row in list(csv.reader(file))[1:] if row[0] not in again]
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(ERROR_COLUMNS)
        writer.writerows(sorted(kept + rows, key=lambda row: row[0]))


def split_document(path, marks):
    """What stands before, between and after the marks."""
    document = path.read_text(encoding="utf-8")
    if [document.count(mark) for mark in marks] != [1, 1]:
        raise SystemExit(f"{path} lacks the lines {marks[0]} and {marks[1]}")
    before, rest = document.split(marks[0])
    return (before, *rest.split(marks[1]))


def write_docs(path, text, marks=(BEGIN, END)):
    before, _, after = split_document(path, marks)
    path.write_text(f"{before}{marks[0]}\n\n{text}\n{marks[1]}{after}", encoding="utf-8")


def merge_docs(path, records):
    """Writes the figures of the records over those that stand in the document."""
    _, old, _ = split_document(path, (BEGIN, END))
    write_docs(path, text_of(merged(parsed(old), document_of(records))))
