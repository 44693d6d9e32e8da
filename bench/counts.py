#!/usr/bin/env python3
"""Figures that no clock changes: triangles, nodes, levels and bytes of the containers of known models.

They stand in bench/results.csv and are compared exactly. A row with `triangles` is a scene, which anybody can generate; one
without is a file. A difference is either a fault or an improvement: in the second case say so in the commit that runs

    bench/counts.py --stroll build/stroll --update      builds the scenes of the table anew and rewrites their rows
"""
import argparse
import csv
import json
import pathlib
import subprocess
import sys
import tempfile

TABLE = pathlib.Path(__file__).resolve().parent / "results.csv"
KEY = ("model", "triangles", "seed")
FIGURES = ("triangles_in", "triangles_leaf", "nodes", "levels", "root_triangles", "bytes_out")
COLUMNS = KEY + FIGURES


class Failed(Exception):
    pass


def read_table(path=TABLE):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def write_table(rows, path=TABLE):
    def order(row):
        return (row["triangles"] == "", row["model"], int(row["triangles"] or 0), row["seed"])
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(sorted(rows, key=order))


def row_of(model, triangles, seed, report):
    """report: the object that `stroll build --json` prints."""
    missing = [name for name in FIGURES if name not in report]
    if missing:
        raise Failed(f"build --json of {model} lacks {', '.join(missing)}")
    row = {"model": model, "triangles": str(triangles), "seed": str(seed)}
    row.update({name: str(report[name]) for name in FIGURES})
    return row


def put_row(row, path=TABLE):
    rows = [old for old in read_table(path) if any(old[name] != row[name] for name in KEY)]
    write_table(rows + [row], path)


def run(command):
    done = subprocess.run([str(word) for word in command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode != 0:
        raise Failed(f"{' '.join(map(str, command))} ended with {done.returncode}: {done.stderr.strip()}")
    return done.stdout


def build_scene(stroll, row, folder):
    """Generates the scene of a row, builds it and returns the row as it is today."""
    scene, container = folder / "scene.ply", folder / "scene.stroll"
    run([stroll, "scene", row["model"], "--triangles", row["triangles"], "--seed", row["seed"], "-o", scene, "--quiet"])
    report = json.loads(run([stroll, "build", scene, "-o", container, "--json", "--quiet"]))
    if report.get("bytes_out") != container.stat().st_size:
        raise Failed(f"bytes_out says {report.get('bytes_out')}, the container has {container.stat().st_size} bytes")
    return row_of(row["model"], row["triangles"], row["seed"], report)


def scenes(rows, most):
    return [row for row in rows if row["triangles"] and int(row["triangles"]) <= most]


def differences(old, new):
    return [f"{name}: {old[name]} in the table, {new[name]} now" for name in FIGURES if old[name] != new[name]]


def main():
    parser = argparse.ArgumentParser(description="Compares the counts of generated scenes with bench/results.csv.")
    parser.add_argument("--stroll", required=True, type=pathlib.Path, help="the program")
    parser.add_argument("--most", type=int, default=500_000, help="leave scenes of more triangles out (500000)")
    parser.add_argument("--update", action="store_true", help="rewrite the table's rows of scenes")
    options = parser.parse_args()
    rows, failures = scenes(read_table(), options.most), 0
    if not rows:
        raise Failed(f"{TABLE} has no scene to compare")
    for row in rows:
        with tempfile.TemporaryDirectory(prefix="stroll-counts-") as folder:
            today = build_scene(options.stroll.resolve(), row, pathlib.Path(folder))
        changed = differences(row, today)
        print(f"{row['model']} {row['triangles']} seed {row['seed']}: {'; '.join(changed) or 'as in the table'}")
        failures += bool(changed)
        if options.update:
            put_row(today)
    return 1 if failures and not options.update else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except Failed as failure:
        sys.exit(f"counts: {failure}")
