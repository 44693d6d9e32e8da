/* All formats that Stroll does not read itself, through assimp, the library: in a child process,
 * because it holds whole scenes in memory and dies of some files. The child (apps/import) writes a
 * stream of triangles (import_protocol.h), which is spooled to scratch as it comes; the child has
 * ended before opening returns, and every pass reads the spool. What the child may take is limited:
 * address space, processor time, time, and the bytes it announces.
 *
 * Directions: most of assimp's importers turn what they read to y up. Where the format has z up and
 * the importer leaves it so, the child says z. */
#include <ctype.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "platform/process.h"
#include "platform/thread.h"
#include "readers/import_stream.h"

#define CHILD_MEMORY_DEFAULT ((uint64_t)1 << 30)
/* Processor time by default: files of a few megabytes take seconds, so this ends loops, not work. */
#define CPU_SECONDS_LEAST 30u
#define CPU_SECONDS_A_MEGABYTE 5u
#define CPU_SECONDS_MOST 7200u
/* On a machine that is busy, or writing to a slow disk, time passes without the child's doing. */
#define SECONDS_A_CPU_SECOND 4u
#define COPY_BYTES ((size_t)1 << 16)
#define STEP_NS 100000000u /* how late a cancel may be seen */
#define NS_PER_S 1000000000u
/* More than assimp takes for any whole file, packed ones too. */
#define MEMORY_OF_A_BYTE 1000u
/* A child that has said all, or died, ends at once. */
#define END_SECONDS 10u

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define CHILD_IS_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define CHILD_IS_SANITIZED 1
#endif
#endif
#ifndef CHILD_IS_SANITIZED
#define CHILD_IS_SANITIZED 0
#endif

/* What assimp 5 lists, less what Stroll reads itself, and xml, which may be anything. */
static const char *const extensions[] = {
    "3d",      "3ds", "3mf", "ac",      "ac3d",     "acc",  "amf",  "ase",  "ask", "assbin",  "b3d",
    "blend",   "bsp", "bvh", "cob",     "csm",      "dae",  "dxf",  "enff", "fbx", "hmp",     "ifc",
    "ifczip",  "iqm", "irr", "irrmesh", "lwo",      "lws",  "lxo",  "md2",  "md3", "md5anim", "md5camera",
    "md5mesh", "mdc", "mdl", "mesh",    "mesh.xml", "mot",  "ms3d", "ndo",  "nff", "off",     "ogex",
    "pk3",     "pmx", "prj", "q3o",     "q3s",      "raw",  "scn",  "sib",  "smd", "step",    "stp",
    "ter",     "uc",  "vta", "x",       "x3d",      "x3db", "xgl",  "zae",  "zgl",
};

const char *strl__assimp_extension(const char *path)
{
    for (size_t i = 0; i < sizeof extensions / sizeof *extensions; i++)
        if (strl__has_extension(path, extensions[i]))
            return extensions[i];
    return NULL;
}

bool strl__assimp_recognises(const strl__input *input)
{
    static const char *const words[] = {"OFF",  "COFF",        "NOFF",    "STOFF",
                                        "FORM", "Kaydara FBX", "BLENDER", "ISO-10303-21;"};
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
        size_t length = strlen(words[i]);
        if ((size_t)(input->end - input->at) > length && memcmp(input->at, words[i], length) == 0 &&
            !isalpha((unsigned char)input->at[length]))
            return true;
    }
    return false;
}

/* ---- the program ---- */

/* The importer's path, owned by the caller, NULL without memory. Not found: *found is false, and
 * the result is the last place that was looked at. */
static char *find_importer(const char *named, bool *found)
{
    /* Beside the program where it was built, then by the way from it where both were installed, which holds
     * wherever that was moved to; last where the library was meant to be, for programs of others. */
    static const char *const places[] = {STRL_IMPORTER, STRL_LIBEXEC_FROM_BIN "/" STRL_IMPORTER};
    char *path = NULL;
    *found = true;
    if (named && *named)
        return strl__strdup(named); /* the user's word: whether it is there, running it tells */
    char *folder = strl_program_folder();
    for (size_t i = 0; folder && i < sizeof places / sizeof *places; i++) {
        path = strl_path_join(folder, places[i]);
        if (path && strl_path_exists(path)) {
            strl__free(folder);
            return path;
        }
        strl__free(path);
    }
    strl__free(folder);
    path = strl_path_join(STRL_LIBEXEC_DIR, STRL_IMPORTER);
    *found = path && strl_path_exists(path);
    return path;
}

static strl_status fail_not_found(const strl_reader *reader, strl_error *err)
{
    char *folder = strl_program_folder();
    const char *extension = strl__assimp_extension(reader->path);
    strl_status status = strl__fail(
        err, STRL_ERR_UNSUPPORTED,
        "%s: %s%s files are read by the program " STRL_IMPORTER ", which is neither in %.100s nor in " STRL_LIBEXEC_DIR
        ": build Stroll where libassimp-dev is installed, or name the program by "
        "STROLL_IMPORT",
        reader->path, extension ? "." : "such", extension ? extension : "", folder ? folder : "its folder");
    strl__free(folder);
    return status;
}

/* ---- one run of it ---- */

typedef struct import_run {
    strl_reader *reader;
    const strl_reader_child *child;
    strl_process *process;
    uint64_t memory_bytes, cpu_seconds, deadline_ns;
    uint64_t own_rss_bytes; /* of this process, at most, meanwhile */
    uint64_t spool_bytes, spool_most;
    uint8_t start[STRL__IMPORT_START_BYTES]; /* of the stream */
    uint8_t *buffer;                         /* COPY_BYTES */
} import_run;

static strl_status start_child(import_run *run, strl_error *err)
{
    strl_reader *reader = run->reader;
    bool found;
    char *program = find_importer(run->child->importer, &found);
    /* A name that begins with a dash must not be taken for an option. */
    char *path = reader->path[0] == '-' ? strl_path_join(".", reader->path) : strl__strdup(reader->path);
    strl_status status = STRL_OK;
    if (!program || !path)
        status = strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for a path", reader->path);
    else if (!found)
        status = fail_not_found(reader, err);
    if (!status) {
        const char *const arguments[] = {program, path, NULL};
        const strl_process_desc desc = {.arguments = arguments,
                                        .address_bytes = run->memory_bytes,
                                        .cpu_seconds = run->cpu_seconds,
                                        .is_sanitized = CHILD_IS_SANITIZED};
        status = strl_process_start(&desc, &run->process, err);
        if (status)
            strl__fail_context(err, status, "%s", reader->path);
    }
    strl__free(program);
    strl__free(path);
    return status;
}

static strl_status fail_time(const import_run *run, bool cpu, strl_error *err)
{
    uint64_t seconds = cpu ? run->cpu_seconds : run->cpu_seconds * SECONDS_A_CPU_SECOND;
    return strl__fail(err, STRL_ERR_LIMIT,
                      "%s: importing it by assimp takes more than %" PRIu64
                      " s%s, its limit, and was stopped: convert it to PLY, OBJ or glTF",
                      run->reader->path, seconds, cpu ? " of processor time" : "");
}

/* why: in the importer's words, may be empty. */
static strl_status fail_memory(const import_run *run, const char *why, strl_error *err)
{
    const uint64_t bytes = run->reader->opened.bytes;
    char doubt[80] = "";
    if (bytes < run->memory_bytes / MEMORY_OF_A_BYTE)
        snprintf(doubt, sizeof doubt, "; a file of %" PRIu64 " bytes that asks for so much may be broken", bytes);
    return strl__fail(err, STRL_ERR_MEMORY,
                      "%s: importing it by assimp takes more than %" PRIu64
                      "M of memory, which is what is left for it%s%s%s: %sconvert it to PLY, OBJ or glTF",
                      run->reader->path, run->memory_bytes >> 20, *why ? "; " : "", why, doubt,
                      run->reader->whole_bytes ? "give more by --memory, or " : "");
}

static strl_status check_cancel(const import_run *run, strl_error *err)
{
    if (run->child->go_on && !run->child->go_on(run->child->context))
        return strl__fail(err, STRL_ERR_CANCELLED, "interrupted");
    return STRL_OK;
}

/* Until the facts are known, only what cannot be more is taken; then what they announce, where the
 * disk has room for it. */
static strl_status check_start(import_run *run, strl_error *err)
{
    strl_reader *reader = run->reader;
    strl__import_facts facts;
    uint64_t free_bytes;
    if (memcmp(run->start, STRL_IMPORT_MAGIC, STRL_IMPORT_MAGIC_BYTES) != 0)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "%s: the stream of triangles that was imported from it is broken: expected "
                          "the word " STRL_IMPORT_MAGIC " at byte 0",
                          reader->path);
    if (!strl__import_facts_parse(run->start, &facts))
        return STRL_OK; /* an error, or what the scan refuses */
    strl_status status = strl_path_free_bytes(reader->scratch_dir, &free_bytes, err);
    if (!status && free_bytes < facts.stream_most)
        status = strl__fail(err, STRL_ERR_DISK_FULL,
                            "%s has %" PRIu64 " bytes free, expected %" PRIu64 " for the %" PRIu64
                            " triangles of %s: name another folder by --scratch",
                            reader->scratch_dir, free_bytes, facts.stream_most, facts.triangles, reader->path);
    run->spool_most = facts.stream_most;
    return status;
}

static strl_status spool(import_run *run, size_t bytes, strl_error *err)
{
    strl__import *state = run->reader->state;
    uint64_t before = run->spool_bytes;
    strl_status status = strl_file_write(state->spool, before, run->buffer, bytes, err);
    run->spool_bytes += bytes;
    if (!status && before < sizeof run->start) {
        size_t room = sizeof run->start - (size_t)before;
        memcpy(run->start + before, run->buffer, bytes < room ? bytes : room);
        if (run->spool_bytes >= sizeof run->start)
            status = check_start(run, err);
    }
    if (!status && run->spool_bytes > run->spool_most)
        status = strl__fail(err, STRL_ERR_FORMAT,
                            "%s: the stream of triangles that was imported from it is broken: it "
                            "has more than the %" PRIu64 " bytes that it announces",
                            run->reader->path, run->spool_most);
    return status;
}

/* All that the child writes; it is done when it has closed its output. */
static strl_status listen(import_run *run, strl_error *err)
{
    bool ended = false;
    strl_status status = STRL_OK;
    while (!status && !ended) {
        size_t got = 0;
        status = strl_process_read(run->process, STEP_NS, run->buffer, COPY_BYTES, &got, &ended, err);
        if (!status)
            status = check_cancel(run, err);
        if (!status && strl_clock_ns() > run->deadline_ns)
            status = fail_time(run, false, err);
        if (!status && got > 0)
            status = spool(run, got, err);
        uint64_t own = got > 0 && run->own_rss_bytes ? 0 : strl_process_rss_bytes();
        run->own_rss_bytes = own > run->own_rss_bytes ? own : run->own_rss_bytes;
    }
    return status;
}

/* A sentence for an end that is none of the protocol's. */
static strl_status fail_end(import_run *run, const strl_process_end *end, strl_error *err)
{
    const char *path = run->reader->path, *said = strl_process_complaint(run->process);
    if (end->cpu_exhausted)
        return fail_time(run, true, err);
    if (strstr(said, "bad_alloc") || strstr(said, "annot allocate memory") || strstr(said, "failed to map segment"))
        return fail_memory(run, said, err);
    if (end->signal == SIGKILL)
        return strl__fail(err, STRL_ERR_MEMORY,
                          "%s: assimp, which imports it, was ended by signal 9 (%s): the machine's "
                          "memory may have run out; convert it to PLY, OBJ or glTF",
                          path, strl_signal_name(end->signal));
    if (end->signal)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "%s: assimp, which imports it, was ended by signal %d (%s): the file is "
                          "broken, or nothing it can import; convert it to PLY, OBJ or glTF",
                          path, end->signal, strl_signal_name(end->signal));
    return strl__fail(err, STRL_ERR_FORMAT, "%s: the program that imports it ended with status %d%s%s", path,
                      end->exit_status, *said ? ": " : "", said);
}

/* What was spooled, once the child has ended: its stream, its error, or its death. */
static strl_status judge(import_run *run, strl_error *err)
{
    const strl__import *state = run->reader->state;
    strl_process_end end;
    if (!strl_process_wait(run->process, END_SECONDS * (uint64_t)NS_PER_S, &end))
        return strl__fail(err, STRL_ERR_LIMIT,
                          "%s: the program that imports it has closed its output but did not end "
                          "within %u s, and was stopped: convert it to PLY, OBJ or glTF",
                          run->reader->path, END_SECONDS);
    run->reader->costs = (strl_reader_costs){run->spool_bytes, end.peak_rss_bytes + run->own_rss_bytes};
    if (end.signal)
        return fail_end(run, &end, err);
    strl_error told = {0};
    strl_status status = strl__import_scan(run->reader, &told);
    if (status == STRL_ERR_MEMORY && state->error_told)
        return fail_memory(run, state->told, err);
    if (err)
        *err = told;
    /* An error that the stream tells says more than a status; a broken stream less. */
    return end.exit_status && !state->error_told ? fail_end(run, &end, err) : status;
}

static void set_limits(import_run *run)
{
    const strl_reader_child *child = run->child;
    uint64_t megabytes = run->reader->opened.bytes >> 20;
    uint64_t seconds =
        megabytes < CPU_SECONDS_MOST ? CPU_SECONDS_LEAST + megabytes * CPU_SECONDS_A_MEGABYTE : CPU_SECONDS_MOST;
    seconds = seconds < CPU_SECONDS_MOST ? seconds : CPU_SECONDS_MOST;
    run->memory_bytes = child->memory_bytes ? child->memory_bytes : CHILD_MEMORY_DEFAULT;
    run->cpu_seconds = child->cpu_seconds ? child->cpu_seconds : seconds;
    run->deadline_ns = strl_clock_ns() + run->cpu_seconds * SECONDS_A_CPU_SECOND * (uint64_t)NS_PER_S;
    run->spool_most = sizeof run->start + STRL_IMPORT_TEXT_MOST;
}

static strl_status run_child(import_run *run, strl_error *err)
{
    set_limits(run);
    strl_status status = start_child(run, err);
    if (!status)
        status = listen(run, err);
    if (!status)
        status = judge(run, err);
    strl_process_close(run->process);
    return status;
}

static strl_status assimp_open(strl_reader *reader, strl_error *err)
{
    strl__import *state = reader->state;
    import_run run = {.reader = reader, .child = &reader->child};
    if (!reader->scratch_dir)
        return strl__fail(err, STRL_ERR_ARGUMENT, "%s: its triangles need a scratch folder, and none was given",
                          reader->path);
    strl_status status = strl_file_create_nameless(reader->scratch_dir, &state->spool, err);
    state->owns_spool = true;
    run.buffer = strl__alloc(COPY_BYTES, 1);
    if (!status && !run.buffer)
        status = strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for a reader", reader->path);
    if (!status)
        status = run_child(&run, err);
    strl__free(run.buffer);
    strl__import_note_facts(reader);
    return status;
}

const strl__format strl__format_assimp = {
    .name = "assimp",
    .default_up = STRL_AXIS_Y,
    .state_bytes = sizeof(strl__import),
    .open = assimp_open,
    .prepare = strl__import_prepare,
    .start = strl__import_start,
    .fill = strl__import_fill,
    .close = strl__import_close,
    .bytes_done = strl__import_bytes_done,
};
