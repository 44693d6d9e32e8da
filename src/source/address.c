#include "source/source.h"

#include <string.h>

const char *strl__address_shown(const char *address, char *shown, size_t size)
{
    const char *colon = address + strcspn(address, ":/?#@"),
               *host = strncmp(colon, "://", 3) == 0 ? colon + 3 : address;
    size_t prefix = (size_t)(host - address), length = strcspn(host, "?#");
    for (size_t i = length; i-- > 0;)
        if (host[i] == '@') {
            host += i + 1;
            length -= i + 1;
            break;
        }
    if (strchr(host + length, '@')) /* a password with a question mark in it, or a query: nobody can tell */
        length = 0;
    if (prefix > size - 1)
        prefix = size - 1;
    memcpy(shown, address, prefix);
    size_t room = size - 1 - prefix;
    if (length > room)
        length = room;
    memcpy(shown + prefix, host, length);
    shown[prefix + length] = 0;
    return shown;
}
