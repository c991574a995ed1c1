/* The lock of a folder that one process uses at a time. A daemon holds that of its data folder (main.c), a command
 * those of the folders that it reads or fills. */
#ifndef ORB_FOLDER_LOCK_H
#define ORB_FOLDER_LOCK_H

/* −1 if a process uses the folder, with the reason on standard error. */
int folder_lock(const char *folder);

#endif
