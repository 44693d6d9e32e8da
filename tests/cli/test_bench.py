#!/usr/bin/env python3
"""stroll bench measures what it names, says it in one shape, and leaves nothing behind. No claim here is about speed.

usage: test_bench.py PROGRAM"""
import json
import os
import signal
import subprocess
import sys
import tempfile
import time

FIGURES = {"scene": ["scene"], "read": ["read"], "build": ["build_one_core", "build", "build_memory"],
           "decode": ["decode"], "select": ["select"], "draw": ["draw"]}
UNITS = {"M triangles/s", "MiB", "ms"}
MAY_LACK = {"draw", "build_memory"}  # without OpenGL; where the system does not tell it


class Test:
    def __init__(self, program, folder):
        self.program, self.folder, self.failures = program, folder, 0

    def command(self, *words):
        return [self.program, "bench", *words, "--triangles", "20K", "--scratch", self.folder]

    def run(self, *words):
        return subprocess.run(self.command(*words), capture_output=True, text=True)

    def check(self, claim, holds, detail):
        print("%s %s" % ("ok  " if holds else "FAIL", claim))
        if not holds:
            self.failures += 1
            print("     " + str(detail))

    def check_empty(self, when):
        self.check("nothing is left " + when, os.listdir(self.folder) == [], os.listdir(self.folder))

    def check_figure(self, figure, runs):
        name = figure["name"]
        if figure["runs"] == 0:
            good = name in MAY_LACK and figure["note"] and figure["median"] is figure["min"] is figure["max"] is None
        else:
            good = figure["runs"] == runs and 0 < figure["min"] <= figure["median"] <= figure["max"]
        self.check("%s has median and spread" % name, good and figure["unit"] in UNITS, figure)

    def test_all(self):
        result = self.run("--runs", "1", "--json", "--quiet")
        report = json.loads(result.stdout) if result.returncode == 0 else {}
        self.check("all measurements run", report != {}, result.stderr)
        names = [figure["name"] for figure in report.get("benchmarks", [])]
        self.check("each name is there, in order", names == sum(FIGURES.values(), []), names)
        facts = [report.get(name) for name in ("version", "compiler", "machine", "triangles", "runs", "jobs")]
        self.check("the machine is named", None not in facts and report["triangles"] == 20000 and
                   set(report["machine"]) == {"cpu", "cores"} and report["machine"]["cores"] > 0, facts)
        for figure in report.get("benchmarks", []):
            self.check_figure(figure, 1)
        self.check_empty("after all")

    def test_choice(self):
        result = self.run("decode", "scene", "--runs", "3", "--json")
        figures = json.loads(result.stdout)["benchmarks"] if result.returncode == 0 else []
        self.check("names choose", [figure["name"] for figure in figures] == ["scene", "decode"],
                   (figures, result.stderr))
        for figure in figures:
            self.check_figure(figure, 3)
        result = self.run("read", "--runs", "2")
        lines = result.stdout.splitlines()
        self.check("the table names figure and unit", result.returncode == 0 and len(lines) == 5 and
                   lines[4].split()[0] == "read" and "M triangles/s" in lines[4], result.stdout)
        self.check_empty("after some")

    def test_usage(self):
        result = self.run("sprint")
        self.check("another name is wrong usage", result.returncode == 2 and "sprint" in result.stderr, result.stderr)
        result = subprocess.run([self.program, "bench", "--help"], capture_output=True, text=True)
        listed = [line.split()[0] for line in result.stdout.splitlines() if line.startswith("  ") and line[2].isalpha()]
        self.check("--help lists all names", result.returncode == 0 and listed == list(FIGURES), result.stdout)
        result = subprocess.run([self.program, "bench", "scene", "--triangles", "3"], capture_output=True, text=True)
        self.check("too few triangles are wrong usage", result.returncode == 2, result.stderr)
        self.check_empty("after wrong usage")

    def test_failures(self):
        missing = os.path.join(self.folder, "missing")
        result = subprocess.run([self.program, "bench", "scene", "--scratch", missing], capture_output=True, text=True)
        self.check("a folder that is not there is named", result.returncode == 1 and missing in result.stderr,
                   result.stderr)
        process = subprocess.Popen(self.command("build", "--runs", "1000", "--quiet"), stderr=subprocess.PIPE,
                                   text=True, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
        until = time.monotonic() + 60
        while not os.listdir(self.folder) and process.poll() is None and time.monotonic() < until:
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=120)
        self.check("an interrupt ends it with a sentence", process.returncode == 1 and errors.startswith("stroll: "),
                   errors)
        self.check_empty("after an interrupt")


def main():
    with tempfile.TemporaryDirectory() as folder:
        test = Test(os.path.abspath(sys.argv[1]), folder)
        for part in (test.test_all, test.test_choice, test.test_usage, test.test_failures):
            part()
        return 1 if test.failures else 0


if __name__ == "__main__":
    sys.exit(main())
