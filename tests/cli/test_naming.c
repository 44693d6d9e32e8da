/* Sentences name the file that they are about once. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "shared/naming.h"

static void check(const char *path, const char *before, const char *after)
{
    strl_error err = {.status = STRL_ERR_FORMAT};
    strcpy(err.message, before);
    assert_int_equal(strl_name_file(path, STRL_ERR_FORMAT, &err), STRL_ERR_FORMAT);
    assert_string_equal(err.message, after);
}

static void a_name_is_put_before_a_sentence_that_lacks_it(void **state)
{
    (void)state;
    check("scan.stroll", "page 3 is broken", "scan.stroll: page 3 is broken");
    check("scan.stroll", "scan.stroll: page 3 is broken", "scan.stroll: page 3 is broken");
    check("a b/scan.stroll", "cannot read a b/scan.stroll: gone", "cannot read a b/scan.stroll: gone");
    check("scan", "the scanline is broken", "scan: the scanline is broken"); /* a part of a word is no name */
    check("p", "page 3 is broken", "p: page 3 is broken");
    check("https://host/p", "page 3 is broken", "page 3 is broken"); /* addresses name themselves */
}

static void nobody_has_to_listen(void **state)
{
    (void)state;
    assert_int_equal(strl_name_file("scan.stroll", STRL_ERR_IO, NULL), STRL_ERR_IO);
    assert_int_equal(strl_name_file("scan.stroll", STRL_OK, NULL), STRL_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_name_is_put_before_a_sentence_that_lacks_it),
        cmocka_unit_test(nobody_has_to_listen),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
