/* The table of all commands, which CMake writes from the files cmd_*.c that are there. */
#ifndef STRL_CLI_COMMANDS_H
#define STRL_CLI_COMMANDS_H

#include "options.h"

extern const strl_cli_command *const strl_cli_commands[]; /* ends with NULL */

#endif
