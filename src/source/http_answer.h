/* Whether an answer is the one that was asked for. Pure: what was asked and the answer's fields in, a verdict out. */
#ifndef STRL_SOURCE_HTTP_ANSWER_H
#define STRL_SOURCE_HTTP_ANSWER_H

#include "source/http_fields.h"
#include "stroll/error.h"

typedef enum strl__http_verdict {
    STRL__HTTP_GOOD,
    STRL__HTTP_AGAIN,   /* wrong, but another time it may be right */
    STRL__HTTP_REFUSED, /* asking again is of no use */
    STRL__HTTP_MOVED,   /* refused where a redirect led to: the address itself may lead elsewhere now */
    STRL__HTTP_CHANGED  /* it is another file than the one that was opened */
} strl__http_verdict;

typedef struct strl__http_asked {
    uint64_t first, last; /* bytes, inclusive */
    bool opening;         /* the first answer: the file may be shorter than that, and its identity is not known yet */
    bool redirected;      /* sent to where an earlier redirect led */
    strl__http_identity identity; /* of what was opened */
} strl__http_asked;

/* Judges a header. A verdict other than good writes why into err: a reason without the address. */
strl__http_verdict strl__http_judge(const strl__http_asked *asked, const strl__http_fields *answer, strl_error *err);

#endif
