/* stroll compare: images with levels of detail against their reference, both folders of `stroll render --depth`. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "compare_images.h"
#include "interrupt.h"
#include "options.h"
#include "platform/file.h"
#include "progress.h"
#include "shared/camera_path.h"

#define LEAST_DEPTH_SHARE 0.999
#define DEFAULT_PSNR_DB 30.0

typedef struct compare_options {
    const char *reference, *images; /* folders */
    double error_px, least_psnr_db;
    bool json, quiet;
} compare_options;

/* Over all frames. */
typedef struct compare_totals {
    size_t frames;
    uint64_t uncovered, overcovered, both, depth_outside, either, differing, visibly_differing;
    size_t worst_coverage_frame, worst_depth_frame, worst_psnr_frame;
    uint64_t worst_coverage, worst_outside;
    double *psnr_db; /* [frames], owned; of frames in which something is covered the first psnr_count */
    size_t psnr_count;
    double psnr_least, psnr_median;
} compare_totals;

typedef struct frame_files {
    strl_image image;
    float *depth; /* owned */
} frame_files;

static strl_status load_files(frame_files *files, const char *folder, size_t frame, strl_error *err)
{
    char name[48];
    uint32_t width = 0, height = 0;
    snprintf(name, sizeof name, "frame_%05zu.png", frame);
    char *png = strl_path_join(folder, name);
    snprintf(name, sizeof name, "frame_%05zu.pfm", frame);
    char *pfm = strl_path_join(folder, name);
    *files = (frame_files){0};
    strl_status status = png && pfm ? strl_image_read_png(&files->image, png, err)
                                    : strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
    if (status == STRL_OK)
        status = strl_depth_read(&files->depth, &width, &height, pfm, err);
    if (status == STRL_OK && (width != files->image.width || height != files->image.height))
        status =
            strl__fail(err, STRL_ERR_FORMAT, "%s has %" PRIu32 "x%" PRIu32 " pixels, its image %" PRIu32 "x%" PRIu32,
                       pfm, width, height, files->image.width, files->image.height);
    strl__free(png);
    strl__free(pfm);
    return status;
}

static void free_files(frame_files *files)
{
    strl_image_deinit(&files->image);
    strl__free(files->depth);
}

static void add_frame(compare_totals *totals, size_t frame, const strl_compare_frame *result)
{
    uint64_t coverage = result->uncovered + result->overcovered;
    totals->uncovered += result->uncovered;
    totals->overcovered += result->overcovered;
    totals->both += result->both;
    totals->depth_outside += result->depth_outside;
    totals->either += result->either;
    totals->differing += result->differing;
    totals->visibly_differing += result->visibly_differing;
    if (coverage > totals->worst_coverage)
        totals->worst_coverage = coverage, totals->worst_coverage_frame = frame;
    if (result->depth_outside > totals->worst_outside)
        totals->worst_outside = result->depth_outside, totals->worst_depth_frame = frame;
    if (result->either == 0)
        return;
    if (totals->psnr_count == 0 || result->psnr_db < totals->psnr_least)
        totals->psnr_least = result->psnr_db, totals->worst_psnr_frame = frame;
    totals->psnr_db[totals->psnr_count++] = result->psnr_db;
}

static strl_status compare_frame(const compare_options *o, const strl_camera_path *path, size_t frame,
                                 compare_totals *totals, strl_error *err)
{
    frame_files reference, images;
    strl_status status = load_files(&reference, o->reference, frame, err);
    if (status != STRL_OK) {
        free_files(&reference);
        return status;
    }
    status = load_files(&images, o->images, frame, err);
    if (status == STRL_OK &&
        (images.image.width != reference.image.width || images.image.height != reference.image.height))
        status = strl__fail(err, STRL_ERR_FORMAT,
                            "frame %zu of %s has %" PRIu32 "x%" PRIu32 " pixels, that of %s %" PRIu32 "x%" PRIu32,
                            frame, o->images, images.image.width, images.image.height, o->reference,
                            reference.image.width, reference.image.height);
    if (status == STRL_OK) {
        strl_compare_frame result;
        double focal_px = reference.image.height / (2 * tan(path->fov_y_deg * (M_PI / 360)));
        strl_compare_images(&(strl_compare_side){reference.image.rgb, reference.depth},
                            &(strl_compare_side){images.image.rgb, images.depth}, reference.image.width,
                            reference.image.height, o->error_px, focal_px, &result);
        add_frame(totals, frame, &result);
    }
    free_files(&reference);
    free_files(&images);
    return status;
}

static strl_status load_path(const char *folder, strl_camera_path *path, strl_error *err)
{
    char *file = strl_path_join(folder, "path.json");
    strl_status status =
        file ? strl_path_load(file, path, err) : strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
    strl__free(file);
    if (status == STRL_ERR_IO)
        return strl__fail_context(err, status, "%s is no folder of images that `stroll render` wrote", folder);
    return status;
}

/* Images of different cameras would only give a meaningless number. */
static strl_status load_common_path(const compare_options *o, strl_camera_path *path, strl_error *err)
{
    strl_camera_path other = {0};
    strl_status status = load_path(o->reference, path, err);
    if (status == STRL_OK)
        status = load_path(o->images, &other, err);
    if (status == STRL_OK && (path->count != other.count || path->fov_y_deg != other.fov_y_deg ||
                              memcmp(path->frames, other.frames, path->count * sizeof *path->frames) != 0))
        status = strl__fail(err, STRL_ERR_ARGUMENT,
                            "%s and %s were drawn with different cameras: save the path of one (--save-path) and load "
                            "it for the other (--path)",
                            o->reference, o->images);
    strl_path_deinit(&other);
    return status;
}

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static strl_status compare(const compare_options *o, compare_totals *totals, strl_error *err)
{
    strl_camera_path path = {0};
    strl_cli_progress progress;
    strl_cli_progress_init(&progress, o->quiet);
    strl_cli_catch_interrupts();
    strl_status status = load_common_path(o, &path, err);
    if (status == STRL_OK) {
        totals->psnr_db = strl__alloc(path.count, sizeof *totals->psnr_db);
        if (!totals->psnr_db)
            status = strl__fail(err, STRL_ERR_MEMORY, "no memory to compare %zu frames", path.count);
    }
    for (size_t f = 0; status == STRL_OK && f < path.count; f++) {
        status = compare_frame(o, &path, f, totals, err);
        if (status == STRL_OK)
            status = strl_cli_check_interrupt(err);
        strl_cli_progress_update(&progress, "compare", f + 1, path.count, "frames");
    }
    strl_cli_progress_end(&progress);
    totals->frames = path.count;
    if (status == STRL_OK && totals->psnr_count == 0)
        status = strl__fail(err, STRL_ERR_ARGUMENT, "no pixel of %s or %s is covered: there is nothing to compare",
                            o->reference, o->images);
    if (status == STRL_OK) {
        qsort(totals->psnr_db, totals->psnr_count, sizeof *totals->psnr_db, by_value);
        totals->psnr_median =
            (totals->psnr_db[(totals->psnr_count - 1) / 2] + totals->psnr_db[totals->psnr_count / 2]) / 2;
    }
    strl_path_deinit(&path);
    return status;
}

/* ---- the answer */

static double depth_share(const compare_totals *t)
{
    return t->both ? 1 - (double)t->depth_outside / (double)t->both : 1;
}

/* Writes the first broken limit into err; STRL_OK where all hold. */
static strl_status judge(const compare_options *o, const compare_totals *t, strl_error *err)
{
    if (t->uncovered + t->overcovered > 0)
        return strl__fail(err, STRL_ERR_LIMIT,
                          "coverage: %" PRIu64
                          " pixels are background where the reference is wholly covered and %" PRIu64
                          " the other way round, expected 0; most in frame %zu",
                          t->uncovered, t->overcovered, t->worst_coverage_frame);
    if (depth_share(t) < LEAST_DEPTH_SHARE)
        return strl__fail(
            err, STRL_ERR_LIMIT,
            "depth: %.4f %% of the pixels covered in both are within the reference's range, expected %.1f %%; "
            "fewest in frame %zu",
            100 * depth_share(t), 100 * LEAST_DEPTH_SHARE, t->worst_depth_frame);
    if (t->psnr_median < o->least_psnr_db)
        return strl__fail(err, STRL_ERR_LIMIT,
                          "colour: the median PSNR is %.2f dB, expected at least %.2f; least in frame %zu",
                          t->psnr_median, o->least_psnr_db, t->worst_psnr_frame);
    return STRL_OK;
}

static void print_json(const compare_options *o, const compare_totals *t, bool holds)
{
    printf("{\"frames\":%zu,\"error_px\":%.6g,\"uncovered_pixels\":%" PRIu64 ",\"overcovered_pixels\":%" PRIu64
           ",\"worst_coverage_frame\":%zu,"
           "\"covered_in_both\":%" PRIu64 ",\"covered_in_either\":%" PRIu64 ",\"differing_pixels\":%" PRIu64
           ",\"visibly_differing_pixels\":%" PRIu64
           ",\"depth_within\":%.8f,\"worst_depth_frame\":%zu,\"psnr_min_db\":%.4f,\"psnr_median_db\":%.4f,"
           "\"worst_psnr_frame\":%zu,\"least_psnr_db\":%.6g,\"holds\":%s}\n",
           t->frames, o->error_px, t->uncovered, t->overcovered, t->worst_coverage_frame, t->both, t->either,
           t->differing, t->visibly_differing, depth_share(t), t->worst_depth_frame, t->psnr_least, t->psnr_median,
           t->worst_psnr_frame, o->least_psnr_db, holds ? "true" : "false");
}

static void print_text(const compare_totals *t)
{
    printf("%zu frame%s\n", t->frames, strl_cli_plural(t->frames));
    printf("coverage  %" PRIu64 " uncovered, %" PRIu64 " overcovered pixels (worst frame %zu)\n", t->uncovered,
           t->overcovered, t->worst_coverage_frame);
    printf("depth     %.4f %% of %" PRIu64 " pixels within the range (worst frame %zu)\n", 100 * depth_share(t),
           t->both, t->worst_depth_frame);
    printf(
        "colour    PSNR median %.2f dB, least %.2f dB (frame %zu); %.2f %% of the covered pixels differ, %.2f %% by more than 16 of 255\n",
        t->psnr_median, t->psnr_least, t->worst_psnr_frame, 100 * (double)t->differing / (double)t->either,
        100 * (double)t->visibly_differing / (double)t->either);
}

static int run(strl_cli_args *args)
{
    compare_options o = {.error_px = 1, .least_psnr_db = DEFAULT_PSNR_DB};
    const strl_cli_option options[] = {
        {.name = "error",
         .kind = STRL_CLI_REAL,
         .value = &o.error_px,
         .argument = "PX",
         .help = "pixel error that DIR_B was drawn with (1)",
         .least = 1e-6,
         .most = 1e6},
        {.name = "psnr",
         .kind = STRL_CLI_REAL,
         .value = &o.least_psnr_db,
         .argument = "DB",
         .help = "least median PSNR, meant for --supersample 4 (30)",
         .least = 0,
         .most = 100},
        {.name = "json", .kind = STRL_CLI_FLAG, .value = &o.json, .help = "print one JSON object"},
    };
    const strl_cli_usage usage = {
        .positional = "DIR_A DIR_B",
        .least = 2,
        .most = 2,
        .options = options,
        .option_count = STRL_CLI_COUNT_OF(options),
        .notes = "Both are folders that `stroll render --depth` wrote with the same cameras; DIR_A is the reference.\n"
                 "Limits: where the 5x5 neighbourhood of a pixel is wholly covered (background) in A, the pixel is "
                 "covered (background) in B;\n"
                 "99.9 % of the pixels covered in both have a depth within the range of A's 3x3 neighbourhood widened "
                 "by PX z / f;\n"
                 "the median over the frames of the PSNR over pixels covered in either is at least DB."};
    strl_cli_list folders;
    int stop = strl_cli_parse(args, &usage, &folders);
    if (stop >= 0)
        return stop;
    compare_totals totals = {0};
    strl_error err = {0};
    o.quiet = args->quiet;
    o.reference = folders.items[0], o.images = folders.items[1];
    strl_status status = compare(&o, &totals, &err);
    if (status == STRL_OK) {
        status = judge(&o, &totals, &err);
        if (o.json)
            print_json(&o, &totals, status == STRL_OK);
        else if (!o.quiet)
            print_text(&totals);
    }
    strl__free(totals.psnr_db);
    return status == STRL_OK ? 0 : strl_cli_fail(&err);
}

STRL_CLI_COMMAND(compare, "compare images with their reference", run);
