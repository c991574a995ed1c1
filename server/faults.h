/* Fault injection: points at which a test build (ORB_FAULTS) kills its own process with SIGKILL.
 *
 * ORBMORPH_FAULT="kill:NAME:2" kills it at the second pass of point NAME, "kill:NAME:1+" at every pass. The start of a
 * job's run is a point named after its key, so that a test can make a job that kills every process that runs it.
 * Release builds contain no such points. Failing system calls are injected from outside: tests/faults.
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
