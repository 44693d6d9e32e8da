#include "readers/stranger.h"

#include <string.h>

#include "readers/internal.h"

#define UNPACK ": unpack it and name the model in it"
#define IMAGE "an image: name the model that it belongs to"
#define CONVERT ", which is not read: convert it to PLY, OBJ or glTF"
#define LIBRARY "a material library: name the OBJ file that it belongs to"
#define CLOUD "a cloud of points, which has no surface: make a mesh of it first"

typedef struct stranger {
    const char *sign; /* first bytes, or the ending of a name */
    size_t length;
    const char *what;
} stranger;

#define SIGN(text) text, sizeof(text) - 1

/* An ending says more than bytes that many formats begin with. */
static const stranger endings[] = {
    {SIGN("3dxml"), "a 3DXML file" CONVERT},
    {SIGN("xaml"), "a XAML file" CONVERT},
    {SIGN("svg"), "a drawing: name a model of surfaces"},
    {SIGN("mtl"), LIBRARY},
    {SIGN("xyz"), CLOUD},
    {SIGN("pts"), CLOUD},
    {SIGN("las"), CLOUD},
    {SIGN("laz"), CLOUD},
    {SIGN("bin"), "raw data: name the model that it belongs to, such as a .gltf file"},
};

static const stranger signs[] = {
    {SIGN("STROLL\x1a\n"), "a container that stroll build has made: view, render or verify it as it is"},
    {SIGN("PK\3\4"), "a ZIP archive" UNPACK},
    {SIGN("\x1f\x8b"), "a gzip archive" UNPACK},
    {SIGN("BZh"), "a bzip2 archive" UNPACK},
    {SIGN("\xfd\x37zXZ"), "an xz archive" UNPACK},
    {SIGN("7z\xbc\xaf"), "a 7z archive" UNPACK},
    {SIGN("\x28\xb5\x2f\xfd"), "a zstd archive" UNPACK},
    {SIGN("\x89PNG"), IMAGE},
    {SIGN("\xff\xd8\xff"), IMAGE},
    {SIGN("GIF8"), IMAGE},
    {SIGN("BM"), IMAGE},
    {SIGN("\xabKTX"), IMAGE},
    {SIGN("DDS "), IMAGE},
    {SIGN("newmtl "), LIBRARY},
    {SIGN("OCTM"), "an OpenCTM mesh" CONVERT},
    {SIGN("$MeshFormat"), "a Gmsh mesh" CONVERT},
    {SIGN("#binvox"), "a grid of voxels" CONVERT},
    {SIGN("%PDF"), "a PDF document: name a model"},
};

bool strl__stranger_is_pointer(const void *start, size_t bytes)
{
    static const char sign[] = "version https://git-lfs.github.com/spec/";
    return bytes >= sizeof sign - 1 && memcmp(start, sign, sizeof sign - 1) == 0;
}

const char *strl__stranger_describe(const strl__input *input, const char *path)
{
    for (size_t i = 0; i < sizeof endings / sizeof *endings; i++)
        if (strl__has_extension(path, endings[i].sign))
            return endings[i].what;
    for (size_t i = 0; i < sizeof signs / sizeof *signs; i++)
        if ((size_t)(input->end - input->at) >= signs[i].length &&
            memcmp(input->at, signs[i].sign, signs[i].length) == 0)
            return signs[i].what;
    return NULL;
}
