#!/usr/bin/env python3
"""What a person sees of `stroll build` on a terminal: an estimate, then one line that only ever advances.

usage: test_build_terminal.py PROGRAM. Nothing here depends on how fast anything is."""
import fcntl
import os
import pty
import re
import struct
import subprocess
import sys
import tempfile
import termios

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "support"))
import sanitized

STROLL = os.path.abspath(sys.argv[1])
LINE = re.compile(r"(\d)/(\d) (\w[\w ]*?) +(?:\[[#-]+\] +)? *(\d+) %(?:  [\d.]+(?: [KMG])? triangles/s)?(?:  left [\d:]+)?"
                  r"  mem ([\d.]+[KMG])/1G  scratch ([\d.]+[KMG])")
if sanitized.sanitizers(STROLL):
    print("skipped: what a person sees is the same without sanitizers")
    sys.exit(77)
failures = 0


def check(claim, holds, detail=""):
    global failures
    print("%s %s" % ("ok  " if holds else "FAIL", claim))
    if not holds:
        failures += 1
        print("     %r" % (detail,))


def on_terminal(*words):
    """All that a terminal of 200 columns gets, standard output included."""
    child, terminal = pty.fork()
    if child == 0:
        fcntl.ioctl(2, termios.TIOCSWINSZ, struct.pack("HHHH", 25, 200, 0, 0))
        os.execv(STROLL, [STROLL, *words])
    shown = b""
    while True:
        try:
            part = os.read(terminal, 65536)
        except OSError:
            break
        if not part:
            break
        shown += part
    _, status = os.waitpid(child, 0)
    os.close(terminal)
    check(f"{words[0]} ends well", os.waitstatus_to_exitcode(status) == 0, shown)
    return shown.decode()


def main():
    with tempfile.TemporaryDirectory() as folder:
        source, output = folder + "/in.ply", folder + "/out.stroll"
        subprocess.run([STROLL, "scene", "isosurface", "-n", "150K", "-o", source, "--quiet"], check=True)
        shown = on_terminal("build", source, "-o", output)
        first, _, rest = shown.partition("\r\n")
        check("the estimate comes first", re.fullmatch(r"about 1\d\d K triangles: up to 1[12]M of scratch, [\d.]+[KMGTP] free"
                                                       r"[\w ]*; some \d+:\d\d", first), first)
        lines = [part for part in rest.split("\r\x1b[K") if "/7 " in part]
        found = [LINE.fullmatch(line.strip()) for line in lines]
        check("every line says stage, share, memory and scratch", lines and all(found), lines)
        found = [match for match in found if match]
        numbers = [(int(match[1]), int(match[4])) for match in found]
        check("stage and share only grow", numbers == sorted(numbers) and all(match[2] == "7" for match in found), numbers)
        check("the line is gone at the end", "\r\x1b[K" + output in shown, shown[-400:])
        quiet = on_terminal("build", source, "-o", output, "--quiet")
        check("--quiet shows nothing", quiet == "", quiet)
        done = subprocess.run([STROLL, "build", source, "-o", output], capture_output=True, text=True)
        check("without a terminal a short build says nothing but its result", done.stderr == "" and
              done.stdout.startswith(output), done)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
