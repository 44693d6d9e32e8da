#!/usr/bin/env python3
"""bench/must_show.py measures every part on a small model, keeps what it has, and its tables lack no figure.

usage: test_must_show.py PROGRAM. Nothing here depends on how fast anything is."""
import json
import os
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(os.environ.get("STRL_TEST_ROOT", pathlib.Path(__file__).resolve().parents[2]))
sys.path[:0] = [str(ROOT / "bench"), str(ROOT / "tests" / "support")]
sys.dont_write_bytecode = True
import measure
import must_show
import sample_parts
import sanitized
import sheets
import tables

MODELS = ("isosurface_3k", "isosurface_6k")
ONE_EACH = ("build", "images_orbit", "images_flythrough", "psnr_orbit", "psnr_flythrough", "verify", "backends",
            "rate", "bytes", "sizes", "dependencies", "walk", "scale", "shapes", "cap", "walk_cold", "claims", "decode", "kills",
            "model", "assembly", "sampled", "chessboard", "theorem", "splats")
REMOTE = ("remote", "remote_faults", "remote_clients")  # run on one model, see test_remote


class Test:
    def __init__(self, program, folder):
        self.program, self.folder, self.failures = program, folder, 0
        self.data, self.log, self.docs, self.counts, self.errors = (
            folder / name for name in ("data", "log.jsonl", "docs.md", "counts.csv", "errors.csv"))
        self.data.mkdir()
        self.docs.write_text(f"before\n{tables.BEGIN}\nSTALE\n{tables.END}\nafter\n")
        self.counts.write_text("model,triangles,seed,triangles_in,triangles_leaf,nodes,levels,root_triangles,"
                               "bytes_out\n")

    def check(self, claim, holds, detail=""):
        print("%s %s" % ("ok  " if holds else "FAIL", claim))
        if not holds:
            self.failures += 1
            print("     " + str(detail))

    def must_show(self, *words, models=MODELS):
        command = [sys.executable, "-B", ROOT / "bench" / "must_show.py", "--data", self.data, "--stroll", self.program,
                   "--scratch", self.folder / "scratch", "--log", self.log, "--docs", self.docs,
                   "--counts", self.counts, "--errors", self.errors, "--kills", 2, "--clients", 8, "--models", ",".join(models), "--frames", 2,
                   "--size", "160x90", "--pairs", 1, "--runs", 1, "--theorem-pairs", 2000, *words]
        return subprocess.run([str(word) for word in command], capture_output=True, text=True)

    def test_parts(self):
        subprocess.run([self.program, "scene", "plain-plane", "--triangles", "2K", "-o", self.data / "plane.ply",
                        "--quiet"], check=True)
        parts = [part for part in must_show.PARTS if part not in REMOTE]
        result = self.must_show("--write-docs", "--psnr-frames", 1, "--parts", ",".join(parts))
        self.check("every part is measured", result.returncode == 0, result.stderr)
        records = measure.Log(self.log, {}).latest()
        wanted = {(name, model) for name in ONE_EACH for model in MODELS}
        wanted |= {("root", "plane"), *(("large", model) for model in MODELS)}
        self.check("each record is there", set(records) == wanted, set(records) ^ wanted)
        said = {record["settings"].get("frames") for (name, _), record in records.items() if name.startswith("psnr")}
        self.check("the frames of a part stand in its record", said == {1}, said)

    def test_scale(self):
        """What the parts about large models measure, on small ones."""
        models = ("isosurface_3k", "boxes_2k_shuffled_stl")
        result = self.must_show("--parts", "shapes", models=models)
        records = measure.Log(self.log, {}).latest()
        boxes, base = (records.get(("shapes", model)) for model in reversed(models))
        self.check("a shuffled STL scene is a model", result.returncode == 0 and boxes and
                   boxes["report"]["triangles_leaf"] == 1992 and boxes["report"]["parts"] == 1, result.stderr)
        self.check("scenes are not left behind", not list((self.folder / "scratch").glob("*_shuffled_stl.stl")) and
                   not (self.folder / "scratch" / "isosurface_3k.ply").exists())
        self.check("times and memory are the system's", base["cpu_seconds"]["median"] > 0 and
                   base["system_peak_rss_bytes"] > 2**20 and base["scratch_bytes"] > 10000, base)
        cap = records["cap", MODELS[0]]
        self.check("a build keeps to the system's limit, and the limit bites", cap["quarter_status"] != 0 and
                   [row["memory"] for row in cap["rows"] if row["holds"]] == ["64M", "1G"], cap)
        for state in ("cold", "warm"):
            walk = records["walk_cold", MODELS[1]][state]
            self.check(f"a {state} walk keeps to its budgets", walk["frames_over_budget"] == 0 and walk["faults"] == 0 and
                       walk["frame_ms"]["count"] == 10 and walk["resident_bytes"]["max"] > 0, walk)
        text = self.docs.read_text()
        self.check("growth stands under the tables", f"from {MODELS[0]} to {MODELS[1]}: x " in text and
                   f"Frame work from {MODELS[0]} to {MODELS[1]} on one path" in text, text[-1500:])

    def test_samples(self):
        def near(bounds, low, high):
            return abs(bounds[0] - low) < 1e-5 and abs(bounds[1] - high) < 1e-5
        bounds = [sample_parts.share_bounds(*pair) for pair in ((0, 100), (5, 100), (100, 100), (0, 0))]
        self.check("intervals are those of Clopper and Pearson", near(bounds[0], 0, 0.036217) and
                   near(bounds[1], 0.016432, 0.112835) and near(bounds[2], 0.963783, 1) and bounds[3] is None, bounds)
        records = measure.Log(self.log, {}).latest()
        for model in MODELS:
            rows = records["theorem", model]["rows"]
            self.check(f"each triangle of {model} has its cell, and no premise is broken", all(row["lost"] == 0 for row in rows) and
                       rows[0]["pairs"] == 2000 and rows[0]["premise"] > 1000 and rows[0]["broken"] == 0 and rows[0]["holds"], rows[0])
            sizes = {(row["path"], row["splat"]) for row in records["splats", model]["rows"]}
            self.check("splats of three sizes are compared on three paths", len(sizes) == 9, sizes)
    def test_remote(self):
        """Of a model and a walk that are large enough for the network to be in the way."""
        model = "isosurface_60k"
        result = self.must_show("--write-docs", "--parts", ",".join(REMOTE), "--frames", 4, "--size", "640x360", models=(model,))
        records = measure.Log(self.log, {}).latest()
        self.check("the parts about addresses are measured", result.returncode == 0, result.stderr)
        for structure in ("clusters", "samples"):
            links = records["remote", model][structure]
            self.check(f"{structure}: images over every link are the file's", [row["same"] for row in links] == [True] * 7, links)
            by_link = {tuple(row["link"] or ()): row for row in links}
            self.check(f"{structure}: a link takes its time, and no bytes fail", not any(row["failures"] + row["faults"] for row in links)
                       and by_link[5, 80]["final_s"]["min"] > 0.24 and by_link[5, 80]["final_bytes"]["min"] > 10**5, by_link[5, 80])
            faults = {row["fault"]: row for row in records["remote_faults", model][structure]}
            self.check(f"{structure}: each fault has happened", len(faults) == 7 and all(row["lasted_s"] >= 0 for row in faults.values()) and
                       faults["none"]["faults"] == 0 and faults["none"]["said"] == "", faults)
            for name, row in records["remote_clients", model][structure].items():
                self.check(f"{structure}: all clients are served ({name})", row["served"] == row["clients"] == 8 and
                           row["refused"] == 0 and row["request_ms"]["count"] == row["requests"] > 8 and row["bytes"] > 8 * 10**5 and
                           row["peak_bytes"] > 2**20, row)

    def test_tables(self):
        text = self.docs.read_text()
        parts = text.split("### ")[1:]
        self.check("the tables replace the old ones", text.startswith("before\n") and text.endswith("\nafter\n") and
                   "STALE" not in text, text)
        self.check("each table is there", len(parts) == len(tables.TABLES),
                   [part.split("\n")[0] for part in parts])
        for part in parts:
            title, rows = part.split("\n")[0], [line for line in part.split("\n") if line.startswith("| ")]
            cells = [cell.strip() for row in rows for cell in row.strip("|").split("|")]
            self.check(f"no figure of \"{title}\" is missing", len(rows) > 1 and "-" not in cells and "" not in cells,
                       rows)
        levels = self.errors.read_text().splitlines()
        self.check("errors of all levels are written", levels[0].endswith(",claimed_over_measured") and
                   all(float(line.split(",")[3]) >= 1 for line in levels[1:]) and
                   sum(line.startswith(MODELS[1] + ",certified,") for line in levels) >= 2, levels)
        counted = [line.split(",")[0] for line in self.counts.read_text().splitlines()[1:]]
        self.check("counts are written", counted == ["isosurface", "isosurface", "plane"], counted)

    def test_origins(self):
        """One line a machine; a table says of which commit it is, and of which models where they differ."""
        def record(model, commit, cores):
            report = {"dropped": {"nonfinite": 0, "degenerate": 0}, "triangles_in": 1, "nodes": 1, "levels": 1,
                      "root_triangles": 1}
            return {"model": model, "commit": commit, "cpu": "CPU", "cores": cores, "memory_gib": 1, "system": "S",
                    "kernel": "K", "report": report, "bytes_per_triangle": 1, "system_peak_rss_bytes": 1,
                    "seconds": 1, "holds": True, "said": ""}

        records = {("build", "a"): record("a", "c1", 2), ("build", "b"): record("b", "c2", 2),
                   ("build", "c"): record("c", "c1", 2), ("root", "a"): record("a", "c1", 2)}
        text = tables.markdown(records)
        self.check("one machine stands once", text.count("Machine") == 1 and
                   text.startswith("Machine: CPU, 2 cores, "), text)
        self.check("a table names its commits with their models",
                   "--parts build`, commits c1 (a, c), c2 (b)\n" in text, text)
        self.check("and one commit alone", "--parts roots`, commit c1\n" in text, text)
        text = tables.markdown({**records, ("root", "b"): record("b", "c1", 4)})
        self.check("two machines get names", "Machine 1: CPU, 2 cores" in text and "Machine 2: CPU, 4 cores" in text and
                   "--parts roots`, commits c1 on machine 1 (a), c1 on machine 2 (b)\n" in text, text)

        self.docs.write_text(f"before\n{tables.BEGIN}\n\n{tables.markdown(records)}\n{tables.END}\nafter\n")
        tables.merge_docs(self.docs, {("build", "b"): record("b", "c3", 4), ("build", "d"): record("d", "c3", 4)})
        text = self.docs.read_text()
        self.check("what is not measured again stays", "Machine 1: CPU, 2 cores" in text and "Machine 2: CPU, 4 cores" in text and
                   "--parts build`, commits c1 on machine 1 (a, c), c3 on machine 2 (b, d)\n" in text and
                   "--parts roots`, commit c1 on machine 1\n" in text and
                   [line[2] for line in text.splitlines() if line.startswith("| ")] == list("macbd") + list("fa"), text)

    def test_sheet(self):
        rows = sheets.read_png(self.folder / "scratch" / "sheets" / f"{MODELS[0]}_orbit.png")
        width = len(rows[0]) // 9  # three pictures of three bytes a pixel
        left, middle, right = (b"".join(bytes(row[3 * width * i:3 * width * (i + 1)]) for row in rows)
                               for i in range(3))
        self.check("a sheet shows reference, ours and their difference", len(set(left)) > 20 and
                   all(c == min(255, sheets.GAIN * abs(a - b)) for a, b, c in zip(left, middle, right)), len(rows))

    def test_png(self):
        picture = [bytearray((x * y * 7 + x * c) % 256 for x in range(9) for c in range(3)) for y in range(5)]
        sheets.write_png(self.folder / "a.png", picture)
        self.check("a picture comes back", sheets.read_png(self.folder / "a.png") == picture)

    def test_resume(self):
        lines = len(self.log.read_text().splitlines())
        result = self.must_show("--parts", "build,images,verify")
        self.check("what is there is kept", result.returncode == 0 and result.stdout.count(": kept") == 8 and
                   len(self.log.read_text().splitlines()) == lines, result.stdout)
        result = self.must_show("--parts", "build", "--again", models=MODELS[:1])
        self.check("--again measures anew", result.returncode == 0 and
                   len(self.log.read_text().splitlines()) == lines + 1, result.stderr)
        old = [json.loads(line) for line in self.log.read_text().splitlines()]
        self.log.write_text("".join(json.dumps({**record, "program": "another"}) + "\n" for record in old))
        result = self.must_show("--parts", "build", models=MODELS[:1])
        self.check("another program's records are not kept", ": kept" not in result.stdout, result.stdout)

    def test_refusals(self):
        result = self.must_show("--parts", "build", models=("missing",))
        self.check("a model that is not there is named", result.returncode == 1 and "holds no missing" in result.stderr,
                   result.stderr)
        result = self.must_show("--parts", "sprint")
        self.check("an unknown part is wrong usage", result.returncode == 2, result.stderr)
        lines = len(self.log.read_text().splitlines())
        result = self.must_show("--parts", "build", "--again", "--data", self.folder / "nowhere")
        self.check("a folder that is not there is wrong usage, and nothing is measured", result.returncode == 2 and
                   "nowhere is no folder" in result.stderr and len(self.log.read_text().splitlines()) == lines,
                   result.stderr)


def main():
    program = os.path.abspath(sys.argv[1])
    if sanitized.sanitizers(program):  # they reserve address space by the terabyte, which no limit allows
        print("skipped: what it asks of the program, other tests ask too")
        return 77
    with tempfile.TemporaryDirectory() as folder:
        test = Test(program, pathlib.Path(folder))
        for part in (test.test_parts, test.test_samples, test.test_remote, test.test_tables, test.test_scale, test.test_origins, test.test_sheet, test.test_png,
                     test.test_resume, test.test_refusals):
            part()
        return 1 if test.failures else 0


if __name__ == "__main__":
    sys.exit(main())
