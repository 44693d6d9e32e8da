#include "memory_end.h"

#include <cstdio>
#include <cstdlib>
#include <new>
#include <unistd.h>

extern "C" {
#include "output.h"
}

namespace
{

/* operator new has no other argument than a size: this is the program's only global. */
int stream_descriptor = -1;

} // namespace

void import_end_without_memory(int descriptor)
{
    stream_descriptor = descriptor;
}

#if defined(__SANITIZE_ADDRESS__)
#define IS_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define IS_SANITIZED 1
#endif
#endif

#ifdef IS_SANITIZED

/* The sanitizer has its own operators, and address space cannot be limited under it; resident memory can. A scene is
 * not released, see main. */
extern "C" const char *__asan_default_options(void);
extern "C" const char *__asan_default_options(void)
{
    return "hard_rss_limit_mb=1024:max_allocation_size_mb=1024:detect_leaks=0";
}

#else

namespace
{

[[noreturn]] void end_program(std::size_t size)
{
    char sentence[80];
    /* A block far larger than the file tells that more memory would not help. */
    std::snprintf(sentence, sizeof sentence, "its last wish was a block of %zu MB", (size >> 20) + 1);
    if (stream_descriptor >= 0)
        import_write_error(stream_descriptor, STRL_IMPORT_MEMORY, sentence);
    _exit(STRL_IMPORT_MEMORY);
}

} // namespace

/* In place of the library's, for assimp's calls too. Those that do not throw keep their word: who calls them has a way
 * without memory. */
void *operator new(std::size_t size)
{
    void *block = std::malloc(size ? size : 1);
    if (!block)
        end_program(size);
    return block;
}

void *operator new[](std::size_t size)
{
    return operator new(size);
}

void *operator new(std::size_t size, const std::nothrow_t &) noexcept
{
    return std::malloc(size ? size : 1);
}

void *operator new[](std::size_t size, const std::nothrow_t &) noexcept
{
    return std::malloc(size ? size : 1);
}

void operator delete(void *block) noexcept
{
    std::free(block);
}

void operator delete[](void *block) noexcept
{
    std::free(block);
}

void operator delete(void *block, std::size_t) noexcept
{
    std::free(block);
}

void operator delete[](void *block, std::size_t) noexcept
{
    std::free(block);
}

#endif
