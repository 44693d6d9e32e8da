// The same from C++: every header of the interface is included, objects are held by unique_ptr.
#include <cstdio>
#include <memory>

#include <stroll/stroll.h>

namespace
{

struct walk_closer {
    void operator()(strl_walk *walk) const
    {
        strl_walk_close(walk);
    }
};
using walk_pointer = std::unique_ptr<strl_walk, walk_closer>;

walk_pointer open_model(const char *path, strl_error &err)
{
    strl_source *source = nullptr;
    strl_walk *walk = nullptr;
    if (strl_source_open_file(path, 0, &source, &err) == STRL_OK)
        strl_walk_open(source, nullptr, &walk, &err);
    return walk_pointer(walk);
}

} // namespace

int main(int argc, char **argv)
{
    strl_error err{};
    if (argc != 3)
        return 2;
    walk_pointer walk = open_model(argv[1], err);
    if (!walk) {
        std::fprintf(stderr, "consumer: %s\n", err.message);
        return 1;
    }
    const strl_container *container = strl_walk_container(walk.get());
    std::printf("triangles %llu\n", static_cast<unsigned long long>(strl_container_triangle_count(container)));
    walk_pointer broken = open_model(argv[2], err);
    std::printf("broken: %s\n", broken ? "opened" : err.message);
    return 0;
}
