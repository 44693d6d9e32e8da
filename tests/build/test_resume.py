#!/usr/bin/env python3
"""A build that was killed, interrupted or met a full disk is resumed, and its bytes are those of one that was not."""
import json
import os
import signal
import subprocess
import sys
from random import Random

from building import NotHere, assert_refused, must, run, run_tests, sanitizers
from resuming import Build, Scene, read

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "readers"))
import image_writer  # noqa: E402

# Under a sanitizer, where a build takes ten times as long, fewer kills of a smaller model.
KILLS, KILLED = (2, "72K") if sanitizers() else (8, "300K")
SMALL = "72K"  # little more than what checkpoints are made of
SAMPLES = ("--structure", "samples", "--memory", "64M")  # of several buckets


def killed_at_random_moments_it_resumes(folder):
    """Each build several times, until it comes to its end; each time after a random share of the time that a whole one took."""
    for number, options in enumerate(((), SAMPLES)):
        own = os.path.join(folder, str(number))
        os.mkdir(own)
        kill_at_random(Scene(own, KILLED, *options), Random(3))


def kill_at_random(scene, random):
    """How often that is behind the first checkpoint is up to the machine, so that the last kill waits for one."""
    kills = 0
    for attempt in range(20 * KILLS):
        build = Build(*scene.words("--resume", "--json", "--jobs", str(random.randint(1, 3))))
        build.wait(random.random() * 0.6 * scene.reference.seconds)
        if build.stop(signal.SIGKILL) is None:
            scene.check(build.output)
            continue
        assert not os.path.exists(scene.out)
        kills += 1
        if kills == KILLS:
            break
    assert kills == KILLS, kills
    scene.stopped(more=("--resume",), when="checkpoint")
    scene.resume()


def killed_while_it_writes_it_resumes(folder):
    """The container holds other payloads than the finished levels do, and is written anew from them."""
    for number, options in enumerate(((), ("--compact",))):
        own = os.path.join(folder, str(number))
        os.mkdir(own)
        scene = Scene(own, SMALL, *options)
        for when in ("order-04.spill", "order-01.spill", "nodes-00.spill"):
            scene.stopped(when=when)
            scene.resume("--jobs", str(1 + number))


def interrupted_it_keeps_what_is_finished(folder):
    scene = Scene(folder, SMALL)
    for number in (signal.SIGINT, signal.SIGTERM):
        interrupt(scene, number)
    interrupt(Scene(folder, SMALL, *SAMPLES), signal.SIGINT, when="checkpoint")


def interrupt(scene, number, **options):
    said = scene.stopped(number, **options)
    assert said.count("\n") == 1 and "interrupted" in said and "--resume" in said, said
    assert sorted(os.listdir(scene.folder)) == ["in.ply", "out.stroll.tmp"]
    scene.resume()


def with_nothing_to_resume_it_begins(folder):
    scene = Scene(folder, SMALL)
    for quiet in ((), ("--quiet",)):
        done = must("build", *scene.words("--resume", "--json", *quiet))
        assert not json.loads(done.output)["resumed"]
        scene.check(done.output)
        assert done.error == "" if quiet else done.error.count("\n") == 1 and "from the beginning" in done.error, done


def of_a_small_model_nothing_is_kept(folder):
    source, out = os.path.join(folder, "in.ply"), os.path.join(folder, "out.stroll")
    must("scene", "isosurface", "--triangles", "60K", "-o", source, "--quiet")
    build = Build(source, "-o", out)
    build.wait_for(os.path.join(out + ".tmp", "payload-01.spill"))
    left = [] if build.stop(signal.SIGTERM) is not None else ["out.stroll"]
    assert sorted(os.listdir(folder)) == ["in.ply", *left]


def without_resume_it_begins_anew(folder):
    scene = Scene(folder, SMALL)
    scene.stopped()
    older = os.path.join(scene.out + ".tmp", "older.spill")
    open(older, "wb").close()
    done = must("build", *scene.words("--json"))
    assert not json.loads(done.output)["resumed"]
    scene.check(done.output)


def what_was_not_saved_is_cut_off_or_removed(folder):
    scene = Scene(folder, SMALL)
    scene.stopped()
    scratch = scene.out + ".tmp"
    with open(os.path.join(scratch, "payload-00.spill"), "ab") as file:
        file.write(b"after the checkpoint" * 5000)
    for name in ("pairs-000.spill", "out.stroll.abcd.part"):
        with open(os.path.join(scratch, name), "wb") as file:
            file.write(b"left over")
    scene.resume()


def assert_begins_anew(done, *parts):
    """What cannot be used is not said to be kept."""
    assert_refused(done, *parts, "leave --resume out to begin anew")
    assert "goes on" not in done.error, done


def damage_is_found(folder):
    scene = Scene(folder, SMALL)
    scene.stopped()
    scratch = scene.out + ".tmp"
    for name, offset in (("checkpoint", 300), ("checkpoint", 2), ("checkpoint", 9), ("ingest.spill", 100),
                         ("partition.spill", 5), ("payload-00.spill", 20), ("nodes-00.spill", 60)):
        path = os.path.join(scratch, name)
        whole = bytearray(read(path))
        for damaged in (whole[:offset] + bytes([whole[offset] ^ 1]) + whole[offset + 1:], whole[:offset]):
            with open(path, "wb") as file:
                file.write(damaged)
            before = sorted(os.listdir(scratch))
            assert_begins_anew(run("build", *scene.words("--resume")), scratch)
            assert sorted(os.listdir(scratch)) == before and not os.path.exists(scene.out)
        with open(path, "wb") as file:
            file.write(whole)
    os.rename(os.path.join(scratch, "partition.spill"), os.path.join(folder, "away"))
    assert_begins_anew(run("build", *scene.words("--resume")), "partition.spill")
    os.rename(os.path.join(folder, "away"), os.path.join(scratch, "partition.spill"))
    scene.resume()


def another_request_is_refused(folder):
    scene = Scene(folder, SMALL)
    scene.stopped()
    other = os.path.join(folder, "other.ply")
    os.link(scene.source, other)
    for words, holds in ((scene.words("--grid", "0.5"), "--grid"), (scene.words("--compact"), "--compact is given"),
                         (scene.words("--up", "x"), "--up"),
                         (scene.words("--unit", "mm"), "--unit is mm"),
                         (scene.words("--no-dependencies"), "--no-dependencies"),
                         (scene.words("--certify"), "--certify is given"),
                         (scene.words("--memory", "512M"), "--memory"),
                         ((scene.source, *scene.words()), "the inputs are 2"),
                         ((other, *scene.words()[1:]), "other.ply")):
        assert_begins_anew(run("build", *words, "--resume"), holds)
    facts = os.stat(scene.source)
    os.utime(scene.source, ns=(facts.st_atime_ns, facts.st_mtime_ns + 10**9))
    assert_begins_anew(run("build", *scene.words("--resume")), "in.ply was changed")
    with open(scene.source, "ab") as file:
        file.write(b"\n")
    assert_begins_anew(run("build", *scene.words("--resume")), "in.ply has")
    os.truncate(scene.source, facts.st_size)
    os.utime(scene.source, ns=(facts.st_atime_ns, facts.st_mtime_ns))
    os.remove(other)
    scene.resume("--memory", "2G")


def another_request_for_samples_is_refused(folder):
    """They take no stage of clusters, nor clusters theirs; and what is damaged is found."""
    scene = Scene(folder, SMALL, *SAMPLES)
    scene.stopped(when="checkpoint")
    plain = (scene.source, "-o", scene.out, "--memory", "64M")
    for words, holds in ((plain, "--structure is clusters, in the build to be resumed it was samples"),
                         (scene.words("--probability", "0.5"), "--probability is 0.5"), (scene.words("--grid", "0.5"), "--grid")):
        assert_begins_anew(run("build", *words, "--resume"), holds)
    facts = os.stat(scene.source)
    os.utime(scene.source, ns=(facts.st_atime_ns, facts.st_mtime_ns + 10**9))
    assert_begins_anew(run("build", *scene.words("--resume")), "in.ply was changed")
    os.utime(scene.source, ns=(facts.st_atime_ns, facts.st_mtime_ns))
    for name in ("ingest.spill", "buckets.spill", "bucket-007.spill"):
        path = os.path.join(scene.out + ".tmp", name)
        whole = read(path)
        for damaged in (whole[:20] + bytes([whole[20] ^ 1]) + whole[21:], whole[:20]):
            with open(path, "wb") as file:
                file.write(damaged)
            assert_begins_anew(run("build", *scene.words("--resume")), name)
        with open(path, "wb") as file:
            file.write(whole)
    scene.resume("--jobs", "1")
    clusters = Scene(folder, SMALL)
    clusters.stopped()
    assert_begins_anew(run("build", *clusters.words("--structure", "samples", "--resume")), "--structure is samples")
    clusters.resume()


def hang_image(source, name):
    """Gives the model an image in a file beside it, which some triangle shows."""
    folder = os.path.dirname(source)
    with open(os.path.join(folder, name), "wb") as file:
        file.write(image_writer.png([[(200, 30, 60), (20, 90, 240)]] * 2))
    if source.endswith(".obj"):
        with open(source, "a", encoding="utf-8") as file:
            file.write("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl shown\nf -3/-3 -2/-2 -1/-1\n")
        with open(os.path.join(folder, "in.mtl"), "a", encoding="utf-8") as file:
            file.write(f"newmtl shown\nmap_Kd {name}\n")
        return
    model = json.loads(read(source))
    primitive = model["meshes"][0]["primitives"][0]
    model["accessors"].append({"componentType": 5126, "type": "VEC2",
                               "count": model["accessors"][primitive["attributes"]["POSITION"]]["count"]})
    primitive["attributes"]["TEXCOORD_0"] = len(model["accessors"]) - 1
    model["materials"][primitive["material"]]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
    model.update(textures=[{"source": 0}], images=[{"uri": name}])
    with open(source, "w", encoding="utf-8") as file:
        json.dump(model, file)


def a_changed_file_beside_the_model_is_refused(folder):
    """What a glTF or an OBJ names is as much of the input as it is itself."""
    for ending, name in (("gltf", "in_000.bin"), ("obj", "in.mtl"), ("gltf", "image.png"), ("obj", "image.png")):
        own = os.path.join(folder, ending + name)
        os.mkdir(own)
        source, beside, out = (os.path.join(own, part) for part in (f"in.{ending}", name, "out.stroll"))
        must("scene", "plant", "--triangles", SMALL, "-o", source, "--quiet")
        if name == "image.png":
            hang_image(source, name)
        said = None
        for attempt in range(20):
            build = Build(source, "-o", out)
            build.wait_for(os.path.join(out + ".tmp", "nodes-01.spill"))
            said = build.stop(signal.SIGKILL)
            if said is not None:
                break
            os.remove(out)
        assert said is not None, "no build could be stopped"
        facts = os.stat(beside)
        os.utime(beside, ns=(facts.st_atime_ns, facts.st_mtime_ns + 10**9))
        assert_begins_anew(run("build", source, "-o", out, "--resume"), f"{name} was changed")
        with open(beside, "ab") as file:
            file.write(b"\n")
        assert_begins_anew(run("build", source, "-o", out, "--resume"), f"{name} has")
        os.rename(beside, beside + ".away")
        assert_begins_anew(run("build", source, "-o", out, "--resume"), name, "No such file")
        os.rename(beside + ".away", beside)
        os.truncate(beside, facts.st_size)
        os.utime(beside, ns=(facts.st_atime_ns, facts.st_mtime_ns))
        done = must("build", source, "-o", out, "--resume", "--json")
        result = json.loads(done.output)
        assert result["resumed"] and result["warnings"]["missing_images"] == 0, result


def scratch_elsewhere_is_found_again_and_removed(folder):
    scene = Scene(folder, SMALL)
    elsewhere = os.path.join(folder, "elsewhere")
    scene.stopped(folder=elsewhere, more=("--scratch", elsewhere))
    assert os.listdir(elsewhere) == ["out.stroll.tmp"]
    scene.resume("--scratch", elsewhere)
    scene.stopped(folder=elsewhere, more=("--scratch", elsewhere), when="order-01.spill")
    left = os.path.join(folder, "out.stroll.tmp")  # no other name may stay beside the output
    assert sorted(os.listdir(folder)) == ["elsewhere", "in.ply", "out.stroll.tmp"], os.listdir(folder)
    assert any(name.endswith(".part") for name in os.listdir(left)), os.listdir(left)
    scene.resume("--scratch", elsewhere)
    assert os.listdir(folder) == ["in.ply"], os.listdir(folder)


def on_a_full_disk_it_waits_for_room(folder):
    disk = os.path.join(folder, "disk")
    os.mkdir(disk)
    mounted = os.geteuid() == 0 and subprocess.run(["mount", "-t", "tmpfs", "-o", "size=24m", "tmpfs", disk],
                                                   stderr=subprocess.DEVNULL).returncode == 0
    if not mounted:
        raise NotHere("mount is not allowed: no small disk to fill")
    try:
        scene, filler = Scene(disk, SMALL), os.path.join(disk, "filler")
        stops = 0
        for attempt in range(40):
            build = Build(*scene.words())
            build.wait_for(os.path.join(scene.out + ".tmp", "nodes-00.spill" if attempt % 2 else "nodes-01.spill"))
            fill(filler)
            _, error = build.child.communicate()
            os.remove(filler)
            if build.child.returncode == 0:  # it was done before the disk was full
                os.remove(scene.out)
                continue
            assert build.child.returncode == 1 and error.count("\n") == 1, error
            assert "No space" in error and "make room" in error and "--resume" in error, error
            assert sorted(os.listdir(disk)) == ["in.ply", "out.stroll.tmp"], os.listdir(disk)
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


if sanitizers():  # what reads scratch; the rest is the program's order of work, the same without them
    run_tests(killed_at_random_moments_it_resumes, damage_is_found, another_request_for_samples_is_refused)
run_tests(killed_at_random_moments_it_resumes, killed_while_it_writes_it_resumes,
          interrupted_it_keeps_what_is_finished, with_nothing_to_resume_it_begins, of_a_small_model_nothing_is_kept, without_resume_it_begins_anew,
          what_was_not_saved_is_cut_off_or_removed, damage_is_found, another_request_is_refused,
          another_request_for_samples_is_refused,
          a_changed_file_beside_the_model_is_refused,
          scratch_elsewhere_is_found_again_and_removed, on_a_full_disk_it_waits_for_room)
