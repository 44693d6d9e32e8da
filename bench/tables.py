"""From the records of must_show.py to the Markdown tables of docs/benchmarks.md."""

BEGIN, END = "<!-- measured: begin -->", "<!-- measured: end -->"


def flat(value):
    """Every number of nested lists and objects, in order."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, (list, tuple)):
        return [number for part in value for number in flat(part)]
    return [value]


def number(value, digits=2):
    if value is None:
        return "?"
    if isinstance(value, bool):
        return "yes" if value else "NO"
    if isinstance(value, int):
        return f"{value:,}"
    return f"{value:,.{digits}f}"


def mebibytes(value):
    return "?" if value is None else f"{value / 2**20:,.0f} MiB"


def table(title, header, rows):
    if not rows:
        return []
    lines = [f"### {title}", "", "| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
    return lines + [""]


def records_of(records, measure):
    return [record for (name, _), record in sorted(records.items()) if name == measure]


def build_rows(records):
    for record in records_of(records, "build"):
        report = record["report"]
        yield (record["model"], number(report["triangles_in"]), number(report["triangles_leaf"]),
               number(report["nodes"]), report["levels"], number(report["root_triangles"]),
               number(record["bytes_per_triangle"]), mebibytes(record["system_peak_rss_bytes"]),
               number(record["seconds"], 1))


def image_rows(records):
    for path in ("orbit", "flythrough"):
        psnr = {record["model"]: record for record in records_of(records, f"psnr_{path}")}
        for record in records_of(records, f"images_{path}"):
            compare, filtered = record["compare"], psnr.get(record["model"], {}).get("compare", {})
            yield (record["model"], path, number(compare.get("coverage_violations")),
                   number(compare.get("depth_within_share"), 5),
                   number(filtered.get("psnr_median_db")), number(filtered.get("psnr_min_db")),
                   number(record["triangles_per_covered_pixel"].get("median")), number(record["max_error_px"]),
                   number(record["holds"]))


def verify_rows(records):
    for record in records_of(records, "verify"):
        report = record["report"]
        yield (record["model"], number(record["holds"]), number(report.get("claimed_over_measured_median")),
               number(report.get("open_edges")), mebibytes(record["system_peak_rss_bytes"]),
               number(record["seconds"], 1))


def rate_rows(records):
    for record in records_of(records, "rate"):
        for name, label, scale in (("one_core", "one core, M triangles/s", 1e-6),
                                   ("two_cores", "two cores, M triangles/s", 1e-6), ("speedup", "two over one", 1)):
            figures = record[name]
            yield (record["model"], label, number(figures["max"] * scale), number(figures["median"] * scale),
                   number(figures["min"] * scale))


def walk_rows(records):
    for record in records_of(records, "walk"):
        for name in ("select_ms", "frame_ms", "triangles", "missing_nodes"):
            figures = record[name]
            yield (record["model"], name, number(float(figures["median"])), number(float(figures["q1"])),
                   number(float(figures["q3"])), number(float(figures["p99"])))


def root_rows(records):
    for record in records_of(records, "root"):
        report = record["report"]
        yield (record["model"], number(report.get("triangles_in")), number(report.get("root_triangles")),
               "built" if record["holds"] else record["said"])


def closing_lines(records):
    lines = []
    for record in records_of(records, "growth"):
        lines.append(f"`frame_ms` from 1 M to 10 M triangles on one path: x {number(record['frame_ms_ratio'])}.")
    for record in records_of(records, "bytes"):
        jobs = ", ".join(str(jobs) for jobs in record["digests"])
        lines.append(f"Same bytes for `--jobs` {jobs} ({record['model']}): {number(record['holds'])}.")
    return lines


def machine_lines(records):
    machines = []
    for record in records.values():
        line = (f"{record['cpu']}, {record['cores']} cores, {record['memory_gib']} GiB, {record['system']}, "
                f"Linux {record['kernel']}, commit {record['commit']}")
        if line not in machines:
            machines.append(line)
    return [f"Machine: {line}." for line in machines]


def markdown(records):
    lines = machine_lines(records) + [""]
    lines += table("Builds", ("model", "triangles in", "leaf triangles", "nodes", "levels", "root triangles",
                              "bytes per triangle", "peak memory", "seconds"), list(build_rows(records)))
    lines += table("Images at one pixel, against the input as read",
                   ("model", "path", "coverage violations", "share of depths within", "PSNR median dB", "PSNR minimum dB",
                    "triangles per covered pixel", "claimed px, largest", "limits hold"), list(image_rows(records)))
    lines += table("verify --against", ("model", "holds", "claimed over measured, median", "open edges", "peak memory",
                                        "seconds"), list(verify_rows(records)))
    lines += table("Build rate, five interleaved pairs", ("model", "figure", "best", "median", "worst"),
                   list(rate_rows(records)))
    lines += table("A walk on one smooth path", ("model", "figure", "median", "lower quartile", "upper quartile", "p99"),
                   list(walk_rows(records)))
    lines += table("Roots", ("file", "triangles in", "root triangles", "outcome"), list(root_rows(records)))
    return "\n".join(lines + closing_lines(records)).rstrip() + "\n"


def write_docs(path, text):
    document = path.read_text(encoding="utf-8")
    if document.count(BEGIN) != 1 or document.count(END) != 1:
        raise SystemExit(f"must_show: {path} lacks the lines {BEGIN} and {END}")
    before, rest = document.split(BEGIN)
    after = rest.split(END)[1]
    path.write_text(f"{before}{BEGIN}\n\n{text}\n{END}{after}", encoding="utf-8")
