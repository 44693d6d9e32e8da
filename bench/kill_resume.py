#!/usr/bin/env python3
"""Kills builds at random moments, resumes them, and compares the bytes with those of a build that nothing stopped.

    bench/kill_resume.py STROLL --scratch DIR [--triangles 10M] [--kills 50] [--seed S] [--memory 1G] [--jobs N] [--structure S]

A build is killed (SIGKILL) after a random share of the time that the unstopped one took, resumed, killed again ... until it
comes to its end; then the next begins. Prints a JSON line for each kill and one for all; exits with 1 where bytes differ
or a build cannot be resumed."""
import argparse
import json
import os
import random
import subprocess
import sys
import time

import measure


def options():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stroll")
    parser.add_argument("--scratch", required=True, help="folder for the model and the builds, made where missing")
    parser.add_argument("--triangles", default="10M")
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--memory", default="1G")
    parser.add_argument("--jobs")
    parser.add_argument("--structure", default="clusters")
    return parser.parse_args()


class Kills:
    def __init__(self, args):
        self.args, self.random = args, random.Random(args.seed)
        self.source, self.out = (os.path.join(args.scratch, name) for name in ("in.ply", "out.stroll"))
        self.lost, self.resumed = 0.0, 0

    def command(self, *more):
        words = [self.args.stroll, "build", self.source, "-o", self.out, "--json", "--quiet", "--memory", self.args.memory,
                 "--structure", self.args.structure]
        return [*words, *(["--jobs", self.args.jobs] if self.args.jobs else []), *more]

    def unstopped(self):
        begin = time.monotonic()
        done = subprocess.run(self.command(), stdout=subprocess.PIPE, check=True)
        self.seconds, self.result = time.monotonic() - begin, json.loads(done.stdout)
        self.expected = measure.digest(self.out)
        os.remove(self.out)

    def run_once(self, kill, spent):
        """One run that is killed after `kill` seconds. True where it came to its end before."""
        begin = time.monotonic()
        child = subprocess.Popen(self.command("--resume"), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        try:
            child.wait(timeout=kill)
        except subprocess.TimeoutExpired:
            child.kill()
        _, error = child.communicate()
        if child.returncode == 0:
            seconds = spent + time.monotonic() - begin
            self.lost = max(self.lost, seconds - self.seconds)
            return True
        if child.returncode > 0:
            sys.exit(f"a build could not be resumed: {error}")
        return False

    def all(self):
        kills = builds = 0
        while kills < self.args.kills:
            spent, here = 0.0, 0
            while True:
                moment = self.random.random() * self.seconds
                last = kills == self.args.kills
                if self.run_once(1e6 if last else moment, spent):
                    break
                kills, here, spent = kills + 1, here + 1, spent + moment
                print(json.dumps({"kill": kills, "of_build": builds + 1, "after_seconds": round(moment, 2),
                                  "scratch_bytes": measure.disk_bytes(self.out + ".tmp")}), flush=True)
            builds += 1
            if measure.digest(self.out) != self.expected:
                sys.exit(f"build {builds}, which was killed {here} times, has other bytes")
            if os.path.exists(self.out + ".tmp"):
                sys.exit(f"build {builds} left its scratch folder")
            os.remove(self.out)
        print(json.dumps({"triangles": self.result["triangles_in"], "kills": kills, "builds": builds, "bytes": "same",
                          "seconds_unstopped": round(self.seconds, 2), "most_seconds_lost": round(self.lost, 2)}))


def main():
    args = options()
    os.makedirs(args.scratch, exist_ok=True)
    kills = Kills(args)
    if not os.path.exists(kills.source):
        subprocess.run([args.stroll, "scene", "isosurface", "--triangles", args.triangles, "-o", kills.source, "--quiet"],
                       check=True)
    kills.unstopped()
    kills.all()


main()
