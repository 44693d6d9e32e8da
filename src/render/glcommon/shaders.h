/* The texts of shaders/, embedded by the build; without version line. */
#ifndef STRL_RENDER_GLCOMMON_SHADERS_H
#define STRL_RENDER_GLCOMMON_SHADERS_H

extern const char strl__shader_srgb[];
extern const char strl__shader_node_vert[];
extern const char strl__shader_node_frag[];
extern const char strl__shader_screen_vert[];
extern const char strl__shader_resolve_frag[];
extern const char strl__shader_depth_frag[];

#endif
