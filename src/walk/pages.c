/* Pages that came a moment ago. What is wanted of one of them some frames later (the children of the nodes that it was
 * read for, as a rule) needs no read. They are part of resident_bytes, and the first to go where something is wanted.
 */
#include <string.h>

#include "walk/internal.h"

#define MOST_KEPT_BYTES ((uint64_t)8 << 20)
#define KEPT_SHARE 32u /* of the walk's memory, at most */

strl__page *strl__page_create(const strl_page_ref *ref, uint8_t *data)
{
    strl__page *page = strl__alloc_zero(1, sizeof *page);
    if (!page)
        return NULL;
    page->ref = *ref;
    page->data = data;
    atomic_init(&page->references, 1);
    return page;
}

strl__page *strl__page_share(strl__page *page)
{
    if (page)
        atomic_fetch_add_explicit(&page->references, 1, memory_order_relaxed);
    return page;
}

void strl__page_release(strl__page *page)
{
    if (page && atomic_fetch_sub_explicit(&page->references, 1, memory_order_acq_rel) == 1) {
        strl__free(page->data);
        strl__free(page);
    }
}

/* ---- kept ones, the oldest first */

static strl__page *take_out(strl_walk *walk, size_t i)
{
    strl__page *page = walk->kept[i];
    walk->kept_count--;
    memmove(&walk->kept[i], &walk->kept[i + 1], (walk->kept_count - i) * sizeof *walk->kept);
    return page;
}

bool strl__page_drop_oldest(strl_walk *walk)
{
    if (walk->kept_count == 0)
        return false;
    strl__page *page = take_out(walk, 0);
    walk->kept_bytes -= page->ref.bytes;
    walk->resident_bytes -= page->ref.bytes;
    strl__page_release(page);
    return true;
}

void strl__page_keep(strl_walk *walk, strl__page *page)
{
    uint64_t share = walk->memory_bytes / KEPT_SHARE, bytes = page->ref.bytes;
    uint64_t most = share < MOST_KEPT_BYTES ? share : MOST_KEPT_BYTES;
    if (bytes > most || strl__page_find(walk, &page->ref))
        return;
    while (walk->kept_count == STRL__KEPT_PAGES || walk->kept_bytes + bytes > most)
        strl__page_drop_oldest(walk);
    if (!strl__make_room(walk, bytes, strl__idle_since(walk)))
        return;
    walk->kept[walk->kept_count++] = strl__page_share(page);
    walk->kept_bytes += bytes;
    walk->resident_bytes += bytes;
}

strl__page *strl__page_find(strl_walk *walk, const strl_page_ref *ref)
{
    for (size_t i = walk->kept_count; i-- > 0;) {
        const strl_page_ref *kept = &walk->kept[i]->ref;
        if (kept->offset != ref->offset || kept->bytes != ref->bytes || kept->checksum != ref->checksum)
            continue;
        strl__page *page = take_out(walk, i);
        walk->kept[walk->kept_count++] = page;
        return page;
    }
    return NULL;
}
