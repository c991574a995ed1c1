/* Talking to systemd, where there is one: sd_notify(3) without its library. */
#ifndef ORB_SYSTEMD_H
#define ORB_SYSTEMD_H

#include <stdint.h>

/* Sends lines of NAME=VALUE to NOTIFY_SOCKET; nothing happens where that is not set. */
void systemd_notify(const char *text);
/* RELOADING=1 with the time, which Type=notify-reload wants. */
void systemd_reloading(void);
/* How often to send WATCHDOG=1, in ms: half of what WATCHDOG_USEC allows; 0: never. */
int64_t systemd_watchdog_ms(void);

#endif
