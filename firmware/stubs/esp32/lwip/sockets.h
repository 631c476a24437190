// The part of lwIP 2.1's sockets that the sketch uses. Only signatures.
#pragma once

#include <stddef.h>
#include <stdint.h>

using ssize_t = int;
using socklen_t = uint32_t;
using sa_family_t = uint8_t;
using in_port_t = uint16_t;

struct in_addr {
  uint32_t s_addr;
};
struct sockaddr_in {
  uint8_t sin_len;
  sa_family_t sin_family;
  in_port_t sin_port;
  in_addr sin_addr;
  char sin_zero[8];
};
struct sockaddr {
  uint8_t sa_len;
  sa_family_t sa_family;
  char sa_data[14];
};

constexpr int AF_INET = 2, SOCK_DGRAM = 2, SOL_SOCKET = 0xfff, SO_BROADCAST = 0x0020, MSG_DONTWAIT = 0x08;
constexpr uint32_t INADDR_ANY = 0;

extern "C" {
uint16_t htons(uint16_t value);
uint16_t ntohs(uint16_t value);
int socket(int domain, int type, int protocol);
int setsockopt(int socket, int level, int name, const void* value, socklen_t bytes);
int bind(int socket, const sockaddr* name, socklen_t bytes);
int close(int socket);
ssize_t sendto(int socket, const void* data, size_t count, int flags, const sockaddr* to, socklen_t bytes);
ssize_t recvfrom(int socket, void* room, size_t count, int flags, sockaddr* from, socklen_t* bytes);
}
