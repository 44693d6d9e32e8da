#include "memory_end.h"

#include <new>
#include <unistd.h>

extern "C" {
#include "output.h"
}

namespace {

/* A new-handler takes no argument: this is the program's only global. */
int stream_descriptor = -1;

void end_program()
{
    import_write_error(stream_descriptor, STRL_IMPORT_MEMORY, "assimp gets no more memory");
    _exit(STRL_IMPORT_MEMORY);
}

} // namespace

void import_end_without_memory(int descriptor)
{
    stream_descriptor = descriptor;
    std::set_new_handler(end_program);
}

#if defined(__SANITIZE_ADDRESS__)
/* Address space cannot be limited under the sanitizer; resident memory can. A scene is not released, see main. */
extern "C" const char *__asan_default_options(void);
extern "C" const char *__asan_default_options(void)
{
    return "hard_rss_limit_mb=1024:detect_leaks=0";
}
#endif
