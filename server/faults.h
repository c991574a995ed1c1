/* Points at which a test build (ORB_FAULTS) ends the process as kill -9 would.
 *
 * ORBMORPH_FAULT="kill:NAME:2" ends it at the second pass of that point, "kill:NAME:1+" at each. A job's key is the
 * name of the point at which its run begins, so that a test can make a job that kills whoever runs it. Release builds
 * have none of this. Failing calls are injected from outside: tests/faults.
 */
#ifndef ORB_FAULTS_H
#define ORB_FAULTS_H

#ifdef ORB_FAULTS
void fault_point(const char *name);
#define FAULT_POINT(name) fault_point(name)
#else
#define FAULT_POINT(name) ((void)0)
#endif

#endif
