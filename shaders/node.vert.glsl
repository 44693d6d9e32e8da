/* Vertices of nodes. A lattice position reaches floats only as the exact sum anchor + offset - reference cell, so a vertex that
 * two nodes share has the same gl_Position in both, bit by bit: no cracks. View space: x right, y up, z forward. */
layout(location = 0) in ivec3 in_position;
layout(location = 1) in uvec2 in_normal;
layout(location = 2) in vec4 in_colour;

/* What the item's vertices share: instanced attributes where one call draws many items, else uniforms. */
#ifdef STRL_ITEM_ATTRIBUTES
layout(location = 3) in vec4 in_rows[6];
layout(location = 9) in ivec4 in_base[2];
#define ITEM_ROW(i) in_rows[i]
#define ITEM_BASE(i) in_base[i]
#else
uniform highp vec4 u_rows[6];
uniform highp ivec4 u_base[2];
#define ITEM_ROW(i) u_rows[i]
#define ITEM_BASE(i) u_base[i]
#endif

/* perspective: 1/tan_x, 1/tan_y, near, unused; orthographic: 1/half width, 1/half height, far, 1/(far - near) */
uniform highp vec4 u_projection;
uniform highp int u_orthographic;

uniform highp vec4 u_section; /* view space: drawn is dot(xyz, p) + w >= 0 */

out highp vec3 v_view;
out highp vec3 v_normal;
out highp vec4 v_colour;
flat out highp float v_spread; /* of the directions that a splat stands for: 0 = one, 1 = any */
flat out highp uint v_shift; /* of the pattern that thins out; 0 for triangles */
invariant gl_Position;

#define FLAG_FLOAT_POSITIONS 1

/* base (64 bits in two words) + offset, rounded to float once. */
vec3 exact_sum(ivec3 base_low, ivec3 base_high, ivec3 offset)
{
    uvec3 low = uvec3(base_low) + uvec3(offset);
    ivec3 carry = ivec3(lessThan(low, uvec3(base_low)));
    ivec3 high = base_high + (offset >> 31) + carry;
    ivec3 negative = high >> 31;
    low = (low ^ uvec3(negative)) - uvec3(negative);
    high = (high ^ negative) - (negative & ivec3(equal(low, uvec3(0u))));
    vec3 magnitude = vec3(high) * 4294967296.0 + vec3(low);
    return mix(magnitude, -magnitude, lessThan(negative, ivec3(0)));
}

vec3 decode_normal(uvec2 coordinates)
{
    vec2 p = vec2(coordinates) * (2.0 / 1023.0) - 1.0;
    float z = 1.0 - abs(p.x) - abs(p.y);
    float fold = max(-z, 0.0);
    p.x += p.x >= 0.0 ? -fold : fold;
    p.y += p.y >= 0.0 ? -fold : fold;
    return normalize(vec3(p, z));
}

uint hash(uvec3 cell)
{
    uint h = cell.x * 0x9e3779b1u ^ cell.y * 0x85ebca77u ^ cell.z * 0xc2b2ae3du;
    h = (h ^ h >> 15) * 0x2c1b3c6du;
    h = (h ^ h >> 12) * 0x297a2d39u;
    return h ^ h >> 15;
}

void main()
{
    vec4 row_x = ITEM_ROW(0), row_y = ITEM_ROW(1), row_z = ITEM_ROW(2);
    ivec4 low = ITEM_BASE(0), high = ITEM_BASE(1);
    vec3 local = (low.w & FLAG_FLOAT_POSITIONS) != 0 ? intBitsToFloat(in_position) : exact_sum(low.xyz, high.xyz, in_position);
    vec3 view = vec3(dot(row_x.xyz, local) + row_x.w, dot(row_y.xyz, local) + row_y.w, dot(row_z.xyz, local) + row_z.w);

#ifndef GL_ES
    gl_ClipDistance[0] = dot(u_section.xyz, view) + u_section.w;
#endif

    gl_PointSize = intBitsToFloat(high.w);
    /* By place and colour: what lies in one cell and is of several trees shows through each other. */
    v_shift = high.w != 0 ? hash(uvec3(in_position) ^ uvec3(in_colour.rgb * 255.0 + 0.5) << 23) : 0u;
    vec3 normal = decode_normal(in_normal & 1023u);
    v_spread = float(in_normal.x >> 10) / 63.0;
    v_view = view;
    v_normal = vec3(dot(ITEM_ROW(3).xyz, normal), dot(ITEM_ROW(4).xyz, normal), dot(ITEM_ROW(5).xyz, normal));
    vec3 tint = vec3(ITEM_ROW(3).w, ITEM_ROW(4).w, ITEM_ROW(5).w);
    vec3 own = tint.x < -1.5 ? mix(-2.0 - tint, in_colour.rgb, 0.25) : in_colour.rgb; /* a marked placement */
    v_colour = vec4(tint.x >= 0.0 ? tint : linear_of(own), in_colour.a);

    /* Reversed depth: near / z, or linear where orthographic. */
    if (u_orthographic != 0) {
        float depth = (u_projection.z - view.z) * u_projection.w;
#ifdef STRL_SYMMETRIC_DEPTH
        depth = 2.0 * depth - 1.0;
#endif
        gl_Position = vec4(view.xy * u_projection.xy, depth, 1.0);
    } else {
#ifdef STRL_SYMMETRIC_DEPTH
        /* Only clips; the fragment shader writes the depth. */
        gl_Position = vec4(view.xy * u_projection.xy, view.z - 2.0 * u_projection.z, view.z);
#else
        gl_Position = vec4(view.xy * u_projection.xy, u_projection.z, view.z);
#endif
    }
}
