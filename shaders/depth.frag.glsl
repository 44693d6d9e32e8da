/* From the depth buffer to the distance along the view direction, as the bits of a float: every system can read integers back. */
uniform highp sampler2D u_samples;
uniform highp int u_factor;
uniform highp vec4 u_projection;
uniform highp int u_orthographic;
layout(location = 0) out highp uint out_bits;

void main()
{
    float depth = texelFetch(u_samples, ivec2(gl_FragCoord.xy) * u_factor + u_factor / 2, 0).r;
    float distance = u_orthographic != 0 ? u_projection.z - depth / u_projection.w : u_projection.z / depth;
    out_bits = depth > 0.0 ? floatBitsToUint(distance) : 0x7f800000u;
}
