/* What the tests of a file behind an address share: the file, rules for its server, reads, and checks of what they
 * give. */
#ifndef HTTP_CHECKS_H
#define HTTP_CHECKS_H

#include <stddef.h>
#include <stdint.h>

#include "source/source.h"
#include "support/fault_server.h"

#define BYTES ((size_t)1 << 20)
#define MS ((uint64_t)1000000)
#define HEAD 4096u /* bytes that opening asks for */

/* What is served, once set_up has filled it, and another file as long. */
extern uint8_t content[BYTES], other_content[BYTES];
extern const fault_content good;
/* Of a client that soon gives up. */
extern const strl_http_desc quick;
extern const fault_rule well;

/* For cmocka_run_group_tests, with strl_test_folder_remove. */
int set_up(void **state);

/* As `quick`, with a cache in the folder of the test. */
strl_http_desc cached(const char *folder);

/* Rules by the number of the request; the last is that of all further ones. */
typedef struct listed_rules {
    const fault_rule *rules;
    unsigned count;
} listed_rules;

/* A fault_script; the context is a listed_rules. */
fault_rule by_number(void *context, unsigned number, const fault_asked *asked);

#define LISTED(...)                                                                                                    \
    &(listed_rules)                                                                                                    \
    {                                                                                                                  \
        (const fault_rule[]){__VA_ARGS__}, sizeof((fault_rule[]){__VA_ARGS__}) / sizeof(fault_rule)                    \
    }

/* What follows fails the test where it is not so. */
strl_source *must_open(const char *url, const strl_http_desc *desc);
strl_source *must_open_memory(void);
void must_not_open(const char *url, strl_status status, const char *words);
/* Polls until there is one; its data is the caller's. */
strl_source_result next_answer(strl_source *source);
void submit(strl_source *source, uint64_t token, uint64_t offset, size_t size, float urgency);
/* Waits for bytes of `content`. */
void check_read(strl_source *source, uint64_t offset, size_t size);
void check_read_fails(strl_source *source, uint64_t offset, size_t size, const char *words);
strl_network_stats stats_of(const strl_source *source);
void wait_until_asked(fault_server *server, unsigned requests);

#endif
