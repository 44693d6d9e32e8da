#!/usr/bin/env python3
"""A build that was killed, interrupted or met a full disk is resumed, and its bytes are those of one that was not."""
import json
import os
import shutil
import signal
import subprocess
import time
from random import Random

from building import assert_refused, must, run, run_tests
from resuming import Watched

KILLS = 8
TRIANGLES = "300K"
COUNTS = ("triangles_in", "triangles_leaf", "dropped", "warnings", "vertices", "parts", "materials", "nodes", "groups",
          "levels", "root_triangles", "bytes_out")


class Scene:
    """An input, and what a build of it gives that nothing stops."""

    def __init__(self, folder, triangles=TRIANGLES):
        self.folder, self.source, self.out = folder, os.path.join(folder, "in.ply"), os.path.join(folder, "out.stroll")
        must("scene", "isosurface", "--triangles", triangles, "-o", self.source, "--quiet")
        clean = os.path.join(folder, "clean.stroll")
        build = Watched(self.source, "-o", clean, "--json")
        build.wait_for(1 << 30)
        self.result, self.checkpoints = json.loads(build.child.communicate()[0]), build.seen
        self.bytes = read(clean)
        os.remove(clean)
        assert self.checkpoints >= 6, self.checkpoints

    def words(self, *more):
        return (self.source, "-o", self.out, *more)

    def resume(self, *more):
        done = must("build", *self.words("--resume", "--json", *more))
        self.check(json.loads(done.output))
        return done

    def check(self, result):
        assert read(self.out) == self.bytes
        assert all(result[key] == self.result[key] for key in COUNTS), (result, self.result)
        assert sorted(os.listdir(self.folder)) == ["in.ply", "out.stroll"], os.listdir(self.folder)
        os.remove(self.out)

    def stopped(self, number, checkpoints=6):
        """Leaves a build that was stopped after so many checkpoints; what it said."""
        for attempt in range(20):
            build = Watched(*self.words())
            build.wait_for(checkpoints)
            said = build.stop(number)
            if said is not None:
                return said
            os.remove(self.out)
        raise AssertionError("no build could be stopped")


def read(path):
    with open(path, "rb") as file:
        return file.read()


def killed_at_random_moments_it_resumes(folder):
    scene, random = Scene(folder), Random(3)
    kills = 0
    for attempt in range(4 * KILLS):
        build = Watched(*scene.words("--quiet", "--jobs", str(random.randint(1, 3))))
        build.wait_for(random.randint(0, scene.checkpoints - 1))
        time.sleep(random.random() * 0.02)
        if build.stop(signal.SIGKILL) is None:
            os.remove(scene.out)
            continue
        assert not os.path.exists(scene.out)
        scene.resume("--jobs", str(random.randint(1, 3)))
        kills += 1
        if kills == KILLS:
            return
    raise AssertionError(f"only {kills} builds could be killed")


def killed_again_and_again_it_comes_to_its_end(folder):
    scene, random = Scene(folder), Random(4)
    kills, longest = 0, 3
    while True:
        build = Watched(*scene.words("--resume", "--json", "--jobs", str(random.randint(1, 3))))
        build.wait_for(random.randint(1, longest))
        if build.child.poll() is not None:
            break
        kills += build.stop(signal.SIGKILL) is not None
        assert kills < 100
    if build.child.returncode == 0 and os.path.exists(scene.out):
        output = build.child.communicate()[0]
        scene.check(json.loads(output))
    else:
        scene.resume()
    assert kills >= 4, kills


def interrupted_it_keeps_what_is_finished(folder):
    scene = Scene(folder)
    for number in (signal.SIGINT, signal.SIGTERM):
        said = scene.stopped(number)
        assert said.count("\n") == 1 and "interrupted" in said and "--resume" in said, said
        assert sorted(os.listdir(folder)) == ["in.ply", "out.stroll.tmp"]
        scene.resume()


def with_nothing_to_resume_it_begins(folder):
    scene = Scene(folder, "100K")
    done = scene.resume()
    assert done.error.count("\n") == 1 and "from the beginning" in done.error, done
    done = scene.resume("--quiet")
    assert done.error == "", done


def of_a_small_model_nothing_is_kept(folder):
    source = os.path.join(folder, "in.ply")
    must("scene", "isosurface", "--triangles", "50K", "-o", source, "--quiet")
    build = Watched(source, "-o", os.path.join(folder, "out.stroll"))
    build.wait_for(1)
    build.child.communicate()
    assert build.seen == 0 and build.child.returncode == 0


def without_resume_it_begins_anew(folder):
    scene = Scene(folder)
    scene.stopped(signal.SIGKILL)
    older = os.path.join(scene.out + ".tmp", "older.spill")
    open(older, "wb").close()
    scene.check(json.loads(must("build", *scene.words("--json")).output))


def what_was_not_saved_is_cut_off_or_removed(folder):
    scene = Scene(folder)
    scene.stopped(signal.SIGKILL)
    scratch = scene.out + ".tmp"
    with open(os.path.join(scratch, "payload-00.spill"), "ab") as file:
        file.write(b"after the checkpoint" * 5000)
    for name in ("pairs-000.spill", "out.stroll.abcd.part"):
        with open(os.path.join(scratch, name), "wb") as file:
            file.write(b"left over")
    scene.resume()


def damage_is_found(folder):
    scene = Scene(folder)
    scene.stopped(signal.SIGKILL)
    scratch = scene.out + ".tmp"
    for name, offset in (("checkpoint", 300), ("checkpoint", 2), ("checkpoint", 9), ("ingest.spill", 100),
                         ("partition.spill", 5), ("payload-00.spill", 20), ("nodes-00.spill", 60)):
        path = os.path.join(scratch, name)
        whole = bytearray(read(path))
        for damaged in (whole[:offset] + bytes([whole[offset] ^ 1]) + whole[offset + 1:], whole[:offset]):
            with open(path, "wb") as file:
                file.write(damaged)
            before = sorted(os.listdir(scratch))
            assert_refused(run("build", *scene.words("--resume")), scratch, "leave --resume out")
            assert sorted(os.listdir(scratch)) == before and not os.path.exists(scene.out)
        with open(path, "wb") as file:
            file.write(whole)
    os.rename(os.path.join(scratch, "partition.spill"), os.path.join(folder, "away"))
    assert_refused(run("build", *scene.words("--resume")), "partition.spill", "leave --resume out")
    os.rename(os.path.join(folder, "away"), os.path.join(scratch, "partition.spill"))
    scene.resume()


def another_request_is_refused(folder):
    scene = Scene(folder)
    scene.stopped(signal.SIGKILL)
    other = os.path.join(folder, "other.ply")
    os.link(scene.source, other)
    for words, holds in ((scene.words("--grid", "0.5"), "--grid"), (scene.words("--up", "x"), "--up"),
                         (scene.words("--unit", "mm"), "--unit is mm"),
                         (scene.words("--no-dependencies"), "--no-dependencies"),
                         (scene.words("--memory", "512M"), "--memory"),
                         ((scene.source, *scene.words()), "the inputs are 2"),
                         ((other, *scene.words()[1:]), "other.ply")):
        assert_refused(run("build", *words, "--resume"), holds, "leave --resume out to begin anew")
    facts = os.stat(scene.source)
    os.utime(scene.source, ns=(facts.st_atime_ns, facts.st_mtime_ns + 10**9))
    assert_refused(run("build", *scene.words("--resume")), "in.ply was changed", "leave --resume out")
    with open(scene.source, "ab") as file:
        file.write(b"\n")
    assert_refused(run("build", *scene.words("--resume")), "in.ply has", "leave --resume out")
    os.truncate(scene.source, facts.st_size)
    os.utime(scene.source, ns=(facts.st_atime_ns, facts.st_mtime_ns))
    os.remove(other)
    scene.resume("--memory", "2G")


def scratch_elsewhere_is_found_again_and_removed(folder):
    scene = Scene(folder)
    elsewhere = os.path.join(folder, "elsewhere")
    for attempt in range(20):
        build = Watched(*scene.words("--scratch", elsewhere))
        build.scratch = os.path.join(elsewhere, "out.stroll.tmp")
        build.wait_for(5)
        if build.stop(signal.SIGKILL) is not None:
            break
        os.remove(scene.out)
    assert os.listdir(elsewhere) == ["out.stroll.tmp"]
    scene.resume("--scratch", elsewhere)


def on_a_full_disk_it_waits_for_room(folder):
    disk = os.path.join(folder, "disk")
    os.mkdir(disk)
    mounted = os.geteuid() == 0 and subprocess.run(["mount", "-t", "tmpfs", "-o", "size=100m", "tmpfs", disk],
                                                   stderr=subprocess.DEVNULL).returncode == 0
    if not mounted:
        print("mount is not allowed: no small disk to fill")
        return
    try:
        scene, filler = Scene(disk), os.path.join(disk, "filler")
        stops = 0
        for attempt in range(20):
            build = Watched(*scene.words())
            build.wait_for(3 + attempt % 4)
            fill(filler)
            _, error = build.child.communicate(timeout=120)
            os.remove(filler)
            if build.child.returncode == 0: # it was done before the disk was full
                os.remove(scene.out)
                continue
            assert build.child.returncode == 1 and error.count("\n") == 1, error
            assert "No space" in error and "make room" in error and "--resume" in error, error
            scene.resume()
            stops += 1
            if stops == 2:
                return
        raise AssertionError("the disk was never full in time")
    finally:
        subprocess.run(["umount", disk], check=True)


def fill(path):
    with open(path, "wb", buffering=0) as file:
        try:
            while True:
                file.write(bytes(1 << 20))
        except OSError:
            pass
        try:
            while True:
                file.write(bytes(512))
        except OSError:
            pass


run_tests(killed_at_random_moments_it_resumes, killed_again_and_again_it_comes_to_its_end,
          interrupted_it_keeps_what_is_finished, with_nothing_to_resume_it_begins,
          of_a_small_model_nothing_is_kept, without_resume_it_begins_anew,
          what_was_not_saved_is_cut_off_or_removed, damage_is_found, another_request_is_refused,
          scratch_elsewhere_is_found_again_and_removed, on_a_full_disk_it_waits_for_room)
