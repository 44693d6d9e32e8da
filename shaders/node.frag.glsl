/* Light from the eye plus a sky hemisphere, in linear light, two-sided. Both lights fade with the angle of view, so nothing jumps
 * where a normal turns away from the eye. */
in highp vec3 v_view;
in highp vec3 v_normal;
in highp vec4 v_colour;
flat in highp float v_spread;
flat in highp uint v_shift;

uniform highp vec4 u_projection;
uniform highp int u_orthographic;
uniform highp vec3 u_sky_up; /* view space, unit */
uniform highp float u_headlight;
uniform highp int u_flat;
#if defined(STRL_ALPHA) && defined(GL_ES)
uniform highp vec4 u_section; /* ES has no clip distances */
#endif

layout(location = 0) out highp vec4 out_colour;

const vec3 AMBIENT = vec3(0.06);
const vec3 SKY = vec3(0.26, 0.29, 0.34);
const vec3 GROUND = vec3(0.09, 0.08, 0.06);

/* Ordered 8x8 pattern of the pixel grid: 0 to 63. */
int bayer(ivec2 pixel)
{
    int x = (pixel.x ^ pixel.y) & 7, y = pixel.y & 7;
    return ((x & 1) << 5) | ((y & 1) << 4) | ((x & 2) << 2) | ((y & 2) << 1) | ((x & 4) >> 1) | ((y & 4) >> 2);
}

#ifdef STRL_ALPHA
/* Of what is spread, more is seen of the faces that are turned to the eye. Their directions lie about the mean normal like a power of the
 * cosine: the mean of squares is `along` it and `across` it; `turned` is the mean of normals as often as they are seen. What is seen faces
 * the eye by the root of the mean square, of any direction by 2 / 3. */
void spread(vec3 normal, vec3 to_eye, inout float facing, inout float up)
{
    float mean = 1.0 - 0.5 * v_spread, along = mean / (2.0 - mean), across = 0.5 - 0.5 * along;
    vec3 turned = across * to_eye + (along - across) * dot(normal, to_eye) * normal;
    facing = sqrt(max(dot(turned, to_eye), 0.0)) * mix(1.0, 1.1547, v_spread);
    up = dot(normalize(turned), u_sky_up);
}
#endif

void main()
{
    vec3 normal = v_normal;
    if (u_flat != 0)
        normal = cross(dFdx(v_view), dFdy(v_view));
#if defined(STRL_ALPHA) && defined(GL_ES)
    if (dot(u_section.xyz, v_view) + u_section.w < 0.0)
        discard;
#endif
#ifdef STRL_ALPHA
    /* Splats of one pixel hide each other by chance: each has the pattern shifted, finer than its steps. */
    int threshold = (bayer(ivec2(gl_FragCoord.xy)) + int(v_shift & 63u)) & 63;
    float within = v_shift != 0u ? (float(v_shift >> 6 & 255u) + 0.5) / 256.0 : 0.5;
    if (v_colour.a * 64.0 < float(threshold) + within)
        discard;
#endif
    float length_squared = dot(normal, normal);
    normal = length_squared > 0.0 ? normal * inversesqrt(length_squared) : vec3(0.0, 0.0, -1.0);
    vec3 to_eye = u_orthographic != 0 ? vec3(0.0, 0.0, -1.0) : -normalize(v_view);
    float facing = dot(normal, to_eye);
    float up = dot(facing < 0.0 ? -normal : normal, u_sky_up);
    facing = abs(facing);
#ifdef STRL_ALPHA
    if (v_spread > 0.0)
        spread(normal, to_eye, facing, up);
#endif
    vec3 light = AMBIENT + facing * (facing * u_headlight + mix(GROUND, SKY, 0.5 + 0.5 * up));
    out_colour = vec4(encoded_of(v_colour.rgb * light), 1.0);
#ifdef STRL_SYMMETRIC_DEPTH
    gl_FragDepth = u_orthographic != 0 ? gl_FragCoord.z : u_projection.z * gl_FragCoord.w;
#endif
}
