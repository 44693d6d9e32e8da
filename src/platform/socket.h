/* Sockets as far as a server needs them beside the library that speaks HTTP. Thread-safe. */
#ifndef STRL_PLATFORM_SOCKET_H
#define STRL_PLATFORM_SOCKET_H

#include <stdbool.h>
#include <stdint.h>

#include "stroll/error.h"

/* Who is at the other end. An IPv4 address that comes as IPv6 is IPv4. */
typedef struct strl_peer {
    uint8_t address[16]; /* IPv4: the first four */
    uint16_t port;
    bool is_v6;
} strl_peer;

#define STRL_PEER_TEXT 64u

/* A listening socket that does not block. host: a name or a number; port 0 = a free one. *bound: the port. */
strl_status strl_socket_listen(const char *host, uint16_t port, int *listener, uint16_t *bound, strl_error *err);
void strl_socket_close(int socket); /* -1 is legal */
/* Ends both directions at once; the descriptor stays open, its owner finds the end of it. */
void strl_socket_end(int socket);

/* socket_address: a struct sockaddr. What is no internet address becomes zeros. */
void strl_peer_from(const void *socket_address, strl_peer *peer);
/* "127.0.0.1:80", "[::1]:80". */
void strl_peer_text(const strl_peer *peer, char text[STRL_PEER_TEXT]);
/* The same for a host as the user gave it: one with a colon is put in brackets. */
void strl_host_text(const char *host, uint16_t port, char *text, unsigned size);
/* Whether only this machine reaches the host of this name. */
bool strl_host_is_loopback(const char *host);

#endif
