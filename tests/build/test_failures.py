#!/usr/bin/env python3
"""A build that fails says so in one sentence, exits with 1, and leaves the folder as it found it."""
import os
import shutil
import signal
import subprocess
import time

from building import NotHere, STROLL, assert_refused, build, must, run, run_tests, sanitizers, write_box_stl, write_grid_obj

OLDER = b"an older container"
PATIENCE_S = 600  # a machine may be slow; what waits longer hangs


def older_output(folder):
    path = os.path.join(folder, "out.stroll")
    with open(path, "wb") as file:
        file.write(OLDER)
    return path


def read(path):
    with open(path, "rb") as file:
        return file.read()


def refused(folder, *words, holds=(), **options):
    """Refused, with the folder's names and the older output, where there is one, as before."""
    before = sorted(os.listdir(folder))
    done = run("build", *words, timeout=120, **options)
    assert_refused(done, *holds)
    assert sorted(os.listdir(folder)) == before, (os.listdir(folder), done)
    if os.path.exists(os.path.join(folder, "out.stroll")):
        assert read(os.path.join(folder, "out.stroll")) == OLDER
    return done


def an_output_equal_to_an_input_is_refused(folder):
    source, other = (os.path.join(folder, name) for name in ("in.stl", "other.obj"))
    write_box_stl(source)
    write_grid_obj(other, 3)
    bytes_before = read(source)
    os.link(source, os.path.join(folder, "hard.stl"))
    os.symlink("in.stl", os.path.join(folder, "soft.stl"))
    for name in ("in.stl", "hard.stl", "soft.stl", "../" + os.path.basename(folder) + "/in.stl"):
        refused(folder, other, source, "-o", os.path.join(folder, name), holds=["is the input"])
        assert read(source) == bytes_before


def what_is_no_input_is_refused(folder):
    out = older_output(folder)
    empty, zeros, inner = (os.path.join(folder, name) for name in ("empty.ply", "zeros.stl", "inner"))
    open(empty, "wb").close()
    with open(zeros, "wb") as file:
        file.write(bytes(4000))
    os.mkdir(inner)
    refused(folder, os.path.join(folder, "absent.ply"), "-o", out, holds=["absent.ply"])
    refused(folder, empty, "-o", out, holds=["empty.ply"])
    refused(folder, zeros, "-o", out, holds=["zeros.stl"])
    refused(folder, inner, "-o", out, holds=["inner"])
    refused(folder, "/dev/null", "-o", out, holds=["/dev/null"])


def a_pipe_as_input_does_not_hang(folder):
    out = older_output(folder)
    os.mkfifo(os.path.join(folder, "pipe.ply"))
    refused(folder, os.path.join(folder, "pipe.ply"), "-o", out, holds=["pipe.ply"])


def a_place_that_cannot_be_written_is_refused(folder):
    source = os.path.join(folder, "in.stl")
    write_box_stl(source)
    os.mkdir(os.path.join(folder, "inner"))
    refused(folder, source, "-o", os.path.join(folder, "inner"), holds=["inner"])
    refused(folder, source, "-o", os.path.join(folder, "no", "such", "out.stroll"), holds=["no/such"])
    refused(folder, source, "-o", os.path.join(folder, "in.stl", "out.stroll"), holds=["in.stl"])
    refused(folder, source, "-o", os.path.join(folder, "out.stroll"), "--scratch", source, holds=["in.stl"])


def without_rights_it_is_refused(folder):
    """Root reads everything: the child becomes somebody else."""
    prefix = []
    if os.geteuid() == 0:
        if not shutil.which("setpriv"):
            raise NotHere("no setpriv: rights not tested")
        prefix = ["setpriv", "--reuid", "65534", "--clear-groups"]
    source, closed = os.path.join(folder, "in.stl"), os.path.join(folder, "closed")
    write_box_stl(source)
    os.mkdir(closed)
    os.chmod(folder, 0o777)
    os.chmod(closed, 0o555)
    os.chmod(source, 0o000)
    program_runs = subprocess.run([*prefix, STROLL, "--version"], stdout=subprocess.DEVNULL).returncode == 0
    if not program_runs:
        raise NotHere("nobody cannot run the program from here: rights not tested")
    refused(folder, source, "-o", os.path.join(folder, "new.stroll"), holds=["in.stl"], prefix=prefix)
    os.chmod(source, 0o444)
    refused(folder, source, "-o", os.path.join(closed, "new.stroll"), holds=["closed"], prefix=prefix)
    assert os.listdir(closed) == []
    must("build", source, "-o", os.path.join(folder, "new.stroll"), "--quiet", prefix=prefix)


def an_older_output_stays_when_the_build_fails(folder):
    """Broken in its last face: everything before was read, sorted and may have been spilled."""
    out = older_output(folder)
    source = os.path.join(folder, "broken.obj")
    write_grid_obj(source, 60)
    with open(source, "a") as file:
        file.write("f 1 2 99999999\n")
    done = refused(folder, source, "-o", out, holds=["broken.obj"])
    assert "99999999" in done.error, done


def a_limit_on_the_size_of_files_is_one_sentence(folder):
    """The system ends a program that passes it by a signal, unless the signal is ignored."""
    source = os.path.join(folder, "in.obj")
    write_grid_obj(source, 250)
    out = os.path.join(folder, "out.stroll")
    refused(folder, source, "-o", out, holds=["out.stroll"], prefix=["sh", "-c", 'ulimit -f 512; exec "$@"', "sh"])
    assert not os.path.exists(out + ".tmp")


def standard_output_is_no_output(folder):
    source = os.path.join(folder, "in.stl")
    write_box_stl(source)
    refused(folder, source, "-o", "-", holds=["standard output"])


def a_full_disk_is_one_sentence(folder):
    if os.geteuid() != 0:
        raise NotHere("not root: no small disk to fill")
    source = os.path.join(folder, "in.obj")
    write_grid_obj(source, 250)
    for megabytes, scratch_elsewhere in ((2, False), (1, True), (6, False)):
        disk, elsewhere = os.path.join(folder, "disk"), os.path.join(folder, "elsewhere")
        os.makedirs(disk, exist_ok=True)
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={megabytes}m", "tmpfs", disk],
                                 stderr=subprocess.DEVNULL)
        if mounted.returncode:
            raise NotHere("mount is not allowed: no small disk to fill")
        try:
            if scratch_elsewhere:
                with open(os.path.join(disk, "filler"), "wb") as file:
                    file.write(bytes(900 << 10))
            out = older_output(disk) if megabytes == 6 else os.path.join(disk, "out.stroll")
            done = refused(disk, source, "-o", out, *(["--scratch", elsewhere] if scratch_elsewhere else []))
            assert ("--resume" in done.error) == scratch_elsewhere, done # the others have finished nothing
            if scratch_elsewhere:
                assert os.listdir(elsewhere) == ["out.stroll.tmp"]
        finally:
            subprocess.run(["umount", disk], check=True)


def files_of_others_in_the_scratch_folder_stay(folder):
    scratch = os.path.join(folder, "scratch")
    os.mkdir(scratch)
    with open(os.path.join(scratch, "letter.txt"), "w") as file:
        file.write("precious")
    source = os.path.join(folder, "in.stl")
    write_box_stl(source)
    build(source, os.path.join(folder, "out.stroll"), "--scratch", scratch)
    assert os.listdir(scratch) == ["letter.txt"]


# ---- stopped on the way ----
LONG = "100K" if sanitizers() else "400K"  # long enough to be stopped in any stage


def start_long_build(folder, out):
    source = os.path.join(folder, "long.ply")
    if not os.path.exists(source):
        must("scene", "isosurface", "--triangles", LONG, "-o", source, "--quiet")
    child = subprocess.Popen([STROLL, "build", source, "-o", out], stdout=subprocess.PIPE,
                             stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + PATIENCE_S
    while not os.path.exists(out + ".tmp/lock"):
        assert child.poll() is None and time.monotonic() < deadline
        time.sleep(0.002)
    return child


def seconds_of_long_build(folder):
    """Of a whole one, here and now."""
    out = os.path.join(folder, "whole.stroll")
    child = start_long_build(folder, out)
    start = time.monotonic()
    _, error = child.communicate(timeout=PATIENCE_S)
    assert child.returncode == 0, error
    os.remove(out)
    return time.monotonic() - start


def signals_stop_a_build_cleanly(folder):
    """At the start it is always stopped; later it may be done already, where the machine's other work came and went."""
    seconds = seconds_of_long_build(folder)
    out = older_output(folder)
    for number, share in ((signal.SIGINT, 0), (signal.SIGTERM, 0.05), (signal.SIGHUP, 0.2), (signal.SIGQUIT, 0.45),
                          (signal.SIGTERM, 0.7)):
        child = start_long_build(folder, out)
        time.sleep(share * seconds)
        child.send_signal(number)
        _, error = child.communicate(timeout=PATIENCE_S)
        if child.returncode == 0 and share > 0:
            older_output(folder)
            continue
        assert child.returncode == 1, (child.returncode, error)
        assert error.count("\n") == 1 and "interrupted" in error, error
        left = ["long.ply", "out.stroll"] + (["out.stroll.tmp"] if "--resume" in error else [])
        assert sorted(os.listdir(folder)) == left, os.listdir(folder)
        assert read(out) == OLDER


def a_second_build_of_the_same_output_is_refused(folder):
    out = os.path.join(folder, "out.stroll")
    other = os.path.join(folder, "in.stl")
    write_box_stl(other)
    child = start_long_build(folder, out)
    assert_refused(run("build", other, "-o", out), "lock")
    _, error = child.communicate(timeout=PATIENCE_S)
    assert child.returncode == 0, error
    must("info", out)
    assert sorted(os.listdir(folder)) == ["in.stl", "long.ply", "out.stroll"]


def what_a_killed_build_left_does_no_harm(folder):
    out = older_output(folder)
    child = start_long_build(folder, out)
    while not any(name.endswith(".spill") for name in os.listdir(out + ".tmp")):
        assert child.poll() is None, "the build was over before it could be killed"
        time.sleep(0.002)
    child.kill()
    child.communicate()
    assert read(out) == OLDER
    clean = os.path.join(folder, "clean.stroll")
    build(os.path.join(folder, "long.ply"), clean)
    build(os.path.join(folder, "long.ply"), out)
    assert read(out) == read(clean)
    assert sorted(os.listdir(folder)) == ["clean.stroll", "long.ply", "out.stroll"]


def mistakes_on_the_command_line_exit_with_2(folder):
    source = os.path.join(folder, "in.stl")
    write_box_stl(source)
    out = os.path.join(folder, "out.stroll")
    for words in ([source], ["-o", out], [source, "-o", out, "--memory", "1K"], [source, "-o", out, "--jobs", "0"],
                  [source, "-o", out, "--grid", "-1"], [source, "-o", out, "--up", "w"],
                  [source, "-o", out, "--nonsense"],
                  [source, "-o", out, "--structure", "pudding"]):
        done = run("build", *words)
        assert done.code == 2 and done.error, done
    assert os.listdir(folder) == ["in.stl"]


run_tests(an_output_equal_to_an_input_is_refused, what_is_no_input_is_refused, a_pipe_as_input_does_not_hang,
          a_place_that_cannot_be_written_is_refused, without_rights_it_is_refused,
          an_older_output_stays_when_the_build_fails, a_limit_on_the_size_of_files_is_one_sentence, standard_output_is_no_output,
          a_full_disk_is_one_sentence,
          files_of_others_in_the_scratch_folder_stay, signals_stop_a_build_cleanly,
          a_second_build_of_the_same_output_is_refused, what_a_killed_build_left_does_no_harm,
          mistakes_on_the_command_line_exit_with_2)
