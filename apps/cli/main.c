/* The program: finds the command and hands it its words. */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "base/memory.h"
#include "commands.h"
#include "options.h"
#include "stroll/version.h"

static void print_help(FILE *out)
{
    fprintf(out, "stroll: any pile of triangles becomes one file to walk through, with a known pixel error\n\n"
                 "usage: stroll COMMAND [words and options]\n\ncommands:\n");
    for (const strl_cli_command *const *command = strl_cli_commands; *command; command++)
        fprintf(out, "  %-8s  %s\n", (*command)->name, (*command)->summary);
    fprintf(out, "\nstroll COMMAND --help lists a command's options; stroll --version prints the version.\n");
}

static const strl_cli_command *find_command(const char *name)
{
    for (const strl_cli_command *const *command = strl_cli_commands; *command; command++)
        if (!strcmp((*command)->name, name))
            return *command;
    return NULL;
}

/* A full disk behind standard output must not look like success. A command that failed has said its sentence. */
static int flush_output(int status)
{
    if ((fflush(stdout) == 0 && !ferror(stdout)) || status)
        return status;
    fprintf(stderr, "stroll: cannot write to standard output: %s\n", strerror(errno));
    return 1;
}

static int run_command(const strl_cli_command *command, int argc, char **argv)
{
    strl_cli_args args = {.command = command->name, .summary = command->summary, .argc = argc, .argv = argv};
    args.words = strl__alloc_zero((size_t)argc + 1, sizeof *args.words);
    if (!args.words) {
        fprintf(stderr, "stroll: no memory for %d words of the command line\n", argc);
        return 1;
    }
    int status = command->run(&args);
    strl__free(args.words);
    return status;
}

int main(int argc, char **argv)
{
    if (argc < 2) {
        print_help(stderr);
        return 2;
    }
    if (!strcmp(argv[1], "--version")) {
        printf("stroll %s\n", STRL_VERSION);
        return flush_output(0);
    }
    if (!strcmp(argv[1], "--help") || !strcmp(argv[1], "-h") || !strcmp(argv[1], "help")) {
        print_help(stdout);
        return flush_output(0);
    }
    const strl_cli_command *command = find_command(argv[1]);
    if (!command) {
        fprintf(stderr, "stroll: there is no command \"%s\" (stroll --help lists them)\n", argv[1]);
        return 2;
    }
    return flush_output(run_command(command, argc - 2, argv + 2));
}
