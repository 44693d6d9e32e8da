/* The end of the program when assimp, which is C++, gets no memory. */
#ifndef STRL_IMPORT_MEMORY_END_H
#define STRL_IMPORT_MEMORY_END_H

#ifdef __cplusplus
extern "C" {
#endif

/* From now on a `new` that fails writes an error to the stream, with the size that was asked for, and ends the program:
 * assimp would catch the exception and call the file broken. For the time before the first record. */
void import_end_without_memory(int descriptor);

#ifdef __cplusplus
}
#endif
#endif
