#include "readers/gltf_draco.h"

#include <cstdio>
#include <cstring>
#include <exception>
#include <memory>
#include <new>

#include <draco/compression/decode.h>
#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>

struct strl__draco {
    std::unique_ptr<draco::Mesh> mesh;
};

namespace
{

/* The start of a bitstream, as its specification has it:
 * https://google.github.io/draco/spec/ (header, metadata, connectivity). */
struct start {
    const uint8_t *at, *end;
    bool failed = false;

    uint64_t bytes(unsigned count)
    {
        uint64_t value = 0;
        if (static_cast<size_t>(end - at) < count) {
            failed = true;
            return 0;
        }
        for (unsigned i = 0; i < count; i++)
            value |= static_cast<uint64_t>(*at++) << (8 * i);
        return value;
    }
    uint64_t varint()
    {
        uint64_t value = 0;
        for (unsigned shift = 0; shift < 63; shift += 7) {
            uint64_t byte = bytes(1);
            value |= (byte & 127) << shift;
            if (failed || byte < 128)
                return value;
        }
        failed = true;
        return 0;
    }
    void skip(uint64_t count)
    {
        if (static_cast<uint64_t>(end - at) < count)
            failed = true;
        else
            at += count;
    }
    void skip_metadata(unsigned depth)
    {
        uint64_t entries = varint();
        for (uint64_t i = 0; i < entries && !failed; i++) {
            skip(bytes(1));
            skip(varint());
        }
        uint64_t inner = varint();
        failed = failed || depth > 16;
        for (uint64_t i = 0; i < inner && !failed; i++) {
            skip(bytes(1));
            skip_metadata(depth + 1);
        }
    }
};

constexpr unsigned metadata_flag = 0x8000;
constexpr unsigned triangular_mesh = 1;
constexpr unsigned edgebreaker = 1;

void skip_all_metadata(start &in)
{
    uint64_t attributes = in.varint();
    for (uint64_t i = 0; i < attributes && !in.failed; i++) {
        in.varint();
        in.skip_metadata(0);
    }
    in.skip_metadata(0);
}

/* What libdraco takes, about: it allocates by itself, so that its wants must be known before. Of a
 * face the corner table and the way through it, for each attribute with seams of its own a table
 * more. Of a point its place in each attribute, and of a component its symbol, its integer and
 * itself. */
constexpr uint64_t face_bytes = 160, seam_bytes = 48, mapping_bytes = 16, component_bytes = 8;

uint64_t add_product(uint64_t sum, uint64_t a, uint64_t b)
{
    uint64_t product;
    if (__builtin_mul_overflow(a, b, &product) || __builtin_add_overflow(sum, product, &sum))
        return UINT64_MAX;
    return sum;
}

/* libdraco makes an object of each descriptor, of five bytes, before anything of them can be counted. Real meshes have
 * four or five. */
constexpr uint64_t most_attributes = 256;

/* How many attributes the bytes announce behind the faces, up to more than are read (its specification,
 * "ParseAttributeDecodersData"). */
uint64_t count_attributes(start in, bool is_edgebreaker)
{
    const uint64_t decoders = in.bytes(1);
    uint64_t count = 0;
    if (is_edgebreaker)
        in.skip(3 * decoders);
    for (uint64_t i = 0; i < decoders && !in.failed && count <= most_attributes; i++) {
        const uint64_t attributes = in.varint();
        count = in.failed ? count : add_product(count, attributes, 1);
        for (uint64_t k = 0; k < attributes && !in.failed && count <= most_attributes; k++) {
            in.skip(4); /* kind, type, components, whether normalized */
            in.varint();
        }
        in.skip(attributes); /* how each is coded */
    }
    return count;
}

/* Stops where the attributes, which are known before their values are decoded, are too many or take too much. */
template <class Decoder> class bounded : public Decoder
{
  public:
    bounded(uint64_t most, bool is_edgebreaker) : most_(most), is_edgebreaker_(is_edgebreaker) {}
    uint64_t wanted = 0; /* bytes of attributes */
    bool has_too_many = false;

  protected:
    bool DecodePointAttributes() override
    {
        const uint8_t *at = reinterpret_cast<const uint8_t *>(this->buffer()->data_head());
        const start in{at, at + this->buffer()->remaining_size()};
        has_too_many = count_attributes(in, is_edgebreaker_) > most_attributes;
        return !has_too_many && Decoder::DecodePointAttributes();
    }

    bool DecodeAllAttributes() override
    {
        const draco::PointCloud *cloud = this->point_cloud();
        for (int i = 0; i < cloud->num_attributes(); i++) {
            const draco::PointAttribute *attribute = cloud->attribute(i);
            const uint64_t size = static_cast<uint64_t>(draco::DataTypeLength(attribute->data_type()));
            const uint64_t components = static_cast<uint64_t>(attribute->num_components());
            wanted = add_product(wanted, cloud->num_points(), mapping_bytes + components * (component_bytes + size));
        }
        return wanted <= most_ && Decoder::DecodeAllAttributes();
    }

  private:
    uint64_t most_;
    bool is_edgebreaker_;
};

template <class Decoder>
std::unique_ptr<draco::Mesh> decode_bounded(const uint8_t *data, size_t size, const strl__draco_facts *facts,
                                            strl__draco_room *room, char why[120])
{
    draco::DecoderBuffer buffer;
    draco::DecoderOptions options;
    bounded<Decoder> decoder(room->bytes, facts->is_edgebreaker);
    std::unique_ptr<draco::Mesh> mesh(new draco::Mesh);
    buffer.Init(reinterpret_cast<const char *>(data), size);
    const draco::Status status = decoder.Decode(options, &buffer, mesh.get());
    room->wanted = decoder.wanted;
    if (status.ok())
        return mesh;
    if (decoder.has_too_many)
        std::snprintf(why, 120, "it has more than the %u attributes that are read",
                      static_cast<unsigned>(most_attributes));
    else
        std::snprintf(why, 120, "%s", status.error_msg());
    return nullptr;
}

} // namespace

int strl__draco_announced(const uint8_t *data, size_t size, strl__draco_facts *facts)
{
    start in{data, data + size};
    *facts = strl__draco_facts{};
    if (size < 11 || std::memcmp(data, "DRACO", 5) != 0)
        return -1;
    in.skip(5);
    const unsigned major = static_cast<unsigned>(in.bytes(1));
    const unsigned minor = static_cast<unsigned>(in.bytes(1));
    const unsigned type = static_cast<unsigned>(in.bytes(1));
    const unsigned method = static_cast<unsigned>(in.bytes(1));
    const unsigned flags = static_cast<unsigned>(in.bytes(2));
    if (major != 2 || minor < 2 || type != triangular_mesh || method > edgebreaker)
        return -1;
    if (flags & metadata_flag)
        skip_all_metadata(in);
    uint64_t seams = 0;
    if (method == edgebreaker) {
        in.skip(1); /* the way of traversal */
        facts->points = in.varint();
        facts->faces = in.varint();
        seams = in.bytes(1);
    } else {
        facts->faces = in.varint();
        facts->points = in.varint();
    }
    facts->is_edgebreaker = method == edgebreaker;
    facts->connectivity_bytes = add_product(size, facts->faces, face_bytes + seams * seam_bytes);
    return in.failed ? -1 : 0;
}

strl__draco *strl__draco_decode(const uint8_t *data, size_t size, const strl__draco_facts *facts,
                                strl__draco_room *room, char why[120])
{
    room->wanted = 0;
    std::snprintf(why, 120, "no memory");
    try {
        std::unique_ptr<strl__draco> mesh(new strl__draco);
        mesh->mesh = facts->is_edgebreaker ? decode_bounded<draco::MeshEdgebreakerDecoder>(data, size, facts, room, why)
                                           : decode_bounded<draco::MeshSequentialDecoder>(data, size, facts, room, why);
        return mesh->mesh ? mesh.release() : nullptr;
    } catch (const std::exception &) {
        return nullptr;
    }
}

uint64_t strl__draco_face_count(const strl__draco *mesh)
{
    return mesh->mesh->num_faces();
}

uint64_t strl__draco_point_count(const strl__draco *mesh)
{
    return mesh->mesh->num_points();
}

void strl__draco_faces(const strl__draco *mesh, uint64_t first, size_t count, uint32_t *corners)
{
    for (size_t i = 0; i < count; i++) {
        const auto &face = mesh->mesh->face(draco::FaceIndex(static_cast<uint32_t>(first + i)));
        for (unsigned corner = 0; corner < 3; corner++)
            corners[3 * i + corner] = face[corner].value();
    }
}

unsigned strl__draco_components(const strl__draco *mesh, uint32_t id)
{
    const draco::PointAttribute *attribute = mesh->mesh->GetAttributeByUniqueId(id);
    return attribute ? static_cast<unsigned>(attribute->num_components()) : 0;
}

int strl__draco_numbers(const strl__draco *mesh, uint32_t id, uint64_t first, size_t count, unsigned components,
                        double *numbers)
{
    const draco::PointAttribute *attribute = mesh->mesh->GetAttributeByUniqueId(id);
    if (!attribute || components > 4 || attribute->num_components() != static_cast<int>(components))
        return -1;
    for (size_t i = 0; i < count; i++) {
        const auto value = attribute->mapped_index(draco::PointIndex(static_cast<uint32_t>(first + i)));
        float reals[4];
        int32_t integers[4];
        bool good = value.value() < attribute->size();
        if (good && attribute->data_type() == draco::DT_FLOAT32)
            good = attribute->ConvertValue<float>(value, static_cast<int8_t>(components), reals);
        else if (good)
            good = attribute->ConvertValue<int32_t>(value, static_cast<int8_t>(components), integers);
        if (!good)
            return -1;
        for (unsigned k = 0; k < components; k++)
            numbers[i * components + k] =
                attribute->data_type() == draco::DT_FLOAT32 ? static_cast<double>(reals[k]) : integers[k];
    }
    return 0;
}

void strl__draco_close(strl__draco *mesh)
{
    delete mesh;
}
