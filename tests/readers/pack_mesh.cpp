/* What the tests of the glTF reader compress, with the libraries' own encoders, from standard input to standard output:
 *
 *   pack_mesh attributes|triangles|indices COUNT STRIDE        raw elements
 *   pack_mesh octahedral|quaternion|exponential COUNT STRIDE   floats, 4 an element (exponential: STRIDE / 4),
 *                                                              filtered, then packed as attributes
 *   pack_mesh draco edgebreaker|sequential FACES COLOURS [EXTRA]   corners: 3 floats of position, 3 of normal, and with
 *                                                              COLOURS = 1 four bytes of colour; the number of points
 *                                                              goes to standard error. EXTRA attributes of 16 shorts,
 * all 0, are added */
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <meshoptimizer.h>

static std::vector<unsigned char> read_all()
{
    std::vector<unsigned char> bytes;
    for (int c = getchar(); c != EOF; c = getchar())
        bytes.push_back(static_cast<unsigned char>(c));
    return bytes;
}

static int write_all(const void *bytes, size_t size)
{
    return fwrite(bytes, 1, size, stdout) == size ? 0 : 1;
}

static std::vector<unsigned char> filter(const std::string &kind, const std::vector<unsigned char> &raw, size_t count,
                                         size_t stride)
{
    std::vector<unsigned char> filtered(count * stride);
    const float *values = reinterpret_cast<const float *>(raw.data());
    if (kind == "octahedral")
        meshopt_encodeFilterOct(filtered.data(), count, stride, stride == 4 ? 8 : 16, values);
    else if (kind == "quaternion")
        meshopt_encodeFilterQuat(filtered.data(), count, stride, 16, values);
    else
        meshopt_encodeFilterExp(filtered.data(), count, stride, 20, values);
    return filtered;
}

static int pack_meshopt(const std::string &kind, size_t count, size_t stride)
{
    std::vector<unsigned char> raw = read_all(), packed;
    if (kind == "triangles" || kind == "indices") {
        std::vector<unsigned> indices(count);
        for (size_t i = 0; i < count; i++) {
            uint32_t index = 0;
            memcpy(&index, &raw[i * stride], stride);
            indices[i] = index;
        }
        const bool list = kind == "triangles";
        packed.resize(list ? meshopt_encodeIndexBufferBound(count, 65536)
                           : meshopt_encodeIndexSequenceBound(count, 65536));
        packed.resize(list ? meshopt_encodeIndexBuffer(packed.data(), packed.size(), indices.data(), count)
                           : meshopt_encodeIndexSequence(packed.data(), packed.size(), indices.data(), count));
    } else {
        if (kind != "attributes")
            raw = filter(kind, raw, count, stride);
        packed.resize(meshopt_encodeVertexBufferBound(count, stride));
        packed.resize(meshopt_encodeVertexBuffer(packed.data(), packed.size(), raw.data(), count, stride));
    }
    return write_all(packed.data(), packed.size());
}

static int pack_draco(const std::string &method, uint32_t faces, bool colours, int extra)
{
    const std::vector<unsigned char> raw = read_all();
    const size_t corner = 24 + (colours ? 4 : 0);
    draco::TriangleSoupMeshBuilder builder;
    if (raw.size() != faces * 3 * corner)
        return 1;
    builder.Start(static_cast<int>(faces));
    const int position = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
    const int normal = builder.AddAttribute(draco::GeometryAttribute::NORMAL, 3, draco::DT_FLOAT32);
    const int colour = colours ? builder.AddAttribute(draco::GeometryAttribute::COLOR, 4, draco::DT_UINT8, true) : -1;
    static const int16_t zeros[16] = {};
    std::vector<int> extras;
    for (int i = 0; i < extra; i++)
        extras.push_back(builder.AddAttribute(draco::GeometryAttribute::GENERIC, 16, draco::DT_INT16));
    for (uint32_t face = 0; face < faces; face++) {
        const unsigned char *at = &raw[face * 3 * corner];
        const draco::FaceIndex index(face);
        builder.SetAttributeValuesForFace(position, index, at, at + corner, at + 2 * corner);
        builder.SetAttributeValuesForFace(normal, index, at + 12, at + corner + 12, at + 2 * corner + 12);
        for (int id : extras)
            builder.SetAttributeValuesForFace(id, index, zeros, zeros, zeros);
        if (colours)
            builder.SetAttributeValuesForFace(colour, index, at + 24, at + corner + 24, at + 2 * corner + 24);
    }
    auto mesh = builder.Finalize();
    if (!mesh)
        return 1;
    draco::Encoder encoder;
    draco::EncoderBuffer packed;
    encoder.SetEncodingMethod(method == "edgebreaker" ? draco::MESH_EDGEBREAKER_ENCODING
                                                      : draco::MESH_SEQUENTIAL_ENCODING);
    if (!encoder.EncodeMeshToBuffer(*mesh, &packed).ok())
        return 1;
    fprintf(stderr, "%u\n", mesh->num_points());
    return write_all(packed.data(), packed.size());
}

int main(int argc, char **argv)
{
    if ((argc == 5 || argc == 6) && strcmp(argv[1], "draco") == 0)
        return pack_draco(argv[2], static_cast<uint32_t>(atoi(argv[3])), atoi(argv[4]) != 0,
                          argc == 6 ? atoi(argv[5]) : 0);
    if (argc == 4)
        return pack_meshopt(argv[1], static_cast<size_t>(atoi(argv[2])), static_cast<size_t>(atoi(argv[3])));
    fprintf(stderr, "pack_mesh: see its source for usage\n");
    return 2;
}
