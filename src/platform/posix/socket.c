#include "platform/socket.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/fail.h"

#define BACKLOG 511

/* -1 with errno. */
static int listen_at(const struct addrinfo *at)
{
    int made = socket(at->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (made < 0)
        return -1;
    int yes = 1, no = 0;
    /* A server that was ended leaves connections behind that would keep its port for minutes. */
    setsockopt(made, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    if (at->ai_family == AF_INET6)
        setsockopt(made, IPPROTO_IPV6, IPV6_V6ONLY, &no, sizeof no);
    if (bind(made, at->ai_addr, at->ai_addrlen) == 0 && listen(made, BACKLOG) == 0)
        return made;
    int code = errno;
    close(made);
    errno = code;
    return -1;
}

static uint16_t port_of(int listener)
{
    struct sockaddr_storage at = {0};
    socklen_t bytes = sizeof at;
    strl_peer peer;
    getsockname(listener, (struct sockaddr *)&at, &bytes);
    strl_peer_from(&at, &peer);
    return peer.port;
}

strl_status strl_socket_listen(const char *host, uint16_t port, int *listener, uint16_t *bound, strl_error *err)
{
    char service[8], place[320], buffer[128];
    struct addrinfo *found = NULL;
    const struct addrinfo hints = {.ai_socktype = SOCK_STREAM, .ai_flags = AI_PASSIVE | AI_NUMERICSERV};
    *listener = -1;
    *bound = 0;
    snprintf(service, sizeof service, "%u", port);
    strl_host_text(host, port, place, sizeof place);
    int code = getaddrinfo(host, service, &hints, &found);
    if (code != 0)
        return strl__fail(err, STRL_ERR_NETWORK, "cannot find the address %s: %s", place,
                          code == EAI_SYSTEM ? strerror_r(errno, buffer, sizeof buffer) : gai_strerror(code));
    errno = EADDRNOTAVAIL;
    for (const struct addrinfo *at = found; at && *listener < 0; at = at->ai_next)
        *listener = listen_at(at);
    code = errno;
    freeaddrinfo(found);
    if (*listener < 0)
        return strl__fail(err, STRL_ERR_NETWORK, "cannot listen at %s: %s", place,
                          strerror_r(code, buffer, sizeof buffer));
    *bound = port_of(*listener);
    return STRL_OK;
}

void strl_socket_close(int socket)
{
    if (socket >= 0)
        close(socket);
}

void strl_socket_end(int socket)
{
    shutdown(socket, SHUT_RDWR);
}

void strl_peer_from(const void *socket_address, strl_peer *peer)
{
    static const uint8_t mapped[12] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff};
    *peer = (strl_peer){0};
    if (!socket_address)
        return;
    sa_family_t family = ((const struct sockaddr *)socket_address)->sa_family;
    if (family == AF_INET) {
        const struct sockaddr_in *in = socket_address;
        memcpy(peer->address, &in->sin_addr, 4);
        peer->port = ntohs(in->sin_port);
    } else if (family == AF_INET6) {
        const struct sockaddr_in6 *in = socket_address;
        const uint8_t *bytes = (const uint8_t *)&in->sin6_addr;
        peer->is_v6 = memcmp(bytes, mapped, sizeof mapped) != 0;
        memcpy(peer->address, peer->is_v6 ? bytes : bytes + 12, peer->is_v6 ? 16 : 4);
        peer->port = ntohs(in->sin6_port);
    }
}

void strl_peer_text(const strl_peer *peer, char text[STRL_PEER_TEXT])
{
    char address[INET6_ADDRSTRLEN] = "?";
    inet_ntop(peer->is_v6 ? AF_INET6 : AF_INET, peer->address, address, sizeof address);
    strl_host_text(address, peer->port, text, STRL_PEER_TEXT);
}

void strl_host_text(const char *host, uint16_t port, char *text, unsigned size)
{
    bool brackets = strchr(host, ':') != NULL;
    unsigned room = size > 16 ? size - 16 : 0; /* for brackets, colon and port */
    snprintf(text, size, "%s%.*s%s:%u", brackets ? "[" : "", (int)room, host, brackets ? "]" : "", port);
}

bool strl_host_is_loopback(const char *host)
{
    struct in_addr four;
    if (inet_pton(AF_INET, host, &four) == 1)
        return (ntohl(four.s_addr) >> 24) == 127;
    return strcmp(host, "::1") == 0 || strcmp(host, "localhost") == 0;
}
