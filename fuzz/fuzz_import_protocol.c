/* Streams of the import protocol from memory: refused with a sentence, or read twice to the same finite triangles. */
#include "fuzz_reader.h"
#include "readers/import_stream.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_reader(&strl__format_import, data, size);
    return 0;
}
