/* Which program reads the formats that Stroll leaves to assimp. */
#ifndef STRL_APPS_SHARED_IMPORTER_H
#define STRL_APPS_SHARED_IMPORTER_H

#ifdef __cplusplus
extern "C" {
#endif

/* What the user says by STROLL_IMPORT; NULL = the one that is installed (readers/reader.h). Borrowed. */
const char *strl_importer(void);

#ifdef __cplusplus
}
#endif
#endif
