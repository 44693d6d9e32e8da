#include "geometry/mesh.h"

bool strl_mesh_create(strl_mesh *mesh, uint32_t points, uint32_t wedges, uint32_t triangles, strl_arena *arena)
{
    *mesh = (strl_mesh){.point_count = points, .wedge_count = wedges, .triangle_count = triangles};
    mesh->position = strl_arena_alloc(arena, points, sizeof *mesh->position);
    mesh->flags = strl_arena_alloc_zero(arena, points, sizeof *mesh->flags);
    mesh->wedge = strl_arena_alloc(arena, wedges, sizeof *mesh->wedge);
    mesh->triangle = strl_arena_alloc(arena, triangles, sizeof *mesh->triangle);
    mesh->drift = strl_arena_alloc(arena, triangles, sizeof *mesh->drift);
    mesh->deviation = strl_arena_alloc(arena, triangles, sizeof *mesh->deviation);
    mesh->shift = strl_arena_alloc(arena, triangles, sizeof *mesh->shift);
    return mesh->position && mesh->flags && mesh->wedge && mesh->triangle && mesh->drift && mesh->deviation &&
           mesh->shift;
}
