#!/usr/bin/env python3
"""Writes the manual pages and the shells' completion from what the program says of itself with --help.

    tools/manual.py --program build/stroll --out build/manual

OUT/man/stroll.1, the prose of docs/man/stroll.1.in with the table of commands; OUT/man/stroll-COMMAND.1, one a command;
OUT/completion/stroll.bash, _stroll (zsh), stroll.fish. --help is the one place where options are declared, so that none of
these can say anything else."""
import argparse
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
OPTION = re.compile(r"^  (?:-(?P<letter>\w),|   ) --(?P<name>[a-z0-9-]+)(?: (?P<argument>\S.*?))?(?:  +(?P<help>\S.*))?$")


class Option:
    def __init__(self, match):
        self.letter, self.name = match["letter"], match["name"]
        self.argument, self.help = match["argument"] or "", match["help"] or ""

    @property
    def choices(self):
        """Words that may be given as they stand: of auto|x|y|z all, of FILE|orbit only orbit."""
        words = self.argument.strip("[]").split("|") if "|" in self.argument or self.argument.islower() else []
        return [word for word in words if re.fullmatch(r"[a-z0-9][a-z0-9-]*", word)]

    @property
    def is_folder(self):
        return self.argument == "DIR"

    @property
    def is_file(self):
        return bool(re.search(r"FILE|OUT\.|INPUT|PNG|DB", self.argument))


class Command:
    """One command, as `stroll COMMAND --help` has it."""

    def __init__(self, program, name, summary):
        self.name, self.summary = name, summary
        text = output_of(program, name, "--help")
        head, _, rest = text.partition("options:\n")
        usage = re.search(r"^usage: stroll \S+ (.*)\[options\]$", head, re.M)
        if not usage or not rest:
            sys.exit(f"manual: the help of {name} has no usage line or no options")
        self.positional = usage[1].strip()
        self.options, notes = [], []
        lines = rest.split("\n")
        while lines and lines[0]:
            self.take_option(lines)
        self.notes = "\n".join(lines).strip("\n")

    def take_option(self, lines):
        line = lines.pop(0)
        match = OPTION.match(line)
        if not match:
            sys.exit(f"manual: {self.name}: not an option: {line!r}")
        option = Option(match)
        if not option.help and lines and lines[0].startswith(" " * 30):
            option.help = lines.pop(0).strip()
        self.options.append(option)

    @property
    def names(self):
        """What may stand for NAME, where the notes list it: two spaces, a word, its meaning."""
        return re.findall(r"^  ([a-z][a-z0-9-]*) {2,}\S", self.notes, re.M) if "NAME" in self.positional else []


def output_of(program, *words):
    return subprocess.run([program, *words], stdout=subprocess.PIPE, check=True, text=True).stdout


def read_commands(program):
    listed = output_of(program, "--help").partition("commands:\n")[2].partition("\n\n")[0]
    return [Command(program, *re.match(r"^  (\S+) +(.*)$", line).groups()) for line in listed.split("\n")]


# ---- manual pages

def roff(text):
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return re.sub(r"^(['.])", r"\\&\1", text, flags=re.M)


def title(name, version):
    return f'.\\" Written from {name.replace("-", " ")} --help.\n.TH {name.upper()} 1 "" "Stroll {version}" "Stroll"\n'


def roff_option(option):
    letter = f"\\fB\\-{option.letter}\\fR, " if option.letter else ""
    argument = f" \\fI{roff(option.argument)}\\fR" if option.argument else ""
    return f".TP\n{letter}\\fB\\-\\-{roff(option.name)}\\fR{argument}\n{roff(option.help)}\n"


def page_of(command, version):
    text = title("stroll-" + command.name, version)
    text += f".SH NAME\nstroll\\-{command.name} \\- {roff(command.summary)}\n"
    text += f".SH SYNOPSIS\n.B stroll {command.name}\n"
    text += f".I {roff(command.positional)}\n" if command.positional else ""
    text += "[options]\n.SH OPTIONS\n" + "".join(map(roff_option, command.options))
    if command.notes:
        text += ".SH NOTES\n.nf\n" + roff(command.notes) + "\n.fi\n"
    text += ".SH EXIT STATUS\n0 done, 1 failed with one sentence on standard error, 2 wrong usage.\n"
    return text + ".SH SEE ALSO\n.BR stroll (1)\n"


def main_page(commands, version):
    table = "".join(f".TP\n.BR stroll\\-{command.name} (1)\n{roff(command.summary)}\n" for command in commands)
    prose = (ROOT / "docs/man/stroll.1.in").read_text()
    return prose.replace("@VERSION@", version).replace("@COMMANDS@\n", table)


# ---- completion

def words_of(command):
    words = []
    for option in command.options:
        words += [f"-{option.letter}"] if option.letter else []
        words.append("--" + option.name)
    return words


def bash_values(command):
    """Cases of COMMAND:OPTION that take a value."""
    cases = ""
    for option in command.options:
        if not option.argument:
            continue
        pattern = f"{command.name}:--{option.name}" + (f"|{command.name}:-{option.letter}" if option.letter else "")
        action = []
        if option.choices:
            action.append(f"_stroll_words \"{' '.join(option.choices)}\"")
        if option.is_folder or option.is_file:
            action.append("_stroll_folders" if option.is_folder else "_stroll_files")
        elif not option.choices and option.argument.startswith("["):
            continue # may be left out, and is a number
        cases += f"    {pattern}) {'; '.join(action + ['return'])} ;;\n"
    return cases


def bash_completion(commands):
    names = " ".join(command.name for command in commands)
    values = "".join(map(bash_values, commands))
    options = "".join(f"    {c.name}) options=\"{' '.join(words_of(c))}\" names=\"{' '.join(c.names)}\" ;;\n"
                      for c in commands)
    return f"""# bash completion of stroll
_stroll_words() {{ mapfile -t -O ${{#COMPREPLY[@]}} COMPREPLY < <(compgen -W "$1" -- "$current"); }}
_stroll_files() {{ mapfile -t -O ${{#COMPREPLY[@]}} COMPREPLY < <(compgen -f -- "$current"); compopt -o filenames 2>/dev/null; }}
_stroll_folders() {{ mapfile -t -O ${{#COMPREPLY[@]}} COMPREPLY < <(compgen -d -- "$current"); compopt -o filenames 2>/dev/null; }}
_stroll() {{
    local current=${{COMP_WORDS[COMP_CWORD]}} command=${{COMP_WORDS[1]}} options= names=
    COMPREPLY=()
    if ((COMP_CWORD == 1)); then
        _stroll_words "{names} --help --version"
        return
    fi
    case $command:${{COMP_WORDS[COMP_CWORD - 1]}} in
{values}    esac
    case $command in
{options}    esac
    if [[ $current == -* ]]; then
        _stroll_words "$options"
    elif [[ $names ]]; then
        _stroll_words "$names"
    else
        _stroll_files
    fi
}}
complete -F _stroll stroll
"""


def quoted(text):
    return text.replace("'", "'\\''")


def zsh_action(option):
    if option.is_folder:
        return "_files -/"
    if option.choices:
        return "{_values value " + " ".join(option.choices) + "; _files}" if option.is_file \
            else "(" + " ".join(option.choices) + ")"
    return "_files" if option.is_file else " "


def zsh_option(option):
    help_text = re.sub(r"([\[\]:\\])", r"\\\1", option.help)
    value = ""
    if option.argument:
        label = re.sub(r"([:\\])", r"\\\1", option.argument.strip("[]"))
        value = ("::" if option.argument.startswith("[") else ":") + f"{label}:{zsh_action(option)}"
    names = [f"-{option.letter}"] if option.letter else []
    names.append("--" + option.name)
    group = f"({' '.join(names)})" if len(names) > 1 else ""
    return [f"'{quoted(group + name + '[' + help_text + ']' + value)}'" for name in names]


def zsh_completion(commands):
    table = "".join(f"    '{quoted(c.name)}:{quoted(c.summary.replace(':', chr(92) + ':'))}'\n" for c in commands)
    cases = ""
    for command in commands:
        words = [word for option in command.options for word in zsh_option(option)]
        rest = "(" + " ".join(command.names) + ")" if command.names else "_files"
        cases += f"  {command.name})\n    _arguments -s \\\n      " + " \\\n      ".join(words) + \
            f" \\\n      '*:word:{rest}' ;;\n"
    return f"""#compdef stroll
local -a commands
local curcontext="$curcontext" state line
commands=(
{table})
_arguments -C '(- *)--help[list the commands]' '(- *)--version[print the version]' '1:command:->command' '*::word:->words'
case $state in
command)
  _describe command commands ;;
words)
  case $line[1] in
{cases}  esac ;;
esac
"""


def fish_completion(commands):
    names = " ".join(command.name for command in commands)
    escape = lambda text: text.replace("\\", "\\\\").replace("'", "\\'")
    text = f"# fish completion of stroll\nset -l commands {names}\n"
    for flag, meaning in (("help", "list the commands"), ("version", "print the version")):
        text += f"complete -c stroll -n \"not __fish_seen_subcommand_from $commands\" -l {flag} -d '{meaning}'\n"
    for command in commands:
        text += f"complete -c stroll -f -n \"not __fish_seen_subcommand_from $commands\" -a {command.name} " \
                f"-d '{escape(command.summary)}'\n"
    for command in commands:
        head = f"complete -c stroll -n '__fish_seen_subcommand_from {command.name}'"
        for option in command.options:
            value = ""
            if option.argument and not option.argument.startswith("["):
                value = " -r" if option.is_file or option.is_folder else " -x"
            value += f" -a '{' '.join(option.choices)}'" if option.choices else ""
            letter = f" -s {option.letter}" if option.letter else ""
            text += f"{head} -l {option.name}{letter}{value} -d '{escape(option.help)}'\n"
        if command.names:
            text += f"{head} -f -a '{' '.join(command.names)}'\n"
    return text


def main():
    parser = argparse.ArgumentParser(description="Writes manual pages and completion.")
    parser.add_argument("--program", required=True)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    options = parser.parse_args()
    version = output_of(options.program, "--version").split()[1]
    commands = read_commands(options.program)
    texts = {"man/stroll.1": main_page(commands, version), "completion/stroll.bash": bash_completion(commands),
             "completion/_stroll": zsh_completion(commands), "completion/stroll.fish": fish_completion(commands)}
    texts.update({f"man/stroll-{command.name}.1": page_of(command, version) for command in commands})
    for name, text in texts.items():
        path = options.out / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


if __name__ == "__main__":
    main()
