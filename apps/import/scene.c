#include "scene.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "base/memory.h"
#include "traits.h"

/* A node between the root and where the walk is. */
typedef struct level {
    const struct aiNode *node;
    unsigned next_child;
    double placement[3][4]; /* to the model's coordinates; what lies below the first three rows is not affine */
    size_t path_bytes;      /* of the path at the node's end */
} level;

typedef struct mesh_counts {
    uint64_t faces, corners, triangles; /* of faces of three corners or more */
    uint64_t points, lines, empty_faces;
} mesh_counts;

typedef struct scene_walk {
    const struct aiScene *scene;
    import_output *output;
    import_refusal *refusal;
    mesh_counts *meshes; /* owned */
    uint32_t *materials; /* the stream's numbers, or STRL_IMPORT_NO_MATERIAL; owned */
    uint32_t material_count;
    level *levels; /* owned */
    size_t level_count, level_capacity;
    char path[STRL_IMPORT_NAME_MOST + 1];
    import_vertex *corners; /* of one face; owned */
} scene_walk;

typedef bool (*visit)(scene_walk *walk, const level *at, void *context);

__attribute__((format(printf, 3, 4))) static bool refuse(scene_walk *walk, enum strl_import_reason reason,
                                                         const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(walk->refusal->sentence, sizeof walk->refusal->sentence, format, arguments);
    va_end(arguments);
    walk->refusal->reason = reason;
    return false;
}

static bool refuse_memory(scene_walk *walk)
{
    return refuse(walk, STRL_IMPORT_MEMORY, "no memory left for the scene");
}

/* ---- the tree of nodes, without recursion: its depth is the file's choice ---- */

static void multiply(double out[3][4], const double a[3][4], const struct aiMatrix4x4 *b)
{
    const double right[3][4] = {{(double)b->a1, (double)b->a2, (double)b->a3, (double)b->a4},
                                {(double)b->b1, (double)b->b2, (double)b->b3, (double)b->b4},
                                {(double)b->c1, (double)b->c2, (double)b->c3, (double)b->c4}};
    for (int row = 0; row < 3; row++)
        for (int column = 0; column < 4; column++)
            out[row][column] = a[row][0] * right[0][column] + a[row][1] * right[1][column] +
                               a[row][2] * right[2][column] + (column == 3 ? a[row][3] : 0);
}

/* Nodes that assimp invents to hold the steps of an FBX transform carry no name of the file. */
static bool is_named(const struct aiNode *node)
{
    return node->mName.length > 0 && !strstr(node->mName.data, "_$AssimpFbx$_");
}

/* The root's name is mostly the importer's own word, and is left out. */
static size_t extend_path(scene_walk *walk, size_t bytes, const struct aiNode *node)
{
    if (walk->level_count == 0 || !is_named(node))
        return bytes;
    int written = snprintf(walk->path + bytes, sizeof walk->path - bytes, "%s%s", bytes ? "/" : "", node->mName.data);
    size_t end = bytes + (written > 0 ? (size_t)written : 0);
    return end < sizeof walk->path ? end : sizeof walk->path - 1;
}

static bool push(scene_walk *walk, const struct aiNode *node)
{
    static const double identity[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
    if (!strl__grow(&walk->levels, &walk->level_capacity, walk->level_count + 1, sizeof *walk->levels))
        return refuse_memory(walk);
    const level *above = walk->level_count ? &walk->levels[walk->level_count - 1] : NULL;
    level *made = &walk->levels[walk->level_count];
    made->node = node;
    made->next_child = 0;
    made->path_bytes = extend_path(walk, above ? above->path_bytes : 0, node);
    multiply(made->placement, above ? above->placement : identity, &node->mTransformation);
    walk->level_count++;
    return true;
}

static bool walk_nodes(scene_walk *walk, visit take, void *context)
{
    walk->level_count = 0;
    bool good = push(walk, walk->scene->mRootNode) && take(walk, &walk->levels[0], context);
    while (good && walk->level_count > 0) {
        level *at = &walk->levels[walk->level_count - 1];
        if (at->next_child == at->node->mNumChildren) {
            walk->level_count--;
            continue;
        }
        const struct aiNode *child = at->node->mChildren[at->next_child++];
        good = !child || (push(walk, child) && take(walk, &walk->levels[walk->level_count - 1], context));
    }
    return good;
}

/* ---- counting ---- */

static bool count_face(scene_walk *walk, unsigned number, const struct aiMesh *mesh, const struct aiFace *face,
                       mesh_counts *counts)
{
    const unsigned corners = face->mNumIndices;
    if (corners > STRL_IMPORT_CORNERS_MOST)
        return refuse(walk, STRL_IMPORT_UNSUPPORTED, "expected faces of at most %u corners, found one of %u",
                      STRL_IMPORT_CORNERS_MOST, corners);
    for (unsigned i = 0; i < corners; i++)
        if (face->mIndices[i] >= mesh->mNumVertices)
            return refuse(walk, STRL_IMPORT_BROKEN, "expected the index of one of %u vertices in mesh %u, found %u",
                          mesh->mNumVertices, number, face->mIndices[i]);
    counts->empty_faces += corners == 0;
    counts->points += corners == 1;
    counts->lines += corners == 2;
    if (corners < 3)
        return true;
    counts->faces++;
    counts->corners += corners;
    counts->triangles += corners - 2;
    return true;
}

static bool count_meshes(scene_walk *walk)
{
    for (unsigned m = 0; m < walk->scene->mNumMeshes; m++) {
        const struct aiMesh *mesh = walk->scene->mMeshes[m];
        if (!mesh || (mesh->mNumFaces > 0 && (!mesh->mFaces || !mesh->mVertices)))
            return refuse(walk, STRL_IMPORT_BROKEN, "expected vertices and faces in mesh %u, found none", m);
        for (unsigned f = 0; f < mesh->mNumFaces; f++)
            if (!count_face(walk, m, mesh, &mesh->mFaces[f], &walk->meshes[m]))
                return false;
    }
    return true;
}

/* Sums over the placements of meshes. */
typedef struct sums {
    import_totals totals;
    uint64_t faces, corners, pieces;
} sums;

static bool count_node(scene_walk *walk, const level *at, void *context)
{
    sums *sum = context;
    sum->pieces++;
    for (unsigned i = 0; i < at->node->mNumMeshes; i++) {
        unsigned m = at->node->mMeshes[i];
        if (m >= walk->scene->mNumMeshes)
            return refuse(walk, STRL_IMPORT_BROKEN, "expected one of %u meshes in a node, found number %u",
                          walk->scene->mNumMeshes, m);
        const mesh_counts *counts = &walk->meshes[m];
        sum->pieces++;
        sum->totals.triangles += counts->triangles;
        sum->totals.points += counts->points;
        sum->totals.lines += counts->lines;
        sum->totals.empty_faces += counts->empty_faces;
        sum->faces += counts->faces;
        sum->corners += counts->corners;
        /* More than any disk holds; sums must not wrap. */
        if (sum->corners >> 56)
            return refuse(walk, STRL_IMPORT_UNSUPPORTED, "its nodes use its meshes too many times");
    }
    return true;
}

/* ---- telling ---- */

/* A mesh at its place. */
typedef struct placed_mesh {
    const struct aiMesh *mesh;
    const double (*placement)[4];
    double normals[3][3]; /* the inverse transpose, but for a positive factor */
    bool mirrored;        /* the placement turns faces over */
    bool has_normals, has_colours;
} placed_mesh;

static void place_normals(placed_mesh *placed)
{
    const double(*m)[4] = placed->placement;
    double(*n)[3] = placed->normals;
    for (int row = 0; row < 3; row++)
        for (int column = 0; column < 3; column++) {
            int r1 = (row + 1) % 3, r2 = (row + 2) % 3, c1 = (column + 1) % 3, c2 = (column + 2) % 3;
            n[row][column] = m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1];
        }
    double determinant = m[0][0] * n[0][0] + m[0][1] * n[0][1] + m[0][2] * n[0][2];
    placed->mirrored = determinant < 0;
    for (int i = 0; placed->mirrored && i < 9; i++)
        n[i / 3][i % 3] = -n[i / 3][i % 3];
}

static void place_normal(const placed_mesh *placed, unsigned index, import_vertex *vertex)
{
    const struct aiVector3D *read = &placed->mesh->mNormals[index];
    const double normal[3] = {(double)read->x, (double)read->y, (double)read->z};
    double out[3], length = 0;
    for (int k = 0; k < 3; k++) {
        const double *row = placed->normals[k];
        out[k] = row[0] * normal[0] + row[1] * normal[1] + row[2] * normal[2];
        length += out[k] * out[k];
    }
    /* Cofactors of a scale by a thousandth are millionths: what is told is a direction. */
    for (int k = 0; k < 3 && length > 0 && isfinite(length); k++)
        vertex->normal[k] = (float)(out[k] / sqrt(length));
}

static void place_vertex(const placed_mesh *placed, unsigned index, import_vertex *vertex)
{
    const struct aiVector3D *read = &placed->mesh->mVertices[index];
    const double at[3] = {(double)read->x, (double)read->y, (double)read->z};
    memset(vertex, 0, sizeof *vertex);
    for (int k = 0; k < 3; k++) {
        const double *row = placed->placement[k];
        vertex->position[k] = row[0] * at[0] + row[1] * at[1] + row[2] * at[2] + row[3];
    }
    if (placed->has_normals)
        place_normal(placed, index, vertex);
    vertex->colour = placed->has_colours ? import_traits_colour(&placed->mesh->mColors[0][index]) : 0xffffffffu;
}

static void tell_faces(scene_walk *walk, const placed_mesh *placed)
{
    const struct aiMesh *mesh = placed->mesh;
    for (unsigned f = 0; f < mesh->mNumFaces && !import_output_failed(walk->output); f++) {
        const struct aiFace *face = &mesh->mFaces[f];
        const unsigned corners = face->mNumIndices;
        for (unsigned i = 0; i < corners && corners >= 3; i++) {
            /* The first corner stays the first, so that a polygon begins where the file says. */
            unsigned from = placed->mirrored && i > 0 ? corners - i : i;
            place_vertex(placed, face->mIndices[from], &walk->corners[i]);
        }
        if (corners >= 3)
            import_output_face(walk->output, walk->corners, corners);
    }
}

/* The stream's number of a material, which is told when it is used first. */
static uint32_t find_material(scene_walk *walk, unsigned index)
{
    char name[STRL_IMPORT_NAME_MOST + 1];
    if (index >= walk->scene->mNumMaterials || !walk->scene->mMaterials[index])
        return STRL_IMPORT_NO_MATERIAL;
    if (walk->materials[index] == STRL_IMPORT_NO_MATERIAL) {
        uint32_t rgba = import_traits_material(walk->scene->mMaterials[index], name);
        walk->materials[index] = walk->material_count++;
        import_output_material(walk->output, rgba, name);
    }
    return walk->materials[index];
}

static void tell_mesh(scene_walk *walk, const level *at, const struct aiMesh *mesh)
{
    placed_mesh placed = {.mesh = mesh,
                          .placement = at->placement,
                          .has_normals = mesh->mNormals != NULL,
                          .has_colours = mesh->mColors[0] != NULL};
    place_normals(&placed);
    import_output_begin(walk->output, find_material(walk, mesh->mMaterialIndex), placed.has_normals,
                        placed.has_colours);
    tell_faces(walk, &placed);
}

static bool tell_node(scene_walk *walk, const level *at, void *context)
{
    bool told = false;
    (void)context;
    for (unsigned i = 0; i < at->node->mNumMeshes; i++) {
        unsigned m = at->node->mMeshes[i];
        const struct aiMesh *mesh = walk->scene->mMeshes[m];
        if (walk->meshes[m].faces == 0)
            continue;
        walk->path[at->path_bytes] = 0; /* what deeper nodes have left behind it */
        if (!told)
            import_output_part(walk->output, at->path_bytes ? walk->path : mesh->mName.data);
        told = true;
        tell_mesh(walk, at, mesh);
    }
    return !import_output_failed(walk->output);
}

/* ---- all of it ---- */

static bool allocate(scene_walk *walk)
{
    const struct aiScene *scene = walk->scene;
    walk->meshes = strl__alloc_zero(scene->mNumMeshes, sizeof *walk->meshes);
    walk->materials = strl__alloc(scene->mNumMaterials, sizeof *walk->materials);
    walk->corners = strl__alloc(STRL_IMPORT_CORNERS_MOST, sizeof *walk->corners);
    if (!walk->meshes || !walk->materials || !walk->corners)
        return refuse_memory(walk);
    memset(walk->materials, 0xff, scene->mNumMaterials * sizeof *walk->materials);
    return true;
}

static bool write_scene(scene_walk *walk, const char *extension)
{
    sums sum = {0};
    import_facts facts = {0};
    if (!walk->scene->mRootNode)
        return refuse(walk, STRL_IMPORT_BROKEN, "assimp finds nothing in it: convert it to PLY, OBJ or glTF");
    if (!allocate(walk) || !count_meshes(walk) || !walk_nodes(walk, count_node, &sum))
        return false;
    import_traits_directions(walk->scene, extension, &facts);
    memcpy(facts.format, extension, strnlen(extension, sizeof facts.format));
    facts.triangles = sum.totals.triangles;
    const uint64_t names = sum.pieces + walk->scene->mNumMaterials;
    facts.stream_most = import_output_most_bytes(sum.pieces, sum.faces, sum.corners) + 4096 +
                        names * (STRL_IMPORT_RECORD_HEAD + 4 + STRL_IMPORT_NAME_MOST);
    import_output_facts(walk->output, &facts);
    if (!walk_nodes(walk, tell_node, NULL))
        return false;
    import_output_end(walk->output, &sum.totals);
    return !import_output_failed(walk->output);
}

bool import_scene_write(const struct aiScene *scene, const char *extension, import_output *output,
                        import_refusal *refusal)
{
    scene_walk walk = {.scene = scene, .output = output, .refusal = refusal};
    refusal->sentence[0] = 0;
    bool good = write_scene(&walk, extension);
    strl__free(walk.meshes);
    strl__free(walk.materials);
    strl__free(walk.levels);
    strl__free(walk.corners);
    return good;
}
