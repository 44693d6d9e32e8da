/* What failed, and when it is asked for again: after frames, ever more of them; sooner where the source was away and is
 * back. While every read fails a look at a time, one read that waits, finds that out. */
#include "walk/internal.h"

#include <string.h>

#include "platform/thread.h"

#define RETRY_FRAMES 8u /* doubles with each failure in a row */
#define RETRY_DOUBLINGS 7u
/* From so many on strl_walk_settled does not wait for it; it is still asked for. Over a network what came wrong may
 * come right: where every other answer is wrong, one thing in 256 is given up. */
#define GIVE_UP_FAILURES 3u
#define GIVE_UP_WRONG 8u
#define LOOK_NS 1000000000u /* between two looks: this part of the time for which the source has been away, */
#define LOOK_SHARE 4u
#define MOST_LOOK_NS 60000000000u /* so much at most */
#define LASTING_NS 1000000000u    /* of an outage, in which nothing at all came */

void strl__note_fault(strl_walk *walk, const strl_error *error)
{
    size_t length = strnlen(error->message, sizeof walk->stats.last_fault - 1);
    walk->stats.faults++;
    memcpy(walk->stats.last_fault, error->message, length);
    walk->stats.last_fault[length] = 0;
}

/* ---- of one thing */

void strl__back_off(const strl_walk *walk, strl__retry *retry, bool is_unread)
{
    uint32_t doublings = retry->failures < RETRY_DOUBLINGS ? retry->failures : RETRY_DOUBLINGS;
    retry->failures++;
    retry->frame = walk->frame + ((uint64_t)RETRY_FRAMES << doublings);
    retry->is_unread = is_unread;
    retry->returns = walk->returns;
}

bool strl__is_given_up(const strl_walk *walk, const strl__retry *retry)
{
    bool may_come_right = !retry->is_unread && strl_source_may_differ(walk->source);
    return retry->failures >= (may_come_right ? GIVE_UP_WRONG : GIVE_UP_FAILURES);
}

bool strl__is_waiting(const strl_walk *walk, const strl__retry *retry)
{
    if (retry->frame <= walk->frame)
        return false;
    bool is_called = retry->returns < (retry->was_early ? walk->lasting_return : walk->returns);
    return !(retry->is_unread && (walk->is_looking || is_called));
}

void strl__retry_asked(const strl_walk *walk, strl__retry *retry)
{
    retry->was_early = retry->frame > walk->frame && !walk->is_looking;
}

/* ---- of the source */

/* Where some reads fail and others do not, the source seems to come back all the time: what fails once more when it was
 * called is not called by that. */
void strl__source_answers(strl_walk *walk)
{
    if (!walk->is_away)
        return;
    walk->is_away = false;
    walk->returns++;
    if (strl_clock_ns() - walk->away_ns >= LASTING_NS)
        walk->lasting_return = walk->returns;
}

void strl__source_fails(strl_walk *walk)
{
    uint64_t now_ns = strl_clock_ns();
    if (!walk->is_away)
        walk->away_ns = now_ns;
    walk->is_away = true;
    uint64_t pause_ns = (now_ns - walk->away_ns) / LOOK_SHARE;
    pause_ns = pause_ns < LOOK_NS ? LOOK_NS : pause_ns > MOST_LOOK_NS ? MOST_LOOK_NS : pause_ns;
    walk->look_ns = now_ns + pause_ns;
}

void strl__begin_look(strl_walk *walk)
{
    uint64_t now_ns = walk->is_away && walk->requests_pending == 0 ? strl_clock_ns() : 0;
    walk->is_looking = now_ns > 0 && now_ns >= walk->look_ns;
    if (walk->is_looking)
        walk->look_ns = now_ns + LOOK_NS; /* where there is nothing to ask for */
}
