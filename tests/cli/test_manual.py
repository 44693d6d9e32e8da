#!/usr/bin/env python3
"""Manual pages and shell completion say what --help says: every command, every option, no other. The help is read
here in another way than tools/manual.py reads it.

usage: test_manual.py PROGRAM      in the folder of the build"""
import pathlib
import re
import shutil
import subprocess
import sys

MANUAL = pathlib.Path("manual")
failures = 0


def check(claim, good, detail=""):
    global failures
    print(f"{'ok    ' if good else 'FAILED'} {claim}{'' if good else ': ' + str(detail)}", flush=True)
    failures += not good


def help_of(program, *words):
    return subprocess.run([program, *words, "--help"], stdout=subprocess.PIPE, check=True, text=True).stdout


def commands_of(program):
    """Those that main's help lists: two spaces, a word, its summary."""
    return [line.split()[0] for line in help_of(program).split("\n") if line.startswith("  ")]


def options_of(program, command):
    """{--name: letter or None}: lines that begin with at most six spaces and an option."""
    options = {}
    for line in help_of(program, command).split("\n"):
        words = line.split()
        if words and re.match(r"^ {2,6}-", line):
            letter = words[0][:2] if words[0].endswith(",") else None
            options[words[1] if letter else words[0]] = letter
    return options


# ---- manual pages

def pages_have_each_option(command, options):
    page = (MANUAL / f"man/stroll-{command}.1").read_text().replace("\\-", "-")
    part = page.partition(".SH OPTIONS\n")[2].partition("\n.SH ")[0]
    lines = [line for line in part.split("\n") if line.startswith("\\fB-")]
    found = {re.search(r"\\fB(--[a-z0-9-]+)", line)[1]: (re.match(r"\\fB(-\w)\\fR, ", line) or [0, None])[1]
             for line in lines}
    check(f"stroll-{command}.1 has the options of --help", found == options, (found, options))
    check(f"stroll-{command}.1 explains each option", all(text.strip() for text in re.split(r"\n?\.TP\n.*\n", part)[1:]), part)


def main_page_names_each_command(program, commands):
    page = (MANUAL / "man/stroll.1").read_text()
    check("stroll.1 names each command", re.findall(r"^\.BR stroll\\-(\w+) \(1\)$", page, re.M) == commands)
    check("stroll.1 has no place left to fill in", "@" not in page)
    for option in re.findall(r"\\-\\-([a-z][a-z\\-]*)", page):
        name = "--" + option.replace("\\", "")
        known = name in ("--help", "--version") or any(name in options_of(program, command) for command in commands)
        check(f"{name} of stroll.1 is there", known)


def pages_are_well_formed():
    if not shutil.which("groff"):
        print("not looked at: what groff warns of (it is missing)")
        return
    for page in sorted(MANUAL.glob("man/*.1")):
        words = ["groff", "-man", "-Tascii", "-ww", "-z", "-rLL=200n", page]
        result = subprocess.run(words, stderr=subprocess.PIPE, text=True)
        check(f"groff finds nothing amiss in {page.name}", result.returncode == 0 and not result.stderr, result.stderr)


# ---- completion

def bash_completes(words):
    """What bash offers for the last of the words."""
    script = f"source {MANUAL}/completion/stroll.bash; COMP_WORDS=(\"$@\"); COMP_CWORD=$(($# - 1)); _stroll; " \
             "printf '%s\\n' \"${COMPREPLY[@]}\""
    out = subprocess.run(["bash", "--norc", "-c", script, "bash", *words], stdout=subprocess.PIPE, check=True, text=True).stdout
    return sorted(line for line in out.split("\n") if line)


def bash_offers_each_option(command, options):
    expected = sorted([*options, *filter(None, options.values())])
    found = bash_completes(["stroll", command, "-"])
    check(f"bash offers the options of {command}", found == expected, (found, expected))


def bash_offers_words(commands):
    check("bash offers the commands", bash_completes(["stroll", ""]) == sorted([*commands, "--help", "--version"]))
    check("bash completes a command", bash_completes(["stroll", "ver"]) == ["verify"])
    check("bash offers the words of an option", bash_completes(["stroll", "build", "--up", ""]) == ["auto", "x", "y", "z"])
    check("bash offers the scenes", "isosurface" in bash_completes(["stroll", "scene", ""]))
    check("bash offers files for a model", bash_completes(["stroll", "info", "CMakeCach"]) == ["CMakeCache.txt"])
    check("bash offers files behind an option", bash_completes(["stroll", "build", "-o", "CMakeCach"]) == ["CMakeCache.txt"])
    found = bash_completes(["stroll", "build", "--scratch", "CMakeF"])
    check("bash offers folders alone where one is wanted", found == ["CMakeFiles"], found)


def texts_have_each_option(command, options):
    zsh = (MANUAL / "completion/_stroll").read_text()
    part = re.search(rf"^  {command}\)\n(.*?);;$", zsh, re.M | re.S)[1]
    found = set(re.findall(r"^      '(?:\([^)]*\))?(--?[a-z0-9-]+)\[", part, re.M))
    expected = {*options, *filter(None, options.values())}
    check(f"zsh has the options of {command}", found == expected, (found, expected))
    fish = (MANUAL / "completion/stroll.fish").read_text()
    lines = re.findall(rf"^complete -c stroll -n '__fish_seen_subcommand_from {command}' -l (\S+)(?: -s (\w))?", fish, re.M)
    found = {"--" + name: "-" + letter if letter else None for name, letter in lines}
    check(f"fish has the options of {command}", found == options, (found, options))


def shells_can_read_them():
    for shell, file in (("bash", "stroll.bash"), ("zsh", "_stroll"), ("fish", "stroll.fish")):
        if not shutil.which(shell):
            print(f"not looked at: whether {shell} can read its file (it is missing)")
            continue
        result = subprocess.run([shell, "-n", MANUAL / "completion" / file], stderr=subprocess.PIPE, text=True)
        check(f"{shell} can read {file}", result.returncode == 0 and not result.stderr, result.stderr)


def main():
    program = sys.argv[1]
    commands = commands_of(program)
    check("there are commands", len(commands) >= 9, commands)
    main_page_names_each_command(program, commands)
    for command in commands:
        options = options_of(program, command)
        check(f"{command} has options", {"--help": "-h", "--quiet": "-q"}.items() <= options.items(), options)
        pages_have_each_option(command, options)
        bash_offers_each_option(command, options)
        texts_have_each_option(command, options)
    bash_offers_words(commands)
    pages_are_well_formed()
    shells_can_read_them()
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
