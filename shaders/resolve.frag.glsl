/* Averages a block of samples in linear light. */
uniform highp sampler2D u_samples;
uniform highp int u_factor;
layout(location = 0) out highp vec4 out_colour;

void main()
{
    ivec2 first = ivec2(gl_FragCoord.xy) * u_factor;
    vec4 sum = vec4(0.0);
    for (int y = 0; y < u_factor; y++)
        for (int x = 0; x < u_factor; x++) {
            vec4 texel = texelFetch(u_samples, first + ivec2(x, y), 0);
            sum += vec4(linear_of(texel.rgb), texel.a);
        }
    sum /= float(u_factor * u_factor);
    out_colour = vec4(encoded_of(sum.rgb), sum.a);
}
