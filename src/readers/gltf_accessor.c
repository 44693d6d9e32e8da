/* Elements of accessors, read through a window. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "readers/gltf.h"

static unsigned element_bytes(const strl__gltf_column *column)
{
    return strl__scalar_bytes(column->type) * column->components;
}

static uint32_t stride_of(const strl__gltf *gltf, const strl__gltf_column *column)
{
    uint32_t stride = gltf->views[column->view].stride;
    return stride ? stride : element_bytes(column);
}

/* ---- checks */

strl_status strl__gltf_check_view(strl__gltf *gltf, uint32_t index, strl_error *err)
{
    const char *path = gltf->reader->path;
    char where[40];
    snprintf(where, sizeof where, ", bufferViews[%u].buffer", index);
    if (index >= gltf->view_count)
        return strl__gltf_fail_index(gltf, "", "bufferViews", gltf->view_count, index, err);
    strl__gltf_view *view = &gltf->views[index];
    strl_status status = STRL_OK;
    uint64_t end;
    if (view->is_checked)
        return STRL_OK;
    if (view->meshopt) {
        status = strl__gltf_check_meshopt(gltf, index, err);
    } else if (view->buffer >= gltf->buffer_count) {
        status = strl__gltf_fail_index(gltf, where, "buffers", gltf->buffer_count, view->buffer, err);
    } else if (__builtin_add_overflow(view->offset, view->bytes, &end) || end > gltf->buffers[view->buffer].bytes) {
        status = strl__fail(err, STRL_ERR_FORMAT,
                            "%s, bufferViews[%u]: its %" PRIu64 " bytes at %" PRIu64 " end after the %" PRIu64
                            " of buffers[%u]",
                            path, index, view->bytes, view->offset, gltf->buffers[view->buffer].bytes, view->buffer);
    } else {
        status = strl__gltf_open_buffer(gltf, view->buffer, err);
    }
    view->is_checked = !status;
    return status;
}

static strl_status check_column(strl__gltf *gltf, uint32_t accessor, const char *what, const strl__gltf_column *column,
                                uint64_t count, strl_error *err)
{
    if (column->view == STRL__NO_ITEM || count == 0)
        return STRL_OK;
    strl_status status = strl__gltf_check_view(gltf, column->view, err);
    if (status)
        return status;
    const uint64_t stride = stride_of(gltf, column), bytes = gltf->views[column->view].bytes;
    uint64_t end; /* count is below 2^32 and stride small: only the offset can overflow */
    if (!__builtin_add_overflow(column->offset, (count - 1) * stride + element_bytes(column), &end) && end <= bytes)
        return STRL_OK;
    return strl__fail(err, STRL_ERR_FORMAT,
                      "%s, accessors[%u]%s: %" PRIu64 " elements of %u bytes, %" PRIu64 " apart from byte %" PRIu64
                      " on, end after the %" PRIu64 " bytes of bufferViews[%u]",
                      gltf->reader->path, accessor, what, count, element_bytes(column), stride, column->offset, bytes,
                      column->view);
}

/* Size bytes elements of a column as they are in the file, from `first` on; they must be there. */
static strl_status load(strl__gltf *gltf, const strl__gltf_column *column, uint64_t first, size_t count,
                        strl_error *err)
{
    const uint64_t stride = stride_of(gltf, column);
    return strl__gltf_read_view(gltf, column->view, column->offset + first * stride, gltf->window,
                                (size_t)((count - 1) * stride + element_bytes(column)), err);
}

static size_t window_elements(const strl__gltf *gltf, const strl__gltf_column *column, size_t count)
{
    size_t fits = STRL__GLTF_WINDOW_BYTES / stride_of(gltf, column);
    return count < fits ? count : fits;
}

static uint32_t load_index(const strl__gltf_column *column, const uint8_t *bytes)
{
    switch (column->type) {
    case STRL__U8:
        return *bytes;
    case STRL__U16:
        return strl__load_16(bytes, false);
    default:
        return strl__load_32(bytes, false);
    }
}

static strl_status read_indices(strl__gltf *gltf, const strl__gltf_column *column, uint64_t first, size_t count,
                                uint32_t *indices, strl_error *err)
{
    if (column->view == STRL__NO_ITEM) {
        memset(indices, 0, count * sizeof *indices);
        return STRL_OK;
    }
    const size_t stride = stride_of(gltf, column);
    strl_status status = STRL_OK;
    for (size_t done = 0; done < count && !status;) {
        size_t some = window_elements(gltf, column, count - done);
        status = load(gltf, column, first + done, some, err);
        for (size_t i = 0; i < some && !status; i++)
            indices[done + i] = load_index(column, gltf->window + i * stride);
        done += some;
    }
    return status;
}

/* They must grow, so that one pass over them is enough. */
static strl_status check_sparse(strl__gltf *gltf, uint32_t index, strl_error *err)
{
    const strl__gltf_accessor *accessor = &gltf->accessors[index];
    const strl__gltf_sparse *sparse = accessor->sparse;
    strl_status status = check_column(gltf, index, ".sparse.indices", &sparse->indices, sparse->count, err);
    if (!status)
        status = check_column(gltf, index, ".sparse.values", &sparse->values, sparse->count, err);
    uint64_t least = 0;
    for (uint64_t first = 0; first < sparse->count && !status; first += STRL__GLTF_CHUNK) {
        uint64_t left = sparse->count - first;
        size_t count = left < STRL__GLTF_CHUNK ? (size_t)left : STRL__GLTF_CHUNK;
        status = read_indices(gltf, &sparse->indices, first, count, gltf->elements, err);
        for (size_t i = 0; i < count && !status; i++) {
            uint32_t element = gltf->elements[i];
            if (element < least || element >= accessor->count)
                status = strl__fail(err, STRL_ERR_FORMAT,
                                    "%s, accessors[%u].sparse: expected growing indices below %" PRIu64
                                    ", found %u at %" PRIu64,
                                    gltf->reader->path, index, accessor->count, element, first + i);
            least = (uint64_t)element + 1;
        }
    }
    return status;
}

strl_status strl__gltf_check_accessor(strl__gltf *gltf, uint32_t index, strl_error *err)
{
    if (index >= gltf->accessor_count)
        return strl__gltf_fail_index(gltf, "", "accessors", gltf->accessor_count, index, err);
    strl__gltf_accessor *accessor = &gltf->accessors[index];
    if (accessor->is_checked)
        return STRL_OK;
    strl_status status = check_column(gltf, index, "", &accessor->values, accessor->count, err);
    if (!status && accessor->sparse && accessor->sparse->count > accessor->count)
        status = strl__fail(err, STRL_ERR_FORMAT,
                            "%s, accessors[%u].sparse: expected at most %" PRIu64 " elements, found %" PRIu64,
                            gltf->reader->path, index, accessor->count, accessor->sparse->count);
    if (!status && accessor->sparse)
        status = check_sparse(gltf, index, err);
    accessor->is_checked = !status;
    return status;
}

/* ---- numbers */

double strl__gltf_denormalize(strl__scalar type, double value)
{
    switch (type) {
    case STRL__I8:
        return value < -127 ? -1 : value / 127;
    case STRL__U8:
        return value / 255;
    case STRL__I16:
        return value < -32767 ? -1 : value / 32767;
    case STRL__U16:
        return value / 65535;
    default:
        return value;
    }
}

static void convert(const strl__gltf_column *column, bool normalized, const uint8_t *bytes, double *numbers)
{
    const unsigned size = strl__scalar_bytes(column->type);
    for (unsigned i = 0; i < column->components; i++) {
        double value = column->type == STRL__F32 ? (double)strl__load_f32(bytes + 4 * i, false)
                                                 : strl__scalar_load(column->type, bytes + size * i, false);
        numbers[i] = normalized ? strl__gltf_denormalize(column->type, value) : value;
    }
}

static strl_status read_column(strl__gltf *gltf, const strl__gltf_column *column, bool normalized, uint64_t first,
                               size_t count, double *numbers, strl_error *err)
{
    if (column->view == STRL__NO_ITEM) {
        memset(numbers, 0, count * column->components * sizeof *numbers);
        return STRL_OK;
    }
    const size_t stride = stride_of(gltf, column);
    strl_status status = STRL_OK;
    for (size_t done = 0; done < count && !status;) {
        size_t some = window_elements(gltf, column, count - done);
        status = load(gltf, column, first + done, some, err);
        for (size_t i = 0; i < some && !status; i++)
            convert(column, normalized, gltf->window + i * stride, numbers + (done + i) * column->components);
        done += some;
    }
    return status;
}

/* The first entry at or after an element. */
static strl_status find_sparse(strl__gltf *gltf, const strl__gltf_sparse *sparse, uint64_t element, uint64_t *entry,
                               strl_error *err)
{
    uint64_t low = 0, high = sparse->count;
    while (low < high) {
        uint64_t middle = low + (high - low) / 2;
        uint32_t found;
        strl_status status = read_indices(gltf, &sparse->indices, middle, 1, &found, err);
        if (status)
            return status;
        if (found < element)
            low = middle + 1;
        else
            high = middle;
    }
    *entry = low;
    return STRL_OK;
}

#define SPARSE_CHUNK 64u

static strl_status overlay(strl__gltf *gltf, const strl__gltf_sparse *sparse, bool normalized, uint64_t first,
                           size_t count, double *numbers, strl_error *err)
{
    const unsigned components = sparse->values.components;
    uint32_t indices[SPARSE_CHUNK];
    double values[SPARSE_CHUNK * 16];
    uint64_t entry = 0;
    strl_status status = find_sparse(gltf, sparse, first, &entry, err);
    while (!status && entry < sparse->count) {
        uint64_t left = sparse->count - entry;
        size_t some = left < SPARSE_CHUNK ? (size_t)left : SPARSE_CHUNK;
        status = read_indices(gltf, &sparse->indices, entry, some, indices, err);
        if (!status)
            status = read_column(gltf, &sparse->values, normalized, entry, some, values, err);
        for (size_t i = 0; i < some && !status; i++) {
            if (indices[i] < first || indices[i] - first >= count)
                return STRL_OK; /* beyond; or the file changed under us */
            memcpy(numbers + (indices[i] - first) * components, values + i * components, components * sizeof *numbers);
        }
        entry += some;
    }
    return status;
}

strl_status strl__gltf_read_numbers(strl__gltf *gltf, uint32_t index, bool normalized, uint64_t first, size_t count,
                                    double *numbers, strl_error *err)
{
    const strl__gltf_accessor *accessor = &gltf->accessors[index];
    strl_status status = read_column(gltf, &accessor->values, normalized, first, count, numbers, err);
    if (!status && accessor->sparse)
        status = overlay(gltf, accessor->sparse, normalized, first, count, numbers, err);
    return status;
}

strl_status strl__gltf_read_indices(strl__gltf *gltf, uint32_t index, uint64_t first, size_t count, uint32_t *indices,
                                    strl_error *err)
{
    const strl__gltf_accessor *accessor = &gltf->accessors[index];
    if (!accessor->sparse)
        return read_indices(gltf, &accessor->values, first, count, indices, err);
    double numbers[STRL__GLTF_CHUNK];
    strl_status status = STRL_OK;
    for (size_t done = 0; done < count && !status;) {
        size_t some = count - done < STRL__GLTF_CHUNK ? count - done : STRL__GLTF_CHUNK;
        status = strl__gltf_read_numbers(gltf, index, false, first + done, some, numbers, err);
        for (size_t i = 0; i < some && !status; i++)
            indices[done + i] = (uint32_t)numbers[i];
        done += some;
    }
    return status;
}
