/* Ctrl-C and termination as a question that long work asks between two steps. */
#ifndef STROLL_CLI_INTERRUPT_H
#define STROLL_CLI_INTERRUPT_H

#include <stdbool.h>

/* From now on SIGINT and SIGTERM only set what strl_cli_interrupted tells. */
void strl_cli_catch_interrupts(void);
bool strl_cli_interrupted(void);

#endif
