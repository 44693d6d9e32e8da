/* The command line of every command: parse, help and usage errors. See options.h. */
#include "options.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* Where the reading of the words stands. */
typedef struct parse_state {
    strl_cli_args *args;
    const strl_cli_usage *usage;
    uint64_t seen;      /* bit per option */
    size_t words;       /* positional words so far */
    int next;           /* index into argv */
    bool options_ended; /* after "--" */
    bool help;
} parse_state;

enum { OPTIONS_MOST = 64 };

static const char *argument_of(const strl_cli_option *option)
{
    static const char *const by_kind[] = {
        [STRL_CLI_FLAG] = "",       [STRL_CLI_STRING] = "TEXT", [STRL_CLI_BYTES] = "BYTES", [STRL_CLI_COUNT] = "N",
        [STRL_CLI_REAL] = "NUMBER", [STRL_CLI_SIZE] = "WxH",    [STRL_CLI_ENUM] = "WORD",   [STRL_CLI_LIST] = "FILE...",
    };
    return option->argument ? option->argument : by_kind[option->kind];
}

static int usage_error(const strl_cli_args *args, const char *format, va_list values)
{
    fprintf(stderr, "stroll %s: ", args->command);
    vfprintf(stderr, format, values);
    fprintf(stderr, " (stroll %s --help lists the options)\n", args->command);
    return 2;
}

int strl_cli_usage_error(const strl_cli_args *args, const char *format, ...)
{
    va_list values;
    va_start(values, format);
    int status = usage_error(args, format, values);
    va_end(values);
    return status;
}

int strl_cli_fail(const strl_error *err)
{
    const char *sentence = err->message[0] ? err->message : strl_status_name(err->status);
    if (err->status == STRL_ERR_CANCELLED) /* whatever the work was: commands are stopped by signals alone */
        sentence = "interrupted";
    fflush(stdout); /* what was said before stands before, through a pipe too */
    fprintf(stderr, "stroll: %s\n", sentence);
    return 1;
}

const char *strl_cli_plural(uint64_t count)
{
    return count == 1 ? "" : "s";
}

static void print_option(char letter, const char *name, const char *argument, bool value_optional, const char *help)
{
    char left[160];
    char shown[96] = "";
    if (*argument)
        snprintf(shown, sizeof shown, value_optional ? " [%s]" : " %s", argument);
    const char short_name[] = {'-', letter, ',', '\0'};
    snprintf(left, sizeof left, "%3s --%s%s", letter ? short_name : "", name, shown);
    if (strlen(left) > 30)
        printf("  %s\n  %-30s  %s\n", left, "", help);
    else
        printf("  %-30s  %s\n", left, help);
}

static void print_help(const strl_cli_args *args, const strl_cli_usage *usage)
{
    printf("stroll %s: %s\n\n", args->command, args->summary);
    printf("usage: stroll %s%s%s [options]\n\noptions:\n", args->command, usage->positional ? " " : "",
           usage->positional ? usage->positional : "");
    for (size_t i = 0; i < usage->option_count; i++) {
        const strl_cli_option *option = &usage->options[i];
        print_option(option->letter, option->name, argument_of(option), option->value_optional, option->help);
    }
    print_option('q', "quiet", "", false, "say nothing but errors: no progress, no warnings, no results but --json");
    print_option('h', "help", "", false, "print this and stop");
    if (usage->notes)
        printf("\n%s\n", usage->notes);
}

static int read_enum(const strl_cli_args *args, const strl_cli_option *option, const char *word)
{
    const char *at = argument_of(option);
    size_t length = strlen(word);
    for (int position = 0; *at; position++) {
        size_t choice = strcspn(at, "|");
        if (length > 0 && choice == length && !memcmp(at, word, length)) {
            *(int *)option->value = position;
            return -1;
        }
        at += choice + (at[choice] == '|');
    }
    return strl_cli_usage_error(args, "--%s is one of %s, not \"%s\"", option->name, argument_of(option), word);
}

static void format_bound(char text[32], const strl_cli_option *option, double bound)
{
    if (option->kind == STRL_CLI_REAL)
        snprintf(text, 32, "%.15g", bound);
    else
        strl_cli_format_scaled(text, bound, option->kind == STRL_CLI_BYTES ? 1024 : 1000);
}

static int check_bounds(const strl_cli_args *args, const strl_cli_option *option, double value, const char *word)
{
    bool bounded = option->least != 0 || option->most != 0;
    if (!bounded || (value >= option->least && value <= option->most))
        return -1;
    char least[32], most[32];
    format_bound(least, option, option->least);
    format_bound(most, option, option->most);
    return strl_cli_usage_error(args, "--%s lies between %s and %s, found %s", option->name, least, most, word);
}

static int read_scaled(const strl_cli_args *args, const strl_cli_option *option, const char *word)
{
    bool bytes = option->kind == STRL_CLI_BYTES;
    uint64_t value = 0;
    if (!strl_cli_read_scaled(word, bytes ? 1024 : 1000, &value))
        return strl_cli_usage_error(args, "--%s takes %s, not \"%s\"", option->name,
                                    bytes ? "a number of bytes such as 512M or 1.5G" : "a whole number such as 8 or 2M",
                                    word);
    int stop = check_bounds(args, option, (double)value, word);
    if (stop < 0)
        *(uint64_t *)option->value = value;
    return stop;
}

static int read_real(const strl_cli_args *args, const strl_cli_option *option, const char *word)
{
    double value = 0;
    if (!strl_cli_read_real(word, &value))
        return strl_cli_usage_error(args, "--%s takes a number, not \"%s\"", option->name, word);
    int stop = check_bounds(args, option, value, word);
    if (stop < 0)
        *(double *)option->value = value;
    return stop;
}

static int read_value(const strl_cli_args *args, const strl_cli_option *option, char *word)
{
    switch (option->kind) {
    case STRL_CLI_STRING:
        *(const char **)option->value = word;
        return -1;
    case STRL_CLI_BYTES:
    case STRL_CLI_COUNT:
        return read_scaled(args, option, word);
    case STRL_CLI_REAL:
        return read_real(args, option, word);
    case STRL_CLI_SIZE:
        if (strl_cli_read_size(word, option->value))
            return -1;
        return strl_cli_usage_error(args, "--%s takes WxH such as 1280x720, each 1 to 16384, not \"%s\"", option->name,
                                    word);
    case STRL_CLI_ENUM:
        return read_enum(args, option, word);
    case STRL_CLI_FLAG:
    case STRL_CLI_LIST:
        break;
    }
    return -1;
}

/* A negative number is a value, not an option. */
static bool looks_like_option(const char *word)
{
    return word[0] == '-' && word[1] != '\0' && !(word[1] >= '0' && word[1] <= '9') && word[1] != '.';
}

static void take_list(parse_state *state, const strl_cli_option *option)
{
    strl_cli_list *list = option->value;
    list->items = &state->args->argv[state->next];
    list->count = 0;
    while (state->next < state->args->argc && !looks_like_option(state->args->argv[state->next])) {
        list->count++;
        state->next++;
    }
}

/* `value` is the text after "=" or a joined letter, NULL = none. */
static int take_option(parse_state *state, const strl_cli_option *option, char *value)
{
    strl_cli_args *args = state->args;
    uint64_t bit = (uint64_t)1 << (option - state->usage->options);
    if (state->seen & bit && option->kind != STRL_CLI_FLAG)
        return strl_cli_usage_error(args, "--%s is given twice", option->name);
    state->seen |= bit;
    if (option->given)
        *option->given = true;
    if (option->kind == STRL_CLI_FLAG || option->kind == STRL_CLI_LIST) {
        if (value)
            return strl_cli_usage_error(args, "--%s takes no value after \"=\"", option->name);
        if (option->kind == STRL_CLI_FLAG) {
            *(bool *)option->value = true;
            return -1;
        }
        take_list(state, option);
        return ((strl_cli_list *)option->value)->count
                   ? -1
                   : strl_cli_usage_error(args, "--%s needs %s", option->name, argument_of(option));
    }
    char *next = state->next < args->argc ? args->argv[state->next] : NULL;
    if (!value && option->value_optional) {
        double number;
        if (!next || !strl_cli_read_real(next, &number))
            return -1;
    }
    if (!value && (!next || !strcmp(next, "--") || (looks_like_option(next) && next[1] == '-')))
        return strl_cli_usage_error(args, "--%s needs %s", option->name, argument_of(option));
    if (!value) {
        value = next;
        state->next++;
    }
    return read_value(args, option, value);
}

static int take_long(parse_state *state, char *word)
{
    char *name = word + 2;
    size_t length = strcspn(name, "=");
    for (size_t i = 0; i < state->usage->option_count; i++) {
        const strl_cli_option *option = &state->usage->options[i];
        if (strlen(option->name) == length && !memcmp(option->name, name, length))
            return take_option(state, option, name[length] ? name + length + 1 : NULL);
    }
    if (!strcmp(name, "help"))
        state->help = true;
    else if (!strcmp(name, "quiet"))
        state->args->quiet = true;
    else
        return strl_cli_usage_error(state->args, "there is no option --%.*s", (int)length, name);
    return -1;
}

static int take_letters(parse_state *state, char *letters)
{
    int stop = -1;
    while (*letters && stop < 0) {
        char letter = *letters++;
        const strl_cli_option *option = NULL;
        for (size_t i = 0; i < state->usage->option_count; i++)
            if (state->usage->options[i].letter == letter)
                option = &state->usage->options[i];
        if (option) {
            bool joined = option->kind != STRL_CLI_FLAG && option->kind != STRL_CLI_LIST && *letters;
            stop = take_option(state, option, joined ? letters : NULL);
            if (joined)
                break;
        } else if (letter == 'h') {
            state->help = true;
        } else if (letter == 'q') {
            state->args->quiet = true;
        } else {
            stop = strl_cli_usage_error(state->args, "there is no option -%c", letter);
        }
    }
    return stop;
}

static int take_word(parse_state *state)
{
    char *word = state->args->argv[state->next++];
    if (!state->options_ended && !strcmp(word, "--")) {
        state->options_ended = true;
        return -1;
    }
    if (!state->options_ended && !strncmp(word, "--", 2))
        return take_long(state, word);
    if (!state->options_ended && looks_like_option(word))
        return take_letters(state, word + 1);
    state->args->words[state->words++] = word;
    return -1;
}

/* A list takes every word up to the next option, so it may have taken this one. */
static int missing_word(const parse_state *state)
{
    const strl_cli_usage *usage = state->usage;
    for (size_t i = 0; i < usage->option_count; i++)
        if (usage->options[i].kind == STRL_CLI_LIST && state->seen & (uint64_t)1 << i)
            return strl_cli_usage_error(
                state->args, "%s is missing: --%s takes all words that follow it, so %s goes before it or after --",
                usage->positional, usage->options[i].name, usage->positional);
    return strl_cli_usage_error(state->args, "%s is missing", usage->positional);
}

static int check_complete(const parse_state *state)
{
    const strl_cli_usage *usage = state->usage;
    if (!usage->positional && state->words > 0)
        return strl_cli_usage_error(state->args, "\"%s\" is one word too many", state->args->words[0]);
    if (state->words < usage->least)
        return missing_word(state);
    if (usage->positional && state->words > usage->most)
        return strl_cli_usage_error(state->args, "\"%s\" is one word too many", state->args->words[usage->most]);
    for (size_t i = 0; i < usage->option_count; i++)
        if (usage->options[i].required && !(state->seen & (uint64_t)1 << i))
            return strl_cli_usage_error(state->args, "--%s %s is missing", usage->options[i].name,
                                        argument_of(&usage->options[i]));
    return -1;
}

int strl_cli_parse(strl_cli_args *args, const strl_cli_usage *usage, strl_cli_list *positional)
{
    parse_state state = {.args = args, .usage = usage};
    int stop = usage->option_count <= OPTIONS_MOST
                   ? -1
                   : strl_cli_usage_error(args, "declares more than %d options", OPTIONS_MOST);
    while (state.next < args->argc && stop < 0 && !state.help)
        stop = take_word(&state);
    if (stop < 0 && state.help) {
        print_help(args, usage);
        return 0;
    }
    if (stop < 0)
        stop = check_complete(&state);
    if (positional)
        *positional = (strl_cli_list){args->words, state.words};
    return stop;
}
