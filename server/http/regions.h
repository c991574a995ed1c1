/* Large answers that are kept in memory and sent without a copy.
 *
 * libmicrohttpd sends an answer from memory with one sendmsg(), which copies the body into the socket: 12 µs of the 40
 * µs that a known asset of 160 KB takes. It uses sendfile() only for answers from files, where it pushes the header out
 * first and sends 128 KB at a time, which takes even longer. So the bytes also lie in a file without a name, and
 * regions.c has a sendmsg() of its own, which the program's libraries call in place of libc's: for a header and a
 * region it sends the header and then the file with sendfile(), for everything else it calls libc's.
 *
 * The files lie on the disk of the data folder: sendfile() takes 27 µs a request from a file in memory (memfd), which
 * the kernel looks up page by page, and 20 from a disk file, which it looks up in batches. The library gets a copy in
 * memory and no mapping of the file: reading a mapping of a file on a broken disk would end the process (SIGBUS). */
#ifndef ORB_HTTP_REGIONS_H
#define ORB_HTTP_REGIONS_H

#include <stddef.h>

/* The folder for the files, for regions made later. Call it before the first thread that makes one. */
void regions_in(const char *folder);
/* Copies bytes into a new region, which never changes. NULL if they are too few to be worth it, or there are too many
 * regions (each has a file descriptor), or the system has no memory: keep them elsewhere then. */
void *region_make(const void *bytes, size_t size);
/* Frees a region that is no longer sent; what the kernel still has to transmit stays valid. 0: not a region. */
int region_free(void *bytes);

#endif
