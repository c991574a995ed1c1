/* The lock of a folder that one process uses at a time. A daemon holds that of its data folder, a command those of the
 * folders that it reads or fills. The kernel releases a lock when its process ends, also after a crash. */
#ifndef ORB_FOLDER_LOCK_H
#define ORB_FOLDER_LOCK_H

/* Returns a descriptor that holds the lock, or −1 if another process uses the folder, with the reason on standard
 * error. */
int folder_lock(const char *folder);

/* The same for the data folder of this process: makes the folder, and waits up to 5 s for a dying process. −1: another
 * process has the lock. FOLDER_LOCK_TOLD: the folder cannot be made or written, and the log has the reason. */
enum { FOLDER_LOCK_TOLD = -2 };
int folder_lock_data(const char *data);
/* Logs why folder_lock_data() returned `lock` < 0, unless it has done so. */
void folder_lock_say(const char *data, int lock);

#endif
