/* A folder of a test's own, made before its tests and expected to be empty after them. One a process. */
#ifndef STRL_TESTS_SUPPORT_FOLDER_H
#define STRL_TESTS_SUPPORT_FOLDER_H

/* Its path; "" before it is made. */
extern char strl_test_folder[64];

/* For cmocka_run_group_tests. */
int strl_test_folder_make(void **state);
/* Fails where something is left in it. */
int strl_test_folder_remove(void **state);

/* A path in the folder, good until the 8th call after. */
const char *strl_test_path(const char *name);

#endif
