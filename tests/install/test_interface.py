#!/usr/bin/env python3
"""The public interface: each header can be included alone in C and C++, and the shared libraries show what the headers declare
and nothing else.

usage: test_interface.py PROGRAM      in the folder of the build"""
import os
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(os.environ["STRL_TEST_ROOT"])
INCLUDE = ROOT / "include"
COMPILERS = {"c": ["-std=c17"], "c++": ["-std=c++17"]}
failures = 0


def check(claim, good, detail=""):
    global failures
    print(f"{'ok    ' if good else 'FAILED'} {claim}{'' if good else ': ' + str(detail)}")
    failures += not good


def cached(name):
    return re.search(rf"^{name}:[A-Z]+=(.*)$", pathlib.Path("CMakeCache.txt").read_text(), re.M)[1]


def headers_stand_alone():
    compilers = {"c": cached("CMAKE_C_COMPILER"), "c++": cached("CMAKE_CXX_COMPILER")}
    for header in sorted(INCLUDE.glob("stroll/*.h")):
        text = f'#include "stroll/{header.name}"\n#include "stroll/{header.name}"\nint something_else;\n'
        for language, standard in COMPILERS.items():
            result = subprocess.run([compilers[language], *standard, "-Wall", "-Wextra", "-pedantic", "-Werror", "-fsyntax-only",
                                     "-I", INCLUDE, "-x", language, "-"], input=text, text=True, stderr=subprocess.PIPE)
            check(f"{header.name} alone is {language}", result.returncode == 0, result.stderr)


def stroll_h_is_over_all():
    text = (INCLUDE / "stroll/stroll.h").read_text()
    for header in INCLUDE.glob("stroll/*.h"):
        check(f"stroll.h includes {header.name}", header.name == "stroll.h" or f'"stroll/{header.name}"' in text)


def code_of(header):
    return re.sub(r"/\*.*?\*/", "", header.read_text(), flags=re.S)


def declared(headers):
    """Functions: a name before a parenthesis, outside of structs and typedefs, at the beginning of a line."""
    names = set()
    for header in headers:
        for line in code_of(header).split("\n"):
            found = re.match(r"^(STRL_API )?\w[\w ]*[ *](strl_\w+)\(", line)
            if found and not line.startswith("typedef"):
                check(f"{found[2]} carries STRL_API", found[1])
                names.add(found[2])
    return names


def symbols(library, *words):
    """Weak ones, which templates of C++ libraries leave, meet anybody else's in peace: they do not count."""
    out = subprocess.run(["nm", *words, "--defined-only", library], stdout=subprocess.PIPE, check=True, text=True).stdout
    return {line.split()[2].split("@")[0] for line in out.split("\n") if re.match(r"^[0-9a-f]+ [ABCDGRST] ", line)}


def libraries_show_the_headers():
    build = [INCLUDE / "stroll/build.h"]
    rest = [path for path in INCLUDE.glob("stroll/*.h") if path not in build]
    for library, headers in (("libstroll.so", rest), ("libstroll_build.so", build)):
        expected, found = declared(headers), symbols(library, "-D")
        check(f"{library} shows each function that is declared", expected and expected <= found, expected - found)
        check(f"{library} shows nothing else", found <= expected, found - expected)


def archives_keep_to_our_names():
    for library in ("libstroll.a", "libstroll_build.a"):
        foreign = {name for name in symbols(library, "-g") if not name.startswith("strl_")}
        check(f"every name in {library} begins with strl_", not foreign, foreign)


def version_is_one():
    text = (INCLUDE / "stroll/version.h").read_text()
    parts = [re.search(rf"STRL_VERSION_{part} (\d+)", text)[1] for part in ("MAJOR", "MINOR", "PATCH")]
    check("the parts of the version make its text", f'STRL_VERSION "{".".join(parts)}"' in text, parts)
    said = subprocess.run([sys.argv[1], "--version"], stdout=subprocess.PIPE, check=True, text=True).stdout
    check("the program says the same", said == f"stroll {'.'.join(parts)}\n", said)


def main():
    headers_stand_alone()
    stroll_h_is_over_all()
    version_is_one()
    libraries_show_the_headers()
    if cached("STRL_SANITIZE"):
        print("not looked at: the archives' names, which sanitizers add to")
    else:
        archives_keep_to_our_names()
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
