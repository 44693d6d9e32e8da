#include "traits.h"

#include <assimp/material.h>
#include <assimp/metadata.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define FBX_UNIT_METRES 0.01 /* its lengths are in centimetres times a factor */

/* Formats with z up whose importers leave it so; others turn y up, or have it up. */
static const char *const z_up[] = {"3mf", "amf", "blend", "cob", "enff", "nff", "off", "raw", "smd", "vta"};
/* Whose importers scale to metres. */
static const char *const metric[] = {"dae", "glb", "gltf", "ifc", "ifczip", "step", "stp", "zae"};

/* A number under a key of the scene's; false where there is none. */
static bool find_number(const struct aiScene *scene, const char *key, double *value)
{
    const struct aiMetadata *data = scene->mMetaData;
    for (unsigned i = 0; data && i < data->mNumProperties; i++) {
        const struct aiMetadataEntry *entry = &data->mValues[i];
        if (strcmp(data->mKeys[i].data, key) != 0 || !entry->mData)
            continue;
        if (entry->mType == AI_INT32)
            *value = *(const int32_t *)entry->mData;
        else if (entry->mType == AI_FLOAT)
            *value = (double)*(const float *)entry->mData;
        else if (entry->mType == AI_DOUBLE)
            *value = *(const double *)entry->mData;
        else
            return false;
        return true;
    }
    return false;
}

static bool is_among(const char *word, const char *const *words, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (strcmp(word, words[i]) == 0)
            return true;
    return false;
}

void import_traits_directions(const struct aiScene *scene, const char *extension, import_facts *facts)
{
    double value;
    facts->up = is_among(extension, z_up, sizeof z_up / sizeof *z_up) ? 2 : 1;
    facts->unit_metres = is_among(extension, metric, sizeof metric / sizeof *metric) ? 1 : 0;
    if (strcmp(extension, "fbx") != 0)
        return;
    /* Told and not applied by the importer: as we do. */
    if (find_number(scene, "UpAxis", &value) && value >= 0 && value <= 2)
        facts->up = (unsigned)value;
    if (find_number(scene, "UnitScaleFactor", &value) && value > 0 && isfinite(value))
        facts->unit_metres = value * FBX_UNIT_METRES;
}

static uint32_t channel(double value)
{
    return value >= 1 || isnan(value) ? 255 : value > 0 ? (uint32_t)(value * 255 + 0.5) : 0;
}

static uint32_t pack(const struct aiColor4D *colour, double alpha)
{
    return channel((double)colour->r) | channel((double)colour->g) << 8 | channel((double)colour->b) << 16 |
           channel(alpha) << 24;
}

uint32_t import_traits_colour(const struct aiColor4D *colour)
{
    return pack(colour, (double)colour->a);
}

/* What assimp makes where a file has no material, grey so that its own viewer shows shades. */
static bool is_placeholder(const struct aiColor4D *colour, const char *name)
{
    return (!*name || strcmp(name, AI_DEFAULT_MATERIAL_NAME) == 0) && colour->r == 0.6f && colour->g == 0.6f &&
           colour->b == 0.6f;
}

uint32_t import_traits_material(const struct aiMaterial *material, char *name)
{
    struct aiColor4D colour = {1, 1, 1, 1};
    struct aiString text = {0};
    ai_real opacity = 1;
    unsigned one = 1;
    name[0] = 0;
    if (aiGetMaterialString(material, AI_MATKEY_NAME, &text) == aiReturn_SUCCESS)
        snprintf(name, STRL_IMPORT_NAME_MOST + 1, "%s", text.data);
    if (aiGetMaterialColor(material, AI_MATKEY_BASE_COLOR, &colour) != aiReturn_SUCCESS &&
        aiGetMaterialColor(material, AI_MATKEY_COLOR_DIFFUSE, &colour) != aiReturn_SUCCESS)
        return 0xffffffffu;
    if (is_placeholder(&colour, name))
        return 0xffffffffu;
    aiGetMaterialFloatArray(material, AI_MATKEY_OPACITY, &opacity, &one);
    /* Several exporters write 0 where they mean that nothing is said; what cannot be seen nobody would have kept. */
    double alpha = opacity > 0 ? (double)opacity : 1;
    return pack(&colour, alpha);
}
