/* Points at which a test build (ORB_FAULTS) makes calls fail.
 *
 * ORBMORPH_FAULT="write:7" fails the 7th write, "fsync:3+" the third and every later one, "kill:publish-renamed:2" ends
 * the process at the second pass of that point. Kinds: write, fsync, rename, sqlite, thread, alloc. Release builds
 * have none of this.
 */
#ifndef ORB_FAULTS_H
#define ORB_FAULTS_H

#ifdef ORB_FAULTS
int fault_hits(const char *kind); /* 1: fail now */
void fault_point(const char *name);
#define FAULT(kind) fault_hits(kind)
#define FAULT_POINT(name) fault_point(name)
#else
#define FAULT(kind) 0
#define FAULT_POINT(name) ((void)0)
#endif

#endif
