/* Ctrl-C, termination and the end of the terminal as a question that long work asks between two steps. Work that
 * hears yes removes what it has not finished and fails with STRL_ERR_CANCELLED, which strl_cli_fail tells as
 * "interrupted". */
#ifndef STROLL_CLI_INTERRUPT_H
#define STROLL_CLI_INTERRUPT_H

#include <stdbool.h>

#include "stroll/error.h"

/* From now on SIGINT, SIGTERM, SIGHUP and SIGQUIT only set what the others tell, those that were ignored excepted. A
 * second SIGINT or SIGQUIT ends the process at once, with what it has not finished left behind. SIGXFSZ is ignored. */
void strl_cli_catch_interrupts(void);
bool strl_cli_interrupted(void);
/* STRL_ERR_CANCELLED once there was a signal. */
strl_status strl_cli_check_interrupt(strl_error *err);

#endif
