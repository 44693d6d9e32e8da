#!/usr/bin/env python3
"""Whatever writes a file writes it whole or not at all, under its given name, and touches no file of anybody else.

usage: test_outputs.py PROGRAM"""
import fcntl
import os
import resource
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
import time
import traceback

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "support"))
import sanitized

STROLL = os.path.abspath(sys.argv[1])
ROOT = os.geteuid() == 0
PATIENCE_S = 600
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)


class Writer:
    """A command that writes one file; `long` takes at least some tenths of a second."""

    def __init__(self, name, ending, words, long=None):
        self.name, self.ending, self.words, self.long = name, ending, words, long or words


def make_writers(data):
    model, source = data + "/model.stroll", data + "/model.ply"
    must("scene", "isosurface", "-n", "150K", "-o", source)
    must("build", source, "-o", model)
    render = ["render", model, "--size", "64x48"]
    frames = render + ["--path", "orbit", "--frames", "3000"]
    return [Writer("build", ".stroll", ["build", source, "-o"]),
            Writer("extract", ".ply", ["extract", model, "--error", "0", "-o"]),
            Writer("scene", ".ply", ["scene", "isosurface", "-n", "20K", "-o"],
                   ["scene", "isosurface", "-n", "30M", "-o"]),
            Writer("image", ".png", render + ["--depth", "-o"]),
            Writer("stats", ".jsonl", render + ["--backend", "null", "--stats"],
                   frames + ["--backend", "null", "--stats"]),
            Writer("cameras", ".json", render + ["--backend", "null", "--save-path"])]


# ---- helpers ----
def run(*words, **options):
    return subprocess.run([STROLL, *words, "--quiet"], capture_output=True, text=True, timeout=PATIENCE_S, **options)


def must(*words):
    done = run(*words)
    assert done.returncode == 0, (words, done.stderr)


def assert_refused(done, *parts):
    assert done.returncode == 1 and done.stderr.count("\n") == 1 and done.stderr.startswith("stroll: "), done
    assert all(part in done.stderr for part in parts), (parts, done.stderr)


def content(path):
    with open(path, "rb") as file:
        return file.read()


def put(path, text):
    with open(path, "w") as file:
        file.write(text)


def every_file(folder):
    """Name to kind and content of all below a folder."""
    found = {}
    for place, folders, files in os.walk(folder):
        for name in folders + files:
            path = os.path.join(place, name)
            mode = os.lstat(path).st_mode
            found[os.path.relpath(path, folder)] = (stat.S_IFMT(mode), content(path) if stat.S_ISREG(mode) else "")
    return found


def fresh(folder, name):
    path = os.path.join(folder, name)
    os.mkdir(path)
    return path


# ---- where a file cannot go ----
def what_is_no_place_for_a_file_is_refused_before_any_work(folder, writers):
    for writer in writers:
        place = fresh(folder, writer.name)
        pipe, device, to_pipe, loop, plain, missing = (
            place + "/" + name + writer.ending for name in ("pipe", "device", "to-pipe", "loop", "plain", "no/x"))
        os.mkfifo(pipe)
        os.symlink(pipe, to_pipe)
        os.symlink(loop, loop)
        put(plain, "plain")
        cases = [("", "name is empty"), (pipe, "is a pipe"), (to_pipe, "is a pipe"), (loop, "loop"),
                 (plain + "/x" + writer.ending, plain), (missing, "the folder " + place + "/no is missing")]
        try:
            os.mknod(device, stat.S_IFCHR | 0o666, os.makedev(1, 7))
            cases.append((device, "is a device"))
        except PermissionError:
            print("no right to make a device: not tested")
        before = every_file(place)
        for path, part in cases:
            assert_refused(run(*writer.long, path), part)
            assert every_file(place) == before, (writer.name, path, every_file(place))


def a_folder_is_no_file(folder, writers):
    place = fresh(folder, "place")
    for writer in writers:
        inner = place + "/inner" + writer.ending
        os.mkdir(inner)
        assert_refused(run(*writer.words, inner), inner, "is a folder")
        if writer.name != "image": # which goes into such a folder
            assert_refused(run(*writer.words, place + "/none" + writer.ending + "/"), "none")
        assert os.listdir(place) == [os.path.basename(inner)]
        os.rmdir(inner)


def without_rights_nothing_is_begun(folder, writers):
    prefix = ["setpriv", "--reuid", "65534", "--clear-groups"] if ROOT else []
    if ROOT and (not shutil.which("setpriv") or subprocess.run([*prefix, STROLL, "--version"],
                                                               stdout=subprocess.DEVNULL).returncode):
        print("nobody cannot run the program: rights not tested")
        return
    os.chmod(folder, 0o755)
    closed, writable = fresh(folder, "closed"), fresh(folder, "writable")
    os.chmod(closed, 0o555)
    os.chmod(writable, 0o777)
    for writer in writers:
        for path in (closed + "/new" + writer.ending, writable + "/protected" + writer.ending):
            put(writable + "/protected" + writer.ending, "protected")
            os.chmod(writable + "/protected" + writer.ending, 0o444)
            done = subprocess.run([*prefix, STROLL, *writer.words, path], capture_output=True, text=True, timeout=PATIENCE_S)
            assert_refused(done, "Permission denied")
            assert os.listdir(closed) == [] and content(writable + "/protected" + writer.ending) == b"protected"


def images_go_to_a_png_or_into_a_folder(folder, writers):
    image = next(writer for writer in writers if writer.name == "image")
    put(folder + "/scan.stroll", "mine")
    for name in ("scan.stroll", "x.jpg", "shots.v2"):
        assert_refused(run(*image.words, f"{folder}/{name}"), name, "NAME.png")
    assert content(folder + "/scan.stroll") == b"mine"
    assert os.listdir(folder) == ["scan.stroll"]
    must(*image.words, folder + "/shots.v2/")
    assert "frame_00000.png" in os.listdir(folder + "/shots.v2")
    must(*image.words, folder + "/BIG.PNG")
    assert content(folder + "/BIG.PNG").startswith(b"\x89PNG")
    os.unlink(folder + "/shots.v2/frame_00000.png")
    os.mkfifo(folder + "/shots.v2/frame_00000.png")
    assert_refused(run(*image.words, folder + "/shots.v2"), "is a pipe")


def an_empty_input_is_named(folder, writers):
    assert_refused(run("build", "", "-o", folder + "/x.stroll"), "name is empty")
    assert os.listdir(folder) == []


# ---- links and older files ----
def a_link_is_followed_and_stays(folder, writers):
    for writer in writers:
        near, far = fresh(folder, writer.name), fresh(folder, writer.name + "-far")
        plain, real, new = far + "/plain" + writer.ending, far + "/real" + writer.ending, far + "/new" + writer.ending
        must(*writer.words, plain)
        put(real, "older")
        os.chmod(real, 0o640)
        for target in (real, new):
            link, hop = near + "/link" + writer.ending, near + "/hop"
            os.symlink("hop", link)
            os.symlink(os.path.relpath(target, near), hop)
            must(*writer.words, link)
            assert os.readlink(link) == "hop" and os.path.islink(hop)
            if writer.name != "stats": # which holds times
                assert content(target) == content(plain)
            os.unlink(link)
            os.unlink(hop)
        assert stat.S_IMODE(os.stat(real).st_mode) == 0o640, "permissions of the replaced file"
        left = {os.path.basename(path) for path in (plain, real, new)}
        assert {name for name in os.listdir(far) if not name.endswith(".pfm")} == left, os.listdir(far)


def files_with_names_of_helpers_stay(folder, writers):
    for writer in writers:
        place = fresh(folder, writer.name)
        out = place + "/out" + writer.ending
        for suffix in (".part", ".faces", ".tmp.bak", ".faces.tmp", ".verify", ".spill"):
            put(out + suffix, "mine")
        os.mkdir(out + ".verify.tmp")
        put(out + ".verify.tmp/mine", "mine")
        if writer.name != "build": # where it is the scratch folder, see below
            put(out + ".tmp", "mine")
        before = every_file(place)
        must(*writer.words, out)
        if writer.name == "build":
            must("scene", "boxes", "-n", "3000", "-o", folder + "/boxes.ply")
            must("build", folder + "/boxes.ply", "-o", out)
            must("verify", out, "--cuts", "5", "--against", folder + "/boxes.ply")
        after = every_file(place)
        assert after.pop(os.path.basename(out))[1]
        after.pop("out.pfm", None)
        assert after == before, (writer.name, after.keys(), before.keys())


# ---- scratch ----
def a_foreign_scratch_folder_is_refused_and_stays(folder, writers):
    build = writers[0]
    killed = leave_scratch(folder, build)
    signature = content(killed + "/lock")

    def mine(path):
        os.mkdir(path)
        put(path + "/mine.txt", "mine")

    def spill_alone(path):
        os.mkdir(path)
        put(path + "/mesh-00.spill", "mine")

    def other_lock(path):
        os.mkdir(path)
        put(path + "/lock", "mine")

    def silent_lock(path):
        mine(path)
        put(path + "/lock", "")

    def signed_but_shared(path):
        shutil.copytree(killed, path)
        put(path + "/mine.txt", "mine")

    def signed_with_link(path):
        shutil.copytree(killed, path)
        os.symlink(killed + "/lock", path + "/soup.spill")

    for i, prepare in enumerate((mine, spill_alone, other_lock, silent_lock, signed_but_shared, signed_with_link,
                                 lambda path: put(path, "mine"), lambda path: os.symlink(killed, path))):
        place = fresh(folder, f"case{i}")
        prepare(place + "/out.stroll.tmp")
        before, was_killed = every_file(place), every_file(killed)
        assert_refused(run(*build.words, place + "/out.stroll"), place + "/out.stroll.tmp")
        assert every_file(place) == before and every_file(killed) == was_killed, i
    assert content(killed + "/lock") == signature


def leave_scratch(folder, build):
    """The scratch folder of a build that was killed."""
    place = fresh(folder, "killed")
    child = subprocess.Popen([STROLL, *build.words, place + "/out.stroll"], stdout=subprocess.DEVNULL)
    scratch = place + "/out.stroll.tmp"
    while not os.path.exists(scratch) or not any(name.endswith(".spill") for name in os.listdir(scratch)):
        assert child.poll() is None, "the build was over before it could be killed"
        time.sleep(0.001)
    child.kill()
    child.wait()
    return scratch


def what_a_killed_build_left_is_taken_over(folder, writers):
    for i in range(2):
        scratch = fresh(folder, f"early{i}") + "/out.stroll.tmp"
        os.mkdir(scratch)
        if i: # killed before it wrote into its lock file
            put(scratch + "/lock", "")
        must(*writers[0].words, scratch[:-len(".tmp")])
        assert os.listdir(os.path.dirname(scratch)) == ["out.stroll"]
    scratch = leave_scratch(folder, writers[0])
    put(scratch + "/older-stage.spill", "of an earlier version")
    must(*writers[0].words, scratch[:-len(".tmp")])
    assert os.listdir(os.path.dirname(scratch)) == ["out.stroll"]


def what_came_into_a_scratch_folder_meanwhile_stays(folder, writers):
    child = subprocess.Popen([STROLL, *writers[0].words, folder + "/out.stroll", "--quiet"])
    while not os.path.exists(folder + "/out.stroll.tmp/lock"):
        assert child.poll() is None
        time.sleep(0.001)
    put(folder + "/out.stroll.tmp/mine.txt", "mine")
    assert child.wait() == 0
    assert sorted(every_file(folder)) == ["out.stroll", "out.stroll.tmp", "out.stroll.tmp/mine.txt"]


def a_scratch_option_names_the_place_and_is_made_for_the_time(folder, writers):
    source = fresh(folder, "in") + "/boxes.ply"
    model = folder + "/model.stroll"
    must("scene", "boxes", "-n", "3000", "-o", source)
    must("build", source, "-o", model)
    verify = ["verify", model, "--cuts", "5", "--against", source]
    for words in (["build", source, "-o", model], verify):
        must(*words, "--scratch", folder + "/absent")
        assert sorted(os.listdir(folder)) == ["in", "model.stroll"]
        os.mkdir(folder + "/there")
        put(folder + "/there/mine", "mine")
        must(*words, "--scratch", folder + "/there")
        assert os.listdir(folder + "/there") == ["mine"]
        shutil.rmtree(folder + "/there")
        assert_refused(run(*words, "--scratch", folder + "/no/such"), "no/such")
        assert_refused(run(*words, "--scratch", ""), '""')
        assert_refused(run(*words, "--scratch", source), source)
        assert sorted(os.listdir(folder)) == ["in", "model.stroll"]
    # refused after the folder was made
    put(folder + "/bad.ply", "ply\nformat ascii 1.0\nelement vertex 9\n")
    assert run("build", folder + "/bad.ply", "-o", model, "--scratch", folder + "/absent").returncode == 1
    assert run(*verify[:-1], folder + "/bad.ply", "--scratch", folder + "/absent").returncode == 1
    assert sorted(os.listdir(folder)) == ["bad.ply", "in", "model.stroll"]


# ---- signals ----
def hear_all():
    """The test itself may run where some are ignored, as in a script's background."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for number in SIGNALS:
        signal.signal(number, signal.SIG_DFL)


def stop(words, number, ready):
    """Sends the signal once ready() holds; the child's exit status and standard error."""
    child = subprocess.Popen([STROLL, *words, "--quiet"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                             preexec_fn=hear_all)
    while not ready() and child.poll() is None:
        time.sleep(0.0005)
    child.send_signal(number)
    _, error = child.communicate(timeout=PATIENCE_S)
    return child.returncode, error


def after(seconds):
    """What holds from then on."""
    start = time.monotonic()
    return lambda: time.monotonic() > start + seconds


def assert_stopped(words, number, ready=None):
    """Without `ready` some time after the start: less where the child was done already, more where it did not listen yet."""
    seconds = 0.3
    for _ in range(40):
        code, error = stop(words, number, ready or after(seconds))
        if code not in (0, -number):
            break
        seconds *= 0.7 if code == 0 else 1.3
    assert code == 1 and error == "stroll: interrupted\n", (words, number, code, error)


def a_signal_leaves_nothing_behind(folder, writers):
    for writer in writers:
        if writer.name in ("image", "cameras"): # done in an instant
            continue
        for number in SIGNALS:
            place = fresh(folder, f"{writer.name}{number}")
            out = place + "/out" + writer.ending
            assert_stopped([*writer.long, out], number, lambda: set(os.listdir(place)) - {os.path.basename(out)})
            assert set(os.listdir(place)) <= {os.path.basename(out)}, os.listdir(place)
            shutil.rmtree(place)
            put_older = fresh(folder, f"older{writer.name}{number}")
            out = put_older + "/out" + writer.ending
            put(out, "older")
            code, _ = stop([*writer.long, out], number, lambda: len(os.listdir(put_older)) > 1)
            assert os.listdir(put_older) == [os.path.basename(out)]
            assert code == 0 or content(out) == b"older"


def stopped_images_are_whole(folder, writers):
    model = writers[1].words[1]
    depth_bytes = len(b"Pf\n64 48\n-1.0\n") + 64 * 48 * 4
    for number in SIGNALS:
        place = folder + f"/orbit{number}"
        words = ["render", model, "--path", "orbit", "--frames", "3000", "--size", "64x48", "--depth", "-o", place]
        assert_stopped(words, number, lambda: os.path.exists(place + "/frame_00003.png"))
        for name in os.listdir(place):
            data = content(place + "/" + name)
            assert name.startswith("frame_0"), name
            whole = data.endswith(b"IEND\xaeB`\x82") if name.endswith(".png") else len(data) == depth_bytes
            assert whole, name
    # before the first image nothing is left, the new folder included
    assert_stopped(["render", writers[0].words[1], "--full", "--path", "walk", "--frames", "2000", "-o",
                    folder + "/new"], signal.SIGINT)
    assert not os.path.exists(folder + "/new") or os.listdir(folder + "/new")


def verify_and_compare_end_by_signals(folder, writers):
    model, source = writers[1].words[1], writers[0].words[1]
    before = every_file(os.path.dirname(model)).keys()
    for number in SIGNALS:
        assert_stopped(["verify", model, "--against", source], number)
        assert every_file(os.path.dirname(model)).keys() == before
    place = folder + "/images"
    must("render", model, "--path", "orbit", "--frames", "40", "--size", "640x480", "--depth", "-o", place)
    assert_stopped(["compare", place, place], signal.SIGTERM)


def what_was_ignored_before_stays_so(folder, writers):
    """As the hangup under nohup, and Ctrl-C in a script's background."""
    def ignore_all():
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)

    child = subprocess.Popen([STROLL, *writers[0].words, folder + "/out.stroll", "--quiet"], preexec_fn=ignore_all)
    while not os.path.exists(folder + "/out.stroll.tmp/lock"):
        assert child.poll() is None
        time.sleep(0.001)
    for number in SIGNALS:
        child.send_signal(number)
    assert child.wait() == 0 and os.listdir(folder) == ["out.stroll"]


def a_second_ctrl_c_ends_the_process(folder, writers):
    """Asked of one that does not come to its next step: it waits for somebody to read its standard output."""
    reading, writing = os.pipe()
    fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, 4096)
    os.set_blocking(writing, False)
    try:
        while True:
            os.write(writing, b"x" * 512)
    except BlockingIOError:
        os.set_blocking(writing, True)
    for number in (signal.SIGINT, signal.SIGQUIT):
        out = f"{folder}/out{number}.stroll"
        child = subprocess.Popen([STROLL, *writers[0].words, out, "--json"], stdout=writing, stderr=subprocess.DEVNULL,
                                 preexec_fn=hear_all)
        try:
            while not os.path.exists(out): # then it prints
                assert child.poll() is None
                time.sleep(0.01)
            time.sleep(0.2)
            child.send_signal(number)
            time.sleep(0.2)
            assert child.poll() is None, "the first one asks"
            child.send_signal(number)
            assert child.wait(timeout=PATIENCE_S) == -number
        finally:
            child.kill()
    os.close(reading)
    os.close(writing)


def a_full_standard_output_is_one_sentence(folder, writers):
    def no_bytes():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))

    for words in (["info", writers[1].words[1], "--json"], ["info", writers[1].words[1]], ["--help"]):
        with open(folder + "/full", "w") as full:
            done = subprocess.run([STROLL, *words], stdout=full, stderr=subprocess.PIPE, text=True, preexec_fn=no_bytes)
        assert done.returncode == 1 and done.stderr.count("\n") == 1, done


FILES = (what_is_no_place_for_a_file_is_refused_before_any_work, a_folder_is_no_file, without_rights_nothing_is_begun,
         images_go_to_a_png_or_into_a_folder, an_empty_input_is_named, a_link_is_followed_and_stays,
         files_with_names_of_helpers_stay, a_foreign_scratch_folder_is_refused_and_stays,
         what_came_into_a_scratch_folder_meanwhile_stays, a_scratch_option_names_the_place_and_is_made_for_the_time,
         a_full_standard_output_is_one_sentence)
# Many commands that are long enough to be stopped.
SIGNALLED = (what_a_killed_build_left_is_taken_over, a_signal_leaves_nothing_behind, stopped_images_are_whole,
             verify_and_compare_end_by_signals, what_was_ignored_before_stays_so, a_second_ctrl_c_ends_the_process)


def main():
    failed = 0
    with tempfile.TemporaryDirectory(prefix="stroll-outputs-") as data:
        os.chmod(data, 0o755)
        writers = make_writers(data)
        for test in FILES + (() if sanitized.sanitizers(STROLL) else SIGNALLED):
            with tempfile.TemporaryDirectory(prefix="stroll-outputs-") as folder:
                start = time.monotonic()
                try:
                    test(folder, writers)
                    print(f"[       OK ] {test.__name__} ({time.monotonic() - start:.1f} s)", flush=True)
                except Exception: # the others are run too
                    failed += 1
                    print(f"[  FAILED  ] {test.__name__}\n{traceback.format_exc()}", flush=True)
    return 1 if failed else 0


sys.exit(main())
