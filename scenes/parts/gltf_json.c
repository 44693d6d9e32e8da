/* See gltf_json.h. */
#include "scenes/parts/gltf_json.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/fail.h"

enum { TEXT_MOST = 400 };

strl_status strl__json_print(strl__stream *stream, strl_error *err, const char *format, ...)
{
    char text[TEXT_MOST + 1];
    va_list arguments;
    va_start(arguments, format);
    int length = vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (length < 0 || length > TEXT_MOST)
        return strl__fail(err, STRL_ERR_INTERNAL, "a piece of glTF has %d characters, expected at most %d", length,
                          TEXT_MOST);
    return strl__stream_write(stream, text, (uint64_t)length, err);
}

strl_status strl__json_floats(strl__stream *stream, const char *name, const float *values, int count, strl_error *err)
{
    strl_status status = strl__json_print(stream, err, ",\"%s\":[", name);
    for (int i = 0; status == STRL_OK && i < count; i++) {
        int digits = 4;
        char text[320]; /* %g may be told to write more than it ever does */
        do
            snprintf(text, sizeof text, "%.*g", digits++, (double)values[i]);
        while (strtof(text, NULL) != values[i]);
        status = strl__json_print(stream, err, "%s%s", i ? "," : "", text);
    }
    return status == STRL_OK ? strl__json_print(stream, err, "]") : status;
}

/* -0 is written as 0. */
static strl_status put_numbers(strl__stream *stream, const char *name, const double *values, int count, strl_error *err)
{
    strl_status status = strl__json_print(stream, err, ",\"%s\":[", name);
    for (int i = 0; status == STRL_OK && i < count; i++)
        status = strl__json_print(stream, err, "%s%.9g", i ? "," : "", values[i] + 0.0);
    return status == STRL_OK ? strl__json_print(stream, err, "]") : status;
}

/* Of a rotation (Shepperd's choice of the largest component). */
static void find_quaternion(const double axis[3][3], double q[4])
{
    double trace = axis[0][0] + axis[1][1] + axis[2][2];
    int largest = 3;
    for (int i = 0; i < 3; i++)
        if (axis[i][i] > (largest == 3 ? trace : axis[largest][largest]))
            largest = i;
    if (largest == 3) {
        double s = 2 * sqrt(1 + trace);
        q[3] = s / 4;
        for (int i = 0; i < 3; i++)
            q[i] = (axis[(i + 1) % 3][(i + 2) % 3] - axis[(i + 2) % 3][(i + 1) % 3]) / s;
        return;
    }
    int a = largest, b = (a + 1) % 3, c = (a + 2) % 3;
    double s = 2 * sqrt(1 + axis[a][a] - axis[b][b] - axis[c][c]);
    q[a] = s / 4;
    q[b] = (axis[a][b] + axis[b][a]) / s;
    q[c] = (axis[a][c] + axis[c][a]) / s;
    q[3] = (axis[b][c] - axis[c][b]) / s;
}

static bool is_straight(const strl__affine *place)
{
    bool straight = true;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            straight &= i == k || place->axis[i][k] == 0;
    return straight;
}

static strl_status put_matrix(strl__stream *stream, const strl__affine *place, strl_error *err)
{
    double matrix[16] = {0};
    for (int i = 0; i < 3; i++) {
        memcpy(matrix + 4 * i, place->axis[i], sizeof place->axis[i]);
        matrix[12 + i] = place->origin[i];
    }
    matrix[15] = 1;
    return put_numbers(stream, "matrix", matrix, 16, err);
}

strl_status strl__json_place(strl__stream *stream, const strl__affine *place, bool as_matrix, strl_error *err)
{
    const double *origin = place->origin;
    double scale[3] = {place->axis[0][0], place->axis[1][1], place->axis[2][2]}, quaternion[4];
    bool straight = is_straight(place);
    if (!straight && as_matrix)
        return put_matrix(stream, place, err);
    strl_status status = STRL_OK;
    if (origin[0] != 0 || origin[1] != 0 || origin[2] != 0)
        status = put_numbers(stream, "translation", origin, 3, err);
    if (status == STRL_OK && straight && (scale[0] != 1 || scale[1] != 1 || scale[2] != 1))
        return put_numbers(stream, "scale", scale, 3, err);
    if (status != STRL_OK || straight)
        return status;
    find_quaternion(place->axis, quaternion);
    return put_numbers(stream, "rotation", quaternion, 4, err);
}

strl_status strl__json_material(strl__stream *stream, const strl__material *material, strl_error *err)
{
    const double *c = material->linear;
    strl_status status =
        strl__json_print(stream, err,
                         "{\"name\":\"%s\",\"pbrMetallicRoughness\":{\"baseColorFactor\":[%.5g,%.5g,%.5g,%.3g],"
                         "\"metallicFactor\":%.3g,\"roughnessFactor\":%.3g}",
                         material->name, c[0], c[1], c[2], material->alpha, material->metallic, material->roughness);
    if (status == STRL_OK)
        status = strl__json_print(stream, err, "%s}", material->alpha < 1 ? ",\"alphaMode\":\"BLEND\"" : "");
    return status;
}

strl_status strl__json_uri(strl__stream *stream, const char *name, strl_error *err)
{
    static const char plain[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-._~";
    strl_status status = STRL_OK;
    for (; *name && status == STRL_OK; name++)
        status = strl__json_print(stream, err, strchr(plain, *name) ? "%c" : "%%%02X", (unsigned char)*name);
    return status;
}
