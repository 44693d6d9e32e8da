/* glTF texts from memory, with their buffers in them: refused with a sentence, or read twice to the same finite
 * triangles. */
#include "fuzz_reader.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_reader(&strl__format_gltf, data, size);
    return 0;
}
