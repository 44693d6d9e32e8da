/* What every command of the program shares: its entry in the command table, its options, its way to fail.
 *
 * A command is one file cmd_NAME.c that ends in STRL_CLI_COMMAND(NAME, "what it does", run); CMake finds the file and
 * puts the command into the table. `run` declares its options with their defaults, calls strl_cli_parse and does the
 * work:
 *
 *     static int run(strl_cli_args *args)
 *     {
 *         uint64_t memory_bytes = 1u << 30;
 *         bool json = false;
 *         strl_cli_list inputs;
 *         const strl_cli_option options[] = {
 *             {.name = "memory", .letter = 'm', .kind = STRL_CLI_BYTES, .value = &memory_bytes,
 *              .help = "peak memory (1G)"},
 *             {.name = "json", .kind = STRL_CLI_FLAG, .value = &json, .help = "print one JSON object"},
 *         };
 *         const strl_cli_usage usage = {.positional = "INPUT...", .least = 1, .most = SIZE_MAX,
 *                                       .options = options, .option_count = STRL_CLI_COUNT_OF(options)};
 *         int stop = strl_cli_parse(args, &usage, &inputs);
 *         if (stop >= 0)
 *             return stop;
 *         ...
 *     }
 *
 * Exit status: 0 done, 1 failed with one sentence on standard error, 2 wrong usage. --help and --quiet belong to every
 * command and are not declared. */
#ifndef STRL_CLI_OPTIONS_H
#define STRL_CLI_OPTIONS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "stroll/error.h"

#ifdef __cplusplus
extern "C" {
#endif

#define STRL_CLI_COUNT_OF(array) (sizeof(array) / sizeof((array)[0]))

/* Words that belong together; the words are borrowed from the command line. */
typedef struct strl_cli_list {
    char *const *items;
    size_t count;
} strl_cli_list;

/* What main hands to a command. */
typedef struct strl_cli_args {
    const char *command; /* its name, for sentences */
    const char *summary;
    int argc; /* words after the command's name */
    char **argv;
    char **words; /* room for argc positional words; strl_cli_parse fills it */
    bool quiet;   /* set by strl_cli_parse: no progress, no warnings */
} strl_cli_args;

typedef struct strl_cli_command {
    const char *name;
    const char *summary; /* one line without a full stop */
    int (*run)(strl_cli_args *args);
} strl_cli_command;

#define STRL_CLI_COMMAND(name, summary, run)                                                                           \
    extern const strl_cli_command strl_cli_command_##name;                                                             \
    const strl_cli_command strl_cli_command_##name = {#name, summary, run}

typedef enum strl_cli_kind {
    STRL_CLI_FLAG,   /* bool *: set true; takes no value */
    STRL_CLI_STRING, /* const char **: borrowed from the command line */
    STRL_CLI_BYTES,  /* uint64_t *: 1.5G; K M G T are powers of 1024 */
    STRL_CLI_COUNT,  /* uint64_t *: 2M; K M G T are powers of 1000 */
    STRL_CLI_REAL,   /* double *: finite */
    STRL_CLI_SIZE,   /* uint32_t[2]: WxH, each 1 to 16384 */
    STRL_CLI_ENUM,   /* int *: position of the word in `argument`, which lists them as "a|b|c" */
    STRL_CLI_LIST    /* strl_cli_list *: all words up to the next option or "--"; at least one; once only */
} strl_cli_kind;

typedef struct strl_cli_option {
    const char *name; /* long name, without dashes */
    char letter;      /* short name, 0 = none */
    strl_cli_kind kind;
    void *value;          /* see strl_cli_kind; keeps its default where the option is not given */
    const char *argument; /* the value in the help; NULL = by kind; for ENUM the legal words */
    const char *help;     /* one line without a full stop, default in parentheses */
    bool *given;          /* set where the option is given; may be NULL */
    bool required;
    bool value_optional; /* REAL and COUNT: the value may be missing; then only `given` is set */
    double least, most;  /* bounds of BYTES, COUNT and REAL, inclusive; both 0 = none (but REAL may be negative) */
} strl_cli_option;

typedef struct strl_cli_usage {
    const char *positional; /* "INPUT...", NULL = none */
    size_t least, most;     /* how many positional words */
    const char *notes;      /* printed under the options, may be NULL */
    const strl_cli_option *options;
    size_t option_count;
} strl_cli_usage;

/* Reads the command line into the options' values and `positional` (may be NULL where usage has none). Returns -1 to go
 * on, else the exit status at which to stop: 0 after --help, 2 after the sentence of a usage error. A value may follow
 * as next word or after "="; short flags may be joined; "--" ends options. */
int strl_cli_parse(strl_cli_args *args, const strl_cli_usage *usage, strl_cli_list *positional);

/* "s" where a noun after this count has one: "1 node", "2 nodes". */
const char *strl_cli_plural(uint64_t count);

/* For rules that a declaration cannot say: prints "stroll COMMAND: sentence" and where help is; returns 2. */
int strl_cli_usage_error(const strl_cli_args *args, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Prints "stroll: sentence" to standard error, after what is on its way to standard output; returns 1. */
int strl_cli_fail(const strl_error *err);

/* The same parsers for words inside a specification. False where the whole word is not such a value; 1.5 is no count,
 * 1.5K is. */
bool strl_cli_read_scaled(const char *word, unsigned thousand, uint64_t *value); /* thousand: 1000 or 1024 */
/* As somebody would type it: 64M, not 67108864; exact for whole numbers up to 10^15. */
void strl_cli_format_scaled(char text[32], double value, unsigned thousand);
/* For people: 1234567 as "1.23 M". */
void strl_cli_format_amount(char text[16], double amount);
bool strl_cli_read_real(const char *word, double *value);
bool strl_cli_read_size(const char *word, uint32_t size[2]);

#ifdef __cplusplus
}
#endif
#endif
