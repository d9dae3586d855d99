// SPDX-License-Identifier: BSD-3-Clause
// The service manager's protocol (notify.h): a text in a datagram on a socket whose name is in the
// environment, a leading @ for the abstract namespace.
#include "daemon/tell/notify.h"

#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

void gv_notify_open(gv_notify *notify) {
  struct sockaddr_un to = {.sun_family = AF_UNIX};
  const char *name = getenv("NOTIFY_SOCKET");
  const char *watchdog_us = getenv("WATCHDOG_USEC");
  *notify = (gv_notify){.socket = -1};
  if (!name || (*name != '/' && *name != '@') || strlen(name) >= sizeof to.sun_path)
    return;
  strcpy(to.sun_path, name);
  if (*name == '@')
    to.sun_path[0] = '\0';
  const socklen_t size = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + strlen(name));
  notify->socket = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (notify->socket < 0)
    return;
  if (connect(notify->socket, (const struct sockaddr *)&to, size) != 0) {
    close(notify->socket);
    notify->socket = -1;
  }
  if (watchdog_us)
    notify->every_ns = strtoll(watchdog_us, NULL, 10) * 1000 / 2;
}

static void tell(const gv_notify *notify, const char *text) {
  if (notify->socket >= 0)
    send(notify->socket, text, strlen(text), MSG_DONTWAIT | MSG_NOSIGNAL);
}

void gv_notify_ready(gv_notify *notify) { tell(notify, "READY=1\nSTATUS=waits for the devices"); }

void gv_notify_alive(gv_notify *notify, int64_t now_ns, uint64_t steps) {
  if (notify->every_ns <= 0 || now_ns - notify->told_ns < notify->every_ns || steps == notify->count)
    return;
  notify->told_ns = now_ns;
  notify->count = steps;
  tell(notify, "WATCHDOG=1");
}

void gv_notify_status(const gv_notify *notify, const char *state, const char *why) {
  char text[300];
  snprintf(text, sizeof text, "STATUS=%s%s%s", state, *why ? ": " : "", why);
  tell(notify, text);
}

void gv_notify_close(gv_notify *notify) {
  tell(notify, "STOPPING=1");
  if (notify->socket >= 0)
    close(notify->socket);
  notify->socket = -1;
}
