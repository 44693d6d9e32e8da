/* What ingest tells people: why nothing could be built, and what was built with something amiss. */
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "build/ingest/internal.h"
#include "build/model.h"

/* Sentences about missing files; the rest is only counted. */
#define MOST_MISSING_TOLD 16u

typedef struct sentence {
    char text[320];
    size_t length;
} sentence;

__attribute__((format(printf, 2, 3))) static void add(sentence *s, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    int written = vsnprintf(s->text + s->length, sizeof s->text - s->length, format, arguments);
    va_end(arguments);
    s->length += written > 0 ? (size_t)written : 0;
    s->length = s->length < sizeof s->text ? s->length : sizeof s->text - 1;
}

/* ", 3 lines", with the noun's own plural; nothing of none. */
static void add_count(sentence *s, uint64_t count, const char *one, const char *many)
{
    if (count)
        add(s, "%s%" PRIu64 " %s", s->length ? ", " : "", count, count == 1 ? one : many);
}

static void add_drops(sentence *s, const strl_build_result *result, uint64_t collapsed)
{
    add_count(s, result->dropped_degenerate - collapsed, "face of fewer than three corners",
              "faces of fewer than three corners");
    add_count(s, result->dropped_nonfinite, "triangle with a corner that is not finite",
              "triangles with corners that are not finite");
    add_count(s, result->dropped_lines, "line", "lines");
    add_count(s, result->dropped_points, "point", "points");
}

void strl__ingest_name_inputs(const strl_build_desc *desc, char *text, size_t size)
{
    if (desc->input_count == 1)
        snprintf(text, size, "%s", desc->inputs[0]);
    else
        snprintf(text, size, "%s and %u more", desc->inputs[0], desc->input_count - 1);
}

strl_status strl__ingest_refuse_collapsed(const strl_build_context *context, const strl_ingest *ingest,
                                          uint64_t collapsed, strl_error *err)
{
    char inputs[STRL_INPUTS_NAME_BYTES];
    sentence others = {.length = 0};
    const char *advice = "";
    if (context->desc->grid > 0 && ingest->step > ingest->finest_step)
        advice = ", a smaller --grid may keep some";
    else if (ingest->step <= ingest->finest_step)
        advice = ", the finest that the extent allows: build what lies far apart into files of its own";
    add_drops(&others, context->result, collapsed);
    strl__ingest_name_inputs(context->desc, inputs, sizeof inputs);
    return strl__fail(err, STRL_ERR_FORMAT,
                      "%s: no triangle is left: %" PRIu64 " lose%s their area on the lattice of step %g%s%s%s", inputs,
                      collapsed, collapsed == 1 ? "s" : "", ingest->step, advice, others.length ? "; also found " : "",
                      others.text);
}

/* The caller's sentence; the library itself never prints. */
__attribute__((format(printf, 2, 3))) static void warn(const strl_build_context *context, const char *format, ...)
{
    char text[1600]; /* names are up to 1023 bytes long */
    va_list arguments;
    if (!context->desc->warn)
        return;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    context->desc->warn(context->desc->context, text);
}

static void warn_of_missing(strl_build_context *context, strl_reader *const *readers)
{
    uint32_t told = 0;
    for (uint32_t i = 0; i < context->desc->input_count; i++) {
        uint32_t count = strl_reader_missing_count(readers[i]);
        context->result->missing_libraries += count;
        for (uint32_t m = 0; m < count && told < MOST_MISSING_TOLD; m++, told++)
            warn(context, "%s: %s; the materials that it would define are white", context->desc->inputs[i],
                 strl_reader_missing(readers[i], m));
    }
    if (told < context->result->missing_libraries)
        warn(context, "%" PRIu64 " more material libraries cannot be read", context->result->missing_libraries - told);
}

static void warn_of_unread(const strl_build_context *context, strl_reader *const *readers)
{
    for (uint32_t i = 0; i < context->desc->input_count; i++) {
        strl_reader_drops drops;
        strl_reader_drops_get(readers[i], &drops);
        if (drops.unread_bytes)
            warn(context,
                 "%s: %" PRIu64
                 " byte%s behind the last record that its header announces %s not read: a count in the header may "
                 "be too small",
                 context->desc->inputs[i], drops.unread_bytes, drops.unread_bytes == 1 ? "" : "s",
                 drops.unread_bytes == 1 ? "is" : "are");
    }
}

/* A model of lines alone is a model, and a script that builds a hundred files should not end at it. But where triangles
 * were read none of which could be kept something is broken, and of a text whose name ends in .obj an empty model would
 * be no answer. */
strl_status strl__ingest_check_empty(strl_build_context *context, strl_reader *const *readers, strl_error *err)
{
    char inputs[STRL_INPUTS_NAME_BYTES];
    sentence found = {.length = 0};
    uint64_t vertices = 0;
    bool certain = true;
    for (uint32_t i = 0; i < context->desc->input_count; i++) {
        strl_reader_info info;
        strl_reader_info_get(readers[i], &info);
        certain = certain && info.is_certain;
        vertices += strl_reader_vertex_count(readers[i]);
    }
    add_drops(&found, context->result, 0);
    if (!found.length)
        add_count(&found, vertices, "vertex", "vertices");
    strl__ingest_name_inputs(context->desc, inputs, sizeof inputs);
    if (context->result->dropped_nonfinite || (!found.length && !certain))
        return strl__fail(err, STRL_ERR_FORMAT, "%s: expected a triangle, found %s", inputs,
                          found.length ? found.text : "no vertex and no face");
    warn_of_missing(context, readers);
    warn_of_unread(context, readers);
    warn(context, "%s: found %s%sno triangle: the model is empty", inputs, found.text, found.length ? " and " : "");
    return STRL_OK;
}

/* One sentence for them all, of the first. */
static void warn_of_images(strl_build_context *context, strl_reader *const *readers)
{
    uint64_t count = 0;
    uint32_t first = 0;
    for (uint32_t i = context->desc->input_count; i-- > 0;) {
        const uint32_t here = strl_reader_missing_image_count(readers[i]);
        first = here ? i : first;
        count += here;
    }
    context->result->missing_images = count;
    if (count == 1)
        warn(context, "%s: %s; its material has its colour alone", context->desc->inputs[first],
             strl_reader_missing_image(readers[first]));
    else if (count)
        warn(context, "%s: %s, and %" PRIu64 " more image%s cannot be used; their materials have their colours alone",
             context->desc->inputs[first], strl_reader_missing_image(readers[first]), count - 1, count == 2 ? "" : "s");
}

void strl__ingest_warn(strl_build_context *context, strl_reader *const *readers, const strl_ingest *ingest)
{
    if (strl__model_is_last_tree(context)) {
        warn_of_missing(context, readers);
        warn_of_unread(context, readers);
        warn_of_images(context, readers);
    }
    if (!ingest->is_coarse)
        return;
    char inputs[STRL_INPUTS_NAME_BYTES];
    strl__ingest_name_inputs(context->desc, inputs, sizeof inputs);
    context->result->coarse_lattices++;
    warn(context,
         "%s: the lattice step %g is more than a sixteenth of a short edge, %g, but the extent allows none finer: "
         "build what lies far apart into files of its own",
         inputs, ingest->step, ingest->short_edge);
}
