/* Notifications to systemd: sd_notify(3) without libsystemd. */
#ifndef ORB_SYSTEMD_H
#define ORB_SYSTEMD_H

#include <stdint.h>

/* Sends lines of NAME=VALUE to NOTIFY_SOCKET; does nothing if that is not set. */
void systemd_notify(const char *text);
/* Sends RELOADING=1 with the time, as Type=notify-reload requires. */
void systemd_reloading(void);
/* The interval for WATCHDOG=1 in ms: half of WATCHDOG_USEC; 0: never. */
int64_t systemd_watchdog_ms(void);

#endif
