/* The options of every command that takes MODEL: what an address wants, which is a cache. */
#ifndef STRL_CLI_REMOTE_H
#define STRL_CLI_REMOTE_H

#include "options.h"
#include "shared/location.h"

typedef struct strl_cli_remote {
    const char *cache; /* of --cache */
    uint64_t cache_bytes;
    bool no_cache;
    char folder[4096]; /* where nothing is given */
} strl_cli_remote;

/* Three entries of an option table. */
#define STRL_CLI_REMOTE_OPTIONS(remote)                                                                                \
    {.name = "cache",                                                                                                  \
     .kind = STRL_CLI_STRING,                                                                                          \
     .value = &(remote)->cache,                                                                                        \
     .argument = "DIR",                                                                                                \
     .help = "where bytes of a model behind an address are kept ($XDG_CACHE_HOME/stroll)"},                            \
        {.name = "cache-size",                                                                                         \
         .kind = STRL_CLI_BYTES,                                                                                       \
         .value = &(remote)->cache_bytes,                                                                              \
         .help = "that these may take (1G)",                                                                           \
         .least = 1 << 20,                                                                                             \
         .most = 0x1p50},                                                                                              \
    {                                                                                                                  \
        .name = "no-cache", .kind = STRL_CLI_FLAG, .value = &(remote)->no_cache,                                       \
        .help = "keep nothing of what an address gave"                                                                 \
    }

/* Fails where one of the names is an address: the command reads files alone. The sentence has nothing of it: it may
 * hold a password. */
strl_status strl_cli_check_files(const char *command, const char *const *names, size_t count, strl_error *err);

/* After parsing. location borrows from remote and name. A folder that was asked for has to be there or to be made;
 * the one that nobody asked for is done without where it cannot be. */
strl_status strl_cli_locate(strl_cli_remote *remote, const char *name, strl_location *location, strl_error *err);

#endif
